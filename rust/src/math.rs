//! Elementary functions in float32, free of branches so that loops over them vectorise.
//!
//! They use additions, multiplications and bit operations only, in a fixed order and without fused
//! multiply-add, so every machine returns the same bits.

/// Arguments below this give the smallest normal float32 (and not a subnormal or zero).
pub const EXP_FLOOR: f32 = -87.0;

/// `exp(x)` for `x <= 0`: relative error below 2e-7 on `[EXP_FLOOR, 0]`, exactly 1 at 0.
#[inline(always)]
pub fn exp_nonpositive(x: f32) -> f32 {
    // x = n ln 2 + r, |r| <= ln 2 / 2. Adding 1.5 * 2^23 rounds to the nearest integer, which then stands
    // in the low bits of the sum. ln 2 is split in two parts, the first with few bits: n * HIGH is exact.
    const MAGIC: f32 = 12_582_912.0;
    const HIGH: f32 = 0.693_359_4;
    const LOW: f32 = -2.121_944_4e-4;
    // Written out, the comparison is one instruction; `f32::max` has NaN to think of.
    let x = if x > EXP_FLOOR { x } else { EXP_FLOOR };
    let shifted = x * std::f32::consts::LOG2_E + MAGIC;
    let n = shifted - MAGIC;
    let r = (x - n * HIGH) - n * LOW;
    // Taylor's series of exp(r); its next term is below 6e-9.
    let mut p = 1.0 / 5040.0;
    for c in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        p = p * r + c;
    }
    let exponent = shifted.to_bits().wrapping_sub(MAGIC.to_bits());
    p * f32::from_bits(exponent.wrapping_add(127) << 23)
}

/// `2^x` for x in `[-126, 0]`: relative error below 1.5e-7, exactly 1 at 0. Any other x gives nonsense.
#[inline(always)]
pub fn exp2_nonpositive(x: f32) -> f32 {
    // x = n + f, |f| <= 1/2, and adding n to the exponent of 2^f multiplies by 2^n.
    const MAGIC: f32 = 12_582_912.0;
    let shifted = x + MAGIC;
    let f = x - (shifted - MAGIC);
    // Fitted to the smallest relative error with 1 fixed at 0; 2e-9 before rounding.
    let mut p = 1.535_336_2e-4;
    for c in [1.339_887_5e-3, 9.618_437e-3, 5.550_332_4e-2, 0.240_226_48, std::f32::consts::LN_2, 1.0] {
        p = p * f + c;
    }
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// `tanh(x)`: absolute error below 2e-7, exactly odd, 0 at 0, rising, and exactly 1 from 9.1 on. NaN stays NaN.
#[inline(always)]
pub fn tanh(x: f32) -> f32 {
    // (1 - e) / (1 + e) with e = exp(-2 |x|) = 2^t, t = n + r, n an integer, |r| <= 1/2. The rounding of t grows
    // with |t|, but e then weighs less and less: one constant in float32 is precise enough.
    const SLOPE: f32 = -2.0 * std::f32::consts::LOG2_E;
    const MAGIC: f32 = 12_582_912.0;
    // Below this e is far too small to change 1 + e, and above it its exponent is a valid one.
    const FLOOR: f32 = -64.0;
    let t = SLOPE * x.abs();
    // In this order the comparison is one instruction and lets NaN pass.
    let t = if t < FLOOR { FLOOR } else { t };
    let shifted = t + MAGIC;
    let r = t - (shifted - MAGIC);
    // 2^r with a relative error below 1.1e-7 (minimax), and 1 at 0 so that tanh(0) is 0.
    let mut p = 1.330_060_7e-3;
    for c in [9.669_691e-3, 5.550_558_5e-2, 0.240_222_83, std::f32::consts::LN_2, 1.0] {
        p = p * r + c;
    }
    // The low bits of `shifted` are n, those of MAGIC that the shift keeps are zero: this multiplies by 2^n.
    let e = f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23));
    ((1.0 - e) / (1.0 + e)).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_accurate_over_its_whole_range() {
        let worst = (0..=870_000)
            .map(|i| -f64::from(i) * 1e-4)
            .map(|x| {
                let x = x as f32;
                let exact = f64::from(x).exp();
                (f64::from(exp_nonpositive(x)) / exact - 1.0).abs()
            })
            .fold(0.0, f64::max);
        assert!(worst < 2e-7, "{worst:e}");
        assert_eq!(exp_nonpositive(0.0), 1.0);
        assert!(exp_nonpositive(-1e30) > 0.0);
    }

    #[test]
    fn exp2_is_accurate_over_its_whole_range() {
        let worst = (0..=1_260_000)
            .map(|i| -(i as f32) * 1e-4)
            .map(|x| (f64::from(exp2_nonpositive(x)) / f64::from(x).exp2() - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(worst < 1.5e-7, "{worst:e}");
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
}
