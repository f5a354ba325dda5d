//! Gathering with AVX-512, which has an instruction for it, and with AVX2, which permutes by a table.

use pulp::cast;
use pulp::x86::{V3, V4};

use super::{CHUNK, Pack, Packed};
use crate::threshold::pixel::Pixel;

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
