//! `picture`: scans drawn side by side.

use std::path::PathBuf;

use super::arguments::{self, From};
use super::mistyped::marked;
use super::print;
use crate::budget::Bytes;
use crate::error::shown;
use crate::picture::{By, Picture, Settings, View};
use crate::pipeline::{Files, Read, Trouble, Use, publish_bytes};
use crate::report::Grouped;
use crate::stage::Source;
use crate::tile::lock;
use crate::{Error, Result};

/// Draws the inputs and prints what the picture shows.
pub(super) fn picture(arguments: &arguments::Picture) -> Result<()> {
    let path = &arguments.output;
    if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("png")) {
        let told = "-o: a picture is a PNG file, whose name ends in .png";
        let png = path.with_extension("png");
        let note = format!("write -o {}", shown(&png));
        return Err(Error::pipeline(marked(told, &shown(path).to_string(), &note)));
    }
    let (mut sources, mut files): (Vec<Box<dyn Source>>, Vec<PathBuf>) = Default::default();
    for input in &arguments.inputs {
        let open = Read { path: vec![input.clone()], format: None }.source()?;
        files.extend(open.paths());
        sources.push(open.open()?);
    }
    let mut all = Files::default();
    files.iter().for_each(|file| all.read(file, Use::Input));
    all.write(path).map_err(|clash| Error::pipeline(format!("this {clash}")).at(path))?;
    let settings = settings(arguments);
    let each: Vec<&dyn Source> = sources.iter().map(|source| &**source).collect();
    let picture = Picture::draw(&each, &settings)?;
    let bytes = picture.png()?;
    let trouble = Trouble::default();
    publish_bytes(path, &bytes, &trouble)?;
    lock(&trouble).iter().for_each(|told| print::warning(told));
    print::result(told(&picture, arguments, bytes.len() as u64))
}

fn settings(arguments: &arguments::Picture) -> Settings {
    let processors = || std::thread::available_parallelism().map_or(1, usize::from);
    Settings {
        view: match arguments.from {
            From::Above => View::Above,
            From::South => View::South,
            From::North => View::North,
            From::East => View::East,
            From::West => View::West,
        },
        by: match arguments.by {
            arguments::By::Height => By::Height,
            arguments::By::Class => By::Class,
            arguments::By::Color => By::Color,
            arguments::By::Intensity => By::Intensity,
        },
        width: arguments.width,
        threads: arguments.threads.unwrap_or_else(processors),
    }
}

/// What the picture shows, as a few lines.
fn told(picture: &Picture, arguments: &arguments::Picture, bytes: u64) -> String {
    let mut told = String::new();
    for (input, (points, outside)) in arguments.inputs.iter().zip(&picture.panels) {
        told += &format!("scan       {input}, {} points", Grouped(*points));
        if *outside > 0 {
            told += &format!(", {} of them outside of the picture", Grouped(*outside));
        }
        told.push('\n');
    }
    if let Some([low, high]) = picture.range {
        told += &format!("colours    {low} to {high}\n");
    }
    let Picture { width, height, pixel, .. } = picture;
    let (path, bytes) = (shown(&arguments.output), Bytes(bytes));
    told + &format!(
        "pixel      {pixel:.4}\noutput     {path}, {width} × {height} pixels, {bytes}\n"
    )
}
