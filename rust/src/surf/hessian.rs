//! Second derivatives by box filters, and the determinant of the Hessian.

use std::ops::Range;

use super::LANES;
use super::integral::Plane;

/// Relative weight of the mixed derivative: box filters see it a little too strongly.
const MIXED: f32 = 0.81;

/// The three box filters of one size.
///
/// On a filter of 9 pixels the boxes have their corners at these ninths of the side; on a larger one, at the
/// nearest pixels. The sides are multiples of 3, so that opposite boxes stay equal.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    /// Its side [px].
    pub(super) size: usize,
    /// Samples from the filter's corner to the sample that it is centred on.
    pub(super) margin: usize,
    corners: [usize; 10],
    /// One over the pixels of the boxes of a pure and of the mixed derivative.
    pure: f32,
    mixed: f32,
}

impl Filter {
    /// The filter of a layer of an octave, both counted from 0.
    pub(super) fn new(octave: usize, layer: usize) -> Self {
        let size = Self::size_of(octave, layer);
        // To the nearest; a ninth of the side is a whole number of thirds, so nothing is halfway.
        let corners = std::array::from_fn(|k| (2 * k * size + 9) / 18);
        let (third, height) = (size / 3, corners[7] - corners[2]);
        Self {
            size,
            margin: (size / 2) >> octave,
            corners,
            pure: 1.0 / (third * height) as f32,
            mixed: 1.0 / (third * third) as f32,
        }
    }

    /// The side of that filter [px].
    pub(super) fn size_of(octave: usize, layer: usize) -> usize {
        (9 + 6 * layer) << octave
    }

    /// Writes the determinants at the samples `columns` of row `i`, and of as many more as fill the last vector.
    #[inline(always)]
    pub(super) fn row(
        &self,
        plane: &Plane,
        i: usize,
        columns: Range<usize>,
        space: &mut [Vec<i32>; 2],
        out: &mut [f32],
    ) {
        let step = plane.step();
        let corner = [(columns.start - self.margin) * step, (i - self.margin) * step];
        // In whole vectors: no loop has a rest to do one by one.
        let count = columns.len().next_multiple_of(LANES);
        let [xx, yy] = space;
        let (xx, yy) = (&mut xx[..count], &mut yy[..count]);
        // One at a time: more than eight streams at once would not fit the registers.
        self.boxes(plane, corner, count, [0, 9, 3, 6], [2, 7, 2, 7]).combine::<3>(xx);
        self.boxes(plane, corner, count, [2, 7, 2, 7], [0, 9, 3, 6]).combine::<3>(yy);
        let out = &mut out[..count];
        let factor = self.pure * self.pure;
        for ((out, &xx), &yy) in out.iter_mut().zip(&*xx).zip(&*yy) {
            *out = xx as f32 * yy as f32 * factor;
        }
        self.boxes(plane, corner, count, [1, 4, 5, 8], [1, 4, 1, 4]).combine::<1>(xx);
        self.boxes(plane, corner, count, [5, 8, 1, 4], [5, 8, 5, 8]).combine::<1>(yy);
        let factor = MIXED * (self.mixed * self.mixed);
        for ((out, &upper), &lower) in out.iter_mut().zip(&*xx).zip(&*yy) {
            let xy = upper.wrapping_add(lower) as f32;
            *out -= xy * xy * factor;
        }
    }

    /// Two boxes along a row of samples, by the numbers of their corners: left, right, left, right, and down so.
    #[inline(always)]
    fn boxes<'a>(
        &self,
        plane: &'a Plane,
        corner: [usize; 2],
        count: usize,
        x: [usize; 4],
        y: [usize; 4],
    ) -> Boxes<'a> {
        let at = |x: usize, y: usize| {
            &plane.along(corner[0] + self.corners[x], corner[1] + self.corners[y])[..count]
        };
        Boxes([
            at(x[0], y[0]),
            at(x[1], y[0]),
            at(x[0], y[1]),
            at(x[1], y[1]),
            at(x[2], y[2]),
            at(x[3], y[2]),
            at(x[2], y[3]),
            at(x[3], y[3]),
        ])
    }

    /// Whether the trace at a sample is positive (1), negative (-1) or zero (0).
    pub(super) fn laplacian(&self, plane: &Plane, i: usize, j: usize) -> i32 {
        let [x, y] = [j, i].map(|at| (at - self.margin) * plane.step());
        let c = &self.corners;
        let sum = |a: usize, b: usize, top: usize, bottom: usize| {
            plane.sum([x + c[a], x + c[b]], [y + c[top], y + c[bottom]])
        };
        let xx = sum(0, 9, 2, 7) - 3 * sum(3, 6, 2, 7);
        let yy = sum(2, 7, 0, 9) - 3 * sum(2, 7, 3, 6);
        (xx + yy).signum()
    }
}

/// The corners of two boxes along a row: the first has its columns and rows in front, the second behind.
struct Boxes<'a>([&'a [i32]; 8]);

impl Boxes<'_> {
    /// The first sum less so many times the second, for every sample.
    #[inline(always)]
    fn combine<const TIMES: i32>(&self, out: &mut [i32]) {
        let [a, b, c, d, e, f, g, h] = self.0;
        let count = out.len();
        let (a, b, c, d) = (&a[..count], &b[..count], &c[..count], &d[..count]);
        let (e, f, g, h) = (&e[..count], &f[..count], &g[..count], &h[..count]);
        for i in 0..count {
            let first = d[i].wrapping_sub(c[i]).wrapping_sub(b[i].wrapping_sub(a[i]));
            let second = h[i].wrapping_sub(g[i]).wrapping_sub(f[i].wrapping_sub(e[i]));
            out[i] = first.wrapping_sub(second.wrapping_mul(TIMES));
        }
    }
}
