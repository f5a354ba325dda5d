//! Pixels as whole numbers of the same order, in which comparing, counting and checking vectorise.

use std::fmt::Debug;
use std::ops::{AddAssign, BitOrAssign};

use super::pack::{CHUNK, Pack, Packed};
use super::workspace::{Buffers, Workspace};

/// The bits of a pixel, read as a signed integer. Those of numbers >= 0 order like the numbers themselves.
///
/// Everything else is out of their way: -0.0 and negative numbers are below, infinity and NaN above.
pub trait Key: Copy + Ord + Debug + Default + From<bool> + AddAssign + BitOrAssign {
    /// Below every other key; the key of -0.0.
    const MIN: Self;
    /// Above the key of every valid pixel.
    const MAX: Self;
    /// A count that was made in keys, so that all lanes of a loop have one width.
    fn count(self) -> usize;
    /// The next key after the middle between two keys, of which the first is smaller; never above the second.
    fn middle(low: Self, high: Self) -> Self;
    /// The key just above another that is not the largest.
    fn after(self) -> Self;
    /// The key just below another that is not the least.
    fn before(self) -> Self;
    /// Negative if this is no key of a positive finite number or +0.0, else not; may be or-ed together.
    fn doubt(self) -> Self;
}

/// A pixel of a landscape: float32, or float64 so that a caller's own comparison `landscape >= d` holds.
///
/// Sealed: what it asks for has no name outside.
pub trait Pixel: Copy + PartialOrd + Debug + Default + Into<f64> + Send + Sync {
    /// Signed integer of the same size.
    type Key: Key;
    /// One step of the exponent, which takes infinity and NaN into the sign bit and nothing below them.
    const STEP: Self::Key;
    /// The bits as a key.
    fn key(self) -> Self::Key;
    /// The number with these bits.
    fn from_key(key: Self::Key) -> Self;
    /// Its buffers in a workspace.
    #[doc(hidden)]
    fn buffers(workspace: &mut Workspace) -> &mut Buffers<Self>;
    /// Moves the pixels strictly between two keys to the front, see [`Pack`].
    #[doc(hidden)]
    fn pack<P: Pack>(
        pack: P,
        chunk: &[Self; CHUNK],
        bounds: [Self::Key; 2],
        out: &mut [Self; CHUNK],
    ) -> Packed;
    /// Whether the pixel is finite and not negative.
    fn valid(self) -> bool;
}

macro_rules! pixel {
    ($float:ty, $key:ty, $unsigned:ty, $buffers:ident) => {
        impl Key for $key {
            const MIN: Self = <$key>::MIN;
            const MAX: Self = <$key>::MAX;
            #[inline(always)]
            fn count(self) -> usize {
                self as usize
            }
            #[inline(always)]
            fn middle(low: Self, high: Self) -> Self {
                let distance = high.wrapping_sub(low) as $unsigned;
                low.wrapping_add(((distance >> 1) + (distance & 1)) as $key)
            }
            #[inline(always)]
            fn after(self) -> Self {
                self + 1
            }
            #[inline(always)]
            fn before(self) -> Self {
                self - 1
            }
            #[inline(always)]
            fn doubt(self) -> Self {
                self | self.wrapping_add(<$float>::STEP)
            }
        }

        impl Pixel for $float {
            type Key = $key;
            const STEP: $key = 1 << (<$float>::MANTISSA_DIGITS - 1);
            #[inline(always)]
            fn key(self) -> $key {
                self.to_bits() as $key
            }
            #[inline(always)]
            fn from_key(key: $key) -> $float {
                <$float>::from_bits(key as $unsigned)
            }
            fn buffers(workspace: &mut Workspace) -> &mut Buffers<Self> {
                &mut workspace.$buffers
            }
            #[inline(always)]
            fn pack<P: Pack>(
                pack: P,
                chunk: &[Self; CHUNK],
                bounds: [$key; 2],
                out: &mut [Self; CHUNK],
            ) -> Packed {
                pack.$buffers(chunk, bounds, out)
            }
            #[inline(always)]
            fn valid(self) -> bool {
                (0.0..<$float>::INFINITY).contains(&self)
            }
        }
    };
}
pixel!(f32, i32, u32, single);
pixel!(f64, i64, u64, double);
