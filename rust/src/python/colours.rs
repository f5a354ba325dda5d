//! Binding of the colour histograms: bins of pixels, windows of an image that is not yet converted, and hits.

use std::cell::Cell;

use numpy::ndarray::{Ix1, Ix2, Ix3};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{created, empty, release, writable};
use super::errors::format_shape;
use super::plain::{plain, shape_of};
use super::scalars::{pair, real, whole};
use super::scan::shares;
use super::scratch;
use crate::colours::Colours;
use crate::error::Error;
use crate::scan::merge::{Hull, merge_corners, merge_scores};
use crate::scan::{Picture, Scan, WindowSpace};
use crate::shape::Shape;
use crate::simd::Simd;

thread_local! {
    static SPACE: Cell<WindowSpace> = Cell::default();
}

/// The bin of hue and saturation of every pixel.
#[pyfunction]
#[pyo3(signature = (rgb, bins, min_saturation, min_value, out, /))]
pub fn hue_saturation_bins<'py>(
    py: Python<'py>,
    rgb: &Bound<'py, PyAny>,
    bins: &Bound<'py, PyAny>,
    min_saturation: &Bound<'py, PyAny>,
    min_value: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArray2<u16>>> {
    let colours = colours(bins, min_saturation, min_value)?;
    let (image, shape) = image(rgb)?;
    let sides = [shape.height(), shape.width()];
    let mut found = match out {
        Some(out) => writable::<u16, Ix2>("out", out, &sides, &[rgb])?,
        None => empty::<u16>(py, sides)?,
    };
    let (pixels, written) = (image.as_slice()?, found.as_slice_mut()?);
    py.detach(|| colours.bins(Simd::best(), pixels, written))?;
    Ok(release(found))
}

/// Scores of some windows of an RGB image, by their upper left pixels.
#[pyfunction]
#[pyo3(signature = (rgb, corners, target, window, bins, min_saturation, min_value, /))]
#[expect(clippy::too_many_arguments, reason = "the parameters of the method")]
pub fn window_intersections<'py>(
    py: Python<'py>,
    rgb: &Bound<'py, PyAny>,
    corners: &Bound<'py, PyAny>,
    target: &Bound<'py, PyAny>,
    window: &Bound<'py, PyAny>,
    bins: &Bound<'py, PyAny>,
    min_saturation: &Bound<'py, PyAny>,
    min_value: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let colours = colours(bins, min_saturation, min_value)?;
    let target = shares(target)?;
    let window = pair("window", "(height, width)", window)?;
    let (image, shape) = image(rgb)?;
    let corners = corners_of("corners", corners)?;
    let corners = corners.as_slice()?.as_chunks::<2>().0;
    let scan = Scan { target: &target, window, stride: 1, wanted: None };
    let scores = created(py, Ix1(corners.len()))?;
    let mut written = scores.try_readwrite()?;
    let picture = Picture { rgb: image.as_slice()?, shape, colours };
    let out = written.as_slice_mut()?;
    scratch::with(&SPACE, shape.pixels(), |space| {
        py.detach(|| scan.windows(Simd::best(), picture, corners, space, out))
    })?;
    drop(written);
    Ok(scores)
}

/// Boxes around groups of windows that are near each other and reach a score, by the windows' centres: their scores and their
/// merging in one call.
#[pyfunction]
#[pyo3(signature = (rgb, centres, target, size, hit, gap, bins, min_saturation, min_value, /))]
#[expect(clippy::too_many_arguments, reason = "the parameters of the method")]
pub fn window_hits<'py>(
    py: Python<'py>,
    rgb: &Bound<'py, PyAny>,
    centres: &Bound<'py, PyAny>,
    target: &Bound<'py, PyAny>,
    size: &Bound<'py, PyAny>,
    hit: &Bound<'py, PyAny>,
    gap: &Bound<'py, PyAny>,
    bins: &Bound<'py, PyAny>,
    min_saturation: &Bound<'py, PyAny>,
    min_value: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let colours = colours(bins, min_saturation, min_value)?;
    let (target, hit) = (shares(target)?, real("hit", hit)? as f32);
    let (side, gap) = (length("size", size, 1)?, length("gap", gap, 0)?);
    let (image, shape) = image(rgb)?;
    let centres = corners_of("centres", centres)?;
    let scan = Scan { target: &target, window: [side as usize; 2], stride: 1, wanted: None };
    let places = scan.places(shape)?;
    let most = [places.width(), places.height()].map(|places| places as i32 - 1);
    let centres = centres.as_slice()?.as_chunks::<2>().0;
    let shifted = |&[u, v]: &[i32; 2]| {
        [(u.saturating_sub(side / 2), most[0]), (v.saturating_sub(side / 2), most[1])]
            .map(|(first, most)| first.clamp(0, most))
    };
    let corners: Vec<[i32; 2]> = centres.iter().map(shifted).collect();
    let picture = Picture { rgb: image.as_slice()?, shape, colours };
    let mut scores = vec![0.0; corners.len()];
    scratch::with(&SPACE, shape.pixels(), |space| {
        py.detach(|| scan.windows(Simd::best(), picture, &corners, space, &mut scores))
    })?;
    let hits = corners.iter().zip(&scores).filter(|&(_, &score)| score >= hit);
    boxes(py, &merge_corners(&hits.map(|(&corner, _)| corner).collect::<Vec<_>>(), side, gap))
}

/// Boxes around groups of windows that are near each other, by their upper left pixels.
#[pyfunction]
#[pyo3(signature = (corners, size, gap, /))]
pub fn merge_windows<'py>(
    py: Python<'py>,
    corners: &Bound<'py, PyAny>,
    size: &Bound<'py, PyAny>,
    gap: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let (size, gap) = (length("size", size, 1)?, length("gap", gap, 0)?);
    let corners = corners_of("corners", corners)?;
    let windows = corners.as_slice()?.as_chunks::<2>().0;
    if let Some(k) = windows.iter().position(|&[u, v]| u.max(v) > i32::MAX - size - gap || u.min(v) < 0) {
        return Err(Error::element("corners", &[k], "pixels of an image", format!("{:?}", windows[k])).into());
    }
    boxes(py, &merge_corners(windows, size, gap))
}

/// The same for the windows of a scan that reach a score.
#[pyfunction]
#[pyo3(signature = (scores, hit, size, gap, /))]
pub fn merge_hits<'py>(
    py: Python<'py>,
    scores: &Bound<'py, PyAny>,
    hit: &Bound<'py, PyAny>,
    size: &Bound<'py, PyAny>,
    gap: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let (size, gap) = (length("size", size, 1)?, length("gap", gap, 0)?);
    let hit = real("hit", hit)? as f32;
    let scores = plain::<f32, Ix2>("scores", "an array (H, W) of float32", "(H, W)", scores)?;
    boxes(py, &merge_scores(scores.as_slice()?, scores.shape()[1], hit, size, gap))
}

fn boxes<'py>(py: Python<'py>, hulls: &[Hull]) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let mut found = empty::<i32>(py, [hulls.len(), 4])?;
    found.as_slice_mut()?.copy_from_slice(hulls.as_flattened());
    Ok(release(found))
}

/// A length in pixels, such that no sum of two coordinates overflows.
fn length(name: &'static str, given: &Bound<'_, PyAny>, least: u64) -> PyResult<i32> {
    const MOST: u64 = 1 << 29;
    let value = whole(name, given, least)?;
    let fits = i32::try_from(value).ok().filter(|_| value <= MOST);
    Ok(fits.ok_or_else(|| Error::scalar(name, format!("at most {MOST}"), value))?)
}

fn corners_of<'py>(name: &'static str, given: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray2<'py, i32>> {
    let pixels = plain::<i32, Ix2>(name, "an array (N, 2) of int32", "(N, 2)", given)?;
    if pixels.shape()[1] != 2 {
        return Err(Error::shape(name, "(N, 2)", format_shape(pixels.shape())).into());
    }
    Ok(pixels)
}

fn colours(
    bins: &Bound<'_, PyAny>,
    min_saturation: &Bound<'_, PyAny>,
    min_value: &Bound<'_, PyAny>,
) -> PyResult<Colours> {
    let [hues, saturations] = pair("bins", "(hues, saturations)", bins)?;
    let [min_saturation, min_value] =
        [byte("min_saturation", min_saturation)?, byte("min_value", min_value)?];
    Ok(Colours::new(hues, saturations, min_saturation, min_value)?)
}

fn byte(argument: &'static str, object: &Bound<'_, PyAny>) -> PyResult<u8> {
    let value = whole(argument, object, 0)?;
    Ok(u8::try_from(value).map_err(|_| Error::scalar(argument, "at most 255", value))?)
}

fn image<'py>(rgb: &Bound<'py, PyAny>) -> PyResult<(PyReadonlyArray3<'py, u8>, Shape)> {
    let image = plain::<u8, Ix3>("rgb", "an array (H, W, 3) of uint8", "(H, W, 3)", rgb)?;
    if image.shape()[2] != 3 {
        return Err(Error::shape("rgb", "(H, W, 3)", format_shape(image.shape())).into());
    }
    let shape = shape_of("rgb", image.shape())?;
    Ok((image, shape))
}
