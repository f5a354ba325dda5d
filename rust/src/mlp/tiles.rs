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

/// One tile. Every sum is a variable of its own: an array of them would be kept in memory, not in registers.
#[inline(always)]
fn sum<const W: usize>(
    matrix: &[[f32; TILE]],
    start: &[f32; TILE],
    x: &[[f32; W]],
    y: &mut [[f32; W]; TILE],
) {
    let [mut a, mut b, mut c, mut d, mut e] = start.map(|start| [start; W]);
    for (w, x) in matrix.iter().zip(x) {
        add(&mut a, w[0], x);
        add(&mut b, w[1], x);
        add(&mut c, w[2], x);
        add(&mut d, w[3], x);
        add(&mut e, w[4], x);
    }
    y[0] = a;
    y[1] = b;
    y[2] = c;
    y[3] = d;
    y[4] = e;
}

/// `sum += weight x` for `W` points.
#[inline(always)]
fn add<const W: usize>(sum: &mut [f32; W], weight: f32, x: &[f32; W]) {
    for lane in 0..W {
        sum[lane] += weight * x[lane];
    }
}
