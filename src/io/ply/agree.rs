//! What the vertices of several PLY files have in common, and the one form that they are brought to
//! where encodings, the order of properties or their types differ.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::ascii::AsciiPart;
use super::file::PlyFile;
use super::header::PropertyKind;
use super::names::{self, RECORDS};
use crate::error::shown;
use crate::io::rows::Encoding;
use crate::io::rows::comments::{self, Said};
use crate::io::rows::schema::placed;
use crate::io::united::{together, unlike};
use crate::point::names::{GPS_TIME, XYZ};
use crate::point::{Endian, GpsTime, Scalar, Schema};
use crate::{Error, Result};

/// What the comments of a file say to us, and the others.
pub(super) struct Texts {
    pub crs: Option<String>,
    pub gps_time: Option<GpsTime>,
    pub dimensions: Vec<String>,
    pub comments: Vec<String>,
}

impl Texts {
    pub fn of(file: &PlyFile) -> Texts {
        let properties: Vec<&str> = file.properties().iter().map(|p| p.name.as_str()).collect();
        let header = &file.header;
        let dimensions = names::dimensions(&properties, &header.comments);
        let properties: BTreeSet<&str> = properties.into_iter().collect();
        // How this file was made is not how others are made of it.
        let Said { crs, gps_time, note: _, others } = Said::of(header.comments.clone());
        let is_ours = |comment: &String| {
            names::property_told(comment).is_some_and(|p| properties.contains(p))
                || comments::is_made(comment, file.points)
        };
        let comments = others.into_iter().filter(|comment| !is_ours(comment)).collect();
        Texts { crs, gps_time, dimensions, comments }
    }

    /// True if vertices have GPS times.
    pub fn has_times(&self) -> bool {
        self.dimensions.iter().any(|name| name == GPS_TIME)
    }
}

/// What records are: those of all files, and those of each.
pub(super) struct Agreed {
    pub schema: Arc<Schema>,
    pub own: Vec<Arc<Schema>>,
}

/// Finds what holds the vertices of all files; refuses those that have other properties, unless
/// what some lack `is_nothing`, or numbers that no type holds together.
pub(super) fn agreed(files: &[PlyFile], texts: &[Texts], is_nothing: bool) -> Result<Agreed> {
    agree(files, texts, is_nothing)?;
    let wide = needs_double(files, texts)?;
    let of = |(file, text): (&PlyFile, &Texts)| Arc::new(schema(file, &text.dimensions, wide));
    let own: Vec<Arc<Schema>> = files.iter().zip(texts).map(of).collect();
    if own.iter().all(|schema| *schema == own[0]) {
        return Ok(Agreed { schema: own[0].clone(), own });
    }
    let names = |schema: &Schema| -> BTreeSet<String> {
        schema.dimensions.iter().map(|dimension| dimension.name.clone()).collect()
    };
    let odd = own.iter().position(|schema| names(schema) != names(&own[0]));
    if let Some(odd) = odd.filter(|_| !is_nothing) {
        return Err(disagree(&files[0], &files[odd], "vertex properties are"));
    }
    let fields = together(&own).map_err(|(n, name)| {
        let told = format!("no type holds all numbers of `{name}`: its type is");
        disagree(&files[0], &files[n], &told)
    })?;
    let (dimensions, stride) = placed(fields);
    let schema = Schema { layout: RECORDS, endian: Endian::Little, stride, dimensions };
    Ok(Agreed { schema: Arc::new(schema), own })
}

/// Refuses files whose vertices have other properties than the first, unless what some lack
/// `is_nothing`; and those that mean something else by them than one before.
fn agree(files: &[PlyFile], texts: &[Texts], is_nothing: bool) -> Result<()> {
    let mut known: BTreeMap<&str, (&str, &PlyFile)> = BTreeMap::new();
    let mut timed: Option<(&PlyFile, &Texts)> = None;
    for (n, (file, text)) in files.iter().zip(texts).enumerate() {
        let properties = || file.properties().iter().map(|property| &property.name);
        let all = || properties().map(String::as_str);
        let of_first = || files[0].properties().iter().map(|property| &property.name);
        if !is_nothing && n > 0 && all().collect::<BTreeSet<_>>() != known.keys().copied().collect()
        {
            let paths = [&*file.path, &files[0].path];
            return Err(unlike(paths, "vertex properties", properties(), of_first()));
        }
        // A file without times says nothing of theirs.
        if text.has_times() || !is_nothing {
            let (first, of_first) = timed.get_or_insert((file, text));
            if of_first.gps_time != text.gps_time {
                return Err(disagree(first, file, "GPS time type is"));
            }
        }
        for (property, name) in all().zip(&text.dimensions) {
            let (dimension, first) = known.entry(property).or_insert((name, file));
            if dimension != name {
                return Err(disagree(first, file, "dimension names are"));
            }
        }
    }
    Ok(())
}

fn disagree(first: &PlyFile, other: &PlyFile, what: &str) -> Error {
    let told = format!("{what} not the same as in {}", shown(&first.path));
    let told = if what.contains(':') { told } else { format!("its {told}") };
    Error::data(&other.path, told).help(
        "files that are read together agree in vertex properties and coordinate reference system; \
         convert one of them first",
    )
}

/// True for dimensions that many programs print with all digits into texts whose headers call them
/// `float`, which has room for seven.
fn is_long(dimension: &str) -> bool {
    XYZ.contains(&dimension) || dimension == GPS_TIME
}

/// True if coordinates and times of these texts are to be held as `double`, so that none loses a
/// digit: where one has more than a `float` holds, or where another file calls them `double`.
fn needs_double<'a>(files: &[PlyFile], texts: &'a [Texts]) -> Result<bool> {
    let long = |(file, texts): (&PlyFile, &Texts), scalar: Scalar| -> Vec<usize> {
        let is_it = |n: &usize| {
            is_long(&texts.dimensions[*n])
                && file.properties()[*n].kind == PropertyKind::Scalar(scalar)
        };
        (0..texts.dimensions.len()).filter(is_it).collect()
    };
    let all = || files.iter().zip(texts);
    let ascii = || all().filter(|(file, _)| file.header.encoding == Encoding::Ascii);
    let names = |one: (&PlyFile, &'a Texts), scalar| -> Vec<&'a String> {
        long(one, scalar).into_iter().map(|n| &one.1.dimensions[n]).collect()
    };
    let floats: BTreeSet<&String> = ascii().flat_map(|one| names(one, Scalar::F32)).collect();
    let doubles = all().flat_map(|one| names(one, Scalar::F64));
    if doubles.into_iter().any(|name| floats.contains(name)) {
        return Ok(true);
    }
    for (file, texts) in ascii() {
        let floats = long((file, texts), Scalar::F32);
        if floats.is_empty() {
            continue;
        }
        let narrow = schema(file, &texts.dimensions, false);
        let part = AsciiPart::new(file.origin.reopen()?, file, &narrow, 0);
        if part.outgrows_float(&floats)? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Coordinates and times that a file calls `float` are `double` if they are to be `wide`.
fn schema(file: &PlyFile, dimensions: &[String], wide: bool) -> Schema {
    let fields = file.properties().iter().zip(dimensions).filter_map(|(property, name)| {
        let PropertyKind::Scalar(scalar) = property.kind else { return None };
        let wide = wide && file.header.encoding == Encoding::Ascii;
        let widens = wide && scalar == Scalar::F32 && is_long(name);
        Some((name.clone(), if widens { Scalar::F64 } else { scalar }))
    });
    let (dimensions, stride) = placed(fields);
    Schema { layout: RECORDS, endian: file.header.encoding.endian(), stride, dimensions }
}
