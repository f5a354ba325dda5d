//! Binding of the threshold.

use std::cell::Cell;

use pyo3::prelude::*;

use super::arrays::{Image, image};
use super::scalars::{name, real, whole};
use crate::error::Error;
use crate::threshold::{self as kernel, Method, Wanted, Workspace};

/// Pixels of an image up to which its buffers are kept: enough for 3840 x 2160.
const KEPT: usize = 1 << 23;

thread_local! {
    /// The buffers of this thread's last call.
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
    // Taken out while in use: a call that comes in between finds an empty one.
    let mut workspace = WORKSPACE.take();
    let result = match &image {
        Image::Single(array) => {
            let pixels = array.as_slice()?;
            py.detach(|| kernel::threshold(pixels, shape, wanted, stride, method, &mut workspace))
        }
        Image::Double(array) => {
            let pixels = array.as_slice()?;
            py.detach(|| kernel::threshold(pixels, shape, wanted, stride, method, &mut workspace))
        }
    };
    if shape.pixels() <= KEPT {
        WORKSPACE.set(workspace);
    }
    Ok(result?)
}
