//! Pipelines in one line: the same as in a file, and every mistake below what was typed.

use pointmill::{Graph, PipelineText, Registry, Set};

use crate::support::command::{done, fails, scans};

fn parse(line: &str) -> pointmill::Result<Graph> {
    Graph::parse_line(line, &Registry::builtin())
}

fn told(line: &str) -> String {
    parse(line).map(|_| ()).unwrap_err().to_string()
}

#[test]
fn a_line_says_what_a_file_says() {
    let line = "synth part points=10k name=scan ! normals neighbors=12 ! cells keep=\"10 %\" ! \
                median ! write a.laz scale=[0.1, 0.1, 0.01] drop=[a, 'b c'] ! \
                grid from=[scan] side='5 cm' ! write path=\"b ! c.ply\"";
    let file = "
        [[stage]]
        kind = 'synth'
        name = 'scan'
        scene = 'part'
        points = 10000
        [[stage]]
        kind = 'normals'
        neighbors = 12
        [[stage]]
        kind = 'cells'
        keep = '10 %'
        [[stage]]
        kind = 'median'
        [[stage]]
        kind = 'write'
        path = 'a.laz'
        scale = [0.1, 0.1, 0.01]
        drop = ['a', 'b c']
        [[stage]]
        kind = 'grid'
        from = 'scan'
        side = '5 cm'
        [[stage]]
        kind = 'write'
        path = 'b ! c.ply'";
    let file = Graph::parse(file, "p.toml", &Registry::builtin()).unwrap();
    assert_eq!(parse(line).unwrap().to_json(), file.to_json());
    assert!(PipelineText::is_line(line) && PipelineText::is_line("a\n!\nb"));
    for file in ["a.toml", "my file.toml", "a!b", "read a.laz !write b.laz", "!a", ""] {
        assert!(!PipelineText::is_line(file), "{file}");
    }
}

#[test]
fn main_keys_need_no_name() {
    let registry = Registry::builtin();
    let graph = parse(
        "synth plane points=9 ! filter \"Z > 1\" ! drop classes=[7] ! \
                       assign 'Classification = 2' ! write 'o.laz'",
    )
    .unwrap();
    let keys = |n: usize| graph.stages[n].keys.to_string();
    assert!(keys(1).contains("Z > 1") && keys(3).contains("Classification = 2"), "{graph}");
    let sets = [Set::parse("synth.points=7").unwrap(), Set::parse("run.threads=1").unwrap()];
    let line = PipelineText::line("synth plane points=9 ! write o.laz");
    let set = line.graph(&registry, &sets).unwrap();
    assert_eq!(
        (&set.stages[0].keys["points"], set.settings.threads.unwrap().get()),
        (&7.into(), 1)
    );
}

#[test]
fn mistakes_in_a_line_stand_below_it() {
    let expected = "\
3 mistakes
the pipeline: `scene` cannot be `prat`
   | synth prat points=9 ! nromals ! write a.lza
   |       ^^^^
   = did you mean `part`? valid: als, part, plane, sphere, squares-random, squares-uniform
the pipeline: there is no stage `nromals`
   | synth prat points=9 ! nromals ! write a.lza
   |                       ^^^^^^^
   = did you mean `normals`? stages: ";
    let told_all = told("synth prat points=9 ! nromals ! write a.lza");
    assert!(told_all.starts_with(expected), "{told_all}");
    for (line, expected) in [
        ("synth part points=9 ! ! write a.laz", "a stage is missing here"),
        ("! synth part points=9", "a stage is missing here"),
        ("synth part points=9 ! write a.laz ! ", "a stage is missing here"),
        ("synth part points=9 ! normals pca ! write a.laz", "`pca` is no KEY=VALUE"),
        ("synth part points=9 ! write my scan.laz", "`scan.laz` is no KEY=VALUE"),
        ("synth part points=9 ! write my scan.laz", "is its `path`, right behind it"),
        ("synth part points=9 points=8 ! write a.laz", "`points` of `synth` is given twice"),
        ("synth part scene=als points=8 ! write a.laz", "`scene` of `synth` is given twice"),
        ("synth part points=9 ! write 'a.laz", "`'` is not closed"),
        ("synth part points=9 ! write a.laz drop=[a", "`[` is not closed"),
        ("synth part points=9 ! write a.laz from=b", "no earlier stage that gives points"),
        ("synth part points=nan ! write a.laz", "not finite"),
        ("synth part points=9 ! median", "nothing takes these points: end with `write`"),
    ] {
        let told = told(line);
        assert!(told.contains(expected) && told.contains("the pipeline: "), "{expected}\n{told}");
        assert!(told.contains('^'), "{told}");
    }
}

#[test]
fn commands_take_a_line_in_the_place_of_a_file() {
    let at = scans(&["in.laz"]);
    let at = at.path();
    let line = "read in.laz ! normals ! cells keep=40% ! median ! write out.laz";
    let check = done(at, &["check", line]);
    assert!(check.contains("the pipeline is right: 3,000 points"), "{check}");
    done(at, &["plan", line]);
    done(at, &["run", line]);
    let file = "[[stage]]\nkind = 'read'\npath = 'in.laz'\n[[stage]]\nkind = 'normals'\n\
                [[stage]]\nkind = 'cells'\nkeep = '40%'\n[[stage]]\nkind = 'median'\n\
                [[stage]]\nkind = 'write'\npath = 'file.laz'\n";
    std::fs::write(at.join("p.toml"), file).unwrap();
    done(at, &["run", "p.toml"]);
    assert!(
        std::fs::read(at.join("out.laz")).unwrap() == std::fs::read(at.join("file.laz")).unwrap()
    );
    // What looks like a line and is none is the name of a file, which is not there.
    for typed in ["read in.laz", "read in.laz !write out.laz"] {
        let help = "a file of this name was looked for; a pipeline in one line has ` ! `";
        fails(at, &["run", typed], 1, &[typed, help]);
    }
    let quotes = "put the whole pipeline in quotes";
    fails(
        at,
        &["run", "read", "in.laz", "!", "write", "out.laz"],
        2,
        &["no more arguments", quotes],
    );
    let none = ["run", "read x*.laz ! write a.laz"];
    fails(at, &none, 1, &["the pipeline: no file matches", "| read x*.laz !", "|      ^^^^^^"]);
    let none = done(at, &["run", line, "--help"]);
    assert!(none.contains("has no parameters"), "{none}");
}
