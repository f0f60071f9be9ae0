//! Bits of scratch files that flip while they wait: every store, at any time of a run. A run either
//! tells, and publishes nothing, or was not touched and writes what it always does.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::fs::{FileExt, PermissionsExt};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill::ErrorKind;
use pointmill::{Overrides, Quiet, Watch};
use serde_json::Value;

use crate::support::case::{Case, execute};

/// What waits in scratch files, by the names of these; `found` waits only where no progress is reported.
const STORES: [&str; 10] = [
    "runs",
    "records",
    "positions",
    "order",
    "states",
    "fates",
    "normals",
    "figures",
    "inputs",
    "report",
];

/// Flips a bit in every 100 bytes of a store's files when the run reports its n-th progress.
struct Flipper<'a> {
    at: &'a Path,
    store: &'a str,
    /// Of `runs`, which are merged between two phases, phases are counted alone.
    left: AtomicU64,
    flipped: AtomicU64,
}

impl<'a> Flipper<'a> {
    fn new(at: &'a Path, store: &'a str, after: u64) -> Self {
        Flipper { at, store, left: AtomicU64::new(after), flipped: AtomicU64::new(0) }
    }

    fn count(&self) {
        if self.left.fetch_sub(1, Ordering::Relaxed) != 1 {
            return;
        }
        let folders = fs::read_dir(self.at).unwrap().map(|entry| entry.unwrap().path());
        for file in folders.flat_map(|folder| fs::read_dir(folder).into_iter().flatten()) {
            let path = file.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            // number-store-number
            if name.split('-').nth(1) == Some(self.store) && name.split('-').count() == 3 {
                self.flip(&path);
            }
        }
    }

    fn flip(&self, path: &Path) {
        for (path, mode) in [(path, 0o600), (path.parent().unwrap(), 0o700)] {
            assert_eq!(fs::metadata(path).unwrap().permissions().mode() & 0o777, mode);
        }
        let file = File::options().read(true).write(true).open(path).unwrap();
        let mut byte = [0];
        for at in (0..file.metadata().unwrap().len()).step_by(100) {
            file.read_exact_at(&mut byte, at).unwrap();
            file.write_all_at(&[byte[0] ^ 1 << (at % 8)], at).unwrap();
            self.flipped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Watch for Flipper<'_> {
    fn phase(&self, _name: &'static str, _total: Option<u64>) {
        self.count();
    }
    fn advance(&self, _points: u64) {
        if self.store != "runs" {
            self.count();
        }
    }
    fn warn(&self, _message: &str) {}
    fn cancelled(&self) -> bool {
        false
    }
}

/// Several passes, every column, an output for each input and one for all.
fn text(case: &Case, scratch: &Path, threads: usize) -> String {
    let folder = case.path("each");
    let each = format!("[[stage]]\nkind = 'write'\nfolder = '{}'\n", folder.display());
    let run = format!(
        "threads = {threads}\ntile_points = 700\nspill = 'always'\nscratch = '{}'\n",
        scratch.display()
    );
    let stages = "[[stage]]\nkind = 'outliers'\n[[stage]]\nkind = 'normals'\n[[stage]]\nkind = \
                  'cells'\nkeep = '30%'\n[[stage]]\nkind = 'median'\n";
    case.text(&run, &format!("{each}{stages}"), "")
}

fn outcome(case: &Case) -> (Vec<u8>, Vec<u8>, Value) {
    let read = |name: &str| fs::read(case.path(name)).unwrap();
    (read("out.ply"), read("each/in.ply"), case.report()["result"].clone())
}

#[test]
fn no_flipped_bit_of_any_store_changes_an_output() {
    let case = Case::new();
    // Off any grid: ties cost an exact search each. Every seventh position has a copy.
    let jitter = |i: u32, by: u32| f64::from(i.wrapping_mul(by) >> 20) / 8192.0;
    let points: Vec<_> = (0..6_400u32)
        .map(|i| {
            let p = i % 5_600;
            let (x, y) = (f64::from(p % 100), f64::from(p / 100));
            (
                [
                    x + jitter(p, 2_654_435_761),
                    y + jitter(p, 2_246_822_519),
                    jitter(p, 3_266_489_917),
                ],
                i,
            )
        })
        .collect();
    case.ply(&points);
    let scratch = tempfile::tempdir().unwrap();
    let none = Flipper::new(scratch.path(), "none", u64::MAX);
    execute(&text(&case, scratch.path(), 1), &Overrides::default(), &none).unwrap();
    let steps = u64::MAX - none.left.into_inner();
    let right = outcome(&case);
    assert!(steps > 40, "{steps}");
    let mut told: BTreeMap<&str, u32> = BTreeMap::new();
    for store in STORES {
        // What is read in the last part of a run alone is met at moments that are closer.
        let moments = if ["normals", "inputs", "report"].contains(&store) { 24 } else { 6 };
        for nth in 1..=moments {
            let _ = fs::remove_dir_all(case.path("each"));
            for name in ["out.ply", "report.json"] {
                fs::write(case.path(name), "old").unwrap();
            }
            let flipper = {
                let after = if store == "runs" { nth } else { steps * nth / moments };
                Flipper::new(scratch.path(), store, after)
            };
            let run = text(&case, scratch.path(), 1 + nth as usize % 2);
            match execute(&run, &Overrides::default(), &flipper) {
                Ok(_) => assert!(outcome(&case) == right, "{store} changed the output"),
                Err(error) => {
                    assert_eq!(error.kind(), ErrorKind::Io, "{store}: {error:?}");
                    let file = error.path().unwrap().display().to_string();
                    assert!(file.contains(&format!("-{store}-")), "{store}: {error:?}");
                    assert!(error.byte().is_some() && error.remedy().is_some(), "{error:?}");
                    assert!(flipper.flipped.load(Ordering::Relaxed) > 0);
                    for name in ["out.ply", "report.json"] {
                        assert_eq!(fs::read(case.path(name)).unwrap(), b"old", "{store}");
                    }
                    assert!(fs::read_dir(case.path("each")).is_ok_and(|left| left.count() == 0));
                    *told.entry(store).or_default() += 1;
                }
            }
            assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 0);
        }
    }
    assert_eq!(told.len(), STORES.len(), "a store that no flip reached: {told:?}");
    execute(&text(&case, scratch.path(), 2), &Overrides::default(), &Quiet).unwrap();
    assert!(outcome(&case) == right);
}
