//! A small tanh network and its Jacobian: the learned projection and the learned ellipse (Section III-A).

use crate::error::{Error, Result};
use crate::math::tanh;

/// Points that go through the network together, one in each vector lane.
const LANES: usize = 16;
type Lanes = [f32; LANES];

/// One layer: `weights` is (outputs, inputs), row-major.
#[derive(Clone, Debug, PartialEq)]
struct Layer {
    inputs: usize,
    outputs: usize,
    weights: Vec<f32>,
    biases: Vec<f32>,
}

/// Weights of a layer as they are given, (outputs, inputs) row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// Rows.
    pub outputs: usize,
    /// Columns.
    pub inputs: usize,
    /// Elements, row by row.
    pub values: Vec<f64>,
}

/// Mean and standard deviation of every input or output of the network.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations, positive.
    pub std: Vec<f64>,
}

/// `net((x - input.mean) / input.std) * output.std + output.mean`, tanh on every layer but the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    layers: Vec<Layer>,
    input: Scale,
    output: Scale,
}

impl Mlp {
    /// Checks that the layers fit each other and the scales, and that every number is finite.
    ///
    /// # Errors
    /// The first argument that does not fit, by its name and index.
    pub fn new(weights: Vec<Weights>, biases: Vec<Vec<f64>>, input: Scale, output: Scale) -> Result<Self> {
        if weights.is_empty() {
            return Err(Error::shape("weights", "a list of at least one matrix", "0"));
        }
        if biases.len() != weights.len() {
            let expected = format!("one vector per layer, {}", weights.len());
            return Err(Error::shape("biases", expected, biases.len().to_string()));
        }
        let mut layers: Vec<Layer> = Vec::with_capacity(weights.len());
        for (k, (weights, biases)) in weights.into_iter().zip(biases).enumerate() {
            let inputs = layers.last().map_or(weights.inputs, |layer| layer.outputs);
            layers.push(Layer::new(k, inputs, weights, &biases)?);
        }
        let mlp = Self { layers, input, output };
        mlp.input.check(["input_mean", "input_std"], mlp.inputs())?;
        mlp.output.check(["output_mean", "output_std"], mlp.outputs())?;
        Ok(mlp)
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.layers[0].inputs
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.layers[self.layers.len() - 1].outputs
    }

    /// Units of every layer, inputs first and outputs last.
    pub fn sizes(&self) -> Vec<usize> {
        let outputs = self.layers.iter().map(|layer| layer.outputs);
        std::iter::once(self.inputs()).chain(outputs).collect()
    }

    /// Layer `k` as (outputs, inputs, weights, biases), in the float32 in which it is computed.
    pub fn layer(&self, k: usize) -> (usize, usize, &[f32], &[f32]) {
        let layer = &self.layers[k];
        (layer.outputs, layer.inputs, &layer.weights, &layer.biases)
    }

    /// Scales of the inputs and of the outputs.
    pub fn scales(&self) -> (&Scale, &Scale) {
        (&self.input, &self.output)
    }

    /// Outputs (N, out) of raw inputs `x` (N, in), both row-major.
    ///
    /// # Errors
    /// Buffers that do not fit, an input that is not finite, or an output beyond float32.
    pub fn forward(&self, x: &[f64], out: &mut [f32]) -> Result<()> {
        self.check(x, out.len(), self.outputs())?;
        let mut buffers = Buffers::default();
        let (inputs, outputs) = (self.inputs(), self.outputs());
        for (x, out) in x.chunks(LANES * inputs).zip(out.chunks_mut(LANES * outputs)) {
            self.load(x, &mut buffers.current);
            for (k, layer) in self.layers.iter().enumerate() {
                layer.forward(&buffers.current, &mut buffers.next);
                if k + 1 < self.layers.len() {
                    buffers.next.iter_mut().flatten().for_each(|y| *y = tanh(*y));
                }
                std::mem::swap(&mut buffers.current, &mut buffers.next);
            }
            for (lane, row) in out.chunks_exact_mut(outputs).enumerate() {
                for (o, y) in row.iter_mut().enumerate() {
                    let raw = f64::from(buffers.current[o][lane]);
                    *y = (raw * self.output.std[o] + self.output.mean[o]) as f32;
                }
            }
        }
        self.check_finite(out, outputs)
    }

    /// Jacobians (N, out, in) of raw outputs by raw inputs at `x` (N, in), row-major.
    ///
    /// # Errors
    /// As for [`Mlp::forward`].
    pub fn jacobian(&self, x: &[f64], out: &mut [f32]) -> Result<()> {
        let (inputs, outputs) = (self.inputs(), self.outputs());
        self.check(x, out.len(), outputs * inputs)?;
        let mut buffers = Buffers::default();
        let mut slopes: Vec<Vec<Lanes>> = vec![Vec::new(); self.layers.len() - 1];
        let rows = out.chunks_mut(LANES * outputs * inputs);
        for (x, out) in x.chunks(LANES * inputs).zip(rows) {
            self.load(x, &mut buffers.current);
            for (layer, slope) in self.layers.iter().zip(&mut slopes) {
                layer.forward(&buffers.current, &mut buffers.next);
                buffers.next.iter_mut().flatten().for_each(|y| *y = tanh(*y));
                slope.clear();
                slope.extend(buffers.next.iter().map(|y| y.map(|y| 1.0 - y * y)));
                std::mem::swap(&mut buffers.current, &mut buffers.next);
            }
            // Backwards from one output at a time: there are fewer outputs than inputs.
            for o in 0..outputs {
                self.layers[self.layers.len() - 1].row(o, &mut buffers.current);
                for (layer, slope) in self.layers.iter().zip(&slopes).rev() {
                    for (g, s) in buffers.current.iter_mut().zip(slope) {
                        g.iter_mut().zip(s).for_each(|(g, s)| *g *= s);
                    }
                    layer.backward(&buffers.current, &mut buffers.next);
                    std::mem::swap(&mut buffers.current, &mut buffers.next);
                }
                for (lane, jacobian) in out.chunks_exact_mut(outputs * inputs).enumerate() {
                    let row = &mut jacobian[o * inputs..(o + 1) * inputs];
                    for (i, y) in row.iter_mut().enumerate() {
                        let scale = self.output.std[o] / self.input.std[i];
                        *y = (f64::from(buffers.current[i][lane]) * scale) as f32;
                    }
                }
            }
        }
        self.check_finite(out, outputs * inputs)
    }

    /// Scales a block of inputs and transposes it, one point to a lane.
    fn load(&self, x: &[f64], block: &mut Vec<Lanes>) {
        let inputs = self.inputs();
        block.clear();
        block.resize(inputs, [0.0; LANES]);
        for (lane, row) in x.chunks_exact(inputs).enumerate() {
            for (i, &value) in row.iter().enumerate() {
                block[i][lane] = ((value - self.input.mean[i]) / self.input.std[i]) as f32;
            }
        }
    }

    fn check(&self, x: &[f64], out: usize, per_row: usize) -> Result<()> {
        let inputs = self.inputs();
        if !x.len().is_multiple_of(inputs) {
            let expected = format!("of N x {inputs} elements");
            return Err(Error::shape("x", expected, x.len().to_string()));
        }
        if out != x.len() / inputs * per_row {
            let expected = format!("of {} elements", x.len() / inputs * per_row);
            return Err(Error::shape("out", expected, out.to_string()));
        }
        match x.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(at) => Err(Error::element("x", &[at / inputs, at % inputs], "finite", x[at])),
        }
    }

    fn check_finite(&self, out: &[f32], per_row: usize) -> Result<()> {
        match out.iter().position(|y| !y.is_finite()) {
            None => Ok(()),
            Some(at) => {
                let row = at / per_row;
                let reason = format!("has a row {row} for which the network overflows float32");
                Err(Error::conflict("x", reason))
            }
        }
    }
}

/// Activations of the layer at hand and of the next.
#[derive(Default)]
struct Buffers {
    current: Vec<Lanes>,
    next: Vec<Lanes>,
}

impl Layer {
    fn new(k: usize, inputs: usize, weights: Weights, biases: &[f64]) -> Result<Self> {
        let Weights { outputs, inputs: columns, values } = weights;
        let name = format!("weights[{k}]");
        if columns != inputs || outputs == 0 || inputs == 0 || values.len() != outputs * columns {
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
            Ok(values.iter().map(|&w| w as f32).collect())
        };
        Ok(Self {
            inputs,
            outputs,
            weights: narrow(name, &values, Some(columns))?,
            biases: narrow(format!("biases[{k}]"), biases, None)?,
        })
    }

    fn forward(&self, x: &[Lanes], y: &mut Vec<Lanes>) {
        y.clear();
        for (row, &bias) in self.weights.chunks_exact(self.inputs).zip(&self.biases) {
            let mut sum = [bias; LANES];
            for (&w, x) in row.iter().zip(x) {
                for (sum, x) in sum.iter_mut().zip(x) {
                    *sum += w * x;
                }
            }
            y.push(sum);
        }
    }

    /// Gradient by the inputs from the gradient by the outputs.
    fn backward(&self, by_outputs: &[Lanes], by_inputs: &mut Vec<Lanes>) {
        by_inputs.clear();
        by_inputs.resize(self.inputs, [0.0; LANES]);
        for (row, g) in self.weights.chunks_exact(self.inputs).zip(by_outputs) {
            for (&w, sum) in row.iter().zip(by_inputs.iter_mut()) {
                for (sum, g) in sum.iter_mut().zip(g) {
                    *sum += w * g;
                }
            }
        }
    }

    /// Gradient of output `o` by the inputs of this (linear) layer, the same in every lane.
    fn row(&self, o: usize, gradient: &mut Vec<Lanes>) {
        gradient.clear();
        let row = &self.weights[o * self.inputs..(o + 1) * self.inputs];
        gradient.extend(row.iter().map(|&w| [w; LANES]));
    }
}

impl Scale {
    fn check(&self, [mean, std]: [&'static str; 2], size: usize) -> Result<()> {
        for (name, values, low) in [(mean, &self.mean, f64::MIN), (std, &self.std, 1e-300)] {
            if values.len() != size {
                let found = format!("({},)", values.len());
                return Err(Error::shape(name, format!("({size},)"), found));
            }
            if let Some(at) = values.iter().position(|x| !(low..=f64::MAX).contains(x)) {
                let expected = if name == mean { "finite" } else { "positive and finite" };
                return Err(Error::element(name, &[at], expected, values[at]));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2-3-2 with scales, and its outputs at `x` in float64.
    fn network() -> (Mlp, impl Fn([f64; 2]) -> [f64; 2]) {
        let (w0, b0) = ([[0.5, -1.0], [2.0, 0.3], [-0.7, 0.9]], [0.1, -0.2, 0.3]);
        let (w1, b1) = ([[1.0, -2.0, 0.5], [0.4, 0.8, -1.5]], [0.05, -0.6]);
        let weights = vec![
            Weights { outputs: 3, inputs: 2, values: w0.concat() },
            Weights { outputs: 2, inputs: 3, values: w1.concat() },
        ];
        let input = Scale { mean: vec![1.0, -2.0], std: vec![2.0, 0.5] };
        let output = Scale { mean: vec![160.0, 120.0], std: vec![80.0, 60.0] };
        let mlp = Mlp::new(weights, vec![b0.to_vec(), b1.to_vec()], input, output).unwrap();
        let twin = move |x: [f64; 2]| {
            let z = [(x[0] - 1.0) / 2.0, (x[1] + 2.0) / 0.5];
            let hidden = [0, 1, 2].map(|k| (w0[k][0] * z[0] + w0[k][1] * z[1] + b0[k]).tanh());
            let raw = [0, 1].map(|o| (0..3).map(|k| w1[o][k] * hidden[k]).sum::<f64>() + b1[o]);
            [raw[0] * 80.0 + 160.0, raw[1] * 60.0 + 120.0]
        };
        (mlp, twin)
    }

    #[test]
    fn forward_and_jacobian_follow_the_formula_for_any_number_of_rows() {
        let (mlp, twin) = network();
        for rows in [0_usize, 1, 15, 16, 17, 40] {
            let x: Vec<f64> = (0..2 * rows).map(|i| (i as f64 * 0.77).sin() * 3.0).collect();
            let (mut y, mut jacobian) = (vec![0.0; 2 * rows], vec![0.0; 4 * rows]);
            mlp.forward(&x, &mut y).unwrap();
            mlp.jacobian(&x, &mut jacobian).unwrap();
            for (n, x) in x.chunks_exact(2).enumerate() {
                let expected = twin([x[0], x[1]]);
                for o in 0..2 {
                    assert!((f64::from(y[2 * n + o]) - expected[o]).abs() < 2e-4);
                    for i in 0..2 {
                        let mut step = [0.0; 2];
                        step[i] = 1e-6;
                        let rise = twin([x[0] + step[0], x[1] + step[1]])[o]
                            - twin([x[0] - step[0], x[1] - step[1]])[o];
                        let slope = f64::from(jacobian[4 * n + 2 * o + i]);
                        assert!((slope - rise / 2e-6).abs() < 1e-3, "{slope} {rise}");
                    }
                }
            }
        }
    }

    #[test]
    fn layers_that_do_not_fit_are_named() {
        let matrix = |outputs, inputs| Weights { outputs, inputs, values: vec![0.0; outputs * inputs] };
        let scale = |n: usize| Scale { mean: vec![0.0; n], std: vec![1.0; n] };
        let biases = vec![vec![0.0; 3], vec![0.0; 2]];
        let error = Mlp::new(vec![matrix(3, 2), matrix(2, 4)], biases, scale(2), scale(2)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "weights[1] must be (out, 3) to follow the layer before it, got (2, 4)"
        );
    }
}
