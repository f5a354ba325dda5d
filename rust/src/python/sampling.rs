//! Bindings of the two samplers.

use std::cell::Cell;

use numpy::ndarray::Ix2;
use numpy::{PyArray2, PyReadwriteArray2};
use pyo3::prelude::*;
use pyo3::types::PySlice;

use super::arrays::{Image, empty, image, release, writable};
use super::scalars::{pair, real, whole};
use super::scratch;
use crate::error::Error;
use crate::gibbs::{Gibbs, Schedule};
use crate::masses::{Landscape, Masses};
use crate::rng::Xoshiro256PlusPlus;
use crate::sample::{self as kernel, Workspace};
use crate::shape::Shape;
use crate::simd::Simd;
use crate::threshold::check_pixels;

/// Sweeps between two looks at pending signals, so that Ctrl-C ends a long chain.
const SWEEPS: u64 = 1 << 14;

thread_local! {
    static MASSES: Cell<Masses> = Cell::default();
    static WORKSPACE: Cell<Workspace> = Cell::default();
}

/// Pixels (u, v) drawn from the landscape by Gibbs sampling.
#[expect(clippy::too_many_arguments, reason = "they are the arguments of the Python function")]
#[pyfunction]
#[pyo3(signature = (landscape, n, seed, start, burn_in, thin, out, /))]
pub fn gibbs_sample<'py>(
    py: Python<'py>,
    landscape: &Bound<'py, PyAny>,
    n: &Bound<'py, PyAny>,
    seed: u64,
    start: Option<&Bound<'py, PyAny>>,
    burn_in: &Bound<'py, PyAny>,
    thin: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let n = number(n)?;
    let mut schedule = Schedule::new(whole("burn_in", burn_in, 0)?, whole("thin", thin, 1)?);
    let start = match start {
        Some(start) => Some(pair("start", "(u, v)", start)?),
        None => None,
    };
    let (image, shape) = image("landscape", landscape)?;
    let mut places = room(py, n, out, landscape)?;
    let mut left = places.as_slice_mut()?;
    let mut rng = Xoshiro256PlusPlus::new(seed);
    let mut converted = Vec::new();
    let pixels = singles(&image, shape, &mut converted)?;
    scratch::with(&MASSES, shape.pixels(), |masses| {
        let mut chain = py.detach(|| {
            let landscape = Landscape { pixels, shape, support: None };
            let mut chain = Gibbs::new(Simd::best(), landscape, masses)?;
            match start {
                Some(start) => chain.start_at(start)?,
                None => chain.start_drawn(&mut rng),
            }
            Ok::<_, Error>(chain)
        })?;
        while !left.is_empty() {
            let kept = py.detach(|| chain.run(&mut rng, SWEEPS, &mut schedule, left));
            left = &mut left[2 * kept..];
            py.check_signals()?;
        }
        Ok::<_, PyErr>(())
    })?;
    Ok(release(places))
}

/// Pixels (u, v) drawn from the landscape independently of each other.
#[pyfunction]
#[pyo3(signature = (landscape, n, seed, min_distance, out, /))]
pub fn sample<'py>(
    py: Python<'py>,
    landscape: &Bound<'py, PyAny>,
    n: &Bound<'py, PyAny>,
    seed: u64,
    min_distance: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let n = number(n)?;
    let min_distance = real("min_distance", min_distance)?;
    let (image, shape) = image("landscape", landscape)?;
    let mut places = room(py, n, out, landscape)?;
    let pixels = places.as_slice_mut()?;
    let mut converted = Vec::new();
    let landscape = Landscape { pixels: singles(&image, shape, &mut converted)?, shape, support: None };
    let mut rng = Xoshiro256PlusPlus::new(seed);
    let drawn = scratch::with(&WORKSPACE, shape.pixels(), |workspace| {
        py.detach(|| kernel::sample(Simd::best(), landscape, min_distance, &mut rng, workspace, pixels))
    })?;
    let places = release(places).into_any();
    if drawn == n { Ok(places) } else { places.get_item(PySlice::new(py, 0, drawn as isize, 1)) }
}

/// A number of samples.
fn number(n: &Bound<'_, PyAny>) -> PyResult<usize> {
    let n = whole("n", n, 0)?;
    if n > i32::MAX as u64 {
        return Err(Error::scalar("n", "at most 2147483647", n).into());
    }
    Ok(n as usize)
}

/// The caller's array for n pixels, or a new one.
fn room<'py>(
    py: Python<'py>,
    n: usize,
    out: Option<&Bound<'py, PyAny>>,
    landscape: &Bound<'py, PyAny>,
) -> PyResult<PyReadwriteArray2<'py, i32>> {
    match out {
        Some(out) => writable::<i32, Ix2>("out", out, &[n, 2], &[landscape]),
        None => empty(py, [n, 2]),
    }
}

/// The pixels in float32.
fn singles<'a>(image: &'a Image<'_>, shape: Shape, converted: &'a mut Vec<f32>) -> PyResult<&'a [f32]> {
    match image {
        Image::Single(array) => Ok(array.as_slice()?),
        Image::Double(array) => {
            // Checked before the conversion, which turns what is too small into zero.
            let pixels = array.as_slice()?;
            check_pixels(pixels, shape)?;
            converted.extend(pixels.iter().map(|&p| p as f32));
            if let Some(at) = converted.iter().position(|p| p.is_infinite()) {
                let index = [at / shape.width(), at % shape.width()];
                return Err(Error::element("landscape", &index, "finite in float32", pixels[at]).into());
            }
            Ok(converted)
        }
    }
}
