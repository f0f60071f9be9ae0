//! Runs in this process with what must not matter set in any way, and what they say of themselves.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pointmill::internals::Simd;
use pointmill::report::{Report, result_bytes};
use pointmill::{Error, ErrorKind, Overrides, Quiet, Result};

use super::case::execute;

/// How much memory a run is given.
#[derive(Debug, Clone, Copy)]
pub enum Memory {
    /// What the refusal of less names, and so many mebibytes more.
    Least(u64),
    /// One gibibyte beyond that.
    Ample,
}

/// The `[run]` settings that must not matter.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    pub tile_points: Option<usize>,
    pub memory: Memory,
    pub threads: usize,
    pub spill: &'static str,
    pub simd: &'static str,
}

/// What `simd` under `[run]` can be on this processor.
pub fn instruction_sets() -> Vec<&'static str> {
    Simd::all().map(|simd| simd.level().name()).collect()
}

impl Settings {
    /// Everything in memory, by one thread, in as few tiles as can be.
    pub const PLAIN: Settings = Settings {
        tile_points: None,
        memory: Memory::Ample,
        threads: 1,
        spill: "auto",
        simd: "auto",
    };

    /// Outputs do not say how they were made: of which files matters here, too.
    fn text(&self, memory: u64, report: &Path) -> String {
        let Settings { threads, spill, simd, .. } = self;
        let tile_points =
            self.tile_points.map_or(String::new(), |points| format!("tile_points = {points}\n"));
        format!(
            "[run]\nprovenance = false\nmemory = {memory}\nthreads = {threads}\nspill = {spill:?}\nsimd = {simd:?}\n\
             report = {report:?}\n{tile_points}"
        )
    }
}

/// What a run left.
pub struct Ran {
    pub output: PathBuf,
    /// The bytes of the report's `result`.
    pub result: Vec<u8>,
    /// Counts of how the work was cut up.
    pub work: BTreeMap<String, u64>,
    pub spilled: u64,
    /// The whole report, but for its tiles.
    pub report: Report,
}

impl Ran {
    pub fn count(&self, what: &str) -> u64 {
        self.work.get(what).copied().unwrap_or(0)
    }

    pub fn bytes(&self) -> Vec<u8> {
        std::fs::read(&self.output).unwrap()
    }
}

/// Runs `read` of `inputs`, then `stages`, then `write` of a file in `folder` with the extension
/// and keys of `write` (as in `"laz"` or `"ply\nencoding = \"ascii\""`).
pub fn run(
    folder: &Path,
    inputs: &[PathBuf],
    stages: &str,
    write: &str,
    settings: Settings,
) -> Result<Ran> {
    run_with(folder, inputs, stages, write, settings, "")
}

/// The same with more keys under `[run]`; `{folder}` in `stages` becomes the folder.
pub fn run_with(
    folder: &Path,
    inputs: &[PathBuf],
    stages: &str,
    write: &str,
    settings: Settings,
    keys_of_run: &str,
) -> Result<Ran> {
    let stages = stages.replace("{folder}", folder.to_str().unwrap());
    let (extension, keys) = write.split_once('\n').unwrap_or((write, ""));
    let output = folder.join(format!("out.{extension}"));
    let report = folder.join("report.json");
    let text = |memory| {
        format!(
            "{}\n{keys_of_run}\n[[stage]]\nkind = \"read\"\npath = {inputs:?}\n{stages}\n\
             [[stage]]\nkind = \"write\"\npath = {output:?}\n{keys}\n",
            settings.text(memory, &report)
        )
    };
    let go = |memory| execute(&text(memory), &Overrides::default(), &Quiet);
    let more = match settings.memory {
        Memory::Least(more) => more << 20,
        Memory::Ample => 1 << 30,
    };
    // What this process holds already counts against the budget, and other tests change it.
    let mut memory = 1 << 20;
    let done = loop {
        match go(memory) {
            Err(error) if error.kind() == ErrorKind::Memory => {
                let least = remedy(&error);
                assert!(least + more > memory, "{error:?} does not do");
                memory = least + more;
            }
            done => break done?,
        }
    };
    let report = std::fs::read(&report).unwrap();
    Ok(Ran {
        output,
        result: result_bytes(&report).unwrap().to_vec(),
        work: done.report.run.work.clone(),
        spilled: done.report.run.spill_bytes,
        report: done.report,
    })
}

/// The budget in bytes that a refusal names.
pub fn remedy(error: &Error) -> u64 {
    let help = error.remedy().unwrap_or_else(|| panic!("{error:?} names no remedy"));
    let digits = help.find(|c: char| c.is_ascii_digit()).unwrap();
    let (number, rest) =
        help[digits..].split_at(help[digits..].find(|c: char| !c.is_ascii_digit()).unwrap());
    assert!(rest.starts_with("MiB"), "{help}");
    number.parse::<u64>().unwrap() << 20
}

/// A scan beside its reduction must have had this, or a test of it may pass empty.
pub fn assert_not_empty(ran: &Ran, cells_cross: bool, what: &str) {
    assert!(ran.count("tiles") >= 30, "{what}: {} tiles", ran.count("tiles"));
    assert!(ran.count("tile_levels") >= 2, "{what}: {} levels", ran.count("tile_levels"));
    assert!(ran.count("rim_positions") > 0, "{what}: no rim");
    assert!(ran.count("unproven") > 0, "{what}: nobody unproven");
    assert!(ran.count("tied") > 0, "{what}: no ties");
    assert!(ran.count("runs") > 1, "{what}: {} runs", ran.count("runs"));
    assert!(ran.spilled > 0, "{what}: nothing spilled");
    assert!(!cells_cross || ran.count("crossing_cells") > 0, "{what}: no cell crosses a face");
}
