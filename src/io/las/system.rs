//! Whether files are in one coordinate reference system, in whatever words they say it, and whose
//! words an output of several has.

use std::cmp::Ordering;

use super::crs::{WKT_LIMIT, has_wkt, is_record, text, units};
use super::vlr::{Evlr, Vlr};
use crate::Result;
use crate::io::systems;

/// The records that say in which system a file's points are.
#[derive(Clone)]
pub struct CrsRecords {
    /// 0 with WKT, which is to be preferred, 1 without, 2 where there is nothing.
    rank: u8,
    /// Their payloads by number, whether extended or not.
    payloads: Vec<(u16, Vec<u8>)>,
    /// Those that are plain.
    pub vlrs: Vec<Vlr>,
    /// Those that are extended.
    pub evlrs: Vec<Evlr>,
}

impl CrsRecords {
    /// Those among the records of a file.
    pub fn of(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Self> {
        let vlrs: Vec<Vlr> =
            vlrs.iter().filter(|v| is_record(&v.user(), v.record())).cloned().collect();
        let evlrs: Vec<Evlr> =
            evlrs.iter().filter(|v| is_record(&v.user(), v.record())).cloned().collect();
        let mut payloads: Vec<(u16, Vec<u8>)> =
            vlrs.iter().map(|v| (v.record(), v.payload().to_vec())).collect();
        for evlr in &evlrs {
            payloads.extend(evlr.payload(WKT_LIMIT)?.map(|payload| (evlr.record(), payload)));
        }
        payloads.sort();
        payloads.dedup();
        let rank = match has_wkt(&vlrs, &evlrs)? {
            true => 0,
            false => 1 + u8::from(text(&vlrs, &evlrs)?.is_none()),
        };
        Ok(CrsRecords { rank, payloads, vlrs, evlrs })
    }

    /// True if both files have them byte for byte, at one place.
    pub fn equal(&self, other: &Self) -> bool {
        self.vlrs == other.vlrs && self.payloads == other.payloads
    }

    /// True if both say the same: the same bytes, WKT of one wording or the same EPSG codes with
    /// the same units, or texts that mean one system.
    pub fn same_system(&self, other: &Self) -> Result<bool> {
        if self.payloads == other.payloads {
            return Ok(true);
        }
        let (Some(one), Some(two)) = (self.text()?, other.text()?) else { return Ok(false) };
        let same = systems::are_alike(&one, &two);
        let (own, others) = (units(&self.vlrs, &self.evlrs)?, units(&other.vlrs, &other.evlrs)?);
        Ok(same && own.are(&others) || systems::mean_one(&one, &two))
    }

    /// See [`text`].
    pub fn text(&self) -> Result<Option<String>> {
        text(&self.vlrs, &self.evlrs)
    }

    /// Of several that say the same, outputs carry the least: those with WKT first, then by bytes.
    pub fn order(&self, other: &Self) -> Ordering {
        let bytes =
            |records: &Self| records.vlrs.iter().flat_map(Vlr::held_bytes).collect::<Vec<u8>>();
        (self.rank, &self.payloads)
            .cmp(&(other.rank, &other.payloads))
            .then_with(|| bytes(self).cmp(&bytes(other)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::crs::{GEO_ASCII, GEO_DOUBLES, GEO_KEYS, USER, WKT};
    use super::*;

    fn keys(words: &[u16]) -> Vlr {
        Vlr::new(USER, GEO_KEYS, "", words.iter().flat_map(|w| w.to_le_bytes()).collect())
    }

    #[test]
    fn one_system_in_other_words_is_one() {
        let of = |vlrs: &[Vlr]| CrsRecords::of(vlrs, &[]).unwrap();
        let wkt = |text: &str| Vlr::new(USER, WKT, "", text.as_bytes().to_vec());
        let utm = |code: u16| keys(&[1, 1, 0, 1, 3072, 0, 1, code]);
        let text = "PROJCS[\"a\",UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25832\"]]";
        let spaced = "PROJCS [ \"a\", UNIT[\"metre\",1.0],\n AUTHORITY[\"EPSG\",\"25832\"]]\0\0";
        let feet = text.replace("metre\",1", "foot\",0.3048");
        let plain = [wkt(text)];
        for same in [wkt(spaced), utm(25832)] {
            let other = of(&[same]);
            assert!(of(&plain).same_system(&other).unwrap() && !of(&plain).equal(&other));
        }
        assert_eq!(of(&plain).order(&of(&[utm(25832)])), Ordering::Less, "WKT is preferred");
        for other in [wkt(&feet), utm(25833), wkt("PROJCS[\"b\",UNIT[\"metre\",1]]")] {
            assert!(!of(&plain).same_system(&of(&[other])).unwrap());
        }
        assert!(!of(&plain).same_system(&of(&[])).unwrap());
        // What no code says may differ behind equal citations.
        let here = |doubles: u8| {
            let ascii = Vlr::new(USER, GEO_ASCII, "", b"Here|".to_vec());
            of(&[ascii, Vlr::new(USER, GEO_DOUBLES, "", vec![doubles; 8])])
        };
        assert!(!here(1).same_system(&here(2)).unwrap());
    }
}
