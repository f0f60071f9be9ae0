//! What a pipeline leaves to the scan ("auto", "spread"): a function of the points alone, told in the
//! report, and the same bytes when it is given by hand. And the baseline of the report.

use std::path::PathBuf;

use crate::support::assert_same;
use crate::support::random::Random;
use crate::support::runs::{Ran, Settings, run};
use crate::support::scan::Scan;
use pointmill::synth::Scene;
use serde_json::Value;

const AUTO: &str = "[[stage]]\nkind = 'normals'\nneighbors = 'auto'\n[[stage]]\nkind = 'cells'\n\
                    measure = 'cone'\nside = 'spread'\nmin_spacing = 'auto'\n";
const MEDIAN: &str = "[[stage]]\nkind = 'median'\n";

fn chosen(ran: &Ran, key: &str) -> Option<Value> {
    let found = ran.report.result.decisions.iter().rev().find(|decision| decision.name == key);
    found.map(|decision| decision.value.clone())
}

/// The pipeline with everything that `ran` chose given by hand.
fn by_hand(ran: &Ran, limit: &str) -> String {
    let value = |key: &str| chosen(ran, key).unwrap();
    let side = if limit.is_empty() { "'spread'".to_owned() } else { value("side").to_string() };
    let limit = match limit {
        "" => format!("max_angle = {}", value("max_angle")),
        "keep = 'auto'" => format!("keep = {}", value("keep")),
        keep => keep.to_owned(),
    };
    format!(
        "[[stage]]\nkind = 'normals'\nneighbors = {}\n[[stage]]\nkind = 'cells'\nmeasure = 'cone'\n\
         side = {side}\nmin_spacing = {}\n{limit}\n{MEDIAN}",
        value("neighbors"),
        value("min_spacing"),
    )
}

#[test]
fn what_is_chosen_is_told_and_gives_the_same_bytes_by_hand_and_however_the_scan_is_cut() {
    let folder = tempfile::tempdir().unwrap();
    let input: PathBuf = folder.path().join("in.las");
    Scan::synthetic(Scene::Als, 30_000, 3).write(&input);
    let go = |stages: &str, settings| {
        run(folder.path(), std::slice::from_ref(&input), stages, "laz", settings).unwrap()
    };
    for limit in ["", "keep = '25%'", "keep = 6000", "keep = 'auto'"] {
        let angle = if limit.is_empty() { "max_angle = 'auto'" } else { limit };
        let auto = format!("{AUTO}{angle}\n{MEDIAN}");
        let whole = go(&auto, Settings::PLAIN);
        let bytes = whole.bytes();
        assert_eq!(chosen(&whole, "neighbors"), Some(20.into()), "the scan has noise");
        let kept = whole.report.result.ledger.kept;
        let expected = [("keep = '25%'", 7500), ("keep = 6000", 6000)];
        expected.iter().filter(|(keep, _)| *keep == limit).for_each(|(_, n)| assert_eq!(kept, *n));
        let cut = go(&auto, Settings { tile_points: Some(300), threads: 2, ..Settings::PLAIN });
        assert!(cut.count("tiles") >= 30, "{} tiles", cut.count("tiles"));
        assert_same(&cut.bytes(), &bytes, limit);
        assert_same(&cut.result, &whole.result, limit);
        let all = Scan::read(&whole.output, usize::MAX).records;
        // The file says which keys were given, so it is its records that are compared.
        let hand = go(&by_hand(&whole, limit), Settings::PLAIN);
        assert_same(&Scan::read(&hand.output, usize::MAX).records, &all, limit);
    }
}

/// Two planes that meet in a ridge along x, with no noise but that of the lattice.
fn roof() -> Scan {
    let mut random = Random(3);
    Scan::synthetic(Scene::Plane, 40_000, 7).moved(|_, _| {
        let (x, y) = (random.below(20_000) as i32, random.below(20_000) as i32 - 10_000);
        [x, y, 9_000 - (y / 2).abs()]
    })
}

#[test]
fn where_planes_have_no_noise_cells_at_edges_are_as_small_as_those_need() {
    let folder = tempfile::tempdir().unwrap();
    let input: PathBuf = folder.path().join("in.las");
    roof().write(&input);
    let go = |stages: &str| {
        let settings = Settings::PLAIN;
        run(folder.path(), std::slice::from_ref(&input), stages, "las", settings).unwrap()
    };
    let ran = go(&format!("{AUTO}keep = '5%'\n{MEDIAN}"));
    assert_eq!(chosen(&ran, "min_spacing"), Some("none".into()));
    let side = chosen(&ran, "side").unwrap().as_f64().unwrap();
    let spaced = AUTO.replace("min_spacing = 'auto'", &format!("min_spacing = {}", 0.6 * side));
    let spaced = go(&format!("{spaced}keep = '5%'\n{MEDIAN}"));
    let rms = |ran: Ran| ran.report.result.totals.unwrap().deviation.unwrap().rms;
    let (free, spaced) = (rms(ran), rms(spaced));
    assert!(free < spaced / 2.0, "{free} beside {spaced}");
}

#[test]
fn the_baseline_is_that_of_a_grid_of_as_many_points() {
    let folder = tempfile::tempdir().unwrap();
    let input: PathBuf = folder.path().join("in.las");
    Scan::synthetic(Scene::Plane, 20_000, 5).write(&input);
    let go = |stages: &str| {
        let settings = Settings::PLAIN;
        run(folder.path(), std::slice::from_ref(&input), stages, "las", settings).unwrap()
    };
    let reduced = go(&format!("{AUTO}keep = '4%'\n{MEDIAN}"));
    let baseline = reduced.report.result.totals.unwrap().baseline.unwrap();
    assert!(baseline.points > 10_000, "{baseline:?}");
    let side = baseline.side;
    let grid = go(&format!(
        "[[stage]]\nkind = 'normals'\nneighbors = 20\n[[stage]]\nkind = 'grid'\nside = {side}\n"
    ));
    let totals = grid.report.result.totals.unwrap();
    // Cubes of a plane that is in no direction special: as many as asked for, as far off.
    let kept = totals.points.after as f64 / 800.0;
    assert!((0.8..1.25).contains(&kept), "{kept}");
    let rms = totals.deviation.unwrap().rms / baseline.rms;
    assert!((0.75..1.33).contains(&rms), "{rms} of {baseline:?}");
    assert_eq!(totals.baseline, None, "the grid does not decide by normals");
    let all = go(
        "[[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\nmax_angle = 0\n[[stage]]\nkind = 'median'\n",
    );
    assert_eq!(all.report.result.totals.unwrap().baseline, None, "there is no grid of all points");
}
