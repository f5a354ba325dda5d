//! Binding of the Gibbs sampler.

use numpy::PyArray2;
use pyo3::prelude::*;

use super::arrays::{Image, empty, image, release};
use super::scalars::{pair, whole};
use crate::error::Error;
use crate::gibbs::Gibbs;
use crate::rng::Xoshiro256PlusPlus;

/// Sweeps between two looks at pending signals, so that Ctrl-C ends a long chain.
const SWEEPS: u64 = 1 << 14;

/// Pixels (u, v) drawn from the landscape by Gibbs sampling.
#[pyfunction]
#[pyo3(signature = (landscape, n, seed, start, burn_in, thin, /))]
pub fn gibbs_sample<'py>(
    py: Python<'py>,
    landscape: &Bound<'py, PyAny>,
    n: &Bound<'py, PyAny>,
    seed: u64,
    start: Option<&Bound<'py, PyAny>>,
    burn_in: &Bound<'py, PyAny>,
    thin: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let n = whole("n", n, 0)?;
    let burn_in = whole("burn_in", burn_in, 0)?;
    let thin = whole("thin", thin, 1)?;
    let start = match start {
        Some(start) => Some(pair("start", "(u, v)", start)?),
        None => None,
    };
    if n > i32::MAX as u64 {
        return Err(Error::scalar("n", "at most 2147483647", n).into());
    }

    let (image, shape) = image("landscape", landscape)?;
    let converted: Vec<f32>;
    let pixels = match &image {
        Image::Single(array) => array.as_slice()?,
        Image::Double(array) => {
            // Checked before the conversion, which turns what is too small into zero.
            crate::threshold::check_pixels(array.as_slice()?, shape)?;
            converted = array.as_slice()?.iter().map(|&p| p as f32).collect();
            &converted
        }
    };

    let mut samples = empty::<i32>(py, [n as usize, 2])?;
    let out = samples.as_slice_mut()?;
    let mut rng = Xoshiro256PlusPlus::new(seed);
    let mut chain = py.detach(|| {
        let mut chain = Gibbs::new(pixels, shape)?;
        match start {
            Some(start) => chain.start_at(start)?,
            None => chain.start_drawn(&mut rng),
        }
        Ok::<_, Error>(chain)
    })?;

    let mut skip = if n == 0 { 0 } else { burn_in.saturating_add(thin - 1) };
    let mut kept = out.chunks_exact_mut(2);
    let mut left = n;
    while left > 0 {
        py.detach(|| {
            for _ in 0..SWEEPS {
                let [u, v] = chain.sweep(&mut rng);
                if skip > 0 {
                    skip -= 1;
                    continue;
                }
                let Some(sample) = kept.next() else { break };
                // An image has at most 2^31 - 1 pixels, see `Shape`.
                sample.copy_from_slice(&[u as i32, v as i32]);
                skip = thin - 1;
                left -= 1;
                if left == 0 {
                    break;
                }
            }
        });
        py.check_signals()?;
    }
    Ok(release(samples))
}
