//! How many points a PCD file has: as its header says, or, where that cannot be, as its length
//! does.

use super::file::PcdFile;
use super::header::{DAMAGED, LONGEST_LINE, PcdData};
use crate::io::damage::advised;
use crate::io::rows::lines::Lines;
use crate::report::Grouped;
use crate::{Error, Result};

impl PcdFile {
    /// Holds the counts of the header against each other and against the file's length. Those that
    /// cannot be are refused, or the file has the points that there are, if that is wanted.
    pub(super) fn count(&mut self) -> Result<()> {
        match self.disagrees() {
            Some(error) if !self.losses.mends() => return Err(advised(error)),
            Some(error) => self.believe_length(error.message().to_owned())?,
            None => self.bound()?,
        }
        if let Some(packed) = &mut self.packed {
            packed.cut(&self.header);
        }
        Ok(())
    }

    /// The error of counts that contradict each other.
    fn disagrees(&self) -> Option<Error> {
        let header = &self.header;
        let of_packed = || {
            let told = self.packed.as_ref()?.disagrees(header)?;
            Some(Error::data(&self.path, told).at_byte(header.body).help(SHORT))
        };
        let of_header = header.disagrees();
        let of_header = of_header
            .map(|told| Error::data(&self.path, told).at_byte(header.points_at).help(DAMAGED));
        of_header.or_else(of_packed)
    }

    /// Takes as many points as the file has, where its counts contradict each other as is `told`.
    /// If one of them is that number, none is lost; else those up to the largest are.
    fn believe_length(&mut self, told: String) -> Result<()> {
        let holds = self.holds()?;
        let header = &mut self.header;
        let counts = [header.points, header.cells()];
        let is_grid = header.height > 1;
        header.points = holds;
        let mut told = format!("{told}: it has {} points, and they are read", Grouped(holds));
        if counts[1] != holds {
            (header.width, header.height) = (holds, 1);
            if is_grid {
                told += " without rows and columns, which nobody knows";
            }
        }
        self.belied = Some(told);
        let most = counts.into_iter().max().unwrap_or(holds);
        if counts.contains(&holds) || most < holds {
            return Ok(());
        }
        self.lose_from(most)
    }

    /// Refuses a count of points that the file is too short for, or goes on with those that there
    /// are.
    fn bound(&mut self) -> Result<()> {
        let (header, room) = (&self.header, self.room());
        let numbers = header.fields.iter().map(|field| field.count as u64).sum::<u64>();
        let holds = match header.data {
            // A number takes a digit and what separates it from the next.
            PcdData::Ascii => (room + 1) / (2 * numbers.max(1)),
            PcdData::Binary => room / header.stride().max(1) as u64,
            PcdData::Compressed => return Ok(()),
        };
        if header.points <= holds {
            return Ok(());
        }
        let claimed = std::mem::replace(&mut self.header.points, holds);
        self.lose_from(claimed)
    }

    /// Goes on with the points that there are, fewer than the header claims, if that is wanted.
    fn lose_from(&mut self, claimed: u64) -> Result<()> {
        let (holds, end) = (self.header.points, self.origin.length());
        let told = format!(
            "the header claims {} points, the file ends after {} at most",
            Grouped(claimed),
            Grouped(holds)
        );
        let error = Error::data(&self.path, told).at_byte(end).help(SHORT);
        self.losses.lose(&self.path, end, claimed - holds, error)
    }

    /// Bytes behind the header.
    fn room(&self) -> u64 {
        self.origin.length().saturating_sub(self.header.body)
    }

    /// How many points there are, whatever the header says: whole records, or lines.
    fn holds(&self) -> Result<u64> {
        let header = &self.header;
        if let Some(packed) = &self.packed {
            return packed.holds(self.origin.reopen()?, &self.path, header);
        }
        if header.data == PcdData::Binary {
            return Ok(self.room() / header.stride().max(1) as u64);
        }
        let span = [header.body, self.origin.length()];
        let handle = self.origin.reopen()?;
        let mut lines = Lines::new(handle, &self.path, span, header.lines, LONGEST_LINE);
        let mut points = 0;
        while lines.pass_over()? {
            points += 1;
        }
        Ok(points)
    }
}

/// What helps where a file is too short.
const SHORT: &str = "the file is cut short, or its header is wrong";
