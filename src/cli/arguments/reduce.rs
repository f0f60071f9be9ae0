//! The arguments of `reduce`.

use clap::Args;

use super::shared::{CommonArguments, FilterArguments, ReadArguments, WrittenArguments};
use crate::cli::classes::{Classes, parse_classes};
use crate::cli::preset::Preset;
use crate::graph::parse_bytes;

/// Arguments of `reduce` that are about cells of agreeing normals.
const OF_CELLS: [&str; 13] = [
    "preset",
    "max_angle",
    "neighbors",
    "side",
    "min_points",
    "max_side",
    "min_spacing",
    "measure",
    "reference",
    "split",
    "method",
    "passes",
    "mark",
];

impl ReduceArguments {
    /// True if the published method is asked for: by a preset, or an option that is about cells.
    pub fn by_cells(&self) -> bool {
        let options = [
            &self.max_angle,
            &self.neighbors,
            &self.side,
            &self.min_points,
            &self.max_side,
            &self.min_spacing,
            &self.measure,
            &self.reference,
            &self.split,
            &self.method,
            &self.passes,
            &self.mark,
        ];
        self.preset.is_some() || options.into_iter().any(Option::is_some)
    }
}

#[derive(Debug, Clone, Args)]
pub(crate) struct ReduceArguments {
    /// Files of points, patterns or folders, or @LIST: a text with one of them a line; or - for
    /// standard input
    #[arg(value_name = "IN", required = true)]
    pub inputs: Vec<String>,
    /// The reduced file: .las, .laz or .ply; or - for standard output, with --to
    #[arg(short, long, value_name = "OUT", required_unless_present_any = ["outdir", "preview"])]
    pub output: Option<String>,
    /// One reduced file for each input instead, in this folder, under the input's name and header;
    /// neighbours are found across the inputs
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    pub outdir: Option<String>,
    /// Format, such as laz, ply or csv [default: by extension; in a folder, that of each input]
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    /// Settings of the published method of cells for a kind of scan, or as it is printed (paper);
    /// other options take the place of a preset's
    #[arg(long, value_name = "KIND")]
    pub preset: Option<Preset>,
    /// How many points are to stay: 10%, 250k or 1e6. They are those that say most of the surface;
    /// with a preset or an option of cells, those that the published method keeps [default: auto,
    /// as many as the shape asks for: twice as many would hardly lower the error; with cells, as
    /// the noise does]
    #[arg(long, value_name = "TARGET", conflicts_with = "max_angle")]
    pub keep: Option<String>,
    /// How many bytes the output is to take, within 2 %: 200MB. As many points stay as that allows;
    /// packed ones differ in size, so a run is repeated until it comes out
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    #[arg(conflicts_with_all = OF_CELLS, conflicts_with_all = ["keep", "tolerance", "preview"])]
    pub size: Option<u64>,
    /// How far from the surface of the points that stay no removed point may be: in the scan's
    /// unit, or as 5mm. Together with a number, whichever needs fewer points
    #[arg(long, value_name = "LENGTH", conflicts_with_all = OF_CELLS)]
    pub tolerance: Option<String>,
    /// How far from the nearest point that stays no removed point may be: in the scan's unit, as
    /// 50cm
    #[arg(long, value_name = "LENGTH", conflicts_with_all = OF_CELLS)]
    pub max_spacing: Option<String>,
    /// What the errors of points count: a number by conditions, such as "Classification == 6 ? 3 :
    /// 1"
    #[arg(long, value_name = "CHOICE", conflicts_with_all = OF_CELLS)]
    pub weight: Option<String>,
    /// Keep the borders of the scan, where points would otherwise be left that lie beyond all that
    /// stay
    #[arg(long, conflicts_with_all = OF_CELLS)]
    pub borders: bool,
    /// Write KeepRank, by which any coarser reduction can be cut off; with a tolerance it is
    /// written anyway, since it tells exceptions from the surface
    #[arg(long, conflicts_with_all = OF_CELLS)]
    pub ranks: bool,
    /// Write nothing: show how many points, which errors and how much time several numbers and
    /// tolerances would come to, by a trial on a part of the scan
    #[arg(long)]
    pub preview: bool,
    /// How much is computed: normal, or low, in a quarter of the time and with larger errors
    /// [default: normal]
    #[arg(long, value_name = "HOW", conflicts_with_all = OF_CELLS)]
    pub effort: Option<String>,
    /// Instead of a number of points: the largest range of normal angles in a cell, in radians, as
    /// 6deg, or auto, by the noise
    #[arg(long, value_name = "ANGLE")]
    pub max_angle: Option<String>,
    /// Nearest other positions that a normal is computed from; auto takes 10 or, where there is
    /// noise, 20 [default: auto]
    #[arg(long, value_name = "K")]
    pub neighbors: Option<String>,
    /// Side of the cells before any split: a length, auto, or spread evenly [default: spread]
    #[arg(long, value_name = "SIDE")]
    pub side: Option<String>,
    /// A cell with this many points or fewer is not split [default: 1]
    #[arg(long, value_name = "N")]
    pub min_points: Option<String>,
    /// Largest side of a cell that is kept whole: in the scan's unit, as 2m, or none [default:
    /// none]
    #[arg(long, value_name = "LENGTH")]
    pub max_side: Option<String>,
    /// No cell of this length or less is split: in the scan's unit, as 5cm, auto or none [default:
    /// auto]
    #[arg(long, value_name = "LENGTH")]
    pub min_spacing: Option<String>,
    /// What the angles of a cell are measured to: axis, one direction for all, or cone, the cell's
    /// own [default: cone]
    #[arg(long, value_name = "HOW")]
    pub measure: Option<String>,
    /// The direction of `--measure axis`: x, y, z or a vector such as 0,0,1 [default: x]
    #[arg(long, value_name = "AXIS")]
    pub reference: Option<String>,
    /// How a cell is split: voronoi, dirichlet or octant [default: voronoi]
    #[arg(long, value_name = "HOW")]
    pub split: Option<String>,
    /// How a normal is computed: varady, delaunay, pca, quadric or cubic [default: varady]
    #[arg(long, value_name = "HOW")]
    pub method: Option<String>,
    /// Remove points that are far from all others before anything else, as a stage `outliers` does
    #[arg(long)]
    pub outliers: bool,
    /// Reduce what is left again, until it was reduced this often [default: 1]
    #[arg(long, value_name = "N")]
    pub passes: Option<String>,
    /// Mark the decision in the records and write them all: key-point, withheld, or class 7 or 18
    #[arg(long, value_name = "HOW")]
    pub mark: Option<String>,
    /// Order of the records: canonical, a function of the points alone, or input, that of the
    /// inputs [default: canonical]
    #[arg(long, value_name = "HOW", conflicts_with = "outdir")]
    pub order: Option<String>,
    /// Reduce the points of these classes alone, such as 2,6; all others stay, and are not seen as
    /// neighbours
    #[arg(long, value_name = "CLASSES", value_delimiter = ',', value_parser = parse_classes)]
    pub classes: Vec<Classes>,
    /// Points of classes 7 and 18, which are noise: drop them, keep them as points like all others,
    /// or ignore them and write them as they are [default: drop; ignore with --mark; keep where
    /// --classes or --keep-classes names one of them]
    #[arg(long, value_name = "HOW")]
    pub noise: Option<String>,
    #[command(flatten)]
    pub filter: FilterArguments,
    /// Points with the withheld flag: drop them, keep them as points like all others, or ignore
    /// them and write them as they are [default: drop]
    #[arg(long, value_name = "HOW")]
    pub withheld: Option<String>,
    /// Points whose coordinates are not finite: refuse the scan, or drop them [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub nonfinite: Option<String>,
    /// Length of a step of the lattice on which points are compared, in the scan's unit, for scans
    /// far from their origin or finer than it. Sides that are chosen follow from it, and with them
    /// how many points stay [default: what the coordinates are stored in, for floats 2^-30]
    #[arg(long, value_name = "NUMBER")]
    pub lattice: Option<String>,
    /// Scans whose points contradict their LAS header, as damaged ones do: refuse them, or warn
    /// [default: refuse]
    #[arg(long, value_name = "HOW")]
    pub headers: Option<String>,
    /// What z is multiplied by where distances are measured, or auto: by what the units of the
    /// reference system say; the records keep their z [default: 1, and scans of mixed units are
    /// refused]
    #[arg(long, value_name = "FACTOR")]
    pub z_scale: Option<String>,
    #[command(flatten)]
    pub read: ReadArguments,
    #[command(flatten)]
    pub written: WrittenArguments,
    #[command(flatten)]
    pub common: CommonArguments,
}
