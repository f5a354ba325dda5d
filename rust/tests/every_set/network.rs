//! Small networks.

use motorprime::Simd;
use motorprime::mlp::{Mlp, Scale, Weights, Workspace};

use crate::case::{Case, Draw, ensure, same_bits, stress};

#[test]
fn networks() {
    stress::<Network>(1000);
}

#[derive(Debug)]
struct Network {
    weights: Vec<Weights>,
    biases: Vec<Vec<f64>>,
    input: Scale,
    output: Scale,
    x: Vec<f64>,
    /// Whether all numbers are of moderate size, so that a twin in float64 is a measure.
    tame: bool,
}

impl Case for Network {
    type Space = Workspace;
    const NAME: &str = "networks";

    fn draw(draw: &mut Draw) -> Self {
        let tame = draw.chance(0.6);
        let layers = 1 + draw.below(3);
        let most = draw.pick(&[3, 6, 12, 30]);
        let sizes: Vec<usize> = (0..=layers).map(|_| 1 + draw.below(most)).collect();
        let mut numbers = |count: usize, spread: f64| -> Vec<f64> {
            let wild = if tame { 0.0 } else { 0.02 };
            let mut number = || match draw.below(3) {
                _ if !draw.chance(wild) => draw.between(-spread, spread),
                0 => draw.sign() * draw.octaves(-149, 127),
                1 => draw.pick(&[0.0, -0.0, 1e-45, 3e38, -3e38, 1e39]),
                _ => draw.pick(&[f64::NAN, f64::INFINITY, 1e300, -1e300, 5e-324]),
            };
            (0..count).map(|_| number()).collect()
        };
        let weights: Vec<Weights> = sizes
            .windows(2)
            .map(|s| Weights { outputs: s[1], inputs: s[0], values: numbers(s[0] * s[1], 1.0) })
            .collect();
        let biases = sizes[1..].iter().map(|&n| numbers(n, 1.0)).collect();
        let [first, last] = [sizes[0], sizes[layers]];
        let mut scale = |n| Scale {
            mean: numbers(n, 3.0),
            std: numbers(n, 0.9).iter().map(|x| if tame { 1.0 + x } else { x.abs() }).collect(),
        };
        let (input, output) = (scale(first), scale(last));
        let rows = [0, 1, 2, 4, 5, 8, 9, 16, 17, 20][(first * 7 + last * 3 + layers) % 10];
        let x = numbers(rows * first, 3.0);
        Self { weights, biases, input, output, x, tame }
    }

    fn check(&self, space: &mut Workspace) -> Result<f64, String> {
        let (weights, biases) = (self.weights.clone(), self.biases.clone());
        let valid = self.valid();
        let mlp = Mlp::new(weights, biases, self.input.clone(), self.output.clone());
        ensure(mlp.is_ok() == valid, || format!("{:?}", mlp.as_ref().err()))?;
        let Ok(mlp) = mlp else { return Ok(0.0) };
        let rows = self.x.len() / mlp.inputs();
        let per_point = [mlp.outputs(), mlp.outputs() * mlp.inputs()];
        let mut first: Option<[Result<Vec<f32>, String>; 2]> = None;
        for simd in Simd::all() {
            let [mut y, mut slopes] = per_point.map(|n| vec![f32::NAN; rows * n]);
            let done = mlp.forward_on(simd, &self.x, space, &mut y);
            let y = done.map(|()| y).map_err(|error| error.to_string());
            let done = mlp.jacobian_on(simd, &self.x, space, &mut slopes);
            let slopes = done.map(|()| slopes).map_err(|error| error.to_string());
            let found = [y, slopes];
            for result in &found {
                match result {
                    Ok(numbers) => {
                        let finite = numbers.iter().all(|x| x.is_finite());
                        ensure(finite && self.x.iter().all(|x| x.is_finite()), || format!("{numbers:?}"))?;
                    }
                    Err(error) => ensure(!self.tame && error.starts_with("x "), || error.clone())?,
                }
            }
            let Some(first) = &first else {
                first = Some(found);
                continue;
            };
            for (a, b) in first.iter().zip(&found) {
                let same = match (a, b) {
                    (Ok(a), Ok(b)) => same_bits(a, b),
                    (a, b) => a == b,
                };
                ensure(same, || format!("{}: {b:?}, not {a:?}", simd.name()))?;
            }
        }
        match first {
            Some([Ok(y), Ok(slopes)]) if self.tame => self.compare(&y, &slopes),
            _ => Ok(0.0),
        }
    }
}

impl Network {
    fn valid(&self) -> bool {
        let narrow = |x: &f64| (*x as f32).is_finite();
        let scales = [&self.input, &self.output];
        self.weights.iter().all(|w| w.values.iter().all(narrow))
            && self.biases.iter().flatten().all(narrow)
            && scales.iter().all(|s| {
                s.mean.iter().all(|x| x.is_finite()) && s.std.iter().all(|x| (1e-300..=f64::MAX).contains(x))
            })
    }

    /// Against the formula in float64, in units that the size of the network explains.
    fn compare(&self, y: &[f32], slopes: &[f32]) -> Result<f64, String> {
        let (inputs, outputs) = (self.input.mean.len(), self.output.mean.len());
        let mut worst = 0.0_f64;
        for (n, x) in self.x.chunks_exact(inputs).enumerate() {
            let mut values: Vec<f64> =
                (0..inputs).map(|i| (x[i] - self.input.mean[i]) / self.input.std[i]).collect();
            // Derivatives by every input, and bounds on the rounding of both.
            let mut rates: Vec<Vec<f64>> = (0..inputs)
                .map(|i| (0..inputs).map(|k| f64::from(u8::from(i == k)) / self.input.std[i]).collect())
                .collect();
            let mut bounds: Vec<f64> = values.iter().map(|x| x.abs() + 1.0).collect();
            let mut steep = rates.clone();
            for (k, (weights, biases)) in self.weights.iter().zip(&self.biases).enumerate() {
                let row = |o: usize| &weights.values[o * weights.inputs..(o + 1) * weights.inputs];
                let sum = |row: &[f64], x: &[f64]| row.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
                let size =
                    |row: &[f64], x: &[f64]| row.iter().zip(x).map(|(w, x)| (w * x).abs()).sum::<f64>();
                let each = 0..weights.outputs;
                let mut next: Vec<f64> = each.clone().map(|o| sum(row(o), &values) + biases[o]).collect();
                bounds = each.clone().map(|o| size(row(o), &bounds) + 2.0).collect();
                rates = rates.iter().map(|r| each.clone().map(|o| sum(row(o), r)).collect()).collect();
                steep = steep.iter().map(|r| each.clone().map(|o| size(row(o), r)).collect()).collect();
                if k + 1 < self.weights.len() {
                    next.iter_mut().for_each(|x| *x = x.tanh());
                    for rate in &mut rates {
                        rate.iter_mut().zip(&next).for_each(|(r, y)| *r *= 1.0 - y * y);
                    }
                }
                values = next;
            }
            for o in 0..outputs {
                let (std, mean) = (self.output.std[o], self.output.mean[o]);
                let twin = values[o] * std + mean;
                let error = (f64::from(y[n * outputs + o]) - twin).abs() / (bounds[o] * std + mean.abs());
                worst = worst.max(error);
                for i in 0..inputs {
                    let slope = f64::from(slopes[(n * outputs + o) * inputs + i]);
                    let bound = steep[i][o] * std * (1.0 + bounds[o]);
                    worst = worst.max((slope - rates[i][o] * std).abs() / bound.max(1e-30));
                }
            }
        }
        ensure(worst < 1e-5, || format!("off by {worst:e}")).map(|()| worst)
    }
}
