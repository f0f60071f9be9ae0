//! The check of a reduced scan beside its original.

use std::sync::{Arc, Mutex};

use super::meet::MeetRecords;
use super::records::Comparison;
use super::reduced::Reduced;
use super::surface::{MeasureSurface, SurfaceMeasured};
use super::verdict::{DistanceFigures, ForeignRecord, Verification};
use crate::engine::Watch;
use crate::graph::{Graph, Overrides, RunSettings};
use crate::host::lock;
use crate::host::process::default_memory;
use crate::io::ends::{Discard, Read};
use crate::language::Registry;
use crate::quantity::Length;
use crate::stage::Role;
use crate::{Error, Result};

/// What is asked of a reduced scan.
#[derive(Debug, Clone, Default)]
pub struct VerifySettings {
    /// How far from the surface of the kept points no removed position may be.
    pub tolerance: Option<Length>,
    /// How far from the nearest kept point no removed position may be. Points farther away than
    /// four times that play no part in the surface.
    pub max_spacing: Option<Length>,
    /// Memory, threads, scratch folder; and which points of the original are not to be measured,
    /// being noise or withheld.
    pub run: RunSettings,
}

/// Checks that `reduced` is a reduction of the scans `original`: whether every record of it is one
/// of theirs, byte for byte where both have the same fields and by the values of the fields of both
/// else, and as often at most; and how far each position that it does not have is from the surface
/// of those that it has.
///
/// The surface at a position is the least-squares plane of its 8 nearest kept points, and all that
/// are as near as the eighth; where fewer than 5 are there, or they are almost on a line, the
/// nearest point. Kept points of `KeepRank` 65535 are exceptions, and no part of it. The files are
/// all that is looked at: how the reduction was made plays no part. The reduced scan is held in
/// memory, the original is not.
///
/// ```
/// use pointmill::compare::{VerifySettings, verify};
/// use pointmill::{Graph, Overrides, Quiet, Registry};
///
/// let at = std::env::temp_dir().join(format!("pointmill-verify-{}", std::process::id()));
/// std::fs::create_dir_all(&at)?;
/// let path = |name: &str| at.join(name).to_str().unwrap().to_owned();
/// let (scan, thin) = (path("scan.las"), path("thin.las"));
/// let registry = Registry::builtin();
/// for line in [
///     format!("synth scene=part points=2000 ! write path=\"{scan}\""),
///     format!("read path=\"{scan}\" ! graded keep=200 ! write path=\"{thin}\""),
/// ] {
///     Graph::parse_line(&line, &registry)?.plan(&Overrides::default())?.run(&Quiet)?;
/// }
/// let verdict = verify(&[scan], &thin, &VerifySettings::default(), &registry, &Quiet)?;
/// assert!(verdict.holds());
/// assert_eq!((verdict.reduced, verdict.foreign), (200, 0));
/// std::fs::remove_dir_all(&at)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// Files that cannot be read, lengths in a unit that the scan does not tell, and a memory that does
/// not do.
pub fn verify(
    original: &[String],
    reduced: &str,
    settings: &VerifySettings,
    registry: &Registry,
    watch: &dyn Watch,
) -> Result<Verification> {
    let read = |path: &[String]| {
        Read { path: path.to_vec(), ..Read::default() }.source(registry.formats())
    };
    let (open, thin) = (read(original)?, read(&[reduced.to_owned()])?.open()?);
    let schema = open.open()?.schema().clone();
    let comparison = Comparison::of(&schema, thin.schema());
    let memory = settings.run.memory.unwrap_or_else(default_memory);
    Reduced::check_memory(thin.points(), memory)?;
    let kept = Arc::new(Reduced::read(&*thin, &comparison)?);
    let measured = Arc::new(Mutex::new(SurfaceMeasured::default()));
    let surface = MeasureSurface {
        reduced: kept.clone(),
        tolerance: settings.tolerance,
        max_spacing: settings.max_spacing,
        measured: measured.clone(),
        known: None,
    };
    let met = MeetRecords { reduced: kept.clone(), original: comparison.original.clone() };
    let held = Reduced::bytes(thin.points()).0;
    let run = RunSettings { memory: Some(memory - held), ..settings.run.clone() };
    let mut graph = Graph::new(run);
    graph.traits.skips_survey = true;
    let source = graph.add("read", Role::Source(open), &[]);
    let records = graph.add("records", Role::Transform(Box::new(met)), &[source]);
    let stage = graph.add("verify", Role::TileOp(Box::new(surface)), &[records]);
    graph.add("discard", Role::Sink(Box::new(Discard {})), &[stage]);
    let done = graph.plan(&Overrides::default())?.run(watch)?;
    let foreign = kept.foreign(&*thin, &comparison)?;
    let measured = lock(&measured).clone();
    let unplaced = || Error::internal("a check ended before it began");
    let lattice = measured.lattice.as_ref().ok_or_else(unplaced)?;
    let exceptions = kept.points.iter().filter(|(_, is_surface)| !is_surface).count() as u64;
    Ok(Verification {
        original: done.report.result.ledger.kept,
        reduced: thin.points(),
        exceptions,
        foreign: foreign.count,
        foreign_synthetic: foreign.synthetic,
        first_foreign: foreign.first.map(|(number, at)| ForeignRecord { number, at }),
        not_compared: comparison.left_out,
        surface: DistanceFigures::of(&measured.surface, lattice),
        coverage: DistanceFigures::of(&measured.nearest, lattice),
        tolerance: measured.tolerance,
        beyond_tolerance: measured.beyond,
        max_spacing: measured.max_spacing,
        beyond_spacing: measured.apart,
        unit: thin.metadata().units.sign(),
        step: lattice.step,
    })
}
