//! Target `pipeline`: the text of a pipeline file, and a plan of what is right in it.

use std::path::Path;

use pointmill::ErrorKind::{self, Data, Io, Memory, Pipeline as Wrong};
use pointmill::{Graph, Overrides, Registry};

use super::judge::{self, Judgement, Outcome, shape};
use super::{Target, las_seeds, mutate, vocabulary};
use crate::support::random::Random;

/// The target.
pub const TARGET: Target =
    Target { name: "pipeline", judge: target, seeds, mutate: change, at_home: true };

/// How a text that is no good is refused, and a plan.
const REFUSED: &[ErrorKind] = &[Wrong, Io];
const NO_PLAN: &[ErrorKind] = &[Wrong, Io, Data, Memory];
/// Mistakes that are told one by one, at most; the rest is a number.
const MOST_TOLD: usize = 64;

/// True for a text that might name files outside the working directory.
pub fn leaves_home(text: &str) -> bool {
    let lower = text.to_lowercase();
    let rooted = |(at, _)| {
        let before = lower[..at].chars().next_back();
        !before.is_some_and(|c: char| c.is_alphanumeric() || matches!(c, '*' | ']' | '?'))
    };
    lower.contains("..") || lower.contains("2f") || lower.match_indices('/').any(rooted)
}

fn target(_: &Path, data: &[u8]) -> Judgement {
    let Ok(text) = std::str::from_utf8(data) else {
        return Ok(Outcome { accepted: false, marks: vec!["no text".to_owned()] });
    };
    if leaves_home(text) {
        return Ok(Outcome { accepted: false, marks: vec!["leaves home".to_owned()] });
    }
    let registry = Registry::builtin();
    let parse = || Graph::parse(text, "p.toml", &registry);
    let pipeline = match (parse(), parse()) {
        (Ok(one), Ok(two)) if format!("{one:?}") == format!("{two:?}") => one,
        (Err(one), Err(two)) if one.to_string() == two.to_string() => {
            return mistakes(&one, text);
        }
        (one, two) => return Err(format!("parsed twice: {one:?} and {two:?}")),
    };
    let mut marks = vec![keys(&pipeline)];
    let plan = match pipeline.plan(&Overrides::default()) {
        Ok(plan) => plan,
        Err(error) => {
            let text = judge::proper("plan", &error, NO_PLAN)?;
            marks.push(format!("plan: {}", shape(&text)));
            return Ok(Outcome { accepted: true, marks });
        }
    };
    // What is planned for the memory and the threads depends on the machine.
    let told = plan.to_string();
    let same = told.lines().take_while(|line| !line.starts_with("threads"));
    marks.extend(same.map(|line| format!("planned: {}", shape(line))));
    Ok(Outcome { accepted: true, marks })
}

/// The stages of a pipeline that is right.
fn keys(pipeline: &Graph) -> String {
    let kinds: Vec<&str> = pipeline.stages.iter().map(|stage| stage.kind.as_str()).collect();
    format!("parsed: {}", kinds.join(" "))
}

/// Every mistake is a mark; each names a place in the text.
pub fn mistakes(error: &pointmill::Error, text: &str) -> Judgement {
    let told = judge::proper("parse", error, REFUSED)?;
    let marks: Vec<String> = told
        .lines()
        .filter_map(|line| line.strip_prefix("p.toml:"))
        .map(|line| format!("mistake: {}", shape(line)))
        .collect();
    if marks.is_empty() {
        return Err(format!("no mistake has a place: {told}"));
    }
    let lines = told.lines().filter_map(|line| line.strip_prefix("p.toml:")?.split(':').next());
    let beyond = |line: &str| line.parse().is_ok_and(|n: usize| n > text.matches('\n').count() + 1);
    if marks.len() > MOST_TOLD || lines.clone().any(beyond) {
        return Err(format!("{} mistakes are told, or one behind the text", marks.len()));
    }
    Ok(Outcome { accepted: false, marks })
}

fn change(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    let (len, words) = (data.len(), vocabulary::words());
    match random.below(6) {
        0..4 => mutate::lines(random, data, len, other, words),
        4 => {
            // A key of any stage, with a value of any kind.
            let key = String::from_utf8_lossy(random.one_of(words)).into_owned();
            let value = if random.one_in(2) {
                mutate::number_text(random)
            } else {
                String::from_utf8_lossy(random.one_of(words)).into_owned()
            };
            let at = data.iter().rposition(|b| *b == b'\n').map_or(len, |at| at + 1);
            let ends: Vec<usize> = (0..at).filter(|&i| data[i] == b'\n').map(|i| i + 1).collect();
            let at = if ends.is_empty() { at } else { random.one_of(&ends) };
            mutate::insert(data, at, format!("{key} = {value}\n").as_bytes());
        }
        _ => mutate::bytes(random, data, other, words),
    }
}

/// The pipelines that users copy.
pub const COPIED: [&str; 3] = [
    include_str!("../../pipelines/reduce.toml"),
    include_str!("../../pipelines/convert.toml"),
    include_str!("../../pipelines/demo.toml"),
];

/// Files for pipelines to read: sound and tiny, broken, none.
pub fn furnish(folder: &Path) {
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).expect("a file to read");
    };
    let las = las_seeds::seeds();
    write("tiny.las", &las[2]);
    write("other.las", &las[6]);
    write("tiny.laz", &las[3]);
    write("broken.laz", &las[3][..las[3].len() / 2]);
    write("none.las", &las[0]);
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\n\
               property double z\nproperty uchar odd\nend_header\n1 2 3 4\n5 6 7 8\n";
    write("tiny.ply", ply.as_bytes());
    let _ = std::fs::create_dir(folder.join("folder"));
    write("folder/inner.las", &las[2]);
}

fn seeds(folder: &Path) -> Vec<Vec<u8>> {
    furnish(folder);
    let mut all: Vec<String> = COPIED.iter().map(|text| (*text).to_owned()).collect();
    let stages =
        ["normals", "cells", "median"].map(|kind| format!("[[stage]]\nkind = \"{kind}\"\n"));
    for from in ["tiny.las", "tiny.laz", "tiny.ply", "broken.laz", "none.las", "folder", "*.la?"] {
        for to in ["out.las", "out.laz", "out.ply"] {
            let read = format!("[[stage]]\nkind = \"read\"\npath = \"{from}\"\n");
            let write = format!("[[stage]]\nkind = \"write\"\npath = \"{to}\"\n");
            all.push(format!("{read}{write}"));
            all.push(format!("{read}{}{write}", stages.concat()));
            all.push(format!(
                "{read}{write}order = \"canonical\"\nscale = 0.01\ndrop = [\"odd\"]\n"
            ));
        }
    }
    for scene in ["plane", "part", "als"] {
        let synth = format!("[[stage]]\nkind = \"synth\"\nscene = \"{scene}\"\npoints = 100\n");
        let run = "[run]\nmemory = \"1GiB\"\nthreads = 2\nnonfinite = \"drop\"\nlattice = 0.001\n";
        all.push(format!(
            "{run}{synth}{}[[stage]]\nkind = \"write\"\npath = \"o.laz\"\n",
            stages.concat()
        ));
    }
    all.extend([JSON, PARAMETERS].map(str::to_owned));
    all.into_iter().map(String::into_bytes).collect()
}

/// A tree in JSON, and parameters at every place that they can have.
const JSON: &str = r#"{
"run": {"threads": 2, "memory": "1GiB"},
"params": {"keep": "10%", "side": {"type": "number", "default": 0.5, "about": "Side"}},
"stage": [
{"kind": "synth", "name": "scan", "scene": "part", "points": 1e3, "noise": null},
{"kind": "grid", "side": "${side}"},
{"kind": "write", "path": "a.laz", "scale": [0.1, 0.1, 0.01]},
{"kind": "cells", "from": ["scan"], "keep": "${keep}"},
{"kind": "write", "path": "b-${side}.laz"}
]}"#;
const PARAMETERS: &str = "\
[params]
keep = '10%'
scene = {choices = ['part', 'als'], default = 'part'}
points = {type = 'whole', default = '${ENV:POINTS:-5k}'}
drop = {type = 'list', default = ['a', 'b']}
[[stage]]
kind = 'synth'
scene = '${scene}'
points = '${points}'
name = 'scan'
[[stage]]
kind = 'merge'
[[stage]]
kind = 'cells'
keep = '${keep}'
[[stage]]
kind = 'write'
path = '$${a}-${keep}.laz'
drop = '${drop}'
[[stage]]
kind = 'write'
from = 'scan'
path = 'all.ply'
";
