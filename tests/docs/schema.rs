//! The JSON Schema of pipeline files accepts and refuses what the language does, as far as a schema
//! can tell.

use std::fs;
use std::path::{Path, PathBuf};

use boon::{Compiler, SchemaIndex, Schemas};
use pointmill::point::PointBatch;
use pointmill::quantity::Length;
use pointmill::report::Tally;
use pointmill::stage::{Needs, Role, RoleName, StageKind, StagePlace, Transform};
use pointmill::{Graph, KeyDescription, Registry};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{keep, root};

/// Thins out, see [`Registry`].
///
/// ```
/// // An example.
/// ```
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Thinning<const LIES: bool> {
    /// How far apart.
    distance: Length,
    /// Which stay.
    #[serde(default)]
    which: Which,
    /// How many at most.
    most: Option<u32>,
}

#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum Which {
    /// Any of them.
    #[default]
    AnyOne,
    /// The highest.
    Highest,
}

impl<const LIES: bool> StageKind for Thinning<LIES> {
    const KIND: &'static str = "thinning";
    const ROLE: RoleName = if LIES { RoleName::Sink } else { RoleName::Transform };
    const ABOUT: &'static str = "Thins out.";

    fn build(self, _: &StagePlace) -> pointmill::Result<Role> {
        Ok(Role::Transform(Box::new(Idle)))
    }
}

struct Idle;

impl Transform for Idle {
    fn needs(&self) -> Needs {
        Needs::none()
    }

    fn apply(&self, _: &mut PointBatch, _: &mut Tally) -> pointmill::Result<()> {
        Ok(())
    }
}

const THINNING: &str = "[[stage]]\nkind = 'synth'\nscene = 'als'\npoints = 9\n\
    [[stage]]\nkind = 'thinning'\ndistance = '1m'\nwhich = 'highest'\nclasses = [2]\n\
    [[stage]]\nkind = 'write'\npath = 'out.laz'\n";

#[test]
fn a_stage_of_a_program_is_described_as_those_that_are_built_in() {
    let registry = Registry::builtin().with::<Thinning<false>>();
    let described = registry.describe("thinning").unwrap();
    assert_eq!((&*described.about, &*described.docs), ("Thins out.", "Thins out, see `Registry`."));
    let keys = |key: &KeyDescription| {
        let default = key.default.as_ref().map(Value::to_string).unwrap_or_default();
        format!("{} = {} [{default}{}] {}", key.name, key.value, key.is_required, key.docs)
    };
    let keys: Vec<String> = described.keys.iter().map(keys).collect();
    let length = "a length (a number in the scan's unit, or such as `\"2m\"`)";
    assert_eq!(keys[0], format!("distance = {length} [true] How far apart."));
    assert_eq!(keys[1], "which = `\"any-one\"` or `\"highest\"` [\"any-one\"false] Which stay.");
    assert_eq!(keys[2], "most = a whole number [false] How many at most.");
    let words: Vec<&str> = described.keys[1].words.iter().map(|word| &*word.docs).collect();
    assert_eq!(words, ["Any of them.", "The highest."]);
    let limits: Vec<&str> = described.limits.iter().map(|key| &*key.name).collect();
    assert_eq!(limits, ["where", "classes", "with", "without"], "it streams");

    let validator = Validator::new(registry.schema());
    validator.check(THINNING).unwrap();
    assert!(validator.check(&THINNING.replace("highest", "lowest")).is_err());
    assert!(Validator::new(Registry::builtin().schema()).check(THINNING).is_err());
    assert!(Graph::parse(THINNING, "p.toml", &registry).is_ok());
}

#[test]
fn a_kind_whose_role_is_another_than_it_says_is_told_so() {
    let registry = Registry::builtin().with::<Thinning<true>>();
    let told = Graph::parse(THINNING, "p.toml", &registry).unwrap_err().to_string();
    assert!(told.contains("`thinning` says that its role is Sink, and it is Transform"), "{told}");
}

struct Validator {
    schemas: Schemas,
    pipeline: SchemaIndex,
}

impl Validator {
    fn new(schema: Value) -> Self {
        let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
        compiler.add_resource("pipeline.json", schema).unwrap();
        let pipeline = compiler.compile("pipeline.json", &mut schemas).unwrap();
        Validator { schemas, pipeline }
    }

    /// What it finds wrong with a text of TOML.
    fn check(&self, text: &str) -> Result<(), String> {
        let value: toml::Table = toml::from_str(text).unwrap();
        let value = serde_json::to_value(value).unwrap();
        self.schemas.validate(&value, self.pipeline).map_err(|wrong| format!("{wrong:#}"))
    }
}

fn files(folder: &str) -> Vec<PathBuf> {
    let all = fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path());
    all.collect()
}

fn text(file: &Path) -> String {
    fs::read_to_string(file).unwrap()
}

#[test]
fn the_schema_in_docs_is_that_of_the_built_in_stages() {
    let schema = serde_json::to_string_pretty(&Registry::builtin().schema()).unwrap();
    keep("docs/pipeline.schema.json", &(schema + "\n"));
}

#[test]
fn every_file_of_pipelines_is_what_the_schema_says() {
    let validator = Validator::new(Registry::builtin().schema());
    let files = files("pipelines");
    assert!(files.len() >= 7);
    for file in files {
        validator.check(&text(&file)).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    }
}

#[test]
fn what_the_language_refuses_by_kind_key_and_value_the_schema_refuses_too() {
    let validator = Validator::new(Registry::builtin().schema());
    let files = files("tests/docs/refused");
    assert!(files.len() >= 30);
    for file in files {
        let (name, text) = (file.display(), text(&file));
        assert!(validator.check(&text).is_err(), "{name} passes the schema");
        assert!(Graph::parse(&text, "p.toml", &Registry::builtin()).is_err(), "{name} is right");
    }
}

#[test]
fn whatever_the_language_takes_for_a_value_the_schema_takes_too() {
    let registry = Registry::builtin();
    let validator = Validator::new(registry.schema());
    for (run, stage) in [
        ("memory = '1.5 GiB'\nthreads = '1e0'", "kind = 'tap'"),
        ("memory = 1_000_000_000\nlattice = 1e-6", "kind = 'tap'\nname = 'größe_1-a'"),
        ("z_scale = 'auto'\nnoise = 'drop'", "kind = 'tap'\nclasses = [2, '6']"),
        ("z_scale = 0.3048", "kind = 'grid'\nside = '1e1 us-ft'\nwhere = 'Z > 3'"),
        ("", "kind = 'grid'\nside = 2\npick = 'median'\nsees = 'all'\nwith = ['key-point']"),
        ("", "kind = 'outliers'\nneighbors = '1e1'\nmultiplier = 2\nmark = 7"),
        ("", "kind = 'outliers'\nmethod = 'radius'\nradius = '5 cm'\nmin_neighbors = 3.0"),
        ("", "kind = 'normals'\nneighbors = 'auto'\norient = 'viewpoint'\nviewpoint = [1, 2, 3.5]"),
        ("", "kind = 'cells'\nside = 'spread'\nmax_angle = '6 deg'\nmax_side = 'none'\nby = []"),
        ("", "kind = 'cells'\nmax_angle = '6°'\nreference = [0, 0, -7]\nmin_points = '1k'"),
        ("", "kind = 'cells'\nkeep = '2.5 M'\nmin_spacing = 'auto'\nreference = 'z'"),
        ("", "kind = 'cells'\nkeep = 1e6\nside = 1\nmin_spacing = '10 mm'"),
        ("", "kind = 'cells'\nkeep = '12.5 %'\nby = ['Classification']\nmax_side = 3"),
        ("", "kind = 'assign'\nset = ['Classification = 7', 'UserData = 1']"),
        ("", "kind = 'stats'\ndimensions = ['Z']\nby_class = true"),
    ] {
        let text = format!(
            "[params]\nkept = 'out'\nending = {{ type = 'text', default = 'laz', about = 'E' }}\n\
             [run]\n{run}\n[[stage]]\nkind = 'synth'\nscene = 'als'\npoints = '1k'\n\
             [[stage]]\n{stage}\n\
             [[stage]]\nkind = 'write'\npath = '${{kept}}.${{ending}}'\nscale = 0.01\noffset = [0, 0.5, 0]\n\
             drop = ['GpsTime']\n"
        );
        let parsed = Graph::parse(&text, "p.toml", &registry);
        assert!(parsed.is_ok(), "{}\n{text}", parsed.unwrap_err());
        validator.check(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    }
}

#[test]
fn a_parameter_may_stand_for_every_value() {
    let (registry, mut replaced) = (Registry::builtin(), 0);
    let validator = Validator::new(registry.schema());
    for (kind, _) in registry.kinds() {
        let table = registry.describe(kind).unwrap();
        let keys = table.all_keys().map(|key| format!("{} = '${{p}}'\n", key.name));
        let keys: Vec<String> = keys.collect();
        replaced += keys.len();
        let text = format!("[[stage]]\nkind = '{kind}'\n{}", keys.concat());
        validator.check(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    }
    assert!(replaced > 60, "{replaced} keys");
}

#[test]
fn a_list_may_have_parameters_among_its_values() {
    let validator = Validator::new(Registry::builtin().schema());
    let text = "[[stage]]\nkind = 'drop'\nclasses = [7, '${class}']\nwith = ['${flag}']";
    validator.check(text).unwrap();
    assert!(validator.check(&text.replace("${", "{")).is_err());
}
