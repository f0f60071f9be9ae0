//! Stages that each break one promise: it is named, and shown on a few points.

use std::hint::black_box;
use std::time::{SystemTime, UNIX_EPOCH};

use pointmill::Result;
use pointmill::ops::removal::remove;
use pointmill::point::{PointBatch, distance2, names};
use pointmill::report::Tally;
use pointmill::stage::{Needs, Role, RoleName, StageKind, StagePlace, TileOp, Transform};
use pointmill::testing::{Broken, Conformance, Promise};
use pointmill::tile::{Fate, Tile};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const KIND: &str = "wrong";

/// What works on tiles, as two functions.
struct OnTiles {
    needs: fn() -> Needs,
    run: fn(&mut Tile, &mut Tally) -> Result<()>,
}

impl TileOp for OnTiles {
    fn needs(&self) -> Needs {
        (self.needs)()
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        (self.run)(tile, tally)
    }
}

/// What streams, as two functions.
struct Streams {
    needs: fn() -> Needs,
    apply: fn(&mut PointBatch),
}

impl Transform for Streams {
    fn needs(&self) -> Needs {
        (self.needs)()
    }

    fn apply(&self, batch: &mut PointBatch, _: &mut Tally) -> Result<()> {
        (self.apply)(batch);
        Ok(())
    }
}

fn on_tiles(needs: fn() -> Needs, run: fn(&mut Tile, &mut Tally) -> Result<()>) -> Broken {
    let make = move || Role::TileOp(Box::new(OnTiles { needs, run }));
    Conformance::of_role(KIND, make).check().unwrap_err()
}

fn streams(needs: fn() -> Needs, apply: fn(&mut PointBatch)) -> Broken {
    let make = move || Role::Transform(Box::new(Streams { needs, apply }));
    Conformance::of_role(KIND, make).check().unwrap_err()
}

/// Removes the positions of a tile for which `is_gone` holds, and enters them.
fn remove_if(
    tile: &mut Tile,
    tally: &mut Tally,
    is_gone: impl Fn(&Tile, usize) -> bool,
) -> Result<()> {
    let gone: Vec<usize> = tile.core.clone().filter(|&i| is_gone(tile, i)).collect();
    let removed = gone.into_iter().map(|i| remove(tile, i)).sum();
    tally.remove(KIND, "wrong", removed);
    Ok(())
}

fn removes() -> Needs {
    Needs::none().removes(None)
}

/// `broken` names the promise, shows at most so many points, and says `told`.
#[track_caller]
fn assert_broken(broken: &Broken, promise: Promise, most: usize, told: &str) {
    let text = broken.to_string();
    println!("{text}\n");
    assert_eq!(broken.promise(), promise, "{text}");
    let points = broken.points().unwrap();
    assert!((1..=most).contains(&points), "{text}");
    assert!(text.contains(&format!("breaks the promise that it {promise}: ")), "{text}");
    assert!(text.contains(told), "{text}");
    assert_eq!(text.matches("\n  X ").count(), if points <= 20 { points } else { 0 }, "{text}");
    assert!(broken.records().unwrap().is_ok());
}

#[test]
fn a_stage_that_looks_too_far_is_found() {
    let broken = on_tiles(removes, |tile, tally| {
        remove_if(tile, tally, |tile, i| {
            let near = |q: &&[i64; 3]| distance2(tile.positions[i], **q) < 1 << 60;
            tile.positions.iter().filter(near).count() > 1
        })
    });
    assert_broken(&broken, Promise::Reach, 4, "comes out of the second and not of the first");
    assert!(broken.to_string().contains("each of which sees the whole scan"));
}

#[test]
fn a_stage_that_looks_for_more_neighbors_than_it_declares_is_found() {
    let broken = on_tiles(
        || removes().neighbors(2),
        |tile, tally| {
            let mut far = Vec::new();
            tile.each_neighborhood(3, |i, n| far.push((i, n.farthest2() > 1000)))?;
            remove_if(tile, tally, |_, i| far.contains(&(i, true)))
        },
    );
    assert_broken(&broken, Promise::Reach, 1, "looks for 3 neighbours and declares 2");
}

#[test]
fn a_stage_that_depends_on_the_order_is_found() {
    let broken = streams(removes, |batch| batch.retain(|number, _| number % 2 == 0));
    assert_broken(&broken, Promise::Order, 2, "second run: records in another order");
}

#[test]
fn a_stage_that_depends_on_the_batch_is_found() {
    // By what it says the order may decide, but not how the input is cut.
    let broken = streams(
        || removes().reads_record_numbers(),
        |batch| batch.retain(|number, _| number % 2 == 0),
    );
    assert_broken(&broken, Promise::Split, 4, "batches of");
}

#[test]
fn a_stage_that_depends_on_the_tile_is_found() {
    let broken =
        on_tiles(removes, |tile, tally| remove_if(tile, tally, |tile, i| i == tile.core.start));
    assert_broken(&broken, Promise::Tiles, 2, "each of which sees the whole scan");
}

#[test]
fn a_stage_that_depends_on_time_is_found() {
    let broken = on_tiles(removes, |tile, tally| {
        remove_if(tile, tally, |_, i| {
            let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
            (now.as_nanos() / 8 + i as u128) % 2 == 0
        })
    });
    assert_broken(&broken, Promise::Time, 16, "comes out of the");
}

#[test]
fn a_stage_that_lies_about_its_memory_is_found() {
    let broken = on_tiles(
        || Needs::none().bytes_per_point(8),
        |tile, _| {
            drop(black_box(vec![0u8; 200 * tile.positions.len()]));
            Ok(())
        },
    );
    // What it takes beyond what it may have besides is seen from some hundred points on.
    assert_broken(&broken, Promise::Memory, 1000, "it worked with ");
    let constant = on_tiles(Needs::none, |_, _| {
        drop(black_box(vec![0u8; 1 << 20]));
        Ok(())
    });
    assert_broken(&constant, Promise::Memory, 1, "it worked with 1048576 bytes on 1 points");
}

#[test]
fn a_stage_that_forgets_the_ledger_is_found() {
    let broken = on_tiles(removes, |tile, _| {
        for i in tile.core.clone().skip(1) {
            remove(tile, i);
        }
        Ok(())
    });
    assert_broken(&broken, Promise::Ledger, 2, "removed 1 records, and it entered 0");
    let silent = on_tiles(Needs::none, |tile, _| {
        tile.fates.fill(Fate::Removed);
        Ok(())
    });
    assert_broken(&silent, Promise::Ledger, 1, "its needs say no removal");
    let another = on_tiles(removes, |tile, tally| {
        let removed = tile.core.clone().map(|i| remove(tile, i)).sum();
        tally.remove("median", "represented", removed);
        Ok(())
    });
    assert_broken(&another, Promise::Ledger, 1, "under the name of another");
    let streamed = streams(Needs::none, |batch| batch.truncate(1));
    assert_broken(&streamed, Promise::Ledger, 2, "its needs say no removal");
}

#[test]
fn a_stage_that_reads_what_it_does_not_declare_is_found() {
    let broken = streams(removes, |batch| {
        let schema = batch.schema().clone();
        let Some(intensity) = schema.find(names::INTENSITY) else { return };
        batch.retain(|_, record| intensity.world(record, schema.endian) < 10.0);
    });
    assert_broken(&broken, Promise::Reads, 1, "dimensions that are not declared");
}

#[test]
fn a_stage_that_changes_what_it_does_not_declare_is_found() {
    let broken = streams(Needs::none, |batch| {
        let schema = batch.schema().clone();
        let field = schema.find(names::CLASSIFICATION).unwrap().offset;
        batch.records_mut().chunks_exact_mut(schema.stride).for_each(|record| record[field] = 1);
    });
    assert_broken(&broken, Promise::Changes, 1, "no record that came in is (X ");
    let moved = on_tiles(Needs::none, |tile, _| {
        tile.positions.iter_mut().for_each(|p| p[2] += 1);
        Ok(())
    });
    assert_broken(&moved, Promise::Changes, 1, "changed the positions of a tile");
}

#[test]
fn a_stage_that_panics_is_found() {
    let broken = on_tiles(removes, |tile, tally| {
        assert!(tile.positions.len() != 1, "a tile of one position");
        remove_if(tile, tally, |_, _| false)
    });
    assert_broken(&broken, Promise::Answers, 1, "panicked");
}

/// Says that it works on tiles, which would give it other keys, and streams.
#[derive(Serialize, Deserialize, JsonSchema)]
struct Pretends {}

impl StageKind for Pretends {
    const KIND: &'static str = "pretends";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Says that it works on tiles.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::Transform(Box::new(Streams { needs: Needs::none, apply: |_| {} })))
    }
}

#[test]
fn a_stage_that_says_another_role_is_found() {
    let broken = Conformance::of(Pretends {}).check().unwrap_err();
    assert_eq!((broken.promise(), broken.points()), (Promise::Role, None));
    assert!(broken.to_string().contains("it streams"), "{broken}");
    Conformance::of(Pretends {}).streams().runs(2).check().unwrap();
}
