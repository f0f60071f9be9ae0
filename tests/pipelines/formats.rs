//! A format that a program brings is as good as those that are there: read, written, described and
//! named in messages.

#![allow(clippy::unwrap_used, reason = "a test that fails says so")]

use std::fs;
use std::path::Path;

use pointmill::{Error, Graph, Overrides, Quiet, Registry, cli, io};
use serde_json::json;

#[path = "../../examples/10_own_format.rs"]
mod own_format;

use own_format::registry;

const POINTS: &str = "toy\n0 0 0\n0.25 0 1.5\n2 2 2\n";

fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, text)| fs::write(at.path().join(name), text).unwrap());
    at
}

/// A pipeline of `read` and `write` with these keys, paths below `at`.
fn pipeline(at: &Path, read: &str, write: &str) -> String {
    let at = at.display();
    format!(
        "[[stage]]\nkind = 'read'\npath = '{at}/{read}\n[[stage]]\nkind = 'write'\npath = '{at}/{write}\n"
    )
}

fn run(at: &Path, read: &str, write: &str) -> Result<(), Error> {
    let graph = Graph::parse(&pipeline(at, read, write), "p.toml", &registry())?;
    graph.plan(&Overrides::default())?.run(&Quiet).map(drop)
}

fn told(error: &Error) -> String {
    format!("{error}; {}", error.remedy().unwrap_or_default())
}

#[test]
fn a_format_from_outside_is_read_converted_and_written() {
    let at = folder(&[("a.toy", POINTS), ("odd.dat", POINTS)]);
    let (at, text) = (at.path(), |name: &str| fs::read_to_string(at.path().join(name)).unwrap());
    run(at, "a.toy'", "b.toy'").unwrap();
    assert_eq!(text("b.toy"), POINTS);
    run(at, "odd.dat'\nformat = 'toy'", "c.toy'").unwrap();
    assert_eq!(text("c.toy"), POINTS);
    // Where the extension tells nothing, the first bytes do.
    run(at, "odd.dat'", "g.toy'").unwrap();
    assert_eq!(text("g.toy"), POINTS);
    // To LAS and PLY, and back: what LAS has besides coordinates must be dropped by name.
    run(at, "a.toy'", "d.laz'\nscale = 0.25").unwrap();
    let lost = told(&run(at, "d.laz'", "e.toy'").unwrap_err());
    assert!(
        lost.contains("e.toy: this TOY output cannot hold `Intensity`, `ReturnNumber`"),
        "{lost}"
    );
    run(at, "a.toy'", "f.ply'").unwrap();
    run(at, "f.ply'", "e.toy'").unwrap();
    assert_eq!(text("e.toy"), POINTS);
    let described = io::describe(&at.join("b.toy"), registry().formats()).unwrap();
    assert_eq!(described, json!({"kind": "TOY", "points": 3}));
}

#[test]
fn a_format_from_outside_is_named_in_messages() {
    let at = folder(&[("a.toy", POINTS), ("named.las", POINTS), ("x.abc", ""), ("b.toy", "1 2 3")]);
    let at = at.path();
    let refused = |read: &str, write: &str, part: &str| {
        let told = told(&run(at, read, write).unwrap_err());
        assert!(told.contains(part), "{part}: {told}");
    };
    refused("x.abc'", "o.toy'", ".txt, .csv, .asc or .toy, or give `read.format`");
    refused("named.las'", "o.toy'", "this is a TOY file, not a LAS or LAZ file");
    refused("named.las'", "o.toy'", "name it .toy, or give `read.format = \"toy\"`");
    refused("b.toy'", "o.las'", "this is a text of numbers, not a TOY file");
    refused("a.toy'\nformat = 'toys'", "o.las'", "did you mean `toy`? valid: asc, copc, csv, e57");
    refused("a.toy'\nformat = 5", "o.las'", "`format`: takes one of las, laz, copc, ply, pcd");
    refused("a.toy'", "o.las'", "a TOY scan written as LAS needs a scale");
    refused("a.toy'", "o.toy'\ndimensions = ['NormalX']", "and toy holds nothing computed");
    refused(
        "a.toy'",
        "o.toy'\nscale = 1.0",
        "`write.scale` is for las, laz and copc, the output is toy",
    );
    let both = format!("a.toy', '{}/c.ply", at.display());
    let both = pipeline(at, &both, "o.las'").replacen("path = '", "path = ['", 1);
    let both = both.replacen("c.ply", "c.ply']", 1);
    fs::write(at.join("c.ply"), "").unwrap();
    let error = told(&Graph::parse(&both, "p.toml", &registry()).unwrap_err());
    assert!(error.contains("PLY and TOY records differ"), "{error}");
    // Without it, it is none.
    let known = Registry::builtin();
    let error = Graph::parse(&pipeline(at, "a.toy'", "o.las'"), "p.toml", &known).unwrap_err();
    assert!(told(&error).contains("the extension of `"), "{error}");
    let error = io::describe(&at.join("a.toy"), known.formats()).unwrap_err();
    assert!(error.to_string().contains("not a LAS, LAZ, COPC, PLY, PCD"), "{error}");
    assert!(
        Graph::read(&at.join("a.toy"), &registry(), &[]).unwrap_err().to_string().contains("TOY")
    );
}

#[test]
fn commands_know_a_format_from_outside() {
    let at = folder(&[("a.toy", POINTS), ("b.toy", POINTS)]);
    let path = |name: &str| at.path().join(name).display().to_string();
    let run = |arguments: &[&str]| {
        let arguments = ["pointmill"].iter().chain(arguments).map(|a| (*a).into()).collect();
        cli::run_with(arguments, &registry())
    };
    let (input, out, ply, back) = (path("a.toy"), path("out/"), path("ply/"), path("back/"));
    // A folder of them is found, and each becomes a file of its own.
    let all = path("");
    assert_eq!(run(&["convert", &all, "-o", &out, "-q"]), 0);
    assert_eq!(fs::read_to_string(path("out/b.toy")).unwrap(), POINTS);
    assert_eq!(run(&["convert", &all, "-o", &ply, "--to", "ply", "-q"]), 0);
    assert_eq!(run(&["convert", &ply, "-o", &back, "--to", "toy", "-q"]), 0);
    assert_eq!(fs::read_to_string(path("back/a.toy")).unwrap(), POINTS);
    assert_eq!(run(&["info", &input]), 0);
    assert_eq!(run(&["convert", &input, "-o", &path("o.toy"), "--to", "toys", "-q"]), 2);
    assert_eq!(run(&["reduce", &input, &path("b.toy"), "--outdir", &out, "-q"]), 0);
    // Of points that coincide one is kept, and each input has its output.
    let both = ["out/a.toy", "out/b.toy"].map(|name| fs::read_to_string(path(name)).unwrap());
    assert_eq!(both.concat().matches("0.25 0 1.5\n").count(), 1, "{both:?}");
}

#[test]
fn a_format_takes_the_place_of_one_of_its_name() {
    let formats = registry().with_format(own_format::Toy);
    let names = formats.formats().names();
    assert_eq!(names.iter().filter(|name| **name == "toy").count(), 1, "{names:?}");
    assert_eq!((names[0], names.last()), ("las", Some(&"toy")));
}
