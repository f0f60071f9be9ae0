//! The rules that points are held to one by one, as they stream by.

use super::described::ExtraRange;
use super::rules as r;
use super::usual::{UsualFields, UsualSeen};
use crate::io::las::copc::validate::{NodeBox, outside, unsorted};
use crate::io::las::format::has_gps_time;
use crate::io::las::header::Header;
use crate::point::PointBatch;
use crate::report::Short;
use crate::stage::Findings;

/// Seconds of a week.
const WEEK: f64 = 604_800.0;
/// The largest colour of 8 bits.
const BYTE_COLOR: u16 = 255;

/// Where the fields of a record are, and what they may be.
pub struct PointRules {
    is_old: bool,
    time: Option<usize>,
    /// The first colour and how many there are.
    colors: Option<(usize, usize)>,
    usual: UsualFields,
    /// True if times are seconds of a week.
    is_week: bool,
    /// Stored coordinates that the header's box holds.
    held: Option<[[i64; 3]; 2]>,
    /// Where the first record is and how long each, where they are plain.
    plain: Option<(u64, u64)>,
    /// Ranges that extra bytes are said to have.
    ranges: Vec<ExtraRange>,
    /// Nodes of an octree, by their first record.
    nodes: Vec<NodeBox>,
}

/// What a thread found.
pub struct PointsSeen {
    pub findings: Findings,
    /// Smallest and largest GPS time.
    pub times: [f64; 2],
    /// The largest colour.
    pub brightest: u16,
    pub points: u64,
    pub usual: UsualSeen,
    /// The node, the number and the time of the last point of an octree.
    last: Option<(usize, u64, f64)>,
}

impl Default for PointsSeen {
    fn default() -> Self {
        PointsSeen {
            findings: Findings::default(),
            times: [f64::INFINITY, f64::NEG_INFINITY],
            brightest: 0,
            points: 0,
            usual: UsualSeen::default(),
            last: None,
        }
    }
}

impl PointsSeen {
    /// Adds what another thread found.
    pub fn merge(&mut self, other: PointsSeen) {
        self.findings.merge(other.findings);
        self.times = [self.times[0].min(other.times[0]), self.times[1].max(other.times[1])];
        self.brightest = self.brightest.max(other.brightest);
        self.points += other.points;
        self.usual.merge(&other.usual);
    }

    /// True if all colours are of 8 bits, and some are not black.
    pub fn has_byte_colors(&self) -> bool {
        (1..=BYTE_COLOR).contains(&self.brightest)
    }

    /// True if all times could be seconds of a week, and some are not 0.
    pub fn are_of_a_week(&self) -> bool {
        let [least, most] = self.times;
        least >= 0.0 && most <= WEEK && most > 0.0
    }
}

impl PointRules {
    /// Those of the points of a file with this header.
    pub fn of(
        header: &Header,
        plain: bool,
        ranges: Vec<ExtraRange>,
        nodes: Vec<NodeBox>,
    ) -> PointRules {
        let format = header.format();
        let is_old = format < 6;
        let behind = if is_old { 20 } else { 22 };
        let time = has_gps_time(format).then_some(behind);
        let colors = match format {
            2 => Some((20, 3)),
            3 | 5 => Some((28, 3)),
            7 => Some((30, 3)),
            8 | 10 => Some((30, 4)),
            _ => None,
        };
        let start = u64::from(header.offset_to_point_data);
        PointRules {
            is_old,
            time,
            colors,
            usual: UsualFields::of(format, colors.map(|(at, _)| at)),
            is_week: header.encoding() & 1 == 0,
            held: held(header),
            plain: plain.then_some((start, header.point_data_record_length.into())),
            ranges,
            nodes,
        }
    }

    /// Looks at records that follow each other from number `first` on.
    pub fn look(&self, seen: &mut PointsSeen, first: u64, batch: &PointBatch) {
        seen.points += batch.len() as u64;
        let mut node = self.nodes.partition_point(|node| node.first <= first);
        for (number, record) in (first..).zip(batch.iter()) {
            let byte = self.plain.map(|(start, each)| start + number * each);
            let Some(core) = record.first_chunk::<20>() else { return };
            let returns = self.flags(&mut seen.findings, number, byte, core);
            let axis =
                |i: usize| i32::from_le_bytes([core[i], core[i + 1], core[i + 2], core[i + 3]]);
            let stored = [0, 4, 8].map(axis);
            seen.usual.look(&self.usual, record, stored, returns);
            if let Some(held) = &self.held {
                in_box(&mut seen.findings, held, number, byte, stored);
            }
            if let Some(time) = self.time.and_then(|at| record.get(at..)?.first_chunk()) {
                let time = f64::from_le_bytes(*time);
                self.time(seen, number, byte, time);
                if !self.nodes.is_empty() {
                    self.order(seen, number, time);
                }
            }
            if let Some((at, count)) = self.colors {
                let colors = record.get(at..at + 2 * count).unwrap_or(&[]).as_chunks::<2>().0;
                let brightest = colors.iter().map(|bytes| u16::from_le_bytes(*bytes)).max();
                seen.brightest = seen.brightest.max(brightest.unwrap_or(0));
            }
            for range in &self.ranges {
                range.look(&mut seen.findings, number, byte, record);
            }
            while self.nodes.get(node).is_some_and(|next| next.first <= number) {
                node += 1;
            }
            if let Some(node) = node.checked_sub(1).map(|node| &self.nodes[node]) {
                let is_in = |i: usize| (node.lo[i]..=node.hi[i]).contains(&i64::from(stored[i]));
                if !(0..3).all(is_in) {
                    outside(&mut seen.findings, node, number, stored);
                }
            }
        }
    }

    /// Return numbers, class and scan angle; the number of the return and of how many it is.
    fn flags(
        &self,
        findings: &mut Findings,
        number: u64,
        byte: Option<u64>,
        core: &[u8; 20],
    ) -> (u8, u8) {
        let at = |field: u64| byte.map(|byte| byte + field);
        let (mask, shift) = if self.is_old { (0b111, 3) } else { (0b1111, 4) };
        let (returned, of) = (core[14] & mask, core[14] >> shift & mask);
        if returned == 0 || of == 0 {
            findings.point(&r::RETURN_ZERO, number, at(14), || format!("{returned} of {of}"));
        } else if returned > of {
            findings.point(&r::RETURN_BEYOND, number, at(14), || format!("{returned} of {of}"));
        }
        let (class, is_reserved) = match self.is_old {
            true => (core[15] & 31, matches!(core[15] & 31, 10 | 11 | 13..)),
            false => (core[16], matches!(core[16], 8 | 12 | 23..64)),
        };
        if is_reserved {
            let field = if self.is_old { 15 } else { 16 };
            findings.point(&r::CLASS, number, at(field), || format!("class {class}"));
        }
        let (angle, field) = match self.is_old {
            true => (f64::from(core[16].cast_signed()), 16),
            false => (f64::from(i16::from_le_bytes([core[18], core[19]])) * 0.006, 18),
        };
        let most = if self.is_old { 90.0 } else { 180.0 };
        if angle.abs() > most {
            findings.point(&r::ANGLE, number, at(field), || format!("{} degrees", Short(angle)));
        }
        (returned, of)
    }

    /// The order of times within a node of an octree.
    fn order(&self, seen: &mut PointsSeen, number: u64, time: f64) {
        let node = self.nodes.partition_point(|node| node.first <= number);
        if let Some((before, last, earlier)) = seen.last
            && (before, last + 1) == (node, number)
            && time < earlier
        {
            unsorted(&mut seen.findings, number, [earlier, time]);
        }
        seen.last = Some((node, number, time));
    }

    fn time(&self, seen: &mut PointsSeen, number: u64, byte: Option<u64>, time: f64) {
        let at = byte.map(|byte| byte + self.time.unwrap_or(0) as u64);
        if !time.is_finite() {
            seen.findings.point(&r::TIME, number, at, || format!("{time:?}"));
            return;
        }
        seen.times = [seen.times[0].min(time), seen.times[1].max(time)];
        if self.is_week && !(0.0..=WEEK).contains(&time) {
            seen.findings
                .point(&r::TIME_BIT, number, at, || format!("{time:?}, and the bit is not set"));
        }
    }
}

/// The stored coordinates that the header's box holds, half a step around it included; None if it
/// is no box.
fn held(header: &Header) -> Option<[[i64; 3]; 2]> {
    let [lo, hi] = header.bounds();
    if !(0..3).all(|axis| lo[axis] <= hi[axis] && (hi[axis] - lo[axis]).is_finite()) {
        return None;
    }
    let (scale, offset) = (header.scale(), header.offset());
    let mut held = [[0; 3]; 2];
    for axis in 0..3 {
        let [one, two] = [lo[axis], hi[axis]].map(|v| (v - offset[axis]) / scale[axis]);
        let largest = lo[axis].abs().max(hi[axis].abs()).max(offset[axis].abs());
        let half = 0.5 + 4.0 * f64::EPSILON * largest / scale[axis].abs();
        held[0][axis] = (one.min(two) - half).ceil() as i64;
        held[1][axis] = (one.max(two) + half).floor() as i64;
    }
    Some(held)
}

fn in_box(
    findings: &mut Findings,
    [lo, hi]: &[[i64; 3]; 2],
    number: u64,
    byte: Option<u64>,
    stored: [i32; 3],
) {
    let is_out = |axis: &usize| !(lo[*axis]..=hi[*axis]).contains(&i64::from(stored[*axis]));
    if let Some(axis) = (0..3).find(is_out) {
        let at = byte.map(|byte| byte + 4 * axis as u64);
        findings.point(&r::BOX, number, at, || {
            format!(
                "stored {} is {}, and the box of the header holds {} to {}",
                ["x", "y", "z"][axis],
                stored[axis],
                lo[axis],
                hi[axis]
            )
        });
    }
}
