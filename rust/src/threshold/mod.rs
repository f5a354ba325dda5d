//! The threshold that leaves a given number of pixels (Section IV-A).

mod bisect;
mod check;
mod pack;
mod pixel;
mod quicksort;
mod select;

pub use check::check_pixels;
pub use pixel::{Key, Pixel};
pub use quicksort::quicksort;

use self::select::{Found, Largest};
use crate::error::{Error, Result};
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};

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

/// Buffers that are kept from one call to the next; once they have their size, a call allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    single: Buffers<f32>,
    double: Buffers<f64>,
}

/// Buffers for one type of pixel.
#[derive(Clone, Debug, Default)]
pub struct Buffers<T> {
    /// Pixels of every stride-th row and column.
    read: Vec<T>,
    sample: Vec<T>,
    inside: Vec<T>,
    spare: Vec<T>,
}

/// The largest `d` such that at least the wanted number of pixels are `>= d`.
///
/// A fraction asks for `ceil(fraction * pixels - 1e-9)` pixels. Where fewer pixels are positive than
/// wanted, `d` is the smallest positive value. With `stride > 1` only every stride-th row and column is
/// read and checked, and a count is divided by `stride^2` and rounded up.
///
/// # Errors
/// A pixel that is negative or not finite, a wanted number or stride outside its domain, or no positive pixel.
pub fn threshold<T: Pixel>(
    landscape: &[T],
    shape: Shape,
    wanted: Wanted,
    stride: usize,
    method: Method,
    workspace: &mut Workspace,
) -> Result<f64> {
    threshold_on(Simd::best(), landscape, shape, wanted, stride, method, workspace)
}

/// [`threshold`] on a given instruction set. All give the same number.
///
/// # Errors
/// As for [`threshold`].
pub fn threshold_on<T: Pixel>(
    simd: Simd,
    landscape: &[T],
    shape: Shape,
    wanted: Wanted,
    stride: usize,
    method: Method,
    workspace: &mut Workspace,
) -> Result<f64> {
    shape.check("landscape", landscape.len())?;
    if stride == 0 {
        return Err(Error::scalar("stride", "at least 1", stride));
    }
    let width = shape.width().div_ceil(stride);
    let wanted = wanted.of(shape.height().div_ceil(stride) * width, stride)?;
    let Buffers { read, sample, inside, spare } = T::buffers(workspace);
    let pixels = if stride == 1 {
        landscape
    } else {
        simd.run(Subsample { landscape, width: shape.width(), stride, out: read });
        read
    };
    let rank = wanted.min(pixels.len());
    let Found { key, doubt } = match method {
        Method::Select => pack::run(simd, Largest { pixels, width, rank, sample, inside, spare }),
        Method::Quicksort => sorted(pixels, rank, inside),
    };
    if doubt {
        check::look_closer(pixels, width, stride)?;
    }
    let key = if key > T::default().key() { key } else { simd.run(LeastPositive(pixels)) };
    if key == T::Key::MAX {
        let reason = if stride == 1 {
            "is zero everywhere: there is nothing to look at".to_owned()
        } else {
            format!("is zero on every pixel of landscape[::{stride}, ::{stride}]")
        };
        return Err(Error::conflict("landscape", reason));
    }
    Ok(T::from_key(key).into())
}

/// Copies every stride-th pixel of every stride-th row.
struct Subsample<'a, T> {
    landscape: &'a [T],
    width: usize,
    stride: usize,
    out: &'a mut Vec<T>,
}

impl<T: Pixel> Kernel for Subsample<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let width = self.width.div_ceil(self.stride);
        self.out.resize(width * (self.landscape.len() / self.width).div_ceil(self.stride), T::default());
        let rows = self.landscape.chunks_exact(self.width).step_by(self.stride);
        for (row, out) in rows.zip(self.out.chunks_exact_mut(width)) {
            if self.stride == 4 {
                let (fours, rest) = row.as_chunks::<4>();
                for (out, pixels) in out.iter_mut().zip(fours) {
                    *out = pixels[0];
                }
                if let (Some(out), Some(&pixel)) = (out.get_mut(fours.len()), rest.first()) {
                    *out = pixel;
                }
            } else {
                for (out, pixels) in out.iter_mut().zip(row.chunks(self.stride)) {
                    *out = pixels[0];
                }
            }
        }
    }
}

/// The `rank`-th largest key, 1 being the largest, read off the sorted pixels.
fn sorted<T: Pixel>(pixels: &[T], rank: usize, values: &mut Vec<T>) -> Found<T::Key> {
    values.clear();
    values.extend_from_slice(pixels);
    quicksort(values);
    Found { key: values[values.len() - rank].key(), doubt: !pixels.iter().all(|p| p.valid()) }
}

/// The least key of a positive pixel, or the largest of all keys.
struct LeastPositive<'a, T>(&'a [T]);

impl<T: Pixel> Kernel for LeastPositive<'_, T> {
    type Output = T::Key;

    #[inline(always)]
    fn run(self) -> T::Key {
        bisect::least_from(self.0, T::Key::from(true))
    }
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
