//! Which columns there are on a branch, and which pass computed them.

use crate::engine::pass::StageOp;
use crate::error::listed;
use crate::point::{ColumnKind, ComputedDimension, NORMAL};
use crate::stage::Needs;
use crate::{Error, Result};

/// The newest values of each column that a stage computed.
#[derive(Debug, Clone, Default)]
pub(super) struct NewestColumns(Vec<NewestColumn>);

#[derive(Debug, Clone, Copy)]
struct NewestColumn {
    kind: ColumnKind,
    /// The pass that computes them.
    pass: usize,
    /// True once a stage or a sink has read them.
    is_read: bool,
}

impl NewestColumns {
    /// True if a stage computed the column.
    pub fn have(&self, kind: &ColumnKind) -> bool {
        self.0.iter().any(|newest| newest.kind == *kind)
    }

    /// True if a stage computed a column of that name, whatever its type.
    pub fn have_named(&self, name: &str) -> bool {
        self.0.iter().any(|newest| newest.kind.name() == name)
    }

    /// The pass whose values of a column are the newest, now that somebody reads them.
    pub fn read(&mut self, kind: ColumnKind) -> Option<usize> {
        let newest = self.0.iter_mut().find(|newest| newest.kind == kind)?;
        newest.is_read = true;
        Some(newest.pass)
    }

    /// From now on the values that pass `pass` computes are the newest.
    pub fn write(&mut self, kind: ColumnKind, pass: usize) {
        self.0.retain(|newest| newest.kind != kind);
        self.0.push(NewestColumn { kind, pass, is_read: false });
    }

    /// Refuses a stage that would replace values that nothing has read, or that gives a column
    /// another type.
    pub fn check_written(&self, stage: &StageOp, needs: &Needs) -> Result<()> {
        let other = |kind: &&ColumnKind| self.have_named(kind.name()) && !self.have(kind);
        if let Some(kind) = needs.writes.iter().find(other) {
            let told = format!(
                "`{}` computes {} of another type than the stage that did before",
                stage.kind,
                kind.name()
            );
            return Err(stage.written.wrong(told).help("one of the two needs another name for it"));
        }
        let lost = |newest: &&NewestColumn| {
            let NewestColumn { kind, is_read, .. } = newest;
            !is_read && needs.writes.contains(kind) && !needs.reads.contains(kind)
        };
        let Some(newest) = self.0.iter().find(lost) else { return Ok(()) };
        let (kind, name) = (&stage.kind, newest.kind.name());
        let told = format!("this `{kind}` would replace values of {name} that nothing has read");
        Err(stage.written.wrong(told).help("leave one of the two out"))
    }

    /// The computed dimension that an output calls `name`, of the newest column that has it.
    pub fn dimension(&self, name: &str) -> Option<ComputedDimension> {
        self.0.iter().rev().find_map(|newest| newest.kind.part(name))
    }

    /// What to write instead of `names`, which no column has.
    pub fn remedy(&self, names: &[&str]) -> String {
        let all = || self.0.iter().flat_map(|newest| newest.kind.parts());
        let is_named = |newest: &&NewestColumn| names.contains(&newest.kind.name());
        if let Some(newest) = self.0.iter().find(is_named) {
            let (name, parts) = (newest.kind.name(), listed(newest.kind.parts(), "and"));
            return format!("the numbers of {name} are {parts}");
        }
        let leave = format!("leave {} out of `dimensions`", listed(names, "and"));
        match (names.iter().find_map(|name| giver(name)), all().next()) {
            (Some(stage), _) => format!("put a `{stage}` stage before it, or {leave}"),
            (None, Some(_)) => {
                format!("{leave}; the stages above compute {}", listed(all(), "and"))
            }
            (None, None) => leave,
        }
    }
}

/// The error of a stage that needs what is not there.
pub(super) fn missing(stage: &StageOp, name: &str, help: &str) -> Error {
    let told = format!("`{}` needs {name}, which nothing before it gives", stage.kind);
    stage.written.wrong(told).help(help.to_owned())
}

/// The error of a stage that reads what no stage computes and no record has, if it does.
pub(super) fn lacks(stage: &StageOp, names: &[&str]) -> Option<Error> {
    let names = (!names.is_empty()).then(|| listed(names, "and"))?;
    let help = format!("no stage computes {names}, and the records of the input have none");
    Some(missing(stage, &names, &help))
}

/// The error of a stage that makes a partition where nothing has taken the one `before`.
pub(super) fn replaced(before: &StageOp, stage: &StageOp) -> Error {
    let (kind, before) = (&stage.kind, &before.kind);
    let told = format!("`{kind}` replaces the cells that `{before}` made, which nothing has taken");
    let help = "leave one of the two out, or put a `median` stage between them";
    stage.written.wrong(told).help(help)
}

/// The stage that computes the normals, if that is the name of one of their numbers.
fn giver(name: &str) -> Option<&'static str> {
    NORMAL.kind().part(name).and_then(|dimension| dimension.column.computed_by())
}
