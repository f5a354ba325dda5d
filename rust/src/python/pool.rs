//! Landscapes that nobody holds any more, to be handed out again.
//!
//! Memory of this size goes back to the system as soon as it is freed, and comes back as pages that the system
//! fills with zeros one by one: for a new stereo pair in every cycle that took several times as long as to
//! compute it. So the last landscapes are remembered, and one that only this memory still holds serves again.
//! A view, a slice or a tensor of another library that shares an array's memory holds the array, too.

use std::sync::Mutex;

use numpy::{PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadwriteArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use super::arrays::empty;
use crate::shape::Shape;

/// Landscapes that are remembered.
const KEPT: usize = 8;
/// Pixels of those that are: less comes from the allocator at no cost, and more would be too much to keep.
const PIXELS: std::ops::RangeInclusive<usize> = 1 << 14..=1 << 21;

static POOL: Mutex<Vec<Py<PyArray2<f32>>>> = Mutex::new(Vec::new());

/// An array to write a landscape to, not initialised.
pub fn landscape(py: Python<'_>, shape: Shape) -> PyResult<PyReadwriteArray2<'_, f32>> {
    let size = [shape.height(), shape.width()];
    if !PIXELS.contains(&shape.pixels()) {
        return empty(py, size);
    }
    // Never waits: a finaliser that runs meanwhile may come here again.
    let Ok(mut pool) = POOL.try_lock() else {
        return empty(py, size);
    };
    // Shape, strides and dtype of an array can be set in place.
    let single = numpy::dtype::<f32>(py);
    let fits = |array: &Bound<'_, PyArray2<f32>>| {
        array.shape() == size && array.is_c_contiguous() && array.dtype().is_equiv_to(&single)
    };
    for at in 0..pool.len() {
        if !fits(pool[at].bind(py)) || references(py, &pool[at])? != held_once(py)? {
            continue;
        }
        // To the end, where it is forgotten last. One that was made read-only is forgotten at once.
        let array = pool.remove(at);
        if let Ok(borrowed) = array.bind(py).clone().try_readwrite() {
            pool.push(array);
            return Ok(borrowed);
        }
        break;
    }
    let new = empty(py, size)?;
    if pool.len() == KEPT {
        pool.remove(0);
    }
    pool.push((**new).clone().unbind());
    Ok(new)
}

/// What `sys.getrefcount` says of an array; it counts its own look as well.
fn references(py: Python<'_>, array: &Py<PyArray2<f32>>) -> PyResult<usize> {
    static COUNT: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    COUNT.import(py, "sys", "getrefcount")?.call1((array,))?.extract()
}

/// What it says of an array that is held once.
fn held_once(py: Python<'_>) -> PyResult<usize> {
    static ONCE: PyOnceLock<usize> = PyOnceLock::new();
    let count = ONCE.get_or_try_init(py, || {
        let array = (**empty::<f32>(py, [1, 1])?).clone().unbind();
        references(py, &array)
    })?;
    Ok(*count)
}
