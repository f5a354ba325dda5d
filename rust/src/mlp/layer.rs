//! One layer, checked and packed for both directions.

use super::Weights;
use super::tiles::Product;
use crate::error::{Error, Result};

/// One layer: `weights` is (outputs, inputs), row-major.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layer {
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    pub(super) weights: Vec<f32>,
    pub(super) biases: Vec<f32>,
    /// From inputs to outputs.
    pub(super) forward: Product,
    /// From the gradient by the outputs to the gradient by the inputs: the transpose.
    pub(super) backward: Product,
}

impl Layer {
    /// Layer `k`, which follows a layer of `inputs` units.
    pub(super) fn new(k: usize, inputs: usize, weights: Weights, biases: &[f64]) -> Result<Self> {
        let Weights { outputs, inputs: columns, values } = weights;
        let name = format!("weights[{k}]");
        if columns != inputs
            || outputs == 0
            || inputs == 0
            || outputs.checked_mul(columns) != Some(values.len())
        {
            let expected = if k == 0 {
                "(out, in), both at least 1".into()
            } else {
                format!("(out, {inputs}) to follow the layer before it")
            };
            return Err(Error::shape(name, expected, format!("({outputs}, {columns})")));
        }
        if biases.len() != outputs {
            let expected = format!("({outputs},) like the rows of {name}");
            let found = format!("({},)", biases.len());
            return Err(Error::shape(format!("biases[{k}]"), expected, found));
        }
        let narrow = |name: String, values: &[f64], columns: Option<usize>| {
            if let Some(at) = values.iter().position(|&w| !(w as f32).is_finite()) {
                let index = columns.map_or(vec![at], |c| vec![at / c, at % c]);
                return Err(Error::element(name, &index, "finite in float32", values[at]));
            }
            Ok(values.iter().map(|&w| w as f32).collect::<Vec<f32>>())
        };
        let weights = narrow(name, &values, Some(columns))?;
        let biases = narrow(format!("biases[{k}]"), biases, None)?;
        let forward = Product::pack(inputs, &biases, |o, i| weights[o * inputs + i]);
        let backward = Product::pack(outputs, &vec![0.0; inputs], |i, o| weights[o * inputs + i]);
        Ok(Self { inputs, outputs, weights, biases, forward, backward })
    }

    /// Weights of output `o`.
    pub(super) fn row(&self, o: usize) -> &[f32] {
        &self.weights[o * self.inputs..(o + 1) * self.inputs]
    }
}
