//! Binding of the scan of histogram intersections.

use std::cell::Cell;

use numpy::{PyArray2, PyArrayDescrMethods, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{list, output, release};
use super::errors::wrong_type;
use super::plain::{mask, plain, shape_of};
use super::scalars::{pair, whole};
use super::scratch;
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
    let target = shares(target)?;
    let window = pair("window", "(height, width)", window)?;
    let stride = usize::try_from(whole("stride", stride, 1)?).unwrap_or(usize::MAX);
    let (indices, image) = indices(bins)?;
    let mut scan = Scan { target: &target, window, stride, wanted: None };
    let places = scan.places(image)?;
    let expected = || format!("a bool array of shape ({}, {})", places.height(), places.width());
    let mask = wanted.map(|wanted| mask("wanted", expected, places, wanted)).transpose()?;
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

/// A target's share of each bin.
pub fn shares(target: &Bound<'_, PyAny>) -> PyResult<Vec<f32>> {
    Ok(list("target", target)?.into_iter().map(|share| share as f32).collect())
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
    let indices = if array.dtype().itemsize() == 1 {
        Indices::Bytes(plain("bins", expected, "(H, W)", object)?)
    } else {
        Indices::Words(plain("bins", expected, "(H, W)", object)?)
    };
    Ok((indices, shape_of("bins", array.shape())?))
}
