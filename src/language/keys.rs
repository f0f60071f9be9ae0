//! From the values of a stage to its struct, by serde, with the place of every value that does not
//! fit. Knows no stage.

use std::cell::RefCell;

use serde::de::{self, DeserializeOwned, Deserializer, IntoDeserializer, Visitor};

use super::fault::{Fault, Problem};
use super::mistake::Mistake;
use super::node::{KeyEntry, Node, NodeValue};
use crate::error::nearest;
use crate::expression::{Assignment, Condition, FromText, ONE_OR_SEVERAL, Weight};
use crate::quantity::parse_count;
use crate::report::AcceptRules;

/// Reads the table `keys` as a `T`, or tells every key that `subject` (a stage kind, `[run]`) does
/// not have and every value that does not fit. `formats` are the names of those that are
/// registered.
pub(crate) fn read<T: DeserializeOwned>(
    subject: &str,
    keys: &Node,
    formats: &[&'static str],
) -> Result<T, Vec<Mistake>> {
    let mut rest = keys.clone();
    let mut mistakes = Vec::new();
    let mut dropped: Vec<String> = Vec::new();
    let mut missing: Vec<(usize, &'static str)> = Vec::new();
    loop {
        let unknown = RefCell::new(Vec::new());
        let outcome =
            T::deserialize(NodeReader { node: &rest, unknown: &unknown, formats, is_list: false });
        let fault = match outcome {
            Ok(read) if dropped.is_empty() && unknown.borrow().is_empty() => return Ok(read),
            Ok(_) => None,
            Err(fault) => Some(fault),
        };
        let unknown = unknown.into_inner();
        let Some(fault) = fault else {
            forget_mistyped(&mut mistakes, missing, &unknown);
            mistakes.extend(unknown.iter().map(|f| f.mistake(subject, keys)));
            return Err(mistakes);
        };
        let is_told = match &fault.problem {
            Problem::Missing(key) => dropped.iter().any(|dropped| dropped == key),
            Problem::Told => true,
            _ => false,
        };
        if !is_told {
            if let (Problem::Missing(key), None) = (&fault.problem, &fault.key) {
                missing.push((mistakes.len(), key));
            }
            mistakes.push(fault.mistake(subject, keys));
        }
        // Try again without the key at fault: the next mistake comes to light.
        if !fault.key.as_deref().is_some_and(|key| remove(&mut rest, key)) {
            forget_mistyped(&mut mistakes, missing, &unknown);
            mistakes.extend(unknown.iter().map(|f| f.mistake(subject, keys)));
            return Err(mistakes);
        }
        dropped.extend(fault.key);
    }
}

/// Takes those out of `mistakes` that tell of a `missing` key which an `unknown` one was meant to
/// be: that is told of the unknown one.
fn forget_mistyped(
    mistakes: &mut Vec<Mistake>,
    missing: Vec<(usize, &'static str)>,
    unknown: &[Fault],
) {
    let is_meant = |lacks: &str| {
        unknown.iter().any(|fault| match &fault.problem {
            Problem::UnknownKey(key, _) => nearest(key, &[lacks.to_owned()]).is_some(),
            _ => false,
        })
    };
    for (at, _) in missing.into_iter().rev().filter(|(_, lacks)| is_meant(lacks)) {
        mistakes.remove(at);
    }
}

fn remove(node: &mut Node, key: &str) -> bool {
    let NodeValue::Table(entries) = &mut node.value else { return false };
    let before = entries.len();
    entries.retain(|e| e.key != key);
    entries.len() < before
}

/// The name of [`FormatName`](crate::stage::FormatName) as serde has it: a word of those that are
/// registered, which the type cannot know.
const FORMAT: &str = "FormatName";

/// A node on its way into a struct.
#[derive(Clone, Copy)]
struct NodeReader<'a> {
    node: &'a Node,
    unknown: &'a RefCell<Vec<Fault>>,
    formats: &'a [&'static str],
    /// True if a value that is no list is one of a single item.
    is_list: bool,
}

/// Below it floats hold all whole numbers.
const WHOLE: f64 = (1u64 << 53) as f64;

impl<'de> NodeReader<'de> {
    /// A whole number, also one that is written as a count is: "10k".
    fn whole<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        let NodeValue::Text(text) = &self.node.value else { return self.deserialize_any(visitor) };
        match parse_count(text) {
            Ok(count) => {
                visitor.visit_u64(count).map_err(|fault: Fault| fault.at(&self.node.place))
            }
            Err(_) => self.deserialize_any(visitor),
        }
    }

    /// Refuses a text that is no `T`, at its place in the text.
    fn expression<T: FromText>(self) -> Result<(), Fault> {
        let NodeValue::Text(text) = &self.node.value else { return Ok(()) };
        T::read(text).map(drop).map_err(|fault| {
            let place = self.node.place.within(text, &fault.span);
            Fault::new(Problem::Expression(fault)).at(&place)
        })
    }

    /// The value, which is to be one of `valid` words.
    fn word(self, valid: &[&'static str]) -> Result<&'de str, Fault> {
        match &self.node.value {
            NodeValue::Text(word) => Ok(word),
            NodeValue::Told => Err(Fault::new(Problem::Told)),
            _ => Err(de::Error::custom(format!("takes one of {}", valid.join(", ")))),
        }
    }

    fn table<V: Visitor<'de>>(
        self,
        entries: &'de [KeyEntry],
        fields: Option<&'static [&'static str]>,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let known = |e: &&KeyEntry| fields.is_none_or(|fields| fields.contains(&e.key.as_str()));
        for entry in entries.iter().filter(|e| !known(e)) {
            let valid = fields.unwrap_or_default().to_vec();
            let problem = Problem::UnknownKey(entry.key.clone(), valid);
            self.unknown.borrow_mut().push(Fault::new(problem).at(&entry.at));
        }
        let entries = entries.iter().filter(known).collect::<Vec<_>>().into_iter();
        visitor.visit_map(Entries { entries, next: None, reader: self })
    }
}

impl<'de> Deserializer<'de> for NodeReader<'de> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        if self.is_list && !matches!(self.node.value, NodeValue::List(_)) {
            let reader = NodeReader { is_list: false, ..self };
            let mut item = Items { items: std::slice::from_ref(self.node).iter(), reader };
            return visitor.visit_seq(&mut item);
        }
        match &self.node.value {
            NodeValue::Text(v) => visitor.visit_borrowed_str(v),
            NodeValue::Flag(v) => visitor.visit_bool(*v),
            // 1e1 is a float in TOML.
            NodeValue::Number(v) if v.fract() == 0.0 && v.abs() < WHOLE => {
                visitor.visit_i64(*v as i64)
            }
            NodeValue::Number(v) => visitor.visit_f64(*v),
            NodeValue::Whole(v) => match (i64::try_from(*v), u64::try_from(*v)) {
                (Ok(v), _) => visitor.visit_i64(v),
                (_, Ok(v)) => visitor.visit_u64(v),
                _ => Err(de::Error::custom("the whole number is too large")),
            },
            NodeValue::List(list) => {
                let reader = NodeReader { is_list: false, ..self };
                let mut items = Items { items: list.iter(), reader };
                let read = visitor.visit_seq(&mut items)?;
                match items.items.len() {
                    0 => Ok(read),
                    over => Err(de::Error::custom(format!("has {over} values too many"))),
                }
            }
            NodeValue::Table(entries) => self.table(entries, None, visitor),
            NodeValue::Told => Err(Fault::new(Problem::Told)),
        }
        .map_err(|fault: Fault| fault.at(&self.node.place))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_some(self).map_err(|fault: Fault| fault.at(&self.node.place))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let known = match name {
            FORMAT => self.word(self.formats).and_then(|word| {
                let problem = || Problem::UnknownWord(word.to_owned(), self.formats.to_vec());
                let is_known = self.formats.contains(&word);
                is_known.then_some(()).ok_or_else(|| Fault::new(problem()))
            }),
            Condition::NAME => self.expression::<Condition>(),
            Assignment::NAME => self.expression::<Assignment>(),
            Weight::NAME => self.expression::<Weight>(),
            AcceptRules::NAME => self.expression::<AcceptRules>(),
            ONE_OR_SEVERAL => {
                let reader = NodeReader { is_list: true, ..self };
                return visitor.visit_newtype_struct(reader);
            }
            _ => Ok(()),
        };
        known
            .and_then(|()| visitor.visit_newtype_struct(self))
            .map_err(|fault: Fault| fault.at(&self.node.place))
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        match &self.node.value {
            NodeValue::Table(entries) if entries.is_empty() => visitor.visit_unit(),
            NodeValue::Table(_) => self.deserialize_struct(name, &[], visitor),
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        match &self.node.value {
            NodeValue::Table(entries) => self
                .table(entries, Some(fields), visitor)
                .map_err(|fault| fault.at(&self.node.place)),
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        self.word(variants)
            .and_then(|word| visitor.visit_enum(word.into_deserializer()))
            .map_err(|fault: Fault| fault.at(&self.node.place))
    }

    fn deserialize_u8<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.whole(visitor)
    }

    fn deserialize_u32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.whole(visitor)
    }

    fn deserialize_u64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.whole(visitor)
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u16 u128 f32 f64 char str string bytes byte_buf unit
        seq tuple tuple_struct map identifier ignored_any
    }
}

struct Items<'a> {
    items: std::slice::Iter<'a, Node>,
    reader: NodeReader<'a>,
}

impl<'de> de::SeqAccess<'de> for &mut Items<'de> {
    type Error = Fault;

    fn next_element_seed<T: de::DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Fault> {
        let Some(node) = self.items.next() else { return Ok(None) };
        let item = seed.deserialize(NodeReader { node, ..self.reader });
        item.map(Some).map_err(|fault| fault.at(&node.place))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.items.len())
    }
}

struct Entries<'a> {
    entries: std::vec::IntoIter<&'a KeyEntry>,
    next: Option<&'a KeyEntry>,
    reader: NodeReader<'a>,
}

impl<'de> de::MapAccess<'de> for Entries<'de> {
    type Error = Fault;

    fn next_key_seed<K: de::DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Fault> {
        self.next = self.entries.next();
        let Some(entry) = self.next else { return Ok(None) };
        let key: de::value::BorrowedStrDeserializer<'de, Fault> =
            de::value::BorrowedStrDeserializer::new(&entry.key);
        seed.deserialize(key).map(Some).map_err(|fault| fault.at(&entry.at).under(&entry.key))
    }

    fn next_value_seed<V: de::DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Fault> {
        let Some(entry) = self.next.take() else {
            return Err(de::Error::custom("a value without a key"));
        };
        let reader = NodeReader { node: &entry.node, ..self.reader };
        seed.deserialize(reader).map_err(|fault| fault.at(&entry.node.place).under(&entry.key))
    }
}
