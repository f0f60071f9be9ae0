//! Outputs whose points are connected, fitted to the stages above them and to the memory.

use super::sorted::{Sorted, blame};
use crate::Result;
use crate::budget::Bytes;
use crate::engine::mesh::whole_mesh_bytes;
use crate::engine::pass::StreamOp;
use crate::point::names::XYZ;
use crate::stage::{Source, Triangulation};

/// For each sink, how its points are connected; refuses one behind a stage that moves points, which
/// `changed_by` has among those that stream above it: places are those of the scan as it was read.
pub(super) fn triangulations(
    source: &dyn Source,
    sorted: &Sorted,
    changed_by: &[Vec<usize>],
) -> Result<Vec<Option<Triangulation>>> {
    let units = source.metadata().units;
    let each = sorted.sinks.iter().zip(&sorted.endings).zip(changed_by);
    let fitted = each.map(|((sink, written), changed_by)| {
        let shape = sink.triangulation(&units).map_err(|error| blame(&**written, error))?;
        let moves =
            |filter: &&StreamOp| filter.changes().iter().any(|name| XYZ.contains(&name.as_str()));
        let mover = changed_by.iter().map(|&filter| &sorted.filters[filter]).find(moves);
        match mover.filter(|_| shape.is_some()) {
            None => Ok(shape),
            Some(mover) => {
                let mover = &mover.kind;
                let told = format!(
                    "`mesh` connects points where they were read, and `{mover}` moves them"
                );
                let help = format!("let a second run read what `{mover}` leaves");
                Err(written.wrong(told).help(help))
            }
        }
    });
    fitted.collect()
}

/// Bytes of the largest mesh that is drawn at once, where that is known: if a stage removes points,
/// it is known when it has.
pub(super) fn connected(sorted: &Sorted, source: &dyn Source) -> Bytes {
    let streams = sorted.transforms.iter().chain(&sorted.filters);
    let mut needs = streams
        .map(|stage| stage.transform.needs())
        .chain(sorted.ops.iter().map(|stage| stage.op.tile().needs()));
    let removes = needs.any(|needs| needs.removes || needs.mark.is_some());
    let units = source.metadata().units;
    // What is wrong with a mesh is told by `triangulations`.
    let mut meshes = sorted.sinks.iter().filter_map(|sink| sink.triangulation(&units).ok()?);
    match meshes.any(|mesh| mesh.max_radius.is_none()) && !removes {
        true => whole_mesh_bytes(source.points()),
        false => Bytes(0),
    }
}
