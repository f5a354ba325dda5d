//! The `rank`-th largest pixel of a landscape, in little more than one pass over it.

use super::bisect::{bisect, count};
use super::pack::{CHUNK, Gathering, Pack};
use super::pixel::{Key, Pixel};

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
    pub spare: &'a mut Vec<T>,
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
        let Self { pixels, width, rank, sample, inside, spare } = self;
        let (mut narrowed, doubt) = narrow(pack, pixels, width, rank, sample, inside);
        loop {
            match narrowed {
                Narrowed::To(key) => return Found { key, doubt },
                Narrowed::Inside { len, rank } => {
                    std::mem::swap(inside, spare);
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
    Inside { len: usize, rank: usize },
}

/// One pass; also tells whether a pixel is in doubt.
#[inline(always)]
fn narrow<T: Pixel, P: Pack>(
    pack: P,
    pixels: &[T],
    width: usize,
    rank: usize,
    sample: &mut Vec<T>,
    inside: &mut Vec<T>,
) -> (Narrowed<T::Key>, bool) {
    let zero = T::Key::default();
    if pixels.len() <= SMALL {
        let (key, [least, largest]) = bisect(pixels, rank);
        return (Narrowed::To(key), least.doubt() < zero || largest.doubt() < zero);
    }
    let [low, high] = bracket(pixels, width, rank, sample);
    if inside.len() < pixels.len() + CHUNK {
        inside.resize(pixels.len() + CHUNK, T::default());
    }
    let Gathered { below, inside: len, doubt } = gather(pack, pixels, [low, high], inside);
    let from_high = pixels.len() - below;

    // The bracket is open, so that a value which many pixels share is never gathered if a sample met it.
    let narrowed = if rank <= from_high {
        Narrowed::To(if rank > count_above(pixels, high) { high } else { bisect(pixels, rank).0 })
    } else if rank <= from_high + len {
        Narrowed::Inside { len, rank: rank - from_high }
    } else if rank <= count(pixels, low) {
        Narrowed::To(low)
    } else {
        Narrowed::To(bisect(pixels, rank).0)
    };
    (narrowed, doubt)
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
    take_every(step, pixels, sample);
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

/// Every `step`-th pixel, beginning with the first.
#[inline(always)]
fn take_every<T: Pixel>(step: usize, pixels: &[T], out: &mut Vec<T>) {
    out.resize(pixels.len().div_ceil(step), T::default());
    for (out, pixels) in out.iter_mut().zip(pixels.chunks(step)) {
        *out = pixels[0];
    }
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
        if let Some(out) = inside[gathered.inside..].first_chunk_mut() {
            let packed = T::pack(pack, chunk, bounds, out);
            gathered.inside += packed.inside;
            gathered.below += packed.below;
            gathered.doubt |= packed.doubt;
        }
    }
    for &pixel in rest {
        inside[gathered.inside] = pixel;
        gathered.inside += usize::from((pixel.key() > low) & (pixel.key() < high));
        gathered.below += usize::from(pixel.key() < high);
        gathered.doubt |= pixel.key().doubt() < T::Key::default();
    }
    gathered
}
