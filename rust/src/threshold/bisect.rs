//! An order statistic by bisection of its value: counts only, nothing is moved and no branch hangs on a pixel.

use super::pixel::{Key, Pixel};

/// The `rank`-th largest key of the pixels, 1 being the largest, and the least and the largest of all.
///
/// Takes a pass per bit in which the two differ at the most; usually half of that, because it ends when a
/// bound has exactly `rank` pixels above it.
#[inline(always)]
pub fn bisect<T: Pixel>(pixels: &[T], rank: usize) -> (T::Key, [T::Key; 2]) {
    let range = range(pixels);
    let [mut low, mut high] = range;
    while low < high {
        let middle = Key::middle(low, high);
        let count = count(pixels, middle);
        if count == rank {
            return (least_from(pixels, middle), range);
        }
        if count > rank { low = middle } else { high = middle.before() }
    }
    (low, range)
}

/// The least and the largest key.
#[inline(always)]
fn range<T: Pixel>(pixels: &[T]) -> [T::Key; 2] {
    let (mut least, mut largest) = (T::Key::MAX, T::Key::MIN);
    for pixel in pixels {
        least = least.min(pixel.key());
        largest = largest.max(pixel.key());
    }
    [least, largest]
}

/// How many keys are at least this one.
#[inline(always)]
pub fn count<T: Pixel>(pixels: &[T], bound: T::Key) -> usize {
    let mut count = T::Key::default();
    for pixel in pixels {
        count += T::Key::from(pixel.key() >= bound);
    }
    count.count()
}

/// The least key that is at least this one; the largest of all keys if there is none.
#[inline(always)]
pub fn least_from<T: Pixel>(pixels: &[T], bound: T::Key) -> T::Key {
    let mut least = T::Key::MAX;
    for pixel in pixels {
        let key = if pixel.key() >= bound { pixel.key() } else { T::Key::MAX };
        least = least.min(key);
    }
    least
}
