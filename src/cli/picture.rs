//! `picture`: scans drawn side by side.

use std::path::PathBuf;

use clap::ValueEnum;

use super::arguments::PictureArguments;
use super::mistyped::marked;
use super::print;
use crate::budget::Bytes;
use crate::engine::{Trouble, publish_bytes};
use crate::error::{listed, shown};
use crate::host::lock;
use crate::host::process::processors;
use crate::host::{Files, Use};
use crate::io::ends::Read;
use crate::picture::{ColorBy, Picture, Settings};
use crate::report::{Grouped, Short};
use crate::stage::{Formats, Source};
use crate::{Error, Result};

/// Draws the inputs and prints what the picture shows.
pub(super) fn picture(arguments: &PictureArguments, formats: &Formats) -> Result<()> {
    let path = &arguments.output;
    if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("png")) {
        let told = "-o: a picture is a PNG file, whose name ends in .png";
        let png = path.with_extension("png");
        let note = format!("write -o {}", shown(&png));
        return Err(Error::pipeline(marked(told, &shown(path).to_string(), &note)));
    }
    let (mut sources, mut files): (Vec<Box<dyn Source>>, Vec<PathBuf>) = Default::default();
    for input in &arguments.inputs {
        let open = Read { path: vec![input.clone()], ..Read::default() }
            .source(formats)
            .map_err(renamed)?;
        files.extend(open.paths());
        sources.push(open.open().map_err(renamed)?);
    }
    let mut all = Files::default();
    files.iter().for_each(|file| all.read(file, Use::Input));
    all.write(path).map_err(|clash| Error::pipeline(format!("this {clash}")).at(path))?;
    let settings = Settings {
        view: arguments.from,
        by: arguments.by,
        width: arguments.width,
        threads: arguments.threads.unwrap_or_else(processors),
    };
    let each: Vec<&dyn Source> = sources.iter().map(|source| &**source).collect();
    for (input, source) in arguments.inputs.iter().zip(&each) {
        let told = settings.by.dimensions(source.schema()).map(drop);
        told.map_err(|error| error.at(input).help(others(&each)))?;
    }
    let picture = Picture::draw(&each, &settings)?;
    let bytes = picture.png()?;
    let trouble = Trouble::default();
    publish_bytes(path, &bytes, &trouble)?;
    lock(&trouble).iter().for_each(|told| print::warning(told));
    let nowhere = arguments.inputs.iter().zip(&picture.nowhere).filter(|(_, points)| **points > 0);
    nowhere.for_each(|(input, points)| print::warning(&nowhereness(input, *points)));
    let black = arguments.inputs.iter().zip(&picture.black).filter(|(_, black)| **black);
    black.for_each(|(input, _)| print::warning(&blackness(input, arguments.by)));
    print::result(told(&picture, arguments, bytes.len() as u64))
}

/// The error without what a pipeline file could say of the format: none draws a picture.
fn renamed(error: Error) -> Error {
    let name = error.remedy().and_then(|help| help.split_once(", or give `read.format"));
    match name.map(|(name, _)| name.to_owned()) {
        Some(name) => error.help(name),
        None => error,
    }
}

/// What all of the scans can be coloured by.
fn others(sources: &[&dyn Source]) -> String {
    let can = |by: &&ColorBy| sources.iter().all(|source| by.is_in(source.schema()));
    let word = |by: &ColorBy| by.to_possible_value().map(|value| value.get_name().to_owned());
    let can = ColorBy::value_variants().iter().filter(can).filter_map(word);
    format!("use {}", listed(can.map(|word| format!("`--by {word}`")), "or"))
}

/// What is told of a scan with points that are not on the picture.
fn nowhereness(input: &str, points: u64) -> String {
    let points = Grouped(points);
    format!("{input}: {points} points cannot be drawn: their coordinates are not finite numbers")
}

/// What is told of a scan that is black throughout.
fn blackness(input: &str, by: ColorBy) -> String {
    let what = if by == ColorBy::Intensity { "intensities" } else { "colours" };
    format!(
        "{input}: all {what} are 0, so that the scan is drawn black: use `--by height` or \
         `--by class`"
    )
}

/// The ends of a range in as many digits as tell a thousandth of it apart.
fn range([low, high]: [f64; 2]) -> String {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return format!("{} to {}", Short(low), Short(high));
    }
    let power = |v: f64| v.log10().floor();
    let largest = low.abs().max(high.abs());
    // All that f64 has are 17 digits.
    let digits = (power(largest) - power(span) + 2.0).clamp(0.0, 16.0);
    let decimals = (digits - power(largest)).max(0.0) as usize;
    if decimals > 9 && largest < 1e-4 {
        let digits = digits as usize;
        return format!("{low:.digits$e} to {high:.digits$e}");
    }
    format!("{low:.decimals$} to {high:.decimals$}")
}

/// What the picture shows, as a few lines.
fn told(picture: &Picture, arguments: &PictureArguments, bytes: u64) -> String {
    let mut told = String::new();
    let each = picture.panels.iter().zip(&picture.thinned_from);
    for (input, ((points, outside), thinned_from)) in arguments.inputs.iter().zip(each) {
        told += &format!("scan       {input}, {}", Grouped(*points));
        if let Some(all) = thinned_from {
            told += &format!(" of {}", Grouped(*all));
        }
        told += " points";
        if *outside > 0 {
            told += &format!(", {} of them outside of the picture", Grouped(*outside));
        }
        told.push('\n');
    }
    if let Some(ends) = picture.range {
        told += &format!("colours    {}\n", range(ends));
    }
    let Picture { width, height, pixel, .. } = picture;
    let (path, bytes) = (shown(&arguments.output), Bytes(bytes));
    let pixel = Short(*pixel);
    told + &format!("pixel      {pixel}\noutput     {path}, {width} × {height} pixels, {bytes}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_have_the_digits_that_tell_a_thousandth_apart() {
        for (ends, told) in [
            ([-2.921_750_068_664_551, 13.456_789], "-2.9 to 13.5"),
            ([0.0, 65_535.0], "0 to 65535"),
            ([1e-6, 3e-6], "0.00000100 to 0.00000300"),
            ([2.5, 2.5], "2.50 to 2.50"),
            ([0.0, 2e-12], "0.00e0 to 2.00e-12"),
            ([1e-15, 2e-15], "1.00e-15 to 2.00e-15"),
            ([5.0, 5.000_000_000_002], "5.00000000000000 to 5.00000000000200"),
        ] {
            assert_eq!(range(ends), told);
        }
    }
}
