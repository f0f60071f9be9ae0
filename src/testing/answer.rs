//! What a run came to, and where two of them differ.

use std::sync::Arc;

use super::made::told;
use crate::point::{COLUMN_ENDIAN, ColumnKind, Dimension, PointBatch, Schema};
use crate::report::Outcome;

/// The records that came out, each with its columns, in the order of their bytes, and what the
/// report says.
#[derive(Debug, Clone)]
pub(super) struct Answer {
    schema: Arc<Schema>,
    columns: Vec<ColumnKind>,
    /// For each record its bytes and, behind them, the values of its columns.
    rows: Vec<Vec<u8>>,
    /// Names and values of what the report says.
    figures: Vec<(&'static str, String)>,
}

/// What of two answers is to be the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Sameness {
    /// Records, columns and report.
    Everything,
    /// Records, columns and the ledger.
    Records,
    /// Columns, and of records these dimensions and the ledger.
    Dimensions(Vec<String>),
}

impl Answer {
    /// That of the batches that came out.
    pub fn of(
        schema: &Arc<Schema>,
        columns: &[ColumnKind],
        batches: &[PointBatch],
        outcome: &Outcome,
    ) -> Answer {
        let mut rows = Vec::new();
        for batch in batches {
            for (n, record) in batch.iter().enumerate() {
                let mut row = record.to_vec();
                for kind in columns {
                    let values = batch.columns.bytes_of(*kind).unwrap_or_default();
                    let value = values.get(n * kind.bytes()..(n + 1) * kind.bytes());
                    row.extend_from_slice(value.unwrap_or_default());
                }
                rows.push(row);
            }
        }
        rows.sort_unstable();
        let schema = batches.first().map_or(schema, PointBatch::schema).clone();
        Answer { schema, columns: columns.to_vec(), rows, figures: figures(outcome) }
    }

    /// The first difference to `other`, told as that of "the first" and "the second" run, with the
    /// dimensions `named` of records.
    pub fn difference(&self, other: &Answer, same: &Sameness, named: &[String]) -> Option<String> {
        let (own, others) = match same {
            Sameness::Dimensions(kept) => (self.masked(kept), other.masked(kept)),
            _ => (self.rows.clone(), other.rows.clone()),
        };
        if let Some(n) = own.iter().zip(&others).position(|(a, b)| a != b) {
            return Some(self.told(&own[n], &others[n], named));
        }
        match (own.get(others.len()), others.get(own.len())) {
            (Some(row), _) => return Some(self.kept_by(row, "first", "second", named)),
            (_, Some(row)) => return Some(self.kept_by(row, "second", "first", named)),
            (None, None) => {}
        }
        let everything = *same == Sameness::Everything;
        let compared = |name: &str| everything || name == "ledger";
        let pairs = self.figures.iter().zip(&other.figures);
        let differ =
            |((name, a), (_, b)): &(&(&str, String), &(&str, String))| compared(name) && a != b;
        pairs.clone().find(differ).map(|((name, a), (_, b))| {
            format!("the same records come out, but the report's {name} is {a} and {b}")
        })
    }

    /// A record that did not come in as it came out, but for the dimensions `changed`.
    pub fn made_up(&self, input: &[Vec<u8>], changed: &[String]) -> Option<String> {
        let known: Vec<&str> = self.schema.dimensions.iter().map(|d| d.name.as_str()).collect();
        let kept = known.into_iter().filter(|name| !changed.iter().any(|c| c == name));
        let kept: Vec<String> = kept.map(str::to_owned).collect();
        let stride = self.schema.stride;
        let mask = mask(&self.schema, &kept);
        let masked = |row: &[u8]| -> Vec<u8> {
            row[..stride].iter().zip(&mask).map(|(byte, mask)| byte & mask).collect()
        };
        let mut left: std::collections::BTreeMap<Vec<u8>, usize> = Default::default();
        input.iter().for_each(|row| *left.entry(masked(row)).or_default() += 1);
        let is_new = |row: &&Vec<u8>| match left.get_mut(&masked(row)) {
            Some(count) if *count > 0 => {
                *count -= 1;
                false
            }
            _ => true,
        };
        let row = self.rows.iter().find({
            let mut is_new = is_new;
            move |row| is_new(row)
        })?;
        Some(format!("no record that came in is ({})", told(&self.schema, &row[..stride], &kept)))
    }

    /// The rows of which all but the columns and the dimensions `kept` is 0, in order.
    fn masked(&self, kept: &[String]) -> Vec<Vec<u8>> {
        let mask = mask(&self.schema, kept);
        let mut rows = self.rows.clone();
        for row in &mut rows {
            row.iter_mut().zip(&mask).for_each(|(byte, mask)| *byte &= mask);
        }
        rows.sort_unstable();
        rows
    }

    /// How two unequal rows differ that stand at the same place of both answers.
    fn told(&self, own: &[u8], other: &[u8], named: &[String]) -> String {
        let stride = self.schema.stride;
        if own[..stride] != other[..stride] {
            return match own < other {
                true => self.kept_by(own, "first", "second", named),
                false => self.kept_by(other, "second", "first", named),
            };
        }
        let record = told(&self.schema, &own[..stride], named);
        let mut at = stride;
        for kind in &self.columns {
            let size = kind.scalar().size();
            for part in kind.parts() {
                if own[at..at + size] != other[at..at + size] {
                    let value = |row: &[u8]| {
                        Dimension::new(*part, kind.scalar(), at).get(row, COLUMN_ENDIAN).as_f64()
                    };
                    let (a, b) = (value(own), value(other));
                    return format!(
                        "the record ({record}) has {part} {a:?} in the first and {b:?} in the \
                         second"
                    );
                }
                at += size;
            }
        }
        format!("the record ({record}) differs")
    }

    fn kept_by(&self, row: &[u8], by: &str, not_by: &str, named: &[String]) -> String {
        let record = told(&self.schema, &row[..self.schema.stride], named);
        format!("the record ({record}) comes out of the {by} and not of the {not_by}")
    }
}

/// The bits of a record that the dimensions `kept` have.
fn mask(schema: &Schema, kept: &[String]) -> Vec<u8> {
    use crate::point::Endian::Little;
    let mut mask = vec![0; schema.stride];
    for dimension in schema.dimensions.iter().filter(|d| kept.contains(&d.name)) {
        let bytes = &mut mask[dimension.offset..dimension.offset + dimension.scalar.size()];
        match dimension.bits {
            None => bytes.fill(0xff),
            Some(bits) => {
                let all = (((1u128 << bits.width) - 1) as u64) << bits.shift;
                let size = bytes.len();
                let of =
                    if schema.endian == Little { all.to_le_bytes() } else { all.to_be_bytes() };
                let of = if schema.endian == Little { &of[..size] } else { &of[8 - size..] };
                bytes.iter_mut().zip(of).for_each(|(byte, bits)| *byte |= bits);
            }
        }
    }
    mask
}

/// What a report says of a run that must be the same for every setup.
fn figures(outcome: &Outcome) -> Vec<(&'static str, String)> {
    let Outcome {
        pipeline: _,
        lattice: _,
        ledger,
        decisions,
        counts,
        stats,
        passes,
        tile_side,
        totals,
        deviations,
        classes,
        accept: _,
    } = outcome;
    vec![
        ("ledger", format!("{ledger:?}")),
        ("decisions", format!("{decisions:?}")),
        ("counts", format!("{counts:?}")),
        ("stats", format!("{stats:?}")),
        ("passes", format!("{passes:?}")),
        ("tile_side", format!("{tile_side:?}")),
        ("totals", format!("{totals:?}")),
        ("deviations", format!("{deviations:?}")),
        ("classes", format!("{classes:?}")),
    ]
}
