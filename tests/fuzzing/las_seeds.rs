//! Small LAS and LAZ files of every version, point format and kind of compression.

use std::io::Cursor;

use laz::{LasZipCompressor, LazVlr, LazVlrBuilder};

use crate::support::las_file::{Beside, Header, STRIDES, extend};
use crate::support::random::Random;

/// What a file is made of.
pub struct Recipe {
    pub minor: u8,
    pub format: u8,
    pub extra: u16,
    pub points: u32,
    pub vlrs: Vec<Beside>,
    pub evlrs: Vec<Beside>,
    /// Points of a chunk; 0 for chunks of varying size; None for no compression.
    pub chunk: Option<u32>,
}

fn put(data: &mut [u8], at: usize, bytes: &[u8]) {
    data[at..at + bytes.len()].copy_from_slice(bytes);
}

fn beside(user: &'static str, record: u16, payload: impl Into<Vec<u8>>) -> Beside {
    Beside { user, record, payload: payload.into() }
}

impl Recipe {
    fn stride(&self) -> usize {
        STRIDES[usize::from(self.format)] + usize::from(self.extra)
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

    /// The file.
    pub fn bake(mut self) -> Vec<u8> {
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
            self.vlrs.push(beside("laszip encoded", LazVlr::RECORD_ID, payload));
        }
        let header = Header {
            minor: self.minor,
            format: self.format,
            is_compressed: compression.is_some(),
            stride: self.stride(),
            scale: [0.01; 3],
            offset: [0.0, 100.0, 200.0],
        };
        let records = self.records();
        let mut file = header.bytes(&self.vlrs, &records);
        match compression {
            Some(laszip) => file = self.compress(file, laszip, &records),
            None => file.extend(records),
        }
        if self.minor >= 4 {
            extend(&mut file, &self.evlrs);
        }
        file
    }

    fn compress(&self, file: Vec<u8>, laszip: LazVlr, records: &[u8]) -> Vec<u8> {
        let mut out = Cursor::new(file);
        out.set_position(out.get_ref().len() as u64);
        let mut encoder = LasZipCompressor::new(out, laszip).expect("an encoder");
        for (i, record) in records.chunks(self.stride()).enumerate() {
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
    let same = beside("LASF_Spec", 4, unnamed(192).repeat(341));
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
                beside("LASF_Projection", 34735, geo_keys()),
                beside("LASF_Projection", 34737, *b"Here|"),
                beside("LASF_Projection", 2112, *b"PROJCS[\"x\"]\0"),
            ];
            vlrs.rotate_left(i % 3);
            vlrs.truncate(1 + i % 3);
            if extra > 0 {
                vlrs.push(beside(
                    "LASF_Spec",
                    4,
                    [descriptor("Echo", 4), descriptor("Range", 5)].concat(),
                ));
            }
            let evlrs = vec![
                beside("LASF_Projection", 2112, *b"GEOGCS[\"y\"]\0"),
                beside("LASF_Spec", 65535, vec![7; 40]),
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
