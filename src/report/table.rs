//! The short table that a run prints.

use std::fmt;
use std::path::Path;

use super::document::Report;
use super::figures::{DeviationTotals, Pair, PlaneFigures, Totals};
use crate::budget::Bytes;

/// A [`Report`] as a few lines for the terminal; lengths in the scan's unit.
pub struct Table<'a> {
    report: &'a Report,
    path: Option<&'a Path>,
}

impl Report {
    /// The report as a few lines for the terminal; `path` is where the whole of it is.
    pub fn table<'a>(&'a self, path: Option<&'a Path>) -> Table<'a> {
        Table { report: self, path }
    }
}

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Report { result, run } = self.report;
        let (read, kept) = (result.ledger.read, result.ledger.kept);
        write!(f, "points     {} in, {} out", Grouped(read), Grouped(kept))?;
        if read > 0 {
            write!(f, " ({:.1} %)", kept as f64 / read as f64 * 100.0)?;
        }
        if let Some(&cells) = result.counts.get("cells") {
            write!(f, "\ncells      {}", Grouped(cells))?;
        }
        if let Some(totals) = &result.totals {
            totals_lines(f, totals)?;
        }
        if let Some(peak) = run.peak_memory_bytes {
            write!(f, "\nmemory     {} at most, budget {}", Bytes(peak), Bytes(run.memory_bytes))?;
        }
        time_line(f, self.report)?;
        if run.spill_bytes > 0 {
            write!(f, "\nspill      {}", Bytes(run.spill_bytes))?;
        }
        if let Some(path) = self.path {
            write!(f, "\nreport     {}", path.display())?;
        }
        writeln!(f)
    }
}

fn totals_lines(f: &mut fmt::Formatter<'_>, totals: &Totals) -> fmt::Result {
    let planes = [("in tiles", &totals.tile_plane), ("whole scan", &totals.scan_plane)];
    let mut heading = "plane RMS";
    for (name, plane) in planes {
        if let Pair { before: Some(PlaneFigures { rms: before, .. }), after } = plane {
            write!(f, "\n{heading:9}  {name} {}", Short(*before))?;
            if let Some(after) = after {
                write!(f, " → {}", Short(after.rms))?;
            }
            heading = "";
        }
    }
    if let Some(DeviationTotals { rms, p95, max, at: [x, y, z], .. }) = totals.deviation {
        write!(f, "\ndeviation  RMS {}, 95 % ≤ {}", Short(rms), Short(p95))?;
        write!(f, ", max {} at ({x}, {y}, {z})", Short(max))?;
    }
    Ok(())
}

fn time_line(f: &mut fmt::Formatter<'_>, report: &Report) -> fmt::Result {
    write!(f, "\ntime       {:.1} s", report.run.seconds)?;
    if let Some(cpu) = report.run.cpu_seconds {
        write!(f, " ({cpu:.1} s of CPU)")?;
    }
    for (i, phase) in report.run.phases.iter().enumerate() {
        let before = if i == 0 { ": " } else { ", " };
        write!(f, "{before}{} {:.1}", phase.name, phase.seconds)?;
    }
    Ok(())
}

/// A count with a comma between thousands.
struct Grouped(u64);

impl fmt::Display for Grouped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = self.0.to_string();
        for (i, digit) in digits.char_indices() {
            if i > 0 && (digits.len() - i).is_multiple_of(3) {
                f.write_str(",")?;
            }
            write!(f, "{digit}")?;
        }
        Ok(())
    }
}

/// A length with three digits that mean something.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            v if v == 0.0 || !v.is_finite() => write!(f, "{v}"),
            v if v.abs() >= 100.0 => write!(f, "{v:.0}"),
            v if v.abs() < 1e-4 => write!(f, "{v:.2e}"),
            v => {
                let decimals = (1..=6).find(|&d| v.abs() * 10f64.powi(d) >= 100.0).unwrap_or(6);
                write!(f, "{v:.*}", decimals as usize)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_grouped_in_thousands() {
        let text = [0, 999, 1000, 12345, 1234567].map(|n| Grouped(n).to_string());
        assert_eq!(text, ["0", "999", "1,000", "12,345", "1,234,567"]);
    }

    #[test]
    fn lengths_show_three_digits() {
        let text = [0.0, 1234.56, 12.345, 1.0, 0.0123456, 0.000123456, 1.5e-7]
            .map(|v| Short(v).to_string());
        assert_eq!(text, ["0", "1235", "12.3", "1.00", "0.0123", "0.000123", "1.50e-7"]);
    }
}
