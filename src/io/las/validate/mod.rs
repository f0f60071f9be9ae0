//! LAS, LAZ and COPC files held to the rules of their specifications: first what header and records
//! say, whatever it is; then, if the reader takes the file, its points, and both beside each other.

mod described;
mod header;
mod points;
mod raw;
mod records;
mod rules;
mod systems;
mod usual;

use std::path::Path;

use super::copc::validate::{CopcRecord, CopcTree, check as check_copc};
use super::copc::{self, rules as copc_rules};
use super::fields::{at, encoding};
use super::file::InputFile;
use super::input::{LasInput, Storage};
use super::source::{LasSource, opened};
use super::verify::Found;
use crate::Result;
use crate::report::Coordinate;
use crate::stage::{Findings, OnError, PointWalk, ReadKeys, Rule, Source};
use described::ExtraRange;
use points::{PointRules, PointsSeen};
use raw::RawHeader;
use records::FoundRecord;
use rules as r;

/// Whose records describe wave packets, and what their indices are added to (LAS 1.4 R15, 3).
const SPECIFICATION: &str = "LASF_Spec";
const WAVEFORM_RECORDS: usize = 99;

/// Rules that the reader needs to find records and points.
static STRUCTURE: [&Rule; 10] = [
    &r::VERSION,
    &r::HEADER_SIZE,
    &r::POINTS_START,
    &r::FORMAT,
    &r::COMPRESSED,
    &r::RECORD_LENGTH,
    &r::SCALE,
    &r::COUNT,
    &r::VLRS,
    &r::EVLRS,
];

/// All rules for LAS and LAZ, and those of COPC besides.
pub fn rules(has_octree: bool) -> Vec<&'static Rule> {
    let octree = if has_octree { &copc_rules::RULES[..] } else { &[] };
    rules::RULES.iter().chain(&usual::USUAL_RULES).chain(octree).copied().collect()
}

/// Checks the file at `path`; as COPC if `is_octree` or if it says that it is.
pub fn validate(
    path: &Path,
    is_octree: bool,
    walk: &PointWalk<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let file = InputFile::open(path)?;
    let raw = RawHeader::read(&file)?;
    header::check(&raw, findings);
    let records = records::read(&file, &raw, findings)?;
    systems::check(&raw, &records, findings);
    described::check(&raw, &records, findings);
    let tree = octree(&file, &raw, &records, is_octree, findings)?;
    room(&raw, &records, findings);
    let source = opened(&[path.to_owned()], &ReadKeys::default());
    match source.and_then(|source| Ok((LasInput::open(path, OnError::Fail)?, source))) {
        Ok((input, source)) => look(&raw, &input, &source, tree, walk, findings),
        Err(error) => {
            // What is wrong was told field by field, as far as it was met there.
            let is_met = STRUCTURE.iter().any(|rule| findings.have(rule));
            findings.error(if is_met { &r::UNREAD } else { &r::READABLE }, &error);
            Ok(())
        }
    }
}

fn octree(
    file: &InputFile,
    raw: &RawHeader,
    records: &[FoundRecord],
    is_octree: bool,
    findings: &mut Findings,
) -> Result<Option<CopcTree>> {
    let ours = records.iter().filter(|record| record.user == copc::USER);
    let ours: Vec<CopcRecord<'_>> = ours
        .map(|record| CopcRecord {
            number: record.number,
            at: record.at,
            payload_at: record.payload_at,
            end: record.payload_at + record.length,
            is_extended: record.is_extended,
            payload: &record.payload,
        })
        .collect();
    if ours.is_empty() && !is_octree {
        return Ok(None);
    }
    let head = (raw.minor(), raw.size(), raw.format(), raw.is_compressed());
    check_copc(file, &ours, head, findings)
}

/// Plain points must be as many as there is room for, up to what comes behind them.
fn room(raw: &RawHeader, records: &[FoundRecord], findings: &mut Findings) {
    let (start, each) = (raw.points_start(), u64::from(raw.short(at::RECORD_LENGTH)));
    if raw.is_compressed() || each == 0 || start > raw.length {
        return;
    }
    let counted = match raw.points() {
        0 => u64::from(raw.word(at::LEGACY_POINTS)),
        points => points,
    };
    let field = if raw.minor() >= 4 { 247 } else { at::LEGACY_POINTS as u64 };
    let extended = records.iter().filter(|record| record.is_extended).map(|record| record.at);
    let packets = (raw.minor() >= 3).then(|| raw.long(at::WAVEFORM_START));
    let next = extended.chain(packets.filter(|&at| at > start)).min();
    let behind = next.unwrap_or(raw.length).min(raw.length);
    let held = (raw.length - start) / each;
    if counted > held {
        let told = format!("{counted}, and the file ends after {held} of {each} bytes each");
        findings.at(&r::COUNT, field, told);
        return;
    }
    let end = start + counted * each;
    if end > behind {
        let told = format!("a record at byte {behind}, and the points end at byte {end}");
        findings.at(&r::EVLRS, behind, told);
    } else if behind - end >= each {
        let more = (behind - end) / each;
        let told = format!("{counted}, and there is room for {more} more behind them");
        findings.at(&r::COUNT, field, told);
    } else if behind > end {
        findings.at(&r::BEHIND, end, format!("{} bytes", behind - end));
    }
}

/// Reads all points and holds them against header and octree.
fn look(
    raw: &RawHeader,
    input: &LasInput,
    source: &LasSource,
    tree: Option<CopcTree>,
    walk: &PointWalk<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let nodes = tree.as_ref().map(|tree| tree.hold(input, findings)).unwrap_or_default();
    let is_plain = matches!(input.storage, Storage::Plain(_));
    for told in input.stored.iter().filter(|_| !is_plain) {
        findings.whole(&r::CHUNK_TABLE, told.rsplit_once(": ").map_or(told.as_str(), |(_, t)| t));
    }
    if input.header.encoding() & encoding::WAVEFORM_EXTERNAL != 0 && input.waveforms.is_none() {
        findings.whole(&r::WAVEFORM_FILE, "there is none");
    }
    let start = usize::from(input.header.point_data_record_length) - input.extra_len();
    let ranges = ExtraRange::all(input.descriptors(), start);
    let rules = PointRules::of(&input.header, is_plain, ranges, nodes);
    let states = walk.each_batch(
        source,
        &[],
        size_of::<PointsSeen>() as u64,
        PointsSeen::default,
        |seen, part, before, batch| {
            let first = source.first_record(part).unwrap_or(0) + before;
            rules.look(seen, first, batch);
        },
        |seen, _, error| {
            seen.findings.error(&r::POINTS, &error);
            Ok(())
        },
    )?;
    let mut all = PointsSeen::default();
    states.into_iter().for_each(|seen| all.merge(seen));
    findings.merge(std::mem::take(&mut all.findings));
    for told in source.found_behind() {
        findings.whole(&r::COUNT, told);
    }
    let is_described = |index: usize| {
        let number = (WAVEFORM_RECORDS + index) as u16;
        input.vlrs.iter().any(|vlr| vlr.is(SPECIFICATION, number))
            || input.evlrs.iter().any(|evlr| evlr.is(SPECIFICATION, number))
    };
    all.usual.tell(&input.header, all.times, is_described, findings);
    if all.has_byte_colors() {
        findings.whole(&r::COLORS, format!("none above {}", all.brightest));
    }
    if input.header.encoding() & 1 != 0 && all.are_of_a_week() {
        let [least, most] = all.times;
        findings.whole(&r::WEEK_TIME, format!("{least} to {most}, and the bit is set"));
    }
    if let Some(found) = source.found() {
        against(raw, input, &found, findings);
        if let Some(tree) = tree {
            tree.hold_times(all.times, findings);
        }
    }
    Ok(())
}

/// What all points come to against what the header says of them.
fn against(raw: &RawHeader, input: &LasInput, found: &Found, findings: &mut Findings) {
    let counted = raw.points();
    if counted != found.points && !findings.have(&r::COUNT) {
        let field = if raw.minor() >= 4 { 247 } else { at::LEGACY_POINTS as u64 };
        findings.at(&r::COUNT, field, format!("{counted}, and there are {}", found.points));
    }
    let (field, width, counts) = raw.returns();
    for (n, (said, is)) in counts.iter().zip(&found.returns[1..]).enumerate() {
        if said != is {
            let told = format!("{said} points of return {}, and there are {is}", n + 1);
            findings.at(&r::RETURNS, (field + width * n) as u64, told);
        }
    }
    if found.points == 0 {
        return;
    }
    let header = &input.header;
    let ([lo, hi], scale, offset) = (header.bounds(), header.scale(), header.offset());
    for axis in 0..3 {
        let world = |stored: i64| stored as f64 * scale[axis] + offset[axis];
        let [one, two] = [found.lo[axis], found.hi[axis]].map(world);
        let (least, most) = (one.min(two), one.max(two));
        let step = scale[axis].abs();
        if lo[axis] < least - step || hi[axis] > most + step {
            let short = |at: f64| Coordinate { at, step };
            let told = format!(
                "{} from {} to {}, and in the points from {} to {}",
                ["x", "y", "z"][axis],
                lo[axis],
                hi[axis],
                short(least),
                short(most)
            );
            findings.at(&r::LOOSE_BOX, (at::BOX + 16 * axis) as u64, told);
        }
    }
}
