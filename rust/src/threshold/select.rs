//! The `rank`-th largest pixel of a landscape, in little more than one pass over it.

use super::bisect::{bisect, count};
use super::pack::{CHUNK, Gathering, Pack};
use super::pixel::{Key, Pixel};
use super::subsample::every;
use super::workspace::first;

/// Up to this many pixels are bisected at once.
pub const SMALL: usize = 1024;

/// Finds the `rank`-th largest key, 1 being the largest.
///
/// A sample brackets it; one pass checks the pixels, counts those above the bracket and gathers those inside.
/// This goes on with what was gathered until it is little, and a bisection ends it. The idea is that of Floyd
/// and Rivest (1975), without their moving about of all elements.
pub struct Largest<'a, T> {
    pub pixels: &'a [T],
    /// Length of a row, which the sample shall not be in step with.
    pub width: usize,
    pub rank: usize,
    pub sample: &'a mut Vec<T>,
    pub gathered: &'a mut [Vec<T>; 2],
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
        let Self { pixels, width, rank, sample, gathered: [inside, spare] } = self;
        // All that any content may need, so that the content never makes a call allocate.
        let sample = first(2 * (pixels.len() / least_step(pixels.len())) + 1, sample);
        let [mut inside, mut spare] = [inside, spare].map(|buffer| first(pixels.len() + CHUNK, buffer));

        let (mut narrowed, doubt) = narrow(pack, pixels, width, rank, sample, inside);
        loop {
            match narrowed {
                Narrowed::To(key) => return Found { key, doubt },
                Narrowed::Among { len, rank } => {
                    (inside, spare) = (spare, inside);
                    (narrowed, _) = narrow(pack, &spare[..len], 1, rank, sample, inside);
                }
            }
        }
    }
}

/// How far a pass has come.
enum Narrowed<K> {
    /// The wanted key.
    To(K),
    /// It has this rank among the gathered pixels, of which there are `len`.
    Among { len: usize, rank: usize },
}

/// One pass; also tells whether a pixel is in doubt.
#[inline(always)]
fn narrow<T: Pixel, P: Pack>(
    pack: P,
    pixels: &[T],
    width: usize,
    rank: usize,
    sample: &mut [T],
    inside: &mut [T],
) -> (Narrowed<T::Key>, bool) {
    let zero = T::Key::default();
    if pixels.len() <= SMALL {
        let (key, [least, largest]) = bisect(pixels, rank);
        return (Narrowed::To(key), least.doubt() < zero || largest.doubt() < zero);
    }
    let [low, high] = bracket(pixels, width, rank, sample);
    let Gathered { below, inside: len, doubt } = gather(pack, pixels, [low, high], inside);
    let from_high = pixels.len() - below;

    // The bracket is open, so that a value which many pixels share is not gathered where the sample met it.
    let key = if rank <= from_high {
        let above = if high < T::Key::MAX { count(pixels, high.after()) } else { 0 };
        (rank > above).then_some(high)
    } else if rank > from_high + len {
        (rank <= count(pixels, low)).then_some(low)
    } else if len > pixels.len() / 2 {
        // A sample so unlike the rest may be so again, and the passes must not add up.
        Some(bisect(&inside[..len], rank - from_high).0)
    } else {
        return (Narrowed::Among { len, rank: rank - from_high }, doubt);
    };
    (Narrowed::To(key.unwrap_or_else(|| bisect(pixels, rank).0)), doubt)
}

/// Two keys between which the wanted one lies in all likelihood.
#[inline(always)]
fn bracket<T: Pixel>(pixels: &[T], width: usize, rank: usize, sample: &mut [T]) -> [T::Key; 2] {
    let step = step(pixels.len(), width);
    let sample = &mut sample[..pixels.len().div_ceil(step)];
    every(step, pixels, sample);
    let size = sample.len() as f64;
    let share = rank as f64 / pixels.len() as f64;
    let (centre, margin) = (share * size, DEVIATIONS * (size * share * (1.0 - share)).sqrt() + 1.0);
    let (above, below) = ((centre - margin) as usize, (centre + margin).ceil() as usize);
    [
        if below > sample.len() { T::Key::MIN } else { bisect(sample, below).0 },
        if above < 1 { T::Key::MAX } else { bisect(sample, above).0 },
    ]
}

/// Half the bracket, in standard deviations of the rank in a random sample: a miss is one in ten thousand.
const DEVIATIONS: f64 = 4.0;

/// The step of the sample, which meets every column of the image alike.
pub fn step(pixels: usize, width: usize) -> usize {
    (least_step(pixels)..).find(|&step| coprime(step, width)).unwrap_or(1)
}

/// The cube root of the size, but for a factor: this balances the sample against what it leaves to gather.
fn least_step(pixels: usize) -> usize {
    (2.0 * (pixels as f64).cbrt()) as usize
}

fn coprime(mut a: usize, mut b: usize) -> bool {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a == 1
}

struct Gathered {
    /// Pixels strictly below the upper end.
    below: usize,
    /// Pixels strictly between the ends.
    inside: usize,
    doubt: bool,
}

/// Checks all pixels, counts those from the upper bound and gathers those strictly between the bounds.
#[inline(always)]
fn gather<T: Pixel, P: Pack>(pack: P, pixels: &[T], bounds: [T::Key; 2], inside: &mut [T]) -> Gathered {
    let [low, high] = bounds;
    let mut gathered = Gathered { below: 0, inside: 0, doubt: false };
    let (chunks, rest) = pixels.as_chunks::<CHUNK>();
    for chunk in chunks {
        let Some(out) = inside[gathered.inside..].first_chunk_mut() else {
            unreachable!("the buffer has a chunk more than there are pixels")
        };
        let packed = T::pack(pack, chunk, bounds, out);
        gathered.inside += packed.inside;
        gathered.below += packed.below;
        gathered.doubt |= packed.doubt;
    }
    for &pixel in rest {
        inside[gathered.inside] = pixel;
        gathered.inside += usize::from((pixel.key() > low) & (pixel.key() < high));
        gathered.below += usize::from(pixel.key() < high);
        gathered.doubt |= pixel.key().doubt() < T::Key::default();
    }
    gathered
}
