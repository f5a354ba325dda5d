//! Where a landscape may be positive: one stretch of columns per row.

use std::ops::Range;

use crate::shape::Shape;

/// One stretch of columns for every row of an image. Outside of them the landscape is 0; inside it may be.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Support {
    // Side by side rather than in pairs, so that covering many rows vectorises.
    lows: Vec<u32>,
    highs: Vec<u32>,
}

impl Support {
    /// Empties the support and fits it to an image.
    pub fn clear(&mut self, shape: Shape) {
        self.lows.clear();
        self.lows.resize(shape.height(), u32::MAX);
        self.highs.clear();
        self.highs.resize(shape.height(), 0);
    }

    /// Whether it was made for an image of this size, or for one as high and narrower.
    pub(crate) fn fits(&self, shape: Shape) -> bool {
        let within = |&high: &u32| high as usize <= shape.width();
        self.highs.len() == shape.height() && self.highs.iter().all(within)
    }

    /// Widens the stretches of these rows so that they hold these columns.
    #[inline(always)]
    pub(crate) fn cover(&mut self, rows: [u32; 2], columns: [u32; 2]) {
        let rows = rows[0] as usize..rows[1] as usize;
        for low in &mut self.lows[rows.clone()] {
            *low = (*low).min(columns[0]);
        }
        for high in &mut self.highs[rows] {
            *high = (*high).max(columns[1]);
        }
    }

    /// Widens every stretch so that it holds the other's.
    pub fn join(&mut self, other: &Self) {
        for (low, &o) in self.lows.iter_mut().zip(&other.lows) {
            *low = (*low).min(o);
        }
        for (high, &o) in self.highs.iter_mut().zip(&other.highs) {
            *high = (*high).max(o);
        }
    }

    /// The columns of row `v`, `0..0` if it has none.
    #[inline(always)]
    pub fn columns(&self, v: usize) -> Range<usize> {
        let high = self.highs[v] as usize;
        (self.lows[v] as usize).min(high)..high
    }

    /// From the first row that has columns to behind the last, `0..0` if none has.
    pub fn rows(&self) -> Range<usize> {
        let Some(first) = self.highs.iter().position(|&high| high > 0) else {
            return 0..0;
        };
        first..self.highs.iter().rposition(|&high| high > 0).map_or(0, |last| last + 1)
    }

    /// From the first column of any of these rows to behind the last, `0..0` if they have none.
    #[inline(always)]
    pub fn hull(&self, rows: Range<usize>) -> Range<usize> {
        let low = self.lows[rows.clone()].iter().copied().min().unwrap_or(0);
        let high = self.highs[rows].iter().copied().max().unwrap_or(0);
        low.min(high) as usize..high as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_grow_to_hold_everything_that_was_covered() {
        let mut support = Support::default();
        support.clear(Shape::new(6, 20).unwrap());
        assert_eq!((support.rows(), support.columns(3)), (0..0, 0..0));
        support.cover([1, 4], [5, 9]);
        support.cover([3, 5], [2, 6]);
        assert_eq!(support.rows(), 1..5);
        assert_eq!([0, 1, 3, 4].map(|v| support.columns(v)), [0..0, 5..9, 2..9, 2..6]);
        assert_eq!(support.hull(0..2), 5..9);
        assert_eq!(support.hull(0..6), 2..9);
        assert_eq!(support.hull(5..6), 0..0);
        let mut other = Support::default();
        other.clear(Shape::new(6, 20).unwrap());
        other.cover([0, 1], [1, 2]);
        other.join(&support);
        assert_eq!((other.rows(), other.columns(0), other.columns(3)), (0..5, 1..2, 2..9));
    }
}
