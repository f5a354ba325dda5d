//! Maxima of the determinant over place and scale, found row by row and refined between the samples.

use std::ops::Range;

use super::LANES;
use super::hessian::Filter;
use super::integral::Plane;
use super::spans::Spans;
use super::{Keypoint, Surf};
use crate::shape::Shape;
use crate::simd::Kernel;

/// Rows of determinants that are kept: a maximum is compared with the rows above and below.
const RING: usize = 3;

/// One octave: its filters and which samples are to be looked at.
#[derive(Debug)]
pub(super) struct Octave {
    index: usize,
    filters: Vec<Filter>,
    rows: usize,
    columns: usize,
    /// Where maxima are looked for, and where determinants are needed for that.
    candidates: Spans,
    determinants: Spans,
}

impl Octave {
    /// The octave of this index, or none if not even one of its layers fits into the image.
    ///
    /// `pixels` are those of the mask, in squares of the octave's step.
    pub(super) fn new(surf: &Surf, index: usize, shape: Shape, pixels: &Spans) -> Option<Self> {
        let filters: Vec<Filter> = (0..surf.layers + 2).map(|layer| Filter::new(index, layer)).collect();
        let [rows, columns] = [shape.height(), shape.width()].map(|size| size >> index);
        // A maximum is moved by a sample at most, so it comes from the square in the mask or one beside it.
        let candidates = pixels.grown();
        let determinants = candidates.grown();
        let octave = Self { index, filters, rows, columns, candidates, determinants };
        let fits = octave.filters[octave.filters.len() - 1].size <= Surf::LARGEST_FILTER
            && !octave.within(1).is_empty_in(rows, columns);
        fits.then_some(octave)
    }

    /// Samples whose maxima in that layer have all their neighbours in the image.
    fn within(&self, layer: usize) -> Border {
        Border(self.filters[layer + 1].margin + 1)
    }

    /// The rows that may have candidates.
    pub(super) fn extent(&self) -> Range<usize> {
        let Range { start, end } = self.within(1).of(self.rows);
        let spans = self.candidates.extent();
        let (start, end) = (start.max(spans.start), end.min(spans.end));
        start.min(end)..end
    }

    /// The rows of the integral image that are read.
    pub(super) fn reads(&self) -> Range<usize> {
        let rows = self.extent();
        if rows.is_empty() {
            return 0..0;
        }
        let largest = &self.filters[self.filters.len() - 1];
        let first = rows.start.saturating_sub(1 + largest.margin) << self.index;
        first..((rows.end + largest.margin + 2) << self.index) + 1
    }

    /// How long it takes to look at a row, compared with others.
    pub(super) fn cost(&self) -> usize {
        self.determinants.area() * self.filters.len()
    }

    /// The row of filters of every layer at row `i`, where they are needed and fit.
    #[inline(always)]
    fn compute(&self, plane: &Plane, i: usize, space: &mut [Vec<i32>; 2], out: &mut Ring) {
        for (layer, filter) in self.filters.iter().enumerate() {
            let border = Border(filter.margin);
            if !border.of(self.rows).contains(&i) {
                continue;
            }
            let (whole, row) = (border.of(self.columns), out.row_mut(i, layer));
            for &[start, end] in self.determinants.row(i) {
                let columns = whole.start.max(start as usize)..whole.end.min(end as usize);
                if !columns.is_empty() {
                    let start = columns.start;
                    filter.row(plane, i, columns, space, &mut row[start..]);
                }
            }
        }
    }
}

/// So many samples at each end are left out.
#[derive(Clone, Copy)]
struct Border(usize);

impl Border {
    #[inline(always)]
    fn of(self, size: usize) -> Range<usize> {
        self.0.min(size)..size.saturating_sub(self.0).max(self.0.min(size))
    }

    fn is_empty_in(self, rows: usize, columns: usize) -> bool {
        self.of(rows).is_empty() || self.of(columns).is_empty()
    }
}

/// The last rows of determinants of all layers.
struct Ring {
    layers: usize,
    stride: usize,
    values: Vec<f32>,
}

impl Ring {
    fn new(layers: usize, columns: usize) -> Self {
        let stride = columns + 2 * LANES;
        Self { layers, stride, values: vec![0.0; RING * layers * stride] }
    }

    #[inline(always)]
    fn place(&self, i: usize, layer: usize) -> Range<usize> {
        let start = (i % RING * self.layers + layer) * self.stride;
        start..start + self.stride
    }

    #[inline(always)]
    fn row(&self, i: usize, layer: usize) -> &[f32] {
        &self.values[self.place(i, layer)]
    }

    #[inline(always)]
    fn row_mut(&mut self, i: usize, layer: usize) -> &mut [f32] {
        let place = self.place(i, layer);
        &mut self.values[place]
    }

    /// The 3 x 3 x 3 determinants around a sample: layers, rows, columns.
    fn around(&self, layer: usize, i: usize, j: usize) -> [[[f32; 3]; 3]; 3] {
        std::array::from_fn(|l| {
            std::array::from_fn(|y| {
                let row = self.row(i + y - 1, layer + l - 1);
                [row[j - 1], row[j], row[j + 1]]
            })
        })
    }
}

/// Finds the keypoints of some rows of an octave.
pub(super) struct Search<'a> {
    pub(super) octave: &'a Octave,
    pub(super) plane: &'a Plane,
    pub(super) threshold: f32,
    pub(super) rows: Range<usize>,
    pub(super) found: &'a mut Vec<Keypoint>,
}

impl Kernel for Search<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { octave, plane, threshold, rows, found } = self;
        let layers = octave.filters.len();
        let mut ring = Ring::new(layers, octave.columns);
        let width = octave.columns.next_multiple_of(LANES);
        let mut space = [vec![0; width], vec![0; width]];
        for i in rows.start - 1..=rows.end {
            octave.compute(plane, i, &mut space, &mut ring);
            if i > rows.start {
                for layer in 1..layers - 1 {
                    octave.maxima(&ring, plane, i - 1, layer, threshold, found);
                }
            }
        }
    }
}

impl Octave {
    /// The maxima of a layer in row `i`.
    #[inline(always)]
    fn maxima(
        &self,
        ring: &Ring,
        plane: &Plane,
        i: usize,
        layer: usize,
        threshold: f32,
        found: &mut Vec<Keypoint>,
    ) {
        let border = self.within(layer);
        if !border.of(self.rows).contains(&i) {
            return;
        }
        let whole = border.of(self.columns);
        let rows = [i - 1, i, i + 1].map(|i| ring.row(i, layer));
        for &[start, end] in self.candidates.row(i) {
            let (start, end) = (whole.start.max(start as usize), whole.end.min(end as usize));
            let mut at = start;
            while at < end {
                if let Some(peaks) = peaks(rows, at, threshold) {
                    for (lane, _) in peaks.iter().enumerate().filter(|(_, peak)| **peak != 0) {
                        if at + lane < end {
                            found.extend(self.refined(ring, plane, layer, i, at + lane));
                        }
                    }
                }
                at += LANES;
            }
        }
    }

    /// The keypoint of a sample that is the largest of its layer, if it is larger than the layers beside it, too.
    #[inline(never)]
    fn refined(&self, ring: &Ring, plane: &Plane, layer: usize, i: usize, j: usize) -> Option<Keypoint> {
        let values = ring.around(layer, i, j);
        let response = values[1][1][1];
        if values[0].iter().chain(&values[2]).flatten().any(|&other| other >= response) {
            return None;
        }
        let [across, down, scale] = offset(&values)?;
        let step = plane.step() as f64;
        let centre = |at: usize| at as f64 * step + (step - 1.0) / 2.0;
        let filter = &self.filters[layer];
        let next = (filter.size - self.filters[layer - 1].size) as f64;
        Some(Keypoint {
            u: (centre(j) + across * step) as f32,
            v: (centre(i) + down * step) as f32,
            size: (filter.size as f64 + scale * next).round_ties_even() as f32,
            angle: 0.0,
            response,
            octave: self.index as i32,
            laplacian: filter.laplacian(plane, i, j),
        })
    }
}

/// Which of the samples from `at` on are above the threshold and all their neighbours in the layer, if any.
#[inline(always)]
fn peaks(rows: [&[f32]; 3], at: usize, threshold: f32) -> Option<[u32; LANES]> {
    #[inline(always)]
    fn larger(a: f32, b: f32) -> f32 {
        if a > b { a } else { b }
    }
    let around = |row: usize| &rows[row][at - 1..][..LANES + 2];
    let (above, row, below) = (around(0), around(1), around(2));
    let (mut peaks, mut any) = ([0; LANES], 0);
    for k in 0..LANES {
        let upper = larger(larger(above[k], above[k + 1]), above[k + 2]);
        let lower = larger(larger(below[k], below[k + 1]), below[k + 2]);
        let most = larger(larger(larger(upper, lower), larger(row[k], row[k + 2])), threshold);
        peaks[k] = u32::from(row[k + 1] > most);
        any |= peaks[k];
    }
    (any != 0).then_some(peaks)
}

/// Where the parabola through the samples has its maximum, in samples across, down and in scale.
///
/// None if that is more than a sample away or cannot be told.
fn offset(values: &[[[f32; 3]; 3]; 3]) -> Option<[f64; 3]> {
    let at = |l: usize, y: usize, x: usize| f64::from(values[l][y][x]);
    let peak = at(1, 1, 1);
    let slope = [
        (at(1, 1, 2) - at(1, 1, 0)) / 2.0,
        (at(1, 2, 1) - at(1, 0, 1)) / 2.0,
        (at(2, 1, 1) - at(0, 1, 1)) / 2.0,
    ];
    let xx = at(1, 1, 0) - 2.0 * peak + at(1, 1, 2);
    let yy = at(1, 0, 1) - 2.0 * peak + at(1, 2, 1);
    let ss = at(0, 1, 1) - 2.0 * peak + at(2, 1, 1);
    let xy = (at(1, 2, 2) - at(1, 2, 0) - at(1, 0, 2) + at(1, 0, 0)) / 4.0;
    let xs = (at(2, 1, 2) - at(2, 1, 0) - at(0, 1, 2) + at(0, 1, 0)) / 4.0;
    let ys = (at(2, 2, 1) - at(2, 0, 1) - at(0, 2, 1) + at(0, 0, 1)) / 4.0;
    // The adjugate of the symmetric matrix.
    let adjugate = [
        [yy * ss - ys * ys, xs * ys - xy * ss, xy * ys - xs * yy],
        [xs * ys - xy * ss, xx * ss - xs * xs, xy * xs - xx * ys],
        [xy * ys - xs * yy, xy * xs - xx * ys, xx * yy - xy * xy],
    ];
    let determinant = xx * adjugate[0][0] + xy * adjugate[0][1] + xs * adjugate[0][2];
    let offset =
        adjugate.map(|row| -(row[0] * slope[0] + row[1] * slope[1] + row[2] * slope[2]) / determinant);
    // Not a number where the determinant is zero, and then not within either.
    offset.iter().all(|x| x.abs() <= 1.0).then_some(offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_maximum_of_a_parabola_is_where_it_was_put() {
        let truth = [0.3, -0.4, 0.2];
        let values: [[[f32; 3]; 3]; 3] = std::array::from_fn(|l| {
            std::array::from_fn(|y| {
                std::array::from_fn(|x| {
                    let [dx, dy, ds] = [x, y, l].map(|k| k as f64 - 1.0);
                    let [x, y, s] = [dx - truth[0], dy - truth[1], ds - truth[2]];
                    (100.0 - 3.0 * x * x - 2.0 * y * y - 4.0 * s * s + x * y - 0.5 * y * s + 0.7 * x * s)
                        as f32
                })
            })
        });
        let found = offset(&values).unwrap();
        for (found, truth) in found.iter().zip(truth) {
            assert!((found - truth).abs() < 1e-4, "{found} {truth}");
        }
        assert!(offset(&[[[1.0; 3]; 3]; 3]).is_none());
    }

    #[test]
    fn filters_have_the_published_sizes_and_boxes_that_weigh_nothing_together() {
        assert_eq!([0, 1, 2, 3, 4].map(|layer| Filter::size_of(0, layer)), [9, 15, 21, 27, 33]);
        assert_eq!([0, 1, 2, 3, 4].map(|layer| Filter::size_of(2, layer)), [36, 60, 84, 108, 132]);
    }
    #[test]
    fn every_row_that_a_filter_around_a_candidate_reads_is_asked_for() {
        let (surf, shape) = (Surf::new(0.0, 3, 3, false, false).unwrap(), Shape::new(300, 310).unwrap());
        for v in [0, 20, 97, 150, 222, 299] {
            let mut mask = vec![false; shape.pixels()];
            mask[v * 310..][..310].fill(true);
            let mut pixels = Spans::of(&mask, shape);
            for index in 0..3 {
                let octave = Octave::new(&surf, index, shape, &pixels).unwrap();
                let (rows, reads) = (octave.extent(), octave.reads());
                for filter in octave.filters.iter().filter(|_| !rows.is_empty()) {
                    let computed = Border(filter.margin).of(octave.rows);
                    for i in (rows.start - 1..=rows.end).filter(|i| computed.contains(i)) {
                        let top = (i - filter.margin) << index;
                        assert!(
                            reads.contains(&top) && reads.contains(&(top + filter.size)),
                            "{v} {index} {i}"
                        );
                    }
                }
                pixels = pixels.halved();
            }
        }
    }
}
