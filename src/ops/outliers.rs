//! The stage `outliers`: points far from all others are removed before anything is computed.

mod neighbors;
mod radius;
mod statistical;

use schemars::JsonSchema;
use serde::ser::SerializeStruct;
use serde::{Deserialize, Serialize, Serializer};

use crate::point::Mark;
use crate::quantity::Length;
use crate::stage::{Role, RoleName, StageKind, StagePlace};
use crate::{Error, Result};

pub use radius::RadiusOutliers;
pub use statistical::StatisticalOutliers;

const NEIGHBORS: usize = 10;
const MULTIPLIER: f64 = 2.0;

/// What the paper does before its first step: "the farther noise point is removed".
///
/// Positions count, not records: copies of a point are no neighbours of each other, weigh as one,
/// and are removed together.
///
/// With `method = "statistical"` a point's figure is the mean distance to its `neighbors` nearest
/// other positions, or to all there are where the scan has fewer. Removed is what exceeds mean +
/// `multiplier` · σ, both taken over the figures of all positions that the stage decides about (σ
/// of the population). Figures are rounded to 2^-16 lattice steps and summed exactly, so that the
/// mean and σ of a scan do not depend on how it is cut into tiles. The report names mean, σ and
/// threshold in the scan's unit. The scan is searched once: a first phase stores the figures, a
/// second reads them.
///
/// With `method = "radius"` removed is what has fewer than `min_neighbors` other positions within
/// `radius`, those at exactly this distance included. Squared distances are whole numbers of
/// lattice steps; they are compared with the square of the radius in steps, which is a whole number
/// of steps where it differs from one by rounding alone (10⁻⁹ of it).
///
/// With `mark`, every record is written and the decision is in the records: `"withheld"` sets the
/// withheld flag of outliers, 7 and 18 (low and high noise) make that their class, `"key-point"`
/// sets the key-point flag of all others and clears that of outliers. The report counts the records
/// as `outliers_marked`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Outliers {
    /// What an outlier is.
    pub method: OutlierMethod,
    /// Of statistical: how many nearest other positions the mean distance is taken to, 1 to 64.
    #[schemars(range(min = 1, max = 64))]
    pub neighbors: Option<usize>,
    /// Of statistical: how many σ above the mean are still no outlier, 0 or more.
    #[schemars(range(min = 0))]
    pub multiplier: Option<f64>,
    /// Of radius, and required there: how far to look.
    pub radius: Option<Length>,
    /// Of radius, and required there: so many other positions make a point none, 1 to 64.
    #[schemars(range(min = 1, max = 64))]
    pub min_neighbors: Option<usize>,
    /// How records are marked, instead of removing any.
    pub mark: Option<Mark>,
}

/// What an outlier is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum OutlierMethod {
    /// What is farther from its neighbours than most points of the scan are from theirs.
    #[default]
    Statistical,
    /// What has too few neighbours nearby.
    Radius,
}

impl Outliers {
    /// The stage in the role that its method has, or the key to blame and why.
    pub(crate) fn role(self) -> Result<Role, (&'static str, Error)> {
        match self.method {
            OutlierMethod::Statistical => {
                let told = "belongs to `outliers.method = \"radius\"`";
                absent("radius", self.radius.is_some(), told)?;
                absent("min_neighbors", self.min_neighbors.is_some(), told)?;
                let neighbors = self.neighbors.unwrap_or(NEIGHBORS);
                let multiplier = self.multiplier.unwrap_or(MULTIPLIER);
                let stage = StatisticalOutliers::new(neighbors, multiplier, self.mark)?;
                Ok(Role::ScanOp(Box::new(stage)))
            }
            OutlierMethod::Radius => {
                let told = "belongs to `outliers.method = \"statistical\"`";
                absent("neighbors", self.neighbors.is_some(), told)?;
                absent("multiplier", self.multiplier.is_some(), told)?;
                let radius = given("radius", self.radius)?;
                let least = given("min_neighbors", self.min_neighbors)?;
                let stage = RadiusOutliers::new(radius, least, self.mark)?;
                Ok(Role::TileOp(Box::new(stage)))
            }
        }
    }
}

/// Refuses `key` if it is there: it would do nothing.
fn absent(key: &'static str, is_there: bool, told: &str) -> Result<(), (&'static str, Error)> {
    if !is_there {
        return Ok(());
    }
    let help = format!("leave `outliers.{key}` out");
    Err((key, Error::pipeline(format!("`outliers.{key}` {told}")).help(help)))
}

fn given<T>(key: &'static str, value: Option<T>) -> Result<T, (&'static str, Error)> {
    value.ok_or_else(|| {
        let error =
            Error::pipeline(format!("`outliers.method = \"radius\"` needs `outliers.{key}`"))
                .help("for example `outliers.radius = 1.0` and `outliers.min_neighbors = 4`");
        ("method", error)
    })
}

/// With the defaults that the method has, as the report names the stage.
impl Serialize for Outliers {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let statistical = self.method == OutlierMethod::Statistical;
        let mut keys = to.serialize_struct("Outliers", 6)?;
        keys.serialize_field("method", &self.method)?;
        keys.serialize_field("neighbors", &self.neighbors.or(statistical.then_some(NEIGHBORS)))?;
        keys.serialize_field("multiplier", &self.multiplier.or(statistical.then_some(MULTIPLIER)))?;
        keys.serialize_field("radius", &self.radius)?;
        keys.serialize_field("min_neighbors", &self.min_neighbors)?;
        keys.serialize_field("mark", &self.mark)?;
        keys.end()
    }
}

impl StageKind for Outliers {
    const KIND: &'static str = "outliers";
    const ROLE: RoleName = RoleName::OnTiles;
    const ABOUT: &'static str = "Removes points that are far from all others.";

    fn build(self, at: &StagePlace) -> Result<Role> {
        self.role().map_err(|(key, error)| at.blame(key, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blamed(text: &str) -> Option<&'static str> {
        toml::from_str::<Outliers>(text).unwrap().role().err().map(|(key, _)| key)
    }

    #[test]
    fn keys_of_the_other_method_are_refused() {
        for (text, key) in [
            ("", None),
            ("neighbors = 1\nmultiplier = 0", None),
            ("neighbors = 64\nmark = 18", None),
            ("radius = 1.0", Some("radius")),
            ("min_neighbors = 3", Some("min_neighbors")),
            ("method = 'radius'\nradius = 1\nmin_neighbors = 1", None),
            ("method = 'radius'\nradius = 1\nmin_neighbors = 1\nneighbors = 3", Some("neighbors")),
            (
                "method = 'radius'\nradius = 1\nmin_neighbors = 1\nmultiplier = 3",
                Some("multiplier"),
            ),
        ] {
            assert_eq!(blamed(text), key, "{text}");
        }
    }

    #[test]
    fn values_that_mean_nothing_are_refused() {
        for (text, key) in [
            ("neighbors = 0", "neighbors"),
            ("neighbors = 65", "neighbors"),
            ("multiplier = -1", "multiplier"),
            ("multiplier = nan", "multiplier"),
            ("multiplier = inf", "multiplier"),
            ("method = 'radius'", "method"),
            ("method = 'radius'\nradius = 1", "method"),
            ("method = 'radius'\nmin_neighbors = 1", "method"),
            ("method = 'radius'\nradius = 1\nmin_neighbors = 0", "min_neighbors"),
            ("method = 'radius'\nradius = 1\nmin_neighbors = 65", "min_neighbors"),
        ] {
            assert_eq!(blamed(text), Some(key), "{text}");
        }
        for radius in ["0", "-1", "nan", "'1 mile'"] {
            let wrong = format!("method = 'radius'\nradius = {radius}\nmin_neighbors = 1");
            let told = toml::from_str::<Outliers>(&wrong).unwrap_err().to_string();
            assert!(told.contains("a length above 0"), "{told}");
        }
        assert!(toml::from_str::<Outliers>("neighbours = 3").is_err());
        assert!(toml::from_str::<Outliers>("mark = 'deleted'").is_err());
    }

    #[test]
    fn the_report_names_the_defaults_of_the_method() {
        let keys = |text| serde_json::to_value(toml::from_str::<Outliers>(text).unwrap()).unwrap();
        let statistical = keys("");
        assert_eq!(
            (&statistical["neighbors"], &statistical["multiplier"]),
            (&10.into(), &2.0.into())
        );
        let radius = keys("method = 'radius'\nradius = 0.5\nmin_neighbors = 2");
        assert!(radius["neighbors"].is_null() && radius["multiplier"].is_null());
        assert_eq!((&radius["radius"], &radius["min_neighbors"]), (&0.5.into(), &2.into()));
    }
}
