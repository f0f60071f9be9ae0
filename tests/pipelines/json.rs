//! Pipelines in JSON: the same keys and messages as in TOML, and nothing that JSON does not have.

use pointmill::{Graph, Registry, Set};

const GOOD: &str = r#"{
  "run": {"threads": 2, "memory": "1GiB"},
  "stage": [
    {"kind": "synth", "name": "scan", "scene": "part", "points": 1e3, "noise": null},
    {"kind": "cells", "side": 0.5, "max_angle": "6deg"},
    {"kind": "write", "path": "a.laz", "scale": [0.1, 0.1, 0.01]},
    {"kind": "write", "from": ["scan"], "path": "b.laz"}
  ]
}"#;

fn parse(text: &str) -> pointmill::Result<Graph> {
    Graph::parse(text, "p.json", &Registry::builtin())
}

fn told(text: &str) -> String {
    parse(text).map(|_| ()).unwrap_err().to_string()
}

#[test]
fn json_says_what_toml_says() {
    let toml = "[run]\nthreads = 2\nmemory = '1GiB'\n\
                [[stage]]\nkind = 'synth'\nname = 'scan'\nscene = 'part'\npoints = 1000\n\
                [[stage]]\nkind = 'cells'\nside = 0.5\nmax_angle = '6deg'\n\
                [[stage]]\nkind = 'write'\npath = 'a.laz'\nscale = [0.1, 0.1, 0.01]\n\
                [[stage]]\nkind = 'write'\nfrom = 'scan'\npath = 'b.laz'\n";
    let (json, toml) =
        (parse(GOOD).unwrap(), Graph::parse(toml, "p", &Registry::builtin()).unwrap());
    assert_eq!(json.to_json(), toml.to_json());
    assert_eq!(json.settings, toml.settings);
    assert_eq!(json.stages[1].line, Some(5));
    // By the name of the file, or by the first character.
    for (text, origin) in [(GOOD.to_owned(), "p"), (format!("\u{feff}\n\t {GOOD}"), "p.toml")] {
        assert!(Graph::parse(&text, origin, &Registry::builtin()).is_ok(), "{origin}");
    }
    // Editors find the schema by a key in the file.
    let named = GOOD.replacen('{', "{\"$schema\": \"pipeline.schema.json\", ", 1);
    assert_eq!(parse(&named).unwrap().to_json(), toml.to_json());
    assert!(told("stage = 3").contains("p.json:1:1: not JSON: "));
    assert!(told("").contains("p.json:1:1: a pipeline in JSON is an object"));
    let sets = [Set::parse("cells.side=2").unwrap()];
    let set = Graph::parse_with(GOOD, "p.json", &Registry::builtin(), &sets).unwrap();
    assert_eq!(set.stages[1].keys["side"], 2.0);
}

#[test]
fn mistakes_in_json_have_places_and_are_told_at_once() {
    let wrong = GOOD
        .replace("\"threads\": 2", "\"thraeds\": 2")
        .replace("\"cells\"", "\"celsl\"")
        .replace("\"6deg\"", "\"6dge\"")
        .replace("[\"scan\"]", "[\"scna\"]");
    let told = told(&wrong);
    for expected in [
        "3 mistakes\n",
        "p.json:2:11: `[run]` has no key `thraeds`\n  \
           2 |   \"run\": {\"thraeds\": 2, \"memory\": \"1GiB\"},\n    |           ^^^^^^^^^\n",
        "p.json:5:14: there is no stage `celsl`\n  \
           5 |     {\"kind\": \"celsl\", \"side\": 0.5, \"max_angle\": \"6dge\"},\n    \
             |              ^^^^^^^\n    = did you mean `cells`?",
        "p.json:7:32: no earlier stage that gives points is named `scna`",
    ] {
        assert!(told.contains(expected), "{expected}\n{told}");
    }
}

#[test]
fn what_is_no_json_is_refused_with_its_place() {
    for (from, to, expected) in [
        ("1e3", "9007199254740993", "4:66: beyond 9007199254740992 programs round"),
        ("1e3", "1e999", "4:66: no key takes a number that is not finite"),
        ("1e3", "NaN", "4:66: not JSON: unexpected token"),
        ("1e3", "NaN", "= JSON has texts in double quotes, numbers, true, false and null"),
        ("1e3", "-Infinity", "not JSON: infinity and NaN are not allowed"),
        ("1e3", "0x10", "4:66: not JSON: hexadecimal numbers"),
        ("1e3", "007", "4:67: not JSON: "),
        ("1e3", "'x'", "4:66: not JSON: single-quoted strings"),
        ("0.01]", "0.01,]", "not JSON: trailing commas are not allowed"),
        ("0.01]", "null]", "no list takes null"),
        ("\"noise\": null", "\"noise\": null, \"scene\": \"als\"", "4:86: `scene` is given twice"),
        ("\"run\"", "\"stage\": [], \"run\"", "3:3: `stage` is given twice"),
        ("{\n", "{ // why\n", "1:3: not JSON: comments are not allowed"),
        ("}\n  ]\n}", "}\n  ]\n", "1:1: not JSON: unterminated object"),
        ("}\n  ]\n}", "}\n  ]\n} {}", "not JSON: text cannot contain more than one JSON value"),
        ("\"run\": {", "\"run\": 3, \"rnu\": {", "2:13: a pipeline file has no `rnu`"),
        ("\"run\": {", "\"run\": 3, \"rnu\": {", "`run` is a table: write \"run\": {…}"),
        (
            "\"stage\": [",
            "\"stages\": [",
            "a pipeline file has no `stages`: write \"stage\": [{…}, {…}]",
        ),
        (
            "{\"kind\": \"cells\"",
            "3, {\"kind\": \"cells\"",
            "a stage is a table: write {\"kind\": …}",
        ),
        (
            "\"kind\": \"cells\"",
            "\"name\": \"cells\"",
            "a stage needs `kind`: write \"kind\": \"cells\"",
        ),
    ] {
        let wrong = GOOD.replacen(from, to, 1);
        assert!(wrong != GOOD, "{from}");
        let told = told(&wrong);
        assert!(told.contains(expected) && told.contains("p.json:"), "{to}: {expected}\n{told}");
    }
    // Large numbers are exact in quotes.
    let seed = GOOD.replace("\"noise\": null", "\"seed\": \"18446744073709551615\"");
    assert_eq!(parse(&seed).unwrap().stages[0].keys["seed"], u64::MAX);
    assert!(told("[]").contains("this is a pipeline of PDAL"));
    assert!(told("{}").contains("= begin with \"stage\": [{…}, {…}] and \"kind\": \"read\""));
}

#[test]
fn deep_nesting_is_refused_and_not_followed() {
    for (open, close) in [("[", "]"), ("{\"a\":", "}")] {
        let deep = format!("{{\"a\": {}1{}}}", open.repeat(100_000), close.repeat(100_000));
        assert!(told(&deep).contains("not JSON: maximum nesting depth exceeded"));
    }
}
