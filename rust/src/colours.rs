//! Hue and saturation of RGB pixels as bins of a histogram: what a colour histogram counts (Section V).
//!
//! Hue (0 to 179) and saturation (0 to 255) are those of OpenCV's 8-bit HSV, for all 2^24 colours. It gets them
//! from tables of fixed-point reciprocals; here these are computed, which compiles to vector instructions.

use crate::error::{Error, Result};
use crate::simd::{Kernel, Simd};

/// Bits after the point of the reciprocals.
const SHIFT: i32 = 12;
/// Pixels that are converted at once.
const BLOCK: usize = 64;

/// How hue and saturation are divided into bins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colours {
    hues: i32,
    saturations: i32,
    min_saturation: i32,
    min_value: i32,
}

impl Colours {
    /// Bins of equal width; a pixel of less saturation or value, both of 0 to 255, has none.
    ///
    /// # Errors
    /// No bins at all, more of them than there are hues (180) or saturations (256).
    pub fn new(hues: usize, saturations: usize, min_saturation: u8, min_value: u8) -> Result<Self> {
        if !(1..=180).contains(&hues) || !(1..=256).contains(&saturations) {
            let expected = "(hues, saturations) of at least (1, 1) and at most (180, 256)";
            return Err(Error::shape("bins", expected, format!("({hues}, {saturations})")));
        }
        Ok(Self {
            hues: hues as i32,
            saturations: saturations as i32,
            min_saturation: min_saturation.into(),
            min_value: min_value.into(),
        })
    }

    /// Number of bins.
    pub fn count(self) -> usize {
        (self.hues * self.saturations) as usize
    }

    /// Writes the bin of every pixel, `hue bin * saturations + saturation bin`; [`Colours::count`] for those
    /// that have none.
    ///
    /// # Errors
    /// Another number of bytes than three for each pixel.
    pub fn bins(self, simd: Simd, rgb: &[u8], out: &mut [u16]) -> Result<()> {
        if rgb.len() != 3 * out.len() {
            let expected = format!("of {} x 3 elements", out.len());
            return Err(Error::shape("rgb", expected, rgb.len().to_string()));
        }
        simd.run(Conversion { colours: self, rgb, out });
        Ok(())
    }
}

struct Conversion<'a> {
    colours: Colours,
    rgb: &'a [u8],
    out: &'a mut [u16],
}

impl Kernel for Conversion<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        convert(self.colours, self.rgb, self.out);
    }
}

/// Bins of a row of pixels; for kernels, which it is compiled into.
#[inline(always)]
pub(crate) fn convert(colours: Colours, rgb: &[u8], out: &mut [u16]) {
    let (blocks, rest) = rgb.as_chunks::<{ 3 * BLOCK }>();
    let (whole, last) = out.as_chunks_mut::<BLOCK>();
    for (rgb, out) in blocks.iter().zip(whole) {
        *out = convert_block(colours, rgb);
    }
    if !last.is_empty() {
        let mut padded = [0; 3 * BLOCK];
        padded[..rest.len()].copy_from_slice(rest);
        last.copy_from_slice(&convert_block(colours, &padded)[..last.len()]);
    }
}

/// Of a known number of pixels, so that the compiler needs no check within.
#[inline(always)]
fn convert_block(colours: Colours, rgb: &[u8; 3 * BLOCK]) -> [u16; BLOCK] {
    let [mut r, mut g, mut b] = [[0_i32; BLOCK]; 3];
    for (k, pixel) in rgb.as_chunks::<3>().0.iter().enumerate() {
        [r[k], g[k], b[k]] = pixel.map(i32::from);
    }
    let mut bins = [0; BLOCK];
    for (k, found) in bins.iter_mut().enumerate() {
        *found = bin(colours, r[k], g[k], b[k]);
    }
    bins
}

#[inline(always)]
fn bin(colours: Colours, r: i32, g: i32, b: i32) -> u16 {
    let value = r.max(g).max(b);
    let range = value - r.min(g).min(b);
    let round = 1 << (SHIFT - 1);
    let saturation = (range * reciprocal(255 << SHIFT, value) + round) >> SHIFT;
    let sector = if value == r {
        g - b
    } else if value == g {
        b - r + 2 * range
    } else {
        r - g + 4 * range
    };
    let turn = (sector * reciprocal((180 << SHIFT) / 6, range) + round) >> SHIFT;
    let hue = if turn < 0 { turn + 180 } else { turn };
    // Up to 180 * 180 this is a division by 180.
    let of_hue = (hue * colours.hues * 46_604) >> 23;
    let bin = of_hue * colours.saturations + ((saturation * colours.saturations) >> 8);
    let has_hue = (saturation >= colours.min_saturation) & (value >= colours.min_value);
    (if has_hue { bin } else { colours.hues * colours.saturations }) as u16
}

/// `numerator / value`, rounded, and 0 for 0. No such quotient lies half-way between two whole numbers, and float32
/// tells them all apart from there.
#[inline(always)]
fn reciprocal(numerator: i32, value: i32) -> i32 {
    // Beside 1.5 * 2^23 a float32 has no bits left for fractions, and its last ones count from 0.
    const POINT: f32 = 12_582_912.0;
    let quotient = numerator as f32 / value.max(1) as f32 + POINT;
    let rounded = quotient.to_bits() as i32 - POINT.to_bits() as i32;
    if value == 0 { 0 } else { rounded }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the definition, in float64, of a colour whose hue and saturation are far from a border of a bin.
    fn by_definition(colours: Colours, [r, g, b]: [u8; 3]) -> u16 {
        let [r, g, b] = [r, g, b].map(f64::from);
        let value = r.max(g).max(b);
        let range = value - r.min(g).min(b);
        let saturation = if value > 0.0 { (255.0 * range / value).round() } else { 0.0 };
        if saturation < colours.min_saturation.into() || value < colours.min_value.into() {
            return colours.count() as u16;
        }
        let sector = if range == 0.0 {
            0.0
        } else if value == r {
            (g - b) / range
        } else if value == g {
            (b - r) / range + 2.0
        } else {
            (r - g) / range + 4.0
        };
        let hue = (30.0 * sector).round().rem_euclid(180.0);
        let of_hue = (hue * f64::from(colours.hues) / 180.0).floor();
        let of_saturation = (saturation * f64::from(colours.saturations) / 256.0).floor();
        (of_hue * f64::from(colours.saturations) + of_saturation) as u16
    }

    fn bins(colours: Colours, simd: Simd, rgb: &[u8]) -> Vec<u16> {
        let mut out = vec![u16::MAX; rgb.len() / 3];
        colours.bins(simd, rgb, &mut out).unwrap();
        out
    }

    #[test]
    fn pure_colours_are_in_the_bins_of_their_hues() {
        let colours = Colours::new(6, 2, 1, 1).unwrap();
        let rgb = [[255, 0, 0], [255, 255, 0], [0, 255, 0], [0, 255, 255], [0, 0, 255], [255, 0, 255]];
        let found = bins(colours, Simd::best(), rgb.as_flattened());
        assert_eq!(found, [1, 3, 5, 7, 9, 11]);
        let pale = [[255, 200, 200], [200, 255, 200], [80, 80, 80], [0, 0, 0], [1, 0, 0]];
        assert_eq!(bins(colours, Simd::best(), pale.as_flattened()), [0, 4, 12, 12, 1]);
    }

    #[test]
    fn colours_are_binned_by_the_definition_on_every_instruction_set() {
        // Every third level of each channel: rounding to whole hues agrees but for ties, which are left out here
        // and are compared with OpenCV's in Python, for all colours.
        let levels = || (0..=255_u8).step_by(3);
        let rgb: Vec<[u8; 3]> =
            levels().flat_map(|r| levels().flat_map(move |g| levels().map(move |b| [r, g, b]))).collect();
        for (hues, saturations) in [(30, 16), (1, 1), (180, 256), (7, 5)] {
            let colours = Colours::new(hues, saturations, 70, 25).unwrap();
            let found = bins(colours, Simd::best(), rgb.as_flattened());
            let differing =
                rgb.iter().zip(&found).filter(|&(&pixel, &bin)| by_definition(colours, pixel) != bin);
            let differing = differing.count();
            assert!(differing * 25 < rgb.len(), "{differing} of {}", rgb.len());
            for simd in Simd::all() {
                assert_eq!(bins(colours, simd, rgb.as_flattened()), found, "{}", simd.name());
            }
        }
    }

    #[test]
    fn a_row_of_any_length_is_converted_to_its_end() {
        let colours = Colours::new(30, 16, 0, 0).unwrap();
        let rgb: Vec<u8> = (0..3 * 200).map(|k| (k * k % 251) as u8).collect();
        let all = bins(colours, Simd::best(), &rgb);
        for length in [0, 1, 63, 64, 65, 128, 199] {
            assert_eq!(bins(colours, Simd::best(), &rgb[..3 * length]), all[..length]);
        }
    }

    #[test]
    fn reciprocals_are_those_of_exact_division() {
        for numerator in [255 << SHIFT, (180 << SHIFT) / 6] {
            for value in 1..256 {
                assert_eq!(
                    reciprocal(numerator, value),
                    (f64::from(numerator) / f64::from(value)).round() as i32
                );
            }
            assert_eq!(reciprocal(numerator, 0), 0);
        }
    }

    #[test]
    fn bins_that_there_cannot_be_and_buffers_of_another_size_are_errors() {
        for (hues, saturations) in [(0, 1), (1, 0), (181, 1), (1, 257)] {
            assert!(Colours::new(hues, saturations, 0, 0).is_err());
        }
        let colours = Colours::new(30, 16, 0, 0).unwrap();
        let error = colours.bins(Simd::best(), &[0; 5], &mut [0; 2]).unwrap_err().to_string();
        assert!(error.contains("2 x 3"), "{error}");
    }
}
