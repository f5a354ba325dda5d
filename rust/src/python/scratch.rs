//! Buffers that a thread keeps from call to call.

use std::cell::Cell;
use std::thread::LocalKey;

/// Pixels of an image up to which buffers are kept: enough for 3840 x 2160.
const KEPT: usize = 1 << 23;

/// Does some work on an image of that many pixels with this thread's buffers.
///
/// They are taken out while in use: a call that comes in between, from a signal's handler, finds none and makes
/// its own. A panic loses them, which costs the next call an allocation.
pub fn with<T: Default, R>(
    buffers: &'static LocalKey<Cell<T>>,
    pixels: usize,
    work: impl FnOnce(&mut T) -> R,
) -> R {
    let mut taken = buffers.take();
    let result = work(&mut taken);
    if pixels <= KEPT {
        buffers.set(taken);
    }
    result
}
