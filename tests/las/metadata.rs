//! What LAS files say besides points, in the words of many writers: read, carried, mended or told.
//! The files of `tests/cases` are small ones of the kinds that public reports of other programs
//! tell of.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::case::execute;
use crate::support::case_file;
use crate::support::command::pointmill;
use crate::support::scan::Scan;
use pointmill::internals;
use pointmill::internals::las::Description;
use pointmill::io::ply;
use pointmill::point::GpsTime;
use pointmill::report::Report;
use pointmill::{ErrorKind, Result};
use pointmill::{Overrides, Quiet};
use tempfile::TempDir;

/// Removes next to nothing, but might.
const GRID: &str = "[[stage]]\nkind = \"grid\"\nside = 0.5\n";
/// Bits of the header's encoding field.
const WKT: u16 = 16;
const ADJUSTED: u16 = 1;

/// A folder for outputs and what is written there.
struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        Bench(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Reads `inputs`, has `stages` work on them under `settings`, and writes `output` with more
    /// keys behind its name.
    fn run(
        &self,
        inputs: &[PathBuf],
        settings: &str,
        stages: &str,
        output: &str,
    ) -> Result<Report> {
        let (name, keys) = output.split_once('\n').unwrap_or((output, ""));
        let text = format!(
            "[run]\nmemory = \"4GiB\"\nthreads = 1\n{settings}\n[[stage]]\nkind = \"read\"\n\
             path = {inputs:?}\n{stages}\n[[stage]]\nkind = \"write\"\npath = {:?}\n{keys}\n",
            self.path(name)
        );
        Ok(execute(&text, &Overrides::default(), &Quiet)?.report)
    }

    /// The output of a conversion of one case, and what was warned of.
    fn convert(&self, name: &str) -> (Description, Vec<String>) {
        let report = self.run(&[case_file(name)], "", "", "out.las").unwrap();
        (internals::las::describe(&self.path("out.las")).unwrap(), report.run.warnings)
    }

    fn header(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()[..227].to_vec()
    }

    fn encoding(&self, name: &str) -> u16 {
        let header = self.header(name);
        u16::from_le_bytes([header[6], header[7]])
    }
}

/// The records of a file with this user and number.
fn records(about: &Description, user: &str, record: u16) -> usize {
    let all = about.vlrs.iter().chain(&about.evlrs);
    all.filter(|v| v.user_id == user && v.record_id == record).count()
}

fn told(warnings: &[String], what: &str) -> bool {
    warnings.iter().any(|warning| warning.contains(what))
}

fn names(about: &Description) -> Vec<&str> {
    about.extra_bytes.iter().map(|extra| extra.name.as_str()).collect()
}

#[test]
fn units_that_are_hidden_are_found_and_mixed_ones_refused() {
    for name in ["15f-esri-projcs-vertcs.las", "15c-geokeys-epsg-only-2277-5703.las"] {
        let bench = Bench::new();
        let error = bench.run(&[case_file(name)], "", GRID, "out.las").unwrap_err();
        assert_eq!(
            (error.kind(), error.path()),
            (ErrorKind::Data, Some(&*case_file(name))),
            "{name}"
        );
        let message = error.to_string();
        assert!(message.contains("x and y are in US survey feet and z in metres"), "{message}");
        let auto = bench.run(&[case_file(name)], "z_scale = \"auto\"", GRID, "out.las").unwrap();
        let factor = auto.result.decisions.iter().find(|d| d.name == "z_scale").unwrap();
        assert!((factor.value.as_f64().unwrap() - 3937.0 / 1200.0).abs() < 1e-9, "{name}");
    }
    let about = internals::las::describe(&case_file("12-wkt2-4224-liblas.las")).unwrap();
    assert!(about.crs.unwrap().starts_with("PROJCRS[\"ETRS89 / UTM zone 32N\""));
    assert_eq!(about.units, "x and y in metres, z in a unit that is not known");
}

#[test]
fn what_is_not_known_of_units_is_said_where_it_matters_and_auto_refuses() {
    let bench = Bench::new();
    let feet = bench.path("feet.las");
    // The vertical code of the case is made one that nobody has given out.
    let bytes = fs::read(case_file("15c-geokeys-epsg-only-2277-5703.las")).unwrap();
    let at = bytes.windows(2).rposition(|w| w == 5703u16.to_le_bytes()).unwrap();
    for (code, why) in
        [(5103u16, "the unit of its reference system is not known here"), (0, "nothing names it")]
    {
        let mut other = bytes.clone();
        other[at..at + 2].copy_from_slice(&code.to_le_bytes());
        fs::write(&feet, &other).unwrap();
        let input = [feet.clone()];
        let report = bench.run(&input, "", GRID, "out.las").unwrap();
        assert!(told(&report.run.warnings, why), "{:?}", report.run.warnings);
        assert!(told(&report.run.warnings, "`run.z_scale = 1`"), "it says how to answer");
        for quiet in ["z_scale = 1", "units = \"ignore\""] {
            let report = bench.run(&input, quiet, GRID, "out.las").unwrap();
            assert!(report.run.warnings.is_empty(), "{quiet}");
        }
        let error = bench.run(&input, "z_scale = \"auto\"", GRID, "out.las").unwrap_err();
        assert!(error.to_string().contains("z in a unit that is not known"), "{error}");
        let report = bench.run(&input, "", "", "out.las").unwrap();
        assert!(report.run.warnings.is_empty(), "a conversion measures nothing");
    }
    // A scan in metres whose heights name no system, and one without any, are the usual ones.
    for name in ["100e-geokey.las", "100a-nocrs.las"] {
        let report = bench.run(&[case_file(name)], "", GRID, "out.las").unwrap();
        assert!(report.run.warnings.is_empty(), "{:?}", report.run.warnings);
        assert!(bench.run(&[case_file(name)], "z_scale = \"auto\"", GRID, "out.las").is_err());
    }
}

#[test]
fn descriptors_in_several_records_are_all_read_and_become_one_record() {
    let bench = Bench::new();
    let (about, warnings) = bench.convert("02-three-eb-vlrs.las");
    let input = internals::las::describe(&case_file("02-three-eb-vlrs.las")).unwrap();
    assert_eq!(records(&input, "LASF_Spec", 4), 3, "the case is what it is for");
    assert_eq!(names(&about), names(&input));
    assert!(names(&about).len() == 3 && !names(&about).iter().any(|n| n.starts_with("ExtraBytes")));
    assert_eq!((records(&about, "LASF_Spec", 4), warnings.len()), (1, 0));
    let same = |path: &Path| Scan::read(path, 100).records;
    assert!(same(&bench.path("out.las")) == same(&case_file("02-three-eb-vlrs.las")));
    // Behind them come normals, and their descriptors fill the longer record.
    let normals = "[[stage]]\nkind = \"normals\"\nneighbors = 4\n";
    let keys = "out.las\ndimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";
    bench.run(&[case_file("02-three-eb-vlrs.las")], "", normals, keys).unwrap();
    let about = internals::las::describe(&bench.path("out.las")).unwrap();
    assert_eq!(names(&about)[3..], ["NormalX", "NormalY", "NormalZ"]);
    let record = about.vlrs.iter().find(|v| v.user_id == "LASF_Spec").unwrap();
    assert_eq!((records(&about, "LASF_Spec", 4), record.length), (1, 6 * 192));
}

#[test]
fn descriptors_that_the_records_have_no_room_for_are_told_and_left_behind() {
    let bench = Bench::new();
    let (about, warnings) = bench.convert("55-eb-no-room.las");
    assert!(told(&warnings, "2 of 2 extra-bytes descriptors, from `Amplitude` on"), "{warnings:?}");
    assert_eq!(records(&about, "LASF_Spec", 4), 0);
    let (about, warnings) = bench.convert("142-eb-evlr.las");
    assert_eq!((names(&about), warnings.len()), (vec!["Dist"], 0), "an extended record is carried");
    assert_eq!(about.evlrs.len(), 1);
}

#[test]
fn ranges_of_extra_bytes_stay_with_all_points_and_go_with_some() {
    let ranges = |path: &Path| {
        let bytes = fs::read(path).unwrap();
        let at = bytes.windows(9).position(|w| w == b"LASF_Spec").unwrap() + 52;
        (bytes[at + 3], bytes[at + 64..at + 112].to_vec())
    };
    let input = ranges(&case_file("92-ebminmax.las"));
    assert!(input.0 & 6 == 6 && input.1.iter().any(|b| *b != 0), "the case has a range");
    let bench = Bench::new();
    bench.convert("92-ebminmax.las");
    assert_eq!(ranges(&bench.path("out.las")), input);
    bench.run(&[case_file("92-ebminmax.las")], "", GRID, "out.las").unwrap();
    assert_eq!(ranges(&bench.path("out.las")), (input.0 & !6, vec![0; 48]));
}

#[test]
fn a_bit_that_belies_the_system_is_told_and_mended() {
    let bench = Bench::new();
    let (about, warnings) = bench.convert("10-wkt-bit-unset.las");
    assert!(told(&warnings, "does not say that the CRS is WKT"), "{warnings:?}");
    assert_eq!(bench.encoding("out.las") & WKT, WKT);
    assert!(about.warnings.is_empty() && about.crs.unwrap().starts_with("PROJCS"));
    // GeoTIFF keys alone become WKT, which point format 6 asks for.
    let (about, warnings) = bench.convert("100e-geokey.las");
    assert_eq!((bench.encoding("out.las") & WKT, warnings.len()), (WKT, 0));
    assert!(about.crs.unwrap().starts_with("PROJCS[\"ETRS89 / UTM zone 32N\""));
    let (_, warnings) = bench.convert("100a-nocrs.las");
    assert_eq!((bench.encoding("out.las") & WKT, warnings.len()), (WKT, 0), "point format 6");
}

#[test]
fn one_system_in_other_bytes_or_words_is_read_as_one_in_any_order() {
    let wkt = ["14c-wkt-trailing-nuls.las", "14d-wkt-no-nul.las", "100b-wkt.las"];
    let bench = Bench::new();
    for files in [&wkt[..], &["100b-wkt.las", "100e-geokey.las"]] {
        let mut outputs = Vec::new();
        let mut paths: Vec<PathBuf> = files.iter().map(|name| case_file(name)).collect();
        for _ in 0..2 {
            bench.run(&paths, "", "", "out.las\norder = \"canonical\"").unwrap();
            let about = internals::las::describe(&bench.path("out.las")).unwrap();
            assert!(about.crs.unwrap().starts_with("PROJCS[\"ETRS89 / UTM zone 32N\""));
            let systems = about.vlrs.iter().filter(|v| v.user_id == "LASF_Projection").count();
            assert_eq!(systems, 1, "{:?}", about.vlrs);
            outputs.push(fs::read(bench.path("out.las")).unwrap());
            bench.run(&paths, "", "", "out.ply\norder = \"canonical\"").unwrap();
            outputs.push(fs::read(bench.path("out.ply")).unwrap());
            paths.reverse();
        }
        assert!(outputs[0] == outputs[2] && outputs[1] == outputs[3], "{files:?}");
    }
    // Systems that differ behind the first words are shown where they do.
    let other = bench.path("other.las");
    let mut bytes = fs::read(case_file("100b-wkt.las")).unwrap();
    let at = bytes.windows(5).rposition(|w| w == b"25832").unwrap();
    bytes[at + 4] = b'3';
    fs::write(&other, bytes).unwrap();
    let error = bench.run(&[case_file("100b-wkt.las"), other], "", "", "out.las").unwrap_err();
    assert!(error.to_string().contains("25832") && error.to_string().contains("25833"), "{error}");
    let error =
        bench.run(&[case_file("100a-nocrs.las"), case_file("100b-wkt.las")], "", "", "out.las");
    assert!(error.unwrap_err().to_string().contains("their CRS differ: none and PROJCS"));
}

#[test]
fn outputs_name_the_program_and_what_it_did_to_the_points() {
    let bench = Bench::new();
    let software = format!("pointmill {}", env!("CARGO_PKG_VERSION"));
    let input = bench.path("in.las");
    let mut bytes = fs::read(case_file("92-ebminmax.las")).unwrap();
    bytes[26..32].copy_from_slice(b"SENSOR");
    bytes[58..64].copy_from_slice(b"WRITER");
    fs::write(&input, bytes).unwrap();
    let written = |inputs: &[PathBuf], stages: &str, output: &str| {
        bench.run(inputs, "provenance = false", stages, output).unwrap();
        let about =
            internals::las::describe(&bench.path(output.split('\n').next().unwrap())).unwrap();
        assert_eq!(about.generating_software, software);
        about
    };
    let all = written(std::slice::from_ref(&input), "", "all.laz");
    assert_eq!((all.system_identifier.as_str(), records(&all, "pointmill", 1)), ("SENSOR", 0));
    let moved = written(std::slice::from_ref(&input), "", "moved.las\nscale = 0.0001");
    assert_eq!(moved.system_identifier, "TRANSFORMATION");
    let some = written(&[input], GRID, "some.las");
    assert_eq!(
        (some.system_identifier.as_str(), records(&some, "pointmill", 1)),
        ("EXTRACTION", 1)
    );
    let stages = |name: &str| -> serde_json::Value {
        let bytes = fs::read(bench.path(name)).unwrap();
        let is_stages = |w: &[u8]| w.starts_with(b"pointmill\0") && w.ends_with(&[1, 0]);
        let at = bytes.windows(18).rposition(is_stages).unwrap() + 16;
        let length = usize::from(u16::from_le_bytes([bytes[at + 2], bytes[at + 3]]));
        serde_json::from_slice(&bytes[at + 36..at + 36 + length]).unwrap()
    };
    let kinds: Vec<_> =
        stages("some.las").as_array().unwrap().iter().map(|s| s["kind"].clone()).collect();
    assert_eq!(kinds, ["read", "grid", "write"]);
    assert!(!stages("some.las").to_string().contains("some.las"), "no path is in there");
    // Another run takes its place, and a conversion carries it on.
    let sparser = GRID.replace("0.5", "2.0");
    let again = written(&[bench.path("some.las")], &sparser, "again.las");
    assert_eq!(
        (records(&again, "pointmill", 1), &stages("again.las")[1]["keys"]["side"]),
        (1, &2.0.into())
    );
    assert_eq!(records(&written(&[bench.path("again.las")], "", "same.las"), "pointmill", 1), 1);
    let same = |name: &str| fs::read(bench.path(name)).unwrap();
    assert!(same("again.las") == same("same.las"), "a conversion of ours changes nothing");
}

#[test]
fn what_gps_times_count_survives_ply() {
    let bench = Bench::new();
    for (name, kind, bit) in [
        ("90-gps-adjusted.las", GpsTime::AdjustedStandard, ADJUSTED),
        ("121-geokey.las", GpsTime::Week, 0),
    ] {
        bench.run(&[case_file(name)], "", "", "out.ply").unwrap();
        let comments = internals::ply::describe(&bench.path("out.ply")).unwrap().comments;
        assert!(told(&comments, "gps_time: seconds of"), "{comments:?}");
        let source = ply::open(&[bench.path("out.ply")]).unwrap();
        assert_eq!(source.metadata().gps_time, Some(kind));
        assert!(!told(&source.metadata().comments, "gps_time"), "it is not carried twice");
        let back = [bench.path("out.ply")];
        let report = bench.run(&back, "", "", "back.las\nscale = 0.01").unwrap();
        assert_eq!(bench.encoding("back.las") & ADJUSTED, bit, "{name}");
        assert!(!told(&report.run.warnings, "GPS week"), "{:?}", report.run.warnings);
    }
    // Where nothing says it, the output says what it takes it for.
    let text = fs::read(bench.path("out.ply")).unwrap();
    let line = b"comment gps_time: seconds of the GPS week\n";
    let at = text.windows(line.len()).position(|w| w == line).unwrap();
    let silent = bench.path("silent.ply");
    fs::write(&silent, [&text[..at], &text[at + line.len()..]].concat()).unwrap();
    let report =
        bench.run(std::slice::from_ref(&silent), "", "", "back.las\nscale = 0.01").unwrap();
    assert!(told(&report.run.warnings, "written as seconds of the GPS week"));
    let error = bench.run(&[bench.path("out.ply"), silent], "", "", "two.ply").unwrap_err();
    assert!(error.to_string().contains("GPS time type"), "{error}");
}

#[test]
fn epsg_codes_come_back_from_ply() {
    let bench = Bench::new();
    bench.run(&[case_file("121-geokey.las")], "", "", "out.ply").unwrap();
    let report = bench.run(&[bench.path("out.ply")], "", "", "back.las\nscale = 0.01").unwrap();
    let about = internals::las::describe(&bench.path("back.las")).unwrap();
    assert_eq!((about.crs.as_deref(), about.point_format), (Some("EPSG:25832+7837"), 1));
    assert_eq!((records(&about, "LASF_Projection", 34735), report.run.warnings.len()), (1, 0));
    // Point formats that ask for WKT get it.
    bench.run(&[case_file("100e-geokey.las")], "", "", "out.ply").unwrap();
    let report = bench.run(&[bench.path("out.ply")], "", "", "back.las\nscale = 0.01").unwrap();
    let about = internals::las::describe(&bench.path("back.las")).unwrap();
    assert!(about.crs.unwrap().ends_with("AUTHORITY[\"EPSG\",\"25832\"]]"));
    assert_eq!((about.point_format, report.run.warnings.len()), (6, 0));
    assert_eq!(bench.encoding("back.las") & WKT, WKT);
}

#[test]
fn a_system_that_las_cannot_name_is_told_for_its_own_reason() {
    let bench = Bench::new();
    bench.run(&[case_file("121-geokey.las")], "", "", "out.ply").unwrap();
    let text = fs::read(bench.path("out.ply")).unwrap();
    let at = text.windows(15).position(|w| w == b"EPSG:25832+7837").unwrap();
    let long = format!("PROJCS[\"{}\"]", "name ".repeat(14_000));
    for (crs, why) in [("EPSG:99", "not known"), ("a field", "neither"), (&long, "64 KiB")] {
        let other = bench.path("other.ply");
        let pieces: Vec<String> = crs
            .as_bytes()
            .chunks(900)
            .map(|piece| String::from_utf8(piece.to_vec()).unwrap())
            .collect();
        let crs = pieces.join("\ncomment crs+ ");
        fs::write(&other, [&text[..at], crs.as_bytes(), &text[at + 15..]].concat()).unwrap();
        let report = bench.run(&[other], "", "", "back.las\nscale = 0.01").unwrap();
        assert!(told(&report.run.warnings, "the CRS is not carried"), "{crs:.20}");
        assert!(told(&report.run.warnings, why), "{:?}", report.run.warnings);
        assert_eq!(internals::las::describe(&bench.path("back.las")).unwrap().crs, None);
    }
}

#[test]
fn waveforms_in_a_file_of_their_own_are_beside_the_output() {
    let bench = Bench::new();
    let name = "22-ext-waveform.las";
    for (file, of) in [("22-ext-waveform.wdp", "from.wdp"), (name, "from.las")] {
        fs::copy(case_file(file), bench.path(of)).unwrap();
    }
    let modes = |mode: u32| {
        let mode = std::os::unix::fs::PermissionsExt::from_mode(mode);
        fs::set_permissions(bench.path("from.wdp"), mode).unwrap();
    };
    modes(0o444);
    for stages in ["", GRID] {
        let report = bench.run(&[bench.path("from.las")], "", stages, "out.las").unwrap();
        let copied = fs::read(bench.path("out.wdp")).unwrap();
        assert!(copied == fs::read(case_file("22-ext-waveform.wdp")).unwrap(), "{stages}");
        let about = fs::metadata(bench.path("out.wdp")).unwrap();
        let mode = fs::metadata(bench.path("out.las")).unwrap().permissions();
        assert_eq!(about.permissions(), mode, "as other outputs, not as its source");
        let listed: Vec<_> = report.run.outputs.iter().map(|o| (&*o.path, o.bytes)).collect();
        assert_eq!(listed[1..], [(bench.path("out.wdp").to_str().unwrap(), Some(about.len()))]);
        fs::remove_file(bench.path("out.wdp")).unwrap();
    }
    // An output beside its input, under its name, has them already.
    for file in [name, "22-ext-waveform.wdp"] {
        fs::copy(case_file(file), bench.path(file)).unwrap();
    }
    let report = bench.run(&[bench.path(name)], "", "", "22-ext-waveform.laz").unwrap();
    assert!(report.run.warnings.is_empty());
    // Two files of waveforms are none that one output could refer to.
    let other = bench.path("other.las");
    fs::copy(case_file(name), &other).unwrap();
    let error = bench.run(&[bench.path(name), other.clone()], "", "", "two.las").unwrap_err();
    assert!(error.to_string().contains("their waveforms are in files of their own"), "{error}");
    let report = bench.run(&[other], "", "", "out.las").unwrap();
    assert!(
        told(&report.run.warnings, "other.wdp, which is not there"),
        "{:?}",
        report.run.warnings
    );
    assert!(!bench.path("out.wdp").exists());
    bench.run(&[case_file("22b-int-waveform.las")], "", "", "out.las").unwrap();
    assert_eq!(
        records(&internals::las::describe(&bench.path("out.las")).unwrap(), "LASF_Spec", 65535),
        1
    );
}

#[test]
fn no_input_and_no_output_is_replaced_by_a_copy_of_waveforms() {
    let bench = Bench::new();
    for (file, name) in [("22-ext-waveform.las", "in.las"), ("22-ext-waveform.wdp", "in.wdp")] {
        fs::copy(case_file(file), bench.path(name)).unwrap();
    }
    let before = fs::read(bench.path("in.wdp")).unwrap();
    let run = |settings: &str, output: &str| {
        let error = bench.run(&[bench.path("in.las")], settings, "", output).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Pipeline, "{error}");
        error.to_string()
    };
    // What is read: the waveforms are an input like the points, whatever their name.
    assert!(run("", "in.wdp\nformat = \"las\"").contains("this is an input"));
    std::os::unix::fs::symlink("in.wdp", bench.path("link.las")).unwrap();
    assert!(run("", "link.las").contains("this is the input"));
    // What is written: another output, and the report.
    let second = |name: &str, format: &str| {
        let path = bench.path(name);
        format!("out.las\n[[stage]]\nkind = \"write\"\npath = {path:?}\nformat = \"{format}\"")
    };
    assert!(run("", &second("out.wdp", "ply")).contains("out.wdp: this is written twice"));
    let report = format!("report = {:?}", bench.path("out.wdp"));
    assert!(run(&report, "out.las").contains("out.wdp: this is written twice"));
    // A file that is to stay is found before any work.
    fs::write(bench.path("out.wdp"), "mine").unwrap();
    let stays = bench.run(&[bench.path("in.las")], "existing = \"refuse\"", "", "out.las");
    assert!(stays.unwrap_err().to_string().contains("out.wdp: this file exists"));
    assert!(!bench.path("out.las").exists());
    assert_eq!(fs::read(bench.path("out.wdp")).unwrap(), b"mine");
    assert!(fs::read(bench.path("in.wdp")).unwrap() == before);
    // Outputs of one name have their waveforms in common.
    bench.run(&[bench.path("in.las")], "", "", &second("out.laz", "laz")).unwrap();
    assert!(fs::read(bench.path("out.wdp")).unwrap() == before);
}

#[test]
fn waveforms_of_two_conversions_are_not_put_in_one_place() {
    let bench = Bench::new();
    for name in ["one/a.las", "two/a.laz"] {
        fs::create_dir_all(bench.path(name).parent().unwrap()).unwrap();
        bench.run(&[case_file("22-ext-waveform.las")], "", "", name).unwrap();
    }
    let convert = || {
        let arguments = ["convert", "one/a.las", "two/a.laz", "-o", "out/"];
        pointmill(&bench.path("."), &arguments).2
    };
    let told = convert();
    assert!(told.contains("out/a.wdp is written twice"), "{told}");
    assert!(!bench.path("out").exists());
}

#[test]
fn waveforms_that_ply_loses_are_told_once() {
    let bench = Bench::new();
    for stages in ["", GRID] {
        let report = bench.run(&[case_file("22-ext-waveform.las")], "", stages, "out.ply").unwrap();
        let told =
            |w: &&String| w.contains("out.ply: PLY does not hold waveforms of LAS; these are lost");
        let warnings = &report.run.warnings;
        assert_eq!(warnings.iter().filter(told).count(), 1, "{warnings:?}");
        assert!(!bench.path("out.wdp").exists());
    }
    let report = bench.run(&[case_file("22b-int-waveform.las")], "", "", "out.ply").unwrap();
    assert!(told(&report.run.warnings, "LASF_Spec 65535"), "{:?}", report.run.warnings);
}

#[test]
fn an_index_of_the_input_is_not_carried() {
    let bench = Bench::new();
    let (about, warnings) = bench.convert("17-lax-evlr.las");
    assert!(told(&warnings, "spatial index (LAStools)"), "{warnings:?}");
    assert_eq!((records(&about, "LAStools", 30), records(&about, "mycompany", 7)), (0, 1));
}
