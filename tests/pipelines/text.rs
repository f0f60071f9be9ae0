//! Pipeline files: what is read, and how every mistake is told.

use std::path::Path;

use pointmill::graph::{MixedUnits, Nonfinite, SimdSetting, ZScale};
use pointmill::io::Write;
use pointmill::io::las::{LAS, LAZ};
use pointmill::io::ply::PLY;
use pointmill::report::Tally;
use pointmill::stage::{Needs, Role, RoleName, StageKind, StagePlace, TileOp};
use pointmill::synth::Synth;
use pointmill::tile::Tile;
use pointmill::{Error, ErrorKind, Result};
use pointmill::{Graph, Overrides, Registry, Set};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A tile stage with a key of every sort.
#[derive(Serialize, Deserialize, JsonSchema)]
struct Thin {
    #[serde(default)]
    angle: f64,
    #[serde(default)]
    neighbors: u32,
    #[serde(default)]
    pick: Option<Pick>,
    #[serde(default)]
    names: Vec<String>,
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Pick {
    Center,
    Median,
    First,
}

impl StageKind for Thin {
    const KIND: &'static str = "thin";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Thins.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        if self.angle > 3.2 {
            let told = Error::pipeline("an angle is at most π").help("write it as 6deg");
            return Err(at.blame("angle", told));
        }
        Ok(Role::TileOp(Box::new(Nothing)))
    }
}

struct Nothing;

impl TileOp for Nothing {
    fn needs(&self) -> Needs {
        Needs::default()
    }

    fn run(&self, _: &mut Tile, _: &mut Tally) -> Result<()> {
        Ok(())
    }
}

/// `synth`, `thin` and `write`.
fn registry() -> Registry {
    let registry = Registry::empty().with::<Synth>().with::<Thin>().with::<Write>();
    registry.with_format(LAS).with_format(LAZ).with_format(PLY)
}

const GOOD: &str = "\
[[stage]]
kind = \"synth\"
scene = \"part\"
points = 1_000

[[stage]]
kind = \"thin\"
neighbors = 12

[[stage]]
kind = \"write\"
path = \"out.laz\"
";

fn parse(text: &str) -> Result<Graph> {
    Graph::parse(text, "p.toml", &registry())
}

fn with(sets: &[&str]) -> Result<Graph> {
    let sets = sets.iter().map(|s| Set::parse(s)).collect::<Result<Vec<_>>>()?;
    Graph::parse_with(GOOD, "p.toml", &registry(), &sets)
}

/// What is told of a wrong pipeline.
fn told(text: &str) -> String {
    let error = parse(text).expect_err("the pipeline is wrong");
    assert_eq!(error.kind(), ErrorKind::Pipeline);
    format!("{error}\n")
}

#[test]
fn a_pipeline_reads_top_to_bottom() {
    let pipeline = parse(GOOD).unwrap();
    let kinds: Vec<&str> = pipeline.stages.iter().map(|s| s.kind.as_str()).collect();
    assert_eq!(kinds, ["synth", "thin", "write"]);
    let lines: Vec<usize> = pipeline.stages.iter().filter_map(|s| s.line).collect();
    assert_eq!(lines, [2, 7, 11]);
    assert!(matches!(pipeline.stages[0].role, Role::Source(_)));
    assert!(matches!(pipeline.stages[1].role, Role::TileOp(_)));
    let Role::Sink(sink) = &pipeline.stages[2].role else { panic!("write is a sink") };
    assert_eq!(sink.path(), Path::new("out.laz"));
}

#[test]
fn canonical_keys_have_defaults_but_no_places() {
    let pipeline = parse(GOOD).unwrap();
    let keys: Vec<String> = pipeline.stages.iter().map(|s| s.keys.to_string()).collect();
    assert_eq!(keys[0], r#"{"points":1000,"scene":"part","seed":0}"#);
    assert_eq!(keys[1], r#"{"angle":0.0,"names":[],"neighbors":12}"#);
    assert_eq!(keys[2], r#"{"dimensions":[],"drop":[]}"#);
}

#[test]
fn settings_are_read() {
    let run = "[run]\nmemory = \"1.5GiB\"\nthreads = 3\nscratch = \"s\"\nreport = \"r.json\"\n\
               lattice = 0.001\nnonfinite = \"drop\"\ntile_points = 5000\nsimd = \"portable\"\n\
               z_scale = 0.5\nunits = \"ignore\"\n";
    let settings = parse(&format!("{run}{GOOD}")).unwrap().settings;
    assert_eq!(settings.memory, Some(1_610_612_736));
    assert_eq!(settings.threads.unwrap().get(), 3);
    assert_eq!(settings.scratch.as_deref(), Some(Path::new("s")));
    assert_eq!(settings.report.as_deref(), Some(Path::new("r.json")));
    assert_eq!(settings.lattice, Some(0.001));
    assert_eq!(settings.nonfinite, Nonfinite::Drop);
    assert_eq!(settings.tile_points.unwrap().get(), 5000);
    assert_eq!(settings.simd, SimdSetting::Portable);
    assert_eq!((settings.z_scale, settings.units), (Some(ZScale::Factor(0.5)), MixedUnits::Ignore));
    assert_eq!(
        parse(&format!("[run]\nmemory = 4096\n{GOOD}")).unwrap().settings.memory,
        Some(4096)
    );
}

#[test]
fn every_mistake_is_told_at_once_with_its_place() {
    let text = "\
[run]
memory = \"2G\"
thraeds = 4

[[stage]]
kind = \"synth\"
scene = \"alps\"
pionts = 1_000

[[stage]]
kind = \"thinn\"

[[stage]]
kind = \"thin\"
neighbours = 12
neighbors = -3
angle = \"wide\"
pick = \"middle\"
names = [\"a\", 7]

[[stages]]
kind = \"write\"
";
    let expected = "\
12 mistakes
p.toml:2:10: `memory`: `2G` is no size such as 512MiB or 2GiB: write 2GiB (units: B, KiB, MiB, GiB, TiB, kB, MB, GB, TB)
  2 | memory = \"2G\"
    |          ^^^^
p.toml:3:1: `[run]` has no key `thraeds`
  3 | thraeds = 4
    | ^^^^^^^
    = did you mean `threads`? keys: existing, headers, lattice, memory, noise, nonfinite, provenance, report, scratch, simd, spill, threads, tile_points, units, withheld, z_scale
p.toml:7:9: `scene` cannot be `alps`
  7 | scene = \"alps\"
    |         ^^^^^^
    = did you mean `als`? valid: als, part, plane, sphere, squares-random, squares-uniform
p.toml:8:1: `synth` has no key `pionts`
  8 | pionts = 1_000
    | ^^^^^^
    = did you mean `points`? keys: front, noise, noise_in, outliers, points, scene, seed
p.toml:11:8: there is no stage `thinn`
  11 | kind = \"thinn\"
     |        ^^^^^^^
     = did you mean `thin`? stages: synth, thin, write
p.toml:15:1: `thin` has no key `neighbours`
  15 | neighbours = 12
     | ^^^^^^^^^^
     = did you mean `neighbors`? keys: angle, names, neighbors, pick
p.toml:16:13: `neighbors`: takes a whole number from 0, not -3
  16 | neighbors = -3
     |             ^^
p.toml:17:9: `angle`: takes a number, not the text \"wide\"
  17 | angle = \"wide\"
     |         ^^^^^^
p.toml:18:8: `pick` cannot be `middle`
  18 | pick = \"middle\"
     |        ^^^^^^^^
     = valid: center, first, median
p.toml:19:15: `names`: takes a text in quotes, not 7
  19 | names = [\"a\", 7]
     |               ^
p.toml:21:3: a pipeline file has no `stages`: write [[stage]]
  21 | [[stages]]
     |   ^^^^^^
p.toml:22:8: a `write` needs `write.path` or `write.folder`
  22 | kind = \"write\"
     |        ^^^^^^^
     = `write.path` is one file, `write.folder` gets one for each input
";
    assert_eq!(told(text), expected);
}

#[test]
fn one_mistake_is_told_alone() {
    let expected = "\
p.toml:8:1: `thin` has no key `neighbor`
  8 | neighbor = 12
    | ^^^^^^^^
    = did you mean `neighbors`? keys: angle, names, neighbors, pick
";
    assert_eq!(told(&GOOD.replace("neighbors", "neighbor")), expected);
}

#[test]
fn what_a_stage_refuses_is_told_at_the_key_it_blames() {
    let expected = "\
p.toml:8:9: an angle is at most π
  8 | angle = 6
    |         ^
    = write it as 6deg
";
    assert_eq!(told(&GOOD.replace("neighbors = 12", "angle = 6")), expected);
}

#[test]
fn text_that_is_not_toml_is_told_with_its_place() {
    let text = told("[[stage]]\nkind = \"synth\nscene = part\n");
    assert!(text.contains("p.toml:2:"), "{text}");
    assert!(text.contains("p.toml:3:9: not TOML"), "{text}");
}

#[test]
fn dates_and_numbers_that_are_not_finite_are_refused() {
    assert!(told(&GOOD.replace("12", "1979-05-27")).contains("p.toml:8:13: no key takes a date"));
    for number in ["nan", "inf", "-inf", "1e999"] {
        let text = told(&GOOD.replace("neighbors = 12", &format!("angle = {number}")));
        assert!(text.starts_with("p.toml:8:9: no key takes a number that is not finite"), "{text}");
    }
    let huge = told(&GOOD.replace("12", "99999999999999999999999"));
    assert!(huge.contains("p.toml:8:13: `neighbors`: the whole number is too large"), "{huge}");
}

#[test]
fn a_chain_that_cannot_be_run_is_refused() {
    let synth = "[[stage]]\nkind = \"synth\"\nscene = \"part\"\npoints = 9\n";
    let thin = "[[stage]]\nkind = \"thin\"\n";
    let write = "[[stage]]\nkind = \"write\"\npath = \"a.laz\"\n";
    let again = "[[stage]]\nkind = \"write\"\npath = \"b.ply\"\n";
    for (text, expected) in [
        (String::new(), "p.toml:1:1: a pipeline needs stages"),
        (format!("{thin}{write}"), "p.toml:2:8: the first stage must be a source, such as `read`"),
        (
            format!("{synth}{synth}{write}"),
            "p.toml:10:8: the sources of a pipeline are one scan: take from all of them",
        ),
        (
            format!("{synth}{write}{thin}"),
            "p.toml:9:8: nothing takes these points: end with `write`",
        ),
        (format!("{synth}{thin}"), "p.toml:6:8: nothing takes these points: end with `write`"),
        (format!("{synth}{write}{write}"), "p.toml:10:8: a.laz is written twice"),
        (
            format!("[run]\nreport = \"a.laz\"\n{synth}{write}"),
            "p.toml:2:10: a.laz is written twice",
        ),
        (
            format!(
                "{synth}{thin}[[stage]]\nkind = \"write\"\nfolder = \"f\"\norder = \"input\"\n"
            ),
            "p.toml:10:9: `write.order = \"input\"` is for one file of all inputs",
        ),
        ("run = 3\n".to_owned() + GOOD, "p.toml:1:1: `run` is a table: write [run]"),
        ("stage = 3\n".to_owned(), "p.toml:1:1: a stage is one of several tables: write [[stage]]"),
        (format!("[[stage]]\npath = \"x\"\n{GOOD}"), "p.toml:1:1: a stage needs `kind`"),
        (format!("[[stage]]\nkind = 3\n{GOOD}"), "p.toml:2:8: `kind` takes a text in quotes"),
    ] {
        let told = told(&text);
        assert!(told.starts_with(expected), "{expected}\n{told}");
    }
    assert!(parse(&format!("{synth}{write}{again}")).is_ok());
    assert!(parse(&format!("{synth}{write}order = \"input\"\n")).is_ok());
}

#[test]
fn from_names_an_earlier_stage() {
    let synth = "[[stage]]\nkind = \"synth\"\nname = \"scan\"\nscene = \"part\"\npoints = 9\n";
    let thin = "[[stage]]\nkind = \"thin\"\nname = \"less\"\nfrom = \"scan\"\n";
    let write =
        |from: &str| format!("[[stage]]\nkind = \"write\"\npath = \"a.laz\"\nfrom = \"{from}\"\n");
    let good = parse(&format!("{synth}{thin}{}", write("less"))).unwrap();
    assert_eq!((&good.stages[1].from[..], &good.stages[2].from[..]), (&[0][..], &[1][..]));
    assert_eq!(good.stages[1].name.as_deref(), Some("less"));
    // A sink may take from any stage above; what works on the points is one chain.
    let both = parse(&format!(
        "{synth}{thin}{}{}",
        write("scan"),
        write("less").replace("a.laz", "b.laz")
    ));
    assert_eq!(both.unwrap().stages[2].from, [0]);
    let unused = told(&format!("{synth}{thin}{}", write("scan")));
    assert!(unused.contains("no output takes what `thin` leaves"), "{unused}");
    let unknown = told(&format!("{synth}{thin}{}", write("lest")));
    assert!(unknown.contains("did you mean `less`? names: less, scan"), "{unknown}");
    for (name, wrong) in [
        ("run", "is a table of the file already"),
        ("thin", "is a kind of stage already"),
        ("a.b", "is made of letters"),
        ("", "is made of letters"),
        ("less", "another stage above"),
    ] {
        let text = format!("{synth}{thin}{}name = \"{name}\"\n", write("less"));
        assert!(told(&text).contains(wrong), "{name}");
    }
}

#[test]
fn an_input_is_never_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let scan = folder.path().join("scan.laz");
    std::fs::write(&scan, b"").unwrap();
    let text = format!(
        "[[stage]]\nkind = \"read\"\npath = \"{scan}\"\n[[stage]]\nkind = \"write\"\npath = \"{other}\"\n",
        scan = scan.display(),
        other = folder.path().join(".").join("scan.laz").display(),
    );
    let registry = registry().with::<pointmill::io::Read>();
    let told = Graph::parse(&text, "p.toml", &registry).unwrap_err().to_string();
    assert!(told.starts_with("p.toml:6:8: ") && told.contains("is an input"), "{told}");
}

#[test]
fn inputs_are_looked_up_and_their_formats_agree() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["b.laz", "a.las", "c.ply", "d.abc"] {
        std::fs::write(folder.path().join(name), b"").unwrap();
    }
    let registry = registry().with::<pointmill::io::Read>();
    let at = |name: &str| format!("\"{}\"", folder.path().join(name).display());
    let read = |path: &str| {
        let text = format!(
            "[[stage]]\nkind = \"read\"\npath = {path}\n[[stage]]\nkind = \"write\"\npath = \"out.laz\"\n"
        );
        Graph::parse(&text, "p.toml", &registry).map(|pipeline| {
            let Role::Source(source) = &pipeline.stages[0].role else { panic!("read is a source") };
            assert_eq!(pipeline.stages[0].keys.to_string(), "{}");
            source.paths()
        })
    };
    let both = ["a.las", "b.laz"].map(|name| folder.path().join(name));
    assert_eq!(read(&at("*.la?")).unwrap(), both);
    for (path, expected) in [
        (at("*.e57"), "p.toml:3:8: no file matches"),
        (at("[ab]*.laz/"), "p.toml:3:8: no file matches"),
        (format!("[{}, {}]", at("a.las"), at("c.ply")), "cannot be read together"),
        (at("d.abc"), "names no format"),
        ("[]".to_owned(), "p.toml:3:8: no input is named"),
        ("3".to_owned(), "p.toml:3:8: `path`: takes a path or a list of paths, not 3"),
    ] {
        let told = read(&path).unwrap_err().to_string();
        assert!(told.contains(expected), "{path}: {told}");
    }
}

#[test]
fn keys_of_write_fit_its_format() {
    let told_of = |keys: &str| told(&GOOD.replace("path = \"out.laz\"", keys));
    for (keys, expected) in [
        ("path = \"out.abc\"", "p.toml:12:8: the extension of `out.abc` names no format"),
        ("path = \"a.ply\"\nscale = 1", "p.toml:13:9: `write.scale` is for las and laz"),
        ("path = \"a.laz\"\nencoding = \"ascii\"", "p.toml:13:12: `write.encoding` is for ply"),
        (
            "path = \"a.laz\"\nscale = [1, 2]",
            "p.toml:13:9: `scale`: takes a number above 0 without a unit",
        ),
        ("path = \"a.laz\"\nscale = [1, 2, 3, 4]", "`scale`: has 1 values too many"),
        ("path = \"a.laz\"\nscale = [1, 0, 1]", "p.toml:13:13: `scale`: takes a number above 0"),
        (
            "path = \"a.laz\"\ndimensions = [\"NormalX\", \"NormalX\"]",
            "p.toml:13:14: `dimensions`: has NormalX twice",
        ),
        ("path = \"a.laz\"\norder = \"random\"", "valid: canonical, input"),
        ("format = \"las\"", "p.toml:11:8: a `write` needs `write.path`"),
    ] {
        let told = told_of(keys);
        assert!(told.contains(expected), "{keys}: {told}");
    }
    let right = "path = \"out.dat\"\nformat = \"las\"\nscale = [0.01, 0.01, 0.001]\n\
                 dimensions = [\"NormalX\", \"NormalY\", \"NormalZ\"]";
    let pipeline = parse(&GOOD.replace("path = \"out.laz\"", right)).unwrap();
    let Role::Sink(sink) = &pipeline.stages[2].role else { panic!("write is a sink") };
    assert_eq!(sink.computed(), pointmill::point::names::NORMAL);
}

#[test]
fn arguments_take_the_place_of_values() {
    let pipeline = with(&[
        "thin.neighbors=20",
        "thin.1.angle = 0.5",
        "thin.pick=median",
        "thin.names=[\"a=b\"]",
        "write.path=other.las",
        "run.memory=64MiB",
        "run.threads=2",
        "thin.neighbors=21",
    ])
    .unwrap();
    let expected = r#"{"angle":0.5,"names":["a=b"],"neighbors":21,"pick":"median"}"#;
    assert_eq!(pipeline.stages[1].keys.to_string(), expected);
    assert_eq!(pipeline.settings.memory, Some(64 << 20));
    assert_eq!(pipeline.settings.threads.unwrap().get(), 2);
    let Role::Sink(sink) = &pipeline.stages[2].role else { panic!("write is a sink") };
    assert_eq!(sink.path(), Path::new("other.las"));
}

#[test]
fn an_argument_mends_the_file() {
    let broken = GOOD.replace("neighbors = 12", "neighbors = \"many\"");
    assert!(parse(&broken).is_err());
    let sets = [Set::parse("thin.neighbors=4").unwrap()];
    assert!(Graph::parse_with(&broken, "p.toml", &registry(), &sets).is_ok());
}

#[test]
fn several_stages_of_a_kind_are_told_apart() {
    let text = GOOD.replace(
        "[[stage]]\nkind = \"write\"",
        "[[stage]]\nkind = \"thin\"\nname = \"last\"\n\n[[stage]]\nkind = \"write\"",
    );
    let set = |sets: &[&str]| {
        let sets: Vec<Set> = sets.iter().map(|s| Set::parse(s).unwrap()).collect();
        Graph::parse_with(&text, "p.toml", &registry(), &sets)
    };
    let good = set(&["thin.1.angle=1", "thin.2.neighbors=2", "last.angle=2"]).unwrap();
    assert_eq!(good.stages[1].keys.to_string(), r#"{"angle":1.0,"names":[],"neighbors":12}"#);
    assert_eq!(good.stages[2].keys.to_string(), r#"{"angle":2.0,"names":[],"neighbors":2}"#);
    let told = set(&["thin.angle=1"]).unwrap_err().to_string();
    let expected = "\
--set: 2 stages are `thin`
   | thin.angle=1
   | ^^^^
   = write: thin.1, thin.2";
    assert_eq!(told, expected);
}

#[test]
fn mistakes_of_an_argument_point_into_it() {
    let told = |set: &str| with(&[set]).map(|_| ()).unwrap_err().to_string();
    let expected = "\
--set: `thin` has no key `neighbours`
   | thin.neighbours=12
   |      ^^^^^^^^^^
   = did you mean `neighbors`? keys: angle, names, neighbors, pick";
    assert_eq!(told("thin.neighbours=12"), expected);
    let expected = "\
--set: `neighbors`: takes a whole number from 0, not the text \"ten\"
   | thin.neighbors=ten
   |                ^^^";
    assert_eq!(told("thin.neighbors=ten"), expected);
    let expected = "\
--set: this pipeline has no stage `thn`
   | thn.neighbors=3
   | ^^^
   = did you mean `thin`? stages: accept, run, synth, thin, write";
    assert_eq!(told("thn.neighbors=3"), expected);
    for (set, expected) in [
        ("neighbors=3", "it is not said of which stage"),
        (".neighbors=3", "it is not said of which stage"),
        ("thin.kind=write", "`kind` is for the pipeline file alone"),
        ("thin.0.angle=1", "no stage `thin.0`"),
        ("thin.2.angle=1", "no stage `thin.2`"),
        ("run.memory=-3", "takes a size such as \"2GiB\", or bytes, not -3"),
        ("run.simd=avx", "valid: auto, avx2, avx512, portable"),
        ("thin.angle=nan", "not finite"),
        ("thin.angle=4", "an angle is at most π"),
        ("thin.neighbors", "there is no `=`"),
        ("ä.ö=ü", "no stage `ä`"),
    ] {
        let told = told(set);
        assert!(told.contains(expected), "{set}: {told}");
    }
}

#[test]
fn a_file_of_nonsense_is_told_in_short() {
    let text: String = (0..100).map(|i| format!("[word{i}]\n")).collect();
    let told = told(&text);
    assert!(told.starts_with("101 mistakes\n"), "{told}");
    assert!(told.ends_with("and 81 more\n"), "{told}");
    let long = told_len(&format!("{}[", "x".repeat(100_000)));
    assert!(long < 1000, "{long}");
}

fn told_len(text: &str) -> usize {
    told(text).len()
}

#[test]
fn a_pipeline_file_is_named_when_it_cannot_be_read() {
    let missing = Graph::read(Path::new("/no/such.toml"), &registry(), &[]).unwrap_err();
    assert_eq!(missing.kind(), ErrorKind::Io);
    assert_eq!(missing.path(), Some(Path::new("/no/such.toml")));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.toml");
    std::fs::write(&file, b"a = \"\xff\"").unwrap();
    let binary = Graph::read(&file, &registry(), &[]).unwrap_err();
    assert_eq!((binary.kind(), binary.byte()), (ErrorKind::Pipeline, Some(5)));
}

/// A tile stage that removes points by their neighbours, and one that does so by cubes alone.
macro_rules! removing {
    ($stage:ident, $kind:literal, $neighbors:literal) => {
        #[derive(Serialize, Deserialize, JsonSchema)]
        struct $stage {}

        impl StageKind for $stage {
            const KIND: &'static str = $kind;
            const ROLE: RoleName = RoleName::OnTiles;
            const ABOUT: &'static str = "Removes.";

            fn build(self, _: &StagePlace) -> Result<Role> {
                Ok(Role::TileOp(Box::new(self)))
            }
        }

        impl TileOp for $stage {
            fn needs(&self) -> Needs {
                Needs::none().neighbors($neighbors).removes(None)
            }

            fn run(&self, _: &mut Tile, _: &mut Tally) -> Result<()> {
                Ok(())
            }
        }
    };
}
removing!(Lonely, "lonely", 5);
removing!(Cubes, "cubes", 0);

#[test]
fn a_neighbourhood_after_any_removal_is_a_second_pass() {
    let registry = Registry::builtin().with::<Lonely>().with::<Cubes>();
    let plan = |stages: &[&str]| {
        let mut text = "[[stage]]\nkind = 'synth'\nscene = 'plane'\npoints = 9\n".to_owned();
        for kind in stages {
            text += &format!("[[stage]]\nkind = '{kind}'\n");
        }
        text += "[[stage]]\nkind = 'write'\npath = 'never-written.las'\n";
        Graph::parse(&text, "p.toml", &registry).unwrap().plan(&Overrides::default())
    };
    for removal in ["lonely", "cubes"] {
        let passes = |stages: &[&str]| {
            let plan = plan(stages).unwrap().to_string();
            plan.lines().filter(|line| line.starts_with("pass ")).count()
        };
        assert_eq!(passes(&["normals", "cells", "median"]), 1);
        assert_eq!(passes(&[removal, "normals", "cells", "median"]), 2);
        assert_eq!(passes(&["normals", "cells", "median", removal]), 2);
        assert_eq!(passes(&["normals", "cells", "median", "normals", "cells", "median"]), 2);
        let unread = plan(&["normals", removal, "normals", "cells", "median"]).err().unwrap();
        assert!(unread.to_string().contains("that nothing has read"), "{unread}");
    }
    assert!(plan(&["normals", "cells", "median"]).is_ok());
}

/// A tile stage that reads a dimension of the records.
#[derive(Serialize, Deserialize, JsonSchema)]
struct Bright {
    dimension: String,
}

impl StageKind for Bright {
    const KIND: &'static str = "bright";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Reads a dimension.";

    fn build(self, _: &StagePlace) -> Result<Role> {
        Ok(Role::TileOp(Box::new(self)))
    }
}

impl TileOp for Bright {
    fn needs(&self) -> Needs {
        Needs::none().looks_at([&*self.dimension])
    }

    fn run(&self, _: &mut Tile, _: &mut Tally) -> Result<()> {
        Ok(())
    }
}

#[test]
fn a_stage_that_works_on_tiles_reads_no_dimension_that_these_have_not() {
    let registry = Registry::builtin().with::<Bright>();
    let plan = |dimension: &str| {
        let text = format!(
            "[[stage]]\nkind = 'synth'\nscene = 'plane'\npoints = 9\n[[stage]]\nkind = 'bright'\n\
             dimension = '{dimension}'\n[[stage]]\nkind = 'write'\npath = 'never-written.las'\n"
        );
        Graph::parse(&text, "p.toml", &registry).unwrap().plan(&Overrides::default())
    };
    assert!(plan("Z").is_ok());
    let told = plan("Intensity").err().unwrap();
    assert!(told.to_string().contains("`bright` needs Intensity, which stages that work on tiles"));
    assert!(told.to_string().contains("p.toml:6:8: "), "{told}");
    let told = plan("Colour").err().unwrap();
    assert!(told.to_string().contains("needs Colour, which nothing before it gives"), "{told}");
}
