//! The variable length records of a file, found and read. A count or a length that lies would lead
//! into the points: each is held against the room that it has.

use std::sync::Arc;

use super::damage::Mending;
use super::fields::{at, encoding};
use super::file::InputFile;
use super::header::Header;
use super::vlr::{BYTES_HELD, EVLR_HEAD, Evlr, RECORDS_HELD, VLR_HEAD, Vlr};
use crate::budget::Bytes;
use crate::error::shown;
use crate::{Error, Result};

/// Bytes between the records and the points that are carried; more are dropped with a warning.
const GAP_CARRIED: u64 = 64 << 10;

/// True for records whose payload means something here: systems, extra bytes, how points are
/// compressed.
fn is_read(user: &str, record: u16) -> bool {
    let users = ["LASF_Projection", "liblas", "laszip encoded"];
    users.contains(&user) || (user, record) == ("LASF_Spec", 4)
}

/// The variable length records of a file and the bytes between them and the points (a point start
/// signature in LAS 1.0). Records that are cut off are left out if that is wanted.
pub fn read_vlrs(
    file: &InputFile,
    header: &Header,
    mending: &mut Mending,
) -> Result<(Vec<Vlr>, Vec<u8>)> {
    let start = u64::from(header.header_size);
    let end = u64::from(header.offset_to_point_data);
    let claimed = claimed(file, header, mending)?;
    let mut vlrs = Vec::new();
    let (mut at, mut held) = (start, 0);
    let (origin, room) = (Arc::new(file.origin().clone()), end - start <= BYTES_HELD);
    for i in 0..claimed {
        let head = match read_head(file, at, end, i, claimed) {
            Ok(head) => head,
            Err(error) => {
                mending.tell(error)?;
                break;
            }
        };
        at += VLR_HEAD as u64;
        let mut vlr = Vlr::left(head, origin.clone(), at);
        let len = vlr.payload_len();
        if room || is_read(&vlr.user(), vlr.record()) {
            vlr.hold(file.bytes(at, usize::from(len))?);
            held += vlr.held();
        }
        if held > BYTES_HELD {
            let told = format!(
                "the variable length records that say what points are exceed {}",
                Bytes(BYTES_HELD)
            );
            return Err(file.wrong(at::VLRS as u64, told).help(NOT_HELD));
        }
        vlrs.push(vlr);
        at += u64::from(len);
    }
    let gap = end - at;
    if gap > GAP_CARRIED {
        mending.warnings.push(format!(
            "{}: {gap} bytes between the records and the points are not carried",
            shown(file.path())
        ));
        return Ok((vlrs, Vec::new()));
    }
    Ok((vlrs, file.bytes(at, gap as usize)?))
}

/// How many records the header claims, which must have room in front of the points.
fn claimed(file: &InputFile, header: &Header, mending: &mut Mending) -> Result<u32> {
    let end = u64::from(header.offset_to_point_data);
    let start = u64::from(header.header_size);
    let mut claimed = header.number_of_variable_length_records;
    let room = (end - start) / VLR_HEAD as u64;
    if u64::from(claimed) > room {
        let error = file
            .wrong(
                at::VLRS as u64,
                format!(
                    "{claimed} variable length records do not fit between the header and the \
                     points at byte {end}"
                ),
            )
            .help("the record count or the start of the points is damaged");
        mending.tell(error)?;
        claimed = room as u32; // less than it was
    }
    if claimed as usize > RECORDS_HELD {
        return Err(too_many(file, at::VLRS as u64, claimed, ""));
    }
    Ok(claimed)
}

/// The head of record `i` of `claimed`, which begins at byte `at` and has room up to byte `end`.
fn read_head(file: &InputFile, at: u64, end: u64, i: u32, claimed: u32) -> Result<[u8; VLR_HEAD]> {
    let Some(room) = (end - at).checked_sub(VLR_HEAD as u64) else {
        return Err(file
            .wrong(at, format!("record {i} of {claimed} begins behind the points"))
            .help("the record count or the start of the points is damaged"));
    };
    let mut head = [0; VLR_HEAD];
    file.read_at(&mut head, at)?;
    let len = u16::from_le_bytes([head[20], head[21]]);
    if u64::from(len) > room {
        return Err(file
            .wrong(at, format!("record {i} of {claimed} has {len} bytes and runs into the points"))
            .help("the record count, this length or the start of the points is damaged"));
    }
    Ok(head)
}

/// What is to be done about records that are not held.
const NOT_HELD: &str = "no scan needs that many: the count is damaged, or another program has to \
                        remove those without a meaning first";

fn too_many(file: &InputFile, field: u64, claimed: u32, extended: &str) -> Error {
    let told = format!(
        "{claimed} {extended}variable length records are more than the {RECORDS_HELD} held"
    );
    file.wrong(field, told).help(NOT_HELD)
}

/// The extended records of a file. LAS 1.3 has at most one, the waveform packets. Those that are
/// cut off are left out if that is wanted.
pub fn read_evlrs(file: &InputFile, header: &Header, mending: &mut Mending) -> Result<Vec<Evlr>> {
    let (mut at, mut claimed) = header.evlrs();
    let mut field = at::EVLRS as u64;
    let internal = header.encoding() & encoding::WAVEFORM_INTERNAL != 0;
    if header.minor() == 3 && internal && header.waveform_start() > 0 {
        (at, claimed) = (header.waveform_start(), 1);
        field = at::WAVEFORM_START as u64;
    }
    if claimed == 0 {
        return Ok(Vec::new());
    }
    let room = file.len().saturating_sub(at);
    if u64::from(claimed) > room / EVLR_HEAD as u64 || at < u64::from(header.header_size) {
        let error = file
            .wrong(
                field,
                format!(
                    "{claimed} extended records from byte {at} do not fit in a file of {} bytes",
                    file.len()
                ),
            )
            .help("the file is cut off, or its header is damaged");
        mending.tell(error)?;
        return Ok(Vec::new());
    }
    if claimed as usize > RECORDS_HELD {
        return Err(too_many(file, field, claimed, "extended "));
    }
    let mut evlrs = Vec::new();
    for i in 0..claimed {
        let mut head = [0; EVLR_HEAD];
        file.read_at(&mut head, at)?;
        let evlr = Evlr::at(head, file.origin().clone(), at);
        let room = file.len().saturating_sub(at + EVLR_HEAD as u64);
        if evlr.payload_len() > room {
            let error = file
                .wrong(
                    at + 20,
                    format!(
                        "extended record {i} of {claimed} claims {} bytes and the file has {room}",
                        evlr.payload_len()
                    ),
                )
                .help("the file is cut off, or this length is damaged");
            mending.tell(error)?;
            break;
        }
        at += evlr.len();
        evlrs.push(evlr);
    }
    Ok(evlrs)
}
