//! The kernels of motorprime: attentional landscapes, thresholds, samplers, small networks and movements.
//!
//! Nothing here knows Python; [`python`](crate) is the only border and is compiled by the feature of the
//! same name. Pixels have `u` to the right and `v` down with centres at integers, images are row-major.

#![cfg_attr(not(feature = "python"), forbid(unsafe_code))]
#![warn(missing_docs)]

pub mod colours;
pub mod dynamics;
pub mod error;
pub mod gaussian;
pub mod gibbs;
pub mod integral;
pub mod kernel;
pub mod masses;
mod math;
mod math64;
pub mod mlp;
pub mod parallel;
#[cfg(feature = "python")]
mod python;
pub mod rng;
pub mod sample;
pub mod scan;
pub mod shape;
pub mod simd;
pub mod step;
pub mod support;
pub mod surf;
pub mod threshold;

pub use error::{Error, Result};
pub use shape::Shape;
pub use simd::Simd;
pub use support::Support;
