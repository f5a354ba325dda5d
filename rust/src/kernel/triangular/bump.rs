//! One kernel in the image: where it is positive, and its profile along u.

use super::grid::round;

/// Kernels wider than this [px] are flat along a row: no image has so many columns that it would matter.
const FLAT: f64 = 1e20;

/// A kernel that is positive somewhere in the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bump {
    /// Pixels on which it is positive, half-open.
    pub(super) rows: [u32; 2],
    pub(super) columns: [u32; 2],
    pub(super) centre: [f64; 2],
    pub(super) width: [f64; 2],
    /// Its largest value, in the unit of the landscape.
    pub(super) peak: f64,
}

/// The pixels on which a triangle is positive, half-open.
#[inline(always)]
pub(super) fn positive(centre: f64, width: f64, size: f64) -> [u32; 2] {
    // At least 0 and at most `size`, which fits: whole numbers that the cast keeps.
    let pixel = |x: f64| {
        let x = if x > 0.0 { x } else { 0.0 };
        if x < size { x } else { size }
    };
    let height = |at: f64| width - (at - centre).abs();
    let (first, end) = (pixel((centre - width).ceil()), pixel((centre + width).floor() + 1.0));
    // The sums are rounded, and at the border itself the triangle is 0: the definition decides.
    let first = if height(first) > 0.0 { first } else { first + 1.0 };
    let end = if end == 0.0 || height(end - 1.0) > 0.0 { end } else { end - 1.0 };
    if centre.abs() + width > DISTANT {
        return sought(centre, width, size);
    }
    [first as i32 as u32, end as i32 as u32]
}

/// Beyond this [px] pixels are so close to each other in float64 that a border may be off by several.
const DISTANT: f64 = (1_u64 << 50) as f64;

/// The same wherever the triangle lies: the height never falls before the centre and never rises after it.
#[cold]
#[inline(never)]
fn sought(centre: f64, width: f64, size: f64) -> [u32; 2] {
    let positive = |at: u32| width - (f64::from(at) - centre).abs() > 0.0;
    let search = |mut low: u32, mut high: u32, before: &dyn Fn(u32) -> bool| {
        while low < high {
            let middle = low + (high - low) / 2;
            if before(middle) { low = middle + 1 } else { high = middle }
        }
        low
    };
    // Saturates at both ends of the image.
    let top = (centre.clamp(0.0, size - 1.0)) as u32;
    let first = search(0, top, &|at| !positive(at));
    let end = search(top, size as u32, &positive);
    [first, end]
}

impl Bump {
    /// The profile along u in whole numbers up to `tallest`, from column `first` on. Rounds after adding a
    /// phase in `[-0.5, 0.5]`.
    #[inline(always)]
    pub(super) fn profile(&self, tallest: f64, phase: f32, first: u32, profile: &mut [i32], size: u32) {
        let (centre, width) = (self.centre[0], self.width[0]);
        let [start, end] = self.columns;
        let (to_start, to_end) = ((start - first) as i32, (end - 1 - first) as i32);
        if end - start == 1 || width > FLAT {
            // One column of a kernel that may be too narrow for a slope, or a kernel without one.
            profile.fill(0);
            let height = (width - (f64::from(start) - centre).abs()) / width;
            let whole = round(height * tallest + f64::from(phase)) as i32;
            profile[to_start as usize..=to_end as usize].fill(whole.max(1));
            return;
        }
        // Two ramps from the ends of the support, where they are small: so float32 neither loses nor adds a
        // column. Counted from the columns' ends they are exact whole numbers plus what stands there.
        const MAGIC: f32 = 12_582_912.0;
        let slope = (tallest / width) as f32;
        let up = (width + (f64::from(start) - centre)) as f32;
        let down = (width - (f64::from(end - 1) - centre)) as f32;
        // At an end that the image does not cut off they exceed 1 by a rounding at the most, and a column more
        // must not come of that.
        let up = up.clamp(f32::MIN_POSITIVE, if start > 0 { 1.0 } else { f32::MAX });
        let down = down.clamp(f32::MIN_POSITIVE, if end == size { f32::MAX } else { 1.0 });
        for (i, p) in profile.iter_mut().enumerate() {
            let rising = (i as i32 - to_start) as f32 + up;
            let falling = (to_end - i as i32) as f32 + down;
            let height = if rising < falling { rising } else { falling };
            // Adding it leaves the nearest whole number in the low bits.
            let shifted = (height * slope + phase) + MAGIC;
            let whole = (shifted.to_bits() as i32).wrapping_sub(MAGIC.to_bits() as i32);
            *p = if height > 0.0 { whole.max(1) } else { 0 };
        }
    }
}
