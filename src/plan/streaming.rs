//! Stages that stream behind tiles, and choices by columns: the passes in which records are looked
//! at one by one, and what they need to see.

use super::limits::rewritten;
use super::passes::PassLayout;
use crate::Result;
use crate::engine::pass::StageOp;
use crate::point::{ColumnKind, names};
use crate::store::CHOSEN;

impl PassLayout<'_> {
    /// What streams behind tiles has a pass of its own, unless nothing but such stages is in the
    /// last.
    pub(super) fn filter(&mut self, filter: usize) -> Result<()> {
        let at = self.streaming();
        self.stream(at, self.sorted.filters[filter].reads());
        self.out.passes[at].filters.push(filter);
        self.at.filters.push(filter);
        (self.at.is_open, self.at.decides) = (false, true);
        Ok(())
    }

    /// The pass in which records may be looked at one by one, behind all calls.
    fn streaming(&mut self) -> usize {
        let at = self.pass();
        let pass = &self.out.passes[at];
        let begins = !pass.calls.is_empty() || !pass.after.is_empty() || pass.chooses.is_some();
        if !begins {
            return at;
        }
        let changes = |filter: &usize| !self.sorted.filters[*filter].changes().is_empty();
        let changed_by: Vec<usize> = self.at.filters.iter().copied().filter(changes).collect();
        let reads: Vec<ColumnKind> =
            changed_by.iter().flat_map(|&filter| self.sorted.filters[filter].reads()).collect();
        let at = self.begin();
        self.out.passes[at].changed_by = changed_by;
        self.stream(at, reads);
        at
    }

    /// Lets stages that stream look at these columns in pass `at`.
    pub(super) fn stream(&mut self, at: usize, columns: Vec<ColumnKind>) {
        for column in columns {
            self.bring(at, column);
            let streamed = &mut self.out.passes[at].streamed;
            if !streamed.contains(&column) {
                streamed.push(column);
            }
        }
    }

    /// Chooses the records that stage `op` is limited to by columns, in a pass before it.
    pub(super) fn choose(&mut self, op: usize) {
        let columns = self.ops[op].chosen_by();
        if columns.is_empty() {
            return;
        }
        let at = self.streaming();
        self.stream(at, columns);
        self.out.passes[at].chooses = Some(op);
        self.at.is_open = false;
    }

    /// Refuses a tile stage that reads what a stage above, which streams, changes only in what is
    /// written.
    pub(super) fn check_unchanged(&self, op: usize) -> Result<()> {
        let StageOp { kind, written, op, limits, selection, .. } = &self.ops[op];
        let needs = op.tile().needs();
        // Where columns choose, records are looked at as the stages above leave them.
        let weight = op.weight();
        let weighs = |name: &str| weight.is_some_and(|(_, weight)| weight.names().contains(&name));
        let is_chosen_by =
            |name: &str| *selection & CHOSEN == 0 && limits.choice.looks_at(name) || weighs(name);
        let is_column = |name: &str| needs.reads.iter().any(|column| column.name() == name);
        let is_read = |name: &String| {
            names::XYZ.contains(&name.as_str())
                || needs.dimensions.contains(name)
                || is_column(name)
                || is_chosen_by(name)
        };
        for filter in &self.at.filters {
            let stream = &self.sorted.filters[*filter];
            let above = &stream.kind;
            if let Some(column) = rewritten(stream, &needs.writes).filter(|_| !stream.of_tiles) {
                let name = column.name();
                let told = format!("`{kind}` computes {name} anew, which `{above}` looks at");
                let help = format!("put `{above}` behind `{kind}`");
                return Err(written.wrong(told).help(help));
            }
            if let Some(name) = stream.changes().iter().find(|name| is_read(name)) {
                let (told, help) = match stream.of_tiles {
                    true => (
                        format!(
                            "`{kind}` works on the positions that were read, and `{above}` moves \
                             points"
                        ),
                        format!("let a second run read what `{above}` leaves"),
                    ),
                    false => (
                        format!("`{kind}` works by {name} as it is read, and `{above}` changes it"),
                        format!(
                            "put `{above}` above all stages that work on tiles, or behind `{kind}`"
                        ),
                    ),
                };
                return Err(written.wrong(told).help(help));
            }
        }
        Ok(())
    }
}
