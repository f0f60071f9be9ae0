//! What the report says of each of several reductions, one behind the other.

use crate::support::runs::{Memory, Settings, run};
use crate::support::scan::Scan;
use pointmill::synth::Scene;
use serde_json::Value;

fn result(folder: &std::path::Path, input: &std::path::Path, passes: usize, cut: bool) -> Value {
    let stages = format!(
        "[[stage]]\nkind = \"normals\"\n[[stage]]\nkind = \"cells\"\nmax_angle = 0.3\n[[stage]]\n\
         kind = \"median\"\npasses = {passes}\n"
    );
    let settings = match cut {
        true => Settings {
            tile_points: Some(120),
            memory: Memory::Least(0),
            threads: 2,
            spill: "always",
            ..Settings::PLAIN
        },
        false => Settings::PLAIN,
    };
    let ran = run(folder, &[input.to_path_buf()], &stages, "las", settings).unwrap();
    assert!(!cut || ran.count("tiles") > 5);
    serde_json::from_slice(&ran.result).unwrap()
}

#[test]
fn planes_are_measured_behind_every_pass_of_a_reduction_that_is_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("scan.las");
    Scan::synthetic(Scene::Part, 6000, 3).write(&input);
    let result = |passes, cut| result(folder.path(), &input, passes, cut);
    let all = result(3, false);
    assert_eq!(result(3, true), all, "tiles change nothing");
    let measured: Vec<&Value> = all["passes"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|pass| !pass["scan_plane"].is_null())
        .collect();
    assert_eq!(measured.len(), 3);
    for (passes, measured) in (1..=3).zip(measured) {
        let alone = result(passes, false);
        for plane in ["tile_plane", "scan_plane"] {
            let after = &alone["totals"][plane]["after"];
            assert!(after["rms"].as_f64().unwrap() > 0.0);
            assert_eq!(&measured[plane], after, "{plane} behind pass {passes}");
        }
        assert_eq!(measured["after"], alone["ledger"]["kept"]);
    }
    let once = result(1, false);
    let has_planes = |pass: &Value| pass.get("scan_plane").is_some();
    assert!(!once["passes"].as_array().unwrap().iter().any(has_planes), "it is in the totals");
}
