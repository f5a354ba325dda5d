//! The threshold that leaves a given number of pixels (Section IV-A).

mod bisect;
mod check;
mod pack;
mod pixel;
mod quicksort;
mod select;
mod subsample;
#[cfg(test)]
mod tests;
mod workspace;

pub use check::check_pixels;
pub use pixel::{Key, Pixel};
pub use quicksort::quicksort;
pub use workspace::Workspace;

use self::check::check_read;
use self::select::{Found, Largest};
use self::subsample::Subsample;
use self::workspace::{Buffers, first};
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
    let Buffers { read, sample, gathered } = T::buffers(workspace);
    let pixels = match stride {
        1 => landscape,
        _ => simd.run(Subsample { landscape, shape, stride, out: read }),
    };
    let rank = wanted.min(pixels.len());
    let key = match method {
        Method::Select => {
            let Found { key, doubt } = pack::run(simd, Largest { pixels, width, rank, sample, gathered });
            if doubt {
                check_read(simd, pixels, width, stride)?;
            }
            key
        }
        Method::Quicksort => {
            check_read(simd, pixels, width, stride)?;
            sorted(pixels, rank, &mut gathered[0])
        }
    };
    // The zeros, and the minus zeros below them, are no answer.
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

/// The `rank`-th largest key, 1 being the largest, by sorting all positive pixels; that of zero if it is none.
fn sorted<T: Pixel>(pixels: &[T], rank: usize, buffer: &mut Vec<T>) -> T::Key {
    let values = first(pixels.len(), buffer);
    // Every pixel is written and only positive ones are kept: no branch to miss.
    let mut kept = 0;
    for &pixel in pixels {
        values[kept] = pixel;
        kept += usize::from(pixel > T::default());
    }
    let values = &mut values[..kept];
    quicksort(values);
    values.len().checked_sub(rank).map_or(T::default(), |at| values[at]).key()
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
    pub(crate) fn of(self, pixels: usize, stride: usize) -> Result<usize> {
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
