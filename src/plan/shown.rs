//! A plan as text: what a run would do and what it would use.

use std::fmt;

use super::fitted::Plan;
use crate::budget::Bytes;
use crate::engine::pass::{Call, Pass, StageOp, StreamOp, needs};
use crate::error::shown;
use crate::expression::Choice;
use crate::quantity::Figure;

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "source   {} ({} files, {} points by their headers)",
            self.task.source_kind,
            self.task.source.inputs().len(),
            self.task.source.points()
        )?;
        for StreamOp { kind, choice, .. } in &self.task.transforms {
            write!(f, "streams  {kind}")?;
            limits_shown(f, choice)?;
        }
        match self.ops.is_empty() && self.task.filters.is_empty() {
            true => self.task.sinks.iter().try_for_each(|sink| sink_line(f, sink.path()))?,
            false => self.passes_shown(f)?,
        }
        if !self.ops.is_empty() {
            self.units_shown(f)?;
        }
        match &self.task.lattice {
            Some(lattice) => {
                write!(f, "lattice  step {} world units", lattice.step)?;
                if lattice.z_scale() != 1.0 {
                    write!(f, ", z times {}", Figure(lattice.z_scale()))?;
                }
                writeln!(f)?;
            }
            None => writeln!(f, "lattice  none: records stream by as they are")?,
        }
        writeln!(f, "order    {}", if self.task.mills { "canonical" } else { "of the input" })?;
        writeln!(f, "threads  {}", self.task.threads)?;
        self.memory(f)
    }
}

fn sink_line(f: &mut fmt::Formatter<'_>, path: &std::path::Path) -> fmt::Result {
    writeln!(f, "sink     {}", shown(path))
}

/// Ends a line with the records that a stage is limited to.
fn limits_shown(f: &mut fmt::Formatter<'_>, choice: &Choice) -> fmt::Result {
    match choice.is_all() {
        true => writeln!(f),
        false => writeln!(f, ", of points {choice}"),
    }
}

impl Plan {
    fn units_shown(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let units = self.task.source.metadata().units;
        write!(f, "units    {}", units.words())?;
        match units.vertical {
            None if units.mismatch().is_none() => {
                writeln!(f, ": z is taken to be in that of x and y")?;
            }
            _ => writeln!(f)?,
        }
        // What lengths in a unit of their own are here.
        for (stage, given) in self.ops.iter().zip(&self.task.given) {
            let lengths = stage.op.tile().lengths();
            for (key, text) in given {
                let Some((_, length)) = lengths.iter().find(|(named, _)| named == key) else {
                    continue;
                };
                let sign = units.sign().map_or(String::new(), |sign| format!(" {sign}"));
                writeln!(f, "length   {key} = {text} is {}{sign}", Figure(length.value()))?;
            }
        }
        Ok(())
    }

    fn passes_shown(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, pass) in self.task.passes.iter().enumerate() {
            let sinks = |f: &mut fmt::Formatter<'_>, which: &[usize]| {
                which.iter().try_for_each(|&sink| sink_line(f, self.task.sinks[sink].path()))
            };
            let label = format!("pass {}", n + 1);
            sinks(f, &pass.before)?;
            if pass.behind != n.checked_sub(1) {
                let from = pass.behind.map_or("the scan".into(), |n| format!("pass {}", n + 1));
                writeln!(f, "         again from what {from} left")?;
            }
            for (i, &call) in pass.calls.iter().enumerate() {
                write!(f, "{:<8} ", if i == 0 { &label } else { "" })?;
                self.call_shown(f, pass, call)?;
            }
            for &filter in &pass.filters {
                let filter = &self.task.filters[filter];
                write!(f, "{label:<8} {} of what is left", filter.kind)?;
                limits_shown(f, &filter.choice)?;
            }
            if let Some(op) = pass.chooses {
                let StageOp { kind, limits, .. } = &self.ops[op];
                write!(f, "{label:<8} chooses for {kind}")?;
                limits_shown(f, &limits.choice)?;
            }
            sinks(f, &pass.after)?;
        }
        Ok(())
    }

    fn call_shown(&self, f: &mut fmt::Formatter<'_>, pass: &Pass, call: Call) -> fmt::Result {
        let (stage, needs) = (&self.ops[call.op], needs(&self.ops, call));
        write!(f, "{}", stage.kind)?;
        if pass.round > 1 {
            write!(f, " (round {})", pass.round)?;
        }
        if call.gathers {
            write!(f, " gathers over the whole scan")?;
        }
        let each = [("reads", needs.read_names()), ("writes", needs.written_names())];
        let told = each.iter().filter(|(_, names)| !names.is_empty());
        let told: Vec<_> =
            told.map(|(what, names)| format!("{what} {}", names.join(", "))).collect();
        write!(f, ": {}", told.join(", "))?;
        if needs.neighbors > 0 {
            let most = if needs.fewer_neighbors { "up to " } else { "" };
            write!(f, ", {most}{} nearest neighbours", needs.neighbors)?;
        }
        if needs.removes || needs.mark.is_some() {
            write!(f, ", {}", if needs.mark.is_some() { "marks" } else { "removes" })?;
        }
        limits_shown(f, &stage.limits.choice)
    }

    fn memory(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shares = self.task.demands.divide().map_err(|_| fmt::Error)?;
        write!(f, "memory   {}", Bytes(self.task.demands.limit))?;
        if self.task.mills {
            write!(
                f,
                ": {} for the program, {} for the index, {} for work, {} to keep points \
                 in\n         runs of {} records, tiles of {} positions with their rims",
                Bytes(shares.base),
                Bytes(shares.index),
                Bytes(shares.work),
                Bytes(shares.kept_in_memory),
                shares.run_records,
                shares.tile_positions
            )?;
        }
        Ok(())
    }
}
