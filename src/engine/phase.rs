//! The phases of a run, as one list: what is done, in which order, and what it is called.
//!
//! A run goes through the list in its order, which its clock holds it to; and the list follows from
//! the task alone. So what a run will do is known before it begins, and a phase means the same to
//! whoever tells of it and to whoever does it.

use super::task::Task;

/// A phase of a run. Its items read what the phases before it sealed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RunPhase {
    /// Parts of the source, as they stream into the outputs.
    Convert,
    /// Parts of the source, sorted into runs.
    Decode,
    /// Ranges of Morton order, sealed.
    Merge,
    /// Samples before this pass, of which stages that ask for them settle what is left to them.
    Look(usize),
    /// Rounds over tiles before this pass, in which a stage chooses what stays.
    Choose(usize),
    /// Tiles in this pass, of which a stage gathers what it decides by.
    Gather(usize),
    /// Tiles in this pass.
    Mill(usize),
    /// Files of this sink, or stretches of it, which are written behind the tiles of a pass, or
    /// behind all points where the output is split.
    Write(usize),
    /// Squares of the plane, in which the points of this sink are connected.
    Connect(usize),
    /// Ranges of blocks, for the figures of what this pass left of a reduction that is repeated.
    Measure(usize),
    /// Ranges of blocks, for the figures of this branch.
    Survey(usize),
    /// Ledgers balance, and files get their names one after the other.
    Publish,
}

impl RunPhase {
    /// As reports and progress name it. Looks and publishing are a part of what is before them
    /// there.
    pub fn name(self) -> Option<&'static str> {
        match self {
            RunPhase::Convert => Some("convert"),
            RunPhase::Decode => Some("decode"),
            RunPhase::Merge => Some("merge"),
            RunPhase::Choose(_) => Some("choose"),
            RunPhase::Gather(_) => Some("gather"),
            RunPhase::Mill(_) => Some("mill"),
            RunPhase::Write(_) => Some("write"),
            RunPhase::Connect(_) => Some("mesh"),
            RunPhase::Measure(_) | RunPhase::Survey(_) => Some("survey"),
            RunPhase::Look(_) | RunPhase::Publish => None,
        }
    }
}

impl RunPhase {
    /// As predictions name it, which tell all phases apart that grow in other ways with the scan.
    pub fn name_in_predictions(self) -> &'static str {
        match self {
            RunPhase::Look(_) => LOOK,
            _ => self.name().unwrap_or("publish"),
        }
    }
}

/// What predictions call the look at samples before a pass, whose number is bounded.
pub(crate) const LOOK: &str = "look";

impl Task {
    /// All phases of the run, in their order.
    pub fn phases(&self) -> Vec<RunPhase> {
        let split = (0..self.sinks.len()).filter(|sink| self.is_split(*sink));
        let end = split.map(RunPhase::Write).chain([RunPhase::Publish]);
        if !self.mills {
            return [RunPhase::Convert].into_iter().chain(end).collect();
        }
        let mut phases = vec![RunPhase::Decode, RunPhase::Merge];
        for (n, pass) in self.passes.iter().enumerate() {
            phases.push(RunPhase::Look(n));
            if !pass.by_rounds.is_empty() {
                phases.push(RunPhase::Choose(n));
            }
            phases.push(match pass.gathers() {
                Some(_) => RunPhase::Gather(n),
                None => RunPhase::Mill(n),
            });
            let sinks = || pass.before.iter().chain(&pass.after).copied();
            let is_folder = |sink: &usize| self.sinks[*sink].is_folder();
            phases.extend(sinks().filter(is_folder).map(RunPhase::Write));
            let is_ranked = |sink: &usize| self.in_input_order[*sink] && !is_folder(sink);
            phases.extend(sinks().filter(is_ranked).map(RunPhase::Write));
            let is_mesh = |sink: &usize| self.meshes[*sink].is_some();
            phases.extend(sinks().filter(is_mesh).map(RunPhase::Connect));
            let branch = self.branches.iter().position(|branch| branch.pass == n);
            let figures = match branch {
                Some(branch) => Some(RunPhase::Survey(branch)),
                None => pass.is_repeated.then_some(RunPhase::Measure(n)),
            };
            phases.extend(figures.filter(|_| !self.traits.skips_survey));
        }
        phases.extend(end);
        phases
    }
}

#[cfg(test)]
mod tests;
