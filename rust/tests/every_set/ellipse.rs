//! Ellipses.

use motorprime::gaussian::Gaussian;
use motorprime::{Shape, Simd, Support};

use crate::case::{Case, Draw, ensure, same_bits, stress};

#[test]
fn ellipses() {
    stress::<Ellipse>(2500);
}

/// Of the value 1 at the mean.
const TOLERANCE: f64 = 1e-6;

#[derive(Debug)]
struct Ellipse {
    shape: Shape,
    gaussian: Gaussian,
}

impl Case for Ellipse {
    type Space = Support;
    const NAME: &str = "ellipses";

    fn draw(draw: &mut Draw) -> Self {
        let shape = draw.shape();
        let mut factor = || match draw.below(20) {
            0 => draw.pick(&[1e-100, 1e100, 1e-30, 1e30, 1.0, 0.5]),
            1 => draw.octaves(-332, 332),
            2..5 => draw.octaves(-20, 24),
            5..8 => (1 + draw.below(20)) as f64,
            _ => draw.between(0.1, 20.0),
        };
        let (l1, l3) = (factor(), factor());
        let lean = draw.sign() * draw.pick(&[0.0, 1.0, l1, l3, 0.3 * l1, 1e3 * l1, 1e100]);
        let l2 = if draw.chance(0.7) { draw.between(-15.0, 15.0) } else { lean };
        let [cutoff, mixing] = [
            match draw.below(12) {
                0 => draw.pick(&[1e-100, 1e100, 1e-8, 13.2, 60.0]),
                1 => draw.octaves(-332, 332),
                2..5 => 3.0,
                _ => draw.between(0.1, 8.0),
            },
            draw.pick(&[0.0, 1.0, 0.5, 1e-300, 1.0 - f64::EPSILON / 2.0]),
        ];
        let mut place = |size: usize, reach: f64| match draw.below(10) {
            0 => draw.pick(&[1e300, -1e300, 1e9, -1e9, 1e-300, -0.0]),
            1..4 => (draw.unit() * size as f64).floor(),
            // The border falls on a pixel.
            4..6 => (draw.unit() * size as f64).floor() + draw.sign() * reach * draw.nearly_one(),
            _ => draw.between(-0.5, 1.5) * size as f64,
        };
        let mean = [place(shape.width(), cutoff * l1), place(shape.height(), cutoff * l3)];
        let mut gaussian = Gaussian { mean, chol: [l1, l2, l3], cutoff, mixing };
        if draw.chance(0.01) {
            let bad = draw.pick(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY]);
            match draw.below(4) {
                0 => gaussian.mean[draw.below(2)] = bad,
                1 => gaussian.chol[draw.below(3)] = bad,
                2 => gaussian.cutoff = draw.pick(&[bad, 0.0, -1.0, 1e101]),
                _ => gaussian.mixing = draw.pick(&[bad, 1.1, -0.1]),
            }
        }
        Self { shape, gaussian }
    }

    fn check(&self, support: &mut Support) -> Result<f64, String> {
        let valid = self.valid();
        let mut first: Option<Vec<f32>> = None;
        for simd in Simd::all() {
            let mut out = vec![f32::NAN; self.shape.pixels()];
            let done = self.gaussian.landscape_on(simd, self.shape, support, &mut out);
            ensure(done.is_ok() == valid, || format!("{}: {done:?}", simd.name()))?;
            if !valid {
                return Ok(0.0);
            }
            if let Some(first) = &first {
                ensure(same_bits(first, &out), || format!("{} gives other bits", simd.name()))?;
            }
            first.get_or_insert(out);
        }
        self.compare(support, &first.unwrap_or_default())
    }
}

impl Ellipse {
    fn valid(&self) -> bool {
        let Gaussian { mean, chol: [l1, l2, l3], cutoff, mixing } = self.gaussian;
        let positive = [l1, l3, cutoff].iter().all(|x| (1e-100..=1e100).contains(x));
        mean.iter().all(|x| x.is_finite()) && positive && l2.abs() <= 1e100 && (0.0..=1.0).contains(&mixing)
    }

    fn compare(&self, support: &Support, out: &[f32]) -> Result<f64, String> {
        let Gaussian { mean, chol: [l1, l2, l3], cutoff, mixing } = self.gaussian;
        let half = cutoff * cutoff / 2.0;
        let uniform = -(-half).exp_m1() / half;
        let mut worst = 0.0_f64;
        for (v, row) in out.chunks_exact(self.shape.width()).enumerate() {
            let columns = support.columns(v);
            for (u, &value) in row.iter().enumerate() {
                let place = || format!("{value:e} at ({u}, {v}), support {columns:?}");
                let value = f64::from(value);
                ensure((0.0..=1.0 + TOLERANCE).contains(&value), place)?;
                ensure(value == 0.0 || columns.contains(&u), place)?;
                let (z1, dv) = ((u as f64 - mean[0]) / l1, v as f64 - mean[1]);
                let z2 = (dv - l2 * z1) / l3;
                let square = z1 * z1 + z2 * z2;
                // How far rounding may take the squared radius, whichever way it is computed.
                let slack = 1e-15 * (1.0 + z1.abs() + (dv.abs() + (l2 * z1).abs()) / l3);
                let slack = 2.0 * slack * (z1.abs() + z2.abs() + slack) + 1e-11 * cutoff * cutoff;
                let excess = square - cutoff * cutoff;
                let inside = excess <= 0.0;
                if excess.abs() > slack {
                    ensure(columns.contains(&u) == inside, || format!("{} {square:e}", place()))?;
                }
                if excess.abs() > slack || columns.contains(&u) {
                    let twin = mixing * (-square / 2.0).exp() + (1.0 - mixing) * uniform;
                    let twin = if columns.contains(&u) { twin } else { 0.0 };
                    let error = (value - twin).abs() - slack.min(1.0);
                    worst = worst.max(error);
                    ensure(error <= TOLERANCE, || format!("{} for {twin:e}", place()))?;
                }
            }
        }
        Ok(worst)
    }
}
