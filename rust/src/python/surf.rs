//! Binding of SURF.

use std::cell::Cell;

use numpy::ndarray::Ix2;
use numpy::{PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{empty, release};
use super::errors::format_shape;
use super::plain::{mask, plain, shape_of};
use super::scalars::{flag, real, whole};
use super::scratch;
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
    let gray = plain::<u8, Ix2>("gray", "an array (H, W) of uint8", "(H, W)", gray)?;
    let shape = shape_of("gray", gray.shape())?;
    let expected = || format!("of the image's shape {}", format_shape(gray.shape()));
    let mask = mask.map(|object| self::mask("mask", expected, shape, object)).transpose()?;
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
