//! Matrix times a block of points, several outputs at a time.

/// Outputs that are summed side by side: enough to hide the latency of an addition behind the others, and few
/// enough that all sums stay in registers.
const TILE: usize = 5;

/// Lines that a product writes for `outputs` outputs: whole tiles.
pub(super) fn padded(outputs: usize) -> usize {
    outputs.next_multiple_of(TILE)
}

/// `matrix x + start`, packed in the order in which it is read: tiles of outputs, inside them inputs, inside
/// them the outputs of the tile. Zeros fill the last tile.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Product {
    inputs: usize,
    matrix: Vec<[f32; TILE]>,
    start: Vec<[f32; TILE]>,
}

impl Product {
    /// Packs the matrix whose element (output, input) is `value(output, input)`; the sums begin at `start`.
    pub(super) fn pack(inputs: usize, start: &[f32], value: impl Fn(usize, usize) -> f32) -> Self {
        let tile = |first: usize, value: &dyn Fn(usize) -> f32| {
            std::array::from_fn(|o| if first + o < start.len() { value(first + o) } else { 0.0 })
        };
        let firsts = (0..start.len()).step_by(TILE);
        Self {
            inputs,
            start: firsts.clone().map(|first| tile(first, &|output| start[output])).collect(),
            matrix: firsts
                .flat_map(|first| (0..inputs).map(move |input| (first, input)))
                .map(|(first, input)| tile(first, &|output| value(output, input)))
                .collect(),
        }
    }

    /// The product for `W` points, terms added one after the other in the order of `x`. Writes [`padded`] lines.
    #[inline(always)]
    pub(super) fn of<const W: usize>(&self, x: &[[f32; W]], y: &mut [[f32; W]]) {
        let tiles = self.matrix.chunks_exact(self.inputs).zip(&self.start);
        for ((matrix, start), y) in tiles.zip(y.as_chunks_mut().0) {
            sum(matrix, start, x, y);
        }
    }
}

/// One tile. The sums are made anew in every step, by value: the compiler then keeps them in registers, where it
/// leaves an array that is changed in place in memory.
#[inline(always)]
fn sum<const W: usize>(
    matrix: &[[f32; TILE]],
    start: &[f32; TILE],
    x: &[[f32; W]],
    y: &mut [[f32; W]; TILE],
) {
    let mut sums: [[f32; W]; TILE] = start.map(|start| [start; W]);
    for (weights, x) in matrix.iter().zip(x) {
        sums = std::array::from_fn(|o| std::array::from_fn(|lane| sums[o][lane] + weights[o] * x[lane]));
    }
    for o in 0..TILE {
        for lane in 0..W {
            y[o][lane] = sums[o][lane];
        }
    }
}
