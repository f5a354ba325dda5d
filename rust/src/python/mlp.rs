//! Binding of the small network.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use super::arrays::{Numbers, empty, list, numbers, release, vector_array};
use super::errors::{format_shape, wrong_type};
use crate::error::Error;
use crate::mlp::{self as kernel, Scale, Weights};

/// A small feed-forward network with tanh layers and a linear last one.
#[pyclass(frozen, module = "motorprime._core")]
pub struct Mlp(kernel::Mlp);

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

    fn __call__<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (x, rows) = self.inputs(x)?;
        let mut out = empty::<f32>(py, [rows, self.0.outputs()])?;
        let values = out.as_slice_mut()?;
        py.detach(|| self.0.forward(&x, values))?;
        Ok(release(out))
    }

    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, numpy::PyArray3<f32>>> {
        let (x, rows) = self.inputs(x)?;
        let (inputs, outputs) = (self.0.inputs(), self.0.outputs());
        let mut out = empty::<f32>(py, [rows, outputs * inputs])?;
        let values = out.as_slice_mut()?;
        py.detach(|| self.0.jacobian(&x, values))?;
        release(out).reshape([rows, outputs, inputs])
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
    fn inputs(&self, x: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, usize)> {
        let Numbers { values, shape } = numbers("x", x)?;
        match shape[..] {
            [rows, columns] if columns == self.0.inputs() => Ok((values, rows)),
            _ => {
                let expected = format!("(N, {})", self.0.inputs());
                Err(Error::shape("x", expected, format_shape(&shape)).into())
            }
        }
    }
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
