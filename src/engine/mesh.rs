//! An output whose points are connected: the Delaunay triangulation of what is left, over a plane,
//! of scans that are larger than memory.
//!
//! Triangulating a scan piece by piece leaves seams, and joining the pieces needs all of them at
//! once. But a triangle is one of the whole scan if its circle holds no other point, and where
//! radii are bounded, that is seen from near by: a piece with a rim of two radii proves every
//! triangle that has its first corner in the piece (`mesh/columns.rs`). So pieces are triangulated
//! by themselves, each triangle is written by the one piece that has its first corner, and the rest
//! of what a piece found in its rim is dropped. Without a bound there is one piece, and the
//! memory must do for it.
//!
//! Places are whole steps of the lattice, so that circles are compared exactly; where more than
//! three places share one, `geom/delaunay.rs` has one polygon of them whoever looks. Of positions
//! above each other the Morton-first is a corner.
//!
//! Points are in the output before: the mill wrote them in canonical order, and their numbers there
//! are counted from states (`tile/numbered.rs`).

mod columns;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::grind::DecodedScan;
use super::job::Job;
use super::outlet::{A_THREAD, Outlet, finished};
use super::shares::MILL_SPARE;
use crate::budget::{Bytes, Lease, whole_mebibytes};
use crate::geom::delaunay::{Delaunay, WIDEST};
use crate::geom::morton::plane_morton_cmp;
use crate::host::process::resident_now;
use crate::point::{Bounds, Position};
use crate::report::{Grouped, Tally};
use crate::stage::{EncodeTriangles, Encoded, Lattice, Sink, SinkSummary, Triangle, Triangulation};
use crate::store::Pieces;
use crate::tile::{NumberedPositions, NumberedReader};
use crate::{Error, Result};

use columns::{PlaneSquare, SquareCut, across, cut};

/// Positions of a square with its rim, about, where the memory does for more: a triangulation that
/// leaves the caches takes longer for each.
const SQUARE: u64 = 1 << 18;
/// Triangles that are encoded at once.
const AT_ONCE: usize = 1 << 14;
/// Bytes of an encoded triangle at most: three numbers as text.
const ENCODED: usize = 3 * 21 + 3;

/// Bytes that a thread holds for each position of a square and its rim.
const EACH: usize = size_of::<PlanePlace>() + Delaunay::BYTES + 2 * size_of::<[u32; 3]>();

/// Bytes that a thread holds besides.
fn besides() -> Bytes {
    let waiting = Bytes::from(ENCODED) * (1 + A_THREAD);
    (Bytes::from(size_of::<Triangle>()) + waiting) * AT_ONCE as u64
}

/// Bytes that a mesh of so many positions needs in memory where no radius bounds its triangles.
pub(crate) fn whole_mesh_bytes(positions: u64) -> Bytes {
    Bytes::of(positions, EACH) + besides() + MILL_SPARE
}

/// What is connected, and how.
pub(super) struct MeshScan<'a> {
    job: &'a Job<'a>,
    lattice: &'a Lattice,
    scan: NumberedPositions,
    shape: Triangulation,
}

/// A place in the plane.
#[derive(Debug, Clone, Copy)]
struct PlanePlace {
    at: [i64; 2],
    height: i64,
    /// The number of its record in the output.
    number: u64,
}

/// What a square came to.
#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Connected {
    corners: u64,
    covered: u64,
    triangles: u64,
}

/// Connects the points of the scan that take part in it by `states` and that `sink` was given, and
/// finishes it.
pub(crate) fn connect(
    job: &Job<'_>,
    field: &DecodedScan<'_>,
    states: Option<Arc<Pieces>>,
    shape: Triangulation,
    mut sink: Box<dyn Sink>,
) -> Result<(SinkSummary, Tally)> {
    let blocks = Bytes::of(field.tiles.blocks() as u64, NumberedPositions::BYTES_PER_BLOCK);
    let _numbers = job.budget.lease(blocks.0, "numbers of a mesh's points")?;
    let scan = NumberedPositions::new(&field.tiles, states, || job.advance(0))?;
    let mesh = MeshScan { job, lattice: field.lattice, scan, shape };
    let (squares, threads, _held) = mesh.cut()?;
    let encoder = sink.triangles()?;
    let commit = |encoded: Encoded| Ok(vec![encoded]);
    let encode = |encoded: Encoded| Ok((0, encoded));
    let threads = job.threads.at_most(threads);
    let outlet = Outlet::new(vec![sink], threads.count(), &commit);
    let mut all = Connected::default();
    threads.items(squares.len(), || outlet.stop()).run(
        || SquareWorker::new(&mesh, &*encoder),
        |worker, number| {
            let connected = worker.connect(&squares[number], |part, encoded, is_last| {
                outlet.deliver((number as u64, part), encoded, is_last, &mut { encode })
            })?;
            job.advance(connected.corners + connected.covered)?;
            Ok(connected)
        },
        |connected: Connected| all.add(&connected),
        |_| outlet.drain(squares.len(), &mut { encode }),
    )?;
    mesh.tell_empty(&all);
    let said = finished(outlet.close(Vec::new(), &mut { encode })?)?;
    let mut tally = Tally::default();
    tally.count("corners", all.corners);
    tally.count("covered", all.covered);
    tally.count("triangles", all.triangles);
    let said = said.into_iter().next();
    Ok((said.ok_or_else(|| Error::internal("a mesh said nothing"))?, tally))
}

impl Connected {
    fn add(&mut self, other: &Connected) {
        self.corners += other.corners;
        self.covered += other.covered;
        self.triangles += other.triangles;
    }
}

impl MeshScan<'_> {
    /// The largest radius in steps.
    fn radius(&self) -> Option<f64> {
        self.shape.max_radius.map(|radius| radius / self.lattice.step)
    }

    /// What must be known around a square: two radii, and what their rounding may leave out.
    fn rim(&self) -> Option<i64> {
        self.radius().map(|radius| (2.0 * radius * (1.0 + 1e-9)).min(4e18) as i64 + 2)
    }

    /// Warns of a mesh without a triangle.
    fn tell_empty(&self, all: &Connected) {
        if all.triangles > 0 || all.corners == 0 {
            return;
        }
        self.job.warn(match self.shape.max_radius {
            Some(radius) if all.corners > 2 => format!(
                "the mesh is empty: no triangle has a circle within `mesh.max_radius = {radius}`"
            ),
            _ => "the mesh is empty: all points lie on one line across its axis".to_owned(),
        });
    }

    /// The squares, and how many threads have memory for one.
    fn cut(&self) -> Result<(Vec<PlaneSquare>, usize, Vec<Lease>)> {
        let job = self.job;
        let wanted = job.task.tile_points().map_or(SQUARE, |points| points as u64);
        // Arenas that are given back stay with the process for a while, in pieces that are too
        // small for what is allocated here.
        let held = resident_now().map_or(0, |now| now.saturating_sub(job.budget.used()));
        let retained = Bytes(held.min(job.task.demands.retained(&job.shares).0));
        let mut heaviest = 0;
        for threads in (1..=job.threads.count()).rev() {
            let besides = besides() * threads as u64 + MILL_SPARE;
            let free = job.budget.free().saturating_sub((besides + retained).0);
            let most = free / threads as u64 / EACH as u64;
            let (axis, numbers) = (self.shape.axis, [wanted.min(most), most]);
            let SquareCut { squares, heaviest: found } =
                cut(&self.scan, axis, self.rim(), numbers)?;
            heaviest = found;
            let threads = threads.min(squares.len().max(1));
            if Bytes::of(found, EACH * threads).fit(free) {
                let listed = Bytes::of(squares.len() as u64, size_of::<PlaneSquare>());
                let working = Bytes::of(found, EACH * threads) + besides;
                let leases = [(listed, "list of squares"), (working, "triangulation")];
                let leases = leases.map(|(bytes, what)| job.budget.lease(bytes.0, what));
                return Ok((squares, threads, leases.into_iter().collect::<Result<_>>()?));
            }
        }
        let enough =
            whole_mebibytes(job.task.demands.limit_behind_mill(whole_mesh_bytes(heaviest)));
        let positions = Grouped(heaviest);
        Err(match self.shape.max_radius {
            None => Error::memory(format!(
                "a mesh whose triangles may be of any size is drawn in memory at once, and the \
                 memory does not do for {positions} positions"
            ))
            .help(format!(
                "give `run.memory = \"{enough}\"`, or `mesh.max_radius`: about three spacings of \
                 the points"
            )),
            Some(radius) => Error::memory(format!(
                "the memory does not do for the {positions} positions that lie within two radii \
                 of `mesh.max_radius = {radius}` around one place"
            ))
            .help(format!("give `run.memory = \"{enough}\"`, or a smaller `mesh.max_radius`")),
        })
    }
}

/// What a thread needs to connect the points of squares.
struct SquareWorker<'a> {
    mesh: &'a MeshScan<'a>,
    encoder: &'a dyn EncodeTriangles,
    reader: NumberedReader,
    places: Vec<PlanePlace>,
    fans: Vec<[u32; 3]>,
    triangles: Vec<Triangle>,
}

impl<'a> SquareWorker<'a> {
    fn new(mesh: &'a MeshScan<'a>, encoder: &'a dyn EncodeTriangles) -> Self {
        SquareWorker {
            mesh,
            encoder,
            reader: NumberedReader::default(),
            places: Vec::new(),
            fans: Vec::new(),
            triangles: Vec::new(),
        }
    }

    /// Draws the triangles of a square and hands them over, in parts.
    fn connect(
        &mut self,
        square: &PlaneSquare,
        mut deliver: impl FnMut(u64, Encoded, bool) -> Result<()>,
    ) -> Result<Connected> {
        let region = self.load(square)?;
        let loaded = square.stretch_of(&self.places, |place| place.at).len();
        self.places.dedup_by_key(|place| place.at);
        let mine = square.stretch_of(&self.places, |place| place.at);
        let corner = across(region.lo, self.mesh.shape.axis);
        let relative = |place: &PlanePlace| [0, 1].map(|n| place.at[n].abs_diff(corner[n]) as f64);
        let fans = &mut self.fans;
        fans.clear();
        let job = self.mesh.job;
        let places = self.places.iter().map(relative);
        Delaunay::of(places, || job.advance(0))?.each_polygon(&mine, self.mesh.radius(), |ring| {
            let [first, rest @ ..] = ring else { return };
            fans.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        });
        // Polygons come as the triangulation has them; this is the order of their corners.
        fans.sort_unstable();
        let parts = self.fans.len().div_ceil(AT_ONCE).max(1);
        for part in 0..parts {
            let until = self.fans.len().min((part + 1) * AT_ONCE);
            self.triangles.clear();
            for corners in &self.fans[part * AT_ONCE..until] {
                let corners = corners.map(|n| self.places[n as usize]);
                let places = corners.map(|place| self.mesh.world(&place));
                self.triangles
                    .push(Triangle { corners: corners.map(|place| place.number), places });
            }
            deliver(part as u64, self.encoder.encode(&self.triangles)?, part + 1 == parts)?;
        }
        let corners = mine.len() as u64;
        let covered = loaded as u64 - corners;
        Ok(Connected { corners, covered, triangles: self.fans.len() as u64 })
    }

    /// Loads a square with its rim, in Morton order of the plane, of places that are one the
    /// Morton-first before the others; the box that they are in.
    fn load(&mut self, square: &PlaneSquare) -> Result<Bounds> {
        let (scan, axis) = (&self.mesh.scan, self.mesh.shape.axis);
        let bounds = scan.bounds();
        let region = match self.mesh.rim() {
            Some(rim) => bounds.common(&square.column(&bounds, axis).grown(rim)),
            None => bounds,
        };
        let [u, v] = across([0, 1, 2].map(|axis| axis as i64), axis);
        if let Some(&wide) = region
            .extent()
            .iter()
            .max()
            .filter(|_| [u, v].iter().any(|&axis| region.extent()[axis as usize] >= WIDEST))
        {
            let told = format!("a mesh cannot reach over {} steps of the lattice", Grouped(wide));
            return Err(Error::memory(told).help("give a coarser `run.lattice`"));
        }
        self.places.clear();
        let places = &mut self.places;
        scan.each(&region, &mut self.reader, |p, number| {
            places.push(PlanePlace { at: across(p, axis), height: p[axis], number });
        })?;
        places.sort_unstable_by(|a, b| plane_morton_cmp(a.at, b.at).then(a.height.cmp(&b.height)));
        Ok(region)
    }
}

impl MeshScan<'_> {
    fn world(&self, place: &PlanePlace) -> [f64; 3] {
        let axis = self.shape.axis;
        let mut position: Position = [0; 3];
        position[axis] = place.height;
        position[(axis + 1) % 3] = place.at[0];
        position[(axis + 2) % 3] = place.at[1];
        self.lattice.world(position)
    }
}
