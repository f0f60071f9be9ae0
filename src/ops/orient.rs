//! The stage `orient`: normals are turned to the side that was seen.

mod angle;
mod propagation;
mod sign;
mod trajectory;

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::quantity::Whole;
use crate::stage::{Role, RoleName, StageKind, StagePlace};
use crate::{Error, Result};

use angle::AngleOrientation;
use propagation::Propagation;
use trajectory::{Trajectory, TrajectoryOrientation};

/// Most neighbours that a normal is compared with.
const MOST: u64 = 64;
const NEIGHBORS: Whole<1, MOST> = Whole::of(10);

/// A fitted normal has no side of its own. This stage turns normals to where they were seen from,
/// or to agree with their neighbours. It stands behind `normals`, whose own `orient` does for what
/// one rule tells: up, or towards a fixed place.
///
/// With `by = "trajectory"` a normal looks to where the sensor was at the point's GPS time, which
/// `file` tells: a text of lines of time, x, y and z, in any order of times, separated by commas,
/// semicolons, tabs or spaces; further columns are not looked at. If its first line is no numbers,
/// it names them: `time` (or `gpstime`), `x`, `y` and `z`, whatever the letters' case and the
/// order. Between two times the sensor moves straight on. A point before the first time or behind
/// the last keeps its normal as it is.
///
/// With `by = "scan-angle"` it looks to where the scan angle says, to the left or to the right of
/// the way of flight and up: x and y against GPS time, of all points of one `PointSourceId`
/// together, tell that way by least squares, so that lines flown in curves need a trajectory.
///
/// With `by = "propagation"` a normal is turned to agree with those of its nearest `neighbors`
/// (Hoppe et al.): along the edges of a minimum spanning forest of the graph of neighbours, whose
/// weights are 1 − |n·n'|; of each part that hangs together the highest point looks up, of equally
/// high ones the first in canonical order. All positions are in memory at once, with
/// 12 bytes for each neighbour and 72 besides; a scan that is too large for the run's memory is
/// refused before any work.
///
/// Normals that lie across the line of sight stay as they are. The report counts the turned ones as
/// `orient_turned`, and those of which nothing tells a side as `orient_unknown`, by positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orientation {
    /// What tells the side.
    pub by: SideTold,
    /// Of trajectory, and required there: the file of times and places.
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// Of propagation: how many nearest other positions a normal is compared with, 1 to 64; 10 by
    /// default.
    #[serde(default)]
    pub neighbors: Option<Whole<1, MOST>>,
}

/// What tells to which side a normal looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SideTold {
    /// Where the sensor was at the point's time.
    Trajectory,
    /// The scan angle, and the way of flight.
    ScanAngle,
    /// Neighbours.
    Propagation,
}

impl Orientation {
    /// The stage in the role that `by` has, or the key to blame and why.
    fn role(self, at: &StagePlace) -> Result<Role, (&'static str, Error)> {
        let is_for = |key: &'static str, is_there: bool, by: &str| match is_there {
            false => Ok(()),
            true => {
                let told = format!("`orient.{key}` belongs to `orient.by = \"{by}\"`");
                let help = format!("leave `orient.{key}` out");
                Err((key, Error::pipeline(told).help(help)))
            }
        };
        if self.by != SideTold::Trajectory {
            is_for("file", self.file.is_some(), "trajectory")?;
        }
        if self.by != SideTold::Propagation {
            is_for("neighbors", self.neighbors.is_some(), "propagation")?;
        }
        Ok(match (self.by, self.file) {
            (SideTold::Trajectory, None) => {
                let told = "`orient.by = \"trajectory\"` needs an `orient.file`";
                let help = "give `orient.file = \"flight.csv\"`, lines of time, x, y and z";
                return Err(("by", Error::pipeline(told).help(help)));
            }
            (SideTold::Trajectory, Some(file)) => {
                // A file that is not there yet is no mistake where the pipeline does not run.
                let trajectory = match at.is_unread() && !file.exists() {
                    true => Trajectory::default(),
                    false => Trajectory::read(&file).map_err(|error| ("file", error))?,
                };
                Role::TileOp(Box::new(TrajectoryOrientation::new(file, trajectory)))
            }
            (SideTold::ScanAngle, _) => Role::ScanOp(Box::new(AngleOrientation::default())),
            (SideTold::Propagation, _) => {
                let neighbors = self.neighbors.unwrap_or(NEIGHBORS).get() as usize;
                Role::ScanOp(Box::new(Propagation::new(neighbors)))
            }
        })
    }
}

impl StageKind for Orientation {
    const KIND: &'static str = "orient";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Turns normals to the side from which they were seen.";
    const PLACES: &'static [&'static str] = &["file"];
    const MAIN: Option<&'static str> = Some("by");

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.role(at).map_err(|(key, error)| at.blame(key, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_another_way_are_refused() {
        let at = StagePlace::new("test", 1);
        let blamed = |text: &str| {
            toml::from_str::<Orientation>(text).unwrap().role(&at).err().map(|(key, _)| key)
        };
        for (text, key) in [
            ("by = 'propagation'", None),
            ("by = 'propagation'\nneighbors = 64", None),
            ("by = 'scan-angle'", None),
            ("by = 'scan-angle'\nneighbors = 5", Some("neighbors")),
            ("by = 'propagation'\nfile = 'x.csv'", Some("file")),
            ("by = 'trajectory'", Some("by")),
            ("by = 'trajectory'\nfile = 'there/is/none.csv'", Some("file")),
        ] {
            assert_eq!(blamed(text), key, "{text}");
        }
        for wrong in ["", "by = 'sun'", "by = 'propagation'\nneighbors = 0"] {
            assert!(toml::from_str::<Orientation>(wrong).is_err(), "{wrong}");
        }
    }
}
