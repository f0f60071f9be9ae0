//! Values that one format or the lattice cannot hold as they are: kept, or told, before the work
//! where that can be; never changed without a word.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use crate::support::case::REDUCE;
use crate::support::case_file;
use crate::support::scan::Scan;
use pointmill::Result;
use pointmill::io::{las, ply};
use pointmill::point::{PointBatch, Scalar, Schema};
use pointmill::stage::Source;
use pointmill::synth::Scene;
use pointmill::{Done, Graph, Overrides, Quiet, Registry, Watch};

/// Hears what a run warns of.
#[derive(Default)]
struct Ear(Mutex<Vec<String>>);

impl Watch for Ear {
    fn phase(&self, _name: &'static str, _total: Option<u64>) {}

    fn advance(&self, _points: u64) {}

    fn warn(&self, message: &str) {
        self.0.lock().unwrap().push(message.to_owned());
    }
}

fn text(run: &str, inputs: &[PathBuf], stages: &str, output: &Path, write: &str) -> String {
    format!(
        "[run]\n{run}\n[[stage]]\nkind = 'read'\npath = {inputs:?}\n{stages}\n\
         [[stage]]\nkind = 'write'\npath = {output:?}\n{write}\n"
    )
}

/// Plans and runs; what came out and all that was warned of.
fn go(text: &str) -> Result<(Done, Vec<String>)> {
    let pipeline = Graph::parse(text, "test.toml", &Registry::builtin())?;
    let ear = Ear::default();
    let done = pipeline.plan(&Overrides::default())?.run(&ear)?;
    Ok((done, ear.0.into_inner().unwrap()))
}

/// Values of a dimension in a file.
fn values(path: &Path, name: &str) -> Vec<f64> {
    let (schema, records) = read(path);
    let field = schema.find(name).unwrap_or_else(|| panic!("no {name} in {schema:?}"));
    records.chunks(schema.stride).map(|record| field.world(record, schema.endian)).collect()
}

fn read(path: &Path) -> (Schema, Vec<u8>) {
    let source: Box<dyn Source> = match path.extension().is_some_and(|e| e == "ply") {
        true => ply::open(&[path.to_owned()]).unwrap(),
        false => las::open(&[path.to_owned()]).unwrap(),
    };
    let mut batch = PointBatch::new(source.schema().clone(), 10_000);
    let mut all = Vec::new();
    for index in 0..source.parts() {
        source.part(index).unwrap().read(&mut batch).unwrap();
        all.extend_from_slice(batch.records());
    }
    ((**source.schema()).clone(), all)
}

#[test]
fn a_text_keeps_digits_that_a_float_has_no_room_for() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    for encoding in ["ascii", "binary"] {
        let keys = format!("encoding = {encoding:?}");
        go(&text("", &[case_file("192-ascii-float-utm.ply")], "", &output, &keys)).unwrap();
        assert_eq!(values(&output, "Y"), [5600000.37, 5600000.12, 5600001.81]);
        assert_eq!(values(&output, "X"), [350000.12, 350000.34, 350001.56]);
    }
    // One whose digits a float has is as it was, and so is one that its neighbour needs no more
    // for.
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                  property float z\nproperty float q\nend_header\n";
    let short = folder.path().join("short.ply");
    fs::write(&short, format!("{header}0.1 -2.25 1e-3 0.123456789012\n")).unwrap();
    let (_, told) = go(&text("", std::slice::from_ref(&short), "", &output, "")).unwrap();
    let (schema, _) = read(&output);
    assert!(schema.dimensions.iter().all(|d| d.scalar == Scalar::F32));
    assert!(told.iter().any(|w| w.contains("1 numbers of `float` properties")), "{told:?}");
    // Together with one of more digits both keep all.
    let long = folder.path().join("long.ply");
    fs::write(&long, format!("{header}5600000.37 2 3 4\n")).unwrap();
    for inputs in [[short.clone(), long.clone()], [long, short]] {
        go(&text("", &inputs, "", &output, "")).unwrap();
        let mut x = values(&output, "X");
        x.sort_by(f64::total_cmp);
        assert_eq!(x, [0.1, 5600000.37]);
    }
}

#[test]
fn texts_of_floats_and_of_doubles_are_one_scan() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    go(&text("", &[case_file("152a.ply"), case_file("152b.ply")], "", &output, "")).unwrap();
    assert_eq!(values(&output, "X"), [0.0, 1.0, 0.0, 1.0]);
    assert_eq!(read(&output).0.find("X").unwrap().scalar, Scalar::F64);
}

#[test]
fn a_text_that_ends_in_a_number_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    let input = folder.path().join("in.ply");
    let whole = fs::read_to_string(case_file("192-ascii-float-utm.ply")).unwrap();
    let told = |text_of_file: &str| {
        fs::write(&input, text_of_file).unwrap();
        let (_, told) = go(&text("", std::slice::from_ref(&input), "", &output, "")).unwrap();
        told.iter().any(|w| w.contains("its last number may be cut short"))
    };
    assert!(whole.ends_with('\n') && !told(&whole));
    assert!(told(whole.trim_end()) && told(&whole[..whole.len() - 2]));
    assert!(!told(&format!("{} ", whole.trim_end())));
}

#[test]
fn scalar_fields_of_ply_are_the_fields_of_las() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.las");
    go(&text("", &[case_file("51-scalar.ply")], "", &output, "scale = 0.001")).unwrap();
    assert_eq!(values(&output, "Intensity"), [12.0, 40_000.0]);
    assert_eq!(values(&output, "Classification"), [2.0, 6.0]);
    assert_eq!(values(&output, "GpsTime"), [1.5, 2.5]);
    assert_eq!(values(&output, "ReturnNumber"), [1.0, 2.0]);
}

#[test]
fn names_keep_their_words_and_headers_hold_no_dots() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    go(&text(
        "provenance = false",
        &[case_file("53c-only-space.las")],
        "",
        &output,
        "encoding = 'ascii'",
    ))
    .unwrap();
    let written = fs::read_to_string(&output).unwrap();
    let header = written.split_once("end_header").unwrap().0;
    assert!(header.contains(" normal_x\n") && !header.contains("_2"), "{header}");
    assert!(header.contains("comment made by pointmill"), "{header}");
    assert!(!header.lines().any(|line| line.contains("..")), "{header}");
    // The names come back, and so does every byte of a second conversion.
    let again = folder.path().join("again.ply");
    go(&text("provenance = false", std::slice::from_ref(&output), "", &again, "")).unwrap();
    assert_eq!(written, fs::read_to_string(&again).unwrap());
    assert!(read(&again).0.find("normal x").is_some());
}

#[test]
fn records_that_ply_does_not_hold_are_named_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    let pipeline = text("", &[case_file("122-vlrs.las")], "", &output, "");
    let plan = Graph::parse(&pipeline, "test.toml", &Registry::builtin()).unwrap();
    let plan = plan.plan(&Overrides::default()).unwrap();
    let [warning] = &plan.warnings()[..] else { panic!("{:?}", plan.warnings()) };
    assert!(warning.contains("these are lost: "), "{warning}");
    let (done, told) = go(&pipeline).unwrap();
    assert!(told.contains(warning) && done.report.run.warnings.contains(warning));
    let copied = text("", &[case_file("122-vlrs.las")], "", &folder.path().join("out.las"), "");
    assert!(go(&copied).unwrap().1.iter().all(|w| !w.contains("lost")));
}

#[test]
fn values_that_the_output_cannot_hold_are_told_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.las");
    let plan = |input: &str, stages: &str, keys: &str| {
        let text = text("", &[case_file(input)], stages, &output, keys);
        let pipeline = Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap();
        pipeline.plan(&Overrides::default())
    };
    let keys = "scale = 0.001";
    let cases = [
        ("190-float-intensity.ply", "Intensity = 0.", "`write.drop = [\"Intensity\"]`"),
        ("51c-floatint-frac.ply", "Intensity = 0.5", "`write.drop = [\"Intensity\"]`"),
        ("108-float-utm.ply", "Y = 5600", "`write.offset = ["),
        ("37d-nan-inf.ply", "X = NaN", "`run.nonfinite = \"drop\"`"),
    ];
    for (input, told, help) in cases {
        let error = plan(input, "", keys).err().unwrap_or_else(|| panic!("{input}"));
        assert!(error.to_string().contains(told), "{error}");
        assert!(error.remedy().unwrap().contains(help), "{error:?}");
        // A stage may remove the point: then it is a warning, unless none of the points fits.
        match plan(input, REDUCE, keys) {
            Ok(warned) => {
                assert!(warned.warnings().iter().any(|w| w.contains(told) && w.contains(help)));
                assert!(!input.starts_with("51c") && !input.starts_with("108"), "{input}");
            }
            Err(error) => {
                assert!(error.to_string().contains(told), "{error}");
                assert!(input.starts_with("51c") || input.starts_with("108"), "{error}");
            }
        }
    }
    // What the help says does.
    let offset = "scale = 0.001\noffset = [346000.0, 5600000.0, 0.0]";
    assert!(plan("108-float-utm.ply", "", offset).is_ok());
    assert!(plan("190-float-intensity.ply", "", "scale = 0.001\ndrop = ['Intensity']").is_ok());
    let dropped = text("nonfinite = 'drop'", &[case_file("37d-nan-inf.ply")], "", &output, keys);
    assert_eq!(go(&dropped).unwrap().0.report.result.ledger.kept, 1);
}

#[test]
fn a_scan_finer_than_the_lattice_is_told_with_a_lattice_that_does() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    let grid = "[[stage]]\nkind = 'grid'\nside = 1.0\n";
    let reduce = |run: &str, stages: &str| {
        go(&text(run, &[case_file("93-nano.ply")], stages, &output, "")).unwrap()
    };
    for stages in [REDUCE, grid] {
        let (done, told) = reduce("", stages);
        let result = &done.report.result;
        assert_eq!((result.ledger.kept, result.counts["positions"]), (1, 1));
        assert_eq!(result.counts["unequal_coordinates"], 1);
        let warning = told.iter().find(|w| w.contains("unequal coordinates")).unwrap();
        assert!(warning.contains("`run.lattice = 1e-12`"), "{warning}");
        // The points are on a line of 399 steps of 1e-11, or in a square of 19: either way the
        // deviation of all but one is the extent of the scan.
        let deviation = result.totals.as_ref().unwrap().deviation.unwrap();
        assert_eq!(deviation.points, 399);
        let apart = result.decisions.iter().find(|d| d.name == "unequal_coordinates_apart");
        let apart = apart.unwrap().value.as_f64().unwrap();
        assert!((1e-10..1e-8).contains(&apart), "{apart}");
        assert!((deviation.max / apart - 1.0).abs() < 1e-6, "{deviation:?} {apart}");
    }
    let (done, told) = reduce("lattice = 1e-12", REDUCE);
    assert_eq!(done.report.result.counts["positions"], 400);
    assert!(told.iter().all(|w| !w.contains("unequal")), "{told:?}");
}

#[test]
fn few_points_that_the_lattice_merges_are_counted_without_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.ply"), folder.path().join("out.ply"));
    let mut text_of_file = "ply\nformat ascii 1.0\nelement vertex 2001\nproperty double x\n\
                            property double y\nproperty double z\nend_header\n"
        .to_owned();
    for i in 0..2000 {
        text_of_file += &format!("{} {} {}\n", i % 50, i / 50, i % 7);
    }
    text_of_file += "1e-12 0 0\n";
    fs::write(&input, text_of_file).unwrap();
    let (done, told) = go(&text("", std::slice::from_ref(&input), REDUCE, &output, "")).unwrap();
    assert_eq!(done.report.result.counts["unequal_coordinates"], 1);
    assert!(told.iter().all(|w| !w.contains("unequal")), "{told:?}");
}

#[test]
fn a_scan_beyond_the_lattice_is_refused_with_a_lattice_that_does() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.ply");
    let reduce = |run: &str| go(&text(run, &[case_file("94-ecef-mm.ply")], REDUCE, &output, ""));
    let error = reduce("").unwrap_err();
    let help = error.remedy().unwrap();
    let step = help.split_once("`run.lattice = ").unwrap().1.split_once('`').unwrap().0;
    let (done, _) = reduce(&format!("lattice = {step}")).unwrap();
    assert_eq!(done.report.result.counts["positions"], 400);
}

#[test]
fn lengths_that_the_lattice_rounds_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.las");
    let told = |stages: &str| {
        let (_, told) = go(&text("", &[case_file("70d.las")], stages, &output, "")).unwrap();
        told.into_iter().filter(|w| w.contains("whole steps")).collect::<Vec<_>>()
    };
    let grid = |side: &str| told(&format!("[[stage]]\nkind = 'grid'\nside = {side}\n"));
    let [warning] = &grid("0.15")[..] else { panic!("one warning") };
    assert!(warning.contains("`grid.side = 0.15`"), "{warning}");
    assert!(grid("0.2").is_empty());
    let cells = |keys: &str| {
        told(&format!(
            "[[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\n{keys}\n\
                       [[stage]]\nkind = 'median'\npasses = 2\n"
        ))
    };
    assert_eq!(cells("side = 1.23\nmax_side = 2.34\nmin_spacing = 0.12").len(), 3);
    assert!(cells("side = 1.2\nmax_side = 2.3\nmin_spacing = 0.1").is_empty());
}

#[test]
fn a_scale_that_the_far_end_of_a_scan_does_not_fit_is_told_by_the_plan() {
    let folder = tempfile::tempdir().unwrap();
    let [input, output] = ["in.las", "out.las"].map(|name| folder.path().join(name));
    let scan = Scan::synthetic(Scene::Als, 20_000, 1);
    let last = scan.points() - 1;
    // One point of many is far away, where nobody looks before the run.
    let moved =
        scan.moved(|i, stored| if i == last { [2_000_000_000, stored[1], 0] } else { stored });
    moved.write(&input);
    let plan = |stages: &str, write: &str| {
        let text = text("", std::slice::from_ref(&input), stages, &output, write);
        let graph = Graph::parse(&text, "test.toml", &Registry::builtin()).unwrap();
        graph.plan(&Overrides::default()).unwrap()
    };
    let finer = "scale = 0.0001";
    let warned = plan("", finer).warnings();
    let told = warned.iter().find(|told| told.contains("the box in the header")).unwrap();
    assert!(told.contains("out.las") && told.contains("a point that is kept does"), "{told}");
    let error = plan("", finer).run(&Quiet).unwrap_err();
    assert!(error.path().is_some_and(|path| path.ends_with("out.las")), "{error}");
    // Where it is cut off, or stored as it is, there is nothing to tell of.
    let crop = "[[stage]]\nkind = 'filter'\nwhere = 'X < 1e6'\n";
    plan(crop, finer).run(&Quiet).unwrap();
    assert_eq!(plan("", "").warnings(), [""; 0]);
}
