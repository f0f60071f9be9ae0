//! Lengths with units of their own: converted where the reference system says what the scan is in,
//! refused with the value that would do where it does not.

use crate::support::case::{Case, execute};
use crate::support::case_file;
use pointmill::point::{Horizontal, Units};
use pointmill::quantity::{Angle, Length};
use pointmill::{Graph, Overrides, Quiet, Registry};

fn in_units(text: &str, horizontal: Option<Horizontal>) -> Result<f64, String> {
    let units = Units { horizontal, ..Units::default() };
    let length = Length::read(text).unwrap().in_scan(&units, "cells.max_side");
    let told = |error: pointmill::Error| format!("{error}; {}", error.remedy().unwrap_or(""));
    length.map(Length::value).map_err(told)
}

#[test]
fn lengths_with_units_are_converted_to_the_unit_of_the_scan() {
    let metres = |text| in_units(text, Some(Horizontal::Metres(1.0))).unwrap();
    let lengths = ["2m", "5 cm", "250mm", "1.5km", "1ft", "1in"].map(metres);
    assert_eq!(lengths, [2.0, 0.05, 0.25, 1500.0, 0.3048, 0.0254]);
    assert_eq!(in_units("6.096m", Some(Horizontal::Metres(0.3048))), Ok(20.0));
    for wrong in ["2", "m", "0m", "-1m", "2 miles", "infm", "nanm", "", "2mm2"] {
        assert_eq!(Length::read(wrong), None, "{wrong}");
    }
}

#[test]
fn where_the_unit_of_the_scan_is_not_known_the_value_that_would_do_is_named() {
    let told = in_units("5cm", None).unwrap_err();
    assert!(told.contains("`cells.max_side = \"5cm\"` has a unit"), "{told}");
    assert!(told.contains("give `cells.max_side = 0.05`"), "{told}");
    let told = in_units("2m", Some(Horizontal::Degrees)).unwrap_err();
    assert!(told.contains("degrees"), "{told}");
}

#[test]
fn quantities_are_shown_as_they_were_given() {
    assert_eq!(Length::read("5 cm").unwrap().to_string(), "5cm");
    assert_eq!(Length::of(2.0).unwrap().to_string(), "2");
    let shown = |text: &str| serde_json::from_str::<Angle>(text).unwrap().to_string();
    assert_eq!(
        ["\"6°\"", "\"6deg\"", "0.25", "\"0.25rad\""].map(shown),
        ["6deg", "6deg", "0.25", "0.25"]
    );
}

#[test]
fn a_pipeline_with_a_length_in_metres_is_refused_before_work_if_the_scan_does_not_tell_its_unit() {
    let case = Case::new();
    case.ply(&[([0.0; 3], 1), ([1.0; 3], 2)]);
    for (stage, key) in [
        ("kind = 'grid'\nside = '2m'", "`grid.side = \"2m\"`"),
        (
            "kind = 'outliers'\nmethod = 'radius'\nradius = '2m'\nmin_neighbors = 1",
            "`outliers.radius",
        ),
    ] {
        let text = case.text("", &format!("[[stage]]\n{stage}\n"), "");
        let error = execute(&text, &Default::default(), &Quiet).unwrap_err();
        assert!(error.to_string().contains(key), "{error}");
        assert!(error.remedy().unwrap().contains("= 2"), "{error}");
        assert_eq!(case.left(), ["in.ply"]);
    }
}

#[test]
fn the_plan_and_the_report_say_what_lengths_were_converted_to() {
    let folder = tempfile::tempdir().unwrap();
    // Its x and y are in US survey feet, its heights in metres.
    let input = case_file("15c-geokeys-epsg-only-2277-5703.las");
    let output = folder.path().join("t_{x}_{y}.las");
    let text = format!(
        "[run]\nz_scale = 3.28\n[[stage]]\nkind = 'read'\npath = '{}'\n[[stage]]\nkind = 'grid'\n\
         side = '3 m'\n[[stage]]\nkind = 'grid'\nside = 20\n[[stage]]\nkind = 'write'\npath = '{}'\n\
         side = '1 km'\n",
        input.display(),
        output.display()
    );
    let graph = Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap();
    let plan = graph.plan(&Overrides::default()).unwrap();
    let shown = plan.to_string();
    assert!(shown.contains("\nlength   grid.side = 3m is 9.8425 US survey ft\n"), "{shown}");
    let report = plan.run(&Quiet).unwrap().report;
    let told = report.result.decisions.iter();
    let told: Vec<(&str, String)> =
        told.map(|told| (&*told.name, told.value.to_string())).collect();
    let has = |name: &str, value: &str| {
        assert!(told.iter().any(|(n, v)| *n == name && v.starts_with(value)), "{name}: {told:?}");
    };
    has("side_given", "\"3m\"");
    has("side_converted", "9.8425");
    assert_eq!(told.iter().filter(|(name, _)| *name == "side_given").count(), 1, "{told:?}");
    // The side of the squares.
    has("side", "3280.83333");
}
