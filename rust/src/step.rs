//! One cycle of attention in one call: from the plan or the posture to where each camera shall look.
//!
//! It gives what the single kernels give one after the other, bit for bit, and is faster in two ways: nothing
//! goes back to the caller between them, and a landscape hands its support to the sampler or the threshold.

use std::cmp::Ordering;

use crate::error::{Error, Result};
use crate::gaussian::Gaussian;
use crate::gibbs::{Gibbs, Schedule};
use crate::kernel::{self, Kernel, Trajectory, Widths};
use crate::masses::{Landscape, Masses};
use crate::mlp::{self, Mlp};
use crate::parallel;
use crate::rng::{Xoshiro256PlusPlus, uniform};
use crate::shape::Shape;
use crate::simd::Simd;
use crate::support::Support;
use crate::threshold::{self, Method, Wanted, threshold_on};

/// Points nearer than this to a camera's plane [m], or behind it, have no pixel.
const NEAREST: f64 = 0.01;

/// The logarithms of the factors of a learned ellipse are clipped to this: from far below a pixel to far
/// beyond any image.
const LOG_FACTOR: f64 = 12.0;

/// How a camera's landscape follows from the plan.
#[derive(Clone, Copy, Debug)]
pub enum Map<'a> {
    /// The plan's points are projected already, to (u, v) [px]. NaN marks a point that has no pixel.
    Pixels(&'a [[f64; 2]]),
    /// Projection matrix (3, 4), row-major, of any scale and sign.
    Matrix(&'a [f64; 12]),
    /// A network from (x, y, z, joints) to (u, v), and one from the same that is negative for points out of view.
    Network(&'a Mlp, Option<&'a Mlp>),
    /// A network from the joints to the ellipse of the reachable space, (u, v, ln L1, L2, ln L3).
    Ellipse(&'a Mlp),
}

/// Where to look, to be filled.
#[derive(Debug)]
pub enum Look<'a> {
    /// Centres (u, v) of windows, Gibbs samples of the landscape from an exact start.
    Windows(&'a mut [i32]),
    /// The most relevant pixels.
    Mask(Wanted, &'a mut [bool]),
}

/// What all cameras share.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    /// The path of the hand [m] in the root frame; unused by ellipses and by pixels.
    pub points: &'a [[f64; 3]],
    /// The posture [rad].
    pub joints: &'a [f64],
    /// Profile of the kernels on the path.
    pub kernel: Kernel,
    /// Radius and mixing of the ellipses.
    pub cutoff: f64,
    /// Share of the Gaussian in its mixture with a uniform.
    pub mixing: f64,
}

/// One camera: what goes in and what comes out.
#[derive(Debug)]
pub struct View<'a> {
    /// Size of its image.
    pub shape: Shape,
    /// Side [px] of the square cells of the image for which the landscape has one element each.
    pub stride: usize,
    /// How the plan appears in it.
    pub map: Map<'a>,
    /// Kernel widths (horizontal, vertical) [px].
    pub width: [f64; 2],
    /// Starts the generator of the windows.
    pub seed: u64,
    /// The landscape, one element for each cell.
    pub landscape: &'a mut [f32],
    /// Where to look.
    pub look: Look<'a>,
}

/// What a camera has of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sight {
    /// Nothing: all of it lies behind the camera. The outputs are not written.
    Behind,
    /// Nothing: it lies beside the image. The landscape is zero everywhere; the look is not written.
    Beside,
    /// Something. The threshold of a mask.
    Seen(Option<f64>),
}

/// Buffers of one camera; a call with a warmed-up workspace allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    inputs: Vec<f64>,
    outputs: Vec<f32>,
    seen: Vec<f32>,
    pixels: Vec<[f64; 2]>,
    support: Support,
    masses: Masses,
    mlp: mlp::Workspace,
    kernel: kernel::Workspace,
    threshold: threshold::Workspace,
}

/// A camera, its buffers, and what comes of it.
#[derive(Debug)]
pub struct Task<'a> {
    /// The camera.
    pub view: View<'a>,
    /// Its buffers.
    pub workspace: &'a mut Workspace,
    /// The result, once [`run`] is done.
    pub result: Result<Sight>,
}

/// Runs every camera's task, at once on several threads or one after the other; with the same results.
pub fn run(plan: &Plan<'_>, tasks: &mut [Task<'_>], threads: bool) {
    let work = |_: usize, task: &mut Task<'_>| {
        task.result = task.view.run(Simd::best(), plan, task.workspace);
    };
    if threads {
        parallel::for_each(tasks, work);
    } else {
        tasks.iter_mut().for_each(|task| work(0, task));
    }
}

impl View<'_> {
    /// Makes the landscape and looks.
    ///
    /// # Errors
    /// As the kernels that it calls; a network that does not fit the joints.
    pub fn run(&mut self, simd: Simd, plan: &Plan<'_>, workspace: &mut Workspace) -> Result<Sight> {
        let cells = Cells::of(self.shape, self.stride)?;
        if let Map::Ellipse(network) = self.map {
            let gaussian = cells.ellipse(ellipse(simd, network, plan, workspace)?);
            gaussian.landscape_on(simd, cells.shape, &mut workspace.support, self.landscape)?;
        } else {
            project(simd, self.map, plan, workspace)?;
            if workspace.pixels.is_empty() {
                return Ok(Sight::Behind);
            }
            let Workspace { pixels, kernel, support, .. } = workspace;
            cells.path(pixels);
            // A kernel between the centres of cells would leave no trace.
            if self.stride > 1 && self.width.iter().any(|&width| width < cells.side) {
                let expected = format!("at most the kernel's width, here {:?} px", self.width);
                return Err(Error::scalar("stride", expected, self.stride));
            }
            let widths = Widths::Common(self.width.map(|width| width / cells.side));
            let path = Trajectory { points: pixels, widths, kernel: plan.kernel, weights: None };
            path.landscape_on(simd, cells.shape, kernel, support, self.landscape)?;
        }
        let rows = workspace.support.rows();
        let inside = &self.landscape[rows.start * cells.shape.width()..rows.end * cells.shape.width()];
        // A support may be empty, and a tiny value at its rim may have become 0 in float32.
        if !inside.iter().any(|&p| p > 0.0) {
            return Ok(Sight::Beside);
        }
        match &mut self.look {
            Look::Windows(centres) => {
                let Workspace { masses, support, .. } = workspace;
                let mut rng = Xoshiro256PlusPlus::new(self.seed);
                let landscape =
                    Landscape { pixels: self.landscape, shape: cells.shape, support: Some(support) };
                let mut chain = Gibbs::new(simd, landscape, masses)?;
                chain.start_drawn(&mut rng);
                chain.run(&mut rng, u64::MAX, &mut Schedule::new(0, 1), centres);
                if self.stride > 1 {
                    let sides = [self.shape.width(), self.shape.height()];
                    for pixel in centres.as_chunks_mut::<2>().0 {
                        *pixel = std::array::from_fn(|k| within(pixel[k], self.stride, sides[k], &mut rng));
                    }
                }
                Ok(Sight::Seen(None))
            }
            Look::Mask(wanted, mask) => {
                let count = Wanted::Count(wanted.of(cells.shape.pixels(), self.stride)? as u64);
                let rows = Shape::new(rows.len(), cells.shape.width())?;
                let level =
                    threshold_on(simd, inside, rows, count, 1, Method::Select, &mut workspace.threshold)?;
                self.shape.check("mask", mask.len())?;
                if self.stride == 1 {
                    for (m, &p) in mask.iter_mut().zip(&*self.landscape) {
                        *m = f64::from(p) >= level;
                    }
                } else {
                    let lines = self.landscape.chunks_exact(cells.shape.width());
                    for (band, line) in mask.chunks_mut(self.shape.width() * self.stride).zip(lines) {
                        let (first, others) = band.split_at_mut(self.shape.width());
                        for (cell, &p) in first.chunks_mut(self.stride).zip(line) {
                            cell.fill(f64::from(p) >= level);
                        }
                        others.chunks_exact_mut(first.len()).for_each(|row| row.copy_from_slice(first));
                    }
                }
                Ok(Sight::Seen(Some(level)))
            }
        }
    }
}

/// An image in square cells, and places in it in units of them, with the centres of cells at whole numbers.
struct Cells {
    shape: Shape,
    side: f64,
    /// Centre of the first one [px].
    first: f64,
}

impl Cells {
    /// Cells of `side` pixels, of which the last ones in a row or a column may reach beyond the image.
    fn of(image: Shape, side: usize) -> Result<Self> {
        if side == 0 {
            return Err(Error::scalar("stride", "at least 1", side));
        }
        let shape = Shape::new(image.height().div_ceil(side), image.width().div_ceil(side))?;
        Ok(Self { shape, side: side as f64, first: (side as f64 - 1.0) / 2.0 })
    }

    fn path(&self, pixels: &mut [[f64; 2]]) {
        // Not even the last bit changes where cells are pixels.
        if self.side > 1.0 {
            pixels.as_flattened_mut().iter_mut().for_each(|x| *x = (*x - self.first) / self.side);
        }
    }

    fn ellipse(&self, of_pixels: Gaussian) -> Gaussian {
        let mean = of_pixels.mean.map(|x| (x - self.first) / self.side);
        Gaussian { mean, chol: of_pixels.chol.map(|x| x / self.side), ..of_pixels }
    }
}

/// A pixel of a cell, each as likely as the others; along one axis, on which the image is `most` pixels long.
fn within(cell: i32, side: usize, most: usize, rng: &mut Xoshiro256PlusPlus) -> i32 {
    let first = cell as usize * side;
    let pixels = side.min(most - first);
    (first + ((uniform(rng) * pixels as f64) as usize).min(pixels - 1)) as i32
}

/// The pixels of the plan's points in front of the camera.
fn project(simd: Simd, map: Map<'_>, plan: &Plan<'_>, workspace: &mut Workspace) -> Result<()> {
    let pixels = &mut workspace.pixels;
    pixels.clear();
    match map {
        Map::Pixels(given) => {
            pixels.extend(given.iter().filter(|p| !p[0].is_nan() && !p[1].is_nan()));
        }
        Map::Matrix(matrix) => {
            let matrix = normalised(matrix)?;
            for &[x, y, z] in plan.points {
                let row = |k: usize| {
                    matrix[4 * k] * x + matrix[4 * k + 1] * y + matrix[4 * k + 2] * z + matrix[4 * k + 3]
                };
                let depth = row(2);
                if depth >= NEAREST {
                    pixels.push([row(0) / depth, row(1) / depth]);
                }
            }
        }
        Map::Network(place, sight) => {
            let Workspace { inputs, outputs, seen, mlp, .. } = workspace;
            let joints = plan.joints.len();
            fits(place, "points and", joints, 3 + joints, 2)?;
            inputs.clear();
            for point in plan.points {
                inputs.extend_from_slice(point);
                inputs.extend_from_slice(plan.joints);
            }
            outputs.resize(2 * plan.points.len(), 0.0);
            place.forward_on(simd, inputs, mlp, outputs)?;
            seen.clear();
            seen.resize(plan.points.len(), 0.0);
            if let Some(sight) = sight {
                fits(sight, "points and", joints, 3 + joints, 1)?;
                sight.forward_on(simd, inputs, mlp, seen)?;
            }
            let places = outputs.as_chunks::<2>().0.iter().zip(&*seen);
            pixels.extend(places.filter(|&(_, &seen)| seen >= 0.0).map(|(p, _)| p.map(f64::from)));
        }
        Map::Ellipse(_) => {}
    }
    Ok(())
}

/// The same camera with the scale and the sign at which the third row gives the depth in front of it [m].
fn normalised(matrix: &[f64; 12]) -> Result<[f64; 12]> {
    let row = |k: usize| [matrix[4 * k], matrix[4 * k + 1], matrix[4 * k + 2]];
    let ([a, b, c], [d, e, f], [g, h, i]) = (row(0), row(1), row(2));
    let volume = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    let length = |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt();
    let lengths = [0, 1, 2].map(|k| length(row(k)));
    if volume.abs().partial_cmp(&(1e-9 * lengths.iter().product::<f64>())) != Some(Ordering::Greater) {
        let expected = "a projection matrix whose left 3 x 3 part is not singular";
        return Err(Error::scalar("maps", expected, volume));
    }
    let scale = volume.signum() / lengths[2];
    Ok(matrix.map(|x| x * scale))
}

/// The ellipse that a network gives for the posture.
fn ellipse(simd: Simd, network: &Mlp, plan: &Plan<'_>, workspace: &mut Workspace) -> Result<Gaussian> {
    fits(network, "no points but", plan.joints.len(), plan.joints.len(), 5)?;
    let mut out = [0.0_f32; 5];
    network.forward_on(simd, plan.joints, &mut workspace.mlp, &mut out)?;
    let [u, v, l1, l2, l3] = out.map(f64::from);
    let factor = |log: f64| log.clamp(-LOG_FACTOR, LOG_FACTOR).exp();
    let (cutoff, mixing) = (plan.cutoff, plan.mixing);
    Ok(Gaussian { mean: [u, v], chol: [factor(l1), l2, factor(l3)], cutoff, mixing })
}

/// Checks the size of a network against what the caller gave.
fn fits(network: &Mlp, given: &str, joints: usize, inputs: usize, outputs: usize) -> Result<()> {
    if (network.inputs(), network.outputs()) == (inputs, outputs) {
        return Ok(());
    }
    // What is missing is more often an argument than a unit of the network.
    let expected =
        format!("a network of {inputs} inputs and {outputs} outputs, with {given} {joints} joints");
    let found = format!("one of {} and {}", network.inputs(), network.outputs());
    Err(Error::shape("maps", expected, found))
}
