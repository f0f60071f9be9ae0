//! A graph as a drawing: lines of text, a Mermaid flowchart, or a graph for Graphviz. What is drawn
//! depends on the pipeline alone; no input is looked at.

use std::fmt;
use std::fmt::Write as _;

use serde_json::Value;

use super::{Graph, GraphStage};
use crate::stage::RoleName;

/// Characters of a key with its value at most; of longer ones the beginning is drawn.
const MOST: usize = 80;

impl Graph {
    /// The graph as a Mermaid flowchart, which many web pages draw from a block of code.
    pub fn to_mermaid(&self) -> String {
        let mut out = "flowchart TD\n".to_owned();
        for (n, stage) in self.stages.iter().enumerate() {
            let label: Vec<String> = lines(stage).iter().map(|line| entities(line)).collect();
            let (opens, closes) = if is_end(stage) { ("([", "])") } else { ("[", "]") };
            let _ = writeln!(out, "  s{n}{opens}\"{}\"{closes}", label.join("<br/>"));
        }
        for (from, to) in self.edges() {
            let _ = writeln!(out, "  s{from} --> s{to}");
        }
        out
    }

    /// The graph in the language of Graphviz: `dot -Tsvg` makes a picture of it.
    pub fn to_dot(&self) -> String {
        let mut out = "digraph pipeline {\n  node [fontname=\"monospace\"];\n".to_owned();
        for (n, stage) in self.stages.iter().enumerate() {
            let shape = if is_end(stage) { "ellipse" } else { "box" };
            let _ = write!(out, "  s{n} [shape={shape}, label=\"");
            for line in lines(stage) {
                // What ends a line puts it to the left.
                out += &(line.replace('\\', r"\\").replace('"', r#"\""#) + r"\l");
            }
            out += "\"];\n";
        }
        for (from, to) in self.edges() {
            let _ = writeln!(out, "  s{from} -> s{to};");
        }
        out + "}\n"
    }

    /// The numbers of every two stages of which the second takes from the first.
    fn edges(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let stages = self.stages.iter().enumerate();
        stages.flat_map(|(to, stage)| stage.from.iter().map(move |from| (*from, to)))
    }

    /// How a stage is called in the line of another, as `--set` does.
    fn called(&self, n: usize) -> String {
        let GraphStage { kind, name, .. } = &self.stages[n];
        let alike = |stages: &[GraphStage]| stages.iter().filter(|s| s.kind == *kind).count();
        match (name, alike(&self.stages)) {
            (Some(name), _) => name.clone(),
            (None, 1) => kind.clone(),
            (None, _) => format!("{kind}.{}", alike(&self.stages[..=n])),
        }
    }

    /// Draws a stage behind `first`, and what follows it behind `rest`.
    fn draw(&self, n: usize, first: &str, rest: &str, out: &mut String) {
        *out += &format!("{first}{}\n", lines(&self.stages[n]).join("  "));
        let takers: Vec<usize> = self.takers(n).collect();
        for (i, &taker) in takers.iter().enumerate() {
            let (first, rest) = match (takers.len(), i + 1 == takers.len()) {
                (1, _) => (rest.to_owned(), rest.to_owned()),
                (_, false) => (format!("{rest}├─ "), format!("{rest}│  ")),
                (_, true) => (format!("{rest}└─ "), format!("{rest}   ")),
            };
            match self.stages[taker].from.len() {
                1 => self.draw(taker, &first, &rest, out),
                _ => *out += &format!("{first}-> {}\n", self.called(taker)),
            }
        }
    }
}

impl fmt::Display for Graph {
    /// A line a stage, each below the one that it takes from; where several take from one, a branch
    /// for each; what takes from several stands for itself below them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = String::new();
        for (n, stage) in self.stages.iter().enumerate() {
            if stage.from.len() != 1 {
                self.draw(n, "", "", &mut out);
            }
        }
        f.write_str(&out)
    }
}

/// True for a source and a sink.
fn is_end(stage: &GraphStage) -> bool {
    matches!(stage.role.name(), RoleName::Source | RoleName::Sink)
}

/// What is said of a stage: its kind and name, then its keys that are written, or all of them where
/// no text says which those are.
fn lines(stage: &GraphStage) -> Vec<String> {
    let mut lines = vec![match &stage.name {
        Some(name) => format!("{} ({name})", stage.kind),
        None => stage.kind.clone(),
    }];
    let all = || {
        let keys = stage.given.as_ref().unwrap_or(&stage.keys).as_object().into_iter().flatten();
        keys.map(|(key, value): (&String, &Value)| (key.clone(), value.to_string())).collect()
    };
    let keys: Vec<(String, String)> = stage.written.keys().unwrap_or_else(all);
    lines.extend(keys.into_iter().map(|(key, value)| shortened(format!("{key} = {value}"))));
    lines
}

fn shortened(line: String) -> String {
    match line.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}

/// A text as Mermaid writes it within quotes.
fn entities(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            // Letters of every language, and what means nothing to Mermaid.
            _ if c.is_alphanumeric() || " _-.,/=()[]{}:*+%…".contains(c) => out.push(c),
            _ => out += &format!("#{};", c as u32),
        }
    }
    out
}
