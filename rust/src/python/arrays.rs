//! NumPy arrays: small ones are copied to float64, images are borrowed, outputs are borrowed for writing.
//!
//! A borrowed image is C-contiguous, aligned and in native byte order, whatever it was given as: anything
//! else is copied first. Note that "contiguous" of the `numpy` crate means C *or* Fortran order.

use std::ops::Range;

use numpy::ndarray::{Dimension, IntoDimension};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArray,
    PyReadonlyArray2, PyReadwriteArray, PyReadwriteArray2, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyInt, PyList, PyTuple};

use super::errors::{format_shape, wrong_type};
use super::pool;
use crate::error::{Argument, Error};
use crate::shape::Shape;

/// Numbers of a small argument, row-major, and their shape.
pub struct Numbers {
    pub values: Vec<f64>,
    pub shape: Vec<usize>,
}

/// Reads a small argument: an array of float32 or float64, or plain (nested) lists of numbers.
pub fn numbers(argument: impl Into<Argument>, object: &Bound<'_, PyAny>) -> PyResult<Numbers> {
    let argument = argument.into();
    if let Ok(array) = object.cast::<PyUntypedArray>() {
        return floats(argument, array);
    }
    let plain = object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>();
    if plain && let Some(values) = flat(object) {
        return Ok(Numbers { shape: vec![values.len()], values });
    }
    static ASARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let expected = "an array of float32 or float64, or lists of numbers";
    let asarray = ASARRAY.import(object.py(), "numpy", "asarray")?;
    let array = asarray.call1((object,)).map_err(|_| wrong_type(argument.clone(), expected, object))?;
    let array =
        array.cast_into::<PyUntypedArray>().map_err(|_| wrong_type(argument.clone(), expected, object))?;
    match array.dtype().kind() {
        b'f' => floats(argument, &array),
        // Whole numbers in a Python list are still numbers; an integer array is a decision, and an error.
        b'i' | b'u' if plain => copied(&array),
        _ => Err(wrong_type(argument, expected, object)),
    }
}

/// A list or tuple that holds nothing but floats and ints.
fn flat(object: &Bound<'_, PyAny>) -> Option<Vec<f64>> {
    fn number(item: &Bound<'_, PyAny>) -> Option<f64> {
        if let Ok(float) = item.cast::<PyFloat>() {
            return Some(float.value());
        }
        item.cast_exact::<PyInt>().ok()?.extract().ok()
    }
    if let Ok(tuple) = object.cast::<PyTuple>() {
        return tuple.iter().map(|item| number(&item)).collect();
    }
    object.cast::<PyList>().ok()?.iter().map(|item| number(&item)).collect()
}

fn floats(argument: Argument, array: &Bound<'_, PyUntypedArray>) -> PyResult<Numbers> {
    check_float(&argument, array)?;
    if array.is_c_contiguous() && array.is_aligned() {
        let shape = array.shape().to_vec();
        if let Ok(array) = array.cast::<PyArrayDyn<f64>>() {
            let array = array.try_readonly().map_err(|_| busy(argument))?;
            return Ok(Numbers { values: array.as_slice()?.to_vec(), shape });
        }
        if let Ok(array) = array.cast::<PyArrayDyn<f32>>() {
            let array = array.try_readonly().map_err(|_| busy(argument))?;
            let values = array.as_slice()?.iter().map(|&x| f64::from(x)).collect();
            return Ok(Numbers { values, shape });
        }
    }
    copied(array)
}

/// Checks for float32 or float64 of either byte order.
fn check_float(argument: &Argument, array: &Bound<'_, PyUntypedArray>) -> PyResult<()> {
    let dtype = array.dtype();
    if dtype.kind() != b'f' || !matches!(dtype.itemsize(), 4 | 8) {
        let expected = "an array of float32 or float64";
        return Err(wrong_type(argument.clone(), expected, array.as_any()));
    }
    if !array.is_exact_instance_of::<PyUntypedArray>() && array.hasattr("mask")? {
        let expected = "an array without a mask";
        return Err(wrong_type(argument.clone(), expected, array.as_any()));
    }
    Ok(())
}

/// A copy in float64, native, aligned and in C order.
fn copied(array: &Bound<'_, PyUntypedArray>) -> PyResult<Numbers> {
    let copy = native::<f64>(array)?;
    let shape = array.shape().to_vec();
    let copy = copy.cast_into::<PyArrayDyn<f64>>().map_err(PyErr::from)?;
    let values = copy.try_readonly().map_err(PyErr::from)?.as_slice()?.to_vec();
    Ok(Numbers { values, shape })
}

fn native<'py, T: Element>(array: &Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyAny>> {
    let dtype = numpy::dtype::<T>(array.py());
    // astype(dtype, order, casting, subok): always a new array, and a plain one.
    array.call_method1("astype", (dtype, "C", "unsafe", false))
}

/// Rows of a fixed number of numbers, for points and their widths.
pub fn rows<const N: usize>(
    argument: impl Into<Argument>,
    object: &Bound<'_, PyAny>,
) -> PyResult<Vec<[f64; N]>> {
    let argument = argument.into();
    let Numbers { values, shape } = numbers(argument.clone(), object)?;
    if shape.len() != 2 || shape[1] != N {
        return Err(Error::shape(argument, format!("(N, {N})"), format_shape(&shape)).into());
    }
    Ok(values.as_chunks().0.to_vec())
}

/// A vector of a fixed size.
pub fn vector<const N: usize>(
    argument: impl Into<Argument>,
    object: &Bound<'_, PyAny>,
) -> PyResult<[f64; N]> {
    let argument = argument.into();
    let Numbers { values, shape } = numbers(argument.clone(), object)?;
    match values.try_into() {
        Ok(values) if shape.len() == 1 => Ok(values),
        _ => Err(Error::shape(argument, format!("({N},)"), format_shape(&shape)).into()),
    }
}

/// A vector of any size.
pub fn list(argument: impl Into<Argument>, object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let argument = argument.into();
    let Numbers { values, shape } = numbers(argument.clone(), object)?;
    if shape.len() != 1 {
        return Err(Error::shape(argument, "(N,)", format_shape(&shape)).into());
    }
    Ok(values)
}

/// A borrowed image.
pub enum Image<'py> {
    Single(PyReadonlyArray2<'py, f32>),
    Double(PyReadonlyArray2<'py, f64>),
}

/// Borrows a landscape of float32 or float64.
pub fn image<'py>(argument: &'static str, object: &Bound<'py, PyAny>) -> PyResult<(Image<'py>, Shape)> {
    let expected = "an array (H, W) of float32 or float64";
    let Ok(array) = object.cast::<PyUntypedArray>() else {
        return Err(wrong_type(argument, expected, object));
    };
    check_float(&argument.into(), array)?;
    let &[height, width] = array.shape() else {
        return Err(Error::shape(argument, "(H, W)", format_shape(array.shape())).into());
    };
    let shape = Shape::new(height, width).map_err(|e| e.renamed(|_| argument.into()))?;
    if let Some(array) = borrowed::<f32, _>(argument, object)? {
        return Ok((Image::Single(array), shape));
    }
    if let Some(array) = borrowed::<f64, _>(argument, object)? {
        return Ok((Image::Double(array), shape));
    }
    let image = if array.dtype().itemsize() == 4 {
        let copy = native::<f32>(array)?.cast_into::<PyArray2<f32>>()?;
        Image::Single(copy.try_readonly()?)
    } else {
        let copy = native::<f64>(array)?.cast_into::<PyArray2<f64>>()?;
        Image::Double(copy.try_readonly()?)
    };
    Ok((image, shape))
}

/// The array itself if it has this type and can be read as one slice in C order.
pub fn borrowed<'py, T: Element, D: Dimension>(
    argument: &'static str,
    object: &Bound<'py, PyAny>,
) -> PyResult<Option<PyReadonlyArray<'py, T, D>>> {
    match object.cast::<PyArray<T, D>>() {
        Ok(array) if array.is_c_contiguous() && array.is_aligned() => {
            Ok(Some(array.try_readonly().map_err(|_| busy(argument))?))
        }
        _ => Ok(None),
    }
}

/// The array to write a landscape to: the caller's or a new one, in either case not yet initialised.
pub fn output<'py>(
    argument: impl Into<Argument>,
    out: Option<&Bound<'py, PyAny>>,
    shape: Shape,
    inputs: &[&Bound<'py, PyAny>],
    py: Python<'py>,
) -> PyResult<PyReadwriteArray2<'py, f32>> {
    match out {
        None => pool::landscape(py, shape),
        Some(out) => writable(argument, out, &[shape.height(), shape.width()], inputs),
    }
}

/// Borrows the caller's array to write to: of this dtype and shape, and apart from the inputs in memory.
pub fn writable<'py, T: Element, D: Dimension>(
    argument: impl Into<Argument>,
    out: &Bound<'py, PyAny>,
    shape: &[usize],
    inputs: &[&Bound<'py, PyAny>],
) -> PyResult<PyReadwriteArray<'py, T, D>> {
    let argument = argument.into();
    let dtype = numpy::dtype::<T>(out.py());
    let expected = || format!("a writable C-contiguous {dtype} array of shape {}", format_shape(shape));
    let wrong =
        |found: &str| -> PyErr { Error::shape(argument.clone(), expected(), found.to_owned()).into() };
    let Ok(untyped) = out.cast::<PyUntypedArray>() else {
        return Err(wrong_type(argument.clone(), expected(), out));
    };
    let Ok(array) = out.cast::<PyArray<T, D>>() else {
        if untyped.dtype().is_equiv_to(&dtype) {
            return Err(wrong(&format_shape(untyped.shape())));
        }
        return Err(wrong_type(argument.clone(), expected(), out));
    };
    if array.shape() != shape {
        return Err(wrong(&format_shape(array.shape())));
    }
    if !(array.is_c_contiguous() && array.is_aligned()) {
        return Err(wrong("one that is not contiguous in C order"));
    }
    let memory = extent(array);
    for input in inputs {
        if overlaps(out, &memory, input)? {
            return Err(Error::conflict(argument.clone(), "overlaps an input in memory").into());
        }
    }
    match array.try_readwrite() {
        Ok(array) => Ok(array),
        Err(numpy::BorrowError::NotWriteable) => Err(wrong("one that is read-only")),
        Err(_) => Err(busy(argument.clone())),
    }
}

/// Whether an input lies in memory between the first and the last byte of the output.
fn overlaps(out: &Bound<'_, PyAny>, memory: &Range<usize>, input: &Bound<'_, PyAny>) -> PyResult<bool> {
    let other = if let Ok(array) = input.cast::<PyArrayDyn<f64>>() {
        extent(array)
    } else if let Ok(array) = input.cast::<PyArrayDyn<f32>>() {
        extent(array)
    } else if input.is_instance_of::<PyUntypedArray>() {
        static SHARE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let share = SHARE.import(input.py(), "numpy", "may_share_memory")?;
        return share.call1((out, input))?.is_truthy();
    } else {
        return Ok(false);
    };
    Ok(memory.start < other.end && other.start < memory.end)
}

/// The addresses from an array's first byte to its last.
fn extent<T: Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>) -> Range<usize> {
    let (mut first, mut last) = (array.data() as usize, array.data() as usize);
    for (&size, &stride) in array.shape().iter().zip(array.strides()) {
        if size == 0 {
            return first..first;
        }
        let reach = (size - 1) * stride.unsigned_abs();
        if stride < 0 { first -= reach } else { last += reach }
    }
    first..last + size_of::<T>()
}

/// A new float32 array of any rank. Small ones take the short way to NumPy, which has no `MemoryError`.
pub fn created<'py, I: IntoDimension>(
    py: Python<'py>,
    shape: I,
) -> PyResult<Bound<'py, PyArray<f32, I::Dim>>> {
    const SMALL: usize = 1 << 14;
    let shape = shape.into_dimension();
    if shape.size_checked().is_some_and(|size| size <= SMALL) {
        return Ok(PyArray::zeros(py, shape, false));
    }
    Ok(numpy_empty::<f32>(py, PyTuple::new(py, shape.slice())?)?.cast_into()?)
}

/// A new array. NumPy allocates it, so that a lack of memory is Python's `MemoryError`.
pub fn empty<'py, T: Element>(py: Python<'py>, shape: [usize; 2]) -> PyResult<PyReadwriteArray2<'py, T>> {
    let array = numpy_empty::<T>(py, (shape[0], shape[1]))?;
    Ok(array.cast_into::<PyArray2<T>>()?.try_readwrite()?)
}

fn numpy_empty<'py, T: Element>(
    py: Python<'py>,
    shape: impl IntoPyObject<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    static EMPTY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    EMPTY.import(py, "numpy", "empty")?.call1((shape, numpy::dtype::<T>(py)))
}

/// The array behind a borrow, which ends here.
pub fn release<T: Element>(array: PyReadwriteArray2<'_, T>) -> Bound<'_, PyArray2<T>> {
    (**array).clone()
}

/// A new vector.
pub fn vector_array<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, values)
}

fn busy(argument: impl Into<Argument>) -> PyErr {
    Error::Busy { argument: argument.into() }.into()
}
