//! Histogram intersections of every window.

use motorprime::scan::{Scan, Workspace};
use motorprime::{Shape, Simd};

use crate::case::{Case, Draw, ensure, same_bits, stress};

#[test]
fn histogram_intersections() {
    stress::<Windows>(2500);
}

#[derive(Debug)]
struct Windows {
    shape: Shape,
    bins: Vec<u16>,
    target: Vec<f32>,
    window: [usize; 2],
    stride: usize,
    bands: usize,
    wanted: Option<Vec<bool>>,
}

impl Case for Windows {
    type Space = (Workspace, Vec<f32>);
    const NAME: &str = "histogram intersections";

    fn draw(draw: &mut Draw) -> Self {
        let shape = draw.shape();
        let [height, width] = [shape.height(), shape.width()];
        let kinds = draw.pick(&[1, 2, 9, 40]);
        let empty = draw.pick(&[0.0, 0.5, 0.99]);
        // Runs of pixels without any bin, as grey walls make them.
        let mut left = 0;
        let bins = (0..shape.pixels()).map(|_| {
            if left == 0 && draw.chance(empty) {
                left = 1 + draw.below(80);
            }
            if left > 0 {
                left -= 1;
                return u16::MAX;
            }
            draw.below(kinds + 2) as u16
        });
        let bins = bins.collect();
        let mut target: Vec<f32> =
            (0..kinds).map(|_| draw.pick(&[0.0, 1.0]) as f32 * draw.octaves(-20, 4) as f32).collect();
        target[draw.below(kinds)] = draw.pick(&[0.1, 1.0, f32::MAX, f32::from_bits(1)]);
        let window = [1 + draw.below(height), 1 + draw.below(width)];
        let stride = draw.pick(&[1, 1, 2, 5, 1000]);
        let scan = Scan { target: &target, window, stride, wanted: None };
        let places = scan.places(shape).expect("it fits").pixels();
        let share = draw.pick(&[0.0, 0.02, 0.5]);
        let wanted = draw.chance(0.5).then(|| (0..places).map(|_| draw.chance(share)).collect());
        Self { shape, bins, target, window, stride, bands: 1 + draw.below(6), wanted }
    }

    fn check(&self, (workspace, first): &mut Self::Space) -> Result<f64, String> {
        let Self { shape, bins, target, window, stride, bands, wanted } = self;
        let scan = Scan { target, window: *window, stride: *stride, wanted: wanted.as_deref() };
        let places = scan.places(*shape).map_err(|e| e.to_string())?;
        first.clear();
        for (k, simd) in Simd::all().into_iter().enumerate() {
            let mut out = vec![f32::NAN; places.pixels()];
            scan.run_on(simd, bins, *shape, bands + k, workspace, &mut out).map_err(|e| e.to_string())?;
            if first.is_empty() {
                first.clone_from(&out);
            }
            ensure(same_bits(first, &out), || format!("{} differs: {out:?}, not {first:?}", simd.name()))?;
        }
        let mut worst: f64 = 0.0;
        for (k, &found) in first.iter().enumerate() {
            let expected = if wanted.as_ref().is_none_or(|wanted| wanted[k]) {
                self.counted(k / places.width() * stride, k % places.width() * stride)
            } else {
                0.0
            };
            worst = worst.max((f64::from(found) - expected).abs() / 1e-6);
        }
        ensure(worst <= 1.0, || format!("off by {worst} millionths")).map(|()| worst)
    }
}

impl Windows {
    /// The score of one window, by counting.
    fn counted(&self, top: usize, left: usize) -> f64 {
        let [height, width] = self.window;
        let mut counts = vec![0.0; self.target.len()];
        for v in top..top + height {
            for &bin in &self.bins[v * self.shape.width() + left..][..width] {
                if let Some(count) = counts.get_mut(usize::from(bin)) {
                    *count += 1.0;
                }
            }
        }
        let area = (height * width) as f64;
        counts.iter().zip(&self.target).map(|(&n, &share): (&f64, _)| (n / area).min(f64::from(share))).sum()
    }
}
