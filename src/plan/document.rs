//! A plan as JSON, for programs: what its text says, under keys that stay.

use serde_json::{Value, json};

use super::fitted::Plan;
use super::outline::Outline;
use crate::engine::pass::{Call, Pass, StageOp, StreamOp, needs};
use crate::expression::Choice;
use crate::geom::lattice::Lattice;

impl Plan {
    /// What the plan's text says, for programs: a JSON object that `docs/formats.md` describes.
    pub fn to_json(&self) -> Value {
        let Outline { inputs, points, report, threads, memory_bytes, scratch, .. } = self.outline();
        let lattice = self.task.lattice.as_ref();
        let units = (!self.ops.is_empty()).then(|| self.task.source.metadata().units.words());
        // What streams has none that anybody should know of.
        let is_stream = self.ops.is_empty() && self.task.filters.is_empty();
        let passes = self.task.passes.iter().filter(|_| !is_stream);
        json!({
            "source": { "kind": self.task.source_kind, "files": inputs, "points": points },
            "streams": self.task.transforms.iter().map(streamed).collect::<Value>(),
            "passes": passes.map(|pass| self.pass(pass)).collect::<Value>(),
            "outputs": self.sinks(&(0..self.task.sinks.len()).collect::<Vec<_>>()),
            "report": report,
            "units": units,
            "lattice_step": lattice.map(|lattice| lattice.step),
            "z_scale": lattice.map(Lattice::z_scale),
            "order": if self.task.mills { "canonical" } else { "input" },
            "threads": threads,
            "memory_bytes": memory_bytes,
            "shares": self.shares(),
            "scratch_folder": scratch,
            "warnings": self.warnings(),
        })
    }

    /// How the memory is divided; null for a stream, which has no need to.
    fn shares(&self) -> Value {
        match self.task.demands.divide() {
            Ok(shares) if self.task.mills => json!({
                "program_bytes": shares.base,
                "index_bytes": shares.index,
                "work_bytes": shares.work,
                "kept_points_bytes": shares.kept_in_memory,
                "run_records": shares.run_records,
                "tile_positions": shares.tile_positions,
            }),
            _ => Value::Null,
        }
    }

    fn sinks(&self, sinks: &[usize]) -> Value {
        sinks.iter().map(|&sink| json!(self.task.sinks[sink].path())).collect()
    }

    fn pass(&self, pass: &Pass) -> Value {
        let filters = pass.filters.iter().map(|&filter| streamed(&self.task.filters[filter]));
        let chooses = pass.chooses.map(|op| {
            let StageOp { kind, limits, .. } = &self.ops[op];
            json!({ "kind": kind, "limited_to": limited_to(&limits.choice) })
        });
        json!({
            "behind": pass.behind.map(|pass| pass + 1),
            "round": pass.round.max(1),
            "outputs_before": self.sinks(&pass.before),
            "stages": pass.calls.iter().map(|&call| self.call(call)).collect::<Value>(),
            "streams": filters.collect::<Value>(),
            "chooses_for": chooses,
            "outputs": self.sinks(&pass.after),
        })
    }

    fn call(&self, call: Call) -> Value {
        let (stage, needs) = (&self.ops[call.op], needs(&self.ops, call));
        json!({
            "kind": stage.kind,
            "gathers": call.gathers,
            "reads": needs.read_names(),
            "writes": needs.written_names(),
            "neighbors": needs.neighbors,
            "removes": needs.removes,
            "marks": needs.mark.is_some(),
            "limited_to": limited_to(&stage.limits.choice),
        })
    }
}

fn streamed(StreamOp { kind, choice, .. }: &StreamOp) -> Value {
    json!({ "kind": kind, "limited_to": limited_to(choice) })
}

/// The points that a stage is limited to, in words; null for all.
fn limited_to(choice: &Choice) -> Value {
    if choice.is_all() { Value::Null } else { choice.to_string().into() }
}
