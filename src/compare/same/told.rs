//! What the records of two scans come to beside each other.

use std::fmt;

use serde::Serialize;

use crate::report::{Coordinate, Grouped};

/// Places of one kind that are told, the first ones.
pub const PLACES: usize = 3;
/// What differs between records of which no dimension does.
pub const OTHER_BYTES: &str = "other bytes";

/// Whether two scans have the same records.
///
/// Records are compared byte for byte where both scans have one layout, and by the values of the
/// dimensions that both have elsewhere. Of equal records that one scan has more often, the first is
/// told. Records are numbered from 0, over all files of a scan; those that are left out are not
/// counted.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RecordsComparison {
    /// Records of the first scan.
    pub first: u64,
    /// Records of the second scan.
    pub second: u64,
    /// True if both have the same records, each as often, in any order.
    pub same: bool,
    /// True if they are in the same order besides.
    pub same_order: bool,
    /// The first record of the first scan that is another in the second, where the records are the
    /// same but for their order.
    pub order_differs: Option<RecordPlace>,
    /// Records that the first scan alone has, or has more often.
    pub only_first: OnlyRecords,
    /// Records that the second scan alone has, or has more often.
    pub only_second: OnlyRecords,
    /// Of those, pairs at the same position with other values.
    pub changed: ChangedRecords,
    /// Whether every record of the second scan is one of the first.
    pub second_in_first: PartOf,
    /// Whether every record of the first scan is one of the second.
    pub first_in_second: PartOf,
    /// What was compared: all bytes of records, or the values of dimensions.
    pub compared: ComparedBy,
    /// Dimensions that the first scan alone has, which were not compared.
    pub not_compared_first: Vec<String>,
    /// Dimensions that the second scan alone has, which were not compared.
    pub not_compared_second: Vec<String>,
    /// The scale that places are told to; 0 where they have none.
    #[serde(skip)]
    pub(in crate::compare) step: f64,
}

/// By what records were compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ComparedBy {
    /// All their bytes.
    Bytes,
    /// The values of the dimensions that both scans have.
    Values,
}

/// Whether the records of one scan are a part of those of another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PartOf {
    /// Some are not.
    No,
    /// All are, each as often at most, in another order.
    InAnotherOrder,
    /// All are, in the same order.
    InOrder,
}

/// A record and where it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RecordPlace {
    /// Its number in its scan, from 0.
    pub number: u64,
    /// World coordinates.
    pub at: [f64; 3],
}

/// Records that one scan alone has.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct OnlyRecords {
    /// How many.
    pub count: u64,
    /// The first of them.
    pub places: Vec<RecordPlace>,
}

/// Records that are at the same position in both scans and have other values.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ChangedRecords {
    /// How many pairs.
    pub pairs: u64,
    /// The dimensions that differ, and in how many pairs.
    pub dimensions: Vec<ChangedDimension>,
    /// The first of them in the first scan.
    pub places: Vec<ChangedPlace>,
}

/// A dimension that differs between the two records of some pairs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ChangedDimension {
    /// Its name.
    pub name: String,
    /// In how many pairs.
    pub pairs: u64,
}

/// A pair of records at the same position.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ChangedPlace {
    /// The number of the record in the first scan, from 0.
    pub first: u64,
    /// The number of the record in the second scan, from 0.
    pub second: u64,
    /// World coordinates.
    pub at: [f64; 3],
}

impl RecordsComparison {
    fn place(&self, at: [f64; 3]) -> String {
        let [x, y, z] = at.map(|at| Coordinate { at, step: self.step });
        format!("({x}, {y}, {z})")
    }

    fn verdict(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.same && self.same_order {
            return writeln!(f, "records    the same, in the same order");
        }
        if self.same {
            write!(f, "records    the same, in another order")?;
            return match &self.order_differs {
                None => writeln!(f),
                Some(place) => {
                    let at = self.place(place.at);
                    writeln!(f, ": they part at number {} at {at}", Grouped(place.number))
                }
            };
        }
        writeln!(f, "records    not the same")?;
        for (name, only) in [("first", &self.only_first), ("second", &self.only_second)] {
            if only.count == 0 {
                writeln!(f, "           the {name} has none that the other does not have")?;
                continue;
            }
            write!(f, "           {} in the {name} only", Grouped(only.count))?;
            let places = only.places.iter().map(|place| (place.number, place.at));
            self.places(f, places.map(|(number, at)| (Grouped(number).to_string(), at)))?;
        }
        self.parts(f)
    }

    fn places(
        &self,
        f: &mut fmt::Formatter<'_>,
        places: impl Iterator<Item = (String, [f64; 3])>,
    ) -> fmt::Result {
        for (n, (number, at)) in places.enumerate() {
            let before = if n == 0 { ": number" } else { "," };
            write!(f, "{before} {number} at {}", self.place(at))?;
        }
        writeln!(f)
    }

    fn parts(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = [("second", "first"), ("first", "second")];
        for (part, (one, other)) in [self.second_in_first, self.first_in_second].iter().zip(names) {
            let order = match part {
                PartOf::No => continue,
                PartOf::InAnotherOrder => "in another order",
                PartOf::InOrder => "in the same order",
            };
            writeln!(f, "subset     all records of the {one} are in the {other}, {order}")?;
        }
        if self.changed.pairs == 0 {
            return Ok(());
        }
        let pairs = Grouped(self.changed.pairs);
        write!(f, "changed    {pairs} at the same position with other values")?;
        let places = self.changed.places.iter();
        let numbers = |one: &ChangedPlace| match one.first == one.second {
            true => Grouped(one.first).to_string(),
            false => format!("{} and {}", Grouped(one.first), Grouped(one.second)),
        };
        self.places(f, places.map(|one| (numbers(one), one.at)))?;
        let each = self.changed.dimensions.iter();
        let each = each.map(|one| format!("{} in {}", one.name, Grouped(one.pairs)));
        writeln!(f, "           {}", each.collect::<Vec<_>>().join(", "))
    }
}

impl fmt::Display for RecordsComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "points     {} and {}", Grouped(self.first), Grouped(self.second))?;
        self.verdict(f)?;
        write!(f, "compared   ")?;
        match self.compared {
            ComparedBy::Bytes => write!(f, "records byte for byte")?,
            ComparedBy::Values => write!(f, "the values of the dimensions that both have")?,
        }
        let left_out = [("first", &self.not_compared_first), ("second", &self.not_compared_second)];
        for (name, names) in left_out {
            if !names.is_empty() {
                write!(f, "; not {}, which the {name} alone has", names.join(", "))?;
            }
        }
        Ok(())
    }
}
