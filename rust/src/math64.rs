//! Elementary functions in float64.
//!
//! Like those in float32 they use additions, multiplications, divisions and bit operations in a fixed order, so
//! every machine returns the same bits; those of the system's library differ from one machine to the next.

const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1; // its last 32 bits are zero: products with n are exact
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// `exp(x)` for x <= 0: relative error below 4e-16, exactly 1 at 0, and 0 below -708. NaN stays NaN.
#[inline(always)]
pub fn exp_nonpositive(x: f64) -> f64 {
    if x < -708.0 {
        return 0.0;
    }
    // x = n ln 2 + r with |r| <= ln(2) / 2. Adding 1.5 * 2^52 rounds to the nearest integer, which then stands in
    // the low bits of the sum.
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    let shifted = x * std::f64::consts::LOG2_E + MAGIC;
    let n = shifted - MAGIC;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    // The series up to r^13 / 13!, in pairs: a chain of thirteen products would wait for each one's latency.
    let (r2, pair) = (r * r, |a: f64, b: f64| a + b * r);
    let (r4, low) = (r2 * r2, pair(1.0 / 2.0, 1.0 / 6.0) + r2 * pair(1.0 / 24.0, 1.0 / 120.0));
    let middle = pair(1.0 / 720.0, 1.0 / 5_040.0) + r2 * pair(1.0 / 40_320.0, 1.0 / 362_880.0);
    let high =
        pair(1.0 / 3_628_800.0, 1.0 / 39_916_800.0) + r2 * pair(1.0 / 479_001_600.0, 1.0 / 6_227_020_800.0);
    let p = 1.0 + (r + r2 * (low + r4 * (middle + r4 * high)));
    // The bits of MAGIC that the shift keeps are zero: this multiplies by 2^n.
    f64::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 52))
}

/// `ln(x)` for finite x > 0: error below 4e-16 of the larger of 1 and `|ln x|`. Any other x gives nonsense.
pub fn ln(x: f64) -> f64 {
    const SUBNORMAL: f64 = 18_014_398_509_481_984.0; // 2^54
    let (x, lift) = if x < f64::MIN_POSITIVE { (x * SUBNORMAL, 54.0) } else { (x, 0.0) };
    // x = 2^n m with m between sqrt(1/2) and sqrt(2).
    let exponent = (x.to_bits() >> 52) as i64 - 1023;
    let m = f64::from_bits((x.to_bits() & ((1 << 52) - 1)) | 1023 << 52);
    let (m, n) = if m > std::f64::consts::SQRT_2 { (m / 2.0, exponent + 1) } else { (m, exponent) };
    let n = n as f64 - lift;
    // ln m = 2 artanh s, s = (m - 1) / (m + 1), |s| < 0.172.
    let s = (m - 1.0) / (m + 1.0);
    let square = s * s;
    let mut sum = 0.0;
    for k in (1..=11).rev() {
        sum = sum * square + 1.0 / f64::from(2 * k + 1);
    }
    let series = 2.0 * s + 2.0 * s * square * sum;
    n * LN_2_HIGH + (series + n * LN_2_LOW)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_accurate_over_its_whole_range() {
        let worst = (0..=708_000)
            .map(|i| -f64::from(i) * 1e-3)
            .map(|x| (exp_nonpositive(x) / x.exp() - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(worst < 4e-16, "{worst:e}");
        assert_eq!(exp_nonpositive(0.0), 1.0);
        assert_eq!(exp_nonpositive(-0.0), 1.0);
        for x in [-708.1, -1e4, -1e300, f64::NEG_INFINITY] {
            assert_eq!(exp_nonpositive(x), 0.0);
        }
        assert!(exp_nonpositive(f64::NAN).is_nan());
    }

    #[test]
    fn ln_is_accurate_for_numbers_of_every_size() {
        let mut worst = 0.0_f64;
        let step = f64::MAX.to_bits() / 300_017;
        for bits in (1..f64::MAX.to_bits()).step_by(step as usize) {
            let x = f64::from_bits(bits);
            worst = worst.max((ln(x) - x.ln()).abs() / x.ln().abs().max(1.0));
        }
        for i in 1..40_000 {
            let x = f64::from(i) * 1e-4;
            worst = worst.max((ln(x) - x.ln()).abs() / x.ln().abs().max(1.0));
        }
        assert!(worst < 4e-16, "{worst:e}");
        assert_eq!(ln(1.0), 0.0);
        assert!((ln(5e-324) - 5e-324_f64.ln()).abs() < 1e-12);
    }
}
