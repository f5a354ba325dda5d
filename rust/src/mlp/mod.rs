//! A small tanh network and its Jacobian: the learned projection and the learned ellipse (Section III-A).

mod layer;
mod pass;
mod tiles;

use crate::error::{Error, Result};
use crate::simd::Simd;
use layer::Layer;
pub use pass::Workspace;
use pass::{Forward, Jacobian};

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
    /// Reciprocals of the inputs' standard deviations.
    input_rates: Vec<f64>,
    /// Lines for the units of the widest layer, inputs and outputs included.
    widest: usize,
    /// Units of all hidden layers.
    hidden: usize,
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
        let input_rates = input.std.iter().map(|std| 1.0 / std).collect();
        let sizes = layers.iter().map(|layer| layer.outputs);
        let widest = tiles::padded(sizes.clone().fold(layers[0].inputs, usize::max));
        let hidden = sizes.rev().skip(1).sum();
        let mlp = Self { layers, input, output, input_rates, widest, hidden };
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

    /// Multiplications of one pass with one point, a measure of how long it takes.
    pub fn multiplications(&self) -> usize {
        self.layers.iter().map(|layer| layer.weights.len()).sum()
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
    pub fn forward<X>(&self, x: &[X], workspace: &mut Workspace, out: &mut [f32]) -> Result<()>
    where
        X: Copy + Into<f64>,
    {
        self.forward_on(Simd::best(), x, workspace, out)
    }

    /// [`Mlp::forward`] on a chosen instruction set; all give the same bits.
    ///
    /// # Errors
    /// As for [`Mlp::forward`].
    pub fn forward_on<X>(&self, simd: Simd, x: &[X], workspace: &mut Workspace, out: &mut [f32]) -> Result<()>
    where
        X: Copy + Into<f64>,
    {
        self.check(x.len(), out.len(), self.outputs())?;
        simd.run(Forward { mlp: self, x, workspace, out })
    }

    /// Jacobians (N, out, in) of raw outputs by raw inputs at `x` (N, in), row-major.
    ///
    /// # Errors
    /// As for [`Mlp::forward`].
    pub fn jacobian<X>(&self, x: &[X], workspace: &mut Workspace, out: &mut [f32]) -> Result<()>
    where
        X: Copy + Into<f64>,
    {
        self.jacobian_on(Simd::best(), x, workspace, out)
    }

    /// [`Mlp::jacobian`] on a chosen instruction set; all give the same bits.
    ///
    /// # Errors
    /// As for [`Mlp::forward`].
    pub fn jacobian_on<X>(
        &self,
        simd: Simd,
        x: &[X],
        workspace: &mut Workspace,
        out: &mut [f32],
    ) -> Result<()>
    where
        X: Copy + Into<f64>,
    {
        self.check(x.len(), out.len(), self.outputs() * self.inputs())?;
        simd.run(Jacobian { mlp: self, x, workspace, out })
    }

    /// Whether `x` and `out` hold whole points, and as many of them.
    fn check(&self, x: usize, out: usize, per_point: usize) -> Result<()> {
        let inputs = self.inputs();
        if !x.is_multiple_of(inputs) {
            return Err(Error::shape("x", format!("of N x {inputs} elements"), x.to_string()));
        }
        let wanted = x / inputs * per_point;
        if out != wanted {
            return Err(Error::shape("out", format!("of {wanted} elements"), out.to_string()));
        }
        Ok(())
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
        let mut space = Workspace::default();
        for rows in [0_usize, 1, 15, 16, 17, 40] {
            let x: Vec<f64> = (0..2 * rows).map(|i| (i as f64 * 0.77).sin() * 3.0).collect();
            let (mut y, mut jacobian) = (vec![0.0; 2 * rows], vec![0.0; 4 * rows]);
            mlp.forward(&x, &mut space, &mut y).unwrap();
            mlp.jacobian(&x, &mut space, &mut jacobian).unwrap();
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
    fn every_instruction_set_gives_the_same_bits_in_a_workspace_that_served_others() {
        let mut state = 7_u64;
        let mut draw = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24) - 0.5
        };
        let mut space = Workspace::default();
        for sizes in [&[3, 2][..], &[1, 1], &[12, 25, 25, 2], &[2, 64, 3], &[7, 6, 5, 4, 11]] {
            let mut vector = |n: usize| (0..n).map(|_| 2.0 * draw()).collect::<Vec<f64>>();
            let layer = |s: &[usize]| Weights { outputs: s[1], inputs: s[0], values: vector(s[0] * s[1]) };
            let weights = sizes.windows(2).map(layer).collect();
            let biases = sizes[1..].iter().map(|&n| vector(n)).collect();
            let (inputs, outputs) = (sizes[0], sizes[sizes.len() - 1]);
            let mut scale = |n| Scale { mean: vector(n), std: vector(n).iter().map(|x| 1.1 + x).collect() };
            let mlp = Mlp::new(weights, biases, scale(inputs), scale(outputs)).unwrap();
            for rows in [1, 4, 5, 8, 9, 15, 16, 17, 50, 100] {
                let single: Vec<f32> = vector(rows * inputs).iter().map(|&x| 3.0 * x as f32).collect();
                let double: Vec<f64> = single.iter().map(|&x| x.into()).collect();
                let [y, slopes] = [outputs, outputs * inputs].map(|n| vec![0.0_f32; rows * n]);
                let mut run = |simd| {
                    let (mut y, mut slopes) = (y.clone(), slopes.clone());
                    mlp.forward_on(simd, &single, &mut space, &mut y).unwrap();
                    mlp.jacobian_on(simd, &double, &mut space, &mut slopes).unwrap();
                    let (mut again, mut slopes_again) = (y.clone(), slopes.clone());
                    mlp.forward_on(simd, &double, &mut space, &mut again).unwrap();
                    mlp.jacobian_on(simd, &single, &mut space, &mut slopes_again).unwrap();
                    let bits: Vec<u32> = y.iter().chain(&slopes).map(|x| x.to_bits()).collect();
                    assert!(again.iter().chain(&slopes_again).map(|x| x.to_bits()).eq(bits.iter().copied()));
                    bits
                };
                let expected = run(Simd::all()[0]);
                for simd in Simd::all() {
                    assert_eq!(run(simd), expected, "{} {sizes:?} {rows}", simd.name());
                }
            }
        }
    }

    #[test]
    fn what_is_not_finite_is_named_by_its_place() {
        let (mlp, _) = network();
        let (mut space, mut y) = (Workspace::default(), [0.0; 6]);
        let error = mlp.forward(&[0.0, 1.0, f32::NAN, 2.0, 0.0, 0.0], &mut space, &mut y).unwrap_err();
        assert_eq!(error.to_string(), "x must be finite, got NaN at x[1, 0]");
        let error = mlp.forward(&[0.0, 0.0, 0.0, 0.0, 1e300, -1e300], &mut space, &mut y).unwrap_err();
        assert_eq!(error.to_string(), "x has a row 2 for which the network overflows float32");
        let error = mlp.forward(&[0.0; 6], &mut space, &mut y[..4]).unwrap_err();
        assert_eq!(error.to_string(), "out must be of 6 elements, got 4");
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
