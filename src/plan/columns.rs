//! Which columns there are on a branch, and which pass computed them.

use crate::engine::pass::StageOp;
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

    /// Refuses a stage that would replace values that nothing has read.
    pub fn check_read(&self, stage: &StageOp, needs: &Needs) -> Result<()> {
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
    pub fn dimension(&self, name: &str) -> Result<ComputedDimension> {
        let found = self.0.iter().rev().find_map(|newest| newest.kind.part(name));
        found.ok_or_else(|| {
            let told = format!("the output wants {name}, which no stage computes");
            let before = giver(name)
                .map_or(String::new(), |stage| format!("put a `{stage}` stage before it, or "));
            Error::pipeline(told).help(format!("{before}leave {name} out of `write.dimensions`"))
        })
    }
}

/// The error of a stage that needs what is not there.
pub(super) fn missing(stage: &StageOp, name: &str, help: &str) -> Error {
    let told = format!("`{}` needs {name}, which nothing before it gives", stage.kind);
    stage.written.wrong(told).help(help.to_owned())
}

/// The stage that computes a column which has this name, or a number of that name.
pub(super) fn giver(name: &str) -> Option<&'static str> {
    let known = NORMAL.kind();
    (known.name() == name || known.part(name).is_some()).then_some("normals")
}
