//! The variable length records and the extended ones, found as the header says and held to the
//! rules of their heads.

use super::raw::RawHeader;
use super::rules as r;
use crate::Result;
use crate::io::las::fields::{at, encoding};
use crate::io::las::file::InputFile;
use crate::io::las::laz::LASZIP;
use crate::io::las::text::text;
use crate::io::las::vlr::{EVLR_HEAD, VLR_HEAD};
use crate::stage::Findings;

/// Records that are looked at; a file with more is not read either.
const MOST: u32 = 1 << 14;
/// Bytes of a payload that is looked at, and of all that are.
const PAYLOAD: u64 = 1 << 20;
const PAYLOADS: u64 = 8 << 20;
/// The reserved field of records in LAS 1.0.
const OLD_RESERVED: u16 = 0xaabb;

/// A record as it stands in the file.
pub struct FoundRecord {
    pub user: String,
    pub number: u16,
    /// Where its head begins.
    pub at: u64,
    /// Where its payload begins.
    pub payload_at: u64,
    /// Bytes of its payload.
    pub length: u64,
    pub is_extended: bool,
    /// What it holds, where that is looked at.
    pub payload: Vec<u8>,
}

impl FoundRecord {
    /// True if it is record `number` of `user`.
    pub fn is(&self, user: &str, number: u16) -> bool {
        self.number == number && self.user == user
    }
}

/// The records of `file`, in their order; what is wrong with them is entered.
pub fn read(
    file: &InputFile,
    raw: &RawHeader,
    findings: &mut Findings,
) -> Result<Vec<FoundRecord>> {
    let mut reading = Reading { file, minor: raw.minor(), records: Vec::new(), held: 0, findings };
    let end = reading.plain(raw)?;
    reading.extended(raw)?;
    let Reading { records, .. } = reading;
    gap(raw, end, findings);
    twice(&records, findings);
    compressed(raw, &records, findings);
    Ok(records)
}

struct Reading<'a> {
    file: &'a InputFile,
    minor: u8,
    records: Vec<FoundRecord>,
    /// Bytes of payloads.
    held: u64,
    findings: &'a mut Findings,
}

impl Reading<'_> {
    /// Those between header and points; where they end.
    fn plain(&mut self, raw: &RawHeader) -> Result<u64> {
        let (mut place, end) = (u64::from(raw.size()), raw.points_start().min(raw.length));
        let count = raw.word(at::VLRS);
        for number in 0..count.min(MOST) {
            let length = match place.checked_add(VLR_HEAD as u64).filter(|head| *head <= end) {
                Some(_) => self.record(place, VLR_HEAD, end)?,
                None => None,
            };
            let Some(length) = length else {
                let told = format!(
                    "record {} of {count} begins at byte {place} and does not end before the \
                     points at byte {end}",
                    number + 1
                );
                self.findings.at(&r::VLRS, place.min(end), told);
                break;
            };
            place += VLR_HEAD as u64 + length;
        }
        Ok(place)
    }

    /// Those behind the points.
    fn extended(&mut self, raw: &RawHeader) -> Result<()> {
        let (mut place, mut count) = if self.minor >= 4 { raw.evlrs() } else { (0, 0) };
        let mut field = at::EVLR_START as u64;
        let has_packets = raw.encoding() & encoding::WAVEFORM_INTERNAL != 0;
        if self.minor == 3 && has_packets && raw.long(at::WAVEFORM_START) > 0 {
            (place, count, field) = (raw.long(at::WAVEFORM_START), 1, at::WAVEFORM_START as u64);
        }
        if count == 0 && place != 0 {
            self.findings.at(&r::EVLR_START, field, format!("byte {place}, and none is counted"));
        }
        if count > 0 && (place < raw.points_start() || place > raw.length) {
            let told = format!(
                "{count} records from byte {place} on, and the points begin at byte {} and the \
                 file ends at {}",
                raw.points_start(),
                raw.length
            );
            self.findings.at(&r::EVLRS, field, told);
            return Ok(());
        }
        for number in 0..count.min(MOST) {
            let head = place.checked_add(EVLR_HEAD as u64).filter(|head| *head <= raw.length);
            let length = match head {
                Some(_) => self.record(place, EVLR_HEAD, raw.length)?,
                None => None,
            };
            let Some(length) = length else {
                let told = format!(
                    "extended record {} of {count} begins at byte {place} and does not end before \
                     the file does, at byte {}",
                    number + 1,
                    raw.length
                );
                self.findings.at(&r::EVLRS, place.min(raw.length), told);
                break;
            };
            place += EVLR_HEAD as u64 + length;
        }
        Ok(())
    }

    /// Adds the record whose head of `head` bytes is at `place`; the bytes of its payload, or none
    /// if they do not end before byte `end`.
    fn record(&mut self, place: u64, head: usize, end: u64) -> Result<Option<u64>> {
        let bytes = self.file.bytes(place, head)?;
        let is_extended = head == EVLR_HEAD;
        let length = match is_extended {
            true => u64::from_le_bytes(std::array::from_fn(|i| bytes[20 + i])),
            false => u64::from(u16::from_le_bytes([bytes[20], bytes[21]])),
        };
        let payload_at = place + head as u64;
        if payload_at.checked_add(length).is_none_or(|behind| behind > end) {
            return Ok(None);
        }
        let (user, number) = (text(&bytes[2..18]), u16::from_le_bytes([bytes[18], bytes[19]]));
        self.head(&bytes, place, &user, number);
        let is_read = length <= PAYLOAD
            && self.held + length <= PAYLOADS
            && ["LASF_Projection", "LASF_Spec", "liblas", "copc"].contains(&user.as_str());
        let payload = if is_read { self.file.bytes(payload_at, length as usize)? } else { vec![] };
        self.held += payload.len() as u64;
        self.records.push(FoundRecord {
            user,
            number,
            at: place,
            payload_at,
            length,
            is_extended,
            payload,
        });
        Ok(Some(length))
    }

    fn head(&mut self, bytes: &[u8], place: u64, user: &str, number: u16) {
        let reserved = u16::from_le_bytes([bytes[0], bytes[1]]);
        let is_old = self.minor == 0 && reserved == OLD_RESERVED;
        if reserved != 0 && !is_old {
            let told = format!("{reserved:#06x} in record {number} of `{user}`");
            self.findings.at(&r::VLR_RESERVED, place, told);
        }
        let name = &bytes[2..18];
        let end = name.iter().position(|&b| b == 0).unwrap_or(name.len());
        if end == 0 {
            self.findings.at(&r::VLR_USER, place + 2, format!("none for record {number}"));
        } else if name[end..].iter().any(|&b| b != 0) {
            let told = format!("other bytes behind the zero that ends `{user}`");
            self.findings.at(&r::VLR_USER, place + 2 + end as u64, told);
        }
    }
}

/// Bytes between the last record and the points, which end the records of LAS 1.0 with a mark.
fn gap(raw: &RawHeader, end: u64, findings: &mut Findings) {
    let gap = raw.points_start().saturating_sub(end);
    let is_mark = raw.minor() == 0 && gap == 2;
    if gap > 0 && !is_mark && !findings.have(&r::VLRS) {
        findings.at(&r::GAP, end, format!("{gap} bytes between them"));
    }
}

/// Records that are there twice and say one thing of the file.
fn twice(records: &[FoundRecord], findings: &mut Findings) {
    let is_single = |record: &FoundRecord| match record.user.as_str() {
        "LASF_Projection" | "liblas" | "copc" => true,
        "LASF_Spec" => matches!(record.number, 0 | 3 | 100..=354 | 65535),
        user => user == LASZIP.0,
    };
    for (n, record) in records.iter().enumerate().filter(|(_, record)| is_single(record)) {
        let is_same = |other: &&FoundRecord| other.is(&record.user, record.number);
        if let Some(first) = records[..n].iter().find(is_same) {
            let told = format!(
                "record {} of `{}` again, which is at byte {}",
                record.number, record.user, first.at
            );
            findings.at(&r::VLR_TWICE, record.at, told);
        }
    }
}

/// What says that points are compressed must do so in both places.
fn compressed(raw: &RawHeader, records: &[FoundRecord], findings: &mut Findings) {
    let record = records.iter().find(|record| record.is(LASZIP.0, LASZIP.1));
    match (raw.is_compressed(), record) {
        (true, None) => {
            let told = format!("{}, and there is no such record", raw.byte(at::FORMAT));
            findings.at(&r::COMPRESSED, at::FORMAT as u64, told);
        }
        (false, Some(record)) => {
            let told = format!("such a record, and the point format is {}", raw.byte(at::FORMAT));
            findings.at(&r::COMPRESSED, record.at, told);
        }
        _ => {}
    }
}
