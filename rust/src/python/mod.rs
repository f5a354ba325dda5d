//! `motorprime._core`: the border to Python. It validates, detaches from the interpreter and converts.

mod arrays;
mod colours;
mod dynamics;
mod errors;
mod landscape;
mod mlp;
mod plain;
mod pool;
mod sampling;
mod scalars;
mod scan;
mod scratch;
mod step;
mod surf;
mod threshold;

use numpy::PyArray2;
use pyo3::prelude::*;

/// The instruction set that the kernels run on.
#[pyfunction]
fn instruction_set() -> &'static str {
    crate::simd::Simd::best().name()
}

/// An array for a landscape, with anything in it.
#[pyfunction]
#[pyo3(signature = (shape, /))]
fn empty_landscape<'py>(py: Python<'py>, shape: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f32>>> {
    Ok(arrays::release(pool::landscape(py, scalars::shape(shape)?)?))
}

/// Kernels of motorprime. The documented faces of these functions are in the package's own modules.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::colours::{hue_saturation_bins, merge_hits, merge_windows, window_hits, window_intersections};
    #[pymodule_export]
    use super::dynamics::CoupledSystem;
    #[pymodule_export]
    use super::landscape::{gaussian_landscape, gaussian_landscapes, kernel_landscape, kernel_landscapes};
    #[pymodule_export]
    use super::mlp::Mlp;
    #[pymodule_export]
    use super::sampling::{gibbs_sample, sample};
    #[pymodule_export]
    use super::scan::intersections;
    #[pymodule_export]
    use super::step::attention_step;
    #[pymodule_export]
    use super::surf::surf;
    #[pymodule_export]
    use super::threshold::threshold;
    #[pymodule_export]
    use super::{empty_landscape, instruction_set};
}
