//! A pipeline file's tables as written, before any stage is built: settings, stages, and what
//! arguments put in their place.

use super::form::TextForm;
use super::mistake::{Mistake, advice};
use super::node::{KeyEntry, Node, NodeValue};
use super::place::{PlacedWord, TextPlace};
use super::registry::Registry;
use super::set::{PARAMETERS, Set};

/// Stages of a pipeline at most: each sink has a file open and memory of its own.
const MOST_STAGES: usize = 256;

/// The tables that are about the whole pipeline, as addresses of values name them.
const TABLES: [&str; 2] = ["run", "accept"];

/// The tables of a pipeline file.
pub(crate) struct Draft {
    form: TextForm,
    /// The `[run]` table.
    pub run: Node,
    /// The `[accept]` table.
    pub accept: Node,
    /// The `[params]` table.
    pub params: Node,
    /// What arguments give for parameters: their names and the texts of their values.
    pub given: Vec<(PlacedWord, PlacedWord)>,
    /// The `[[stage]]` tables, from top to bottom.
    pub stages: Vec<StageDraft>,
    /// What is wrong so far.
    pub mistakes: Vec<Mistake>,
}

/// A `[[stage]]` table.
#[derive(Clone)]
pub(crate) struct StageDraft {
    /// Its kind and where it is written; None if it has none, which is told.
    pub kind: Option<PlacedWord>,
    /// Its name, if it has one.
    pub name: Option<PlacedWord>,
    /// The stages that it takes from, if it says.
    pub from: Option<Vec<PlacedWord>>,
    /// All other keys; their place is that of the kind, or else of the table.
    pub keys: Node,
}

/// Sorts the tables of a file in this form, whose first text is `len` bytes long.
pub(crate) fn read(
    entries: Vec<KeyEntry>,
    len: usize,
    form: TextForm,
    registry: &Registry,
) -> Draft {
    let empty = || Node { place: TextPlace::new(0, 0..0), value: NodeValue::Table(Vec::new()) };
    let mut draft = Draft {
        form,
        run: empty(),
        accept: empty(),
        params: empty(),
        given: Vec::new(),
        stages: Vec::new(),
        mistakes: Vec::new(),
    };
    let is_stages = |entry: &KeyEntry| matches!(entry.key.as_str(), "stage" | "stages");
    if !entries.iter().any(is_stages) {
        let begin = format!("begin with {} and {}", form.stages(), form.key("kind", "read"));
        let told = Mistake::new(TextPlace::new(0, len..len), "a pipeline needs stages");
        draft.mistakes.push(told.note(begin));
    }
    for KeyEntry { key, at, node } in entries {
        match key.as_str() {
            "run" => draft.run = draft.table("run", at, node),
            "accept" => draft.accept = draft.table("accept", at, node),
            "params" => draft.params = draft.table("params", at, node),
            "stage" | "stages" => draft.add_stages(&key, at, node, registry),
            // By which editors know how to complete and check the file.
            "$schema" => {}
            word => draft.mistakes.push(Mistake::word(
                at,
                format!("a pipeline file has no `{word}`"),
                word,
                "tables",
                ["accept", "params", "run", "stage"],
            )),
        }
    }
    draft
}

fn text(node: Node) -> Result<PlacedWord, (TextPlace, &'static str)> {
    match node.value {
        NodeValue::Text(text) => Ok((text, node.place)),
        _ => Err((node.place, "a text in quotes")),
    }
}

/// One name or a list of them.
fn names(node: Node) -> Result<Vec<PlacedWord>, (TextPlace, &'static str)> {
    const TAKES: &str = "the name of a stage, or a list of names";
    let name = |node: Node| text(node).map_err(|(place, _)| (place, TAKES));
    match node.value {
        NodeValue::List(list) if list.is_empty() => Err((node.place, TAKES)),
        NodeValue::List(list) => list.into_iter().map(name).collect(),
        _ => name(node).map(|name| vec![name]),
    }
}

impl StageDraft {
    /// A stage of which nothing is known.
    fn unknown(keys: Node) -> Self {
        StageDraft { kind: None, name: None, from: None, keys }
    }

    /// True if it is of that kind.
    fn is(&self, kind: &str) -> bool {
        self.kind.as_ref().is_some_and(|(own, _)| own == kind)
    }
}

impl Draft {
    /// The table `name`; what is none is told, and empty.
    fn table(&mut self, name: &str, at: TextPlace, node: Node) -> Node {
        match node.value {
            NodeValue::Table(table) => Node { place: at, value: NodeValue::Table(table) },
            _ => {
                let told = format!("`{name}` is a table: write {}", self.form.table(name));
                self.mistakes.push(Mistake::new(at.clone(), told));
                Node { place: at, value: NodeValue::Table(Vec::new()) }
            }
        }
    }

    fn add_stages(&mut self, key: &str, at: TextPlace, node: Node, registry: &Registry) {
        let NodeValue::List(list) = node.value else {
            let told = format!("a stage is one of several tables: write {}", self.form.stages());
            self.mistakes.push(Mistake::new(at, told));
            return;
        };
        if key != "stage" {
            let told = format!("a pipeline file has no `{key}`: write {}", self.form.stages());
            self.mistakes.push(Mistake::new(at, told));
        }
        for node in list {
            if self.stages.len() == MOST_STAGES {
                let told = format!("a pipeline has at most {MOST_STAGES} stages");
                self.mistakes.push(Mistake::new(node.place.clone(), told));
                self.stages.push(StageDraft::unknown(node));
                return;
            }
            self.stage(node, registry);
        }
    }

    fn stage(&mut self, node: Node, registry: &Registry) {
        let NodeValue::Table(mut entries) = node.value else {
            let told = format!("a stage is a table: write {}", self.form.stage());
            self.mistakes.push(Mistake::new(node.place.clone(), told));
            self.stages.push(StageDraft::unknown(node));
            return;
        };
        let has_kind = entries.iter().any(|entry| entry.key == "kind");
        let kind = self.take(&mut entries, "kind", text);
        let name = self.take(&mut entries, "name", text);
        let from = self.take(&mut entries, "from", names);
        if !has_kind {
            let mistake = self.without_kind(node.place.clone(), &entries, &name, registry);
            self.mistakes.push(mistake);
        }
        let place = kind.as_ref().map_or(node.place, |(_, place)| place.clone());
        let keys = Node { place, value: NodeValue::Table(entries) };
        self.stages.push(StageDraft { kind, name, from, keys });
    }

    /// What a stage without a kind is told: the key that was meant to be it, if there is one.
    fn without_kind(
        &self,
        place: TextPlace,
        entries: &[KeyEntry],
        name: &Option<PlacedWord>,
        registry: &Registry,
    ) -> Mistake {
        if let Some((name, at)) = name.as_ref().filter(|(name, _)| registry.has(name)) {
            let told = format!("a stage needs `kind`: write {}", self.form.key("kind", name));
            return Mistake::new(at.clone(), told)
                .note("`name` is a word of your own, for the `from` of other stages");
        }
        let kinds = || registry.kinds().map(|(kind, _)| kind);
        if let Some(KeyEntry { at, node, .. }) = entries.iter().find(|e| e.key == "type") {
            let word = if let NodeValue::Text(word) = &node.value { word.as_str() } else { "" };
            let told = "a stage has no `type`: write `kind`";
            return Mistake::word(at.clone(), told, word, "kinds", kinds());
        }
        Mistake::new(place, "a stage needs `kind`").note(advice("", "kinds", kinds()))
    }

    /// Takes `key` out of a stage's keys and reads it; what it cannot be is told.
    fn take<T>(
        &mut self,
        entries: &mut Vec<KeyEntry>,
        key: &str,
        read: fn(Node) -> Result<T, (TextPlace, &'static str)>,
    ) -> Option<T> {
        let at = entries.iter().position(|e| e.key == key)?;
        match read(entries.remove(at).node) {
            Ok(read) => Some(read),
            Err((place, takes)) => {
                self.mistakes.push(Mistake::new(place, format!("`{key}` takes {takes}")));
                None
            }
        }
    }

    /// The values of settings and of the stages' keys.
    pub fn values(&self) -> impl Iterator<Item = &Node> {
        [&self.run, &self.accept].into_iter().chain(self.stages.iter().map(|stage| &stage.keys))
    }

    /// The same, to be changed.
    pub fn values_mut(&mut self) -> impl Iterator<Item = &mut Node> {
        [&mut self.run, &mut self.accept]
            .into_iter()
            .chain(self.stages.iter_mut().map(|stage| &mut stage.keys))
    }

    /// Puts the value of `set`, which is text `source`, in its place.
    pub fn apply(&mut self, set: &Set, source: usize, registry: &Registry) {
        match self.apply_to_table(set, source, registry) {
            Ok(()) => {}
            Err(mistakes) => self.mistakes.extend(mistakes),
        }
    }

    fn apply_to_table(
        &mut self,
        set: &Set,
        source: usize,
        registry: &Registry,
    ) -> Result<(), Vec<Mistake>> {
        let Some((stage, key)) = set.address() else {
            let told = "it is not said of which stage the value is";
            let told = Mistake::new(set.place(source, set.written()), told);
            return Err(vec![told.note("write STAGE.KEY=VALUE, or run.KEY=VALUE")]);
        };
        if stage == PARAMETERS {
            let name = (key.to_owned(), set.place(source, key));
            self.given.push((name, set.text(source)));
            return Ok(());
        }
        if !TABLES.contains(&stage) && ["kind", "name", "from"].contains(&key) {
            let told = format!("`{key}` is for the pipeline file alone");
            return Err(vec![Mistake::new(set.place(source, key), told)]);
        }
        let node = set.value(source)?;
        let at = set.place(source, key);
        let (table, kind) = match stage {
            "run" => (&mut self.run, "run"),
            "accept" => (&mut self.accept, "accept"),
            _ => {
                let addressed = self.addressed(stage).map_err(|(told, note)| {
                    vec![Mistake::new(set.place(source, stage), told).note(note)]
                })?;
                (&mut addressed.keys, addressed.kind.as_ref().map_or("", |(kind, _)| kind.as_str()))
            }
        };
        let NodeValue::Table(entries) = &mut table.value else { return Ok(()) };
        entries.retain(|e| e.key != key && registry.others(kind, key).all(|other| e.key != other));
        entries.push(KeyEntry { key: key.to_owned(), at, node });
        Ok(())
    }

    /// The stage that `address` means: a name, a kind, or `kind.N` counted from 1; else
    /// what is wrong, and what is right.
    fn addressed(&mut self, address: &str) -> Result<&mut StageDraft, (String, String)> {
        let named = |s: &StageDraft| s.name.as_ref().is_some_and(|(name, _)| name == address);
        if let Some(i) = self.stages.iter().position(named) {
            return Ok(&mut self.stages[i]);
        }
        let of = |kind: &str| -> Vec<usize> {
            (0..self.stages.len()).filter(|&i| self.stages[i].is(kind)).collect()
        };
        let numbered = address.rsplit_once('.').and_then(|(kind, n)| {
            let n: usize = n.parse().ok()?;
            of(kind).get(n.checked_sub(1)?).copied()
        });
        let all = of(address);
        match (&all[..], numbered) {
            (_, Some(one)) | (&[one], None) => Ok(&mut self.stages[one]),
            (&[], None) => Err((
                format!("this pipeline has no stage `{address}`"),
                advice(address, "stages", self.addresses()),
            )),
            (several, None) => {
                let valid = (1..=several.len()).map(|n| format!("{address}.{n}"));
                Err((
                    format!("{} stages are `{address}`", several.len()),
                    advice("", "write", valid),
                ))
            }
        }
    }

    fn addresses(&self) -> Vec<String> {
        let kinds = self.stages.iter().filter_map(|s| Some(s.kind.as_ref()?.0.clone()));
        let names = self.stages.iter().filter_map(|s| Some(s.name.as_ref()?.0.clone()));
        kinds.chain(names).chain(TABLES.map(str::to_owned)).collect()
    }
}
