//! The threshold that leaves a given number of pixels (Section IV-A).

use crate::error::{Error, Result};
use crate::shape::Shape;

/// How the threshold is found; both methods give the same number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Sort all pixels with quicksort and read off the value, as the paper does.
    Quicksort,
    /// Find the one value without sorting the others.
    Select,
}

impl Method {
    /// The names that [`Method::named`] knows.
    pub const NAMES: &[&str] = &["select", "quicksort"];

    /// The method of that name.
    ///
    /// # Errors
    /// An unknown name; the error lists the known ones.
    pub fn named(name: &str) -> Result<Self> {
        match name {
            "quicksort" => Ok(Self::Quicksort),
            "select" => Ok(Self::Select),
            _ => Err(Error::Unknown { argument: "method".into(), known: Self::NAMES, found: name.into() }),
        }
    }
}

/// How many pixels shall be at or above the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// A share of the pixels, in (0, 1].
    Fraction(f64),
    /// A number of pixels of the full image, at least 1.
    Count(u64),
}

/// A pixel of a landscape: float32, or float64 so that a caller's own comparison `landscape >= d` holds.
pub trait Pixel: Copy + PartialOrd {
    /// Unsigned integer of the same size.
    type Bits: Copy + Ord + Default;
    /// The bits of a non-negative number, which order like the numbers themselves.
    fn bits(self) -> Self::Bits;
    /// The number of such bits.
    fn from_bits(bits: Self::Bits) -> f64;
    /// Whether the pixel is finite and not negative.
    fn valid(self) -> bool;
    /// Whether all pixels are, as fast as memory delivers them.
    fn all_valid(pixels: &[Self]) -> bool;
    /// Whether the pixel is above zero.
    fn positive(self) -> bool;
    /// The number in float64.
    fn value(self) -> f64;
}

macro_rules! pixel {
    ($float:ty, $bits:ty) => {
        impl Pixel for $float {
            type Bits = $bits;
            fn bits(self) -> $bits {
                self.to_bits()
            }
            fn from_bits(bits: $bits) -> f64 {
                f64::from(<$float>::from_bits(bits))
            }
            fn valid(self) -> bool {
                (0.0..<$float>::INFINITY).contains(&self)
            }
            fn all_valid(pixels: &[Self]) -> bool {
                // Zero times a pixel is zero unless the pixel is infinite or NaN. Sixteen lanes vectorise.
                const LANES: usize = 16;
                let (mut zero, mut least) = ([0.0; LANES], [0.0; LANES]);
                let (chunks, rest) = pixels.as_chunks::<LANES>();
                for chunk in chunks {
                    for ((zero, least), &p) in zero.iter_mut().zip(&mut least).zip(chunk) {
                        *zero += p * 0.0;
                        *least = if p < *least { p } else { *least };
                    }
                }
                let fine = |(&zero, &least): (&$float, &$float)| zero == 0.0 && least >= 0.0;
                zero.iter().zip(&least).all(fine) && rest.iter().all(|p| p.valid())
            }
            fn positive(self) -> bool {
                self > 0.0
            }
            fn value(self) -> f64 {
                f64::from(self)
            }
        }
    };
}
pixel!(f32, u32);
pixel!(f64, u64);

/// The largest `d` such that at least the wanted number of pixels are `>= d`.
///
/// A fraction asks for `ceil(fraction * pixels - 1e-9)` pixels. Where fewer pixels are positive than
/// wanted, `d` is the smallest positive value. With `stride > 1` only every stride-th row and column is
/// read, and a count is divided by `stride^2` and rounded up.
///
/// # Errors
/// A pixel that is negative or not finite, a wanted number or stride outside its domain, or no positive pixel.
pub fn threshold<T: Pixel>(
    landscape: &[T],
    shape: Shape,
    wanted: Wanted,
    stride: usize,
    method: Method,
) -> Result<f64> {
    shape.check("landscape", landscape.len())?;
    if stride == 0 {
        return Err(Error::scalar("stride", "at least 1", stride));
    }
    check_pixels(landscape, shape)?;
    let pixels = shape.height().div_ceil(stride) * shape.width().div_ceil(stride);
    let wanted = wanted.of(pixels, stride)?;

    let mut values = if stride == 1 {
        positive_bits(landscape.iter(), landscape.len())
    } else {
        let rows = landscape.chunks_exact(shape.width()).step_by(stride);
        positive_bits(rows.flat_map(|row| row.iter().step_by(stride)), pixels)
    };
    if values.is_empty() {
        let reason = if stride == 1 {
            "is zero everywhere: there is nothing to look at".to_owned()
        } else {
            format!("is zero on every pixel of landscape[::{stride}, ::{stride}]")
        };
        return Err(Error::conflict("landscape", reason));
    }
    // Ascending, the wanted-th largest stands that far from the end; zeros were never collected.
    let rank = values.len().saturating_sub(wanted);
    let bits = match method {
        Method::Quicksort => {
            quicksort(&mut values);
            values[rank]
        }
        Method::Select => *values.select_nth_unstable(rank).1,
    };
    Ok(T::from_bits(bits))
}

impl Wanted {
    /// The number of pixels to find among `pixels`.
    fn of(self, pixels: usize, stride: usize) -> Result<usize> {
        match self {
            Self::Fraction(fraction) if fraction > 0.0 && fraction <= 1.0 => {
                // The small term keeps 0.3 * 10 from asking for four pixels.
                let wanted = (fraction * pixels as f64 - 1e-9).ceil();
                Ok((wanted as usize).max(1))
            }
            Self::Fraction(fraction) => Err(Error::scalar("fraction", "in (0, 1]", fraction)),
            Self::Count(0) => Err(Error::scalar("count", "at least 1", 0)),
            Self::Count(count) => {
                let square = (stride as u64).saturating_mul(stride as u64);
                Ok(usize::try_from(count.div_ceil(square)).unwrap_or(usize::MAX))
            }
        }
    }
}

/// Checks in one pass that every pixel is finite and not negative.
pub fn check_pixels<T: Pixel>(landscape: &[T], shape: Shape) -> Result<()> {
    if T::all_valid(landscape) {
        return Ok(());
    }
    let at = landscape.iter().position(|p| !p.valid()).unwrap_or(0);
    let index = [at / shape.width(), at % shape.width()];
    Err(Error::element("landscape", &index, "finite and >= 0", landscape[at].value()))
}

/// The bits of the positive pixels. Every pixel is written and only positive ones are kept: no branch to miss.
fn positive_bits<'a, T: Pixel + 'a>(pixels: impl Iterator<Item = &'a T>, count: usize) -> Vec<T::Bits> {
    let mut values = vec![T::Bits::default(); count];
    let mut kept = 0;
    for &pixel in pixels {
        values[kept] = pixel.bits();
        kept += usize::from(pixel.positive());
    }
    values.truncate(kept);
    values
}

/// Slices up to this length are sorted by insertion.
const SHORT: usize = 24;

/// Hoare's quicksort, ascending, with the median of three as pivot.
///
/// Recurses into the shorter part only, so the stack stays logarithmic; an input made to defeat the pivot
/// is handed to the standard library's sort before it turns quadratic.
pub fn quicksort<T: Copy + Ord>(values: &mut [T]) {
    let allowed = 4 * values.len().checked_ilog2().unwrap_or(0);
    sort(values, allowed);

    fn sort<T: Copy + Ord>(mut values: &mut [T], mut allowed: u32) {
        while values.len() > SHORT {
            if allowed == 0 {
                values.sort_unstable();
                return;
            }
            allowed -= 1;
            let middle = partition(values);
            let (left, right) = values.split_at_mut(middle);
            let (short, long) = if left.len() < right.len() { (left, right) } else { (right, left) };
            sort(short, allowed);
            values = long;
        }
        insertion_sort(values);
    }
}

/// Splits so that nothing left of the returned index exceeds anything right of it; both sides are non-empty.
fn partition<T: Copy + Ord>(values: &mut [T]) -> usize {
    let (mut i, mut j) = (0_usize, values.len() - 1);
    let middle = i.midpoint(j);
    if values[middle] < values[i] {
        values.swap(middle, i);
    }
    if values[j] < values[i] {
        values.swap(j, i);
    }
    if values[j] < values[middle] {
        values.swap(j, middle);
    }
    let pivot = values[middle];
    // Stopping on equal values splits a run of ties in the middle, where a landscape has many.
    loop {
        while values[i] < pivot {
            i += 1;
        }
        while pivot < values[j] {
            j -= 1;
        }
        if i >= j {
            return j + 1;
        }
        values.swap(i, j);
        i += 1;
        j -= 1;
    }
}

fn insertion_sort<T: Copy + Ord>(values: &mut [T]) {
    for end in 1..values.len() {
        let value = values[end];
        let mut at = end;
        while at > 0 && value < values[at - 1] {
            values[at] = values[at - 1];
            at -= 1;
        }
        values[at] = value;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn quicksort_sorts(mut values in prop::collection::vec(0_u32..50, 0..400)) {
            let mut sorted = values.clone();
            sorted.sort_unstable();
            quicksort(&mut values);
            prop_assert_eq!(values, sorted);
        }

        #[test]
        fn both_methods_find_the_largest_value_that_leaves_enough(
            pixels in prop::collection::vec(prop::sample::select(vec![0.0_f32, 0.5, 1.0, 2.0, 3.0]), 1..300),
            wanted in 1_u64..320,
        ) {
            prop_assume!(pixels.iter().any(|&p| p > 0.0));
            let shape = Shape::new(1, pixels.len()).unwrap();
            let find = |method| threshold(&pixels, shape, Wanted::Count(wanted), 1, method).unwrap();
            let d = find(Method::Select);
            prop_assert_eq!(d, find(Method::Quicksort));
            let at_least = |d: f64| pixels.iter().filter(|&&p| p > 0.0 && f64::from(p) >= d).count() as u64;
            let positive = at_least(0.0);
            prop_assert!(at_least(d) >= wanted.min(positive));
            let above = pixels.iter().filter(|&&p| f64::from(p) > d).count() as u64;
            prop_assert!(above < wanted);
        }
    }

    #[test]
    fn quicksort_survives_orders_made_to_defeat_it() {
        let n = 200_000_u32;
        let mut cases = [(0..n).collect::<Vec<_>>(), (0..n).rev().collect(), vec![7; n as usize]];
        for values in &mut cases {
            quicksort(values);
            assert!(values.is_sorted());
        }
    }

    #[test]
    fn a_bad_pixel_is_found_wherever_it_stands() {
        let shape = Shape::new(5, 9).unwrap();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -1e-45] {
            for at in 0..shape.pixels() {
                let mut pixels = vec![1.0_f32; shape.pixels()];
                pixels[at] = bad;
                let error = check_pixels(&pixels, shape).unwrap_err().to_string();
                assert!(error.ends_with(&format!("at landscape[{}, {}]", at / 9, at % 9)), "{error}");
            }
        }
        assert_eq!(check_pixels(&vec![-0.0_f32; shape.pixels()], shape), Ok(()));
    }
}
