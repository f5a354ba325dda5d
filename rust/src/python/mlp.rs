//! Binding of the small network.

use std::cell::Cell;

use numpy::ndarray::{Dimension, IntoDimension};
use numpy::{
    PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use super::arrays::{Numbers, borrowed, created, list, numbers, vector_array, writable};
use super::errors::{format_shape, wrong_type};
use super::scratch;
use crate::error::{Error, Result};
use crate::mlp::{self as kernel, Scale, Weights, Workspace};

/// A small feed-forward network with tanh layers and a linear last one.
#[pyclass(frozen, module = "motorprime._core")]
pub struct Mlp(pub(super) kernel::Mlp);

thread_local! {
    static WORKSPACE: Cell<Workspace> = Cell::default();
}

/// Multiplications below which to hand the interpreter to other threads costs more than it gives them.
const SHORT: usize = 1 << 18;

/// Points as they came, read in place where they can be.
enum Points<'py> {
    Single(PyReadonlyArray2<'py, f32>),
    Double(PyReadonlyArray2<'py, f64>),
    Copied(Vec<f64>),
}

/// What the kernels read.
#[derive(Clone, Copy)]
enum Values<'a> {
    Single(&'a [f32]),
    Double(&'a [f64]),
}

#[pymethods]
impl Mlp {
    #[new]
    #[pyo3(signature = (weights, biases, input_mean, input_std, output_mean, output_std))]
    fn new(
        weights: &Bound<'_, PyAny>,
        biases: &Bound<'_, PyAny>,
        input_mean: &Bound<'_, PyAny>,
        input_std: &Bound<'_, PyAny>,
        output_mean: &Bound<'_, PyAny>,
        output_std: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let mut matrices = Vec::new();
        for (k, item) in layers("weights", weights)?.iter().enumerate() {
            let Numbers { values, shape } = numbers(format!("weights[{k}]"), item)?;
            let [outputs, inputs] = shape[..] else {
                let name = format!("weights[{k}]");
                return Err(Error::shape(name, "(out, in)", format_shape(&shape)).into());
            };
            matrices.push(Weights { outputs, inputs, values });
        }
        let mut vectors = Vec::new();
        for (k, item) in layers("biases", biases)?.iter().enumerate() {
            vectors.push(list(format!("biases[{k}]"), item)?);
        }
        let input = Scale { mean: list("input_mean", input_mean)?, std: list("input_std", input_std)? };
        let output = Scale { mean: list("output_mean", output_mean)?, std: list("output_std", output_std)? };
        Ok(Self(kernel::Mlp::new(matrices, vectors, input, output)?))
    }

    #[pyo3(signature = (x, /, *, out=None))]
    fn __call__<'py>(
        &self,
        x: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (points, rows) = self.points(x)?;
        let values = points.values()?;
        let work = rows.saturating_mul(self.0.multiplications());
        filled(x, out, [rows, self.0.outputs()], work, |space, out| match values {
            Values::Single(x) => self.0.forward(x, space, out),
            Values::Double(x) => self.0.forward(x, space, out),
        })
    }

    #[pyo3(signature = (x, /, *, out=None))]
    fn jacobian<'py>(
        &self,
        x: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let (points, rows) = self.points(x)?;
        let values = points.values()?;
        let (inputs, outputs) = (self.0.inputs(), self.0.outputs());
        let work = rows.saturating_mul(self.0.multiplications()).saturating_mul(1 + outputs);
        filled(x, out, [rows, outputs, inputs], work, |space, out| match values {
            Values::Single(x) => self.0.jacobian(x, space, out),
            Values::Double(x) => self.0.jacobian(x, space, out),
        })
    }

    /// Units of every layer, inputs first and outputs last.
    #[getter]
    fn sizes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.0.sizes())
    }

    fn __repr__(&self) -> String {
        let sizes: Vec<String> = self.0.sizes().iter().map(usize::to_string).collect();
        format!("Mlp({})", sizes.join("-"))
    }

    /// The arguments that make an equal network, for `copy` and `pickle`.
    fn __getnewargs__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let (weights, biases) = (PyList::empty(py), PyList::empty(py));
        for k in 0..self.0.sizes().len() - 1 {
            let (outputs, inputs, matrix, vector) = self.0.layer(k);
            weights.append(PyArray1::from_slice(py, matrix).reshape([outputs, inputs])?)?;
            biases.append(PyArray1::from_slice(py, vector))?;
        }
        let (input, output) = self.0.scales();
        (
            weights,
            biases,
            vector_array(py, &input.mean),
            vector_array(py, &input.std),
            vector_array(py, &output.mean),
            vector_array(py, &output.std),
        )
            .into_pyobject(py)
    }
}

impl Mlp {
    /// The points and how many they are.
    fn points<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<(Points<'py>, usize)> {
        // A subclass of the array may hide something, a mask for example: `numbers` looks at it.
        if x.is_exact_instance_of::<PyUntypedArray>() {
            if let Some(array) = borrowed::<f64, _>("x", x)? {
                let rows = self.rows(array.shape())?;
                return Ok((Points::Double(array), rows));
            }
            if let Some(array) = borrowed::<f32, _>("x", x)? {
                let rows = self.rows(array.shape())?;
                return Ok((Points::Single(array), rows));
            }
        }
        let Numbers { values, shape } = numbers("x", x)?;
        Ok((Points::Copied(values), self.rows(&shape)?))
    }

    fn rows(&self, shape: &[usize]) -> PyResult<usize> {
        match *shape {
            [rows, columns] if columns == self.0.inputs() => Ok(rows),
            _ => {
                let expected = format!("(N, {})", self.0.inputs());
                Err(Error::shape("x", expected, format_shape(shape)).into())
            }
        }
    }
}

impl Points<'_> {
    fn values(&self) -> PyResult<Values<'_>> {
        Ok(match self {
            Self::Single(array) => Values::Single(array.as_slice()?),
            Self::Double(array) => Values::Double(array.as_slice()?),
            Self::Copied(values) => Values::Double(values),
        })
    }
}

/// The caller's array or a new one, filled by the kernel; `work` is how many multiplications that takes.
fn filled<'py, I: IntoDimension>(
    x: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
    shape: I,
    work: usize,
    kernel: impl FnOnce(&mut Workspace, &mut [f32]) -> Result<()> + Send,
) -> PyResult<Bound<'py, PyArray<f32, I::Dim>>> {
    let shape = shape.into_dimension();
    let mut out = match out {
        Some(out) => writable::<f32, I::Dim>("out", out, shape.slice(), &[x])?,
        None => created(x.py(), shape)?.try_readwrite()?,
    };
    let values = out.as_slice_mut()?;
    scratch::with(&WORKSPACE, values.len(), |space| {
        if work < SHORT { kernel(space, values) } else { x.py().detach(|| kernel(space, values)) }
    })?;
    Ok((**out).clone())
}

fn layers<'py>(argument: &'static str, object: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyAny>>> {
    if let Ok(list) = object.cast::<PyList>() {
        return Ok(list.iter().collect());
    }
    match object.cast::<PyTuple>() {
        Ok(tuple) => Ok(tuple.iter().collect()),
        Err(_) => Err(wrong_type(argument, "a list of arrays, one per layer", object)),
    }
}
