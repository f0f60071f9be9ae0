//! Scans that a check makes: a few points in all the arrangements that stages trip over, as records
//! with every dimension that the stages ask for.

use std::fmt::Write as _;
use std::sync::Arc;

use crate::Result;
use crate::io::las;
use crate::memory;
use crate::point::{Bits, Dimension, Horizontal, Metadata, Scalar, Schema, Units, Value, names};
use crate::synth::Random;

/// How the points of a scan lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arrangement {
    Uniform,
    Clusters,
    Planes,
    Copies,
    Nothing,
    Grid,
    Far,
    One,
    Line,
    Edge,
}

impl Arrangement {
    pub const ALL: [Arrangement; 10] = [
        Arrangement::Uniform,
        Arrangement::Clusters,
        Arrangement::Planes,
        Arrangement::Copies,
        Arrangement::Nothing,
        Arrangement::Grid,
        Arrangement::Far,
        Arrangement::One,
        Arrangement::Line,
        Arrangement::Edge,
    ];

    /// What messages call it.
    pub fn called(self) -> &'static str {
        match self {
            Arrangement::Uniform => "points anywhere in a box",
            Arrangement::Clusters => "clusters of unlike density",
            Arrangement::Planes => "planes",
            Arrangement::Copies => "many points at a few positions",
            Arrangement::Nothing => "no points",
            Arrangement::Grid => "points on a grid",
            Arrangement::Far => "points far from the origin",
            Arrangement::One => "one point",
            Arrangement::Line => "points on a line",
            Arrangement::Edge => "integers at the ends of what they hold",
        }
    }

    fn points(self, most: usize) -> usize {
        match self {
            Arrangement::Nothing => 0,
            Arrangement::One => 1,
            _ => most,
        }
    }

    /// Stored coordinates of a point in a box of `extent` steps.
    fn place(self, random: &mut Random, extent: f64, number: usize) -> [i32; 3] {
        let mut anywhere = || (extent * random.unit()) as i32;
        let at = [anywhere(), anywhere(), anywhere()];
        let [x, y, z] = at;
        match self {
            Arrangement::Uniform | Arrangement::Far => at,
            Arrangement::Nothing | Arrangement::One => at,
            Arrangement::Clusters => {
                let cluster = (number % 3) as i32;
                at.map(|v| (v >> (4 * cluster)) + cluster * (extent * 0.7) as i32)
            }
            Arrangement::Planes => match number % 3 {
                0 => [x, y, 0],
                1 => [x, 0, z],
                _ => [x, y, y],
            },
            Arrangement::Copies => {
                // As few positions as there are hundreds of points, and one.
                let position = (number / 100 + number % 2) as i32;
                [position * 7, position * 3, position % 2]
            }
            Arrangement::Grid => at.map(|v| v * 5 / (extent as i32 + 1) * (extent as i32 / 4 + 1)),
            Arrangement::Line => [x, 2 * (x / 2), -x],
            Arrangement::Edge => at.map(|v| match v % 5 {
                0 => i32::MIN,
                1 => i32::MAX,
                2 => i32::MIN + 1 + v,
                3 => i32::MAX - 1 - v,
                _ => v,
            }),
        }
    }
}

/// Records that are alike in their schema.
#[derive(Debug, Clone)]
pub(super) struct MadeScan {
    pub arrangement: Arrangement,
    pub schema: Arc<Schema>,
    pub records: Arc<Vec<u8>>,
}

impl MadeScan {
    /// A scan of `most` points, or fewer where that is the arrangement, with the dimensions `asked`
    /// for: records of LAS, or, for every second `seed`, of plain numbers.
    ///
    /// # Errors
    ///
    /// Dimensions that no schema has together.
    pub fn of(arrangement: Arrangement, most: usize, asked: &[String], seed: u64) -> Result<Self> {
        let mut random = Random::new(seed, 0);
        let schema = Arc::new(schema(arrangement, asked, &mut random)?);
        let extent = 64.0 * libm::pow(2.0, 10.0 * random.unit());
        let mut records = vec![0; arrangement.points(most) * schema.stride];
        for (number, record) in records.chunks_exact_mut(schema.stride).enumerate() {
            let place = arrangement.place(&mut random, extent, number);
            // Of many points at a position some are the same in every byte.
            let alike = arrangement == Arrangement::Copies && random.unit() < 0.8;
            let mut values = match alike {
                true => Random::new(seed, 1 + number as u64 % 4),
                false => Random::new(seed, 5 + number as u64),
            };
            for dimension in &schema.dimensions {
                let axis = names::XYZ.iter().position(|name| *name == dimension.name);
                match axis {
                    Some(axis) => put_coordinate(dimension, &schema, record, place[axis]),
                    None => randomize(dimension, &schema, record, &mut values),
                }
            }
        }
        Ok(MadeScan { arrangement, schema, records: Arc::new(records) })
    }

    /// What outputs would carry on: coordinates are metres.
    pub fn metadata(&self) -> Metadata {
        let horizontal = Some(Horizontal::Metres(1.0));
        let units = Units { horizontal, vertical: Some(1.0), ..Units::default() };
        Metadata { units, ..Metadata::default() }
    }

    /// How many points it has.
    pub fn len(&self) -> usize {
        self.records.len() / self.schema.stride
    }

    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.records.chunks_exact(self.schema.stride)
    }

    fn with(&self, records: Vec<u8>) -> MadeScan {
        MadeScan { records: Arc::new(records), ..self.clone() }
    }

    /// The records with these numbers.
    pub fn only(&self, numbers: &[usize]) -> MadeScan {
        let stride = self.schema.stride;
        let record = |n: &usize| &self.records[n * stride..(n + 1) * stride];
        self.with(numbers.iter().flat_map(record).copied().collect())
    }

    /// The same records in another order.
    pub fn shuffled(&self, seed: u64) -> MadeScan {
        let mut random = Random::new(seed, 1);
        let mut numbers: Vec<(u64, usize)> =
            (0..self.len()).map(|n| (random.unit().to_bits(), n)).collect();
        numbers.sort_unstable();
        let numbers: Vec<usize> = numbers.into_iter().map(|(_, n)| n).collect();
        self.only(&numbers)
    }

    /// Of points with the same coordinates the first: what other records hold then decides no order
    /// among them.
    pub fn distinct(&self) -> MadeScan {
        let mut known = std::collections::BTreeSet::new();
        let axes = self.schema.coordinates();
        let place = |record: &[u8]| {
            axes.map(|axes| axes.map(|a| a.get(record, self.schema.endian).as_f64().to_bits()))
        };
        let numbers: Vec<usize> = self
            .iter()
            .enumerate()
            .filter(|(_, r)| known.insert(place(r)))
            .map(|(n, _)| n)
            .collect();
        self.only(&numbers)
    }

    /// The same points with other values in all dimensions but coordinates and those `kept`.
    pub fn altered(&self, kept: &[String], seed: u64) -> MadeScan {
        let mut records = (*self.records).clone();
        let is_kept = |name: &String| names::XYZ.contains(&name.as_str()) || kept.contains(name);
        for record in records.chunks_exact_mut(self.schema.stride) {
            // By what the record is: a part of the scan is altered as the whole.
            let mut random = Random::new(seed, u64::from(crc32fast::hash(record)));
            for dimension in self.schema.dimensions.iter().filter(|d| !is_kept(&d.name)) {
                randomize(dimension, &self.schema, record, &mut random);
            }
        }
        self.with(records)
    }

    /// A record with its coordinates and what it holds of the dimensions `named`.
    pub fn told(&self, record: &[u8], named: &[String]) -> String {
        told(&self.schema, record, named)
    }
}

/// The coordinates of a record and what it holds of the dimensions `named`.
pub(super) fn told(schema: &Schema, record: &[u8], named: &[String]) -> String {
    let is_told = |d: &&Dimension| {
        names::XYZ.contains(&d.name.as_str()) || named.iter().any(|name| *name == d.name)
    };
    let mut text = String::new();
    for dimension in schema.dimensions.iter().filter(is_told) {
        let value = dimension.world(record, schema.endian);
        let gap = if text.is_empty() { "" } else { " " };
        let _ = write!(text, "{gap}{} {value:?}", dimension.name);
    }
    text
}

/// The dimensions `asked` for, of records of LAS or of plain numbers.
fn schema(arrangement: Arrangement, asked: &[String], random: &mut Random) -> Result<Schema> {
    let far = match arrangement {
        Arrangement::Far => [500_000.0, 5_400_000.0, 300.0],
        _ => [0.0; 3],
    };
    let is_float = arrangement != Arrangement::Edge && random.unit() < 0.4;
    let of_las = las::layout(7, &[], [0.001; 3], far);
    let extra = asked.iter().filter(|name| of_las.find(name).is_none());
    let extra: Vec<(String, Scalar)> = extra.map(|name| (name.clone(), Scalar::F32)).collect();
    if !is_float {
        return Ok(las::layout(7, &extra, [0.001; 3], far));
    }
    let mut plain: Vec<(&str, Scalar)> = names::XYZ.map(|name| (name, Scalar::F64)).to_vec();
    plain.extend([(names::INTENSITY, Scalar::U16), (names::CLASSIFICATION, Scalar::U8)]);
    plain.push((names::GPS_TIME, Scalar::F64));
    for name in asked {
        if plain.iter().all(|(known, _)| known != name) {
            let scalar = of_las.find(name).map_or(Scalar::F32, |dimension| dimension.scalar);
            plain.push((name, scalar));
        }
    }
    let mut schema = memory::schema(&plain)?;
    for dimension in &mut schema.dimensions {
        if let Some(axis) = names::XYZ.iter().position(|name| *name == dimension.name) {
            dimension.origin = far[axis];
        }
    }
    Ok(schema)
}

/// Stores a coordinate: so many steps, or of plain numbers so many 1024ths.
fn put_coordinate(dimension: &Dimension, schema: &Schema, record: &mut [u8], steps: i32) {
    let value = match dimension.scalar.is_float() {
        true => Value::Double(f64::from(steps) / 1024.0),
        false => Value::Signed(i64::from(steps)),
    };
    let _ = dimension.put(record, schema.endian, value);
}

/// Stores any value that the dimension holds: small whole numbers where that is its type, so that
/// values meet.
fn randomize(dimension: &Dimension, schema: &Schema, record: &mut [u8], random: &mut Random) {
    let value = match (dimension.scalar.is_float(), dimension.bits) {
        (true, _) => Value::Single((random.between(-4.0, 4.0) * 8.0).round() as f32 / 8.0),
        (false, Some(Bits { width, .. })) => {
            Value::Unsigned((random.unit() * 2f64.powi(i32::from(width.min(5)))) as u64)
        }
        (false, None) => Value::Unsigned((random.unit() * 20.0) as u64),
    };
    let _ = dimension.put(record, schema.endian, value);
}
