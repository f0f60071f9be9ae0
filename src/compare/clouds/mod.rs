//! How far the points of two scans are from each other, both ways: from the nearest point, and from
//! the plane of the nearest ones; and what angles their normals have. Exact, and out of core: both
//! scans are sorted as a run sorts its own, and what does not fit in memory goes into scratch
//! files.

mod angles;
mod measured;
mod normals;
mod sealed;
mod told;
mod walk;

use std::sync::Arc;

use crate::budget::{Budget, Bytes};
use crate::compare::same::{open, step_of};
use crate::engine::Watch;
use crate::engine::scratch::{Scratch, Trouble, memory_warning};
use crate::geom::simd::Simd;
use crate::graph::{MixedUnits, RunSettings, SpillSetting};
use crate::host::process::{default_memory, processors, resident_now};
use crate::host::{Threads, lock};
use crate::language::Registry;
use crate::point::{Selection, Units};
use crate::stage::{BATCH, Lattice, Source};
use crate::store::{Intake, Pieces, SealedTiles, SpillArea, ref_bytes};
use crate::{Error, ErrorKind, Result};
use normals::RecordNormals;
use sealed::{Placing, SealSettings, stride};
use walk::{CloudWalk, MeasuredCloud, STRETCH, WalkArena};

pub use angles::{NormalAngles, NormalDirection};
pub use told::{CloudDirection, CloudDistances, CloudFigures};

/// Bytes of what the process and each of its threads hold besides what is leased.
const PROCESS: u64 = 6 << 20;
const THREAD: u64 = 3 << 20;
/// Records that a thread sorts at once, at least and at most.
const RUN_RECORDS: [u64; 2] = [16_384, 1 << 19];

/// Measures how far two scans are from each other, but for the points of a selection that is left
/// out; and the angles between their normals, if these are to be compared.
pub(super) fn cloud_distances(
    paths: [&[String]; 2],
    (left_out, has_normals): (&Selection, bool),
    run: &RunSettings,
    registry: &Registry,
    watch: &dyn Watch,
) -> Result<(CloudDistances, Option<NormalAngles>)> {
    let sources = [open(paths[0], registry)?.open()?, open(paths[1], registry)?.open()?];
    let nothing = sources
        .iter()
        .zip(paths)
        .find(|(source, _)| has_normals && RecordNormals::of(source.schema()).is_none());
    if let Some((_, paths)) = nothing {
        return Err(without_normals(paths));
    }
    let units = [&sources[0].metadata().units, &sources[1].metadata().units];
    if run.units == MixedUnits::Refuse {
        refuse_units(units)?;
    }
    let trouble = Trouble::default();
    let threads = run.threads.map_or_else(processors, usize::from);
    let outcome = Threads::start(threads, |threads| {
        measure(&sources, (left_out, has_normals), run, threads, &trouble, watch)
    });
    lock(&trouble).iter().for_each(|told| watch.warn(told));
    let sign = units[0].sign();
    outcome.map(|(distances, normals)| (CloudDistances { unit: sign, ..distances }, normals))
}

/// Refuses scans of which one has no normals.
fn without_normals(paths: &[String]) -> Error {
    let told = "the scan has no normals (NormalX, NormalY and NormalZ) to compare";
    let error = Error::new(ErrorKind::Data, told);
    let error = match paths {
        [path] => error.at(path),
        _ => error,
    };
    error.help(
        "compute them: `pointmill run 'read scan.laz ! normals ! write with-normals.laz \
         dimensions=[NormalX,NormalY,NormalZ]'`",
    )
}

/// Refuses scans between which a distance means nothing.
fn refuse_units(units: [&Units; 2]) -> Result<()> {
    let mismatch = units.iter().find_map(|units| units.mismatch());
    let told = match (mismatch, units.map(|units| units.horizontal)) {
        (Some(mismatch), _) => mismatch.message,
        (None, [Some(a), Some(b)]) if a != b => {
            "the two scans are in different units: a distance mixes them".to_owned()
        }
        _ => return Ok(()),
    };
    Err(Error::new(ErrorKind::Data, told).help("bring both scans to one unit first"))
}

fn measure(
    sources: &[Box<dyn Source>; 2],
    (left_out, has_normals): (&Selection, bool),
    run: &RunSettings,
    threads: Threads<'_>,
    trouble: &Trouble,
    watch: &dyn Watch,
) -> Result<(CloudDistances, Option<NormalAngles>)> {
    let schemas = [sources[0].schema(), sources[1].schema()];
    let placing = Placing::of(schemas, run.lattice)?;
    let budget = Budget::new(run.memory.unwrap_or_else(default_memory));
    let base = resident_now().unwrap_or(0) + PROCESS + THREAD * threads.count() as u64;
    let _base = budget.lease(base, "program")?;
    let shares = CloudShares::of(&budget, sources, threads.count(), has_normals);
    let kept = if run.spill == SpillSetting::Always { 0 } else { shares.kept };
    let folder = run.scratch.clone().unwrap_or_else(std::env::temp_dir);
    let scratch = Arc::new(Scratch::below(&folder, trouble));
    let area = SpillArea::new(budget.clone(), kept, Box::new(scratch));
    let sealing = SealSettings {
        placing: &placing,
        left_out,
        has_normals,
        nonfinite: run.nonfinite,
        run_records: shares.run_records,
        area: &area,
        budget: &budget,
        threads,
        watch,
    };
    let seal = |side: usize| {
        sealing.seal(&*sources[side], budget.lease(shares.sorting, "sorting of records")?)
    };
    let clouds = [seal(0)?, seal(1)?];
    let walking = WalkArena::bytes(has_normals) * threads.count() as u64;
    let _walking = budget.lease(walking, "search")?;
    let simd = run.simd.resolve()?;
    let [first, second] = [(0, 1), (1, 0)].map(|(asking, asked)| {
        let walk = CloudWalk { asking: &clouds[asking], asked: &clouds[asked] };
        walked(&walk, threads, (simd, has_normals), watch)
    });
    memory_warning(&folder, area.written()).iter().for_each(|told| watch.warn(told));
    let (first, second) = (first?, second?);
    let told_to = step_of([schemas[0], schemas[1]]);
    let distances = CloudDistances { told_to, ..told(&first, &second, placing.lattice()) };
    let angles = |one: &MeasuredCloud| {
        one.normals.as_ref().map(|normals| NormalDirection::of(normals, placing.lattice()))
    };
    let normals = has_normals.then(|| NormalAngles {
        first_to_second: angles(&first),
        second_to_first: angles(&second),
        told_to,
    });
    Ok((distances, normals))
}

fn told(first: &MeasuredCloud, second: &MeasuredCloud, lattice: &Lattice) -> CloudDistances {
    let first_to_second = CloudDirection::of(first, lattice);
    let second_to_first = CloudDirection::of(second, lattice);
    let largest = |direction: Option<CloudDirection>| direction.map(|one| one.nearest.max);
    let both = largest(first_to_second).zip(largest(second_to_first));
    CloudDistances {
        first_to_second,
        second_to_first,
        hausdorff: both.map(|(a, b)| a.max(b)),
        unit: None,
        step: lattice.step,
        told_to: lattice.step,
    }
}

/// The distances of all points that ask, stretch by stretch.
fn walked(
    walk: &CloudWalk<'_>,
    threads: Threads<'_>,
    (simd, has_normals): (Simd, bool),
    watch: &dyn Watch,
) -> Result<MeasuredCloud> {
    let (blocks, mut all) = (walk.asking.blocks(), MeasuredCloud::default());
    if walk.asked.positions() == 0 {
        return Ok(all);
    }
    watch.phase("measure", Some(walk.asking.positions()));
    let of_threads = threads.items(blocks.div_ceil(STRETCH), || {}).run(
        || WalkArena::with(simd, has_normals),
        |arena, number| {
            if watch.cancelled() {
                return Err(Error::interrupted());
            }
            let stretch = number * STRETCH..((number + 1) * STRETCH).min(blocks);
            let positions = stretch.clone().map(|block| walk.asking.block(block).len() as u64);
            watch.advance(positions.sum());
            walk.measure(stretch, arena)
        },
        |()| (),
        |arena| Ok(arena.all()),
    )?;
    of_threads.iter().for_each(|one| all.merge(one));
    Ok(all)
}

/// What the memory is divided into.
struct CloudShares {
    /// Records that a thread sorts at once, and bytes that all take for it.
    run_records: usize,
    sorting: u64,
    /// Bytes of the scans that stay in memory.
    kept: u64,
}

impl CloudShares {
    fn of(
        budget: &Budget,
        sources: &[Box<dyn Source>; 2],
        threads: usize,
        has_normals: bool,
    ) -> CloudShares {
        let stride = stride(has_normals);
        let points = [sources[0].points(), sources[1].points()];
        let free = budget.free();
        let largest = points[0].max(points[1]);
        let reading = sources
            .iter()
            .map(|source| source.part_bytes() + (BATCH * (source.schema().stride + 64)) as u64);
        let reading = reading.max().unwrap_or(0);
        let fixed = Intake::fixed_bytes(stride).0 + reading;
        let each = Intake::bytes_per_record(stride, false, false).0.max(1);
        let [fewest, most] = RUN_RECORDS;
        let share = (free / 4 / threads as u64).saturating_sub(fixed) / each;
        let run_records = share.min(most.max(largest / 64)).max(fewest);
        let sorting = (fixed + run_records * each) * threads as u64;
        let tables = |points: u64| {
            SealedTiles::index_bytes(points)
                + Pieces::table_bytes(points, stride)
                + Pieces::table_bytes(points, ref_bytes(false))
        };
        // The index of the runs and that of the merged scan exist side by side for a moment.
        let held = tables(points[0]) + tables(points[1]) + SealedTiles::index_bytes(largest);
        let walking = WalkArena::bytes(has_normals) * threads as u64;
        let working = Bytes(sorting.max(walking) + free / 16);
        let kept = free.saturating_sub((held + working).0);
        CloudShares { run_records: run_records as usize, sorting, kept }
    }
}
