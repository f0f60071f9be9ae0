//! What tests of whole runs share: a folder with an input, its pipeline, and what came out.

use std::fs;
use std::path::PathBuf;

use pointmill::Result;
use pointmill::{Done, Graph, Overrides, Quiet, Registry, Watch};
use serde_json::Value;

/// The three stages of a reduction, as they come.
pub const REDUCE: &str =
    "[[stage]]\nkind = 'normals'\n[[stage]]\nkind = 'cells'\n[[stage]]\nkind = 'median'\n";

/// A folder with a pipeline that reads `in.ply` or another source and writes `out.ply`.
pub struct Case {
    pub at: tempfile::TempDir,
}

impl Case {
    pub fn new() -> Self {
        Case { at: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.at.path().join(name)
    }

    /// Writes `in.ply`: positions and a number each.
    pub fn ply(&self, points: &[([f64; 3], u32)]) {
        let mut bytes = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty \
             double y\nproperty double z\nproperty uint tag\nend_header\n",
            points.len()
        )
        .into_bytes();
        for (p, tag) in points {
            p.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
            bytes.extend(tag.to_le_bytes());
        }
        fs::write(self.path("in.ply"), bytes).unwrap();
    }

    /// The records of `out.ply`.
    pub fn written(&self) -> Vec<([f64; 3], u32)> {
        let bytes = fs::read(self.path("out.ply")).unwrap();
        let head = b"end_header\n";
        let body = bytes.windows(head.len()).position(|w| w == head).unwrap() + head.len();
        let float = |at: &[u8]| f64::from_le_bytes(at.try_into().unwrap());
        let record = |r: &[u8]| {
            let p = [float(&r[..8]), float(&r[8..16]), float(&r[16..24])];
            (p, u32::from_le_bytes(r[24..].try_into().unwrap()))
        };
        bytes[body..].chunks_exact(28).map(record).collect()
    }

    /// Reads `in.ply`, does `stages`, writes `out.ply` and `report.json`.
    pub fn text(&self, run: &str, stages: &str, write: &str) -> String {
        let read =
            format!("[[stage]]\nkind = 'read'\npath = '{}'\n", self.path("in.ply").display());
        let write = format!(
            "[[stage]]\nkind = 'write'\npath = '{}'\n{write}\n",
            self.path("out.ply").display()
        );
        let report = self.path("report.json");
        format!("[run]\nreport = '{}'\n{run}\n{read}{stages}{write}", report.display())
    }

    pub fn run(&self, run: &str, stages: &str, write: &str) -> Result<Done> {
        execute(&self.text(run, stages, write), &Overrides::default(), &Quiet)
    }

    pub fn report(&self) -> Value {
        serde_json::from_slice(&fs::read(self.path("report.json")).unwrap()).unwrap()
    }

    pub fn left(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.at.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

/// Plans and runs a pipeline of the stages that pointmill has.
pub fn execute(text: &str, overrides: &Overrides, watch: &dyn Watch) -> Result<Done> {
    execute_with(&Registry::builtin(), text, overrides, watch)
}

/// The same with stages of one's own.
pub fn execute_with(
    registry: &Registry,
    text: &str,
    overrides: &Overrides,
    watch: &dyn Watch,
) -> Result<Done> {
    Graph::parse(text, "test.toml", registry)?.plan(overrides)?.run(watch)
}
