//! SURF: speeded-up robust features (Bay, Ess, Tuytelaars and Van Gool 2008), computed only where a mask needs it.
//!
//! Keypoints are maxima over place and scale of the Hessian's determinant, which box filters on the integral image
//! approximate; Haar wavelets give them an orientation and a descriptor. Sizes, units and thresholds are those of
//! OpenCV 3. Every sample is computed in the same way wherever a mask begins and whichever thread does it, so the
//! keypoints inside a mask have the same bits as those of the whole image.

mod descriptor;
mod hessian;
mod integral;
mod maxima;
mod orientation;
mod spans;
#[cfg(test)]
mod tests;

use descriptor::Describe;
use integral::Plane;
use maxima::{Octave, Search};
use orientation::Disc;
use spans::Spans;

use crate::error::{Error, Result};
use crate::parallel;
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};

/// Samples that are computed at a time.
const LANES: usize = 16;
/// Keypoints of one turn of a thread.
const TURN: usize = 16;
/// Turns that each thread gets to look at rows, so that all are busy to the end.
const TURNS: usize = 8;

/// A blob of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Column of its centre [px].
    pub u: f32,
    /// Row of its centre [px].
    pub v: f32,
    /// Side of the filter that it answers best [px]; its scale is 1.2 / 9 of that.
    pub size: f32,
    /// Direction of its gradient [rad], from the u axis towards the v axis, in `[0, 2 pi)`.
    pub angle: f32,
    /// Determinant of the Hessian.
    pub response: f32,
    /// Octave in which it was found, from 0.
    pub octave: i32,
    /// 1 for a dark blob, -1 for a bright one.
    pub laplacian: i32,
}

/// What is detected and described.
#[derive(Clone, Debug, PartialEq)]
pub struct Surf {
    threshold: f32,
    octaves: usize,
    layers: usize,
    upright: bool,
    extended: bool,
}

/// Buffers that serve from image to image.
#[derive(Debug, Default)]
pub struct Workspace {
    planes: Vec<Plane>,
}

/// Keypoints and their descriptors, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// The strongest first.
    pub keypoints: Vec<Keypoint>,
    /// As many numbers for each as [`Surf::numbers`].
    pub descriptors: Vec<f32>,
}

impl Surf {
    /// The widest filter [px]: its sums still fit 32 bits.
    const LARGEST_FILTER: usize = 3600;
    /// Most octaves and most layers of an octave.
    const MOST: usize = 16;

    /// Checks the parameters.
    ///
    /// Keypoints have a determinant above `threshold`, in grey levels squared. Every octave doubles the filters'
    /// sizes and the distance of the samples, and has so many layers in which maxima are found. `upright` leaves
    /// out the orientation; `extended` describes by 128 numbers instead of 64.
    ///
    /// # Errors
    /// A threshold that is negative or not finite; octaves or layers that are not 1 to 16.
    pub fn new(threshold: f64, octaves: usize, layers: usize, upright: bool, extended: bool) -> Result<Self> {
        if !(threshold >= 0.0 && threshold <= f64::from(f32::MAX)) {
            return Err(Error::scalar("hessian_threshold", "finite and not negative", threshold));
        }
        for (name, number) in [("octaves", octaves), ("layers", layers)] {
            if !(1..=Self::MOST).contains(&number) {
                let expected = format!("a whole number from 1 to {}", Self::MOST);
                return Err(Error::scalar(name, expected, number));
            }
        }
        Ok(Self { threshold: threshold as f32, octaves, layers, upright, extended })
    }

    /// Numbers of a descriptor.
    pub fn numbers(&self) -> usize {
        if self.extended { 128 } else { 64 }
    }

    /// The keypoints of a grey image whose rounded places are in the mask, on at most so many threads.
    ///
    /// # Errors
    /// An image or a mask that does not have as many pixels as the shape.
    pub fn detect(
        &self,
        gray: &[u8],
        mask: Option<&[bool]>,
        shape: Shape,
        threads: usize,
        workspace: &mut Workspace,
    ) -> Result<Features> {
        self.detect_on(Simd::best(), gray, mask, shape, threads, workspace)
    }

    /// [`Surf::detect`] on a chosen instruction set; all give the same bits.
    ///
    /// # Errors
    /// As for [`Surf::detect`].
    pub fn detect_on(
        &self,
        simd: Simd,
        gray: &[u8],
        mask: Option<&[bool]>,
        shape: Shape,
        threads: usize,
        workspace: &mut Workspace,
    ) -> Result<Features> {
        shape.check("gray", gray.len())?;
        if let Some(mask) = mask {
            shape.check("mask", mask.len())?;
        }
        let threads = threads.clamp(1, parallel::threads());
        let octaves = self.octaves_of(mask, shape);
        if octaves.iter().all(|octave| octave.extent().is_empty()) {
            return Ok(Features::default());
        }
        workspace.planes.resize_with(octaves.len(), Plane::default);
        let planes = &mut workspace.planes;
        let needed: Vec<_> = octaves.iter().map(Octave::reads).collect();
        integral::fill(simd, gray, shape, threads, &needed, planes);
        let mut keypoints = self.search(simd, &octaves, planes, threads);
        if let Some(mask) = mask {
            keypoints.retain(|keypoint| keypoint.is_in(mask, shape));
        }
        keypoints.sort_unstable_by(Keypoint::stronger);
        Ok(self.describe(simd, gray, shape, &planes[0], &keypoints, threads))
    }

    /// The octaves that fit into the image, and which of their samples the mask needs.
    fn octaves_of(&self, mask: Option<&[bool]>, shape: Shape) -> Vec<Octave> {
        let mut pixels = mask.map_or_else(|| Spans::whole(shape), |mask| Spans::of(mask, shape));
        let mut octaves = Vec::new();
        for index in 0..self.octaves {
            if index > 0 {
                pixels = pixels.halved();
            }
            let Some(octave) = Octave::new(self, index, shape, &pixels) else { break };
            octaves.push(octave);
        }
        octaves
    }

    /// All keypoints, in any order and without an angle.
    fn search(&self, simd: Simd, octaves: &[Octave], planes: &[Plane], threads: usize) -> Vec<Keypoint> {
        let all: usize = octaves.iter().map(Octave::cost).sum();
        let turns = if threads > 1 { threads * TURNS } else { 1 };
        let mut parts = Vec::new();
        for (octave, plane) in octaves.iter().zip(planes) {
            let (rows, turns) = (octave.extent(), (octave.cost() * turns).div_ceil(all.max(1)).max(1));
            let share = rows.len().div_ceil(turns).max(1);
            for start in rows.clone().step_by(share) {
                parts.push((octave, plane, start..(start + share).min(rows.end), Vec::new()));
            }
        }
        let threshold = self.threshold;
        parallel::share(threads, &mut parts, |(octave, plane, rows, found)| {
            simd.run(Search { octave, plane, threshold, rows: rows.clone(), found });
        });
        parts.into_iter().flat_map(|(_, _, _, found)| found).collect()
    }

    /// The same keypoints with their angles, and their descriptors; those that have none are left out.
    fn describe(
        &self,
        simd: Simd,
        gray: &[u8],
        shape: Shape,
        sums: &Plane,
        keypoints: &[Keypoint],
        threads: usize,
    ) -> Features {
        let numbers = self.numbers();
        let mut descriptors = vec![0.0; keypoints.len() * numbers];
        let mut keypoints: Vec<Option<Keypoint>> = keypoints.iter().copied().map(Some).collect();
        let (disc, describe) = (Disc::new(), Describe::new(gray, shape, sums, self.extended, self.upright));
        let mut turns: Vec<_> =
            keypoints.chunks_mut(TURN).zip(descriptors.chunks_mut(TURN * numbers)).collect();
        parallel::share(threads, &mut turns, |(keypoints, descriptors)| {
            let (upright, keypoints) = (self.upright, &mut **keypoints);
            let (disc, describe, descriptors) = (&disc, &describe, &mut **descriptors);
            simd.run(Turn { upright, disc, describe, shape, sums, keypoints, descriptors });
        });
        let mut kept = 0;
        for (k, _) in keypoints.iter().enumerate().filter(|(_, keypoint)| keypoint.is_some()) {
            descriptors.copy_within(k * numbers..(k + 1) * numbers, kept * numbers);
            kept += 1;
        }
        descriptors.truncate(kept * numbers);
        Features { keypoints: keypoints.into_iter().flatten().collect(), descriptors }
    }
}

impl Keypoint {
    /// Whether the mask is set at the nearest pixel.
    fn is_in(&self, mask: &[bool], shape: Shape) -> bool {
        let [u, v] = [self.u, self.v].map(|x| x.round_ties_even() as usize);
        v < shape.height() && u < shape.width() && mask[v * shape.width() + u]
    }

    /// The stronger comes first, then the larger; no two in one place are of one size.
    fn stronger(&self, other: &Self) -> std::cmp::Ordering {
        let key = |k: &Self| [k.response, k.size, k.octave as f32, k.v, k.u];
        let pairs = key(other).into_iter().zip(key(self));
        pairs.fold(std::cmp::Ordering::Equal, |order, (b, a)| order.then(b.total_cmp(&a)))
    }
}

/// Orientation and descriptor of some keypoints.
struct Turn<'a> {
    upright: bool,
    disc: &'a Disc,
    describe: &'a Describe<'a>,
    shape: Shape,
    sums: &'a Plane,
    keypoints: &'a mut [Option<Keypoint>],
    descriptors: &'a mut [f32],
}

impl Kernel for Turn<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let numbers = self.descriptors.len() / self.keypoints.len();
        for (slot, descriptor) in self.keypoints.iter_mut().zip(self.descriptors.chunks_exact_mut(numbers)) {
            let Some(mut keypoint) = *slot else { continue };
            *slot = None;
            let direction = if self.upright {
                // Upwards, as the others have it; what matters is that all have the same.
                self.disc.fits(self.shape, &keypoint).then_some([0.0, -1.0])
            } else {
                self.disc.direction(self.sums, self.shape, &keypoint)
            };
            let Some(direction) = direction else { continue };
            keypoint.angle = orientation::angle(direction);
            self.describe.write(&keypoint, direction, descriptor);
            *slot = Some(keypoint);
        }
    }
}
