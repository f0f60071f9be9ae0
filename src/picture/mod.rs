//! Pictures of scans: the points as a viewer sees them from above or from a side, as PNG. Knows no
//! paths; a scan is whatever a [`Source`] yields.
//!
//! A scan is decoded twice: once for its extent and the range of what it is coloured by, since
//! headers may be wrong about the first and silent about the second; once to draw. Of COPC only the
//! levels are read that have a point for every pixel, and some of these for the first look. A pixel
//! is one number, the nearness of its point above the point's colour, so that threads draw into one
//! image by taking the larger number, and neither their number nor the order of points changes a
//! pixel.

mod coarse;
mod color;
mod look;
mod paint;
mod settings;
mod several;

use crate::stage::Source;
use crate::{Error, Result};

use coarse::Drawn;
pub(crate) use color::mixed;
use look::{Frame, Look};
use paint::Canvas;
use settings::NARROWEST;
pub use settings::{ColorBy, Settings, View, WIDEST};
pub(crate) use several::{DrawnPlace, draw_several};

/// Panels that are drawn side by side, at most.
pub const MOST_PANELS: usize = 4;
/// Bytes of pixels from which on a picture is compressed for speed.
const LARGE: usize = 3 << 20;
/// Pixels between panels.
const GAP: u32 = 8;

/// Scans drawn side by side, in one frame and with one range of colours.
#[derive(Debug)]
#[non_exhaustive]
pub struct Picture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Red, green and blue of each pixel, row by row from the top.
    pub pixels: Vec<u8>,
    /// Side of a pixel in the scan's unit.
    pub pixel: f64,
    /// What the first and the last colour stand for, where colours are a range of figures.
    pub range: Option<[f64; 2]>,
    /// For each panel its points, and how many of them lie outside of the frame.
    pub panels: Vec<(u64, u64)>,
    /// For each panel how many points the scan has, if only coarse levels of it were read, as they
    /// do for the pixels.
    pub thinned_from: Vec<Option<u64>>,
    /// For each panel the points that are drawn nowhere, since a coordinate of theirs is not
    /// finite.
    pub nowhere: Vec<u64>,
    /// For each panel if it is black, since all colours or intensities of its scan are 0.
    pub black: Vec<bool>,
}

impl Picture {
    /// Draws `sources`, a panel each.
    ///
    /// # Errors
    ///
    /// Those of the sources; a scan that does not have what it is to be coloured by; no point at
    /// all; more than [`MOST_PANELS`] scans or a width out of bounds.
    pub fn draw(sources: &[&dyn Source], settings: &Settings) -> Result<Picture> {
        let panels = sources.len() as u32;
        if sources.is_empty() || sources.len() > MOST_PANELS {
            let told = format!("{} scans side by side: a picture shows 1 to {MOST_PANELS}", panels);
            return Err(Error::pipeline(told));
        }
        if !(NARROWEST..=WIDEST).contains(&settings.width) {
            let told = format!(
                "a picture of {} pixels: it can be {NARROWEST} to {WIDEST} wide",
                settings.width
            );
            return Err(Error::pipeline(told));
        }
        let most = [(settings.width - GAP * (panels - 1)) / panels, settings.width];
        let looks = sources.iter().map(|source| Drawn::at_first(*source, most).look(settings));
        let looks = looks.collect::<Result<Vec<Look>>>()?;
        let frame = Frame::of(&looks, most)?;
        let range = settings.by.range(&looks);
        let largest = looks.iter().map(|look| look.points).max().unwrap_or(0);
        let common = frame.dot(largest);
        let mut picture = Picture::blank(&frame, &looks, settings.by);
        for (n, source) in sources.iter().enumerate() {
            let drawn = Drawn::within(*source, &frame, settings.view);
            let canvas = Canvas::new(frame.size, drawn.dot(common));
            picture.panels.push(canvas.draw(drawn.source(), settings, &frame, range)?);
            picture.thinned_from.push(drawn.is_coarser().then(|| source.points()));
            picture.place(&canvas, n as u32 * (frame.size[0] + GAP));
        }
        Ok(picture)
    }

    /// A picture with room for a panel for each of the `looks`.
    fn blank(frame: &Frame, looks: &[Look], by: ColorBy) -> Picture {
        let panels = looks.len() as u32;
        let width = frame.size[0] * panels + GAP * (panels - 1);
        let height = frame.size[1];
        Picture {
            width,
            height,
            pixels: vec![255; 3 * width as usize * height as usize],
            pixel: frame.pixel,
            range: by.is_range().then(|| by.range(looks)),
            panels: Vec::new(),
            thinned_from: Vec::new(),
            nowhere: looks.iter().map(|look| look.nowhere).collect(),
            black: looks.iter().map(|look| by.is_black(look)).collect(),
        }
    }

    /// Copies a panel to the columns from `left` on.
    fn place(&mut self, canvas: &Canvas, left: u32) {
        let [wide, high] = canvas.size();
        for y in 0..high {
            for x in 0..wide {
                let at = 3 * (y as usize * self.width as usize + (left + x) as usize);
                self.pixels[at..at + 3].copy_from_slice(&canvas.shaded(x, y));
            }
        }
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    ///
    /// Those of the encoder, which has none for a picture that was drawn.
    pub fn png(&self) -> Result<Vec<u8>> {
        // Of a large picture of COPC a smaller file would take half of the time.
        let compression = match self.pixels.len() {
            0..LARGE => png::Compression::Balanced,
            _ => png::Compression::Fast,
        };
        png_bytes([self.width, self.height], &self.pixels, compression)
    }
}

/// A PNG file of so many pixels across and down: red, green and blue of each, row by row from the
/// top.
///
/// # Errors
///
/// Those of the encoder: pixels that are not as many.
pub(crate) fn png_bytes(
    [width, height]: [u32; 2],
    pixels: &[u8],
    compression: png::Compression,
) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(compression);
    let wrong = |cause| Error::internal("the picture cannot be encoded").because(cause);
    let mut writer = encoder.write_header().map_err(wrong)?;
    writer.write_image_data(pixels).map_err(wrong)?;
    writer.finish().map_err(wrong)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests;
