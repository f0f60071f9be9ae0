//! Parameters of pipelines: what they take, where they stand, and every mistake with them.

use std::fs;

use pointmill::{Graph, ParameterType, PipelineText, Registry, Set};

use crate::support::command::{command, fails, pointmill, scans};

const TEXT: &str = "\
[params]
keep = '10%'
out = {type = 'path', default = 'out', about = 'Folder of the outputs'}
neighbors = {default = 10, about = 'Nearest others'}
format = {choices = ['laz', 'las'], default = 'laz'}
scale = {type = 'list', default = [0.01, 0.01, 0.001]}
points = {type = 'whole', default = '${ENV:POINTS:-5k}'}

[run]
scratch = '${ENV:SCRATCH}'

[[stage]]
kind = 'synth'
scene = 'part'
points = '${points}'

[[stage]]
kind = 'normals'
neighbors = '${neighbors}'

[[stage]]
kind = 'cells'
keep = '${keep}'

[[stage]]
kind = 'median'

[[stage]]
kind = 'write'
path = '${out}/$${a}-${neighbors}-${ENV:NAME:-x}.${format}'
scale = '${scale}'
drop = ['${format}', 'b']
";

fn graph(text: &str, params: &[&str]) -> pointmill::Result<Graph> {
    let sets: Vec<Set> = params.iter().map(|param| Set::param(param).unwrap()).collect();
    let variables = |name: &str| match name {
        "SCRATCH" => Some("/scratch".into()),
        "NAME" | "POINTS" => Some("".into()),
        _ => None,
    };
    let text = PipelineText::new(text, "p.toml").with_environment(variables);
    text.graph(&Registry::builtin(), &sets)
}

fn told(text: &str, params: &[&str]) -> String {
    graph(text, params).map(|_| ()).unwrap_err().to_string()
}

fn path(graph: &Graph) -> String {
    let pointmill::stage::Role::Sink(sink) = &graph.stages[4].role else { panic!("a sink") };
    sink.path().display().to_string()
}

#[test]
fn values_take_defaults_and_what_is_given() {
    let by_default = graph(TEXT, &[]).unwrap();
    assert_eq!(path(&by_default), "out/${a}-10-x.laz");
    assert_eq!(by_default.settings.scratch.as_deref().unwrap().to_str(), Some("/scratch"));
    let keys = |graph: &Graph, n: usize| graph.stages[n].keys.clone();
    assert_eq!(keys(&by_default, 0)["points"], 5000);
    assert_eq!(keys(&by_default, 1)["neighbors"], 10);
    assert_eq!(keys(&by_default, 4)["scale"], serde_json::json!([0.01, 0.01, 0.001]));
    assert_eq!(keys(&by_default, 4)["drop"], serde_json::json!(["laz", "b"]));
    let given = [
        "keep = 250k",
        "out=a=b/${c}",
        "neighbors=20",
        "neighbors=12",
        "format=las",
        "scale=[1, 1, 2]",
        "points=1e4",
    ];
    let given = graph(TEXT, &given).unwrap();
    assert_eq!(path(&given), "a=b/${c}/${a}-12-x.las");
    assert_eq!(keys(&given, 0)["points"], 10_000);
    assert_eq!(keys(&given, 2)["keep"], 250_000);
    assert_eq!(keys(&given, 4)["scale"], serde_json::json!([1.0, 1.0, 2.0]));
    // What an argument sets is no text of the file: nothing in it is a reference.
    let sets = [Set::parse("write.path=${x}.laz").unwrap(), Set::parse("run.scratch=s").unwrap()];
    let set = PipelineText::new(TEXT, "p.toml").graph(&Registry::builtin(), &sets).unwrap();
    assert_eq!(path(&set), "${x}.laz");
}

#[test]
fn a_measure_is_a_number_or_has_a_unit() {
    let text = "[params]\nside = {type = 'measure', default = 500}\n\
                [[stage]]\nkind = 'synth'\nscene = 'als'\npoints = 10\n\
                [[stage]]\nkind = 'grid'\nside = '${side}'\n\
                [[stage]]\nkind = 'write'\npath = 'o.laz'\n";
    let side = |params: &[&str]| graph(text, params).unwrap().stages[1].keys["side"].clone();
    assert_eq!(side(&[]), 500.0);
    assert_eq!(side(&["side=0.5"]), 0.5);
    assert_eq!(side(&["side=50 cm"]), "50cm");
    let wrong = told(text, &["side=wide"]);
    assert!(
        wrong.contains("takes a number, or one with a unit such as 5 cm, not `wide`"),
        "{wrong}"
    );
}

#[test]
fn a_value_that_does_not_fit_is_told_where_it_was_given() {
    let expected = "\
--param: `keep`: takes";
    let wrong = told(TEXT, &["keep=lots"]);
    assert!(wrong.starts_with(expected), "{wrong}");
    assert!(wrong.contains("\n   | keep=lots\n   |      ^^^^"), "{wrong}");
    let wrong = told(&TEXT.replace("default = 10,", "default = -10,"), &[]);
    assert!(wrong.starts_with("p.toml:4:24: `neighbors`: takes"), "{wrong}");
    let wrong = told(&TEXT.replace("'part'", "'${keep}'"), &["keep=prat"]);
    assert!(wrong.contains("--param: `scene` cannot be `prat`"), "{wrong}");
    assert!(wrong.contains("did you mean `part`?"), "{wrong}");
}

#[test]
fn every_mistake_with_parameters_is_told_with_its_place() {
    for (from, to, params, expected) in [
        ("", "", &["kepe=1"][..], "--param: this pipeline has no parameter `kepe`"),
        ("", "", &["kepe=1"], "did you mean `keep`? parameters: format, keep, neighbors, out, "),
        ("", "", &["neighbors=ten"], "the parameter `neighbors` takes a whole number, not `ten`"),
        ("", "", &["points=x"], "--param: the parameter `points` takes a whole number, not `x`"),
        ("", "", &["out="], "--param: the parameter `out` takes a path, not ``"),
        ("", "", &["scale=3"], "the parameter `scale` takes a list such as [a, b], not `3`"),
        ("", "", &["format=lsa"], "--param: the parameter `format` cannot be `lsa`"),
        ("", "", &["format=lsa"], "did you mean `las`? valid: las, laz"),
        (
            "default = 'laz'",
            "default = 'ply'",
            &[],
            "p.toml:5:47: the parameter `format` cannot be",
        ),
        (
            "'path', default = 'out'",
            "'path'",
            &[],
            "p.toml:3:1: the parameter `out` has no default",
        ),
        ("'path', default = 'out'", "'path'", &[], "give `params.out = VALUE`"),
        ("keep = '${keep}'", "", &[], "p.toml:2:1: no value uses the parameter `keep`"),
        ("'${keep}'", "'${kepe}'", &[], "p.toml:23:9: there is no parameter `kepe`"),
        ("'${keep}'", "'${kepe}'", &[], "did you mean `keep`?"),
        ("'${keep}'", "'${keep'", &[], "p.toml:23:9: `${` is not closed by `}`"),
        ("'${keep}'", "'x${a b}'", &[], "p.toml:23:10: `${a b}` names no parameter"),
        ("'${keep}'", "'${scale}%'", &[], "the list `scale` cannot be a part of a text"),
        ("SCRATCH}", "NOWHERE}", &[], "p.toml:10:12: the environment has no `NOWHERE`"),
        ("SCRATCH}", "NOWHERE}", &[], "`${ENV:NOWHERE:-default}` does without"),
        ("'10%'", "'${out}'", &[], "a default cannot refer to `out`, another parameter"),
        ("'10%'", "{about = 'x'}", &[], "p.toml:2:1: `params.keep` needs `type` or `default`"),
        ("'10%'", "{typ = 'text'}", &[], "`params.keep` has no key `typ`"),
        (
            "'10%'",
            "{type = 'txet'}",
            &[],
            "did you mean `text`? valid: flag, list, measure, number, ",
        ),
        ("'10%'", "{type = 'flag', default = 3}", &[], "takes true or false, not `3`"),
        ("'10%'", "{type = 'number', default = 'x'}", &["keep=1"], "takes a number, not `x`"),
        ("['laz', 'las']", "['laz', 7]", &[], "p.toml:5:29: the parameter `format` takes a text"),
        ("[params]\nkeep", "params = 3\n#", &[], "`params` is a table: write [params]"),
        ("keep = '10%'", "'a b' = 1", &[], "p.toml:2:1: a parameter's name is made of letters"),
    ] {
        let text = TEXT.replacen(from, to, 1);
        assert!(from.is_empty() || text != TEXT, "{from}");
        let told = told(&text, params);
        assert!(told.contains(expected), "{to} {params:?}: {expected}\n{told}");
    }
    for (param, expected) in [
        ("keep", "--param: there is no `=`"),
        ("=3", "--param: a parameter's name is made of letters"),
        ("a.b=3", "--param: a parameter's name is made of letters"),
    ] {
        let told = Set::param(param).unwrap_err().to_string();
        assert!(told.contains(expected), "{told}");
    }
    let set = Set::parse("params.keep=3").unwrap_err().to_string();
    assert!(set.contains("a parameter has an argument of its own"), "{set}");
}

#[test]
fn a_wrong_parameter_brings_no_further_mistake_and_hides_none() {
    // A name that is mistyped leaves its parameter unused.
    let mistyped = told(&TEXT.replace("'${keep}'", "'${kepe}'"), &[]);
    assert!(mistyped.starts_with("p.toml:23:9: there is no parameter `kepe`"), "{mistyped}");
    // The value of `scene` is not known, which is told where it comes from, and not at the stage.
    let text = TEXT.replace("scene = 'part'", "scene = '${scene}'\npionts = 3");
    let text = text.replace("[params]", "[params]\nscene = {type = 'text'}");
    let told = told(&text, &[]);
    assert!(told.starts_with("2 mistakes\np.toml:2:1: the parameter `scene` has no"), "{told}");
    assert!(told.contains("`synth` has no key `pionts`"), "{told}");
}

#[test]
fn parameters_are_listed() {
    let all = PipelineText::new(TEXT, "p.toml").parameters().unwrap();
    let names: Vec<&str> = all.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names, ["keep", "out", "neighbors", "format", "scale", "points"]);
    assert_eq!((all[0].takes, all[0].default.as_deref()), (ParameterType::Text, Some("10%")));
    assert_eq!((all[1].takes, &*all[1].about), (ParameterType::Path, "Folder of the outputs"));
    assert_eq!(all[2].takes, ParameterType::Whole);
    assert_eq!(all[3].choices, ["laz", "las"]);
    assert_eq!(all[4].default.as_deref(), Some("[0.01, 0.01, 0.001]"));
    let json = "{\"params\": {\"a\": 3}, \"stage\": []}";
    assert_eq!(PipelineText::new(json, "p").parameters().unwrap().len(), 1);
}

#[test]
fn commands_take_parameters_and_the_environment_and_list_them() {
    let at = tempfile::tempdir().unwrap();
    let text = TEXT.replace("[run]\nscratch = '${ENV:SCRATCH}'\n", "");
    let text = text.replace("drop = ['${format}', 'b']", "");
    let text =
        text.replace("ENV:NAME", "ENV:POINTMILL_TEST_NAME").replace("ENV:POINTS", "ENV:NONE");
    fs::write(at.path().join("p.toml"), text).unwrap();
    fs::create_dir(at.path().join("o")).unwrap();
    let params = ["--param", "out=o", "--param", "points=3k", "--param", "keep=40%"];
    for name in ["check", "plan", "run"] {
        let (code, _, stderr) = pointmill(at.path(), &[&[name, "p.toml"], &params[..]].concat());
        assert_eq!(code, 0, "{name}: {stderr}");
    }
    assert!(at.path().join("o/${a}-10-x.laz").exists());
    let mut run = command(at.path(), &[&["run", "p.toml"], &params[..]].concat());
    assert!(run.env("POINTMILL_TEST_NAME", "tail").output().unwrap().status.success());
    assert!(at.path().join("o/${a}-10-tail.laz").exists());
    let wrong = ["run", "p.toml", "--param", "keep=10k%"];
    fails(at.path(), &wrong, 2, &["error: --param: `keep`: takes", "| keep=10k%\n   |      ^^^^"]);
    let lacking = fs::read_to_string(at.path().join("p.toml")).unwrap();
    let lacking = lacking.replace("type = 'path', default = 'out'", "type = 'path'");
    fs::write(at.path().join("q.toml"), lacking).unwrap();
    fails(at.path(), &["check", "q.toml"], 2, &["give `--param out=VALUE`"]);
    for arguments in [["run", "q.toml", "--help"], ["check", "-h", "q.toml"]] {
        let (code, stdout, stderr) = pointmill(at.path(), &arguments);
        assert_eq!((code, &*stderr), (0, ""));
        for line in [
            "Parameters of q.toml:\n  --param keep=TEXT        [default: 10%]\n",
            "  --param out=PATH         Folder of the outputs [must be given]\n",
            "  --param format=TEXT      [default: laz] [possible values: laz, las]\n",
        ] {
            assert!(stdout.contains("Usage: pointmill ") && stdout.contains(line), "{stdout}");
        }
    }
    let (code, stdout, stderr) = pointmill(at.path(), &["run", "none.toml", "--help"]);
    assert!(code == 1 && stdout.contains("Usage: ") && stderr.contains("none.toml"), "{stderr}");
    assert_eq!(pointmill(at.path(), &["run", "--help"]).0, 0);
    assert_eq!(pointmill(at.path(), &["reduce", "--help"]).0, 0);
}

#[test]
fn the_page_shows_a_pipeline_that_runs() {
    let page = include_str!("../../docs/pipeline.md");
    let shown = page.split("```").find(|block| block.starts_with("toml\n[params]")).unwrap();
    let shown = shown.strip_prefix("toml").unwrap();
    let at = scans(&["in.laz"]);
    fs::write(at.path().join("p.toml"), shown).unwrap();
    let run = ["run", "p.toml", "--param", "scan=in.laz", "--param", "keep=40%"];
    let (code, _, stderr) = pointmill(at.path(), &run);
    assert_eq!(code, 0, "{stderr}");
    for output in ["reduced.laz", "thin.laz"] {
        assert!(at.path().join(output).exists(), "{output}");
    }
}

#[test]
fn a_graph_prints_references_that_are_none_as_such() {
    let text = "[[stage]]\nkind = 'synth'\nscene = 'part'\npoints = 9\n\
                [[stage]]\nkind = 'write'\npath = '$${a}/$$${b}/${ENV:C:-c}.laz'\ndrop = ['$${d}']\n";
    let graph = Graph::parse(text, "p.toml", &Registry::builtin()).unwrap();
    let printed = graph.to_toml().unwrap();
    assert!(printed.contains("\"$${a}/$$${b}/c.laz\""), "{printed}");
    let again = Graph::parse(&printed, "p.toml", &Registry::builtin()).unwrap();
    assert_eq!(again.to_toml().unwrap(), printed);
    assert_eq!(again.to_json(), graph.to_json());
}
