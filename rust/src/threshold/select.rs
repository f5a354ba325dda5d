//! The `rank`-th largest pixel of a landscape, in little more than one pass over it.

use super::bisect::{bisect, count};
use super::pixel::{Key, Pixel};
use super::pack::{CHUNK, Gathering, Pack};

/// Up to this many pixels are bisected at once.
pub const SMALL: usize = 1024;

/// Finds the `rank`-th largest key, 1 being the largest.
///
/// A sample brackets it, one pass checks the pixels, counts those above the bracket and gathers those within,
/// and a bisection ends it (Floyd and Rivest, 1975, with the recursion replaced).
pub struct Largest<'a, T> {
    pub pixels: &'a [T],
    /// Length of a row, which the sample shall not be in step with.
    pub width: usize,
    pub rank: usize,
    pub sample: &'a mut Vec<T>,
    pub inside: &'a mut Vec<T>,
}

/// What a search has found.
pub struct Found<K> {
    pub key: K,
    /// Whether a pixel is negative, -0.0, infinite or NaN: a closer look must decide.
    pub doubt: bool,
}

impl<T: Pixel> Gathering for Largest<'_, T> {
    type Output = Found<T::Key>;

    #[inline(always)]
    fn run<P: Pack>(self, pack: P) -> Self::Output {
        let Self { pixels, width, rank, sample, inside } = self;
        if pixels.len() <= SMALL {
            let (key, [least, largest]) = bisect(pixels, rank);
            return Found { key, doubt: least.doubt() < T::Key::default() || largest.doubt() < T::Key::default() };
        }
        let [low, high] = bracket(pixels, width, rank, sample);
        inside.resize(pixels.len() + CHUNK, T::default());
        let Gathered { from_high, inside: len, doubt } = gather(pack, pixels, [low, high], inside);
        let doubt = doubt < T::Key::default();

        // The bracket is open, so that a value which many pixels share is never gathered if a sample met it.
        let key = if rank <= from_high {
            if rank > count_above(pixels, high) { high } else { bisect(pixels, rank).0 }
        } else if rank <= from_high + len {
            bisect(&inside[..len], rank - from_high).0
        } else if rank <= count(pixels, low) {
            low
        } else {
            bisect(pixels, rank).0
        };
        Found { key, doubt }
    }
}

#[inline(always)]
fn count_above<T: Pixel>(pixels: &[T], bound: T::Key) -> usize {
    let mut count = T::Key::default();
    for pixel in pixels {
        count += T::Key::from(pixel.key() > bound);
    }
    count.count()
}

/// Two keys between which the wanted one lies in all likelihood.
#[inline(always)]
fn bracket<T: Pixel>(pixels: &[T], width: usize, rank: usize, sample: &mut Vec<T>) -> [T::Key; 2] {
    let step = step(pixels.len(), width);
    sample.clear();
    sample.extend(pixels.iter().step_by(step));
    let size = sample.len() as f64;
    let share = (rank as f64 / pixels.len() as f64).min(1.0);
    let centre = share * size;
    let margin = DEVIATIONS * (size * share * (1.0 - share)).sqrt() + 1.0;
    let (above, below) = ((centre - margin) as usize, (centre + margin).ceil() as usize);
    [
        if below > sample.len() { T::Key::MIN } else { bisect(sample, below).0 },
        if above < 1 { T::Key::MAX } else { bisect(sample, above).0 },
    ]
}

/// Half the bracket, in standard deviations of the rank in a random sample.
const DEVIATIONS: f64 = 3.0;

/// The step of the sample: about the cube root of the size, which makes sample and gathered part alike in size.
fn step(pixels: usize, width: usize) -> usize {
    let least = (pixels as f64).cbrt() as usize;
    (least..).find(|&step| coprime(step, width)).unwrap_or(1)
}

fn coprime(mut a: usize, mut b: usize) -> bool {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a == 1
}

struct Gathered<K> {
    /// Pixels not below the upper end.
    from_high: usize,
    /// Pixels strictly between the ends.
    inside: usize,
    doubt: K,
}

/// Pixels that are checked and counted before they are gathered, while they are in the innermost cache.
const BLOCK: usize = 1024;

/// Checks all pixels, counts those from the upper bound and gathers those strictly between the bounds.
#[inline(always)]
fn gather<T: Pixel, P: Pack>(
    pack: P,
    pixels: &[T],
    bounds: [T::Key; 2],
    inside: &mut [T],
) -> Gathered<T::Key> {
    let [low, high] = bounds;
    let mut gathered = Gathered { from_high: 0, inside: 0, doubt: T::Key::default() };
    for block in pixels.chunks(BLOCK) {
        let (mut doubt, mut from_high) = (T::Key::default(), T::Key::default());
        for pixel in block {
            doubt |= pixel.key().doubt();
            from_high += T::Key::from(pixel.key() >= high);
        }
        gathered.doubt |= doubt;
        gathered.from_high += from_high.count();
        let (chunks, rest) = block.as_chunks::<CHUNK>();
        for chunk in chunks {
            if let Some(out) = inside[gathered.inside..].first_chunk_mut() {
                gathered.inside += T::pack(pack, chunk, bounds, out);
            }
        }
        for &pixel in rest {
            inside[gathered.inside] = pixel;
            gathered.inside += usize::from((pixel.key() > low) & (pixel.key() < high));
        }
    }
    gathered
}
