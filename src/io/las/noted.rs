//! The variable length records in which a LAS file says how it was made.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use super::damage::Mending;
use super::file::InputFile;
use super::header::Header;
use super::records::read_vlrs;
use super::vlr::Vlr;
use crate::point::RunNote;
use crate::{Error, Result};

/// User and number of these records, whose payloads are one text.
pub const NOTE: (&str, u16) = ("pointmill", 2);
/// Bytes of it that one record holds.
const PIECE: usize = 60_000;
/// Bytes of the longest that is read.
const LONGEST: usize = 4 << 20;

/// The records that hold `text`.
pub fn records(text: &str) -> Vec<Vlr> {
    let record = |piece: &[u8]| Vlr::new(NOTE.0, NOTE.1, "provenance", piece.to_vec());
    text.as_bytes().chunks(PIECE).map(record).collect()
}

/// What the file at `path` says of how it was made; None if it says nothing, or more than is ever
/// said.
pub fn read(path: &Path) -> Result<Option<String>> {
    let file = InputFile::open(path)?;
    let header = Header::read(&file)?;
    let (vlrs, _) = read_vlrs(&file, &header, &mut Mending::default())?;
    let ours: Vec<&Vlr> = vlrs.iter().filter(|vlr| vlr.is(NOTE.0, NOTE.1)).collect();
    let length: usize = ours.iter().map(|vlr| usize::from(vlr.payload_len())).sum();
    if !(1..=LONGEST).contains(&length) {
        return Ok(None);
    }
    let mut text = Vec::with_capacity(length);
    for vlr in ours {
        text.extend_from_slice(&vlr.whole_payload()?);
    }
    Ok(Some(String::from_utf8_lossy(&text).into_owned()))
}

/// The records of a note in a file that is being written.
pub struct WrittenNote<'a> {
    /// Byte of the first of them.
    pub at: u64,
    /// What they say.
    pub note: &'a RunNote,
}

impl WrittenNote<'_> {
    /// Puts the text in the place of its draft.
    pub fn settle(&self, file: &mut File, path: &Path) -> Result<()> {
        let mut bytes = Vec::new();
        records(self.note.text()?).iter().try_for_each(|record| record.append(&mut bytes))?;
        file.seek(SeekFrom::Start(self.at))
            .and_then(|_| file.write_all(&bytes))
            .map_err(|e| Error::io(path, "write it", e))
    }
}
