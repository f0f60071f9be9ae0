//! Targets of formats besides LAS and PLY: files of any bytes are described, opened, read twice and
//! written as a text and as PCD, or refused.

use std::path::Path;

use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
use pointmill::ErrorKind::{self, Data, Io, Pipeline};
use pointmill::Registry;
use pointmill::stage::{Format, FormatName, ReadKeys, Source, WriteKeys};

use super::judge::{self, Judgement, Outcome, magnitude, shape};
use super::{Target, mutate};
use crate::support::random::Random;

/// How a file that is no good is refused.
const REFUSED: &[ErrorKind] = &[Data, Pipeline];

const fn target(
    name: &'static str,
    judge: fn(&Path, &[u8]) -> Judgement,
    seeds: fn(&Path) -> Vec<Vec<u8>>,
    mutate: fn(&mut Random, &mut Vec<u8>, &[u8]),
) -> Target {
    Target { name, judge, seeds, mutate, at_home: false }
}

pub const XYZ: Target = target("xyz", |path, data| judge("xyz", path, data), xyz_seeds, lines);
pub const PTX: Target = target("ptx", |path, data| judge("ptx", path, data), ptx_seeds, lines);
pub const PCD: Target = target("pcd", |path, data| judge("pcd", path, data), pcd_seeds, headed);
pub const OBJ: Target = target("obj", |path, data| judge("obj", path, data), obj_seeds, lines);
pub const OFF: Target = target("off", |path, data| judge("off", path, data), off_seeds, lines);
pub const STL: Target = target("stl", |path, data| judge("stl", path, data), stl_seeds, headed);
pub const E57: Target = target("e57", |path, data| judge("e57", path, data), e57_seeds, paged);

fn judge(name: &str, path: &Path, data: &[u8]) -> Judgement {
    let registry = Registry::builtin();
    let named = |name: &str| registry.formats().named(&FormatName(name.to_owned())).unwrap();
    let format = named(name);
    let _ = format.sniff(&data[..data.len().min(512)]);
    if let Err(error) = format.describe(path) {
        judge::proper("describe", &error, REFUSED)?;
    }
    let source = match format.open(&[path.to_owned()], &ReadKeys::default()) {
        Ok(source) => source,
        Err(error) => {
            let mut outcome = judge::refused("open", &error, REFUSED)?;
            outcome.marks.extend(cause(&error));
            return Ok(outcome);
        }
    };
    let mut marks: Vec<String> =
        source.warnings().iter().map(|w| format!("warning: {}", shape(w))).collect();
    let dimensions = &source.schema().dimensions;
    marks.push(format!(
        "size: 2^{} points, {} dimensions",
        magnitude(source.points()),
        dimensions.len()
    ));
    let kinds: Vec<String> = dimensions.iter().map(|d| format!("{:?}", d.scalar)).collect();
    marks.push(format!("types: {}", kinds.join(" ")));
    let Some(read) = judge::read_twice(&*source, REFUSED)? else {
        marks.push("a part holds too much".to_owned());
        return Ok(Outcome { accepted: true, marks });
    };
    if let Some(error) = &read.error {
        marks.push(format!("points: {}", shape(error)));
    }
    if read.all && read.error.is_none() {
        for to in ["csv", "pcd"] {
            let copy = path.with_extension(to);
            if let Err(error) = copied(&copy, &**named(to), &*source) {
                let text = judge::proper("write", &error, &[Data, Pipeline, Io])?;
                marks.push(format!("write: {}", shape(&text)));
                continue;
            }
            let again = named(to).open(&[copy], &ReadKeys::default());
            let again = again.map_err(|e| format!("our own {to} does not open: {e:?}"))?;
            let Some(back) = judge::read_twice(&*again, REFUSED)? else { continue };
            if back.error.is_some() || back.records != read.records {
                return Err(format!("our own {to} has {back:?} of {read:?}"));
            }
        }
    }
    Ok(Outcome { accepted: read.error.is_none(), marks })
}

/// What a library said.
fn cause(error: &pointmill::Error) -> Option<String> {
    let first = std::error::Error::source(error)?;
    let text = std::iter::successors(Some(first), |cause| cause.source());
    Some(text.map(|cause| shape(&cause.to_string())).collect::<Vec<_>>().join(": "))
}

fn copied(copy: &Path, format: &dyn Format, source: &dyn Source) -> pointmill::Result<()> {
    let schema = source.schema();
    let sink = format.create(copy, &WriteKeys::default(), schema, source.metadata(), false)?;
    judge::pour(source, sink)
}

const WORDS: &[&[u8]] = &[
    b"X",
    b"Y",
    b"Z",
    b"_",
    b"R",
    b"Intensity",
    b"#",
    b"//",
    b",",
    b";",
    b"\t",
    b"nan",
    b"-inf",
    b"1e400",
    b"-0",
    b"0",
    b"0.0",
    b"1,5",
    b"255",
    b"256",
    b"0.5",
    b"1e-320",
    b"\r",
    b"\r\n",
    b"\xef\xbb\xbf",
    b"\xff",
    b"18446744073709551616",
    b"-9223372036854775809",
    b"v",
    b"vn",
    b"f",
    b"OFF",
    b"COFF",
    b"NOFF",
    b"STOFF",
    b"BINARY",
    b"solid",
    b"facet normal",
    b"vertex",
    b"endfacet",
    b"VERSION .7",
    b"FIELDS",
    b"SIZE",
    b"TYPE",
    b"COUNT",
    b"WIDTH",
    b"HEIGHT",
    b"POINTS",
    b"DATA",
    b"ascii",
    b"binary",
    b"binary_compressed",
    b"rgb",
    b"rgba",
    b"x y z",
    b"F F F",
    b"4 4 4",
    b"8",
    b"\"",
    b"4294967295",
];

fn lines(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    match random.below(4) {
        0..3 => mutate::lines(random, data, data.len(), other, WORDS),
        _ => mutate::bytes(random, data, other, WORDS),
    }
}

/// The first lines more often than what is behind them.
fn headed(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    let end = data.windows(5).position(|w| w == b"DATA ").map_or(data.len().min(200), |at| at + 12);
    let end = end.min(data.len());
    match random.below(3) {
        0..2 => mutate::lines(random, data, end, other, WORDS),
        _ => mutate::bytes(random, data, other, WORDS),
    }
}

/// Bytes of pages, whose checksums are made right again more often than not.
fn paged(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    match random.below(3) {
        0 => mutate::lines(random, data, data.len(), other, WORDS),
        _ => mutate::bytes(random, data, other, WORDS),
    }
    if !random.one_in(8) {
        data.resize(data.len().next_multiple_of(1024), 0);
        for page in data.chunks_exact_mut(1024) {
            let sum = crc32c(&page[..1020]).to_be_bytes();
            page[1020..].copy_from_slice(&sum);
        }
    }
}

/// The checksum of E57's pages (Castagnoli).
fn crc32c(bytes: &[u8]) -> u32 {
    let mut sum = u32::MAX;
    for &byte in bytes {
        sum ^= u32::from(byte);
        for _ in 0..8 {
            sum = sum >> 1 ^ if sum & 1 == 1 { 0x82f6_3b78 } else { 0 };
        }
    }
    !sum
}

fn texts(all: &[&str]) -> Vec<Vec<u8>> {
    all.iter().map(|text| text.as_bytes().to_vec()).collect()
}

fn xyz_seeds(_: &Path) -> Vec<Vec<u8>> {
    texts(&[
        "1 2 3\n4 5 6\n",
        "X,Y,Z,Intensity\n1,2,3,40\n-1.5,2e1,.5,300\n",
        "\u{feff}# x y z R G B\n1\t2\t3\t255\t0\t7\r\n\n// more\n0 0 0 0 0 0",
        "2\n1 2 3\n4 5 6\n",
        "a;X;Y;Z\n18446744073709551615;1;2;3\n-1;nan;0.1;1e300\n",
    ])
}

fn ptx_seeds(_: &Path) -> Vec<Vec<u8>> {
    let head = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n10 20 30 1\n";
    let one = format!("2\n1\n{head}1 2 3 0.5\n0 0 0 0.5\n");
    vec![one.repeat(2).into_bytes(), format!("1\n1\n{head}1 2 3 1 255 0 7\n").into_bytes()]
}

fn pcd_seeds(_: &Path) -> Vec<Vec<u8>> {
    let head = |height: usize, data: &str| {
        format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb _ n\nSIZE 4 4 4 4 1 2\nTYPE F F F F U I\n\
             COUNT 1 1 1 1 2 3\nWIDTH 2\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\n\
             DATA {data}\n",
            2 * height
        )
    };
    let values: Vec<u8> = (0..96u8).collect();
    let packed: Vec<u8> = values[..48].chunks(16).flat_map(|run| [&[15], run].concat()).collect();
    let sizes = [packed.len() as u32, 48].map(u32::to_le_bytes);
    vec![
        [head(2, "binary").as_bytes(), &values].concat(),
        [head(1, "binary_compressed").as_bytes(), sizes.as_flattened(), &packed].concat(),
        [head(1, "ascii").as_bytes(), b"1 2 3 4.2108e+06 0 0 1 -2 3\nnan 2 3 0 0 0 1 2 3\n"]
            .concat(),
    ]
}

fn obj_seeds(_: &Path) -> Vec<Vec<u8>> {
    texts(&[
        "# x\nv 1 2 3\nv 4 5 6 # y\nvn 0 0 1\nf 1 2 1\n",
        "o a\nv 1 2 3 0.5 0 1\nv 1 2 3 1 0 0\n",
    ])
}

fn off_seeds(_: &Path) -> Vec<Vec<u8>> {
    texts(&[
        "OFF\n2 1 0\n1 2 3\n4 5 6\n3 0 1 0\n",
        "COFF 1 0 0\n1 2 3 255 0 7 255\n",
        "NOFF\n1 0 0\n1 2 3 0 0 1\n",
    ])
}

fn stl_seeds(_: &Path) -> Vec<Vec<u8>> {
    let text = "solid x\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 4 5 6\nvertex 7 8 9\n\
                endloop\nendfacet\nendsolid x\n";
    let binary = [&[b' '; 80][..], &2u32.to_le_bytes(), &[1; 100]].concat();
    vec![text.as_bytes().to_vec(), binary]
}

fn e57_seeds(folder: &Path) -> Vec<Vec<u8>> {
    let path = folder.join("seed.e57");
    let mut writer = E57Writer::from_file(&path, "{seed}").unwrap();
    let single = RecordDataType::Single { min: None, max: None };
    let axes = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    let mut fields: Vec<Record> =
        axes.into_iter().map(|name| Record { name, data_type: single.clone() }).collect();
    let integer = |min, max| RecordDataType::Integer { min, max };
    fields.push(Record { name: RecordName::CartesianInvalidState, data_type: integer(0, 2) });
    fields.push(Record { name: RecordName::Intensity, data_type: integer(-5, 1000) });
    let mut cloud = writer.add_pointcloud("{one}", fields).unwrap();
    for n in 0..40 {
        let at = [n as f32, 0.5, -1.0].map(RecordValue::Single);
        let more = [RecordValue::Integer(n % 3), RecordValue::Integer(n)];
        cloud.add_point([&at[..], &more].concat()).unwrap();
    }
    cloud.finalize().unwrap();
    writer.finalize().unwrap();
    vec![std::fs::read(&path).unwrap()]
}
