//! A stage in a role that passes every call on, and looks at what the stage does with it.

use std::path::PathBuf;
use std::sync::Arc;

use super::allocator::measured;
use super::hidden::Hidden;
use super::promise::Promise;
use super::tile_state::TileState;
use super::witness::Witness;
use crate::error::Undeclared;
use crate::expression::{KeyExpression, Weight};
use crate::geom::lattice::Lattice;
use crate::point::{PointBatch, Schema, Units};
use crate::quantity::Length;
use crate::report::Tally;
use crate::stage::{
    AnyScanOp, Forecast, GridBeside, Needs, NextRound, Role, RoundFound, RoundOp, RoundTile,
    ScanFacts, SoFar, StoredSummaries, TileOp, Transform,
};
use crate::store::KeptPoints;
use crate::tile::Tile;
use crate::{Error, Result};

/// A stage and who looks at it.
struct WatchedStage<S: ?Sized> {
    kind: String,
    witness: Arc<Witness>,
    stage: Box<S>,
}

/// The same role, looked at by `witness`.
pub(super) fn watched(kind: &str, role: Role, witness: &Arc<Witness>) -> Role {
    let (kind, witness) = (kind.to_owned(), witness.clone());
    match role {
        Role::Transform(stage) => Role::Transform(Box::new(WatchedStage { kind, witness, stage })),
        Role::TileOp(stage) => Role::TileOp(Box::new(WatchedStage { kind, witness, stage })),
        Role::ScanOp(stage) => Role::ScanOp(Box::new(WatchedStage { kind, witness, stage })),
        Role::RoundOp(stage) => Role::RoundOp(Box::new(WatchedStage { kind, witness, stage })),
        other => other,
    }
}

/// The records that a tally has as removed by the stage `kind`, and by any.
pub(super) fn entered(tally: &Tally, kind: &str) -> (u64, u64) {
    let of = |is_asked: &dyn Fn(&str) -> bool| {
        let removed = tally.removed.iter().filter(|((stage, _), _)| is_asked(stage));
        removed.map(|(_, records)| records).sum()
    };
    (of(&|stage| stage == kind), of(&|_| true))
}

#[warn(clippy::missing_trait_methods, reason = "every call is passed on")]
impl Transform for WatchedStage<dyn Transform> {
    fn needs(&self) -> Needs {
        self.stage.needs()
    }

    fn expressions(&self) -> Vec<(&'static str, KeyExpression<'_>)> {
        self.stage.expressions()
    }

    fn check(&self, schema: &Schema) -> Result<()> {
        self.stage.check(schema)
    }

    fn leaves(&self, schema: &Schema) -> Result<Option<Schema>> {
        self.stage.leaves(schema)
    }

    fn warnings(&self, schema: &Schema) -> Vec<String> {
        self.stage.warnings(schema)
    }

    fn misses(&self, claimed: [[f64; 3]; 2]) -> Option<String> {
        self.stage.misses(claimed)
    }

    fn idle(&self, schema: &Schema) -> Vec<String> {
        self.stage.idle(schema)
    }

    fn emptied(&self) -> Option<String> {
        self.stage.emptied()
    }

    fn removes_by(&self) -> Vec<&'static str> {
        self.stage.removes_by()
    }

    fn files(&self) -> Vec<(&'static str, PathBuf)> {
        self.stage.files()
    }

    fn apply(&self, batch: &mut PointBatch, tally: &mut Tally) -> Result<()> {
        let (before, entered_before) = (batch.len(), entered(tally, &self.kind).1);
        let (outcome, bytes) = measured(|| self.stage.apply(batch, tally));
        self.witness.took_besides(before, bytes);
        let entries = entered(tally, &self.kind).1 - entered_before;
        let tell = |told: String| self.witness.tell(Promise::Ledger, told);
        if batch.len() > before {
            tell(format!("it made {} records of {before}", batch.len()));
        } else if batch.len() < before && !self.stage.needs().removes {
            let gone = before - batch.len();
            tell(format!("it removed {gone} of {before} records, and its needs say no removal"));
        } else if entries > 0 {
            tell(format!(
                "it entered {entries} records as removed, which the run does for a stage that \
                 streams"
            ));
        }
        outcome
    }
}

impl<S: TileOp + ?Sized> WatchedStage<S> {
    /// Lets the stage work on `tile`: it sees what `needs` say, and what it does is compared with
    /// them.
    fn work(
        &self,
        needs: &Needs,
        tile: &mut Tile,
        tally: &mut Tally,
        work: impl FnOnce(&S, &mut Tile, &mut Tally) -> Result<()>,
    ) -> (Result<()>, u64) {
        let before = TileState::of(tile, needs);
        let (of_stage, of_any) = entered(tally, &self.kind);
        let hidden = Hidden::of(tile, needs);
        let (outcome, bytes) = measured(|| work(&self.stage, tile, tally));
        hidden.give_back(tile);
        if outcome.is_ok() {
            before.compare(tile, needs, &self.witness);
            let (now_of_stage, now_of_any) = entered(tally, &self.kind);
            let (own, all) = (now_of_stage - of_stage, now_of_any - of_any);
            if all != own {
                let told = format!("it entered {} records under the name of another", all - own);
                self.witness.tell(Promise::Ledger, told);
            }
            before.balance(tile, needs, own, &self.witness);
        }
        (self.hear(outcome), bytes)
    }

    /// Does the work of a tile, for which the stage declares memory.
    fn mill(
        &self,
        needs: &Needs,
        tile: &mut Tile,
        tally: &mut Tally,
        work: impl FnOnce(&S, &mut Tile, &mut Tally) -> Result<()>,
    ) -> Result<()> {
        let (outcome, bytes) = self.work(needs, tile, tally, work);
        self.witness.took(tile.positions.len(), needs.bytes_per_point, bytes);
        outcome
    }

    /// Tells of an error that the stage has only because it did not declare what it asked for.
    fn hear(&self, outcome: Result<()>) -> Result<()> {
        let promise = match outcome.as_ref().err().and_then(Error::is_undeclared) {
            Some(Undeclared::Column) => Some(Promise::Reads),
            Some(Undeclared::Neighbors) => Some(Promise::Reach),
            None => None,
        };
        if let (Some(promise), Err(error)) = (promise, &outcome) {
            self.witness.tell(promise, error.to_string());
        }
        outcome
    }

    /// What a call that works on no tile comes to.
    fn besides<T>(&self, (outcome, bytes): (T, u64)) -> T {
        self.witness.took_besides(0, bytes);
        outcome
    }
}

#[warn(clippy::missing_trait_methods, reason = "every call is passed on")]
impl<S: TileOp + ?Sized> TileOp for WatchedStage<S> {
    fn needs(&self) -> Needs {
        self.stage.needs()
    }

    fn convert(&mut self, units: &Units) -> Result<()> {
        self.stage.convert(units)
    }

    fn lengths(&self) -> Vec<(&'static str, Length)> {
        self.stage.lengths()
    }

    fn files(&self) -> Vec<(&'static str, PathBuf)> {
        self.stage.files()
    }

    fn for_share(&mut self, share: f64) {
        self.stage.for_share(share);
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        let settled = measured(|| self.stage.settle(scan));
        self.besides(settled)
    }

    fn warnings(&self, lattice: &Lattice) -> Vec<String> {
        self.stage.warnings(lattice)
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        self.mill(&self.stage.needs(), tile, tally, |stage, tile, tally| stage.run(tile, tally))
    }

    fn decisions(&self) -> Vec<(String, serde_json::Value)> {
        self.stage.decisions()
    }

    fn sample_side(&self) -> Option<i64> {
        self.stage.sample_side()
    }

    fn sample(&self, tile: &mut Tile) -> Result<Vec<f64>> {
        let mut figures = Vec::new();
        let needs = self.stage.needs();
        // Samples have so few positions that no memory is planned for what they take.
        let (outcome, bytes) = self.work(&needs, tile, &mut Tally::default(), |stage, tile, _| {
            figures = stage.sample(tile)?;
            Ok(())
        });
        self.witness.took_besides(tile.positions.len(), bytes);
        outcome.map(|()| figures)
    }

    fn forecast(&mut self, samples: &[Vec<f64>]) -> Forecast {
        let forecast = measured(|| self.stage.forecast(samples));
        self.besides(forecast)
    }
}

impl RoundOp for WatchedStage<dyn RoundOp> {
    fn next(&mut self, so_far: &SoFar<'_>) -> Result<NextRound> {
        let next = measured(|| self.stage.next(so_far));
        self.besides(next)
    }

    fn round(&self, tile: &RoundTile<'_>, found: &mut RoundFound) -> Result<()> {
        self.stage.round(tile, found)
    }

    fn weight(&self) -> Option<(&'static str, &Weight)> {
        self.stage.weight()
    }

    fn beside(&self, so_far: &SoFar<'_>) -> Option<GridBeside> {
        self.stage.beside(so_far)
    }

    fn chosen(&mut self, kept: Arc<KeptPoints>) {
        self.stage.chosen(kept);
    }
}

impl AnyScanOp for WatchedStage<dyn AnyScanOp> {
    fn gather_needs(&self) -> Needs {
        self.stage.gather_needs()
    }

    fn gather_into(&self, tile: &mut Tile, tally: &mut Tally, bytes: &mut Vec<u8>) -> Result<()> {
        self.mill(&self.stage.gather_needs(), tile, tally, |stage, tile, tally| {
            stage.gather_into(tile, tally, bytes)
        })
    }

    fn conclude_from(&mut self, stored: &dyn StoredSummaries) -> Result<Option<String>> {
        let Needs { of_scan, of_any_scan, bytes_per_point, .. } = self.stage.gather_needs();
        // What tiles take is free by then, and does for reading what was gathered of one.
        let of_scan = of_scan + bytes_per_point;
        let (outcome, bytes) = measured(|| self.stage.conclude_from(stored));
        self.witness.took_of_scan(stored.records(), (of_scan, of_any_scan), bytes);
        outcome
    }
}
