//! Cumulative tables over blocks, and how to search them.

/// Pixels of a block along its line.
pub(super) const BLOCK: usize = 16;
/// Tables are filled up to a multiple of this with blocks that have no mass, so that loops have no odd ends.
const LANES: usize = 8;

/// Cumulative sums of lines over blocks, made when a line is first asked for.
#[derive(Clone, Debug, Default)]
pub(super) struct Tables {
    blocks: usize,
    sums: Vec<f64>,
    /// The round in which a line was made: a new round empties the tables at no cost.
    made: Vec<u32>,
    round: u32,
}

impl Tables {
    pub(super) fn reset(&mut self, lines: usize, blocks: usize) {
        self.blocks = blocks.next_multiple_of(LANES);
        self.round = self.round.wrapping_add(1);
        if self.round == 0 {
            self.made.fill(0);
            self.round = 1;
        }
        if self.made.len() < lines {
            self.made.resize(lines, 0);
        }
        if self.sums.len() < lines * self.blocks {
            self.sums.resize(lines * self.blocks, 0.0);
        }
    }

    /// The table of a line; `fill` writes the masses of its blocks where it has not been made.
    #[inline(always)]
    pub(super) fn line(&mut self, line: usize, fill: impl Fill) -> &[f64] {
        let table = &mut self.sums[line * self.blocks..(line + 1) * self.blocks];
        if self.made[line] != self.round {
            self.made[line] = self.round;
            let blocks = fill.fill(table);
            table[blocks..].fill(0.0);
            // By pairs: half as many additions wait for the one before.
            let mut total = 0.0;
            for [first, second] in table.as_chunks_mut::<2>().0 {
                let pair = *first + *second;
                *first += total;
                total += pair;
                *second = total;
            }
        }
        table
    }
}

/// Writes the masses of the blocks of a line and returns how many there are. A trait and not a closure, which might not be inlined and would
/// then not be compiled for the instruction set.
pub(super) trait Fill {
    fn fill(self, masses: &mut [f64]) -> usize;
}

/// Blocks of columns of a row.
pub(super) struct Across<'a, T>(pub(super) &'a [T]);

impl<T: Copy + Into<f64>> Fill for Across<'_, T> {
    #[inline(always)]
    fn fill(self, masses: &mut [f64]) -> usize {
        let (blocks, rest) = self.0.as_chunks::<BLOCK>();
        for (k, mass) in masses[..blocks.len()].iter_mut().enumerate() {
            // The compiler must not see that blocks follow each other: it would load one number of each of
            // several blocks into a register, instead of several numbers of one.
            *mass = block_sum(&blocks[std::hint::black_box(k)]);
        }
        if !rest.is_empty() {
            masses[blocks.len()] = rest.iter().map(|&m| m.into()).sum();
        }
        self.0.len().div_ceil(BLOCK)
    }
}

/// Blocks of rows of a column.
pub(super) struct Down<'a> {
    pub(super) sums: &'a [f64],
    pub(super) width: usize,
    pub(super) blocks: usize,
    pub(super) u: usize,
}

impl Fill for Down<'_> {
    #[inline(always)]
    fn fill(self, masses: &mut [f64]) -> usize {
        let mut at = self.u;
        for mass in &mut masses[..self.blocks] {
            *mass = self.sums[at];
            at += self.width;
        }
        self.blocks
    }
}

/// Blocks of rows of the whole image.
pub(super) struct Bands<'a> {
    pub(super) tables: &'a mut Tables,
    pub(super) sums: &'a [f64],
    pub(super) width: usize,
    pub(super) blocks: usize,
}

impl Bands<'_> {
    /// The table of a block of rows.
    #[inline(always)]
    pub(super) fn table(&mut self, band: usize) -> &[f64] {
        self.tables.line(band, Across(&self.sums[band * self.width..(band + 1) * self.width]))
    }
}

impl Fill for Bands<'_> {
    #[inline(always)]
    fn fill(mut self, masses: &mut [f64]) -> usize {
        for (band, mass) in masses[..self.blocks].iter_mut().enumerate() {
            *mass = self.table(band).last().copied().unwrap_or(0.0);
        }
        self.blocks
    }
}

/// Sum of a block, in an order that suits registers of any length.
#[inline(always)]
fn block_sum<T: Copy + Into<f64>>(block: &[T; BLOCK]) -> f64 {
    let m: [f64; 8] = std::array::from_fn(|i| block[i].into() + block[i + 8].into());
    let m: [f64; 4] = std::array::from_fn(|i| m[i] + m[i + 4]);
    (m[0] + m[2]) + (m[1] + m[3])
}

/// The first block whose cumulative sum exceeds `x` times the total, and how far into it that is.
#[inline(always)]
pub(super) fn invert(cumulative: &[f64], x: f64) -> (usize, f64) {
    find(cumulative, x * cumulative.last().copied().unwrap_or(0.0))
}

/// The first block whose cumulative sum exceeds the target, and how far into it the target is.
///
/// A block of no mass adds nothing to its predecessor's sum and so is never the first.
#[inline(always)]
pub(super) fn find(cumulative: &[f64], target: f64) -> (usize, f64) {
    // Counting along a short table is faster than bisecting it: no comparison waits for the one before.
    let (chunks, _) = cumulative.as_chunks::<LANES>();
    let mut index = chunks.as_flattened().iter().map(|&sum| u64::from(sum <= target)).sum::<u64>() as usize;
    if index == cumulative.len() {
        // Rounding took the target up to the total: the last block that has mass.
        let total = cumulative.last().copied().unwrap_or(0.0);
        index = cumulative.partition_point(|&sum| sum < total);
    }
    let before = if index == 0 { 0.0 } else { cumulative[index - 1] };
    (index, target - before)
}

/// The first block of a line, filled up with zeros.
#[inline(always)]
pub(super) fn first_block<T: Copy + Into<f64>>(line: &[T]) -> [f64; BLOCK] {
    match line.first_chunk::<BLOCK>() {
        Some(block) => block.map(Into::into),
        None => std::array::from_fn(|i| line.get(i).map_or(0.0, |&mass| mass.into())),
    }
}

/// The first item of a block at which its sum exceeds `rest`, and how far into it that is.
#[inline(always)]
pub(super) fn within(block: [f64; BLOCK], rest: f64) -> (usize, f64) {
    // By pairs: half as many additions wait for the one before.
    let (mut index, mut before, mut sum) = (0, 0.0, 0.0);
    for k in 0..BLOCK / 2 {
        sum += block[2 * k] + block[2 * k + 1];
        let passed = sum <= rest;
        index += 2 * usize::from(passed);
        before = if passed { sum } else { before };
    }
    if index == BLOCK {
        // The block's sum was formed in another order and may be larger by a rounding: its last mass.
        index = block.iter().rposition(|&mass| mass > 0.0).unwrap_or(0);
        return (index, block[index]);
    }
    let first = before + block[index];
    if first <= rest { (index + 1, rest - first) } else { (index, rest - before) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inversion_never_picks_a_block_without_mass() {
        let cumulative = [0.0, 0.0, 0.25, 0.25, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(find(&cumulative, 0.0), (2, 0.0));
        assert_eq!(find(&cumulative, 0.2499).0, 2);
        assert_eq!(find(&cumulative, 0.25), (4, 0.0));
        assert_eq!(find(&cumulative, 1.0 - f64::EPSILON / 2.0).0, 4);
        // Even where rounding reaches the total.
        assert_eq!(find(&cumulative, 1.0).0, 4);
        assert_eq!(within(first_block(&[0.0, 0.5, 0.0, 0.25, 0.0]), 0.0), (1, 0.0));
        assert_eq!(within(first_block(&[0.0, 0.5, 0.0, 0.25, 0.0]), 0.5), (3, 0.0));
        assert_eq!(within(first_block(&[0.0, 0.5, 0.0, 0.25, 0.0]), 0.75), (3, 0.25));
    }

    #[test]
    fn a_line_is_summed_to_its_odd_end() {
        let line: Vec<f64> = (1..=20).map(f64::from).collect();
        let mut masses = [0.0; 2];
        Across(&line).fill(&mut masses);
        assert_eq!(masses, [136.0, 74.0]);
    }
}
