//! Matrix times a block of points, several outputs at a time.

/// Points that go through the network together, one in each vector lane.
pub(super) const LANES: usize = 16;

/// Outputs that are summed side by side: enough to hide the latency of an addition behind the others, and few
/// enough that all sums stay in registers.
const TILE: usize = 5;

/// One number of every point of a block, on a cache line of its own.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Line(pub [f32; LANES]);

impl Line {
    pub(super) const ZERO: Self = Self([0.0; LANES]);

    /// The first `W` points: a block that is not full leaves the other lanes alone.
    #[inline(always)]
    pub(super) fn points<const W: usize>(&self) -> &[f32; W] {
        self.0.first_chunk().unwrap_or_else(|| unreachable!())
    }

    /// The first `W` points, to be changed.
    #[inline(always)]
    pub(super) fn points_mut<const W: usize>(&mut self) -> &mut [f32; W] {
        self.0.first_chunk_mut().unwrap_or_else(|| unreachable!())
    }
}

/// An (outputs, inputs) matrix in the order in which it is read: tiles of outputs, inside them inputs, inside
/// them the outputs of the tile. The last tile is narrower if need be.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tiles {
    inputs: usize,
    outputs: usize,
    values: Vec<f32>,
}

impl Tiles {
    /// Packs the matrix whose element (output, input) is `value(output, input)`.
    pub(super) fn pack(outputs: usize, inputs: usize, value: impl Fn(usize, usize) -> f32) -> Self {
        let mut values = Vec::with_capacity(outputs * inputs);
        for first in (0..outputs).step_by(TILE) {
            for input in 0..inputs {
                values.extend((first..outputs.min(first + TILE)).map(|output| value(output, input)));
            }
        }
        Self { inputs, outputs, values }
    }

    /// `y = matrix x + start` for the first `W` points, terms added one after the other in the order of `x`.
    #[inline(always)]
    pub(super) fn times<const W: usize>(&self, x: &[Line], start: &[f32], y: &mut [Line]) {
        let (x, start, y) = (&x[..self.inputs], &start[..self.outputs], &mut y[..self.outputs]);
        let whole = self.outputs / TILE * TILE;
        let (tiles, rest) = self.values.split_at(whole * self.inputs);
        let (start, start_rest) = start.split_at(whole);
        let (y, y_rest) = y.split_at_mut(whole);
        let tiles = tiles.chunks_exact(TILE * self.inputs);
        for ((tile, start), y) in tiles.zip(start.chunks_exact(TILE)).zip(y.chunks_exact_mut(TILE)) {
            sum::<TILE, W>(tile, x, start, y);
        }
        match y_rest.len() {
            1 => sum::<1, W>(rest, x, start_rest, y_rest),
            2 => sum::<2, W>(rest, x, start_rest, y_rest),
            3 => sum::<3, W>(rest, x, start_rest, y_rest),
            4 => sum::<4, W>(rest, x, start_rest, y_rest),
            _ => {}
        }
    }
}

/// One tile of `N` outputs.
#[inline(always)]
fn sum<const N: usize, const W: usize>(tile: &[f32], x: &[Line], start: &[f32], y: &mut [Line]) {
    let mut sums = [[0.0; W]; N];
    for (sums, &start) in sums.iter_mut().zip(start) {
        *sums = [start; W];
    }
    for (weights, x) in tile.as_chunks::<N>().0.iter().zip(x) {
        let x = x.points::<W>();
        for (sums, w) in sums.iter_mut().zip(weights) {
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum += w * x;
            }
        }
    }
    for (y, sums) in y.iter_mut().zip(sums) {
        *y.points_mut() = sums;
    }
}
