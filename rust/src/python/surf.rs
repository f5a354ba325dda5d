//! Binding of SURF.

use std::cell::Cell;

use numpy::{
    Element, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::arrays::{borrowed, empty, release};
use super::errors::{format_shape, wrong_type};
use super::scalars::{flag, real, whole};
use super::scratch;
use crate::error::Error;
use crate::shape::Shape;
use crate::surf::{Surf, Workspace};

thread_local! {
    static WORKSPACE: Cell<Workspace> = Cell::default();
}

/// Integral images of 4 bytes that are kept for a pixel.
const PLANES: usize = 4;

type Features<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<i32>>, Bound<'py, PyArray2<f32>>);

/// Keypoints (u, v, size, angle, response), their (octave, laplacian), and their descriptors.
#[pyfunction]
#[pyo3(signature = (gray, mask, hessian_threshold, octaves, layers, upright, extended, threads, /))]
#[expect(clippy::too_many_arguments, reason = "the parameters of the method")]
pub fn surf<'py>(
    py: Python<'py>,
    gray: &Bound<'py, PyAny>,
    mask: Option<&Bound<'py, PyAny>>,
    hessian_threshold: &Bound<'py, PyAny>,
    octaves: &Bound<'py, PyAny>,
    layers: &Bound<'py, PyAny>,
    upright: &Bound<'py, PyAny>,
    extended: &Bound<'py, PyAny>,
    threads: Option<&Bound<'py, PyAny>>,
) -> PyResult<Features<'py>> {
    let surf = Surf::new(
        real("hessian_threshold", hessian_threshold)?,
        count("octaves", octaves)?,
        count("layers", layers)?,
        flag("upright", upright)?,
        flag("extended", extended)?,
    )?;
    let threads = threads.map_or(Ok(usize::MAX), |threads| count("threads", threads))?;
    let gray = plain::<u8>("gray", "an array (H, W) of uint8", gray)?;
    let shape = shape_of("gray", &gray)?;
    let mask = mask.map(|mask| plain::<bool>("mask", "an array (H, W) of bool", mask)).transpose()?;
    if let Some(mask) = &mask
        && mask.shape() != gray.shape()
    {
        let expected = format!("of the image's shape {}", format_shape(gray.shape()));
        return Err(Error::shape("mask", expected, format_shape(mask.shape())).into());
    }
    let pixels = gray.as_slice()?;
    let mask = mask.as_ref().map(|mask| mask.as_slice()).transpose()?;
    let found = scratch::with(&WORKSPACE, shape.pixels().saturating_mul(PLANES), |workspace| {
        py.detach(|| surf.detect(pixels, mask, shape, threads, workspace))
    })?;
    let count = found.keypoints.len();
    let (mut numbers, mut signs) = (empty::<f32>(py, [count, 5])?, empty::<i32>(py, [count, 2])?);
    let rows = numbers.as_slice_mut()?.as_chunks_mut::<5>().0.iter_mut();
    let rows = rows.zip(signs.as_slice_mut()?.as_chunks_mut::<2>().0);
    for ((numbers, signs), k) in rows.zip(&found.keypoints) {
        *numbers = [k.u, k.v, k.size, k.angle, k.response];
        *signs = [k.octave, k.laplacian];
    }
    let mut descriptors = empty::<f32>(py, [count, surf.numbers()])?;
    descriptors.as_slice_mut()?.copy_from_slice(&found.descriptors);
    Ok((release(numbers), release(signs), release(descriptors)))
}

/// A number of which more than an address can hold is as wrong as the largest that it can.
fn count(argument: &'static str, object: &Bound<'_, PyAny>) -> PyResult<usize> {
    Ok(usize::try_from(whole(argument, object, 1)?).unwrap_or(usize::MAX))
}

/// Borrows an array of exactly this type, or a copy in C order.
fn plain<'py, T: Element>(
    argument: &'static str,
    expected: &'static str,
    object: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray2<'py, T>> {
    let Ok(array) = object.cast::<PyUntypedArray>() else {
        return Err(wrong_type(argument, expected, object));
    };
    if !array.dtype().is_equiv_to(&numpy::dtype::<T>(object.py())) {
        return Err(wrong_type(argument, expected, object));
    }
    if !array.is_exact_instance_of::<PyUntypedArray>() && array.hasattr("mask")? {
        return Err(wrong_type(argument, "an array without a mask", object));
    }
    if array.ndim() != 2 {
        return Err(Error::shape(argument, "(H, W)", format_shape(array.shape())).into());
    }
    if let Some(array) = borrowed::<T>(argument, object)? {
        return Ok(array);
    }
    let copy = object.call_method1("copy", ("C",))?.cast_into::<PyArray2<T>>()?;
    Ok(copy.try_readonly()?)
}

fn shape_of<T: Element>(argument: &'static str, array: &PyReadonlyArray2<'_, T>) -> PyResult<Shape> {
    let [height, width] = [array.shape()[0], array.shape()[1]];
    Ok(Shape::new(height, width).map_err(|error| error.renamed(|_| argument.into()))?)
}
