use super::*;
use crate::point::{Metadata, PointBatch, Schema};
use crate::stage::{OpenSource, Part};
use crate::synth::{Scene, Synthetic};
use std::sync::Arc;

fn settings(view: View, by: ColorBy, threads: usize) -> Settings {
    Settings { view, by, width: 128, threads }
}

fn landscape(points: u64) -> Box<dyn Source> {
    Synthetic { scene: Scene::Als, points, seed: 3, noise: None, ..Synthetic::default() }
        .open()
        .unwrap()
}

/// Records in parts of its own choice.
struct Few {
    schema: Arc<Schema>,
    metadata: Metadata,
    parts: Vec<Vec<u8>>,
}

struct Once<'a>(Option<&'a [u8]>);

impl Part for Once<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        if let Some(records) = self.0.take() {
            batch.extend(records);
        }
        Ok(())
    }
}

impl Source for Few {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }
    fn metadata(&self) -> &Metadata {
        &self.metadata
    }
    fn points(&self) -> u64 {
        self.parts.iter().map(|part| (part.len() / self.schema.stride) as u64).sum()
    }
    fn part_bytes(&self) -> u64 {
        0
    }
    fn parts(&self) -> usize {
        self.parts.len()
    }
    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        Ok(Box::new(Once(Some(&self.parts[index]))))
    }
}

/// Points of a class each, all intensities 7.
fn points(places: &[([f64; 3], u8)]) -> Few {
    use crate::point::{Dimension, Endian, Layout, Scalar, names};
    let axes = names::XYZ.iter().zip([0, 8, 16]);
    let mut dimensions: Vec<Dimension> =
        axes.map(|(name, at)| Dimension::new(*name, Scalar::F64, at)).collect();
    dimensions.push(Dimension::new(names::CLASSIFICATION, Scalar::U8, 24));
    let schema =
        Schema { layout: Layout::plain("made"), endian: Endian::Little, stride: 25, dimensions };
    let record = |(place, class): &([f64; 3], u8)| {
        let mut record: Vec<u8> = place.iter().flat_map(|v| v.to_le_bytes()).collect();
        record.push(*class);
        record
    };
    Few {
        schema: Arc::new(schema),
        metadata: Metadata::default(),
        parts: places.iter().map(record).collect(),
    }
}

/// The colour of a pixel without its shade: the same up to a factor.
fn hue(picture: &Picture, x: u32, y: u32) -> [u8; 3] {
    let at = 3 * (y * picture.width + x) as usize;
    picture.pixels[at..at + 3].try_into().unwrap()
}

#[test]
fn the_nearest_point_of_a_pixel_is_seen_from_every_side() {
    // A corner each so that all views have one frame, and two points behind each other in the
    // middle.
    let corners = [[0.0; 3], [100.0; 3]].map(|at| (at, 0));
    let middle = [([50.0, 50.0, 60.0], 6), ([50.0, 50.0, 40.0], 2), ([50.0, 40.0, 50.0], 5)];
    let few = points(&[&corners[..], &middle[..]].concat());
    let seen = |view| {
        let picture = Picture::draw(&[&few], &settings(view, ColorBy::Class, 1)).unwrap();
        assert_eq!((picture.width, picture.height), (128, 128));
        hue(&picture, 63, 63)
    };
    // From above the roof hides the ground; from the south what is nearer hides nothing above it.
    assert_eq!(seen(View::Above), ColorBy::Class.color(&[6.0], [0.0, 255.0]));
    assert_eq!(seen(View::South), ColorBy::Class.color(&[5.0], [0.0, 255.0]));
}

#[test]
fn threads_and_parts_change_no_pixel() {
    let scan = landscape(30_000);
    let draw = |threads| {
        Picture::draw(&[&*scan], &settings(View::West, ColorBy::Intensity, threads)).unwrap()
    };
    let (one, three) = (draw(1), draw(3));
    assert_eq!(one.pixels, three.pixels);
    assert_eq!((&one.panels, one.range), (&three.panels, three.range));
    let drawn = one.pixels.chunks_exact(3).filter(|pixel| **pixel != [255; 3]).count();
    assert!(drawn > 1000, "{drawn} pixels are drawn");
}

#[test]
fn panels_share_a_frame_and_a_range() {
    let (scan, part) = (landscape(20_000), landscape(2_000));
    let both =
        Picture::draw(&[&*scan, &*part], &settings(View::Above, ColorBy::Height, 2)).unwrap();
    assert_eq!(both.panels, [(20_000, 0), (2_000, 0)]);
    assert!(both.width <= 128 && both.pixels.len() == 3 * (both.width * both.height) as usize);
    let [low, high] = both.range.unwrap();
    assert!(low < high);
    let decoder = png::Decoder::new(std::io::Cursor::new(both.png().unwrap()));
    let info = decoder.read_info().unwrap();
    assert_eq!((info.info().width, info.info().height), (both.width, both.height));
}

#[test]
fn a_far_point_does_not_shrink_the_rest() {
    let mut places: Vec<_> =
        (0..1000).map(|i| ([f64::from(i % 40), f64::from(i / 40), 0.0], 2)).collect();
    places.push(([1e9, 0.0, 0.0], 2));
    let picture =
        Picture::draw(&[&points(&places)], &settings(View::Above, ColorBy::Height, 1)).unwrap();
    assert_eq!(picture.panels, [(1001, 1)]);
    assert!(picture.pixel < 1.0, "{}", picture.pixel);
}

#[test]
fn one_point_copies_and_points_that_are_nowhere_are_drawn() {
    for places in [
        vec![([5.0, 6.0, 7.0], 2)],
        vec![([5.0, 6.0, 7.0], 2); 50],
        vec![([5.0, 6.0, 7.0], 2), ([f64::NAN, 0.0, 0.0], 2), ([f64::INFINITY, 0.0, 0.0], 2)],
    ] {
        let few = points(&places);
        let picture = Picture::draw(&[&few], &settings(View::East, ColorBy::Height, 2)).unwrap();
        assert!(picture.pixels.chunks_exact(3).any(|pixel| *pixel != [255; 3]), "{places:?}");
        let nowhere = places.iter().filter(|(at, _)| !at.iter().all(|v| v.is_finite())).count();
        assert_eq!(picture.nowhere, [nowhere as u64]);
    }
}

#[test]
fn what_has_no_width_is_in_the_middle_of_a_picture_that_can_be_seen() {
    let line = |at: fn(f64) -> [f64; 3]| -> Vec<([f64; 3], u8)> {
        (0..=1000).map(|i| (at(f64::from(i)), 2)).collect()
    };
    for (places, size) in [
        (line(|v| [v, 7.0, 0.0]), [128, 64]),
        (line(|v| [7.0, v, 0.0]), [64, 128]),
        (vec![([5.0, 6.0, 7.0], 2)], [64, 64]),
    ] {
        let picture =
            Picture::draw(&[&points(&places)], &settings(View::Above, ColorBy::Height, 1)).unwrap();
        assert_eq!([picture.width, picture.height], size);
        assert_eq!(picture.panels, [(places.len() as u64, 0)]);
        let drawn = |x: u32, y: u32| hue(&picture, x, y) != [255; 3];
        let (x, y) = (size[0] / 2 - 1, size[1] / 2 - 1);
        assert!(drawn(x, y), "{size:?}");
        let edges = [drawn(0, 0), drawn(size[0] - 1, 0), drawn(0, size[1] - 1)];
        assert_eq!(edges, [false; 3], "{size:?}");
    }
}

#[test]
fn a_scan_whose_colours_are_all_0_is_known_to_be_black() {
    let scene = |scene| {
        Synthetic { scene, points: 2000, seed: 3, noise: None, ..Synthetic::default() }
            .open()
            .unwrap()
    };
    let black = |by, scan: &dyn Source| {
        Picture::draw(&[scan], &settings(View::Above, by, 1)).unwrap().black
    };
    assert_eq!(black(ColorBy::Intensity, &*scene(Scene::Als)), [false]);
    assert_eq!(black(ColorBy::Height, &*scene(Scene::Plane)), [false]);
    assert_eq!(black(ColorBy::Class, &points(&[([1.0; 3], 0)])), [false], "class 0 is grey");
}

#[test]
fn what_cannot_be_drawn_is_told() {
    let few = points(&[([0.0; 3], 2)]);
    let told = |sources: &[&dyn Source], by, width| {
        let settings = Settings { view: View::Above, by, width, threads: 1 };
        Picture::draw(sources, &settings).unwrap_err().to_string()
    };
    assert!(told(&[&few], ColorBy::Color, 128).contains("the scan has no colours"));
    assert!(told(&[&few], ColorBy::Intensity, 128).contains("the scan has no intensities"));
    assert!(
        told(&[&few, &few, &few, &few, &few], ColorBy::Height, 128)
            .contains("5 scans side by side")
    );
    assert!(told(&[&few], ColorBy::Height, 63).contains("a picture of 63 pixels"));
    let nowhere = points(&[([f64::NAN; 3], 2)]);
    assert!(told(&[&nowhere], ColorBy::Height, 128).contains("no point to draw: 1 have"));
}
