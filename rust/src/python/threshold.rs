//! Binding of the threshold.

use std::cell::Cell;

use pyo3::prelude::*;

use super::arrays::{Image, image};
use super::scalars::{name, real, whole};
use super::scratch;
use crate::error::Error;
use crate::threshold::{self as kernel, Method, Wanted, Workspace};

thread_local! {
    static WORKSPACE: Cell<Workspace> = Cell::default();
}

/// The largest d that leaves the wanted number of pixels at or above it.
#[pyfunction]
#[pyo3(signature = (landscape, fraction, count, method, stride, /))]
pub fn threshold(
    py: Python<'_>,
    landscape: &Bound<'_, PyAny>,
    fraction: Option<&Bound<'_, PyAny>>,
    count: Option<&Bound<'_, PyAny>>,
    method: &Bound<'_, PyAny>,
    stride: &Bound<'_, PyAny>,
) -> PyResult<f64> {
    let wanted = match (fraction, count) {
        (Some(fraction), None) => Wanted::Fraction(real("fraction", fraction)?),
        (None, Some(count)) => Wanted::Count(whole("count", count, 1)?),
        (None, None) => {
            return Err(Error::conflict("fraction", "or count must be given").into());
        }
        (Some(_), Some(_)) => {
            let reason = "and count must not both be given";
            return Err(Error::conflict("fraction", reason).into());
        }
    };
    let method = name("method", method, Method::named)?;
    let stride = usize::try_from(whole("stride", stride, 1)?).unwrap_or(usize::MAX);
    let (image, shape) = image("landscape", landscape)?;
    let result = scratch::with(&WORKSPACE, shape.pixels(), |workspace| match &image {
        Image::Single(array) => {
            let pixels = array.as_slice()?;
            Ok::<_, PyErr>(py.detach(|| kernel::threshold(pixels, shape, wanted, stride, method, workspace)))
        }
        Image::Double(array) => {
            let pixels = array.as_slice()?;
            Ok(py.detach(|| kernel::threshold(pixels, shape, wanted, stride, method, workspace)))
        }
    })?;
    Ok(result?)
}
