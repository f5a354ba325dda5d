//! The grid of a batch: how kernels are rounded along v.

/// Bits of the number of steps in the widest kernel of a batch; with more than [`MANY`] kernels, and with slopes
/// that have a fraction, a few of these are left to the profiles.
pub(super) const GRID_BITS: i32 = 22;
pub(super) const GRID_BITS_OF_MANY: i32 = 20;
pub(super) const MANY: usize = 128;
/// The largest sum of offsets, with room for sums that are under way.
const LARGEST_SUM: f64 = (1_u64 << 51) as f64;
/// Fractional bits of a slope below one step per row, of kernels wider than 2^22 px.
const FRACTION_BITS: i32 = 8;

/// The grid of a batch: how many steps there are to a pixel.
pub(super) struct Grid {
    /// 2^g in two factors, since g may exceed the exponents of float64.
    factors: [f64; 2],
    /// Steps from row to row.
    pub(super) row: f64,
    /// Rows after which the offsets move on, lest they grow with the image.
    pub(super) band: usize,
    pub(super) largest_value: f64,
}

impl Grid {
    #[inline(always)]
    pub(super) fn new([narrowest, widest]: [f64; 2], bits: i32) -> Self {
        let g = bits - exponent(widest);
        let factors = [2.0_f64.powi(g / 2), 2.0_f64.powi(g - g / 2)];
        // Finite, though it means nothing, for kernels so narrow that they have no slope.
        let row = (factors[0] * factors[1]).min(LARGEST_SUM);
        let fraction = f64::from(1 << FRACTION_BITS);
        let (row, room) = if g < 0 { (round(row * fraction) / fraction, fraction) } else { (row, 1.0) };
        let band = (2.0 * narrowest).clamp(8.0, 1e6).ceil();
        // How far a line rises or falls within a band, in units of its kernel's peak.
        let rise = if narrowest < 1.0 { 0.0 } else { band / narrowest };
        Self { factors, row, band: band as usize, largest_value: LARGEST_SUM / room / (1.0 + rise) }
    }

    /// A distance [px] in steps.
    #[inline(always)]
    pub(super) fn steps(&self, distance: f64) -> f64 {
        distance * self.factors[0] * self.factors[1]
    }
}

/// The nearest whole number of a number below 2^51.
#[inline(always)]
pub(super) fn round(x: f64) -> f64 {
    const MAGIC: f64 = 1.5 * (1_u64 << 52) as f64;
    (x + MAGIC) - MAGIC
}

/// `floor(log2(x))` of a positive number.
#[inline]
pub(super) fn exponent(x: f64) -> i32 {
    const LIFT: f64 = (1_u64 << 54) as f64;
    if x < f64::MIN_POSITIVE {
        return exponent(x * LIFT) - 54;
    }
    (x.to_bits() >> 52) as i32 - 1023
}
