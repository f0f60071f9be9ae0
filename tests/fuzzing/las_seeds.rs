//! Small LAS and LAZ files of every version, point format and kind of compression.

use std::io::Cursor;

use laz::{LasZipCompressor, LazVlr, LazVlrBuilder};

use crate::support::random::Random;

/// Bytes of a record of each point format.
pub const RECORD: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// One variable length record: user, number, payload.
type Record<'a> = (&'a str, u16, Vec<u8>);

/// What a file is made of.
pub struct Recipe<'a> {
    pub minor: u8,
    pub format: u8,
    pub extra: u16,
    pub points: u32,
    pub vlrs: Vec<Record<'a>>,
    pub evlrs: Vec<Record<'a>>,
    /// Points of a chunk; 0 for chunks of varying size; None for no compression.
    pub chunk: Option<u32>,
}

/// Bytes of the header of LAS 1.`minor`.
pub fn header_size(minor: u8) -> usize {
    [227, 227, 227, 235, 375][usize::from(minor.min(4))]
}

fn put(data: &mut [u8], at: usize, bytes: &[u8]) {
    data[at..at + bytes.len()].copy_from_slice(bytes);
}

fn record_head(record: &Record<'_>, extended: bool) -> Vec<u8> {
    let (user, number, payload) = record;
    let mut head = vec![0; if extended { 60 } else { 54 }];
    put(&mut head, 2, user.as_bytes());
    put(&mut head, 18, &number.to_le_bytes());
    if extended {
        put(&mut head, 20, &(payload.len() as u64).to_le_bytes());
    } else {
        put(&mut head, 20, &(payload.len() as u16).to_le_bytes());
    }
    head.extend(payload);
    head
}

impl Recipe<'_> {
    fn stride(&self) -> usize {
        usize::from(RECORD[usize::from(self.format)] + self.extra)
    }

    /// Records that resemble a scan line: what compression is made for.
    fn records(&self) -> Vec<u8> {
        let mut random = Random(u64::from(self.format) + 100);
        let (mut all, stride) = (Vec::new(), self.stride());
        for i in 0..self.points as i32 {
            let mut record = vec![0u8; stride];
            let at = [i * 10, i * i % 50, 1000 - i];
            at.iter()
                .enumerate()
                .for_each(|(axis, v)| put(&mut record, 4 * axis, &v.to_le_bytes()));
            put(&mut record, 12, &(40 + i as u16).to_le_bytes());
            record[14] = if self.format < 6 { 0b01_010_001 } else { 0b0010_0001 };
            record[15] = if self.format < 6 { 2 } else { 0 };
            for byte in &mut record[16..] {
                *byte = if random.one_in(3) { random.number() as u8 } else { i as u8 };
            }
            all.extend(record);
        }
        all
    }

    fn header(&self, vlrs: &[Vec<u8>]) -> Vec<u8> {
        let size = header_size(self.minor);
        let start = size + vlrs.iter().map(Vec::len).sum::<usize>();
        let mut header = vec![0; size];
        put(&mut header, 0, b"LASF");
        put(&mut header, 24, &[1, self.minor]);
        put(&mut header, 26, b"OTHER");
        put(&mut header, 58, b"seeds");
        put(&mut header, 94, &(size as u16).to_le_bytes());
        put(&mut header, 96, &(start as u32).to_le_bytes());
        put(&mut header, 100, &(vlrs.len() as u32).to_le_bytes());
        header[104] = self.format | if self.chunk.is_some() { 0x80 } else { 0 };
        put(&mut header, 105, &(self.stride() as u16).to_le_bytes());
        if self.format < 6 {
            put(&mut header, 107, &self.points.to_le_bytes());
        }
        for axis in 0..3 {
            put(&mut header, 131 + 8 * axis, &0.01f64.to_le_bytes());
            put(&mut header, 155 + 8 * axis, &(100.0 * axis as f64).to_le_bytes());
        }
        if self.minor >= 4 {
            put(&mut header, 247, &u64::from(self.points).to_le_bytes());
        }
        header
    }

    /// The file.
    pub fn bake(&self) -> Vec<u8> {
        let mut vlrs: Vec<Vec<u8>> = self.vlrs.iter().map(|v| record_head(v, false)).collect();
        let compression = self.chunk.map(|points| {
            let builder = LazVlrBuilder::default()
                .with_point_format(self.format, self.extra)
                .expect("a point format");
            match points {
                0 => builder.with_variable_chunk_size().build(),
                points => builder.with_fixed_chunk_size(points).build(),
            }
        });
        if let Some(laszip) = &compression {
            let mut payload = Vec::new();
            laszip.write_to(&mut payload).expect("a laszip record");
            vlrs.push(record_head(&("laszip encoded", 22204, payload), false));
        }
        let mut file = self.header(&vlrs);
        file.extend(vlrs.concat());
        match compression {
            Some(laszip) => file = self.compress(file, laszip),
            None => file.extend(self.records()),
        }
        if self.minor >= 4 && !self.evlrs.is_empty() {
            let start = file.len() as u64;
            put(&mut file, 235, &start.to_le_bytes());
            put(&mut file, 243, &(self.evlrs.len() as u32).to_le_bytes());
            self.evlrs.iter().for_each(|record| file.extend(record_head(record, true)));
        }
        file
    }

    fn compress(&self, file: Vec<u8>, laszip: LazVlr) -> Vec<u8> {
        let mut out = Cursor::new(file);
        out.set_position(out.get_ref().len() as u64);
        let mut encoder = LasZipCompressor::new(out, laszip).expect("an encoder");
        for (i, record) in self.records().chunks(self.stride()).enumerate() {
            encoder.compress_one(record).expect("a point");
            if self.chunk == Some(0) && i % 5 == 3 {
                encoder.finish_current_chunk().expect("a chunk");
            }
        }
        encoder.done().expect("a chunk table");
        encoder.into_inner().into_inner()
    }
}

fn geo_keys() -> Vec<u8> {
    let words: [u16; 12] = [1, 1, 0, 2, 3072, 0, 1, 26915, 1026, 34737, 5, 0];
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// A descriptor of extra bytes: `name`, of type `kind`.
fn descriptor(name: &str, kind: u8) -> Vec<u8> {
    let mut bytes = vec![0; 192];
    bytes[2] = kind;
    bytes[3] = 0b1_1000;
    put(&mut bytes, 4, name.as_bytes());
    put(&mut bytes, 112, &0.5f64.to_le_bytes());
    bytes
}

/// A descriptor of `size` bytes without a meaning.
fn unnamed(size: u8) -> Vec<u8> {
    let mut bytes = vec![0; 192];
    bytes[3] = size;
    bytes
}

/// A file whose records are as long as can be, of descriptors that all want the same names.
pub fn same_names() -> Vec<u8> {
    let same = ("LASF_Spec", 4, unnamed(192).repeat(341));
    Recipe {
        minor: 4,
        format: 0,
        extra: 341 * 192,
        points: 1,
        vlrs: vec![same],
        evlrs: Vec::new(),
        chunk: None,
    }
    .bake()
}

/// The files to begin with.
pub fn seeds() -> Vec<Vec<u8>> {
    let none = Recipe {
        minor: 4,
        format: 0,
        extra: 0,
        points: 12,
        vlrs: Vec::new(),
        evlrs: Vec::new(),
        chunk: None,
    };
    let mut all = vec![
        Recipe { points: 0, ..none }.bake(),
        Recipe { points: 0, chunk: Some(5), minor: 2, vlrs: vec![], evlrs: vec![], ..none }.bake(),
    ];
    for format in 0..=10u8 {
        let minor = if format < 6 { format.div_ceil(2).clamp(0, 3) } else { 4 };
        for (i, chunk) in [None, Some(5), Some(0), Some(50_000)].into_iter().enumerate() {
            let extra = if i % 2 == 0 { 6 } else { 0 };
            let mut vlrs = vec![
                ("LASF_Projection", 34735, geo_keys()),
                ("LASF_Projection", 34737, b"Here|".to_vec()),
                ("LASF_Projection", 2112, b"PROJCS[\"x\"]\0".to_vec()),
            ];
            vlrs.rotate_left(i % 3);
            vlrs.truncate(1 + i % 3);
            if extra > 0 {
                vlrs.push((
                    "LASF_Spec",
                    4,
                    [descriptor("Echo", 4), descriptor("Range", 5)].concat(),
                ));
            }
            let evlrs = vec![
                ("LASF_Projection", 2112, b"GEOGCS[\"y\"]\0".to_vec()),
                ("LASF_Spec", 65535, vec![7; 40]),
            ];
            let points = 12 + 2 * i as u32;
            all.push(Recipe { minor, format, extra, points, vlrs, evlrs, chunk }.bake());
        }
    }
    // Versions of compression that we do not write, and files without chunks.
    all.extend(super::laz::seeds().into_iter().step_by(5));
    // Many extra bytes: a decoder has a model for each.
    for (format, extra) in [(1, 900), (6, 300)] {
        let chunk = Some(50_000);
        all.push(Recipe { format, extra, chunk, vlrs: vec![], evlrs: vec![], ..none }.bake());
    }
    all
}
