//! The names of classes, for people.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::figures::{ClassFigures, Pair};

/// What a class means by LAS 1.4 R15; None for those that it leaves to the user or reserves.
///
/// Table 17 for all but 8 and 12, which only formats 0 to 5 have (Table 9); it reserves them.
pub fn class_name(class: u8) -> Option<&'static str> {
    Some(match class {
        0 => "never classified",
        1 => "unclassified",
        2 => "ground",
        3 => "low vegetation",
        4 => "medium vegetation",
        5 => "high vegetation",
        6 => "building",
        7 => "low noise",
        8 => "model key-point",
        9 => "water",
        10 => "rail",
        11 => "road surface",
        12 => "overlap",
        13 => "wire guard",
        14 => "wire conductor",
        15 => "transmission tower",
        16 => "wire connector",
        17 => "bridge deck",
        18 => "high noise",
        19 => "overhead structure",
        20 => "ignored ground",
        21 => "snow",
        22 => "temporal exclusion",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::class_name;

    #[test]
    fn classes_of_the_standard_have_names_and_others_none() {
        let named = (0..=255).filter(|&class| class_name(class).is_some()).count();
        assert_eq!(named, 23);
        assert_eq!((class_name(2), class_name(6)), (Some("ground"), Some("building")));
        assert_eq!(class_name(64), None);
    }
}

/// Records by class, before and after.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClassCounts {
    counts: Box<[Pair<u64>; 256]>,
}

impl Serialize for ClassCounts {
    fn serialize<S: Serializer>(&self, into: S) -> Result<S::Ok, S::Error> {
        self.counts.as_slice().serialize(into)
    }
}

impl<'a> Deserialize<'a> for ClassCounts {
    fn deserialize<D: Deserializer<'a>>(from: D) -> Result<Self, D::Error> {
        let counts: Result<Box<_>, Vec<_>> = Vec::deserialize(from)?.try_into();
        let told = |all: Vec<Pair<u64>>| D::Error::invalid_length(all.len(), &"256 classes");
        Ok(ClassCounts { counts: counts.map_err(told)? })
    }
}

impl Default for ClassCounts {
    fn default() -> Self {
        ClassCounts { counts: Box::new([Pair::default(); 256]) }
    }
}

impl ClassCounts {
    /// Counts a record read.
    pub fn read(&mut self, class: u8) {
        self.counts[usize::from(class)].before += 1;
    }

    /// Counts a record kept.
    pub fn keep(&mut self, class: u8) {
        self.counts[usize::from(class)].after += 1;
    }

    /// Adds other counts.
    pub fn merge(&mut self, other: &ClassCounts) {
        for (sum, n) in self.counts.iter_mut().zip(other.counts.iter()) {
            sum.before += n.before;
            sum.after += n.after;
        }
    }

    /// The classes that there are, by number.
    pub fn figures(&self) -> Vec<ClassFigures> {
        let classes = (0..=u8::MAX).zip(self.counts.iter()).filter(|(_, n)| n.before > 0);
        classes.map(|(class, n)| ClassFigures { class, before: n.before, after: n.after }).collect()
    }
}
