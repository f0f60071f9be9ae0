//! What a run tells of itself when its work is done: the figures of its report, once its ledgers
//! balance, and why outputs are empty if they are.
//!
//! Records are counted in places that know nothing of each other: as they are read, as stages
//! remove them, as chunks are cut, and as sinks write them. No count is computed from the others,
//! so a record that is lost or written twice fails the run instead of being hidden in a difference.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::Path;

use super::clock::Clock;
use super::finished::{Finished, FinishedBranch};
use super::hashing::InputHashes;
use super::job::Job;
use super::lines::TileLines;
use super::pass::{Branch, StreamOp};
use super::survey::Measured;
use super::tagger::{LEFT_OUT, NOT_FINITE};
use super::task::Task;
use crate::host::process::peak_memory;
use crate::host::standard;
use crate::report::{
    AcceptVerdict, Decision, FileFigures, Grouped, LatticeFigures, Ledger, Machine, Outcome,
    Removed, Report, RunFigures, check_written,
};
use crate::stage::{Input, OutputSplit, SinkSummary, Source};
use crate::{Error, Result};

impl Task {
    /// The files of all sinks, each with the records that it was given and what it said; false
    /// with the path of what is no file.
    fn written<'a>(
        &'a self,
        finished: &'a Finished,
    ) -> impl Iterator<Item = (&'a Path, bool, &'a (u64, SinkSummary))> {
        let files = |sink: usize| -> Vec<(&'a Path, bool)> {
            match self.is_split(sink) {
                true => finished.split[sink].iter().map(|path| (&**path, true)).collect(),
                false => self.files(sink).iter().map(|to| (to.path(), to.is_file())).collect(),
            }
        };
        let files = (0..self.sinks.len()).flat_map(files);
        files.zip(finished.written.iter().flatten()).map(|((path, is_file), w)| (path, is_file, w))
    }

    /// What is known of the run when its output is written.
    pub(super) fn figures(&self, finished: &Finished, job: &Job<'_>) -> RunFigures {
        let mut warnings = self.source.warnings();
        let all = finished.written.iter().flatten();
        // What all of many files say is said once.
        let mut told = BTreeSet::new();
        let notes = all.flat_map(|(_, sink)| &sink.notes).filter(|note| told.insert(*note));
        warnings.extend(notes.cloned());
        let outputs = self.written(finished).map(|(path, is_file, (_, summary))| {
            FileFigures::of(path, summary.points, is_file.then_some(summary.bytes))
        });
        RunFigures {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            inputs: input_figures(&*self.source, job.hashes.as_deref()),
            outputs: outputs.collect(),
            machine: Machine::this(),
            threads: job.threads.count(),
            memory_bytes: self.demands.limit,
            leased_bytes: job.budget.peak(),
            memory_holders: job.budget.at_peak(),
            spill_bytes: job.area.written(),
            warnings,
            lost: self.source.lost(),
            reprojection: self.source.reprojection(),
            ..RunFigures::default()
        }
    }

    /// The report of a finished run, once its ledgers balance, and the lines of the tiles of each
    /// branch.
    pub(super) fn account(
        &self,
        finished: Finished,
        mut run: RunFigures,
        mut clock: Clock<'_>,
    ) -> Result<(Report, Vec<Option<TileLines>>)> {
        for (path, _, (given, summary)) in self.written(&finished) {
            check_written(path, *given, summary.points)?;
        }
        run.cpu_by_phase = clock.cpu_by_phase();
        let cpu_seconds;
        (run.seconds, cpu_seconds, run.phases) = clock.finish();
        run.cpu_seconds = Some(cpu_seconds);
        run.peak_memory_bytes = peak_memory();
        run.work = finished.tally.work.iter().map(named).collect();
        let (mut results, mut lines) = (Vec::new(), Vec::new());
        for (branch, came_to) in self.branches.iter().zip(finished.branches) {
            let (result, tiles) = self.outcome(branch, came_to, finished.read)?;
            results.push(result);
            lines.push(tiles);
        }
        let mut results = results.into_iter();
        let result = results.next().ok_or_else(|| Error::internal("a run came to nothing"))?;
        Ok((Report { result, further: results.collect(), run }, lines))
    }

    /// What a branch came to, of so many records that were read.
    fn outcome(
        &self,
        branch: &Branch,
        finished: FinishedBranch,
        read: u64,
    ) -> Result<(Outcome, Option<TileLines>)> {
        let ledger = Ledger::new(read, finished.kept, &finished.tally);
        ledger.check()?;
        let (tile_side, totals, deviations, tiles) = match finished.measured {
            Some(Measured { tile_side, totals, deviations, tiles }) => {
                (Some(tile_side), Some(totals), deviations, Some(tiles))
            }
            None => (None, None, Vec::new(), None),
        };
        let lattice = self.lattice.as_ref();
        let mut decisions = finished.decisions;
        if let Some(lattice) = lattice.filter(|lattice| lattice.z_scale() != 1.0) {
            let (stage, name) = ("run".to_owned(), "z_scale".to_owned());
            decisions.insert(0, Decision { stage, name, value: lattice.z_scale().into() });
        }
        let is_on = |sink: &usize| std::ptr::eq(&self.branches[self.branch_of[*sink]], branch);
        let on_branch = || (0..self.sinks.len()).filter(is_on);
        let sides = on_branch().filter_map(|sink| match self.splits[sink] {
            Some(OutputSplit::Squares(side)) => Some(side),
            _ => None,
        });
        let radii = on_branch().filter_map(|sink| self.meshes[sink]?.max_radius);
        let lengths = sides.map(|side| ("write", "side", side));
        let lengths = lengths.chain(radii.map(|radius| ("mesh", "max_radius", radius)));
        decisions.extend(lengths.map(|(stage, name, value)| {
            let (stage, name) = (stage.to_owned(), name.to_owned());
            Decision { stage, name, value: value.into() }
        }));
        let accept = AcceptVerdict::of(&self.accept, &ledger, totals.as_ref());
        let outcome = Outcome {
            pipeline: branch.stages.clone(),
            lattice: lattice.map(|l| LatticeFigures { step: l.step, shift: l.shift }),
            ledger,
            decisions,
            counts: finished.tally.counts.iter().map(named).collect(),
            stats: finished.tally.stats.iter().map(|(name, s)| s.figures(name)).collect(),
            passes: finished.passes,
            tile_side,
            totals,
            deviations,
            classes: finished.classes,
            accept,
        };
        Ok((outcome, tiles))
    }
}

/// Says that outputs are empty: that the input was so too, or what removed the points, by the
/// settings that say so where there are any: the stages of commands are nothing that their users
/// know.
pub(super) fn nothing_left(finished: &Finished, job: &Job<'_>) -> Vec<String> {
    if finished.read == 0 {
        return vec!["the inputs have no points: what is written has none either".to_owned()];
    }
    let streams: Vec<_> = job.task.transforms.iter().chain(&job.task.filters).collect();
    let keys = |r: &Removed| -> Vec<&str> {
        let ours = streams.iter().filter(|stage| stage.kind == r.stage);
        let run = LEFT_OUT.iter().filter(|(reason, ..)| *reason == r.reason);
        let nonfinite = (r.reason == NOT_FINITE).then_some("run.nonfinite");
        let of_run = run.map(|(_, setting, _)| *setting).chain(nonfinite);
        ours.flat_map(|stage| stage.transform.removes_by()).chain(of_run).collect()
    };
    let by = |r: &Removed| {
        let keys: Vec<String> = keys(r).iter().map(|key| format!("`{key}`")).collect();
        let by = if keys.is_empty() { r.stage.clone() } else { keys.join(" and ") };
        format!("{} {} ({by})", Grouped(r.records), r.reason)
    };
    let empty = finished.branches.iter().filter(|branch| branch.kept == 0);
    let ledgers = empty.map(|branch| Ledger::new(finished.read, branch.kept, &branch.tally));
    let told = ledgers.map(|ledger| {
        let by: Vec<String> = ledger.removed.iter().map(by).collect();
        let removed = |stage: &&&StreamOp| ledger.removed.iter().any(|r| r.stage == stage.kind);
        let why = streams.iter().filter(removed).filter_map(|stage| stage.transform.emptied());
        let why: String = why.map(|why| format!("; {why}")).collect();
        format!("no point is left of {}: {}{why}", Grouped(ledger.read), by.join(", "))
    });
    told.collect()
}

fn named((name, count): (&Cow<'static, str>, &u64)) -> (String, u64) {
    (name.clone().into_owned(), *count)
}

fn input_figures(source: &dyn Source, hashes: Option<&InputHashes>) -> Vec<FileFigures> {
    let figures = |input: Input| {
        let bytes = standard::about(&input.path).ok().map(|about| about.len());
        let sha256 = hashes.and_then(|hashes| hashes.of(&input.path));
        FileFigures { sha256, ..FileFigures::of(&input.path, input.points, bytes) }
    };
    source.inputs().into_iter().map(figures).collect()
}
