//! Classes of points as they are typed.

use std::fmt;
use std::ops::RangeInclusive;

use crate::error::nearest;

/// Classes that have a name in the LAS specification (1.4 R15, table 17).
const CLASSES: [(&str, u8); 10] = [
    ("unclassified", 1),
    ("ground", 2),
    ("low-vegetation", 3),
    ("medium-vegetation", 4),
    ("high-vegetation", 5),
    ("building", 6),
    ("noise", 7),
    ("water", 9),
    ("rail", 10),
    ("road", 11),
];

/// A class, or those from one to another.
#[derive(Debug, Clone)]
pub(super) struct Classes(RangeInclusive<u8>);

impl Classes {
    /// Every one of them.
    pub fn each(&self) -> RangeInclusive<u8> {
        self.0.clone()
    }

    /// True if `class` is one of them.
    pub fn has(&self, class: u8) -> bool {
        self.0.contains(&class)
    }
}

/// As it is typed: `2`, `3-5`.
impl fmt::Display for Classes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (first, last) = (self.0.start(), self.0.end());
        match first == last {
            true => write!(f, "{first}"),
            false => write!(f, "{first}-{last}"),
        }
    }
}

/// Reads `2` or `3-5`.
pub(super) fn parse_classes(text: &str) -> Result<Classes, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    match (first.trim().parse(), last.trim().parse()) {
        (Ok(first), Ok(last)) if first <= last => return Ok(Classes(first..=last)),
        (Ok(first), Ok::<u8, _>(last)) => {
            return Err(format!("`{text}` is no range of classes: write {last}-{first}"));
        }
        _ => {}
    }
    let names = CLASSES.map(|(name, _)| name.to_owned());
    let near = nearest(text, &names).and_then(|near| CLASSES.iter().find(|(n, _)| n == near));
    let meant = near.map_or(String::new(), |(name, class)| format!("; {name} is {class}"));
    Err(format!("classes are numbers from 0 to 255, or ranges such as 3-5{meant}"))
}
