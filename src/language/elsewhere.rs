//! Stages as other programs name them, and what pointmill leaves to others: what to write instead.

use super::node::{Node, NodeValue};
use crate::error::nearest;

/// Names of stages of other programs, without a prefix such as `filters.`, and what does the same
/// here.
const ELSEWHERE: [(&[&str], &str); 17] = [
    (&["load", "reader", "open"], "`read` with the `path`"),
    (&["range", "expression", "mongo", "keep_class"], "`filter` with `where`"),
    (&["delete", "drop_points"], "`drop` with `where`, `classes`, `with` or `without`"),
    (&["assign", "ferry", "set_attribute"], "`assign` with `set`"),
    (
        &["voxelgrid", "voxelcenternearestneighbor", "voxelcentroidnearestneighbor", "voxel"],
        "`grid` with `side`",
    ),
    (&["voxeldownsize", "subsample", "thin"], "`grid` with `side`, or `sample` with `distance`"),
    (&["poisson", "spatial"], "`sample` with `distance`"),
    (&["decimation", "randomize", "random"], "`sample` with `every` or `fraction`"),
    (&["outlier", "noise", "sor", "classify_with_sor", "denoise"], "`outliers`"),
    (&["normal", "compute_normals"], "`normals`"),
    (&["clip", "geofence", "polygon"], "`crop` with `polygon`"),
    (&["transformation", "translate", "rotate", "scale", "apply_transform"], "`transform`"),
    (&["splitter", "chipper", "tile", "tiles", "divider"], "`write` with `side` and `{x}_{y}`"),
    (&["summarise", "statistics", "statistical"], "`stats`"),
    (&["reduction", "reduce"], "`normals`, `cells` and `median`, one after the other"),
    (&["concatenate", "append"], "`merge`, or several paths in `read`"),
    (&["progress"], "`tap`"),
];

/// What pointmill does not do, by the names of stages that do; and which program does.
const OTHERS: [(&[&str], &str, &str); 2] = [
    (
        &["smrf", "csf", "pmf", "ground", "classify_with_csf", "classify_ground"],
        "classify ground",
        "`pdal translate scan.laz ground.laz smrf` does; then read that, and \
         `where = \"Classification == 2\"` is its ground",
    ),
    (
        &["hag_nn", "hag_delaunay", "hag_dem", "hag", "normalize"],
        "compute heights above ground",
        "`pdal translate scan.laz heights.laz hag_delaunay \
         --writers.las.extra_dims=HeightAboveGround=float32` does; then read that",
    ),
];

/// Names of stages that change the reference system.
const REPROJECT: [&str; 5] = ["reproject", "reprojection", "transform_crs", "warp", "cs2cs"];
/// Keys that such stages have for the system that they lead to.
const TO: [&str; 7] = ["to", "out_srs", "crs", "target", "epsg", "srs", "path"];

/// What there is to say of a stage of the unknown `kind`, if another program has it: what is wrong,
/// and what to do.
pub(super) fn told(kind: &str, keys: &Node) -> Option<(String, String)> {
    let lower = kind.to_ascii_lowercase();
    let name = lower.rsplit('.').next().unwrap_or(&lower).replace('-', "_");
    let name = name.as_str();
    if REPROJECT.contains(&name) {
        let to = target(keys).unwrap_or_else(|| "EPSG:25832".to_owned());
        return Some(is_here(kind, &format!("the key `reproject = \"{to}\"` of `read`")));
    }
    if let Some((_, what, help)) = OTHERS.iter().find(|(names, ..)| names.contains(&name)) {
        let told = format!("there is no stage `{kind}`: pointmill does not {what}");
        return Some((told, (*help).to_owned()));
    }
    if lower == "writers.null" {
        return Some(is_here(kind, "`discard`"));
    }
    if let Some((ends @ ("readers" | "writers"), format)) = lower.split_once('.') {
        let both = ["las", "copc", "ply", "pcd", "e57", "text"];
        let read = ["pts", "ptx", "obj"];
        match ends {
            "readers" if both.contains(&format) || read.contains(&format) => {
                return Some(is_here(kind, "`read` with the `path`"));
            }
            "writers" if both.contains(&format) => {
                return Some(is_here(kind, "`write` with the `path`"));
            }
            _ => {}
        }
        let does = if ends == "readers" { "read" } else { "write" };
        let told = format!("there is no stage `{kind}`: pointmill does not {does} {format} files");
        return Some((
            told,
            "it reads and writes LAS, LAZ, COPC, PLY, PCD, E57 and texts".to_owned(),
        ));
    }
    let (_, here) = ELSEWHERE.iter().find(|(names, _)| names.contains(&name))?;
    // What is mistyped by a letter is told as such.
    let own: Vec<String> = here.split('`').skip(1).step_by(2).map(str::to_owned).collect();
    let is_mistyped = name == lower && nearest(name, &own).is_some();
    (!is_mistyped).then(|| is_here(kind, here))
}

/// What is said of a stage that is here under another name.
fn is_here(kind: &str, here: &str) -> (String, String) {
    (format!("there is no stage `{kind}`"), format!("what it does elsewhere is here {here}"))
}

/// The reference system that the keys of a stage name.
fn target(keys: &Node) -> Option<String> {
    let NodeValue::Table(entries) = &keys.value else { return None };
    let entry = entries.iter().find(|entry| TO.contains(&entry.key.as_str()))?;
    match &entry.node.value {
        NodeValue::Text(text) if is_plain(text) => Some(text.clone()),
        _ => None,
    }
}

/// True if a text can stand in a command as it is.
fn is_plain(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|c| c.is_ascii_alphanumeric() || b":+_.-".contains(&c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::Registry;
    use crate::{Graph, Overrides};

    fn told(stage: &str) -> String {
        let text = format!("stage = [{{kind = 'read', path = 'a.las'}}, {{{stage}}}]");
        match Graph::parse(&text, "p.toml", &Registry::builtin()) {
            Ok(graph) => graph.plan(&Overrides::default()).err().unwrap().to_string(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn what_other_programs_call_a_stage_is_known_where_pointmill_has_none_of_that_name() {
        let registry = Registry::builtin();
        let all = ELSEWHERE.iter().map(|(names, _)| *names);
        let names: Vec<&str> = all
            .chain(OTHERS.iter().map(|(names, ..)| *names))
            .flatten()
            .chain(&REPROJECT)
            .filter(|name| **name != "assign")
            .copied()
            .collect();
        for name in &names {
            assert!(!registry.has(name), "{name}");
            assert_eq!(names.iter().filter(|other| *other == name).count(), 1, "{name} twice");
        }
        let text = told("kind = 'filters.assign', assignment = 'Classification[:]=0'");
        assert!(text.contains("is here `assign` with `set`"), "{text}");
        let text = told("kind = 'filters.voxeldownsize', cell = 1.0");
        assert!(text.contains("there is no stage `filters.voxeldownsize`"), "{text}");
        assert!(text.contains("is here `grid` with `side`"), "{text}");
        let text = told("kind = 'filters.smrf'");
        assert!(text.contains("pdal translate scan.laz ground.laz smrf"), "{text}");
        let text = told("kind = 'readers.las', filename = 'a.las'");
        assert!(text.contains("is here `read` with the `path`"), "{text}");
        for kind in ["readers.copc", "readers.e57", "readers.ptx", "writers.copc", "writers.text"] {
            let text = told(&format!("kind = '{kind}', filename = 'a'"));
            assert!(text.contains("with the `path`"), "{text}");
        }
        assert!(told("kind = 'writers.ptx'").contains("does not write ptx files"));
        let text = told("kind = 'writers.gdal', filename = 'a.tif'");
        assert!(text.contains("pointmill does not write gdal files"), "{text}");
        assert!(told("kind = 'writers.null'").contains("is here `discard`"));
        // Keys, too.
        let text = told("kind = 'grid', cell = 1");
        assert!(text.contains("did you mean `side`?"), "{text}");
        // A name that nobody has, or that is ours but for a letter, gets the nearest.
        assert!(told("kind = 'normal'").contains("did you mean `normals`"));
        assert!(told("kind = 'gird', side = 1").contains("did you mean `grid`"));
    }

    #[test]
    fn who_asks_to_reproject_is_told_the_key_that_does_it() {
        let text = told("kind = 'filters.reprojection', out_srs = 'EPSG:4326'");
        assert!(text.contains("is here the key `reproject = \"EPSG:4326\"` of `read`"), "{text}");
        // What could not stand in a pipeline is not put there.
        let text = told("kind = 'reproject', to = 'a; rm -r b'");
        assert!(text.contains("`reproject = \"EPSG:25832\"`"), "{text}");
    }
}
