//! Binding of the scan of histogram intersections.

use std::cell::Cell;

use numpy::{
    Element, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::arrays::{borrowed, list, output, release};
use super::errors::{format_shape, wrong_type};
use super::scalars::{pair, whole};
use super::scratch;
use crate::error::Error;
use crate::scan::{Scan, Workspace};
use crate::shape::Shape;

thread_local! {
    static WORKSPACE: Cell<Workspace> = Cell::default();
}

/// Scores of all windows of an image of bin indices.
#[pyfunction]
#[pyo3(signature = (bins, target, window, stride, wanted, out, /))]
pub fn intersections<'py>(
    py: Python<'py>,
    bins: &Bound<'py, PyAny>,
    target: &Bound<'py, PyAny>,
    window: &Bound<'py, PyAny>,
    stride: &Bound<'py, PyAny>,
    wanted: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let target: Vec<f32> = list("target", target)?.into_iter().map(|share| share as f32).collect();
    let window = pair("window", "(height, width)", window)?;
    let stride = usize::try_from(whole("stride", stride, 1)?).unwrap_or(usize::MAX);
    let (indices, image) = indices(bins)?;
    let mut scan = Scan { target: &target, window, stride, wanted: None };
    let places = scan.places(image)?;
    let mask = wanted.map(|wanted| mask(wanted, places)).transpose()?;
    scan.wanted = mask.as_ref().map(|mask| mask.as_slice()).transpose()?;
    let inputs: Vec<_> = [Some(bins), wanted].into_iter().flatten().collect();
    let mut scores = output("out", out, places, &inputs, py)?;
    let pixels = scores.as_slice_mut()?;
    scratch::with(&WORKSPACE, image.pixels(), |workspace| match &indices {
        Indices::Bytes(bins) => {
            let bins = bins.as_slice()?;
            Ok::<_, PyErr>(py.detach(|| scan.run(bins, image, workspace, pixels))?)
        }
        Indices::Words(bins) => {
            let bins = bins.as_slice()?;
            Ok(py.detach(|| scan.run(bins, image, workspace, pixels))?)
        }
    })?;
    Ok(release(scores))
}

/// A borrowed image of indices.
enum Indices<'py> {
    Bytes(PyReadonlyArray2<'py, u8>),
    Words(PyReadonlyArray2<'py, u16>),
}

fn indices<'py>(object: &Bound<'py, PyAny>) -> PyResult<(Indices<'py>, Shape)> {
    let expected = "an array (H, W) of uint8 or uint16";
    let Ok(array) = object.cast::<PyUntypedArray>() else {
        return Err(wrong_type("bins", expected, object));
    };
    let dtype = array.dtype();
    if dtype.kind() != b'u' || dtype.itemsize() > 2 {
        return Err(wrong_type("bins", expected, object));
    }
    let &[height, width] = array.shape() else {
        return Err(Error::shape("bins", "(H, W)", format_shape(array.shape())).into());
    };
    let shape = Shape::new(height, width).map_err(|e| e.renamed(|_| "bins".into()))?;
    let indices = match dtype.itemsize() {
        1 => Indices::Bytes(in_order("bins", array)?),
        _ => Indices::Words(in_order("bins", array)?),
    };
    Ok((indices, shape))
}

fn mask<'py>(object: &Bound<'py, PyAny>, places: Shape) -> PyResult<PyReadonlyArray2<'py, bool>> {
    let expected = format!("a bool array of shape ({}, {})", places.height(), places.width());
    match object.cast::<PyUntypedArray>() {
        Ok(array) if array.dtype().kind() == b'b' => {
            if array.shape() != [places.height(), places.width()] {
                return Err(Error::shape("wanted", expected, format_shape(array.shape())).into());
            }
            in_order("wanted", array)
        }
        _ => Err(wrong_type("wanted", expected, object)),
    }
}

/// The array itself if it can be read as one slice in C order, else a copy that can.
fn in_order<'py, T: Element>(
    argument: &'static str,
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<PyReadonlyArray2<'py, T>> {
    if let Some(array) = borrowed::<T>(argument, array.as_any())? {
        return Ok(array);
    }
    let dtype = numpy::dtype::<T>(array.py());
    let copy = array.call_method1("astype", (dtype, "C", "unsafe", false))?;
    Ok(copy.cast_into::<PyArray2<T>>()?.try_readonly()?)
}
