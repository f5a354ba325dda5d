//! A band of rows of windows, computed from the top down.

use std::ops::Range;

use super::boxes::{Levels, box_sums};
use super::{Bin, Scan, Slots};
use crate::shape::Shape;
use crate::simd::Kernel;

/// Columns that are asked at once whether they are empty.
const BLOCK: usize = 32;

/// A number of pixels: as narrow as a window's area allows, so that many fit a register.
pub trait Count: Copy + Default + Send {
    /// Its buffers in a band's space.
    fn buffers(space: &mut Space) -> &mut Buffers<Self>;
    fn plus(self, other: Self) -> Self;
    /// One more or, where `sign` says so, one less.
    fn step(self, more: bool) -> Self;
    /// Whether any is not zero.
    fn any(block: &[Self]) -> bool;
    fn real(self) -> f32;
}

macro_rules! count {
    ($type:ty, $buffers:ident) => {
        impl Count for $type {
            fn buffers(space: &mut Space) -> &mut Buffers<Self> {
                &mut space.$buffers
            }
            #[inline(always)]
            fn plus(self, other: Self) -> Self {
                self.wrapping_add(other)
            }
            #[inline(always)]
            fn step(self, more: bool) -> Self {
                if more { self.wrapping_add(1) } else { self.wrapping_sub(1) }
            }
            #[inline(always)]
            fn any(block: &[Self]) -> bool {
                block.iter().fold(0, |all, &count| all | count) != 0
            }
            #[inline(always)]
            fn real(self) -> f32 {
                // By way of a signed number, which every instruction set converts; an area fits one.
                self as i32 as f32
            }
        }
    };
}
count!(u16, narrow);
count!(u32, wide);

/// Memory of a band.
#[derive(Clone, Debug, Default)]
pub struct Space {
    narrow: Buffers<u16>,
    wide: Buffers<u32>,
}

/// Buffers for one type of count.
#[derive(Clone, Debug, Default)]
pub struct Buffers<C> {
    /// Counts of every column for each of the target's bins, and for all the others together.
    columns: Vec<C>,
    /// Which of the target's bins each pixel of the counted rows is in.
    slots: Vec<u16>,
    sums: Vec<C>,
    levels: Levels<C>,
    scores: Vec<f32>,
}

/// One piece of a scan.
pub struct Band<'a, T> {
    pub scan: Scan<'a>,
    pub slots: &'a Slots,
    pub bins: &'a [T],
    pub image: Shape,
    /// Windows in a row.
    pub columns: usize,
    /// The first row of windows.
    pub first: usize,
    pub wanted: Option<&'a [bool]>,
    pub out: &'a mut [f32],
    pub space: &'a mut Space,
}

impl<'a, T: Bin> Band<'a, T> {
    /// The work, with counts of one type.
    pub fn counted<C: Count>(&mut self) -> Rows<'_, 'a, T, C> {
        let Self { scan, slots, bins, image, columns, first, wanted, .. } = *self;
        let buffers = C::buffers(self.space);
        Rows { scan, slots, bins, image, columns, first, wanted, out: self.out, buffers }
    }
}

/// [`Band`] with the buffers for its counts.
pub struct Rows<'b, 'a, T, C> {
    scan: Scan<'a>,
    slots: &'a Slots,
    bins: &'a [T],
    image: Shape,
    columns: usize,
    first: usize,
    wanted: Option<&'a [bool]>,
    out: &'b mut [f32],
    buffers: &'b mut Buffers<C>,
}

impl<T: Bin, C: Count> Kernel for Rows<'_, '_, T, C> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        self.out.fill(0.0);
        let reach = self.reach();
        if reach.is_empty() {
            return;
        }
        // The rows of pixels that the columns count at present.
        let mut counted = 0..0;
        let Scan { window: [height, width], stride, .. } = self.scan;
        for i in 0..self.out.len() / self.columns {
            let mut from = 0;
            while let Some(run) = self.next_run(i, from) {
                from = run.end;
                let top = (self.first + i) * stride;
                if counted != (top..top + height) {
                    self.slide(&mut counted, top..top + height, &reach);
                }
                let pixels = run.start * stride..(run.end - 1) * stride + width;
                self.score(pixels.start - reach.start..pixels.end - reach.start, reach.len());
                self.write(i, run);
            }
        }
    }
}

impl<T: Bin, C: Count> Rows<'_, '_, T, C> {
    /// The columns of pixels that the wanted windows of this band cover.
    #[inline(always)]
    fn reach(&self) -> Range<usize> {
        let Scan { window: [_, width], stride, .. } = self.scan;
        let Some(wanted) = self.wanted else {
            return 0..(self.columns - 1) * stride + width;
        };
        let rows = || wanted.chunks_exact(self.columns);
        let first = rows().filter_map(|row| row.iter().position(|&w| w)).min();
        let last = rows().filter_map(|row| row.iter().rposition(|&w| w)).max();
        match (first, last) {
            (Some(first), Some(last)) => first * stride..last * stride + width,
            _ => 0..0,
        }
    }

    /// The next windows of row `i` to be computed in one go. A gap that the windows beside it cover belongs to
    /// them: its columns are summed anyway.
    #[inline(always)]
    fn next_run(&self, i: usize, from: usize) -> Option<Range<usize>> {
        let Some(wanted) = self.wanted else {
            return (from < self.columns).then_some(from..self.columns);
        };
        let row = &wanted[i * self.columns..][..self.columns];
        let start = from + row[from..].iter().position(|&w| w)?;
        let gap = self.scan.window[1] / self.scan.stride;
        let mut end = start + 1;
        while let Some(next) = row[end..].iter().take(gap + 1).position(|&w| w) {
            end += next + 1;
        }
        Some(start..end)
    }

    /// Makes the columns count other rows.
    #[inline(always)]
    fn slide(&mut self, counted: &mut Range<usize>, rows: Range<usize>, reach: &Range<usize>) {
        if rows.start >= counted.end {
            let size = (self.slots.caps.len() + 1) * reach.len();
            self.buffers.columns.clear();
            self.buffers.columns.resize(size, C::default());
            self.buffers.slots.resize(self.scan.window[0] * reach.len(), 0);
            *counted = rows.start..rows.start;
        }
        for v in counted.start..rows.start {
            self.count(v, false, reach);
        }
        for v in counted.end..rows.end {
            self.look_up(v, reach);
            self.count(v, true, reach);
        }
        *counted = rows;
    }

    /// The place where the slots of a row of pixels are kept as long as it is counted.
    #[inline(always)]
    fn kept(&self, v: usize, reach: usize) -> Range<usize> {
        let at = v % self.scan.window[0];
        at * reach..(at + 1) * reach
    }

    #[inline(always)]
    fn look_up(&mut self, v: usize, reach: &Range<usize>) {
        let kept = self.kept(v, reach.len());
        let row = &self.bins[v * self.image.width()..][reach.clone()];
        let of = &self.slots.of[..];
        let none = of.len() - 1;
        for (slot, &bin) in self.buffers.slots[kept].iter_mut().zip(row) {
            *slot = of[bin.into().min(none)];
        }
    }

    /// Adds a row of pixels to the columns, or takes it off. Most pixels of most images are none of the
    /// target's, and are passed over many at a time.
    #[inline(always)]
    fn count(&mut self, v: usize, more: bool, reach: &Range<usize>) {
        let kept = self.kept(v, reach.len());
        let Buffers { columns, slots, .. } = &mut *self.buffers;
        let none = self.slots.caps.len() as u16;
        for (k, block) in slots[kept].chunks(BLOCK).enumerate() {
            if block.iter().fold(true, |all, &slot| all & (slot == none)) {
                continue;
            }
            for (u, &slot) in block.iter().enumerate() {
                let count = &mut columns[usize::from(slot) * reach.len() + k * BLOCK + u];
                *count = count.step(more);
            }
        }
    }

    /// Scores of all windows within these columns.
    #[inline(always)]
    fn score(&mut self, columns: Range<usize>, reach: usize) {
        let width = self.scan.window[1];
        let Buffers { columns: counts, sums, levels, scores, .. } = &mut *self.buffers;
        let windows = columns.len() + 1 - width;
        scores.clear();
        scores.resize(windows, 0.0);
        if sums.len() < windows {
            sums.resize(windows, C::default());
        }
        for (counts, &cap) in counts.chunks_exact(reach).zip(&self.slots.caps) {
            let counts = &counts[columns.clone()];
            let Some(filled) = filled(counts) else {
                continue;
            };
            let first = (filled.start + 1).saturating_sub(width);
            let end = filled.end.min(windows);
            let sums = &mut sums[..end - first];
            box_sums(&counts[first..], width, levels, sums);
            for (score, &sum) in scores[first..end].iter_mut().zip(&*sums) {
                let count = sum.real();
                *score += if count < cap { count } else { cap };
            }
        }
    }

    /// Writes the scores of a run, each as a share of the window's pixels.
    #[inline(always)]
    fn write(&mut self, i: usize, run: Range<usize>) {
        let Scan { window: [height, width], stride, .. } = self.scan;
        let area = (height * width) as f32;
        let row = i * self.columns..(i + 1) * self.columns;
        let out = &mut self.out[row.clone()][run.clone()];
        if stride == 1 {
            for (out, &score) in out.iter_mut().zip(&self.buffers.scores) {
                *out = score / area;
            }
        } else {
            for (out, &score) in out.iter_mut().zip(self.buffers.scores.iter().step_by(stride)) {
                *out = score / area;
            }
        }
        if let Some(wanted) = self.wanted {
            for (out, &wanted) in out.iter_mut().zip(&wanted[row][run]) {
                *out = if wanted { *out } else { 0.0 };
            }
        }
    }
}

/// A range of columns outside of which all are empty; none if all are.
#[inline(always)]
fn filled<C: Count>(counts: &[C]) -> Option<Range<usize>> {
    let (blocks, rest) = counts.as_chunks::<BLOCK>();
    let any = |block: &[C; BLOCK]| C::any(block);
    let end = if C::any(rest) { counts.len() } else { (blocks.iter().rposition(any)? + 1) * BLOCK };
    let start = blocks.iter().position(any).unwrap_or(blocks.len()) * BLOCK;
    Some(start..end)
}
