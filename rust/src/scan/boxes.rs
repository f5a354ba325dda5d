//! Sums of neighbours.

use super::band::Count;

/// Buffers of [`box_sums`].
#[derive(Clone, Debug, Default)]
pub struct Levels<C> {
    from: Vec<C>,
    to: Vec<C>,
}

/// `sums[i] = values[i] + ... + values[i + width - 1]`, for as many as there are sums.
///
/// By doubling: sums of 1, 2, 4 ... neighbours, of which those that make up `width` are added. There are few
/// additions for each value, and unlike in a running sum none waits for the one before.
#[inline(always)]
pub fn box_sums<C: Count>(values: &[C], width: usize, levels: &mut Levels<C>, sums: &mut [C]) {
    let count = sums.len();
    let values = &values[..count + width - 1];
    for buffer in [&mut levels.from, &mut levels.to] {
        if buffer.len() < values.len() {
            buffer.resize(values.len(), C::default());
        }
    }
    let (mut from, mut to) = (&mut levels.from[..values.len()], &mut levels.to[..values.len()]);
    from.copy_from_slice(values);
    let (mut size, mut done) = (1, 0);
    loop {
        if width & size != 0 {
            let part = &from[done..done + count];
            if done == 0 {
                sums.copy_from_slice(part);
            } else {
                for (sum, &x) in sums.iter_mut().zip(part) {
                    *sum = sum.plus(x);
                }
            }
            done += size;
        }
        if done == width {
            return;
        }
        let left = from.len() - size;
        let (low, high) = (&from[..left], &from[size..]);
        for ((sum, &a), &b) in to[..left].iter_mut().zip(low).zip(high) {
            *sum = a.plus(b);
        }
        (from, to) = (&mut to[..left], &mut from[..left]);
        size *= 2;
    }
}
