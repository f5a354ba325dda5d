//! The kernels of motorprime: attentional landscapes, thresholds, samplers and small networks.
//!
//! Nothing here knows Python; [`python`](crate) is the only border and is compiled by the feature of the
//! same name. Pixels have `u` to the right and `v` down with centres at integers, images are row-major.

#![cfg_attr(not(feature = "python"), forbid(unsafe_code))]
#![warn(missing_docs)]

pub mod error;
pub mod gaussian;
pub mod gibbs;
pub mod kernel;
pub mod masses;
mod math;
pub mod mlp;
pub mod parallel;
#[cfg(feature = "python")]
mod python;
pub mod rng;
pub mod sample;
pub mod shape;
pub mod simd;
pub mod step;
pub mod support;
pub mod threshold;

pub use error::{Error, Result};
pub use shape::Shape;
pub use simd::Simd;
pub use support::Support;
