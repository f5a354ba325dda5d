//! Inputs of one exact type, such as images of bytes and masks: borrowed, or copied where they are not in order.

use numpy::ndarray::Dimension;
use numpy::{
    Element, PyArray, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::arrays::borrowed;
use super::errors::{format_shape, wrong_type};
use crate::error::Error;
use crate::shape::Shape;

/// Borrows an array of exactly this type, in either byte order, or a copy in C order.
///
/// `expected` says which type; `axes` which shape, such as `(H, W)`.
pub fn plain<'py, T: Element, D: Dimension>(
    argument: &'static str,
    expected: &'static str,
    axes: &'static str,
    object: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    let Ok(array) = object.cast::<PyUntypedArray>() else {
        return Err(wrong_type(argument, expected, object));
    };
    let (given, dtype) = (array.dtype(), numpy::dtype::<T>(object.py()));
    if (given.kind(), given.itemsize()) != (dtype.kind(), dtype.itemsize()) {
        return Err(wrong_type(argument, expected, object));
    }
    if !array.is_exact_instance_of::<PyUntypedArray>() && array.hasattr("mask")? {
        return Err(wrong_type(argument, "an array without a mask", object));
    }
    if D::NDIM.is_some_and(|rank| array.ndim() != rank) {
        return Err(Error::shape(argument, axes, format_shape(array.shape())).into());
    }
    if let Some(array) = borrowed::<T, D>(argument, object)? {
        return Ok(array);
    }
    // astype(dtype, order, casting, subok), also from the other byte order.
    let copy = object.call_method1("astype", (dtype, "C", "unsafe", false))?.cast_into::<PyArray<T, D>>()?;
    Ok(copy.try_readonly()?)
}

/// Borrows a mask (H, W) of exactly this shape.
pub fn mask<'py>(
    argument: &'static str,
    expected: impl FnOnce() -> String,
    shape: Shape,
    object: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray2<'py, bool>> {
    let mask = plain::<bool, _>(argument, "an array (H, W) of bool", "(H, W)", object)?;
    if mask.shape() != [shape.height(), shape.width()] {
        return Err(Error::shape(argument, expected(), format_shape(mask.shape())).into());
    }
    Ok(mask)
}

/// Height and width of an image, (H, W) or (H, W, channels).
pub fn shape_of(argument: &'static str, sides: &[usize]) -> PyResult<Shape> {
    Ok(Shape::new(sides[0], sides[1]).map_err(|error| error.renamed(|_| argument.into()))?)
}
