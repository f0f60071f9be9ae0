//! What measured points usually are, and points that somebody made up, rounded or cut down are not:
//! nothing of it is forbidden. The rules are lasvalidate's, but for the last.

use crate::io::las::header::Header;
use crate::report::Grouped;
use crate::stage::{Findings, Rule};

/// All of them.
pub static USUAL_RULES: [&Rule; 6] =
    [&OFFSET_STEPS, &COARSE, &SAME, &RETURN_ABOVE, &SOURCE_ID, &DESCRIPTOR];

static OFFSET_STEPS: Rule = Rule::warning(
    "offset-steps",
    "LAS 1.4 R15, 2.4 X, Y, and Z Offset",
    "a whole number of steps of the scale, so that coordinates have the decimals of the scale",
);
static COARSE: Rule = Rule::warning(
    "coarse-coordinates",
    "LAS 1.4 R15, 2.6 X, Y, and Z",
    "coordinates that differ by less than ten steps of the scale: else the scale is too fine",
);
static SAME: Rule = Rule::note(
    "same-values",
    "LAS 1.4 R15, 2.6 Point Data Records",
    "intensities, scan angles, GPS times and colours that are not the same in all points",
);
static RETURN_ABOVE: Rule = Rule::warning(
    "return-above",
    "LAS 1.4 R15, 2.4 Legacy Number of Point by Return",
    "return numbers and numbers of returns up to 5 before LAS 1.4, as the header counts no more",
);
static SOURCE_ID: Rule = Rule::note(
    "point-source-id",
    "LAS 1.4 R15, 2.6 Point Source ID",
    "the file source ID of the header, where it has one; else IDs that are not all 0",
);
static DESCRIPTOR: Rule = Rule::fault(
    "waveform-descriptor",
    "LAS 1.4 R15, 2.6 Wave Packet Descriptor Index",
    "0, or the index of a record LASF_Spec 100 to 354 that is there",
);

/// The largest return number that headers before LAS 1.4 count.
const COUNTED: u8 = 5;

/// Where fields of a record are.
pub struct UsualFields {
    is_old: bool,
    /// The first colour.
    colors: Option<usize>,
    /// The index of a wave packet's descriptor.
    packet: Option<usize>,
}

impl UsualFields {
    /// Those of a point format, whose first colour is at a byte.
    pub fn of(format: u8, colors: Option<usize>) -> UsualFields {
        let packet = match format {
            4 => Some(28),
            5 => Some(34),
            9 => Some(30),
            10 => Some(38),
            _ => None,
        };
        UsualFields { is_old: format < 6, colors, packet }
    }
}

/// What points have in common.
pub struct UsualSeen {
    points: u64,
    /// Smallest and largest intensity, angle, source and colours, as far as there are some.
    values: [[i32; 2]; 6],
    /// Of each axis the last decimal digit of all stored coordinates; 10 where they differ.
    digits: [Option<u8>; 3],
    /// Descriptors of wave packets that points refer to.
    descriptors: [bool; 256],
    returns_above: u64,
}

/// Digits that differ.
const MIXED: u8 = 10;

impl Default for UsualSeen {
    fn default() -> Self {
        UsualSeen {
            points: 0,
            values: [[i32::MAX, i32::MIN]; 6],
            digits: [None; 3],
            descriptors: [false; 256],
            returns_above: 0,
        }
    }
}

impl UsualSeen {
    /// Looks at a record: its stored coordinates and returns, and the fields.
    pub fn look(
        &mut self,
        fields: &UsualFields,
        record: &[u8],
        stored: [i32; 3],
        (returned, of): (u8, u8),
    ) {
        self.points += 1;
        self.returns_above += u64::from(returned.max(of) > COUNTED);
        let short = |at: usize| {
            let bytes = record.get(at..at + 2).unwrap_or(&[0; 2]);
            u16::from_le_bytes([bytes[0], bytes[1]])
        };
        let (angle, source) = match fields.is_old {
            true => (i32::from(record[16].cast_signed()), 18),
            false => (i32::from(short(18).cast_signed()), 20),
        };
        let color = |n: usize| fields.colors.map_or(0, |at| i32::from(short(at + 2 * n)));
        let (intensity, source) = (i32::from(short(12)), i32::from(short(source)));
        let values = [intensity, angle, source, color(0), color(1), color(2)];
        for (ends, value) in self.values.iter_mut().zip(values) {
            *ends = [ends[0].min(value), ends[1].max(value)];
        }
        for (digit, stored) in self.digits.iter_mut().zip(stored) {
            if *digit != Some(MIXED) {
                let own = stored.rem_euclid(10) as u8;
                *digit = Some(if digit.is_none_or(|digit| digit == own) { own } else { MIXED });
            }
        }
        if let Some(index) = fields.packet.and_then(|at| record.get(at)) {
            self.descriptors[usize::from(*index)] = true;
        }
    }

    /// Adds what another thread saw.
    pub fn merge(&mut self, other: &UsualSeen) {
        self.points += other.points;
        self.returns_above += other.returns_above;
        for (ends, more) in self.values.iter_mut().zip(other.values) {
            *ends = [ends[0].min(more[0]), ends[1].max(more[1])];
        }
        for (digit, more) in self.digits.iter_mut().zip(other.digits) {
            *digit = match (*digit, more) {
                (Some(one), Some(other)) if one != other => Some(MIXED),
                (one, other) => one.or(other),
            };
        }
        self.descriptors.iter_mut().zip(other.descriptors).for_each(|(one, more)| *one |= more);
    }

    /// Enters what is not usual. `times` are the smallest and the largest GPS time; a record
    /// describes the wave packets of an index if `is_described` says so.
    pub fn tell(
        &self,
        header: &Header,
        times: [f64; 2],
        is_described: impl Fn(usize) -> bool,
        findings: &mut Findings,
    ) {
        offsets(header, findings);
        let missing = (1..256).filter(|&n| self.descriptors[n] && !is_described(n));
        missing.for_each(|n| findings.whole(&DESCRIPTOR, format!("no record for index {n}")));
        if header.minor() < 4 && self.returns_above > 0 {
            let points = Grouped(self.returns_above);
            findings.whole(&RETURN_ABOVE, format!("{points} points with 6 or 7"));
        }
        if self.points < 2 {
            return;
        }
        self.tell_same(header, times, findings);
        let coarse = (0..3).filter(|&axis| self.digits[axis] != Some(MIXED));
        coarse.for_each(|axis| {
            findings.whole(&COARSE, format!("{} by ten steps at least", ["x", "y", "z"][axis]));
        });
        let [least, most] = self.values[2];
        let own = i32::from(header.file_source_id);
        if own == 0 && most == 0 {
            findings.whole(&SOURCE_ID, "0 in the header and in all points");
        } else if own != 0 && most != 0 && [least, most] != [own; 2] {
            let told = format!("{own} in the header, and {least} to {most} in the points");
            findings.whole(&SOURCE_ID, told);
        }
    }

    fn tell_same(&self, header: &Header, times: [f64; 2], findings: &mut Findings) {
        let is_same = |n: usize| self.values[n][0] == self.values[n][1];
        let value = |n: usize| self.values[n][0];
        let mut told = |what: &str, value: &str| {
            findings.whole(&SAME, format!("all {what} are {value}"));
        };
        if is_same(0) {
            told("intensities", &value(0).to_string());
        }
        if is_same(1) {
            told("scan angles", &value(1).to_string());
        }
        if times[0] == times[1] {
            told("GPS times", &times[0].to_string());
        }
        let has_colors = matches!(header.format(), 2 | 3 | 5 | 7 | 8 | 10);
        if has_colors && (3..6).all(is_same) {
            let [red, green, blue] = [3, 4, 5].map(value);
            told("colours", &format!("({red}, {green}, {blue})"));
        }
    }
}

/// Offsets that are no whole number of steps: decimal fractions are seldom exact in binary.
fn offsets(header: &Header, findings: &mut Findings) {
    let each = header.offset().into_iter().zip(header.scale()).zip(["x", "y", "z"]);
    for ((offset, scale), axis) in each {
        let steps = offset / scale;
        let rest = (offset - steps.round() * scale).abs();
        // Behind the decimals that a double holds at the offset nothing is told.
        let ulp = offset.abs() * f64::EPSILON;
        if steps.is_finite() && rest > scale.abs() * 1e-3 + 2.0 * ulp {
            findings.whole(&OFFSET_STEPS, format!("{axis} of {offset} in steps of {scale}"));
        }
    }
}
