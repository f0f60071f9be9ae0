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

    /// True if both say the same: the same bytes; or the same units, and WKT of one wording, the
    /// same EPSG codes or texts that mean one system.
    pub fn same_system(&self, other: &Self) -> Result<bool> {
        if self.payloads == other.payloads {
            return Ok(true);
        }
        let (Some(one), Some(two)) = (self.text()?, other.text()?) else { return Ok(false) };
        let same = systems::are_alike(&one, &two) || systems::mean_one(&one, &two);
        // Keys of units may say what the text of the codes beside them does not.
        let (own, others) = (units(&self.vlrs, &self.evlrs)?, units(&other.vlrs, &other.evlrs)?);
        Ok(same && own.are(&others))
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
    use super::super::crs::{GEO_ASCII, GEO_DOUBLES, USER, WKT};
    use super::super::geokeys::tests::keys;
    use super::*;

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

    #[test]
    fn other_units_or_heights_beside_the_same_words_are_another_system() {
        let of = |vlrs: &[Vlr]| CrsRecords::of(vlrs, &[]).unwrap();
        // Keys of units beside the same code, and heights beside the same projection.
        let beside = |key: u16, value: u16| {
            of(&[keys(&[1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 2277, key, 0, 1, value])])
        };
        let zone = |key: u16, value: u16| {
            let own = [1, 1, 0, 6, 1024, 0, 1, 1, 2048, 0, 1, 4269, 3072, 0, 1, 32767];
            let rest = [3074, 0, 1, 16014, 3076, 0, 1, 9001, key, 0, 1, value];
            of(&[keys(&[&own[..], &rest].concat())])
        };
        for others in [
            [beside(4099, 9003), beside(4099, 9001), beside(3076, 9001), beside(4096, 5703)],
            [zone(4096, 5703), zone(4096, 6360), zone(4099, 9003), zone(4096, 0)],
        ] {
            for (n, one) in others.iter().enumerate() {
                for (m, two) in others.iter().enumerate() {
                    assert_eq!(one.same_system(two).unwrap(), n == m, "{n} {m}");
                }
            }
        }
        let text = crate::io::epsg::wkt(2277, Some(6360)).unwrap();
        let both = of(&[Vlr::new(USER, WKT, "", text.into_bytes())]);
        assert!(beside(4096, 6360).same_system(&both).unwrap());
    }
}
