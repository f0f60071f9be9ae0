//! Two scans beside each other: their records, how far their points are from each other, the angles
//! between their normals, and their depth images.

use std::fmt;

use serde::Serialize;

use super::clouds::{CloudDistances, NormalAngles, cloud_distances};
use super::depth::{DepthErrors, DepthSettings, depth_errors};
use super::figures::Judged;
use super::left_out::looked_at;
use super::rules::{CompareRules, CompareVerdict};
use super::same::{RecordsComparison, compare_records};
use crate::Result;
use crate::engine::Watch;
use crate::graph::{RunSettings, Treatment};
use crate::language::Registry;
use crate::ops::Axis;

/// Pixels of depth images where nothing else is asked for.
pub const DEPTH_PIXELS: usize = 1024;
/// How depth images are seen for rules alone.
const DEPTH_SEEN: (Axis, usize) = (Axis::Z, DEPTH_PIXELS);

/// What two scans are compared by, besides their records.
#[derive(Debug, Clone, Default)]
pub struct CompareSettings {
    /// What becomes of noise, points of the classes 7 and 18. None: their records are compared, and
    /// distances and depth images leave them out.
    pub noise: Option<Treatment>,
    /// What becomes of points with the withheld flag; None: as of noise.
    pub withheld: Option<Treatment>,
    /// Whether distances are measured. Rules on them measure them in any case.
    pub distances: bool,
    /// Whether the angles between normals are measured. Rules on them measure them in any case.
    pub normals: bool,
    /// The axis that depth images look along and their pixels, 1 to 32,768 along the longer side;
    /// None: there are none, but for rules on them, which look along z in [`DEPTH_PIXELS`].
    pub depth: Option<(Axis, usize)>,
    /// What the result must be.
    pub accept: Option<CompareRules>,
    /// Memory, threads, scratch folder, and what becomes of points whose coordinates are not
    /// finite, which have no distance and no depth; their records are compared.
    pub run: RunSettings,
}

/// What two scans come to beside each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ScanComparison {
    /// Whether both have the same records.
    pub records: RecordsComparison,
    /// How far their points are from each other, if that was asked for.
    pub distances: Option<CloudDistances>,
    /// What angles their normals have, if that was asked for.
    pub normals: Option<NormalAngles>,
    /// What they differ by as depth images, if that was asked for.
    pub depth: Option<DepthErrors>,
    /// Whether the result is accepted, if there are rules.
    pub accept: Option<CompareVerdict>,
}

impl ScanComparison {
    /// An error of kind [`ErrorKind::NotAccepted`](crate::ErrorKind::NotAccepted) with the rules
    /// that do not hold, if one does not.
    ///
    /// # Errors
    ///
    /// That, and nothing else.
    pub fn accepted(&self) -> Result<()> {
        self.accept.as_ref().map_or(Ok(()), CompareVerdict::accepted)
    }
}

/// Compares two scans: are their records the same, in the same order, is one a part of the other;
/// and, if asked, how far their points are from each other, and what they differ by as depth
/// images. The scans may be of different formats. Neither is held in memory.
///
/// ```
/// use pointmill::compare::{CompareSettings, PartOf, compare};
/// use pointmill::{Graph, Overrides, Quiet, Registry};
///
/// let at = std::env::temp_dir().join(format!("pointmill-compare-{}", std::process::id()));
/// std::fs::create_dir_all(&at)?;
/// let path = |name: &str| at.join(name).to_str().unwrap().to_owned();
/// let (scan, part) = (path("scan.ply"), path("part.ply"));
/// let registry = Registry::builtin();
/// for line in [
///     format!("synth scene=plane points=5000 ! write path=\"{scan}\""),
///     format!("read path=\"{scan}\" ! sample every=2 ! write path=\"{part}\""),
/// ] {
///     Graph::parse_line(&line, &registry)?.plan(&Overrides::default())?.run(&Quiet)?;
/// }
/// let settings = CompareSettings { distances: true, ..CompareSettings::default() };
/// let told = compare(&[scan], &[part], &settings, &registry, &Quiet)?;
/// assert!(!told.records.same);
/// assert_eq!(told.records.second_in_first, PartOf::InOrder);
/// assert_eq!(told.records.only_first.count, 2500);
/// let distances = told.distances.unwrap();
/// assert_eq!(distances.second_to_first.unwrap().nearest.max, 0.0);
/// assert!(distances.first_to_second.unwrap().nearest.max > 0.0);
/// std::fs::remove_dir_all(&at)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// Files that cannot be read; points that have no place where distances are measured; a scan
/// without normals where they are compared; rules in a unit that the scans do not tell; a memory or
/// a disk that does not do.
pub fn compare(
    first: &[String],
    second: &[String],
    settings: &CompareSettings,
    registry: &Registry,
    watch: &dyn Watch,
) -> Result<ScanComparison> {
    let CompareSettings { noise, withheld, depth, accept, run, .. } = settings;
    let accept = accept.as_ref().map(|rules| rules.in_scan(first, registry)).transpose()?;
    let asks = |of: fn(&CompareRules) -> bool| accept.as_ref().is_some_and(of);
    let measures = settings.distances || asks(CompareRules::measures);
    let has_normals = settings.normals || asks(CompareRules::is_on_normals);
    let depth = depth.or_else(|| asks(CompareRules::is_on_depth).then_some(DEPTH_SEEN));
    let paths = [first, second];
    let looked = looked_at(*noise, *withheld);
    let records = compare_records(paths, &looked, run, registry, watch)?;
    let run = RunSettings {
        noise: Some(noise.unwrap_or(Treatment::Drop)),
        withheld: withheld.unwrap_or(Treatment::Drop),
        ..run.clone()
    };
    let looked = looked_at(run.noise, Some(run.withheld));
    let clouds = || cloud_distances(paths, (&looked, has_normals), &run, registry, watch);
    let clouds = (measures || has_normals).then(clouds).transpose()?;
    let (distances, normals) = clouds
        .map_or((None, None), |(distances, normals)| (measures.then_some(distances), normals));
    let seen = |(axis, pixels): (Axis, usize)| {
        let settings = DepthSettings { axis, pixels, run: run.clone() };
        depth_errors(first, second, &settings, registry, watch)
    };
    let depth = depth.map(seen).transpose()?;
    let all = Judged {
        records: &records,
        distances: distances.as_ref(),
        normals: normals.as_ref(),
        depth: depth.as_ref(),
    };
    let accept = accept.map(|rules| rules.judge(&all));
    Ok(ScanComparison { records, distances, normals, depth, accept })
}

impl fmt::Display for ScanComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.records.fmt(f)?;
        if let Some(distances) = &self.distances {
            write!(f, "\n{distances}")?;
        }
        if let Some(normals) = &self.normals {
            write!(f, "\n{normals}")?;
        }
        if let Some(depth) = &self.depth {
            write!(f, "\n{depth}")?;
        }
        if let Some(accept) = &self.accept {
            write!(f, "\n{accept}")?;
        }
        Ok(())
    }
}
