//! Target `text`: one argument `stage.key=value`; its value is also taken as a size, and the text
//! as a pipeline in one line and as a parameter.

use std::path::Path;

use pointmill::graph::parse_bytes;
use pointmill::{Graph, Registry, Set};

use super::judge::{self, Judgement, Outcome, shape};
use super::pipeline::{furnish, leaves_home};
use super::{Target, mutate, vocabulary};
use crate::support::random::Random;

/// The target.
pub const TARGET: Target =
    Target { name: "text", judge: target, seeds, mutate: change, at_home: true };

/// A pipeline with a stage of every role, and two stages of one kind, one of them named.
const PIPELINE: &str = "\
[run]
memory = \"1GiB\"
[[stage]]
kind = \"read\"
path = \"tiny.las\"
[[stage]]
kind = \"normals\"
[[stage]]
kind = \"cells\"
name = \"coarse\"
[[stage]]
kind = \"cells\"
[[stage]]
kind = \"median\"
[[stage]]
kind = \"write\"
path = \"out.laz\"
";

fn target(_: &Path, data: &[u8]) -> Judgement {
    let text = String::from_utf8_lossy(data);
    if leaves_home(&text) {
        return Ok(Outcome { accepted: false, marks: vec!["leaves home".to_owned()] });
    }
    let value = text.split_once('=').map_or(&*text, |(_, value)| value);
    let mut marks = vec![match parse_bytes(value) {
        Ok(bytes) => format!("a size, {}", judge::magnitude(bytes)),
        Err(told) if told.is_empty() => return Err("a size is refused without a word".to_owned()),
        Err(told) => format!("no size: {}", shape(&told)),
    }];
    // A text may name a file that is not there.
    let wrong = &[pointmill::ErrorKind::Pipeline, pointmill::ErrorKind::Io];
    marks.push(match Graph::parse_line(&text, &Registry::builtin()) {
        Ok(graph) => format!("a line of {} stages", graph.stages.len()),
        Err(error) => {
            let told = judge::proper("line", &error, wrong)?;
            format!("no line: {}", shape(told.lines().next().unwrap_or_default()))
        }
    });
    if let Err(error) = Set::param(&text) {
        judge::proper("param", &error, wrong)?;
    }
    let set = match Set::parse(&text) {
        Ok(set) => set,
        Err(error) => {
            judge::proper("set", &error, wrong)?;
            marks.push("no argument".to_owned());
            return Ok(Outcome { accepted: false, marks });
        }
    };
    let same = Set::argument("--keep", text.split('=').next().unwrap_or(""), value.into());
    for set in [set, same] {
        match Graph::parse_with(PIPELINE, "p.toml", &Registry::builtin(), &[set]) {
            Ok(pipeline) => {
                let keys: Vec<String> =
                    pipeline.stages.iter().map(|stage| shape(&stage.keys.to_string())).collect();
                marks.push(format!("taken: {:?} {}", pipeline.settings.nonfinite, keys.concat()));
            }
            Err(error) => {
                let told = judge::proper("set", &error, wrong)?;
                let first = told.lines().next().unwrap_or_default();
                marks.push(format!("not taken: {}", shape(first)));
            }
        }
    }
    let accepted = marks.iter().any(|mark| mark.starts_with("taken"));
    Ok(Outcome { accepted, marks })
}

fn change(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    let (len, words) = (data.len(), vocabulary::words());
    if random.one_in(2) {
        mutate::lines(random, data, len, other, words);
    } else if random.one_in(3) {
        let word = |random: &mut Random| String::from_utf8_lossy(random.one_of(words)).into_owned();
        let (stage, key) = (word(random), word(random));
        let value = if random.one_in(2) { mutate::number_text(random) } else { word(random) };
        *data = format!("{stage}.{key}={value}").into_bytes();
    } else {
        mutate::bytes(random, data, other, words);
    }
}

fn seeds(folder: &Path) -> Vec<Vec<u8>> {
    furnish(folder);
    let all = [
        "read tiny.las ! normals neighbors=12 ! cells keep=\"10 %\" ! median ! write out.laz",
        "synth part points=10k name=a ! grid side=0.5 from=[a] ! write 'o.ply' drop=[b, \"c\"]",
        "run.memory=2GiB",
        "run.memory=1.5 MB",
        "run.memory=18446744073709551615",
        "run.lattice=0.001",
        "run.nonfinite=drop",
        "run.threads=4",
        "read.path=[\"tiny.las\", 'tiny.laz']",
        "read.path=*.laz",
        "normals.neighbors=20",
        "normals.method=pca",
        "cells.max_angle=6deg",
        "coarse.max_angle=0.1",
        "cells.2.max_angle=\"0.5 deg\"",
        "cells.1.side=auto",
        "coarse.side=2.5",
        "cells.2.split=octant",
        "cells.2.min_points=3",
        "write.scale=[0.1, 0.1, 0.01]",
        "write.offset=[1, 2, 3]",
        "write.drop=[]",
        "write.path=out.ply",
        "write.dimensions=['NormalX', 'NormalY', 'NormalZ']",
        "a=b",
        "=",
        "",
    ];
    all.iter().map(|text| text.as_bytes().to_vec()).collect()
}
