//! Matrix times a block of points, several outputs at a time.

/// Outputs that are summed side by side: enough to hide the latency of an addition behind the others, and few
/// enough that all sums stay in registers.
const TILE: usize = 5;

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

    /// `y = matrix x + start` for `W` points, terms added one after the other in the order of `x`.
    #[inline(always)]
    pub(super) fn times<const W: usize>(&self, x: &[[f32; W]], start: &[f32], y: &mut [[f32; W]]) {
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
fn sum<const N: usize, const W: usize>(tile: &[f32], x: &[[f32; W]], start: &[f32], y: &mut [[f32; W]]) {
    let (Some(start), Some(y)) = (start.first_chunk::<N>(), y.first_chunk_mut::<N>()) else { return };
    let mut sums: [[f32; W]; N] = start.map(|start| [start; W]);
    for (weights, x) in tile.as_chunks::<N>().0.iter().zip(x) {
        sums = std::array::from_fn(|o| std::array::from_fn(|lane| sums[o][lane] + weights[o] * x[lane]));
    }
    for o in 0..N {
        for lane in 0..W {
            y[o][lane] = sums[o][lane];
        }
    }
}
