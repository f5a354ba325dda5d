//! Which samples a mask needs: stretches of columns for every row.

use std::ops::Range;

use crate::shape::Shape;

/// Stretches nearer than this are computed as one: to begin a new one costs as much as the gap.
const GAP: u32 = 12;

/// Stretches of columns for every row, rising and apart from each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Spans {
    /// Where the stretches of each row begin in `columns`, and the end of the last.
    rows: Vec<usize>,
    columns: Vec<[u32; 2]>,
}

impl Spans {
    fn empty() -> Self {
        Self { rows: vec![0], columns: Vec::new() }
    }

    /// All of an image.
    pub(super) fn whole(shape: Shape) -> Self {
        let columns = vec![[0, shape.width() as u32]; shape.height()];
        Self { rows: (0..=shape.height()).collect(), columns }
    }

    /// The pixels of a mask that are set.
    pub(super) fn of(mask: &[bool], shape: Shape) -> Self {
        let mut spans = Self::empty();
        for row in mask.chunks_exact(shape.width()) {
            let mut at = 0;
            while let Some(start) = position(row, at, true) {
                let end = position(row, start, false).unwrap_or(row.len());
                spans.columns.push([start as u32, end as u32]);
                at = end;
            }
            spans.rows.push(spans.columns.len());
        }
        spans
    }

    /// The stretches of a row; none outside of the image.
    pub(super) fn row(&self, v: usize) -> &[[u32; 2]] {
        match self.rows.get(v..=v + 1) {
            Some(&[start, end]) => &self.columns[start..end],
            _ => &[],
        }
    }

    pub(super) fn height(&self) -> usize {
        self.rows.len() - 1
    }

    /// From the first row that has stretches to behind the last.
    pub(super) fn extent(&self) -> Range<usize> {
        let some = |&v: &usize| !self.row(v).is_empty();
        let Some(first) = (0..self.height()).find(some) else { return 0..0 };
        first..(0..self.height()).rev().find(some).map_or(0, |last| last + 1)
    }

    /// Columns of all stretches together.
    pub(super) fn area(&self) -> usize {
        self.columns.iter().map(|[start, end]| (end - start) as usize).sum()
    }

    /// The squares of two by two in which something is.
    pub(super) fn halved(&self) -> Self {
        self.merged(
            self.height().div_ceil(2),
            |v| 2 * v..2 * v + 2,
            |[start, end]| [start / 2, (end - 1) / 2 + 1],
        )
    }

    /// Everything in reach of a step in any of the eight directions; it may reach over the right border.
    pub(super) fn grown(&self) -> Self {
        self.merged(
            self.height(),
            |v| v.saturating_sub(1)..v + 2,
            |[start, end]| [start.saturating_sub(1), end + 1],
        )
    }

    /// As many rows, each with the stretches of several rows of this, changed and then joined.
    fn merged(
        &self,
        height: usize,
        sources: impl Fn(usize) -> Range<usize>,
        change: impl Fn([u32; 2]) -> [u32; 2],
    ) -> Self {
        let (mut spans, mut row) = (Self::empty(), Vec::new());
        for v in 0..height {
            row.clear();
            row.extend(sources(v).flat_map(|v| self.row(v)).map(|&span| change(span)));
            row.sort_unstable();
            let first = spans.columns.len();
            for &[start, end] in &row {
                match spans.columns[first..].last_mut() {
                    Some(last) if start <= last[1] + GAP => last[1] = last[1].max(end),
                    _ => spans.columns.push([start, end]),
                }
            }
            spans.rows.push(spans.columns.len());
        }
        spans
    }
}

/// The first place from `at` on that is set, or is not.
fn position(row: &[bool], at: usize, set: bool) -> Option<usize> {
    // Sixteen at a time: most of a mask is long stretches.
    const BLOCK: usize = 16;
    let mut at = at;
    while let Some(block) = row.get(at..at + BLOCK)
        && block.iter().fold(true, |same, &pixel| same & (pixel != set))
    {
        at += BLOCK;
    }
    row[at..].iter().position(|&pixel| pixel == set).map(|offset| at + offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn painted(spans: &Spans, width: usize) -> Vec<Vec<bool>> {
        let row = |v| {
            let mut row = vec![false; width];
            for &[start, end] in spans.row(v) {
                row[(start as usize).min(width)..(end as usize).min(width)].fill(true);
            }
            row
        };
        (0..spans.height()).map(row).collect()
    }

    #[test]
    fn stretches_are_the_pixels_that_are_set() {
        let shape = Shape::new(3, 50).unwrap();
        let mut mask = vec![false; 150];
        for at in [0, 1, 20, 49, 50, 99] {
            mask[at] = true;
        }
        let spans = Spans::of(&mask, shape);
        assert_eq!(spans.row(0), [[0, 2], [20, 21], [49, 50]]);
        assert_eq!(spans.row(1), [[0, 1], [49, 50]]);
        assert!(spans.row(2).is_empty() && spans.row(3).is_empty());
        assert_eq!((spans.extent(), spans.area()), (0..2, 6));
        assert_eq!(Spans::whole(shape), Spans::of(&[true; 150], shape));
        assert_eq!(Spans::of(&[false; 150], shape).extent(), 0..0);
    }

    #[test]
    fn growing_and_halving_keep_every_pixel_and_its_neighbours() {
        let (height, width) = (13, 90);
        let shape = Shape::new(height, width).unwrap();
        let mut state = 1_u32;
        let mask: Vec<bool> = (0..height * width)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                state >> 26 == 0
            })
            .collect();
        let spans = Spans::of(&mask, shape);
        let (grown, halved) = (painted(&spans.grown(), width + 1), painted(&spans.halved(), width / 2));
        assert_eq!(halved.len(), 7);
        for (v, u) in (0..height).flat_map(|v| (0..width).map(move |u| (v, u))) {
            if mask[v * width + u] {
                assert!(halved[v / 2][u / 2]);
                for row in &grown[v.saturating_sub(1)..(v + 2).min(height)] {
                    assert!(row[u.saturating_sub(1)..u + 2].iter().all(|&set| set));
                }
            }
        }
        assert!(spans.grown().area() < height * width);
    }
}
