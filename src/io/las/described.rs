//! The extra-bytes descriptors of a file: which of those that its records hold are true of its
//! points, and the records that an output has them in.

use super::extra::{DESCRIPTOR_BYTES, Descriptor};
use super::vlr::{Evlr, Vlr};
use crate::Result;

/// User and number of the record that names the extra bytes.
pub const EXTRA_BYTES: (&str, u16) = ("LASF_Spec", 4);
/// Descriptors that one record holds.
const MOST: usize = u16::MAX as usize / DESCRIPTOR_BYTES;

/// What the descriptors of a file say of its extra bytes.
#[derive(Debug, Clone, Default)]
pub struct Described {
    /// Those that fit the records, in order from the first extra byte.
    pub descriptors: Vec<Descriptor>,
    /// True if the file's own records hold just these, once.
    pub as_they_are: bool,
    /// Why there are descriptors that are not used.
    pub warning: Option<String>,
}

impl Described {
    /// Those in the records of a file whose points have `extra` bytes behind the standard fields: a
    /// record that describes them all, else all records one after the other, as some writers have a
    /// record for each attribute.
    pub fn of(vlrs: &[Vlr], evlrs: &[Evlr], extra: usize) -> Result<Self> {
        let ours = vlrs.iter().filter(|v| v.is(EXTRA_BYTES.0, EXTRA_BYTES.1));
        let mut lists: Vec<Vec<Descriptor>> = ours.map(|v| Descriptor::all(v.payload())).collect();
        // There can be as many as a record has bytes.
        let most = DESCRIPTOR_BYTES * usize::from(u16::MAX);
        for evlr in evlrs.iter().filter(|v| v.is(EXTRA_BYTES.0, EXTRA_BYTES.1)) {
            lists.extend(evlr.payload(most)?.map(|payload| Descriptor::all(&payload)));
        }
        let records = lists.len();
        let size = |list: &[Descriptor]| list.iter().map(Descriptor::size).sum::<usize>();
        let whole = lists.iter().position(|list| extra > 0 && size(list) == extra);
        let all = match whole {
            Some(i) => lists.swap_remove(i),
            None => lists.concat(),
        };
        let mut end = 0;
        let fits = all.iter().take_while(|descriptor| {
            end += descriptor.size();
            end <= extra
        });
        let fitting = fits.count();
        let warning = match all.get(fitting) {
            Some(first) => Some(format!(
                "{} of {} extra-bytes descriptors, from `{}` on, describe bytes that the records, \
                 which have {extra} extra bytes, do not have: they are not carried on",
                all.len() - fitting,
                all.len(),
                first.name()
            )),
            None if whole.is_some() && lists.iter().any(|list| *list != all) => Some(format!(
                "the extra bytes are described by {records} records: the one that describes all of \
                 them is used, the others are not carried on"
            )),
            None => None,
        };
        let as_they_are = records <= 1 && fitting == all.len();
        let descriptors = all[..fitting].to_vec();
        Ok(Described { descriptors, as_they_are, warning })
    }

    /// The records of an output: `vlrs` and `evlrs` where they hold the descriptors, else with
    /// these in one record in the place of all that there were.
    pub fn carried(&self, vlrs: &mut Vec<Vlr>, evlrs: &mut Vec<Evlr>) {
        if !self.as_they_are {
            describe(vlrs, evlrs, &self.descriptors);
        }
    }
}

/// Has the extra bytes described by `descriptors` alone, in one record, or in several where one
/// cannot hold them.
pub fn describe(vlrs: &mut Vec<Vlr>, evlrs: &mut Vec<Evlr>, descriptors: &[Descriptor]) {
    let is_ours = |v: &Vlr| v.is(EXTRA_BYTES.0, EXTRA_BYTES.1);
    let place = vlrs.iter().position(is_ours).unwrap_or(vlrs.len());
    vlrs.retain(|v| !is_ours(v));
    evlrs.retain(|v| !v.is(EXTRA_BYTES.0, EXTRA_BYTES.1));
    let records = descriptors.chunks(MOST).map(record);
    vlrs.splice(place..place, records.collect::<Vec<_>>());
}

/// The record that holds `descriptors`, as many as fit one.
pub fn record(descriptors: &[Descriptor]) -> Vlr {
    let payload = descriptors.iter().flat_map(|d| *d.bytes()).collect();
    Vlr::new(EXTRA_BYTES.0, EXTRA_BYTES.1, "Extra bytes", payload)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::Scalar;

    fn descriptors(names: &[&str]) -> Vec<Descriptor> {
        names.iter().map(|name| Descriptor::plain(name, Scalar::U16)).collect()
    }

    fn names(of: &Described) -> Vec<String> {
        of.descriptors.iter().map(Descriptor::name).collect()
    }

    fn carried(described: &Described, mut vlrs: Vec<Vlr>) -> Vec<Vlr> {
        described.carried(&mut vlrs, &mut Vec::new());
        vlrs
    }

    #[test]
    fn records_for_one_attribute_each_are_read_in_order_and_become_one() {
        let other = Vlr::new("me", 1, "", Vec::new());
        let each = ["A", "B", "C"].map(|name| record(&descriptors(&[name])));
        let vlrs = [&each[..1], std::slice::from_ref(&other), &each[1..]].concat();
        let described = Described::of(&vlrs, &[], 6).unwrap();
        assert_eq!(
            (names(&described), &described.warning),
            (vec!["A".into(), "B".into(), "C".into()], &None)
        );
        let all = record(&descriptors(&["A", "B", "C"]));
        assert_eq!(carried(&described, vlrs), [all, other]);
    }

    #[test]
    fn what_the_records_of_points_have_no_room_for_is_told_and_not_carried() {
        let vlrs = vec![record(&descriptors(&["A", "B", "C"]))];
        let described = Described::of(&vlrs, &[], 5).unwrap();
        assert_eq!(names(&described), ["A", "B"]);
        let told = described.warning.clone().unwrap();
        assert!(told.contains("1 of 3") && told.contains("`C`"), "{told}");
        assert_eq!(carried(&described, vlrs.clone()), [record(&descriptors(&["A", "B"]))]);
        let none = Described::of(&vlrs, &[], 0).unwrap();
        assert!(none.warning.is_some() && carried(&none, vlrs).is_empty());
    }

    #[test]
    fn one_record_is_carried_as_it_is() {
        let vlr = record(&descriptors(&["A"]));
        for extra in [2, 9] {
            let described = Described::of(std::slice::from_ref(&vlr), &[], extra).unwrap();
            assert!(described.as_they_are && described.warning.is_none());
        }
        assert!(Described::of(&[], &[], 4).unwrap().as_they_are);
    }

    #[test]
    fn of_several_records_the_one_that_describes_all_is_true() {
        let (short, all) = (record(&descriptors(&["X"])), record(&descriptors(&["A", "B"])));
        let described = Described::of(&[short.clone(), all.clone()], &[], 4).unwrap();
        assert_eq!(names(&described), ["A", "B"]);
        assert!(described.warning.clone().unwrap().contains("2 records"));
        assert_eq!(carried(&described, vec![short, all.clone()]), vec![all.clone()]);
        let twice = Described::of(&[all.clone(), all.clone()], &[], 4).unwrap();
        assert_eq!(
            (&twice.warning, carried(&twice, vec![all.clone(), all.clone()])),
            (&None, vec![all])
        );
    }

    #[test]
    fn more_descriptors_than_a_record_holds_are_in_several() {
        let many: Vec<String> = (0..MOST + 3).map(|i| format!("A{i}")).collect();
        let many = descriptors(&many.iter().map(String::as_str).collect::<Vec<_>>());
        let mut vlrs = Vec::new();
        describe(&mut vlrs, &mut Vec::new(), &many);
        assert_eq!(vlrs.len(), 2);
        let again = Described::of(&vlrs, &[], 2 * many.len()).unwrap();
        assert_eq!(again.descriptors, many);
    }
}
