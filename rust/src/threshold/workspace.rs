//! The memory of a threshold, kept from one call to the next.

/// Buffers that belong to the caller: once they have met an image of a size, a call for one of that size
/// allocates nothing. They take about two images.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    pub(super) single: Buffers<f32>,
    pub(super) double: Buffers<f64>,
}

/// The buffers for one type of pixel. None is ever shortened.
#[derive(Clone, Debug, Default)]
pub struct Buffers<T> {
    /// The pixels of every stride-th row and column.
    pub(super) read: Vec<T>,
    pub(super) sample: Vec<T>,
    /// Two for gathered pixels, so that some can be gathered from those that were.
    pub(super) gathered: [Vec<T>; 2],
}

/// The first `len` elements of a buffer, which grows to them if it must.
pub fn first<T: Clone + Default>(len: usize, buffer: &mut Vec<T>) -> &mut [T] {
    if buffer.len() < len {
        buffer.resize(len, T::default());
    }
    &mut buffer[..len]
}
