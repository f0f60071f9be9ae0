//! E57 files held to the rules of ASTM E2807 that a reader can hold them to: header, checksums of
//! pages, the XML section, and what it says of each scan.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use e57::{PointCloud, RecordDataType, RecordName};

use super::file::{E57Scan, reader};
use super::names::{CALLED, MAGIC};
use super::source;
use crate::host::{Threads, lock};
use crate::io::origin::Origin;
use crate::stage::{Findings, PointWalk, ReadKeys, Rule, WHOLE_RULES, foreign, read_whole};
use crate::{Error, Result};

/// Bytes of a page, and of the checksum that ends it.
const PAGE: u64 = 1024;
const CHECKSUM: usize = 4;
/// Bytes of the header.
const HEADER: usize = 48;
/// What the axes are called.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Pages that are checked as one item.
const PAGES: u64 = 4096;

static VERSION: Rule = Rule::fault("e57-version", "ASTM E2807, file header, versions", "1.0");
static LENGTH: Rule = Rule::fault(
    "e57-length",
    "ASTM E2807, file header, filePhysicalLength",
    "the bytes of the file, a whole number of pages of 1,024",
);
static PAGE_SIZE: Rule = Rule::fault("e57-page-size", "ASTM E2807, file header, pageSize", "1024");
static XML: Rule = Rule::fault(
    "e57-xml",
    "ASTM E2807, file header, xmlPhysicalOffset and xmlLogicalLength",
    "an XML section within the file",
);
static SUM: Rule = Rule::fault(
    "e57-checksum",
    "ASTM E2807, pages",
    "the CRC-32C of the 1,020 bytes before it, at the end of each page",
);
static SECTION: Rule =
    Rule::fault("e57-section", "ASTM E2807, XML section", "XML that says what scans there are");
static BOUNDS: Rule = Rule::fault(
    "e57-bounds",
    "ASTM E2807, cartesianBounds",
    "finite numbers, no smallest above the largest",
);
static BOUNDS_HOLD: Rule = Rule::fault(
    "e57-bounds-hold",
    "ASTM E2807, cartesianBounds",
    "bounds that hold all points of the scan, in its own coordinates",
);
static GUID: Rule =
    Rule::warning("e57-guid", "ASTM E2807, Data3D, guid", "an identifier for each scan");

/// All rules for E57 files.
pub(super) fn rules() -> Vec<&'static Rule> {
    let own = [&VERSION, &LENGTH, &PAGE_SIZE, &XML, &SUM, &SECTION, &BOUNDS, &BOUNDS_HOLD, &GUID];
    own.into_iter().chain(WHOLE_RULES).collect()
}

/// Checks the file at `path`.
pub(super) fn validate(path: &Path, walk: &PointWalk<'_>, findings: &mut Findings) -> Result<()> {
    let (file, origin) = Origin::open(path)?;
    let length = origin.length();
    let mut head = [0; HEADER];
    let read = |bytes: &mut [u8], at| {
        file.read_exact_at(bytes, at).map_err(|e| Error::io(path, "read it", e).at_byte(at))
    };
    if length < HEADER as u64 {
        return Err(foreign(path, CALLED));
    }
    read(&mut head, 0)?;
    if !head.starts_with(MAGIC) {
        return Err(foreign(path, CALLED));
    }
    header(&head, length, findings);
    sums(path, &file, length, walk, findings)?;
    let opened = match reader(path, &origin) {
        Ok(opened) => opened,
        Err(error) => {
            findings.error(&SECTION, &error);
            return Ok(());
        }
    };
    let scans = opened.pointclouds();
    (1..).zip(&scans).for_each(|(number, scan)| of_scan(number, scan, findings));
    let source = source::open(&[path.to_owned()], &ReadKeys::default())?;
    read_whole(&source, walk, findings)?;
    source.files.iter().flat_map(|file| &file.scans).for_each(|scan| of_points(scan, findings));
    Ok(())
}

fn header(head: &[u8; HEADER], length: u64, findings: &mut Findings) {
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| head[at + i]));
    let long = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| head[at + i]));
    let (major, minor) = (word(8), word(12));
    if (major, minor) != (1, 0) {
        findings.at(&VERSION, 8, format!("{major}.{minor}"));
    }
    if long(16) != length || !length.is_multiple_of(PAGE) {
        findings.at(&LENGTH, 16, format!("{}, and the file has {length}", long(16)));
    }
    if long(40) != PAGE {
        findings.at(&PAGE_SIZE, 40, format!("{}", long(40)));
    }
    let (start, bytes) = (long(24), long(32));
    // Checksums lie between the bytes of the section.
    let end = start.checked_add(bytes).filter(|end| *end <= length);
    if start < HEADER as u64 || bytes == 0 || end.is_none() {
        let told = format!("{bytes} bytes from byte {start} on, and the file has {length}");
        findings.at(&XML, 24, told);
    }
}

/// Holds all pages against their checksums.
fn sums(
    path: &Path,
    file: &File,
    length: u64,
    walk: &PointWalk<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let pages = length / PAGE;
    let items = pages.div_ceil(PAGES) as usize;
    let item = |(buffer, wrong): &mut (Vec<u8>, Findings), item: usize| -> Result<()> {
        let from = item as u64 * PAGES;
        let count = PAGES.min(pages - from);
        buffer.resize((count * PAGE) as usize, 0);
        let at = from * PAGE;
        file.read_exact_at(buffer, at).map_err(|e| Error::io(path, "read it", e).at_byte(at))?;
        for (number, page) in (from..).zip(buffer.chunks_exact(PAGE as usize)) {
            let (bytes, sum) = page.split_at(page.len() - CHECKSUM);
            let right = crc32c::crc32c(bytes);
            let found = u32::from_be_bytes(std::array::from_fn(|i| sum[i]));
            if right != found {
                let told = format!("{found:#010x} ends page {number}, and {right:#010x} is right");
                wrong.at(&SUM, number * PAGE + bytes.len() as u64, told);
            }
        }
        Ok(())
    };
    let all = std::sync::Mutex::new(Findings::default());
    Threads::start(walk.threads, |threads| {
        threads.items(items, || {}).run(
            || (Vec::new(), Findings::default()),
            item,
            |()| {},
            |(_, wrong)| {
                lock(&all).merge(wrong);
                Ok(())
            },
        )
    })?;
    findings.merge(all.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner));
    Ok(())
}

/// The axes of a scan's bounds, as far as both ends of one are told.
fn axes(scan: &PointCloud) -> impl Iterator<Item = (usize, [f64; 2])> {
    let bounds = scan.cartesian_bounds.as_ref();
    let axes = bounds.map(|bounds| {
        [(bounds.x_min, bounds.x_max), (bounds.y_min, bounds.y_max), (bounds.z_min, bounds.z_max)]
    });
    let axes = axes.into_iter().flatten().enumerate();
    axes.filter_map(|(axis, (low, high))| Some((axis, [low?, high?])))
}

/// Half of the largest scale of coordinates that are whole numbers of steps: bounds may be those of
/// what was rounded to these.
fn half_step(scan: &PointCloud) -> f64 {
    let coordinates = scan.prototype.iter().filter(|record| {
        use RecordName::{CartesianX, CartesianY, CartesianZ};
        matches!(record.name, CartesianX | CartesianY | CartesianZ)
    });
    let scales = coordinates.filter_map(|record| match record.data_type {
        RecordDataType::ScaledInteger { scale, .. } => Some(scale.abs()),
        _ => None,
    });
    scales.fold(0.0, f64::max) / 2.0
}

/// Holds the points of a scan that were read to its bounds, but for what single precision and the
/// steps of coordinates round.
fn of_points(scan: &E57Scan, findings: &mut Findings) {
    let Some([lowest, highest]) = *lock(&scan.seen) else { return };
    for (axis, [low, high]) in axes(&scan.cloud) {
        let slack = f64::from(f32::EPSILON) * low.abs().max(high.abs()) + half_step(&scan.cloud);
        let (least, most) = (lowest[axis], highest[axis]);
        if low <= high && (least < low - slack || most > high + slack) {
            let (name, number) = (AXES[axis], scan.number);
            let told = format!("{name} of points from {least} to {most}, and the bounds of scan ");
            findings.whole(&BOUNDS_HOLD, format!("{told}{number} are {low} to {high}"));
        }
    }
}

fn of_scan(number: u64, scan: &PointCloud, findings: &mut Findings) {
    if scan.guid.as_ref().is_none_or(String::is_empty) {
        findings.whole(&GUID, format!("scan {number} has none"));
    }
    for (axis, [low, high]) in axes(scan) {
        if scan.records > 0 && !(low <= high && low.is_finite() && high.is_finite()) {
            let axis = AXES[axis];
            findings.whole(&BOUNDS, format!("{axis} of scan {number} from {low} to {high}"));
        }
    }
}
