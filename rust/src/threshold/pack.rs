//! Gathering of the pixels between two bounds: the one step that no plain loop compiles well to.

#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};
use pulp::{Arch, WithSimd, cast};

use super::pixel::{Key, Pixel};
use crate::simd::Simd;

/// Pixels that are gathered at once.
pub const CHUNK: usize = 16;

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
    /// Not zero if the key of a pixel is in doubt, see [`Key::doubt`].
    pub doubt: u32,
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
    // Most chunks of a smooth landscape hold none, and this loop is a few vector instructions.
    let (mut below, mut any, mut doubt) = (T::Key::default(), T::Key::default(), T::Key::default());
    for pixel in chunk {
        doubt |= pixel.key().doubt();
        below += T::Key::from(pixel.key() < high);
        any |= T::Key::from((pixel.key() > low) & (pixel.key() < high));
    }
    let mut inside = 0;
    if any != T::Key::default() {
        for &pixel in chunk {
            out[inside % CHUNK] = pixel;
            inside += usize::from((pixel.key() > low) & (pixel.key() < high));
        }
    }
    Packed { inside, below: below.count(), doubt: (doubt < T::Key::default()).into() }
}

#[cfg(target_arch = "x86_64")]
impl Pack for V4 {
    #[inline(always)]
    fn single(self, chunk: &[f32; CHUNK], [low, high]: [i32; 2], out: &mut [f32; CHUNK]) -> Packed {
        let f = self.avx512f;
        let keys = cast(*chunk);
        let below = f._mm512_cmplt_epi32_mask(keys, f._mm512_set1_epi32(high));
        let inside = f._mm512_mask_cmpgt_epi32_mask(below, keys, f._mm512_set1_epi32(low));
        *out = cast(f._mm512_maskz_compress_epi32(inside, keys));
        Packed {
            inside: inside.count_ones() as usize,
            below: below.count_ones() as usize,
            doubt: f._mm512_cmpge_epu32_mask(keys, f._mm512_set1_epi32(f32::INFINITY.key())).into(),
        }
    }
    #[inline(always)]
    fn double(self, chunk: &[f64; CHUNK], [low, high]: [i64; 2], out: &mut [f64; CHUNK]) -> Packed {
        const LANES: usize = 8;
        let f = self.avx512f;
        let mut packed = Packed { inside: 0, below: 0, doubt: 0 };
        for half in chunk.as_chunks::<LANES>().0 {
            let keys = cast(*half);
            let below = f._mm512_cmplt_epi64_mask(keys, f._mm512_set1_epi64(high));
            let inside = f._mm512_mask_cmpgt_epi64_mask(below, keys, f._mm512_set1_epi64(low));
            let front: [f64; LANES] = cast(f._mm512_maskz_compress_epi64(inside, keys));
            out[packed.inside..][..LANES].copy_from_slice(&front);
            packed.inside += inside.count_ones() as usize;
            packed.below += below.count_ones() as usize;
            let infinity = f._mm512_set1_epi64(f64::INFINITY.key());
            packed.doubt |= u32::from(f._mm512_cmpge_epu64_mask(keys, infinity));
        }
        packed
    }
}

#[cfg(target_arch = "x86_64")]
impl Pack for V3 {
    #[inline(always)]
    fn single(self, chunk: &[f32; CHUNK], [low, high]: [i32; 2], out: &mut [f32; CHUNK]) -> Packed {
        const LANES: usize = 8;
        static FRONT: [[u32; 8]; 1 << LANES] = front(1);
        let (f, g) = (self.avx, self.avx2);
        let mut packed = Packed { inside: 0, below: 0, doubt: 0 };
        for half in chunk.as_chunks::<LANES>().0 {
            let keys = cast(*half);
            let above = g._mm256_cmpgt_epi32(keys, f._mm256_set1_epi32(low));
            let below = g._mm256_cmpgt_epi32(f._mm256_set1_epi32(high), keys);
            let inside = f._mm256_movemask_ps(cast(g._mm256_and_si256(above, below))) as u8;
            let below = f._mm256_movemask_ps(cast(below));
            let order = cast(FRONT[usize::from(inside)]);
            let front: [f32; LANES] = cast(g._mm256_permutevar8x32_epi32(keys, order));
            out[packed.inside..][..LANES].copy_from_slice(&front);
            packed.inside += inside.count_ones() as usize;
            packed.below += below.count_ones() as usize;
            let next = g._mm256_add_epi32(keys, f._mm256_set1_epi32(1 << 23));
            packed.doubt |= f._mm256_movemask_ps(cast(g._mm256_or_si256(keys, next))) as u32;
        }
        packed
    }
    #[inline(always)]
    fn double(self, chunk: &[f64; CHUNK], [low, high]: [i64; 2], out: &mut [f64; CHUNK]) -> Packed {
        const LANES: usize = 4;
        static FRONT: [[u32; 8]; 1 << LANES] = front(2);
        let (f, g) = (self.avx, self.avx2);
        let mut packed = Packed { inside: 0, below: 0, doubt: 0 };
        for quarter in chunk.as_chunks::<LANES>().0 {
            let keys = cast(*quarter);
            let above = g._mm256_cmpgt_epi64(keys, f._mm256_set1_epi64x(low));
            let below = g._mm256_cmpgt_epi64(f._mm256_set1_epi64x(high), keys);
            let inside = f._mm256_movemask_pd(cast(g._mm256_and_si256(above, below))) as usize % FRONT.len();
            let below = f._mm256_movemask_pd(cast(below));
            let front: [f64; LANES] = cast(g._mm256_permutevar8x32_epi32(keys, cast(FRONT[inside])));
            out[packed.inside..][..LANES].copy_from_slice(&front);
            packed.inside += inside.count_ones() as usize;
            packed.below += below.count_ones() as usize;
            let next = g._mm256_add_epi64(keys, f._mm256_set1_epi64x(1 << 52));
            packed.doubt |= f._mm256_movemask_pd(cast(g._mm256_or_si256(keys, next))) as u32;
        }
        packed
    }
}

/// For every set of lanes the order that brings its lanes to the front, in words of which a lane has `words`.
#[cfg(target_arch = "x86_64")]
const fn front<const SETS: usize>(words: usize) -> [[u32; 8]; SETS] {
    let mut orders = [[0; 8]; SETS];
    let mut set = 0;
    while set < SETS {
        let (mut word, mut kept) = (0, 0);
        while word < 8 {
            if set >> (word / words) & 1 == 1 {
                orders[set][kept] = word as u32;
                kept += 1;
            }
            word += 1;
        }
        set += 1;
    }
    orders
}
