//! The parameters of a pipeline text: what `[params]` declares, the values that they have, and the
//! values of stages and settings that take them.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::draft::Draft;
use super::keys;
use super::mistake::{Mistake, advice};
use super::node::{KeyEntry, Node, NodeValue};
use super::parameter::{Parameter, ParameterType, value_words};
use super::place::{PlacedWord, TextPlace};
use super::references::{self, Environment, Piece};
use crate::error::nearest;

/// The keys of a parameter that has a table of its own. What its default and its choices may be
/// depends on its type.
#[derive(Deserialize, Default)]
#[serde(default)]
struct ParameterKeys {
    #[serde(rename = "type")]
    takes: Option<ParameterType>,
    #[serde(rename = "default")]
    _default: Option<IgnoredAny>,
    about: String,
    choices: Option<Vec<IgnoredAny>>,
}

/// A parameter as it is declared.
pub(super) struct Declared {
    pub name: String,
    /// Where it is declared.
    pub at: TextPlace,
    /// None if the declaration is wrong, which is told.
    takes: Option<ParameterType>,
    pub default: Option<Node>,
    choices: Vec<Node>,
    about: String,
}

/// The parameters that the table `[params]` declares; what is wrong there goes into `mistakes`.
pub(super) fn declared(table: &Node, mistakes: &mut Vec<Mistake>) -> Vec<Declared> {
    let mut entries: Vec<&KeyEntry> = table.entries().iter().collect();
    entries.sort_by_key(|entry| entry.at.start); // as they are written
    let each = entries.into_iter().map(|entry| {
        let (name, at) = (entry.key.clone(), entry.at.clone());
        if !references::is_name(&name) {
            let told = "a parameter's name is made of letters, digits, - and _";
            mistakes.push(Mistake::new(at.clone(), told));
        }
        let mut one = Declared {
            name,
            at,
            takes: None,
            default: None,
            choices: Vec::new(),
            about: String::new(),
        };
        match one.read(&entry.node) {
            Ok(takes) => one.takes = Some(takes),
            Err(wrong) => mistakes.extend(wrong),
        }
        one
    });
    each.collect()
}

impl Declared {
    /// Reads the value of its key: its default, or a table of keys. Returns its type.
    fn read(&mut self, node: &Node) -> Result<ParameterType, Vec<Mistake>> {
        let mut takes = None;
        match &node.value {
            NodeValue::Table(_) => {
                let read: ParameterKeys = keys::read(&format!("params.{}", self.name), node, &[])?;
                takes = read.takes;
                self.about = read.about;
                let key = |key: &str| node.entries().iter().find(|entry| entry.key == key);
                self.default = key("default").map(|entry| entry.node.clone());
                if let (Some(entry), Some(_)) = (key("choices"), &read.choices)
                    && let NodeValue::List(choices) = &entry.node.value
                {
                    self.choices = choices.clone();
                }
            }
            _ => self.default = Some(node.clone()),
        }
        let example = self.default.as_ref().or(self.choices.first());
        let takes = takes.or(example.and_then(ParameterType::of)).ok_or_else(|| {
            let told = format!("`params.{}` needs `type` or `default`", self.name);
            vec![Mistake::new(self.at.clone(), told).note(advice(
                "",
                "types",
                ParameterType::WORDS,
            ))]
        })?;
        let unfit = self.choices.iter().filter(|choice| !takes.fits(choice));
        let mut wrong: Vec<Mistake> = unfit.map(|choice| self.unfit(takes, choice)).collect();
        // What refers to the environment is known later.
        let is_known = |default: &&Node| !value_words(default).contains("${");
        if let Some(default) = self.default.as_ref().filter(is_known) {
            wrong.extend(self.read_default(takes, default, &|_| None).err());
        }
        if wrong.is_empty() { Ok(takes) } else { Err(wrong) }
    }

    /// Its value: what it is given, else its default. None if it can have none, which is told.
    fn value(
        &self,
        given: Option<&PlacedWord>,
        environment: Environment<'_>,
        mistakes: &mut Vec<Mistake>,
    ) -> Option<Node> {
        let takes = self.takes?;
        let read = match (given, &self.default) {
            (Some((text, place)), _) => self.read_text(takes, text, place),
            (None, Some(default)) => self.read_default(takes, default, environment),
            (None, None) => {
                let told =
                    format!("the parameter `{}` has no default: it must be given", self.name);
                let help = format!("give `params.{} = VALUE`", self.name);
                Err(Mistake::new(self.at.clone(), told).note(help))
            }
        };
        read.map_err(|wrong| mistakes.push(wrong)).ok()
    }

    fn read_text(
        &self,
        takes: ParameterType,
        text: &str,
        place: &TextPlace,
    ) -> Result<Node, Mistake> {
        match takes.read(text, place) {
            Some(node) => self.choose(node),
            None => {
                let value = NodeValue::Text(text.to_owned());
                Err(self.unfit(takes, &Node { place: place.clone(), value }))
            }
        }
    }

    fn read_default(
        &self,
        takes: ParameterType,
        default: &Node,
        environment: Environment<'_>,
    ) -> Result<Node, Mistake> {
        let no_parameter = |name: &str| {
            let told = format!("a default cannot refer to `{name}`, another parameter");
            Err((told, "it can refer to the environment: `${ENV:NAME}`".to_owned()))
        };
        let NodeValue::Text(text) = &default.value else {
            return match takes.fits(default) {
                true => self.choose(default.clone()),
                false => Err(self.unfit(takes, default)),
            };
        };
        let text = filled(default, text, environment, no_parameter)?;
        self.read_text(takes, &text, &default.place)
    }

    /// The value, which must be one of the choices, if there are some.
    fn choose(&self, node: Node) -> Result<Node, Mistake> {
        let is = value_words(&node);
        let choices: Vec<String> = self.choices.iter().map(value_words).collect();
        if choices.is_empty() || choices.contains(&is) {
            return Ok(node);
        }
        let told = format!("the parameter `{}` cannot be `{is}`", self.name);
        Err(Mistake::word(node.place, told, &is, "valid", choices))
    }

    fn unfit(&self, takes: ParameterType, node: &Node) -> Mistake {
        let (name, words, is) = (&self.name, takes.words(), value_words(node));
        let told = format!("the parameter `{name}` takes {words}, not `{is}`");
        Mistake::new(node.place.clone(), told)
    }

    /// What users are told of it.
    pub fn told(self) -> Option<Parameter> {
        Some(Parameter {
            name: self.name,
            takes: self.takes?,
            default: self.default.as_ref().map(value_words),
            choices: self.choices.iter().map(value_words).collect(),
            about: self.about,
        })
    }
}

/// The names of the parameters to which values of a pipeline refer.
pub(super) fn used(draft: &Draft) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    draft.values().for_each(|node| references::enter_names(node, &mut names));
    // No kind takes a parameter: the stage is told so, and the parameter is not told, too.
    let kinds = draft.stages.iter().filter_map(|stage| stage.kind.as_ref());
    kinds.for_each(|(kind, _)| references::enter_text(kind, &mut names));
    names
}

/// Puts values in the place of all references in a pipeline, which refers to the parameters `used`
/// where no argument changes it. Returns the values that parameters have, by their names.
pub(super) fn fill(
    draft: &mut Draft,
    used: &BTreeSet<String>,
    environment: Environment<'_>,
) -> BTreeMap<String, Node> {
    let mut mistakes = Vec::new();
    let declared = declared(&draft.params, &mut mistakes);
    let values = ParameterValues::new(&declared, &draft.given, used, environment, &mut mistakes);
    draft.values_mut().for_each(|node| values.fill(node, &mut mistakes));
    let ParameterValues { values, .. } = values;
    draft.mistakes.extend(mistakes);
    values.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

/// The values of all parameters, and the environment.
struct ParameterValues<'a> {
    /// By name; None where one is wrong, which is told.
    values: BTreeMap<String, Option<Node>>,
    environment: Environment<'a>,
}

impl<'a> ParameterValues<'a> {
    /// The values of parameters that the text refers to by the names `used`.
    fn new(
        declared: &[Declared],
        given: &[(PlacedWord, PlacedWord)],
        used: &BTreeSet<String>,
        environment: Environment<'a>,
        mistakes: &mut Vec<Mistake>,
    ) -> Self {
        for ((name, at), _) in
            given.iter().filter(|((n, _), _)| declared.iter().all(|d| d.name != *n))
        {
            let told = format!("this pipeline has no parameter `{name}`");
            let names = declared.iter().map(|one| &one.name);
            mistakes.push(Mistake::word(at.clone(), told, name, "parameters", names));
        }
        mistakes.extend(unused(declared, used));
        let value = |one: &Declared| {
            let given = given.iter().rev().find(|((name, _), _)| *name == one.name);
            (one.name.clone(), one.value(given.map(|(_, value)| value), environment, mistakes))
        };
        ParameterValues { values: declared.iter().map(value).collect(), environment }
    }

    /// Puts values in the place of the references in `node`. What arguments gave is left as it is:
    /// references are for the file.
    fn fill(&self, node: &mut Node, mistakes: &mut Vec<Mistake>) {
        match &mut node.value {
            NodeValue::List(list) => list.iter_mut().for_each(|item| self.fill(item, mistakes)),
            NodeValue::Table(entries) => {
                entries.iter_mut().for_each(|entry| self.fill(&mut entry.node, mistakes));
            }
            NodeValue::Text(text) if node.place.source == 0 && text.contains("${") => {
                let text = std::mem::take(text);
                *node = self.filled(node, &text).unwrap_or_else(|wrong| {
                    mistakes.extend(wrong);
                    Node { place: node.place.clone(), value: NodeValue::Told }
                });
            }
            _ => {}
        }
    }

    /// The value of `node`, whose text refers to others; None if one of these is wrong already.
    fn filled(&self, node: &Node, text: &str) -> Result<Node, Option<Mistake>> {
        if let Ok([(Piece::Parameter(name), span)]) = references::pieces(text).as_deref() {
            let value = self
                .value(name)
                .map_err(|(told, help)| Some(references::wrong(node, text, span, told, help)))?;
            return value.clone().ok_or(None);
        }
        let is_told = std::cell::Cell::new(false);
        let text = filled(node, text, self.environment, |name| match self.value(name)? {
            Some(Node { value: NodeValue::List(_) | NodeValue::Table(_), .. }) => Err((
                format!("the list `{name}` cannot be a part of a text"),
                "let it be the whole value".to_owned(),
            )),
            Some(node) => Ok(value_words(node)),
            None => {
                is_told.set(true);
                Ok(String::new())
            }
        })?;
        match is_told.get() {
            true => Err(None),
            false => Ok(Node { place: node.place.clone(), value: NodeValue::Text(text) }),
        }
    }

    fn value(&self, name: &str) -> Result<&Option<Node>, (String, String)> {
        self.values.get(name).ok_or_else(|| {
            let told = format!("there is no parameter `{name}`");
            let help = match self.values.is_empty() {
                true => "declare it under `params`; a literal `${` is written `$${`".to_owned(),
                false => advice(name, "parameters", self.values.keys()),
            };
            (told, help)
        })
    }
}

/// Parameters that no value uses, but for those of which the name is mistyped where they are.
fn unused<'a>(
    declared: &'a [Declared],
    used: &BTreeSet<String>,
) -> impl Iterator<Item = Mistake> + 'a {
    let names: Vec<String> = declared.iter().map(|one| one.name.clone()).collect();
    let meant: BTreeSet<String> =
        used.iter().filter_map(|name| nearest(name, &names).cloned()).collect();
    // What has no name that a value could say is told so already.
    let named = declared.iter().filter(|one| references::is_name(&one.name));
    let unused = named.filter(move |one| !meant.contains(&one.name));
    unused.map(|one| {
        let told = format!("no value uses the parameter `{}`", one.name);
        let help = format!("write `${{{}}}` where its value is to stand", one.name);
        Mistake::new(one.at.clone(), told).note(help)
    })
}

/// The text of `node` with all references replaced.
fn filled(
    node: &Node,
    text: &str,
    environment: Environment<'_>,
    parameter: impl Fn(&str) -> Result<String, (String, String)>,
) -> Result<String, Mistake> {
    let pieces = references::pieces(text)
        .map_err(|(told, help, span)| references::wrong(node, text, &span, told, help))?;
    let each = pieces.into_iter().map(|(piece, span)| {
        let value = match piece {
            Piece::Plain(plain) => Ok(plain.to_owned()),
            Piece::Parameter(name) => parameter(name),
            Piece::Variable(name, default) => references::variable(name, default, environment),
        };
        value.map_err(|(told, help)| references::wrong(node, text, &span, told, help))
    });
    each.collect()
}
