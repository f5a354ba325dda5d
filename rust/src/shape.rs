//! The size of an image.

use crate::error::{Error, Result};

/// Height and width of an image [px], both at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    height: usize,
    width: usize,
}

impl Shape {
    /// Pixels that an image may have, so that coordinates and indices fit 32 bits.
    pub const MAX_PIXELS: usize = i32::MAX as usize;

    /// Checks that the image has at least one pixel and at most [`Shape::MAX_PIXELS`].
    pub fn new(height: usize, width: usize) -> Result<Self> {
        match height.checked_mul(width) {
            Some(1..=Self::MAX_PIXELS) => Ok(Self { height, width }),
            _ => Err(Error::shape(
                "shape",
                "(height, width) of at least 1 and at most 2147483647 pixels",
                format!("({height}, {width})"),
            )),
        }
    }

    /// Rows.
    pub fn height(self) -> usize {
        self.height
    }

    /// Columns.
    pub fn width(self) -> usize {
        self.width
    }

    /// Number of pixels.
    pub fn pixels(self) -> usize {
        self.height * self.width
    }

    /// Checks that a buffer has one element for every pixel.
    pub fn check(self, argument: &'static str, elements: usize) -> Result<()> {
        if elements == self.pixels() {
            return Ok(());
        }
        Err(Error::shape(
            argument,
            format!("of {} x {} elements", self.height, self.width),
            elements.to_string(),
        ))
    }
}

/// The whole numbers in `[low, high]` that are also in `0..size`, as a half-open range (empty if none).
#[inline(always)]
pub(crate) fn pixels_between(low: f64, high: f64, size: usize) -> (usize, usize) {
    // A float-to-integer cast saturates, so bounds far outside the image need no special case.
    let first = low.ceil().max(0.0) as usize;
    let end = (high.floor() + 1.0).max(0.0) as usize;
    let end = end.min(size);
    (first.min(end), end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_pixel_and_too_many_pixels_are_errors() {
        assert!(Shape::new(0, 3).is_err());
        assert!(Shape::new(usize::MAX, 2).is_err());
        assert!(Shape::new(1, 1).is_ok());
    }

    #[test]
    fn both_ends_belong_to_the_interval_and_the_image_clips_it() {
        assert_eq!(pixels_between(2.0, 4.0, 10), (2, 5));
        assert_eq!(pixels_between(2.1, 2.9, 10), (3, 3));
        assert_eq!(pixels_between(-1e300, 1e300, 10), (0, 10));
        assert_eq!(pixels_between(20.0, 30.0, 10), (10, 10));
        assert_eq!(pixels_between(-30.0, -20.0, 10), (0, 0));
    }
}
