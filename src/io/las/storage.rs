//! How the points of a LAS or LAZ file are stored and how many there are, proven against the file's
//! length.

use super::chunks;
use super::chunks::Chunks;
use super::damage::Mending;
use super::file::InputFile;
use super::header::Header;
use super::held::{HeldPoints, held};
use super::laz::{Compression, LASZIP};
use super::vlr::{VLR_HEAD, Vlr};
use crate::error::shown;
use crate::report::Grouped;
use crate::stage::OnError;
use crate::{Error, Result};

/// How the points are stored.
#[derive(Debug, Clone)]
pub enum Storage {
    /// As they are: so many of them.
    Plain(u64),
    /// As LAZ.
    Laz(Compression, Chunks),
}

/// How the points of a file are stored, by its header, its records and its length.
///
/// # Errors
///
/// Damage, if it is not mended, and what cannot be read.
pub fn storage(
    file: &InputFile,
    header: &Header,
    vlrs: &[Vlr],
    evlrs_start: Option<u64>,
    mending: &mut Mending,
) -> Result<Storage> {
    let record = vlrs.iter().position(|v| v.is(LASZIP.0, LASZIP.1));
    if !header.compressed() {
        return plain(file, header, evlrs_start, mending).map(Storage::Plain);
    }
    let Some(record) = record else {
        return Err(file
            .wrong(
                super::fields::at::FORMAT as u64,
                "the header says LAZ and there is no record that says how",
            )
            .help("the file is damaged: LASzip writes a record 'laszip encoded'"));
    };
    let before: usize = vlrs[..record].iter().map(Vlr::len).sum();
    let at = (usize::from(header.header_size) + before + VLR_HEAD) as u64;
    let (format, stride) = (header.format(), header.point_data_record_length);
    let compression = Compression::read(file, &vlrs[record], at, format, stride)?;
    let counted = header.points();
    let held = match mending.on_error {
        OnError::Salvage => held(file, header, &compression)?.filter(|held| held.least > counted),
        _ => None,
    };
    let found = chunks::uncounted(file, header, evlrs_start, &compression)?;
    match (held, found) {
        (Some(HeldPoints { least, most }), _) => {
            mending.warnings.push(behind_counted(file, least - counted, counted));
            mending.warnings.extend((most > least).then(|| perhaps_more(file, most - least)));
        }
        (None, Some(bytes)) => return Err(mending.advised(uncounted(file, bytes))),
        (None, None) => {}
    }
    let points = held.map_or(counted, |held| held.least);
    let end = behind_points(file, header, evlrs_start, u64::from(header.offset_to_point_data));
    let mut chunks = Chunks::read(file, (header, points), &compression, end, mending)?;
    check_last(file, &compression, &mut chunks, mending)?;
    Ok(Storage::Laz(compression, chunks))
}

/// How many plain points there are: those of the header, whose bytes must be there, or as many as
/// there are, if damage is mended; a warning if there are more.
fn plain(
    file: &InputFile,
    header: &Header,
    evlrs_start: Option<u64>,
    mending: &mut Mending,
) -> Result<u64> {
    let start = u64::from(header.offset_to_point_data);
    let (points, each) = (header.points(), u64::from(header.point_data_record_length));
    let held = (file.len() - start) / each;
    if points > held {
        let error = file
            .wrong(
                file.len(),
                format!(
                    "the file ends after {} of the {} points that its header claims, {each} bytes \
                     each from byte {start}",
                    Grouped(held),
                    Grouped(points)
                ),
            )
            .help("the copy or download is incomplete, or the header's count is damaged");
        mending.lose(file, start + held * each, points - held, error)?;
        return Ok(held);
    }
    let end = start + points * each;
    let behind = behind_points(file, header, evlrs_start, end) - end;
    if mending.on_error == OnError::Salvage && behind >= each {
        let more = behind / each;
        mending.warnings.push(behind_counted(file, more, points));
        return Ok(points + more);
    }
    if points == 0 && behind >= each {
        return Err(mending.advised(uncounted(file, behind)));
    }
    if behind >= each {
        mending.warnings.push(format!(
            "{}: {} bytes behind the {} points that the header counts are not read",
            shown(file.path()),
            Grouped(behind),
            Grouped(points)
        ));
    }
    Ok(points)
}

/// What is said of points that the header does not count and that are read.
fn behind_counted(file: &InputFile, more: u64, counted: u64) -> String {
    format!(
        "{}: {} points behind the {} that the header counts are read, too",
        shown(file.path()),
        Grouped(more),
        Grouped(counted)
    )
}

/// What is said of a last chunk whose bytes do not tell how many points it has.
fn perhaps_more(file: &InputFile, more: u64) -> String {
    format!(
        "{}: the last chunk may have up to {} points more, which are not read: its records are so \
         much alike that its bytes do not tell how many there are",
        shown(file.path()),
        Grouped(more)
    )
}

/// Where the next thing behind the points begins, which end at byte `end` or later, or the file
/// ends.
fn behind_points(file: &InputFile, header: &Header, evlrs_start: Option<u64>, end: u64) -> u64 {
    // Waveform packets that are not listed as a record stand behind the points too.
    let waveforms = Some(header.waveform_start()).filter(|&at| at > 0);
    let next = evlrs_start.into_iter().chain(waveforms).filter(|&at| at >= end).min();
    next.unwrap_or(file.len()).clamp(end, file.len().max(end))
}

/// A writer that did not come to its end leaves a count of 0 in front of the points.
fn uncounted(file: &InputFile, bytes: u64) -> Error {
    let field = super::fields::at::LEGACY_POINTS as u64;
    file.wrong(field, format!("the header counts no points and {bytes} bytes of points follow it"))
        .help("what wrote the file did not finish it; repair the counts of its header first")
}

/// The table of fixed layered chunks does not say how many points the last one has; the chunk does.
fn check_last(
    file: &InputFile,
    compression: &Compression,
    chunks: &mut Chunks,
    mending: &mut Mending,
) -> Result<()> {
    let Chunks::Known(chunks) = chunks else { return Ok(()) };
    let Some(last) = chunks.last().filter(|_| compression.layers > 0) else { return Ok(()) };
    let head = match chunks::layered_head(file, last.start, last.end, compression) {
        Ok(head) => head,
        // It is lost where it is read.
        Err(error) if mending.mends(&error) => return Ok(()),
        Err(error) => return Err(mending.advised(error)),
    };
    if head.points < last.points {
        let error = file
            .wrong(
                last.start + compression.stride as u64,
                format!(
                    "the last chunk has {} of the {} points that the header's count leaves for it",
                    head.points, last.points
                ),
            )
            .help("the header's count of points is damaged, or the file is cut off");
        mending.lose(file, last.end, last.points - head.points, error)?;
        chunks.shorten_last(head.points);
        return Ok(());
    }
    if head.points > last.points && last.whole {
        last.whole = false;
        mending.warnings.push(format!(
            "{}: {} points behind those that the header counts are not read",
            shown(file.path()),
            head.points - last.points
        ));
    }
    Ok(())
}
