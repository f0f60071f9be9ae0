//! Variable length records (LAS 1.4 R15, sections 2.5 and 2.7), carried as their bytes. Extended
//! ones stay in their file until they are written: one may hold gigabytes of waveforms. So do
//! others where there are many bytes of them.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::sync::Arc;

use super::file::InputFile;
use super::text::{field, text};
use crate::budget::Bytes;
use crate::io::origin::Origin;
use crate::{Error, ErrorKind, Result};

/// Bytes of a record's head.
pub const VLR_HEAD: usize = 54;
/// Bytes of an extended record's head.
pub const EVLR_HEAD: usize = 60;
/// Bytes of variable length records that are held in memory, of one file or as the union of
/// several: a budget has room for them before it is known. More of those that mean something here
/// are refused, more of others are left in their files.
pub const BYTES_HELD: u64 = 8 << 20;
/// Variable length records, and as many extended ones, whose heads are held in memory.
pub const RECORDS_HELD: usize = 1 << 14;
/// A variable length record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vlr {
    head: [u8; VLR_HEAD],
    payload: Payload,
}

/// What a variable length record holds.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Payload {
    /// Shared by all who carry the record.
    Held(Arc<[u8]>),
    /// Left in the file, from this byte.
    Left(Arc<Origin>, u64),
}

impl Vlr {
    /// A record whose payload is in a file from byte `at` on.
    pub fn left(head: [u8; VLR_HEAD], origin: Arc<Origin>, at: u64) -> Self {
        Vlr { head, payload: Payload::Left(origin, at) }
    }

    /// Holds its payload.
    pub fn hold(&mut self, payload: Vec<u8>) {
        self.payload = Payload::Held(payload.into());
    }

    /// A new record; `payload` must be shorter than 64 KiB.
    pub fn new(user: &str, record: u16, description: &str, payload: Vec<u8>) -> Self {
        let mut head = [0; VLR_HEAD];
        head[2..18].copy_from_slice(&field::<16>(user));
        head[22..].copy_from_slice(&field::<32>(description));
        head[18..20].copy_from_slice(&record.to_le_bytes());
        Vlr { head, payload: Payload::Held(Arc::default()) }.with_payload(payload)
    }

    /// The same record with another payload (shorter than 64 KiB).
    pub fn with_payload(&self, payload: Vec<u8>) -> Self {
        debug_assert!(u16::try_from(payload.len()).is_ok());
        let mut head = self.head;
        head[20..22].copy_from_slice(&(payload.len() as u16).to_le_bytes());
        Vlr { head, payload: Payload::Held(payload.into()) }
    }

    /// Who defined it.
    pub fn user(&self) -> String {
        text(&self.head[2..18])
    }

    /// Its number among those of its user.
    pub fn record(&self) -> u16 {
        u16::from_le_bytes([self.head[18], self.head[19]])
    }

    /// What it says it is.
    pub fn description(&self) -> String {
        text(&self.head[22..])
    }

    /// What it holds; nothing for a record that is left in its file, which means nothing here.
    pub fn payload(&self) -> &[u8] {
        match &self.payload {
            Payload::Held(bytes) => bytes,
            Payload::Left(..) => &[],
        }
    }

    /// Bytes of what it holds.
    pub fn payload_len(&self) -> u16 {
        u16::from_le_bytes([self.head[20], self.head[21]])
    }

    /// What it holds, read from its file if it is left there.
    pub fn whole_payload(&self) -> Result<Cow<'_, [u8]>> {
        match &self.payload {
            Payload::Held(bytes) => Ok(Cow::Borrowed(bytes)),
            Payload::Left(origin, at) => {
                let bytes =
                    InputFile::reopen(origin)?.bytes(*at, usize::from(self.payload_len()))?;
                Ok(Cow::Owned(bytes))
            }
        }
    }

    /// Head and payload as in the file, as far as they are held.
    pub fn held_bytes(&self) -> impl Iterator<Item = u8> + '_ {
        self.head.iter().chain(self.payload()).copied()
    }

    /// Bytes that it takes in memory.
    pub fn held(&self) -> u64 {
        (VLR_HEAD + self.payload().len()) as u64
    }

    /// True if it is record `record` of `user`.
    pub fn is(&self, user: &str, record: u16) -> bool {
        self.record() == record && self.user() == user
    }

    /// Adds head and payload to `to`, as in the file.
    pub fn append(&self, to: &mut Vec<u8>) -> Result<()> {
        to.extend(self.head);
        to.extend_from_slice(&self.whole_payload()?);
        Ok(())
    }

    /// Bytes in the file.
    pub fn len(&self) -> usize {
        VLR_HEAD + usize::from(self.payload_len())
    }

    /// The order of a union of records: user, number, bytes.
    pub fn order(&self, other: &Self) -> Result<Ordering> {
        let heads = (self.user(), self.record())
            .cmp(&(other.user(), other.record()))
            .then_with(|| self.head.cmp(&other.head));
        match heads {
            Ordering::Equal => Ok(self.whole_payload()?.cmp(&other.whole_payload()?)),
            _ => Ok(heads),
        }
    }
}

/// An extended variable length record: its head, and where its payload is.
#[derive(Debug, Clone)]
pub struct Evlr {
    head: [u8; EVLR_HEAD],
    origin: Origin,
    start: u64,
}

impl Evlr {
    /// The record of this head, which begins at byte `start` of a file.
    pub fn at(head: [u8; EVLR_HEAD], origin: Origin, start: u64) -> Self {
        Evlr { head, origin, start }
    }

    /// Who defined it.
    pub fn user(&self) -> String {
        text(&self.head[2..18])
    }

    /// Its number among those of its user.
    pub fn record(&self) -> u16 {
        u16::from_le_bytes([self.head[18], self.head[19]])
    }

    /// What it says it is.
    pub fn description(&self) -> String {
        text(&self.head[28..])
    }

    /// True if it is record `record` of `user`.
    pub fn is(&self, user: &str, record: u16) -> bool {
        self.record() == record && self.user() == user
    }

    /// Bytes of the payload, which the file has.
    pub fn payload_len(&self) -> u64 {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&self.head[20..28]);
        u64::from_le_bytes(bytes)
    }

    /// Bytes of head and payload.
    pub fn len(&self) -> u64 {
        EVLR_HEAD as u64 + self.payload_len()
    }

    /// Opened anew for each use: a survey of thousands of files must not hold them all open.
    fn open(&self) -> Result<InputFile> {
        InputFile::reopen(&self.origin)
    }

    /// Where its head stands in its file.
    pub fn position(&self) -> u64 {
        self.start
    }

    /// The payload if it has at most `limit` bytes.
    pub fn payload(&self, limit: usize) -> Result<Option<Vec<u8>>> {
        match usize::try_from(self.payload_len()) {
            Ok(len) if len <= limit => {
                self.open()?.bytes(self.start + EVLR_HEAD as u64, len).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// Hands head and payload to `take`, at most 64 KiB at a time.
    pub fn stream(&self, mut take: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
        let file = self.open()?;
        let mut at = self.start;
        let end = self.start + self.len();
        while at < end {
            let len = (end - at).min(64 << 10) as usize;
            take(&file.bytes(at, len)?)?;
            at += len as u64;
        }
        self.origin.unchanged()
    }

    /// The order of a union of records: user, number, bytes.
    pub fn order(&self, other: &Self) -> Result<Ordering> {
        let heads = (self.user(), self.record())
            .cmp(&(other.user(), other.record()))
            .then_with(|| self.head.cmp(&other.head));
        if heads != Ordering::Equal {
            return Ok(heads);
        }
        let (one, two) = (self.open()?, other.open()?);
        let (mut done, len) = (0, self.len());
        while done < len {
            let n = (len - done).min(64 << 10) as usize;
            let bytes = one.bytes(self.start + done, n)?;
            let order = bytes.cmp(&two.bytes(other.start + done, n)?);
            if order != Ordering::Equal {
                return Ok(order);
            }
            done += n as u64;
        }
        Ok(Ordering::Equal)
    }
}

/// Refuses a union of records of several files that is more than is held of one.
pub fn check_held(vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<()> {
    let bytes: u64 = vlrs.iter().map(Vlr::held).sum();
    if vlrs.len().max(evlrs.len()) <= RECORDS_HELD && bytes <= BYTES_HELD {
        return Ok(());
    }
    let (vlrs, evlrs, most) = (vlrs.len(), evlrs.len(), Bytes(BYTES_HELD));
    let told = format!(
        "the inputs have {vlrs} different variable length records of {} and {evlrs} extended ones: \
         {RECORDS_HELD} of each, and {most}, are held",
        Bytes(bytes)
    );
    Err(Error::new(ErrorKind::Data, told).help("run them in several parts, or one by one"))
}
