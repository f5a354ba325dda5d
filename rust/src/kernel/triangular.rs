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

use super::{Trajectory, Widths};
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};
use crate::support::Support;

/// Profiles and rows begin and end at multiples of this many columns, so that loops have no odd ends.
const LANES: usize = 8;
/// Bits of the number of steps in the widest kernel of a batch; with more than [`MANY`] kernels, and with slopes
/// that have a fraction, a few of these are left to the profiles.
const GRID_BITS: i32 = 22;
const GRID_BITS_OF_MANY: i32 = 20;
const MANY: usize = 128;
/// Widths of one batch differ by less than this many octaves, so that the narrowest has few bits less. The
/// classes meet at 1 px, for kernels narrower than a pixel have no slope.
const OCTAVES: i32 = 3;
/// Profiles of one batch differ by about this many octaves: the least keeps some bits beside the tallest.
const TALLEST_TO_LEAST: i32 = 12;
/// As many times lower than the tallest profile of a batch may its profiles be in the mean, so that a step of
/// each is little beside their sum.
const TALLEST_TO_MEAN: f64 = 32.0;
/// Points of one batch, unless their profiles would be too many to number.
const BATCH: usize = 512;
/// Points of one batch whose kernels are so wide that their slope needs fractional bits.
const FEW: usize = 8;
/// The largest profile, which float32 arithmetic still rounds to the nearest whole number.
const LARGEST_PROFILE: f64 = (1 << 22) as f64;
/// The largest sum of the profiles of one row, with room for sums that are under way.
const LARGEST_SLOPE: f64 = (1 << 29) as f64;
/// The largest sum of offsets, with room for sums that are under way.
const LARGEST_SUM: f64 = (1_u64 << 51) as f64;
/// Kernels wider than this [px] are flat along a row: no image has so many columns that it would matter.
const FLAT: f64 = 1e20;
/// Fractional bits of a slope below one step per row, of kernels wider than 2^22 px.
const FRACTION_BITS: i32 = 8;

/// A kernel that is positive somewhere in the image.
#[derive(Clone, Copy, Debug)]
struct Bump {
    /// Pixels on which it is positive, half-open.
    rows: [u32; 2],
    columns: [u32; 2],
    centre: [f64; 2],
    width: [f64; 2],
    /// Its largest value, in the unit of the landscape.
    peak: f64,
}

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

/// Where a point stands among the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    /// Of widths along v.
    class: i32,
    /// Octaves by which its profile is below one of weight and widths 1, about.
    fall: i32,
    point: u32,
}

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

/// Lists the points that have weight so that the points of a batch stand together. Returns whether they are
/// even: whether any of them may be in one batch.
fn arrange(trajectory: &Trajectory<'_>, order: &mut Vec<Place>) -> bool {
    let points = 0..trajectory.points.len();
    let (weights, widths) = (trajectory.weights, trajectory.widths);
    order.clear();
    order.extend(points.filter(|&n| weights.is_none_or(|w| w[n] > 0.0)).map(|n| {
        let fall = weights.map_or(0, |w| -exponent(w[n]));
        match widths {
            Widths::Common(_) => Place { class: 0, fall, point: n as u32 },
            Widths::PerPoint(widths) => {
                let [wide, high] = widths[n].map(exponent);
                Place { class: high.div_euclid(OCTAVES), fall: fall + wide + 2 * high, point: n as u32 }
            }
        }
    }));
    let tallest = order.iter().min_by_key(|p| p.fall).copied();
    // Mostly they make one batch as they are, or one after the other.
    let even = tallest.is_none_or(|tallest| {
        let mut sum = 0.0;
        let fit = order.iter().all(|p| {
            sum += share(p, &tallest);
            fits(p, &tallest)
        });
        fit && order.len() as f64 <= TALLEST_TO_MEAN * sum
    });
    if !even {
        order.sort_unstable();
    }
    even
}

/// Whether a point may be in one batch with the tallest of it.
fn fits(place: &Place, tallest: &Place) -> bool {
    place.class == tallest.class && place.fall <= tallest.fall + TALLEST_TO_LEAST
}

/// Its profile in units of the tallest.
fn share(place: &Place, tallest: &Place) -> f64 {
    1.0 / f64::from(1 << (place.fall - tallest.fall).clamp(0, TALLEST_TO_LEAST))
}

/// How many of the points make a batch. Where they are not even they are sorted, the tallest of a class first.
fn batch(trajectory: &Trajectory<'_>, order: &[Place], even: bool, most: usize) -> usize {
    let high = trajectory.widths.of(order[0].point as usize)[1];
    // The widest of the class may be wider by as many octaves.
    let most = if exponent(high) < GRID_BITS_OF_MANY - OCTAVES { most } else { most.min(FEW) };
    if even {
        return order.len().min(most);
    }
    let (mut count, mut sum) = (0.0, 0.0);
    let fit = |p: &&Place| {
        (count, sum) = (count + 1.0, sum + share(p, &order[0]));
        fits(p, &order[0]) && count <= TALLEST_TO_MEAN * sum
    };
    order.iter().take(most).take_while(fit).count()
}

/// `floor(log2(x))` of a positive number.
#[inline]
fn exponent(x: f64) -> i32 {
    const LIFT: f64 = (1_u64 << 54) as f64;
    if x < f64::MIN_POSITIVE {
        return exponent(x * LIFT) - 54;
    }
    (x.to_bits() >> 52) as i32 - 1023
}

/// The pixels on which a triangle is positive, half-open.
#[inline(always)]
fn positive(centre: f64, width: f64, size: f64) -> [u32; 2] {
    // At least 0 and at most `size`, which fits: whole numbers that the cast keeps.
    let pixel = |x: f64| {
        let x = if x > 0.0 { x } else { 0.0 };
        if x < size { x } else { size }
    };
    let height = |at: f64| width - (at - centre).abs();
    let (first, end) = (pixel((centre - width).ceil()), pixel((centre + width).floor() + 1.0));
    // The sums are rounded, and at the border itself the triangle is 0: the definition decides.
    let first = if height(first) > 0.0 { first } else { first + 1.0 };
    let end = if end == 0.0 || height(end - 1.0) > 0.0 { end } else { end - 1.0 };
    if centre.abs() + width > DISTANT {
        return sought(centre, width, size);
    }
    [first as i32 as u32, end as i32 as u32]
}

/// Beyond this [px] pixels are so close to each other in float64 that a border may be off by several.
const DISTANT: f64 = (1_u64 << 50) as f64;

/// The same wherever the triangle lies: the height never falls before the centre and never rises after it.
#[cold]
#[inline(never)]
fn sought(centre: f64, width: f64, size: f64) -> [u32; 2] {
    let positive = |at: u32| width - (f64::from(at) - centre).abs() > 0.0;
    let search = |mut low: u32, mut high: u32, before: &dyn Fn(u32) -> bool| {
        while low < high {
            let middle = low + (high - low) / 2;
            if before(middle) { low = middle + 1 } else { high = middle }
        }
        low
    };
    // Saturates at both ends of the image.
    let top = (centre.clamp(0.0, size - 1.0)) as u32;
    let first = search(0, top, &|at| !positive(at));
    let end = search(top, size as u32, &positive);
    [first, end]
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

/// The grid of a batch: how many steps there are to a pixel.
struct Grid {
    /// 2^g in two factors, since g may exceed the exponents of float64.
    factors: [f64; 2],
    /// Steps from row to row.
    row: f64,
    /// Rows after which the offsets move on, lest they grow with the image.
    band: usize,
    largest_value: f64,
}

impl Grid {
    #[inline(always)]
    fn new([narrowest, widest]: [f64; 2], bits: i32) -> Self {
        let g = bits - exponent(widest);
        let factors = [2.0_f64.powi(g / 2), 2.0_f64.powi(g - g / 2)];
        // Finite, though it means nothing, for kernels so narrow that they have no slope.
        let row = (factors[0] * factors[1]).min(LARGEST_SUM);
        let fraction = f64::from(1 << FRACTION_BITS);
        let (row, room) = if g < 0 { (round(row * fraction) / fraction, fraction) } else { (row, 1.0) };
        let band = (2.0 * narrowest).clamp(8.0, 1e6).ceil();
        // How far a line rises or falls within a band, in units of its kernel's peak.
        let rise = if narrowest < 1.0 { 0.0 } else { band / narrowest };
        Self { factors, row, band: band as usize, largest_value: LARGEST_SUM / room / (1.0 + rise) }
    }

    /// A distance [px] in steps.
    #[inline(always)]
    fn steps(&self, distance: f64) -> f64 {
        distance * self.factors[0] * self.factors[1]
    }
}

/// The nearest whole number of a number below 2^51.
#[inline(always)]
fn round(x: f64) -> f64 {
    const MAGIC: f64 = 1.5 * (1_u64 << 52) as f64;
    (x + MAGIC) - MAGIC
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
            Image::Whole(out) => buffers.rows(shape, support, out, |value, out| {
                *out = (value * norm) as f32;
            }),
            Image::Sum(sums) => buffers.rows(shape, support, sums, |value, sum| {
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

    /// Goes down the image: events first, then the row that the lines give.
    #[inline(always)]
    fn rows<T: Copy + Default>(
        &mut self,
        shape: Shape,
        support: &Support,
        image: &mut [T],
        write: impl Fn(f64, &mut T),
    ) {
        let clears = size_of::<T>() == size_of::<f32>();
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
                if clears {
                    row[..inside.start].fill(T::default());
                    row[inside.end..].fill(T::default());
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

impl Bump {
    /// The profile along u in whole numbers up to `tallest`, from column `first` on. Rounds after adding a
    /// phase in `[-0.5, 0.5]`.
    #[inline(always)]
    fn profile(&self, tallest: f64, phase: f32, first: u32, profile: &mut [i32], size: u32) {
        let (centre, width) = (self.centre[0], self.width[0]);
        let [start, end] = self.columns;
        let (to_start, to_end) = ((start - first) as i32, (end - 1 - first) as i32);
        if end - start == 1 || width > FLAT {
            // One column of a kernel that may be too narrow for a slope, or a kernel without one.
            profile.fill(0);
            let height = (width - (f64::from(start) - centre).abs()) / width;
            let whole = round(height * tallest + f64::from(phase)) as i32;
            profile[to_start as usize..=to_end as usize].fill(whole.max(1));
            return;
        }
        // Two ramps from the ends of the support, where they are small: so float32 neither loses nor adds a
        // column. Counted from the columns' ends they are exact whole numbers plus what stands there.
        const MAGIC: f32 = 12_582_912.0;
        let slope = (tallest / width) as f32;
        let up = (width + (f64::from(start) - centre)) as f32;
        let down = (width - (f64::from(end - 1) - centre)) as f32;
        // At an end that the image does not cut off they exceed 1 by a rounding at the most, and a column more
        // must not come of that.
        let up = up.clamp(f32::MIN_POSITIVE, if start > 0 { 1.0 } else { f32::MAX });
        let down = down.clamp(f32::MIN_POSITIVE, if end == size { f32::MAX } else { 1.0 });
        for (i, p) in profile.iter_mut().enumerate() {
            let rising = (i as i32 - to_start) as f32 + up;
            let falling = (to_end - i as i32) as f32 + down;
            let height = if rising < falling { rising } else { falling };
            // Adding it leaves the nearest whole number in the low bits.
            let shifted = (height * slope + phase) + MAGIC;
            let whole = (shifted.to_bits() as i32).wrapping_sub(MAGIC.to_bits() as i32);
            *p = if height > 0.0 { whole.max(1) } else { 0 };
        }
    }
}
