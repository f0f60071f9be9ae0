//! One E57 file: its scans, and what the values of each are.

use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use e57::{E57Reader, PointCloud, RecordDataType};

use super::fields::{Meaning, meaning};
use super::names::{CALLED, MAGIC};
use super::pose::Pose;
use super::reading::Windowed;
use crate::error::shown;
use crate::io::damage::Losses;
use crate::io::origin::Origin;
use crate::report::Grouped;
use crate::stage::{OnError, foreign};
use crate::{Error, Result};

/// One scan of a file.
pub(super) struct E57Scan {
    pub cloud: PointCloud,
    /// None where its coordinates are those of all.
    pub pose: Option<Pose>,
    /// What each value of a point is.
    pub meanings: Vec<Meaning>,
    /// Its number in the file, from 1.
    pub number: u64,
    /// Bits of a point.
    pub bits: u64,
    /// Points that the file says are invalid and that were met so far.
    pub invalid: AtomicU64,
    /// What its points that were read to the end lie in, in its own coordinates.
    pub seen: Mutex<Option<[[f64; 3]; 2]>>,
}

/// One file.
pub(super) struct E57File {
    pub path: PathBuf,
    pub origin: Origin,
    pub scans: Vec<E57Scan>,
    pub crs: Option<String>,
    pub warnings: Vec<String>,
    /// What is lost of it.
    pub losses: Losses,
}

/// The error of a file that the crate cannot read.
pub(super) fn unreadable(path: &Path, told: &str, cause: e57::Error) -> Error {
    Error::data(path, told)
        .because(cause)
        .help("the file is damaged or cut short: copy or make it again")
}

/// A reader of the file's bytes, its header read.
pub(super) fn reader(path: &Path, origin: &Origin) -> Result<E57Reader<Windowed>> {
    let bytes = Windowed::new(origin.reopen()?, origin.length());
    E57Reader::new(bytes).map_err(|cause| unreadable(path, "its header is not read", cause))
}

impl E57File {
    /// Reads what the file says of its scans; `chosen` are the numbers of those that are read.
    pub fn open(path: &Path, chosen: Option<&[u64]>, on_error: OnError) -> Result<E57File> {
        let (file, origin) = Origin::open(path)?;
        let mut first = [0; MAGIC.len()];
        let is_e57 = origin.length() >= first.len() as u64 && {
            let read = file.read_exact_at(&mut first, 0);
            read.map_err(|e| Error::io(path, "read it", e))?;
            first == *MAGIC
        };
        if !is_e57 {
            return Err(foreign(path, CALLED));
        }
        let opened = reader(path, &origin)?;
        let crs = opened.coordinate_metadata().map(str::trim).filter(|text| !text.is_empty());
        let crs = crs.map(str::to_owned);
        let all = opened.pointclouds();
        let mut warnings = Vec::new();
        if let Some(missing) = chosen.and_then(|c| c.iter().find(|&&n| n > all.len() as u64)) {
            let told = format!("`read.scans` names scan {missing}, and the file has {}", all.len());
            return Err(Error::pipeline(told).at(path));
        }
        if all.is_empty() {
            warnings.push(format!("{}: the file has no scan", shown(path)));
        }
        if !opened.images().is_empty() {
            let images = opened.images().len();
            warnings
                .push(format!("{}: {images} images are not points: they are dropped", shown(path)));
        }
        let is_chosen = |n: &u64| chosen.is_none_or(|chosen| chosen.contains(n));
        let scans = (1..).zip(all).filter(|(n, _)| is_chosen(n));
        let scans = scans.map(|(number, cloud)| scan(path, origin.length(), number, cloud));
        let scans = scans.collect::<Result<Vec<_>>>()?;
        let losses = Losses::new(on_error);
        Ok(E57File { path: path.to_owned(), origin, scans, crs, warnings, losses })
    }

    /// Points that were met so far and have no coordinates.
    pub fn invalid(&self) -> u64 {
        self.scans.iter().map(|scan| scan.invalid.load(Ordering::Relaxed)).sum()
    }

    /// Points that its scans claim.
    pub fn points(&self) -> u64 {
        self.scans.iter().fold(0, |sum, scan| sum.saturating_add(scan.cloud.records))
    }
}

/// A scan of a file of so many bytes.
fn scan(path: &Path, length: u64, number: u64, cloud: PointCloud) -> Result<E57Scan> {
    let fail = |told: String| Error::data(path, format!("scan {number}: {told}"));
    let meanings: Vec<Meaning> = cloud.prototype.iter().map(|r| meaning(r, &cloud)).collect();
    if !cloud.has_cartesian() && !cloud.has_spherical() {
        return Err(fail("its points have no coordinates".to_owned()));
    }
    let bits: u64 = cloud.prototype.iter().map(|record| bits(&record.data_type)).sum();
    // A value takes its bits, so the file's length bounds the points; of none it would bound
    // nothing.
    let holds = (length * 8).checked_div(bits).unwrap_or(0);
    if cloud.records > holds {
        let (points, holds) = (Grouped(cloud.records), Grouped(holds));
        let told = format!("{points} points are claimed, the file holds {holds} at most");
        return Err(fail(told).help("the file is cut short, or its header is wrong"));
    }
    let pose = cloud.transform.as_ref().and_then(Pose::of);
    if pose.is_some_and(|pose| !pose.is_finite()) {
        return Err(fail("its pose is no turn and shift".to_owned()));
    }
    let (invalid, seen) = (AtomicU64::new(0), Mutex::new(None));
    Ok(E57Scan { cloud, pose, meanings, number, bits, invalid, seen })
}

/// Bits of a value.
fn bits(kind: &RecordDataType) -> u64 {
    match kind {
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => {
            let span = (i128::from(*max) - i128::from(*min)).max(0);
            u64::from(i128::BITS - span.leading_zeros())
        }
    }
}
