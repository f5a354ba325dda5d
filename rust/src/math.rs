//! Elementary functions in float32, free of branches so that loops over them vectorise.
//!
//! They use additions, multiplications and bit operations only, in a fixed order and without fused
//! multiply-add, so every machine returns the same bits.

/// `2^x` for x in `[-126, 0]`: relative error below 2e-7, exactly 1 at 0. Any other x gives nonsense, but NaN
/// stays NaN.
#[inline(always)]
pub fn exp2_nonpositive(x: f32) -> f32 {
    // x = n + r with |r| <= 1/2. Adding 1.5 * 2^23 rounds to the nearest integer, which then stands in the low
    // bits of the sum.
    const MAGIC: f32 = 12_582_912.0;
    let shifted = x + MAGIC;
    let r = x - (shifted - MAGIC);
    // Fitted to the smallest relative error with 1 fixed at 0; 1.1e-7 before rounding.
    let mut p = 1.330_060_7e-3;
    for c in [9.669_691e-3, 5.550_558_5e-2, 0.240_222_83, std::f32::consts::LN_2, 1.0] {
        p = p * r + c;
    }
    // The bits of MAGIC that the shift keeps are zero: this multiplies by 2^n.
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// `tanh(x)`: absolute error below 2e-7, exactly odd, 0 at 0, rising, and exactly 1 from 9.1 on. NaN stays NaN.
#[inline(always)]
pub fn tanh(x: f32) -> f32 {
    // (1 - e) / (1 + e) with e = exp(-2 |x|) = 2^t. The rounding of t grows with |t|, but e then weighs less and
    // less: one constant in float32 is precise enough.
    const SLOPE: f32 = -2.0 * std::f32::consts::LOG2_E;
    // Below this e is far too small to change 1 + e, and above it its exponent is a valid one.
    const FLOOR: f32 = -64.0;
    let t = SLOPE * x.abs();
    // In this order the comparison is one instruction and lets NaN pass.
    let t = if t < FLOOR { FLOOR } else { t };
    let e = exp2_nonpositive(t);
    ((1.0 - e) / (1.0 + e)).copysign(x)
}

/// The angle of `(x, y)` in radians, in `[-pi, pi]`: error below 4e-7, 0 at the origin. Finite numbers only.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (across, up) = (x.abs(), y.abs());
    let (small, large) = if across < up { (across, up) } else { (up, across) };
    let t = if large > 0.0 { small / large } else { 0.0 };
    let square = t * t;
    // Fitted to the smallest error of atan(t) / t on [0, 1].
    let mut p = 2.456_719e-3;
    for c in [
        -1.440_133_5e-2,
        3.978_118_7e-2,
        -7.234_854e-2,
        0.104_989_45,
        -0.141_612_29,
        0.199_859_07,
        -0.333_325_98,
        0.999_999_9,
    ] {
        p = p * square + c;
    }
    let angle = t * p;
    let angle = if across < up { std::f32::consts::FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { std::f32::consts::PI - angle } else { angle };
    if y < 0.0 { -angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp2_is_accurate_over_its_whole_range() {
        let worst = (0..=1_260_000)
            .map(|i| -(i as f32) * 1e-4)
            .map(|x| (f64::from(exp2_nonpositive(x)) / f64::from(x).exp2() - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(worst < 2e-7, "{worst:e}");
        assert_eq!(exp2_nonpositive(0.0), 1.0);
        assert_eq!(exp2_nonpositive(-126.0), f32::MIN_POSITIVE);
    }

    #[test]
    fn tanh_is_accurate_odd_and_saturates() {
        // Every 61st float32 from the subnormal ones to 20, upwards.
        let (mut worst, mut last) = (0.0_f64, 0.0);
        for bits in (0..=20.0_f32.to_bits()).step_by(61) {
            let x = f32::from_bits(bits);
            let y = tanh(x);
            worst = worst.max((f64::from(y) - f64::from(x).tanh()).abs());
            assert!(y >= last && y <= 1.0, "{x:e} {y:e}");
            assert_eq!((-y).to_bits(), tanh(-x).to_bits());
            last = y;
        }
        assert!(worst < 2e-7, "{worst:e}");
        assert_eq!(tanh(0.0).to_bits(), 0.0_f32.to_bits());
        assert_eq!(tanh(-0.0).to_bits(), (-0.0_f32).to_bits());
        for x in [9.1, 64.0, 1e20, f32::MAX, f32::INFINITY] {
            assert_eq!((tanh(x), tanh(-x)), (1.0, -1.0), "{x}");
        }
        assert!(tanh(f32::NAN).is_nan() && tanh(-f32::NAN).is_nan());
    }
    #[test]
    fn atan2_is_accurate_all_around_and_keeps_to_the_right_quadrant() {
        let mut worst = 0.0_f64;
        for i in 0..200_000 {
            let angle = f64::from(i) * 3.2e-5 - 3.2;
            for length in [1e-20, 1.0, 1e18] {
                let (y, x) = ((length * angle.sin()) as f32, (length * angle.cos()) as f32);
                worst = worst.max((f64::from(atan2(y, x)) - f64::from(y).atan2(f64::from(x))).abs());
            }
        }
        assert!(worst < 4e-7, "{worst:e}");
        let half = std::f32::consts::FRAC_PI_2;
        let axes = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]];
        assert_eq!(axes.map(|[y, x]| atan2(y, x)), [0.0, 0.0, half, 2.0 * half, -half]);
    }
}
