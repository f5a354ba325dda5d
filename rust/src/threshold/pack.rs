//! Gathering of the pixels between two bounds: the one step that no plain loop compiles well to.

#[cfg(target_arch = "x86_64")]
mod x86;

use pulp::{Arch, WithSimd};

use super::pixel::{Key, Pixel};
use crate::simd::Simd;

/// Pixels that are gathered at once.
pub const CHUNK: usize = 64;

/// Moves the pixels of a chunk whose keys lie strictly between two bounds to the front of `out`, in their
/// order. What it writes behind them has no meaning.
pub trait Pack: Copy {
    fn single(self, chunk: &[f32; CHUNK], bounds: [i32; 2], out: &mut [f32; CHUNK]) -> Packed;
    fn double(self, chunk: &[f64; CHUNK], bounds: [i64; 2], out: &mut [f64; CHUNK]) -> Packed;
}

/// How many pixels of a chunk lie where.
pub struct Packed {
    /// Strictly between the bounds.
    pub inside: usize,
    /// Strictly below the upper bound.
    pub below: usize,
    /// Whether one of them is in doubt, see [`Key::doubt`].
    pub doubt: bool,
}

/// Work that gathers. Mark the implementation of `run` `#[inline(always)]`.
pub trait Gathering {
    type Output;
    fn run<P: Pack>(self, pack: P) -> Self::Output;
}

/// Runs the work on an instruction set.
pub fn run<G: Gathering>(simd: Simd, work: G) -> G::Output {
    struct Op<G, P>(G, P);
    impl<G: Gathering, P: Pack> WithSimd for Op<G, P> {
        type Output = G::Output;
        #[inline(always)]
        fn with_simd<S: pulp::Simd>(self, _: S) -> G::Output {
            self.0.run(self.1)
        }
    }
    match simd.arch() {
        #[cfg(target_arch = "x86_64")]
        Arch::V3(v3) => pulp::Simd::vectorize(v3, Op(work, v3)),
        #[cfg(target_arch = "x86_64")]
        Arch::V4(v4) => pulp::Simd::vectorize(v4, Op(work, v4)),
        arch => arch.dispatch(Op(work, Plain)),
    }
}

/// Without such instructions: every pixel is written and only those between the bounds are kept, which leaves
/// no branch to miss.
#[derive(Clone, Copy)]
pub struct Plain;

impl Pack for Plain {
    #[inline(always)]
    fn single(self, chunk: &[f32; CHUNK], bounds: [i32; 2], out: &mut [f32; CHUNK]) -> Packed {
        plain(chunk, bounds, out)
    }
    #[inline(always)]
    fn double(self, chunk: &[f64; CHUNK], bounds: [i64; 2], out: &mut [f64; CHUNK]) -> Packed {
        plain(chunk, bounds, out)
    }
}

#[inline(always)]
fn plain<T: Pixel>(chunk: &[T; CHUNK], [low, high]: [T::Key; 2], out: &mut [T; CHUNK]) -> Packed {
    let (mut below, mut doubt) = (T::Key::default(), T::Key::default());
    for pixel in chunk {
        below += T::Key::from(pixel.key() < high);
    }
    for pixel in chunk {
        doubt |= pixel.key().doubt();
    }
    let mut inside = 0;
    for part in chunk.as_chunks::<16>().0 {
        // Most parts of a smooth landscape hold none, and this loop is a few vector instructions.
        let mut any = T::Key::default();
        for pixel in part {
            any |= T::Key::from((pixel.key() > low) & (pixel.key() < high));
        }
        if any == T::Key::default() {
            continue;
        }
        for &pixel in part {
            out[inside % CHUNK] = pixel;
            inside += usize::from((pixel.key() > low) & (pixel.key() < high));
        }
    }
    Packed { inside, below: below.count(), doubt: doubt < T::Key::default() }
}
