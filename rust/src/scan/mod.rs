//! Histogram intersections of every window of an image: the exact scan of a histogram detector (Section V).
//!
//! The score of a window is `sum_b min(count_b / area, target_b)`, from 0 to 1 for a target that sums to 1.
//! Only bins of a positive target matter. Each of them keeps a histogram of the columns that the rows of the
//! window cut out, which slides down the image one row at a time; a row of windows is then a box sum along
//! those columns. An integral histogram (see [`crate::integral`]) answers for any window in four look-ups a
//! bin, but its planes do not fit a cache, and it was several times slower where every window is asked for.

mod band;
mod boxes;
pub mod merge;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod window_tests;
mod windows;

use band::Band;
pub use windows::{Picture, WindowSpace};

use crate::error::{Error, Result};
use crate::parallel;
use crate::shape::Shape;
use crate::simd::Simd;

/// Rows of windows that one piece of work has at least. Each begins by counting a whole window's rows, and where
/// other programs have the other processors, to wait for them takes longer than a small image.
const ROWS: usize = 160;

/// An index of a bin, as images hold them.
pub trait Bin: Copy + Into<usize> + Send + Sync {}
impl Bin for u8 {}
impl Bin for u16 {}

/// What is looked for, and with which windows.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// The target's share of each bin, finite and >= 0. A pixel whose index is not among them is in no bin.
    pub target: &'a [f32],
    /// Height and width of the windows [px].
    pub window: [usize; 2],
    /// Step from window to window [px], down and to the right.
    pub stride: usize,
    /// The windows that are wanted, row-major as in the result; all without it. The others score 0.
    pub wanted: Option<&'a [bool]>,
}

/// Buffers that belong to the caller and are kept from one scan to the next.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    bands: Vec<band::Space>,
}

/// The target's positive bins.
struct Slots {
    /// Bin to the place of its counts among the positive bins; one more stands for all the others.
    of: Vec<u16>,
    /// Pixels of a window that the target grants to each.
    caps: Vec<f32>,
}

impl Scan<'_> {
    /// Bins that a target may have.
    pub const MAX_BINS: usize = u16::MAX as usize;

    /// Rows and columns of windows that fit into an image.
    ///
    /// # Errors
    /// A window or stride of no pixels, or a window larger than the image.
    pub fn places(&self, image: Shape) -> Result<Shape> {
        if self.stride == 0 {
            return Err(Error::scalar("stride", "at least 1", 0));
        }
        let [height, width] = self.window;
        if height == 0 || width == 0 || height > image.height() || width > image.width() {
            let expected =
                format!("(height, width) of 1 to ({}, {}), the image's", image.height(), image.width());
            return Err(Error::shape("window", expected, format!("({height}, {width})")));
        }
        let steps = |length: usize, side: usize| (length - side) / self.stride + 1;
        Shape::new(steps(image.height(), height), steps(image.width(), width))
    }

    /// Writes the score of the window at rows `i * stride` and columns `j * stride` to `out[i, j]`.
    ///
    /// Rows are computed side by side; the result does not depend on how many threads there are.
    ///
    /// # Errors
    /// A window, stride or target outside its domain, or a buffer of another size.
    pub fn run<T: Bin>(
        &self,
        bins: &[T],
        image: Shape,
        workspace: &mut Workspace,
        out: &mut [f32],
    ) -> Result<()> {
        let rows = self.places(image)?.height();
        self.run_on(Simd::best(), bins, image, (rows / ROWS).max(1), workspace, out)
    }

    /// [`Scan::run`] on a given instruction set, cut into so many bands; all give the same bits.
    ///
    /// # Errors
    /// The same.
    pub fn run_on<T: Bin>(
        &self,
        simd: Simd,
        bins: &[T],
        image: Shape,
        bands: usize,
        workspace: &mut Workspace,
        out: &mut [f32],
    ) -> Result<()> {
        let places = self.places(image)?;
        image.check("bins", bins.len())?;
        places.check("out", out.len())?;
        if let Some(wanted) = self.wanted {
            places.check("wanted", wanted.len())?;
        }
        let slots = self.slots()?;
        let rows = places.height().div_ceil(bands.clamp(1, places.height()));
        workspace.bands.resize_with(places.height().div_ceil(rows), Default::default);
        let pieces = out.chunks_mut(rows * places.width()).zip(&mut workspace.bands).enumerate();
        let pieces = pieces.map(|(k, (out, space))| {
            let first = k * rows;
            let wanted = self.wanted.map(|wanted| &wanted[first * places.width()..][..out.len()]);
            Band {
                scan: *self,
                slots: &slots,
                bins,
                image,
                columns: places.width(),
                first,
                wanted,
                out,
                space,
            }
        });
        let mut pieces: Vec<_> = pieces.collect();
        let [height, width] = self.window;
        let small = height * width <= usize::from(u16::MAX);
        parallel::for_each(&mut pieces, |_, band| {
            if small { simd.run(band.counted::<u16>()) } else { simd.run(band.counted::<u32>()) }
        });
        Ok(())
    }

    fn slots(&self) -> Result<Slots> {
        if self.target.len() > Self::MAX_BINS {
            let expected = format!("of at most {} bins", Self::MAX_BINS);
            return Err(Error::shape("target", expected, self.target.len().to_string()));
        }
        let area = (self.window[0] * self.window[1]) as f64;
        let mut caps = Vec::new();
        for (bin, &share) in self.target.iter().enumerate() {
            if !(0.0..f32::INFINITY).contains(&share) {
                return Err(Error::element("target", &[bin], "finite and >= 0", share));
            }
            if share > 0.0 {
                caps.push((f64::from(share) * area) as f32);
            }
        }
        if caps.is_empty() {
            return Err(Error::conflict("target", "is zero everywhere: there is nothing to look for"));
        }
        let others = caps.len() as u16;
        let mut next = 0..others;
        let slot = |&share: &f32| if share > 0.0 { next.next() } else { None }.unwrap_or(others);
        let mut of: Vec<u16> = self.target.iter().map(slot).collect();
        of.push(others);
        Ok(Slots { of, caps })
    }
}
