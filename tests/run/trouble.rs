//! Runs that cannot begin, fail, panic or are stopped: each ends with its error and leaves nothing
//! behind.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill::point::{Column, PointBatch};
use pointmill::report::Tally;
use pointmill::stage::{
    Gathered, Needs, Role, RoleName, ScanOp, StageKind, StagePlace, TileOp, Transform,
};
use pointmill::tile::Tile;
use pointmill::{Error, ErrorKind, Result};
use pointmill::{Overrides, Quiet, Registry, Watch};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::support::case::{Case, REDUCE, execute, execute_with};

#[test]
fn what_cannot_be_written_is_refused_before_any_work() {
    let case = Case::new();
    case.ply(&[([0.0; 3], 0)]);
    fs::write(case.path("out.ply"), "old").unwrap();
    let text = case.text("", REDUCE, "");
    let told = |overrides: Overrides| execute(&text, &overrides, &Quiet).unwrap_err();
    let report = |path: PathBuf| told(Overrides { report: Some(path), ..Overrides::default() });
    let same = report(case.path(".").join("out.ply"));
    assert!(same.to_string().ends_with("out.ply: this is written twice"), "{same}");
    let missing = report(case.path("none/report.json"));
    assert!(missing.to_string().ends_with("none: the folder does not exist"));
    assert!(report(PathBuf::from("/dev/null")).to_string().contains("no regular file"));
    let scratch = told(Overrides { scratch: Some(case.path("none")), ..Overrides::default() });
    assert!(scratch.to_string().ends_with("none: the folder for scratch does not exist"));
    std::os::unix::fs::symlink(case.path("in.ply"), case.path("link.json")).unwrap();
    fs::hard_link(case.path("in.ply"), case.path("hard.json")).unwrap();
    for name in ["link.json", "hard.json"] {
        assert!(report(case.path(name)).to_string().contains("this is the input "), "{name}");
    }
    assert_eq!(fs::read(case.path("out.ply")).unwrap(), b"old");
    assert_eq!(case.left(), ["hard.json", "in.ply", "link.json", "out.ply"]);
}

/// A stage that fails or panics at its n-th call.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct Trouble<const TILES: bool> {
    after: u64,
    panics: bool,
    #[serde(skip)]
    calls: Arc<AtomicU64>,
}

impl<const TILES: bool> Trouble<TILES> {
    fn meet(&self) -> Result<()> {
        match self.calls.fetch_add(1, Ordering::Relaxed) == self.after {
            // Unlike `panic!`, says nothing on stderr.
            true if self.panics => std::panic::resume_unwind(Box::new("trouble")),
            true => Err(Error::new(ErrorKind::Data, "trouble")),
            false => Ok(()),
        }
    }
}

impl<const TILES: bool> StageKind for Trouble<TILES> {
    const KIND: &'static str = if TILES { "tile-trouble" } else { "stream-trouble" };
    const ROLE: RoleName = if TILES { RoleName::OnTiles } else { RoleName::Transform };
    const ABOUT: &'static str = "Fails.";

    fn build(self, _at: &StagePlace) -> Result<Role> {
        Ok(if TILES { Role::TileOp(Box::new(self)) } else { Role::Transform(Box::new(self)) })
    }
}

impl<const TILES: bool> Transform for Trouble<TILES> {
    fn needs(&self) -> Needs {
        Needs::default()
    }
    fn apply(&self, _batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        self.meet()
    }
}

impl<const TILES: bool> TileOp for Trouble<TILES> {
    fn needs(&self) -> Needs {
        Needs::default()
    }
    fn run(&self, _tile: &mut Tile, _tally: &mut Tally) -> Result<()> {
        self.meet()
    }
}

#[test]
fn trouble_in_a_stage_ends_the_run_and_leaves_nothing_behind() {
    let case = Case::new();
    let points: Vec<_> =
        (0..60_000u32).map(|i| ([f64::from(i % 300), f64::from(i / 300), 0.0], i)).collect();
    case.ply(&points);
    fs::write(case.path("out.ply"), "old").unwrap();
    for threads in [1, 3] {
        for (trouble, order) in
            [("stream", "input"), ("stream", "canonical"), ("tile", "canonical")]
        {
            for (panics, kind) in [(false, ErrorKind::Data), (true, ErrorKind::Internal)] {
                let stage = format!(
                    "[[stage]]\nkind = '{trouble}-trouble'\nafter = 4\npanics = {panics}\n"
                );
                let run = format!("threads = {threads}\ntile_points = 3000\nspill = 'always'");
                let write = format!("order = '{order}'");
                let text = case.text(&run, &stage, &write);
                let registry = Registry::builtin().with::<Trouble<true>>().with::<Trouble<false>>();
                let error = execute_with(&registry, &text, &Overrides::default(), &Quiet);
                let error = error.unwrap_err();
                assert_eq!(error.kind(), kind, "{threads} {trouble} {order}: {error}");
                assert_eq!(case.left(), ["in.ply", "out.ply"]);
            }
        }
    }
    assert_eq!(fs::read(case.path("out.ply")).unwrap(), b"old");
}

/// A stage of two phases that fails or panics in one of them.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
struct ScanTrouble {
    phase: String,
    panics: bool,
    #[serde(skip)]
    calls: Arc<AtomicU64>,
}

const FOUND: Column<u8> = Column::new("Found", &[]);

impl ScanTrouble {
    /// Fails in the third tile of its phase, or at once where there are none.
    fn meet(&self, phase: &str) -> Result<()> {
        if self.phase != phase {
            return Ok(());
        }
        let calls = self.calls.fetch_add(1, Ordering::Relaxed);
        match calls == 2 || phase == "conclude" {
            true if self.panics => std::panic::resume_unwind(Box::new("trouble")),
            true => Err(Error::new(ErrorKind::Data, "trouble")),
            false => Ok(()),
        }
    }
}

impl StageKind for ScanTrouble {
    const KIND: &'static str = "scan-trouble";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Fails in one of two phases.";

    fn build(self, _at: &StagePlace) -> Result<Role> {
        Ok(Role::ScanOp(Box::new(self)))
    }
}

impl TileOp for ScanTrouble {
    fn needs(&self) -> Needs {
        Needs::none().reads(&FOUND)
    }
    fn run(&self, _tile: &mut Tile, _tally: &mut Tally) -> Result<()> {
        self.meet("run")
    }
}

impl ScanOp for ScanTrouble {
    type Summary = Vec<u64>;

    fn gather_needs(&self) -> Needs {
        Needs::none().writes(&FOUND)
    }
    fn gather(&self, tile: &mut Tile, _tally: &mut Tally) -> Result<Vec<u64>> {
        tile.columns.get_mut(&FOUND)?.fill(1);
        self.meet("gather")?;
        Ok(vec![tile.core.len() as u64])
    }
    fn conclude(&mut self, gathered: &dyn Gathered<Vec<u64>>) -> Result<Option<String>> {
        gathered.each(&mut |tile| match tile[..] {
            [_] => self.meet("conclude"),
            _ => Err(Error::internal("a summary came back as another")),
        })?;
        Ok(None)
    }
}

#[test]
fn trouble_in_either_phase_of_a_stage_ends_the_run_and_leaves_nothing_behind() {
    let case = Case::new();
    let points: Vec<_> =
        (0..20_000u32).map(|i| ([f64::from(i % 200), f64::from(i / 200), 0.0], i)).collect();
    case.ply(&points);
    fs::write(case.path("out.ply"), "old").unwrap();
    let text = |phase: &str, panics: bool, threads: usize| {
        let stage =
            format!("[[stage]]\nkind = 'scan-trouble'\nphase = '{phase}'\npanics = {panics}\n");
        // An output above it is complete by then, and goes away all the same.
        let early = case.path("early.ply");
        let early = format!("[[stage]]\nkind = 'write'\npath = '{}'\n", early.display());
        let normals = "[[stage]]\nkind = 'normals'\n";
        let run = format!("threads = {threads}\ntile_points = 1500\nspill = 'always'");
        case.text(&run, &format!("{normals}{early}{stage}"), "")
    };
    let registry = Registry::builtin().with::<ScanTrouble>();
    let go = |text: &str| execute_with(&registry, text, &Overrides::default(), &Quiet);
    for threads in [1, 3] {
        for phase in ["gather", "conclude", "run"] {
            for (panics, kind) in [(false, ErrorKind::Data), (true, ErrorKind::Internal)] {
                if panics && phase == "conclude" {
                    continue; // on the caller's own thread
                }
                let error = go(&text(phase, panics, threads)).unwrap_err();
                assert_eq!(error.kind(), kind, "{threads} {phase}: {error}");
                assert_eq!(case.left(), ["in.ply", "out.ply"], "{threads} {phase}");
            }
        }
    }
    assert_eq!(fs::read(case.path("out.ply")).unwrap(), b"old");
    go(&text("none", false, 2)).unwrap();
    assert_eq!(case.left(), ["early.ply", "in.ply", "out.ply", "report.json"]);
}

/// Asks to stop after so many reports of progress.
struct Impatient(AtomicU64);

impl Watch for Impatient {
    fn phase(&self, _name: &'static str, _total: Option<u64>) {}
    fn advance(&self, _points: u64) {
        let _ = self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1));
    }
    fn warn(&self, _message: &str) {}
    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed) == 0
    }
}

#[test]
fn a_run_stops_in_every_phase_when_it_is_asked_to() {
    let case = Case::new();
    let points: Vec<_> = (0..30_000u32)
        .map(|i| ([f64::from(i % 200), f64::from(i / 200), f64::from(i % 2)], i))
        .collect();
    case.ply(&points);
    let run = "threads = 2\ntile_points = 2000\nspill = 'always'";
    let stages = "[[stage]]\nkind = 'outliers'\n[[stage]]\nkind = 'normals'\n[[stage]]\nkind = \
                  'cells'\nkeep = '30%'\n[[stage]]\nkind = 'median'\n";
    let text = case.text(run, stages, "");
    let mut stops = 0;
    for patience in (1..).step_by(3) {
        let watch = Impatient(AtomicU64::new(patience));
        match execute(&text, &Overrides::default(), &watch) {
            Err(error) => assert_eq!(error.kind(), ErrorKind::Interrupted, "{error}"),
            Ok(_) => break,
        }
        stops += 1;
        assert_eq!(case.left(), ["in.ply"], "patience {patience}");
    }
    assert!(stops >= 5, "{stops} stops");
    assert_eq!(case.left(), ["in.ply", "out.ply", "report.json"]);
}

#[test]
fn scratch_may_be_elsewhere_and_goes_away_from_there() {
    let case = Case::new();
    let elsewhere = tempfile::tempdir().unwrap();
    case.ply(
        &(0..5000u32).map(|i| ([f64::from(i % 70), f64::from(i / 70), 0.0], i)).collect::<Vec<_>>(),
    );
    let seen = |path: &Path| fs::read_dir(path).unwrap().count();
    let text = case.text("spill = 'always'", REDUCE, "");
    let overrides =
        Overrides { scratch: Some(elsewhere.path().to_owned()), ..Overrides::default() };
    execute(&text, &overrides, &Quiet).unwrap();
    assert!(case.report()["run"]["spill_bytes"].as_u64().unwrap() > 0);
    assert_eq!((seen(elsewhere.path()), seen(case.at.path())), (0, 3));
}
