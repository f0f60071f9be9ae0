//! Drawings of graphs: as text, for Mermaid and for Graphviz.

use pointmill::{Graph, Registry};

fn graph(text: &str) -> Graph {
    Graph::parse(text, "p.toml", &Registry::builtin()).unwrap()
}

/// A scan of which one branch is thinned, and one is what it was.
const BRANCHES: &str = r#"
    stage = [
        { kind = "synth", scene = "als", points = "10k", name = "scan" },
        { kind = "write", path = 'a "b" \ #1 <i>.laz' },
        { kind = "grid", side = 0.5, pick = "center" },
        { kind = "write", path = "all.ply" },
        { kind = "write", path = "same.ply", from = "scan" },
    ]"#;

#[test]
fn a_chain_is_a_line_a_stage_and_a_branch_stands_behind_its_stage() {
    assert_eq!(
        graph(BRANCHES).to_string(),
        "synth (scan)  scene = \"als\"  points = \"10k\"\n\
         ├─ write  path = \"a \\\"b\\\" \\\\ #1 <i>.laz\"\n\
         ├─ grid  side = 0.5  pick = \"center\"\n\
         │  write  path = \"all.ply\"\n\
         └─ write  path = \"same.ply\"\n"
    );
}

#[test]
fn what_means_something_to_mermaid_and_to_graphviz_is_escaped() {
    let graph = graph(BRANCHES);
    let mermaid = graph.to_mermaid();
    let line = "  s1([\"write<br/>path = #34;a #92;#34;b#92;#34; #92;#92; #35;1 \
                #60;i#62;.laz#34;\"])\n";
    assert!(mermaid.contains(line), "{mermaid}");
    assert!(mermaid.ends_with("  s0 --> s1\n  s0 --> s2\n  s2 --> s3\n  s0 --> s4\n"));
    let dot = graph.to_dot();
    let line = r#"label="write\lpath = \"a \\\"b\\\" \\\\ #1 <i>.laz\"\l"];"#;
    assert!(dot.contains(line), "{dot}");
    assert!(dot.ends_with("  s0 -> s1;\n  s0 -> s2;\n  s2 -> s3;\n  s0 -> s4;\n}\n"));
}

#[test]
fn a_stage_that_takes_from_several_stands_below_them() {
    let source = "{ kind = 'synth', scene = 'als', points = 9, name =";
    let text = format!(
        "stage = [{source} 'a' }}, {source} 'b' }}, \
         {{ kind = 'merge', from = ['a', 'b'] }}, {{ kind = 'write', path = 'c.ply' }}]"
    );
    let keys = "scene = \"als\"  points = 9";
    assert_eq!(
        graph(&text).to_string(),
        format!(
            "synth (a)  {keys}\n-> merge\nsynth (b)  {keys}\n-> merge\n\
             merge\nwrite  path = \"c.ply\"\n"
        )
    );
}

#[test]
fn long_values_are_cut_between_characters() {
    let path = "é".repeat(500);
    let text = format!(
        "stage = [{{ kind = 'synth', scene = 'als', points = 9 }}, \
         {{ kind = 'write', path = '{path}.ply' }}]"
    );
    let drawn = graph(&text).to_string();
    let line = drawn.lines().last().unwrap();
    assert_eq!(line.chars().count(), "write  ".len() + 80 + 1, "{line}");
    assert!(line.ends_with("é…"), "{line}");
}
