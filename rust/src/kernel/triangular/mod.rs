//! Triangular kernels at a cost that hardly grows with their width.
//!
//! Down a column every triangle is linear but at three places: the row where it enters, the first row at or
//! below its peak, and the row where it has left. So every column has a line, an offset and a slope, that
//! gives one row after the other; only at those three events of a kernel does its profile along u touch the
//! lines.
//!
//! **Nothing drifts, because nothing is rounded on the way.** The profile along u is rounded once, to whole
//! numbers P(u), at least 1 inside the support. The triangle along v is rounded once, to the smaller of two
//! ramps of whole steps of 2^-g px, at least 1 on every row of the support. Everything later is sums of
//! products of these below 2^53, which float64 holds exactly, in whatever order they are added. A kernel that
//! leaves takes back precisely what it brought: the landscape is never negative, it is 0 exactly outside the
//! union of the supports, and it has the same bits on every instruction set.
//!
//! *Error.* Where the peaks of the kernels on one row sum to m times one kernel's own, its profile P has up to
//! 2^22 steps, or about 2^27 / m. A width along v has at least 2^18 steps, 2^22 where all have one width. Every
//! kernel rounds at another place, so that hundreds of them do not all err to the same side; and those that
//! would be left with a few steps beside much taller ones have a grid of their own. What remains to one side
//! are the borders, where a kernel of nearly 0 counts as one step: a hundred borders on one pixel, by less than
//! a thousandth of a pixel each, may be 1e-5 of the kernels' summed peaks. Kernels of more than 2^17 px along v
//! have the fewest steps, since the fraction of their slope takes bits: less than 1e-5 of the summed peaks.
//!
//! *Borders.* Ramps begin at real positions, so sub-pixel points are exact to the same bound. A kernel that
//! enters above the image enters in its first row, with the value and the slope that it has there.

mod batches;
mod bump;
mod grid;

use batches::{BATCH, Place, arrange, batch};
use bump::{Bump, positive};
use grid::{GRID_BITS, GRID_BITS_OF_MANY, Grid, MANY, exponent, round};

use super::Trajectory;
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};
use crate::support::Support;

/// Profiles and rows begin and end at multiples of this many columns, so that loops have no odd ends.
const LANES: usize = 8;
/// The largest profile, which float32 arithmetic still rounds to the nearest whole number.
const LARGEST_PROFILE: f64 = (1 << 22) as f64;
/// The largest sum of the profiles of one row, with room for sums that are under way.
const LARGEST_SLOPE: f64 = (1 << 29) as f64;

/// A change of the lines by multiples of a kernel's profile, before a row is written.
#[derive(Clone, Copy, Debug)]
struct Event {
    /// Change of the value in this row, in steps.
    value: f64,
    /// Change of the slope, in steps per row over [`Grid::row`].
    slope: i32,
    /// Where the profile begins, and the columns that it has.
    profile: u32,
    columns: [u32; 2],
    /// The next event of the same row.
    next: u32,
}

const NONE: u32 = u32::MAX;

/// What a warmed-up call reuses.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffers {
    order: Vec<Place>,
    bumps: Vec<Bump>,
    profiles: Vec<i32>,
    events: Vec<Event>,
    /// The first event of every row.
    heads: Vec<u32>,
    /// The line of every column: its value in the first row of the band at hand, and its slope, a sum of
    /// profiles.
    offsets: Vec<f64>,
    slopes: Vec<i32>,
    band: usize,
    row: f64,
    /// Change of the sum of the peaks from row to row.
    active: Vec<f64>,
    /// Image and support, where it takes several batches.
    sums: Vec<f64>,
    batch: Support,
}

/// Writes the landscape of a checked trajectory whose weights sum to `total`, and its support.
pub(super) fn landscape(
    trajectory: &Trajectory<'_>,
    simd: Simd,
    shape: Shape,
    total: f64,
    buffers: &mut Buffers,
    support: &mut Support,
    out: &mut [f32],
) {
    let mut order = std::mem::take(&mut buffers.order);
    let even = arrange(trajectory, &mut order);
    let padded = shape.width().next_multiple_of(LANES);
    let most = (u32::MAX as usize / padded).clamp(1, BATCH);
    let first = batch(trajectory, &order, even, most);

    if first == order.len() {
        let image = Image::Whole(out);
        simd.run(Batch { trajectory, points: &order, shape, total, buffers, support, image });
    } else {
        let (mut sums, mut spans) = (std::mem::take(&mut buffers.sums), std::mem::take(&mut buffers.batch));
        sums.clear();
        sums.resize(shape.pixels(), 0.0);
        support.clear(shape);
        let mut rest = &order[..];
        while !rest.is_empty() {
            let (points, others) = rest.split_at(batch(trajectory, rest, even, most));
            let image = Image::Sum(&mut sums);
            simd.run(Batch { trajectory, points, shape, total, buffers, support: &mut spans, image });
            support.join(&spans);
            rest = others;
        }
        for (value, &sum) in out.iter_mut().zip(&sums) {
            *value = sum as f32;
        }
        (buffers.sums, buffers.batch) = (sums, spans);
    }
    buffers.order = order;
}

impl Buffers {
    /// Collects the kernels that are positive somewhere in the image.
    #[inline(always)]
    fn place(&mut self, trajectory: &Trajectory<'_>, points: &[Place], shape: Shape, total: f64) {
        self.bumps.clear();
        let (columns, rows) = (shape.width() as f64, shape.height() as f64);
        for &Place { point: n, .. } in points {
            let (centre, width) = (trajectory.points[n as usize], trajectory.widths.of(n as usize));
            let weight = trajectory.weights.map_or(1.0, |w| w[n as usize]);
            let columns = positive(centre[0], width[0], columns);
            let rows = positive(centre[1], width[1], rows);
            if columns[0] < columns[1] && rows[0] < rows[1] {
                // The product is in the range that was checked, however extreme its factors are.
                let peak = weight / total / (width[0] * width[1]);
                // A hand that rests has many points in one place.
                match self.bumps.last_mut() {
                    Some(last) if last.centre == centre && last.width == width => {
                        last.peak += peak;
                        continue;
                    }
                    _ => {}
                }
                self.bumps.push(Bump { rows, columns, centre, width, peak });
            }
        }
    }

    /// A bound on the sum of the peaks of all kernels that are active on one row.
    #[inline(always)]
    fn largest_sum(&mut self, shape: Shape) -> f64 {
        self.active.clear();
        self.active.resize(shape.height() + 1, 0.0);
        let mut all = 0.0;
        for bump in &self.bumps {
            self.active[bump.rows[0] as usize] += bump.peak;
            self.active[bump.rows[1] as usize] -= bump.peak;
            all += bump.peak;
        }
        let (mut sum, mut largest) = (0.0, 0.0);
        for change in &self.active {
            sum += change;
            largest = if sum > largest { sum } else { largest };
        }
        // The differences are rounded by less than this.
        largest + 1e-9 * all
    }

    /// Lists the rows where a kernel stops being linear, with what changes there.
    #[inline(always)]
    fn schedule(&mut self, bump: &Bump, profile: u32, columns: [u32; 2], grid: &Grid) {
        let [first, end] = bump.rows;
        let last = f64::from(end - 1 - first);
        // Two ramps, counted in rows from the first; neither reaches 0 on a row of the support.
        let from_centre = f64::from(first) - bump.centre[1];
        let up = round(grid.steps(bump.width[1] + from_centre)).max(1.0);
        let down = round(grid.steps(bump.width[1] - from_centre)).max(1.0);
        let step = grid.row;
        let down = if last > 0.0 { down.max(last * step + 1.0) } else { down };

        // What the row would get without an event, and the slope, of which a row is `step`.
        let (mut value, mut slope) = (0.0, 0);
        if bump.width[1] < 1.0 {
            // One or two rows. The ramps of a kernel narrower than a pixel are steep beyond all bounds.
            for row in first..end {
                let at = up.min(down);
                let at = if row == first { at } else { (up + step).min(down - step) };
                self.push(row, at - value, 0, profile, columns);
                value = at;
            }
        } else {
            // The first row at or below the peak.
            let peak = if up < down { ((down - up) / (2.0 * step)).ceil().min(last + 1.0) } else { 0.0 };
            if peak > 0.0 {
                self.push(first, up, 1, profile, columns);
                (value, slope) = (up + peak * step, 1);
            }
            if peak <= last {
                let at = down - peak * step;
                self.push(first + peak as u32, at - value, -1 - slope, profile, columns);
                (value, slope) = (at - (last + 1.0 - peak) * step, -1);
            }
        }
        if (end as usize) < self.heads.len() {
            self.push(end, -value, -slope, profile, columns);
        }
    }

    #[inline(always)]
    fn push(&mut self, row: u32, value: f64, slope: i32, profile: u32, columns: [u32; 2]) {
        let head = &mut self.heads[row as usize];
        self.events.push(Event { value, slope, profile, columns, next: *head });
        *head = (self.events.len() - 1) as u32;
    }
}

enum Image<'a> {
    Whole(&'a mut [f32]),
    Sum(&'a mut [f64]),
}

/// The kernels of one batch, from bumps to pixels.
struct Batch<'a> {
    trajectory: &'a Trajectory<'a>,
    points: &'a [Place],
    shape: Shape,
    total: f64,
    buffers: &'a mut Buffers,
    support: &'a mut Support,
    image: Image<'a>,
}

impl Kernel for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { trajectory, points, shape, total, buffers, support, image } = self;
        support.clear(shape);
        buffers.place(trajectory, points, shape, total);
        let norm = buffers.prepare(shape, support);
        match image {
            Image::Whole(out) => buffers.rows(shape, support, out, Some(0.0), |value, out| {
                *out = (value * norm) as f32;
            }),
            Image::Sum(sums) => buffers.rows(shape, support, sums, None, |value, sum| {
                *sum += value * norm;
            }),
        }
    }
}

impl Buffers {
    /// Rounds the kernels and lists their events; returns the factor from values to densities.
    #[inline(always)]
    fn prepare(&mut self, shape: Shape, support: &mut Support) -> f64 {
        let padded = shape.width().next_multiple_of(LANES);
        self.offsets.clear();
        self.offsets.resize(padded, 0.0);
        self.slopes.clear();
        self.slopes.resize(padded, 0);
        self.heads.clear();
        self.heads.resize(shape.height(), NONE);
        self.events.clear();

        let widths = self.bumps.iter().map(|b| b.width[1]);
        let narrowest = widths.clone().reduce(f64::min).unwrap_or(1.0);
        let widest = widths.reduce(f64::max).unwrap_or(1.0);
        let saves = self.bumps.len() > MANY || exponent(widest) >= GRID_BITS_OF_MANY;
        let bits = if saves { GRID_BITS_OF_MANY } else { GRID_BITS };
        let grid = Grid::new([narrowest, widest], bits);
        // The bound keeps the scale finite where float32 has nothing but zeros left.
        let largest_sum = self.largest_sum(shape).max(1e-200);
        let mut scale = grid.largest_value / largest_sum;
        scale = scale.min(LARGEST_SLOPE * grid.steps(narrowest) / largest_sum);
        for bump in &self.bumps {
            scale = scale.min(LARGEST_PROFILE * grid.steps(bump.width[1]) / bump.peak);
        }
        let bumps = std::mem::take(&mut self.bumps);
        let mut profile = 0;
        for (k, bump) in bumps.iter().enumerate() {
            let tallest = scale * bump.peak / grid.steps(bump.width[1]);
            let [first, end] = bump.columns;
            let columns = [first - first % LANES as u32, end.next_multiple_of(LANES as u32)];
            let end = profile + (columns[1] - columns[0]) as usize;
            if end > self.profiles.len() {
                self.profiles.resize(end, 0);
            }
            // Multiples of the golden ratio, less whole numbers: they fill the interval evenly.
            let phase = (k as u32).wrapping_mul(0x9e37_79b9) as i32 as f32 * (0.5 / (1_u32 << 31) as f32);
            bump.profile(tallest, phase, columns[0], &mut self.profiles[profile..end], shape.width() as u32);
            support.cover(bump.rows, bump.columns);
            self.schedule(bump, profile as u32, columns, &grid);
            profile = end;
        }
        self.bumps = bumps;
        (self.band, self.row) = (grid.band, grid.row);
        1.0 / scale
    }

    /// Goes down the image: events first, then the row that the lines give. Pixels beside the support are set to
    /// `outside`, or left alone.
    #[inline(always)]
    fn rows<T: Copy>(
        &mut self,
        shape: Shape,
        support: &Support,
        image: &mut [T],
        outside: Option<T>,
        write: impl Fn(f64, &mut T),
    ) {
        for (k, band) in image.chunks_mut(self.band * shape.width()).enumerate() {
            if k > 0 {
                let rows = self.band as f64 * self.row;
                for (offset, &slope) in self.offsets.iter_mut().zip(&self.slopes) {
                    *offset += f64::from(slope) * rows;
                }
            }
            for (t, row) in band.chunks_exact_mut(shape.width()).enumerate() {
                let (v, rows) = (k * self.band + t, f64::from(t as u32) * self.row);
                let mut event = self.heads[v];
                while event != NONE {
                    let Event { value, slope, profile, columns, next } = self.events[event as usize];
                    event = next;
                    let columns = columns[0] as usize..columns[1] as usize;
                    let profile = &self.profiles[profile as usize..][..columns.len()];
                    let (offsets, slopes) = (&mut self.offsets[columns.clone()], &mut self.slopes[columns]);
                    add(offsets, slopes, profile, value - f64::from(slope) * rows, slope);
                }
                let span = support.columns(v);
                let (start, end) = (span.start, span.end);
                let inside = start - start % LANES..end.next_multiple_of(LANES).min(row.len());
                if let Some(outside) = outside {
                    row[..inside.start].fill(outside);
                    row[inside.end..].fill(outside);
                }
                let lines = self.offsets[inside.clone()].iter().zip(&self.slopes[inside.clone()]);
                for (pixel, (&offset, &slope)) in row[inside].iter_mut().zip(lines) {
                    write(offset + f64::from(slope) * rows, pixel);
                }
            }
        }
    }
}

/// Adds multiples of a profile to lines.
#[inline(always)]
fn add(offsets: &mut [f64], slopes: &mut [i32], profile: &[i32], offset: f64, slope: i32) {
    for (o, &p) in offsets.iter_mut().zip(profile) {
        *o += offset * f64::from(p);
    }
    for (s, &p) in slopes.iter_mut().zip(profile) {
        *s += slope * p;
    }
}
