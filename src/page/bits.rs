//! Pictures as text that stands in a page.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::Result;
use crate::picture::png_bytes;
use png::Compression;

/// Bytes of a picture's file at most; one that takes more is drawn half as wide.
const MOST_BYTES: usize = 600_000;

/// A picture in a page.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Image {
    /// What an `img` has as its source.
    pub data: String,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl Image {
    /// Of so many pixels across and down: red, green and blue of each, row by row from the top.
    pub fn of([width, height]: [u32; 2], pixels: &[u8]) -> Result<Image> {
        let (mut size, mut pixels) = ([width, height], pixels.to_vec());
        let mut png = png_bytes(size, &pixels, Compression::Balanced)?;
        while png.len() > MOST_BYTES && size.iter().all(|side| *side > 2) {
            (size, pixels) = halved(size, &pixels);
            png = png_bytes(size, &pixels, Compression::Balanced)?;
        }
        let data = format!("data:image/png;base64,{}", STANDARD.encode(&png));
        Ok(Image { data, width: size[0], height: size[1] })
    }
}

/// A picture of half as many pixels across and down, each the mean of four.
fn halved([width, height]: [u32; 2], pixels: &[u8]) -> ([u32; 2], Vec<u8>) {
    let size = [width / 2, height / 2];
    let mut out = Vec::with_capacity(3 * size[0] as usize * size[1] as usize);
    for y in 0..size[1] as usize {
        for x in 0..size[0] as usize {
            for channel in 0..3 {
                let at = |dx, dy| {
                    let pixel = (2 * y + dy) * width as usize + 2 * x + dx;
                    u32::from(pixels[3 * pixel + channel])
                };
                out.push(((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4) as u8);
            }
        }
    }
    (size, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_is_too_large_is_drawn_half_as_wide() {
        let small = Image::of([4, 2], &[7; 24]).unwrap();
        assert_eq!((small.width, small.height), (4, 2));
        assert!(small.data.starts_with("data:image/png;base64,iVBOR"));
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let pixels: Vec<u8> = (0..3 * 601 * 400).map(|_| noise()).collect();
        let large = Image::of([601, 400], &pixels).unwrap();
        assert_eq!((large.width, large.height), (300, 200));
        assert_eq!(
            halved([3, 2], &[0, 0, 0, 4, 4, 4, 9, 9, 9, 8, 8, 8, 4, 4, 4, 9, 9, 9]).1,
            [4; 3]
        );
    }
}
