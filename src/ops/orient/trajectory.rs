//! Normals look to where the sensor was when their point was measured.

use std::path::{Path, PathBuf};

use super::sign::{TIME, turn};
use crate::geom::lattice::Lattice;
use crate::ops::normals::SignRule;
use crate::point::{NORMAL, names};
use crate::report::Tally;
use crate::stage::{Needs, ScanFacts, TileOp};
use crate::tile::Tile;
use crate::{Error, Result};

/// Largest file that is read: some ten million lines.
const MOST_BYTES: u64 = 1 << 30;

/// Where a sensor was, by time.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Trajectory {
    /// Time, x, y and z in world units, by ascending time.
    places: Vec<[f64; 4]>,
}

impl Trajectory {
    /// Reads a text of times and places.
    pub fn read(path: &Path) -> Result<Trajectory> {
        let failed = |what: &str, e: std::io::Error| Error::io(path, what, e);
        let size = std::fs::metadata(path).map_err(|e| failed("open", e))?.len();
        if size > MOST_BYTES {
            let told = format!("it has {size} bytes, and a trajectory has at most {MOST_BYTES}");
            return Err(Error::data(path, told).help("leave out what is between the flown lines"));
        }
        let bytes = std::fs::read(path).map_err(|e| failed("read", e))?;
        let text = String::from_utf8(bytes).map_err(|_| {
            let help = "a trajectory is lines of time, x, y and z";
            Error::data(path, "it is no text").help(help)
        })?;
        Trajectory::parse(&text).map_err(|(line, told)| {
            let told = format!("line {line}: {told}");
            Error::data(path, told).help("a trajectory is lines of time, x, y and z, in numbers")
        })
    }

    /// The same of a text; the number of the line that is wrong, and why.
    fn parse(text: &str) -> Result<Trajectory, (usize, String)> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = text.lines().enumerate().filter(|(_, line)| !is_blank(line)).peekable();
        let mut columns = [0, 1, 2, 3];
        if let Some((n, first)) = lines.peek().copied()
            && !fields(first).all(|field| field.parse::<f64>().is_ok())
        {
            columns = named_columns(first).map_err(|told| (n + 1, told))?;
            lines.next();
        }
        let mut places = Vec::new();
        for (n, line) in lines {
            let all: Vec<&str> = fields(line).collect();
            let mut place = [0.0; 4];
            for (value, &column) in place.iter_mut().zip(&columns) {
                let field = all.get(column).copied().unwrap_or_default();
                let number = field.parse().ok().filter(|number: &f64| number.is_finite());
                *value = number.ok_or_else(|| {
                    (n + 1, format!("column {} is {field:?}, no number", column + 1))
                })?;
            }
            places.push(place);
        }
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        match places.is_empty() {
            true => Err((1, "there is no place in it".to_owned())),
            false => Ok(Trajectory { places }),
        }
    }

    /// Where the sensor was; none before the first time and behind the last.
    fn at(&self, time: f64) -> Option<[f64; 3]> {
        let next = self.places.partition_point(|place| place[0] < time);
        let [later, x, y, z] = *self.places.get(next)?;
        if later == time {
            return Some([x, y, z]);
        }
        let [earlier, from @ ..] = *self.places.get(next.checked_sub(1)?)?;
        let part = (time - earlier) / (later - earlier);
        Some([0, 1, 2].map(|axis| from[axis] + part * ([x, y, z][axis] - from[axis])))
    }
}

fn is_blank(line: &str) -> bool {
    line.trim().is_empty() || line.trim_start().starts_with('#')
}

/// The fields of a line, whatever is between them.
fn fields(line: &str) -> impl Iterator<Item = &str> {
    let between = |c: char| matches!(c, ',' | ';' | '\t' | ' ' | '\r');
    line.split(between).map(|field| field.trim_matches('"')).filter(|field| !field.is_empty())
}

/// Where a first line of names has time, x, y and z.
fn named_columns(line: &str) -> Result<[usize; 4], String> {
    let names: Vec<String> = fields(line).map(str::to_lowercase).collect();
    let find = |wanted: &[&str]| {
        let is_it = |name: &String| wanted.contains(&name.as_str());
        names
            .iter()
            .position(is_it)
            .ok_or_else(|| format!("it names no column {}, and is no line of numbers", wanted[0]))
    };
    let time = find(&["time", "gpstime", "gps_time", "t"])?;
    Ok([time, find(&["x", "easting"])?, find(&["y", "northing"])?, find(&["z", "height"])?])
}

/// `orient` by a trajectory.
pub(super) struct TrajectoryOrientation {
    file: PathBuf,
    trajectory: Trajectory,
    lattice: Option<Lattice>,
}

impl TrajectoryOrientation {
    pub fn new(file: PathBuf, trajectory: Trajectory) -> Self {
        TrajectoryOrientation { file, trajectory, lattice: None }
    }
}

impl TileOp for TrajectoryOrientation {
    fn needs(&self) -> Needs {
        Needs::none().looks_at(names::XYZ).reads(&NORMAL).reads(&TIME).writes(&NORMAL)
    }

    fn files(&self) -> Vec<(&'static str, PathBuf)> {
        vec![("file", self.file.clone())]
    }

    fn settle(&mut self, scan: &ScanFacts) -> Result<()> {
        self.lattice = Some(scan.lattice.clone());
        Ok(())
    }

    fn run(&self, tile: &mut Tile, tally: &mut Tally) -> Result<()> {
        let unsettled = || Error::internal("the stage orient ran before it was settled");
        let lattice = self.lattice.as_ref().ok_or_else(unsettled)?;
        let times = tile.columns.take(&TIME)?;
        turn(tile, tally, |tile, i, normal| {
            let side = SignRule::towards(self.trajectory.at(times[i])?, lattice);
            Some(side.settled(normal, tile.positions[i]) != normal)
        })?;
        tile.columns.put(times);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_many_kinds_are_read_and_others_refused_with_the_line() {
        let two = Trajectory { places: vec![[1.0, 0.0, 0.0, 100.0], [3.0, 10.0, 0.0, 120.0]] };
        for text in [
            "1 0 0 100\n3 10 0 120\n",
            "3,10,0,120\r\n1,0,0,100\r\n",
            "# flown today\n\n1;0;0;100;7\n3;10;0;120;8\n",
            "X,Y,Z,GpsTime\n0,0,100,1\n10,0,120,3\n",
            "\u{feff}\"time\"\t\"x\"\t\"y\"\t\"z\"\n1\t0\t0\t100\n3\t10\t0\t120\n",
        ] {
            assert_eq!(Trajectory::parse(text).as_ref(), Ok(&two), "{text:?}");
        }
        for (text, line, part) in [
            ("", 1, "no place"),
            ("time,x,y\n1,2,3\n", 1, "no column z"),
            ("1 2 3 4\n1 2 3\n", 2, "column 4"),
            ("1 2 3 4\n\n1 2 nan 4\n", 3, "column 3 is \"nan\""),
            ("1 2 3 4\n1 2 x 4\n", 2, "column 3"),
        ] {
            let (at, told) = Trajectory::parse(text).unwrap_err();
            assert!(at == line && told.contains(part), "{text:?}: {at}, {told}");
        }
    }

    #[test]
    fn the_sensor_moves_straight_on_and_is_nowhere_beyond_its_times() {
        let flown = Trajectory::parse("1 0 0 100\n3 10 0 120\n").unwrap();
        assert_eq!(flown.at(1.0), Some([0.0, 0.0, 100.0]));
        assert_eq!(flown.at(2.5), Some([7.5, 0.0, 115.0]));
        assert_eq!(flown.at(3.0), Some([10.0, 0.0, 120.0]));
        assert_eq!((flown.at(0.999), flown.at(3.001), flown.at(f64::NAN)), (None, None, None));
    }
}
