//! SURF: the same bits on every set and number of threads, and inside every mask those of the whole image.

use motorprime::surf::{Features, Surf, Workspace};
use motorprime::{Shape, Simd};

use crate::case::{Case, Draw, ensure, stress};

#[test]
fn keypoints() {
    stress::<Keypoints>(60);
}

#[derive(Debug)]
struct Keypoints {
    surf: Surf,
    shape: (usize, usize),
    image: Vec<u8>,
    mask: Vec<bool>,
}

impl Case for Keypoints {
    type Space = Workspace;
    const NAME: &str = "keypoints";

    fn draw(draw: &mut Draw) -> Self {
        let threshold = draw.pick(&[0.0, 30.0, 300.0, 3000.0]);
        let (octaves, layers) = (1 + draw.below(5), 1 + draw.below(4));
        let surf = Surf::new(threshold, octaves, layers, draw.chance(0.3), draw.chance(0.3)).unwrap();
        let (height, width) = (20 + draw.below(110), 20 + draw.below(130));
        let mut image = vec![draw.below(256) as u8; height * width];
        for _ in 0..1 + draw.below(150) {
            let (rows, columns) = (stretch(draw, height), stretch(draw, width));
            let brightness = draw.below(256) as u8;
            for v in rows {
                image[v * width..][columns.clone()].fill(brightness);
            }
        }
        let mut mask = vec![false; height * width];
        match draw.below(5) {
            // Single pixels, a line across, a line down, rectangles, noise.
            0 => (0..1 + draw.below(40)).for_each(|_| mask[draw.below(height * width)] = true),
            1 => mask[draw.below(height) * width..][..width].fill(true),
            2 => {
                let column = draw.below(width);
                (0..height).for_each(|v| mask[v * width + column] = true);
            }
            3 => {
                for _ in 0..1 + draw.below(4) {
                    let (rows, columns) = (stretch(draw, height), stretch(draw, width));
                    rows.for_each(|v| mask[v * width..][columns.clone()].fill(true));
                }
            }
            _ => mask.iter_mut().for_each(|pixel| *pixel = draw.chance(0.1)),
        }
        Self { surf, shape: (height, width), image, mask }
    }

    fn check(&self, space: &mut Workspace) -> Result<f64, String> {
        let shape = Shape::new(self.shape.0, self.shape.1).unwrap();
        let mut run = |image: &[u8], simd, mask, threads| {
            self.surf.detect_on(simd, image, mask, shape, threads, space).map_err(|e| e.to_string())
        };
        let negative: Vec<u8> = self.image.iter().map(|pixel| 255 - pixel).collect();
        let whole = run(&self.image, Simd::all()[0], None, 1)?;
        let inside = self.inside(&whole);
        for simd in Simd::all() {
            for threads in [1, 2, 5] {
                let same = bits(&run(&self.image, simd, None, threads)?) == bits(&whole);
                ensure(same, || format!("{} on {threads} threads differs", simd.name()))?;
                // What a buffer holds from another image must not matter.
                run(&negative, simd, None, 1)?;
                let masked = run(&self.image, simd, Some(&self.mask), threads)?;
                let counts = || {
                    let (found, wanted) = (masked.keypoints.len(), inside.keypoints.len());
                    format!("{} on {threads} threads: {found} inside, not {wanted}", simd.name())
                };
                ensure(bits(&masked) == bits(&inside), counts)?;
            }
        }
        Ok(0.0)
    }
}

impl Keypoints {
    /// The features of the whole image whose rounded places are in the mask.
    fn inside(&self, whole: &Features) -> Features {
        let (mut inside, numbers) = (Features::default(), self.surf.numbers());
        for (keypoint, descriptor) in whole.keypoints.iter().zip(whole.descriptors.chunks_exact(numbers)) {
            let [u, v] = [keypoint.u, keypoint.v].map(|x| x.round_ties_even() as usize);
            if self.mask[v * self.shape.1 + u] {
                inside.keypoints.push(*keypoint);
                inside.descriptors.extend(descriptor);
            }
        }
        inside
    }
}

/// Some of the numbers below `size`, one after the other.
fn stretch(draw: &mut Draw, size: usize) -> std::ops::Range<usize> {
    let start = draw.below(size);
    start..(start + 1 + draw.below(1 + size / 4)).min(size)
}

fn bits(features: &Features) -> Vec<u32> {
    let numbers = features.keypoints.iter().flat_map(|k| {
        let place = [k.u, k.v, k.size, k.angle, k.response].map(f32::to_bits);
        place.into_iter().chain([k.octave as u32, k.laplacian as u32])
    });
    numbers.chain(features.descriptors.iter().map(|x| x.to_bits())).collect()
}
