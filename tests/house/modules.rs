//! Which file of the crate imports which, by their texts: every path is followed to the file that
//! has the thing at its end, through what other files re-export. `mod x;` is no import.

use std::collections::{BTreeMap, BTreeSet};

/// A path in a file.
struct Import {
    names: Vec<String>,
    /// What the file calls the thing at its end.
    called: String,
    /// True if others may take that thing from here.
    is_public: bool,
    /// True if the file does nothing else with it.
    is_only_handed_on: bool,
}

/// The files of a crate, each by its module's names from the root (`geom::simd`; the root is "").
pub struct Modules(BTreeMap<String, Vec<Import>>);

impl Modules {
    /// From modules and their texts.
    pub fn of(files: impl IntoIterator<Item = (String, String)>) -> Modules {
        Modules(files.into_iter().map(|(module, text)| (module, imports_of(&text))).collect())
    }

    /// What each imports. A facade does not import the children that it only hands on.
    pub fn imports(&self) -> BTreeMap<String, BTreeSet<String>> {
        let each = |(from, all): (&String, &Vec<Import>)| {
            let to = all.iter().filter_map(|import| self.imported(from, import));
            (from.clone(), to.collect())
        };
        self.0.iter().map(each).collect()
    }

    fn imported(&self, from: &str, import: &Import) -> Option<String> {
        let to = self.target(from, &import.names)?;
        let is_below = from.is_empty() || to.starts_with(&format!("{from}::"));
        (to != from && !(is_below && import.is_only_handed_on)).then_some(to)
    }

    /// The file that has what `names` lead to from the module `from`; None outside of the crate.
    fn target(&self, from: &str, names: &[String]) -> Option<String> {
        let (first, mut rest) = names.split_first()?;
        let mut at = match first.as_str() {
            "crate" => String::new(),
            "self" => from.to_owned(),
            "super" => parent(from),
            child => Some(below(from, child)).filter(|module| self.0.contains_key(module))?,
        };
        while let Some((name, more)) = rest.split_first() {
            let child = below(&at, name);
            if name == "super" {
                at = parent(&at);
            } else if self.0.contains_key(&child) {
                at = child;
            } else {
                let all = self.0.get(&at)?;
                let Some(handed_on) = all.iter().find(|i| i.is_public && i.called == *name) else {
                    break;
                };
                let names = [&handed_on.names, more].concat();
                return self.target(&at, &names).or(Some(at));
            }
            rest = more;
        }
        // What the root has itself is no module: such a name stands in the tests of a file.
        (!at.is_empty()).then_some(at)
    }
}

fn parent(module: &str) -> String {
    module.rsplit_once("::").map_or(String::new(), |(parent, _)| parent.to_owned())
}

fn below(module: &str, child: &str) -> String {
    if module.is_empty() { child.to_owned() } else { format!("{module}::{child}") }
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Names, `::`, and all other characters one by one. A `//` in a text of the program ends the line
/// as a comment does, which loses no path.
fn tokens(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    for mut line in text.lines().map(|line| line.split("//").next().unwrap_or("")) {
        while let Some(first) = line.chars().next() {
            let length = match line.find(|c| !is_of_name(c)).unwrap_or(line.len()) {
                0 if line.starts_with("::") => 2,
                0 => first.len_utf8(),
                name => name,
            };
            let (token, behind) = line.split_at(length);
            if !first.is_whitespace() {
                tokens.push(token);
            }
            line = behind;
        }
    }
    tokens
}

/// All paths of two names or more.
fn imports_of(text: &str) -> Vec<Import> {
    let tokens = tokens(text);
    let mut all: Vec<Import> = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if !tokens[at].starts_with(is_of_name) {
            at += 1;
            continue;
        }
        let is_public = matches!(tokens[..at], [.., "pub" | ")", "use"]);
        let mut paths = Vec::new();
        at = read_paths(&tokens, at, &[], &mut paths);
        for (names, called) in paths.into_iter().filter(|(names, _)| names.len() > 1) {
            let count = |tokens: &[&str]| tokens.iter().filter(|token| **token == called).count();
            let is_only_handed_on = is_public && count(&tokens) <= count(&names).max(1);
            let names = names.into_iter().map(str::to_owned).collect();
            all.push(Import { names, called: called.to_owned(), is_public, is_only_handed_on });
        }
    }
    all
}

/// Adds the path that begins at token `at`, `before` being what a group has in common, or all paths
/// of a group, each with what it is called; returns what follows it.
fn read_paths<'a>(
    tokens: &[&'a str],
    mut at: usize,
    before: &[&'a str],
    paths: &mut Vec<(Vec<&'a str>, &'a str)>,
) -> usize {
    let mut names = before.to_vec();
    while let Some(&token) = tokens.get(at) {
        at += 1;
        if token == "{" {
            while !matches!(tokens.get(at), None | Some(&"}")) {
                let comma = usize::from(tokens[at] == ",");
                at = if comma == 1 { at + 1 } else { read_paths(tokens, at, &names, paths) };
            }
            return at + 1;
        }
        // `a::{self}` is a.
        if token != "self" || names.is_empty() {
            names.push(token);
        }
        match tokens[at..] {
            ["::", ..] => at += 1,
            ["as", called, ..] => {
                paths.push((names, called));
                return at + 2;
            }
            _ => {
                paths.push((names, token));
                return at;
            }
        }
    }
    at
}
