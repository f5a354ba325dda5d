//! Gathering of the pixels between two bounds: the one step that no plain loop compiles well to.

#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};
use pulp::{Arch, WithSimd, cast};

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

#[cfg(target_arch = "x86_64")]
impl Pack for V4 {
    #[inline(always)]
    fn single(self, chunk: &[f32; CHUNK], [low, high]: [i32; 2], out: &mut [f32; CHUNK]) -> Packed {
        const LANES: usize = 16;
        let f = self.avx512f;
        let [low, high, step] = [low, high, f32::STEP].map(|key| f._mm512_set1_epi32(key));
        let (mut inside, mut below, mut doubt) = (0, 0, f._mm512_setzero_si512());
        for part in chunk.as_chunks::<LANES>().0 {
            let keys = cast(*part);
            let under = f._mm512_cmplt_epi32_mask(keys, high);
            let within = f._mm512_mask_cmpgt_epi32_mask(under, keys, low);
            let front: [f32; LANES] = cast(f._mm512_maskz_compress_epi32(within, keys));
            out[inside..][..LANES].copy_from_slice(&front);
            inside += within.count_ones() as usize;
            below += under.count_ones() as usize;
            doubt = f._mm512_or_si512(doubt, f._mm512_or_si512(keys, f._mm512_add_epi32(keys, step)));
        }
        Packed { inside, below, doubt: f._mm512_cmplt_epi32_mask(doubt, f._mm512_setzero_si512()) != 0 }
    }
    #[inline(always)]
    fn double(self, chunk: &[f64; CHUNK], [low, high]: [i64; 2], out: &mut [f64; CHUNK]) -> Packed {
        const LANES: usize = 8;
        let f = self.avx512f;
        let [low, high, step] = [low, high, f64::STEP].map(|key| f._mm512_set1_epi64(key));
        let (mut inside, mut below, mut doubt) = (0, 0, f._mm512_setzero_si512());
        for part in chunk.as_chunks::<LANES>().0 {
            let keys = cast(*part);
            let under = f._mm512_cmplt_epi64_mask(keys, high);
            let within = f._mm512_mask_cmpgt_epi64_mask(under, keys, low);
            let front: [f64; LANES] = cast(f._mm512_maskz_compress_epi64(within, keys));
            out[inside..][..LANES].copy_from_slice(&front);
            inside += within.count_ones() as usize;
            below += under.count_ones() as usize;
            doubt = f._mm512_or_si512(doubt, f._mm512_or_si512(keys, f._mm512_add_epi64(keys, step)));
        }
        Packed { inside, below, doubt: f._mm512_cmplt_epi64_mask(doubt, f._mm512_setzero_si512()) != 0 }
    }
}

#[cfg(target_arch = "x86_64")]
impl Pack for V3 {
    #[inline(always)]
    fn single(self, chunk: &[f32; CHUNK], [low, high]: [i32; 2], out: &mut [f32; CHUNK]) -> Packed {
        const LANES: usize = 8;
        static FRONT: [[u32; 8]; 1 << LANES] = front(1);
        let (f, g) = (self.avx, self.avx2);
        let [low, high, step] = [low, high, f32::STEP].map(|key| f._mm256_set1_epi32(key));
        let (mut inside, mut below, mut doubt) = (0, 0, f._mm256_setzero_si256());
        for part in chunk.as_chunks::<LANES>().0 {
            let keys = cast(*part);
            let under = g._mm256_cmpgt_epi32(high, keys);
            let within = g._mm256_and_si256(under, g._mm256_cmpgt_epi32(keys, low));
            let within = f._mm256_movemask_ps(cast(within)) as usize % FRONT.len();
            let front: [f32; LANES] = cast(g._mm256_permutevar8x32_epi32(keys, cast(FRONT[within])));
            out[inside..][..LANES].copy_from_slice(&front);
            inside += within.count_ones() as usize;
            below += f._mm256_movemask_ps(cast(under)).count_ones() as usize;
            doubt = g._mm256_or_si256(doubt, g._mm256_or_si256(keys, g._mm256_add_epi32(keys, step)));
        }
        Packed { inside, below, doubt: f._mm256_movemask_ps(cast(doubt)) != 0 }
    }
    #[inline(always)]
    fn double(self, chunk: &[f64; CHUNK], [low, high]: [i64; 2], out: &mut [f64; CHUNK]) -> Packed {
        const LANES: usize = 4;
        static FRONT: [[u32; 8]; 1 << LANES] = front(2);
        let (f, g) = (self.avx, self.avx2);
        let [low, high, step] = [low, high, f64::STEP].map(|key| f._mm256_set1_epi64x(key));
        let (mut inside, mut below, mut doubt) = (0, 0, f._mm256_setzero_si256());
        for part in chunk.as_chunks::<LANES>().0 {
            let keys = cast(*part);
            let under = g._mm256_cmpgt_epi64(high, keys);
            let within = g._mm256_and_si256(under, g._mm256_cmpgt_epi64(keys, low));
            let within = f._mm256_movemask_pd(cast(within)) as usize % FRONT.len();
            let front: [f64; LANES] = cast(g._mm256_permutevar8x32_epi32(keys, cast(FRONT[within])));
            out[inside..][..LANES].copy_from_slice(&front);
            inside += within.count_ones() as usize;
            below += f._mm256_movemask_pd(cast(under)).count_ones() as usize;
            doubt = g._mm256_or_si256(doubt, g._mm256_or_si256(keys, g._mm256_add_epi64(keys, step)));
        }
        Packed { inside, below, doubt: f._mm256_movemask_pd(cast(doubt)) != 0 }
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
