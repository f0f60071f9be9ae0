//! Target `ply`: header, other elements and vertices of a PLY file.

use std::path::Path;

use pointmill::ErrorKind::{self, Data, Pipeline};
use pointmill::internals::ply::{PlyOptions, create, describe};
use pointmill::io::ply::open;
use pointmill::stage::Source;

use super::judge::{self, Judgement, Outcome, magnitude, shape};
use super::{Target, mutate};
use crate::support::random::Random;

/// The target.
pub const TARGET: Target =
    Target { name: "ply", judge: target, seeds: |_| seeds(), mutate: change, at_home: false };

/// How a file that is no good is refused.
const REFUSED: &[ErrorKind] = &[Data];

fn target(path: &Path, data: &[u8]) -> Judgement {
    if let Err(error) = describe(path) {
        judge::proper("describe", &error, REFUSED)?;
    }
    let source = match open(&[path.to_owned()]) {
        Ok(source) => source,
        Err(error) => return judge::refused("open", &error, REFUSED),
    };
    let schema = source.schema().clone();
    let mut marks: Vec<String> =
        source.warnings().iter().map(|w| format!("warning: {}", shape(w))).collect();
    let dimensions = magnitude(schema.dimensions.len() as u64);
    marks.push(format!("schema: {:?}, 2^{dimensions} dimensions", schema.endian));
    marks.push(format!(
        "size: 2^{} points, {} comments, crs {}",
        magnitude(source.points()),
        magnitude(source.metadata().comments.len() as u64),
        source.metadata().crs.is_some(),
    ));
    // The shared dimensions begin with a capital letter; all other names are the file's own.
    let known = schema.dimensions.iter().map(|d| &d.name);
    let known = known.filter(|name| name.len() < 24 && name.starts_with(char::is_uppercase));
    let known = known.map(|name| shape(name));
    marks.extend(known.map(|name| format!("dimension: {name}")).take(40));
    twice_the_file(path, &*source)?;
    let Some(read) = judge::read_twice(&*source, REFUSED)? else {
        marks.push("a part holds too much".to_owned());
        return Ok(Outcome { accepted: true, marks });
    };
    if let Some(error) = &read.error {
        marks.push(format!("points: {}", shape(error)));
    }
    if read.all && read.error.is_none() {
        marks.extend(written(path, &*source, &read, data.len().is_multiple_of(2))?);
    }
    Ok(Outcome { accepted: read.error.is_none(), marks })
}

/// A file agrees with itself, or says why not.
fn twice_the_file(path: &Path, once: &dyn Source) -> Result<(), String> {
    match open(&[path.to_owned(), path.to_owned()]) {
        Ok(both) if both.points() == once.points().saturating_mul(2) => Ok(()),
        Ok(both) => Err(format!("{} points twice are {}", once.points(), both.points())),
        Err(error) => judge::proper("merge", &error, REFUSED).map(drop),
    }
}

/// What was read can be written, and is the same when read again.
fn written(
    path: &Path,
    source: &dyn Source,
    read: &judge::Read,
    carry_rest: bool,
) -> Result<Option<String>, String> {
    let copy = path.with_extension("ply");
    if let Err(error) = copy_of(&copy, source, carry_rest) {
        let text = judge::proper("write", &error, &[Data, Pipeline])?;
        return Ok(Some(format!("write: {}", shape(&text))));
    }
    let again = open(&[copy]).map_err(|e| format!("our own output does not open: {e:?}"))?;
    if again.schema() != source.schema() {
        return Err(format!("{:?} became {:?}", source.schema(), again.schema()));
    }
    match judge::read_twice(&*again, REFUSED)? {
        Some(same) if same == *read => Ok(None),
        Some(other) => Err(format!("written and read again: {read:?} became {other:?}")),
        None => Ok(None),
    }
}

fn copy_of(copy: &Path, source: &dyn Source, carry_rest: bool) -> pointmill::Result<()> {
    let schema = source.schema();
    let options = PlyOptions { carry_rest, ..PlyOptions::default() };
    let sink = create(copy, &options, schema, source.metadata())?;
    judge::pour(source, sink)
}

const WORDS: &[&[u8]] = &[
    b"ply",
    b"format",
    b"ascii",
    b"binary_little_endian",
    b"binary_big_endian",
    b"1.0",
    b"comment",
    b"obj_info",
    b"element",
    b"vertex",
    b"face",
    b"property",
    b"list",
    b"end_header",
    b"char",
    b"uchar",
    b"short",
    b"ushort",
    b"int",
    b"uint",
    b"int64",
    b"uint64",
    b"float",
    b"double",
    b"int8",
    b"float64",
    b"x",
    b"y",
    b"z",
    b"nx",
    b"red",
    b"r",
    b"intensity",
    b"gps_time",
    b"classification",
    b"dimension",
    b"dimension x: NormalX",
    b"comment crs: EPSG:4326",
    b"comment crs+ more",
    b"comment made by pointmill                   ",
    b"nan",
    b"-inf",
    b"1e400",
    b"-0",
    b"\r",
    b"\r\n",
    b"\t ",
    b"\xff\xfe",
    "\u{2028}é".as_bytes(),
];

fn change(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    let end = data.windows(10).position(|w| w == b"end_header").map_or(data.len(), |at| at + 11);
    let whole = if random.one_in(4) { data.len() } else { end };
    match random.below(4) {
        0..3 => mutate::lines(random, data, whole, other, WORDS),
        _ => mutate::bytes(random, data, other, WORDS),
    }
}

const TYPES: [(&str, usize); 10] = [
    ("char", 1),
    ("uchar", 1),
    ("short", 2),
    ("ushort", 2),
    ("int", 4),
    ("uint", 4),
    ("int64", 8),
    ("uint64", 8),
    ("float", 4),
    ("double", 8),
];

/// A header: vertices with coordinates of type `kind`, and `more` lines at the end.
fn header(encoding: &str, points: usize, kind: &str, before: &str, more: &str) -> String {
    format!(
        "ply\nformat {encoding} 1.0\ncomment made up\ncomment crs: EPSG:2154\nobj_info seed\n\
         {before}element vertex {points}\nproperty {kind} x\nproperty {kind} y\n\
         property {kind} z\n{more}end_header\n"
    )
}

fn seeds() -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    let faces = "element face 2\nproperty list uchar int vertex_indices\n";
    let bodies: [&[u8]; 2] = [&[1, 0, 0, 0, 7, 1, 0, 0, 0, 8], &[1, 0, 0, 0, 7, 1, 0, 0, 0, 8]];
    for (kind, size) in TYPES {
        for encoding in ["binary_little_endian", "binary_big_endian"] {
            let body: Vec<u8> = (0..4 * 3 * size).map(|i| (i * 7) as u8).collect();
            let plain = header(encoding, 4, kind, "", "");
            all.push([plain.as_bytes(), &body].concat());
            let behind = header(encoding, 4, kind, "", faces);
            all.push([behind.as_bytes(), &body, bodies[0]].concat());
            let before = header(encoding, 4, kind, faces, "");
            all.push([before.as_bytes(), bodies[1], &body].concat());
        }
        let lines = "1 2 3\n4 5 6\n7 8 9\n1e1 0 12\n";
        all.push((header("ascii", 4, kind, "", "") + lines).into_bytes());
    }
    let fields = "property uchar red\nproperty ushort intensity\nproperty double gps_time\n\
                  property float nx\ncomment dimension odd: Echo Width\nproperty uint odd\n";
    let rows = "1.5 -2 nan 255 65535 1e300 0.5 7\n\n3 4 inf 0 0 -1.25e-7 1 8\n";
    let body = [3u8; 62];
    all.push((header("ascii", 2, "double", "", fields) + rows).into_bytes());
    all.push((header("ascii", 2, "double", faces, fields) + "1 2\n0\n" + rows).into_bytes());
    let binary = header("binary_little_endian", 2, "float", "", fields);
    all.push([binary.as_bytes(), &body].concat());
    all.push(header("ascii", 0, "float", "", "").into_bytes());
    all.push(String::from_utf8_lossy(&all[3]).replace('\n', "\r").into_bytes());
    all.push(String::from_utf8_lossy(&all[3]).replace('\n', "\r\n").into_bytes());
    all
}
