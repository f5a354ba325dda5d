//! The passes through the network, block by block of points.

use super::Mlp;
use crate::error::{Error, Result};
use crate::math::tanh;
use crate::simd::Kernel;

/// Points that go through the network together, one in each lane of a line.
const LANES: usize = 16;
/// The same for a remainder that fits into fewer lanes, such as the one point of a control loop.
const NARROW: usize = 8;
const NARROWEST: usize = 4;

/// Buffers of a pass. They fit themselves to any network; keep one per thread, and calls allocate nothing.
#[derive(Clone, Debug, Default)]
pub struct Workspace(Vec<f32>);

impl Workspace {
    /// That many lines of `W` points, from the start of a cache line on.
    #[inline(always)]
    fn lines<const W: usize>(&mut self, count: usize) -> &mut [[f32; W]] {
        const CACHE_LINE: usize = 64 / size_of::<f32>();
        let size = count * W;
        if self.0.len() < size + CACHE_LINE {
            self.0.resize(size + CACHE_LINE, 0.0);
        }
        let start = self.0.as_ptr().align_offset(64).min(CACHE_LINE);
        self.0[start..start + size].as_chunks_mut().0
    }
}

/// The outputs (N, out) of the points `x` (N, in).
pub(super) struct Forward<'a, X> {
    pub(super) mlp: &'a Mlp,
    pub(super) x: &'a [X],
    pub(super) workspace: &'a mut Workspace,
    pub(super) out: &'a mut [f32],
}

impl<X: Copy + Into<f64>> Kernel for Forward<'_, X> {
    type Output = Result<()>;

    #[inline(always)]
    fn run(self) -> Result<()> {
        let Self { mlp, x, workspace, out } = self;
        check_inputs(mlp, x)?;
        let (inputs, outputs) = (mlp.inputs(), mlp.outputs());
        for (x, out) in x.chunks(LANES * inputs).zip(out.chunks_mut(LANES * outputs)) {
            if x.len() <= NARROWEST * inputs {
                forward::<X, NARROWEST>(mlp, x, workspace, out);
            } else if x.len() <= NARROW * inputs {
                forward::<X, NARROW>(mlp, x, workspace, out);
            } else {
                forward::<X, LANES>(mlp, x, workspace, out);
            }
        }
        check_outputs(out, outputs)
    }
}

/// The Jacobians (N, out, in) at the points `x` (N, in).
pub(super) struct Jacobian<'a, X> {
    pub(super) mlp: &'a Mlp,
    pub(super) x: &'a [X],
    pub(super) workspace: &'a mut Workspace,
    pub(super) out: &'a mut [f32],
}

impl<X: Copy + Into<f64>> Kernel for Jacobian<'_, X> {
    type Output = Result<()>;

    #[inline(always)]
    fn run(self) -> Result<()> {
        let Self { mlp, x, workspace, out } = self;
        check_inputs(mlp, x)?;
        let (inputs, per_point) = (mlp.inputs(), mlp.outputs() * mlp.inputs());
        for (x, out) in x.chunks(LANES * inputs).zip(out.chunks_mut(LANES * per_point)) {
            if x.len() <= NARROWEST * inputs {
                jacobian::<X, NARROWEST>(mlp, x, workspace, out);
            } else if x.len() <= NARROW * inputs {
                jacobian::<X, NARROW>(mlp, x, workspace, out);
            } else {
                jacobian::<X, LANES>(mlp, x, workspace, out);
            }
        }
        check_outputs(out, per_point)
    }
}

/// Up to `W` points.
#[inline(always)]
fn forward<X: Copy + Into<f64>, const W: usize>(mlp: &Mlp, x: &[X], space: &mut Workspace, out: &mut [f32]) {
    let lines = space.lines::<W>(2 * mlp.widest);
    let (mut current, mut next) = lines.split_at_mut(mlp.widest);
    load(mlp, x, current);
    let (last, hidden) = mlp.layers.split_last().unwrap_or_else(|| unreachable!());
    for layer in hidden {
        layer.forward.of(current, next);
        for y in next[..layer.outputs].as_flattened_mut() {
            *y = tanh(*y);
        }
        std::mem::swap(&mut current, &mut next);
    }
    last.forward.of(current, next);
    let scale = mlp.output.std.iter().zip(&mlp.output.mean);
    for (o, (y, (&std, &mean))) in next.iter().zip(scale).enumerate() {
        let y = y.map(|y| (f64::from(y) * std + mean) as f32);
        store(y, &mut out[o..], last.outputs);
    }
}

/// Up to `W` points. Goes backwards from one output at a time, for there are fewer outputs than inputs.
#[inline(always)]
fn jacobian<X: Copy + Into<f64>, const W: usize>(mlp: &Mlp, x: &[X], space: &mut Workspace, out: &mut [f32]) {
    let lines = space.lines::<W>(2 * mlp.widest + mlp.hidden);
    let (lines, all_slopes) = lines.split_at_mut(2 * mlp.widest);
    let (mut current, mut next) = lines.split_at_mut(mlp.widest);
    load(mlp, x, current);
    let (last, hidden) = mlp.layers.split_last().unwrap_or_else(|| unreachable!());
    let mut slopes = &mut all_slopes[..];
    for layer in hidden {
        layer.forward.of(current, next);
        let slope;
        (slope, slopes) = slopes.split_at_mut(layer.outputs);
        let y = next[..layer.outputs].as_flattened_mut();
        for (y, slope) in y.iter_mut().zip(slope.as_flattened_mut()) {
            *y = tanh(*y);
            *slope = 1.0 - *y * *y;
        }
        std::mem::swap(&mut current, &mut next);
    }
    let (inputs, per_point) = (mlp.inputs(), mlp.inputs() * last.outputs);
    for o in 0..last.outputs {
        // By the inputs of the last layer, which is linear, the gradient is its row of weights.
        for (g, &w) in current.iter_mut().zip(last.row(o)) {
            *g = [w; W];
        }
        let mut end = mlp.hidden;
        for layer in hidden.iter().rev() {
            let slopes = all_slopes[end - layer.outputs..end].as_flattened();
            for (g, slope) in current.as_flattened_mut().iter_mut().zip(slopes) {
                *g *= slope;
            }
            layer.backward.of(current, next);
            std::mem::swap(&mut current, &mut next);
            end -= layer.outputs;
        }
        let per_std = mlp.input_rates.iter();
        for (i, (g, rate)) in current.iter().zip(per_std).enumerate() {
            let scale = mlp.output.std[o] * rate;
            let g = g.map(|g| (f64::from(g) * scale) as f32);
            store(g, &mut out[o * inputs + i..], per_point);
        }
    }
}

/// Scales a block of points and transposes it, one point to a lane. The last point fills the lanes left over.
#[inline(always)]
fn load<X: Copy + Into<f64>, const W: usize>(mlp: &Mlp, x: &[X], block: &mut [[f32; W]]) {
    let inputs = mlp.inputs();
    let mut rows = [&x[x.len() - inputs..]; W];
    for (row, x) in rows.iter_mut().zip(x.chunks_exact(inputs)) {
        *row = x;
    }
    let scale = mlp.input.mean.iter().zip(&mlp.input_rates);
    for (i, (line, (mean, rate))) in block[..inputs].iter_mut().zip(scale).enumerate() {
        // One input at a time: a compiler that sees several makes vectors of them and scatters those over the
        // lines, which is slow.
        let i = std::hint::black_box(i).min(inputs - 1);
        *line = rows.map(|row| ((row[i].into() - mean) * rate) as f32);
    }
}

/// Writes one number of every point, `stride` apart.
#[inline(always)]
fn store<const W: usize>(values: [f32; W], out: &mut [f32], stride: usize) {
    for (out, value) in out.iter_mut().step_by(stride).zip(values) {
        *out = value;
    }
}

#[inline(always)]
fn check_inputs<X: Copy + Into<f64>>(mlp: &Mlp, x: &[X]) -> Result<()> {
    // Without an early exit the test of a good input is a loop of vectors.
    let good = x.iter().fold(true, |good, &x| good & x.into().is_finite());
    if good { Ok(()) } else { Err(infinite_input(mlp.inputs(), x)) }
}

#[cold]
fn infinite_input<X: Copy + Into<f64>>(inputs: usize, x: &[X]) -> Error {
    let at = x.iter().position(|&x| !x.into().is_finite()).unwrap_or(0);
    Error::element("x", &[at / inputs, at % inputs], "finite", x[at].into())
}

#[inline(always)]
fn check_outputs(out: &[f32], per_point: usize) -> Result<()> {
    let good = out.iter().fold(true, |good, y| good & y.is_finite());
    if good { Ok(()) } else { Err(infinite_output(out, per_point)) }
}

#[cold]
fn infinite_output(out: &[f32], per_point: usize) -> Error {
    let at = out.iter().position(|y| !y.is_finite()).unwrap_or(0);
    let row = at / per_point;
    Error::conflict("x", format!("has a row {row} for which the network overflows float32"))
}
