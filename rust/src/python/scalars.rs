//! Python numbers, one at a time.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyFloat, PyInt, PyList, PyString, PyTuple, PyType};

use super::errors::wrong_type;
use crate::error::{Error, Result};
use crate::shape::Shape;

/// A real number: float, int or a NumPy scalar of either; never bool, text or an array.
pub fn real(argument: &'static str, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    if let Ok(float) = object.cast::<PyFloat>() {
        return Ok(float.value());
    }
    static REAL: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let class = REAL.import(object.py(), "numbers", "Real")?;
    if !object.is_instance_of::<PyBool>() && object.is_instance(class)? {
        // An int too large for a float overflows here.
        return object
            .extract()
            .map_err(|_| Error::scalar(argument, "a number within float64", object).into());
    }
    Err(wrong_type(argument, "a number", object))
}

/// A whole number of at least `low`.
pub fn whole(argument: &'static str, object: &Bound<'_, PyAny>, low: u64) -> PyResult<u64> {
    if object.is_instance_of::<PyBool>() {
        return Err(wrong_type(argument, "a whole number", object));
    }
    let index = match object.cast::<PyInt>() {
        Ok(int) => int.clone().into_any(),
        Err(_) => {
            object.call_method0("__index__").map_err(|_| wrong_type(argument, "a whole number", object))?
        }
    };
    match index.extract::<u64>() {
        Ok(value) if value >= low => Ok(value),
        _ => {
            let expected = format!("a whole number of at least {low} and below 2^64");
            Err(Error::scalar(argument, expected, object).into())
        }
    }
}

/// True or false, of Python or of NumPy.
pub fn flag(argument: &'static str, object: &Bound<'_, PyAny>) -> PyResult<bool> {
    object.extract().map_err(|_| wrong_type(argument, "True or False", object))
}

/// Two whole numbers, as a tuple or list.
pub fn pair(
    argument: &'static str,
    expected: &'static str,
    object: &Bound<'_, PyAny>,
) -> PyResult<[usize; 2]> {
    let items: Vec<Bound<'_, PyAny>> = if let Ok(tuple) = object.cast::<PyTuple>() {
        tuple.iter().collect()
    } else if let Ok(list) = object.cast::<PyList>() {
        list.iter().collect()
    } else {
        return Err(wrong_type(argument, expected, object));
    };
    let [first, second] = items.as_slice() else {
        return Err(Error::shape(argument, expected, format!("{object:?}")).into());
    };
    let size = |item| -> PyResult<usize> {
        let value = whole(argument, item, 0)?;
        // Beyond the address space it is outside every image, like the largest index.
        Ok(usize::try_from(value).unwrap_or(usize::MAX))
    };
    Ok([size(first)?, size(second)?])
}

/// The size of an image.
pub fn shape(object: &Bound<'_, PyAny>) -> PyResult<Shape> {
    let [height, width] = pair("shape", "(height, width)", object)?;
    Ok(Shape::new(height, width)?)
}

/// A name among the known ones.
pub fn name<T>(
    argument: &'static str,
    object: &Bound<'_, PyAny>,
    named: impl FnOnce(&str) -> Result<T>,
) -> PyResult<T> {
    let text = object.cast::<PyString>().map_err(|_| wrong_type(argument, "a name", object))?;
    Ok(named(&text.to_string_lossy())?)
}
