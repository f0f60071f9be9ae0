//! Runs of the program on a machine that fails in chosen ways (`shim.c`), and what must hold after
//! each of them.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

use assert_cmd::Command;
use pointmill::report::result_bytes;

use crate::support::command::PROGRAM;

/// Numbers of errors of Linux, the same on the processors that the shim knows.
pub const EINTR: u32 = 4;
pub const EIO: u32 = 5;
pub const EACCES: u32 = 13;
pub const EMFILE: u32 = 24;
pub const ENOSPC: u32 = 28;
pub const ENOLCK: u32 = 37;

/// Every sort of data spills, and two outputs and a report are to appear together.
const JOB: &str = r#"
[run]
memory = "100MiB"
threads = 2
spill = "always"
report = "report.json"

[[stage]]
kind = "read"
path = "in.laz"

[[stage]]
kind = "outliers"

[[stage]]
kind = "normals"

[[stage]]
kind = "cells"
keep = "20%"

[[stage]]
kind = "write"
path = "mid.laz"

[[stage]]
kind = "median"

[[stage]]
kind = "write"
path = "out.laz"
"#;

const INPUTS: [&str; 2] = ["in.laz", "job.toml"];
const OUTPUTS: [&str; 3] = ["mid.laz", "out.laz", "report.json"];

/// What becomes of the chosen calls.
#[derive(Debug, Clone, Copy)]
pub enum Does {
    /// They fail with this number.
    Error(u32),
    /// The process is killed instead.
    Kill,
    /// They do half of what they were asked to.
    Short,
    /// A bit of what they bring is another.
    Flip,
    /// No space is left after as many bytes as [`When::Nth`] says.
    Full,
}

/// Which calls are chosen.
#[derive(Debug, Clone, Copy)]
pub enum When {
    /// None: they are only counted.
    Never,
    Nth(u64),
    Every(u64),
}

/// A way to fail.
#[derive(Debug, Clone, Copy)]
pub struct Fault {
    pub call: &'static str,
    /// Only on paths that contain this.
    pub path: Option<&'static str>,
    pub does: Does,
    pub when: When,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} {}: {:?} {:?}", self.call, self.path.unwrap_or(""), self.does, self.when)
    }
}

/// What a run came to.
pub struct Ran {
    /// None if it was killed.
    pub code: Option<i32>,
    pub told: String,
    pub calls: u64,
    pub changed: u64,
    pub written: u64,
}

/// A folder with a job, what the job gives where nothing fails, and the failing machine.
pub struct Bench {
    folder: tempfile::TempDir,
    counts: PathBuf,
    shim: PathBuf,
    reference: Vec<Vec<u8>>,
    /// What did not hold, one line each.
    pub broken: Vec<String>,
    pub faults: usize,
}

/// Compiles the shim, once a process: Rust links with `cc`, so it is there.
fn shim() -> PathBuf {
    static SHIM: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let made = SHIM.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("shim.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/shim.c");
        let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
        Command::new(compiler)
            .args(["-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o"])
            .args([&library, &source])
            .assert()
            .success();
        (folder, library)
    });
    made.1.clone()
}

impl Bench {
    pub fn new() -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let at = fs::canonicalize(folder.path()).unwrap();
        fs::create_dir(at.join("work")).unwrap();
        fs::write(at.join("work/job.toml"), JOB).unwrap();
        let counts = at.join("counts");
        let mut bench = Bench {
            folder,
            counts,
            shim: shim(),
            reference: Vec::new(),
            broken: Vec::new(),
            faults: 0,
        };
        bench.program("synth als -n 4000 -o in.laz").assert().success();
        bench.refresh();
        let ran = bench.run(None);
        assert_eq!(ran.code, Some(0), "{}", ran.told);
        bench.reference = OUTPUTS.iter().map(|name| bench.content(name)).collect();
        assert_eq!(bench.strays(), [""; 0]);
        bench
    }

    fn at(&self) -> PathBuf {
        fs::canonicalize(self.folder.path()).unwrap().join("work")
    }

    fn program(&self, arguments: &str) -> Command {
        let mut command = Command::new(PROGRAM);
        command.current_dir(self.at()).args(arguments.split_whitespace());
        command.timeout(Duration::from_secs(60));
        command
    }

    /// Old outputs, and nothing of earlier runs.
    fn refresh(&self) {
        for name in self.strays() {
            let path = self.at().join(name);
            if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.unwrap();
        }
        for name in OUTPUTS {
            fs::write(self.at().join(name), format!("old {name}")).unwrap();
        }
    }

    /// What is in the folder and should not be.
    fn strays(&self) -> Vec<String> {
        let entries = fs::read_dir(self.at()).unwrap().map(|entry| entry.unwrap().file_name());
        let names = entries.map(|name| name.into_string().unwrap());
        names.filter(|n| !INPUTS.contains(&n.as_str()) && !OUTPUTS.contains(&n.as_str())).collect()
    }

    /// The bytes of an output, of a report those that are a function of the points.
    fn content(&self, name: &str) -> Vec<u8> {
        let bytes = fs::read(self.at().join(name)).unwrap_or_default();
        match name.ends_with(".json") {
            true => result_bytes(&bytes).map(<[u8]>::to_vec).unwrap_or(bytes),
            false => bytes,
        }
    }

    /// Runs the job, with or without a fault.
    pub fn run(&self, fault: Option<&Fault>) -> Ran {
        fs::write(&self.counts, [0; 24]).unwrap();
        let mut command = self.program("run job.toml");
        if let Some(fault) = fault {
            let does = match fault.does {
                Does::Error(number) => number.to_string(),
                other => format!("{other:?}").to_lowercase(),
            };
            let (nth, every) = match fault.when {
                When::Never => (0, 0),
                When::Nth(n) => (n, 0),
                When::Every(n) => (0, n),
            };
            command.env("LD_PRELOAD", &self.shim).env("FAULT_FOLDER", self.at());
            command.env("FAULT_COUNTS", &self.counts).env("FAULT_CALL", fault.call);
            command.env("FAULT_DOES", does).env("FAULT_NTH", nth.to_string());
            command.env("FAULT_EVERY", every.to_string());
            command.envs(fault.path.map(|path| ("FAULT_PATH", path)));
        }
        let output = command.output().unwrap();
        let counts = fs::read(&self.counts).unwrap();
        let [calls, changed, written] =
            [0, 8, 16].map(|at| u64::from_le_bytes(counts[at..at + 8].try_into().unwrap()));
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        Ran { code: output.status.code(), told, calls, changed, written }
    }

    /// How often a sound run makes a call, and how many bytes it writes by it.
    pub fn count(&self, call: &'static str, path: Option<&'static str>) -> Ran {
        self.refresh();
        let ran = self.run(Some(&Fault { call, path, does: Does::Short, when: When::Never }));
        assert_eq!(ran.code, Some(0), "{}", ran.told);
        assert!(ran.calls > 0, "no {call} of {path:?} is made: the test would be empty");
        ran
    }

    /// Runs the job with a fault from old outputs; notes what does not hold whatever fails: outputs
    /// are old or complete, and the next run gives the right ones and leaves nothing behind. Gives
    /// the run and the outputs that are new.
    pub fn suffer(&mut self, fault: &Fault) -> (Ran, Vec<&'static str>) {
        self.refresh();
        let ran = self.run(Some(fault));
        if ran.changed == 0 {
            self.note(fault, &ran, "no call was changed");
        }
        self.faults += 1;
        let mut new = Vec::new();
        for (name, reference) in OUTPUTS.into_iter().zip(self.reference.clone()) {
            match self.content(name) {
                bytes if bytes == reference => new.push(name),
                bytes if bytes == format!("old {name}").as_bytes() => {}
                _ => self.note(fault, &ran, &format!("{name} is neither old nor complete")),
            }
        }
        if ran.code.is_some() {
            // What cannot be removed is said.
            for name in self.strays().into_iter().filter(|name| !ran.told.contains(name)) {
                self.note(fault, &ran, &format!("{name} stays and nobody says so"));
            }
        }
        let again = self.run(None);
        let complete =
            OUTPUTS.iter().zip(&self.reference).all(|(name, r)| self.content(name) == *r);
        if again.code != Some(0) || !complete {
            self.note(fault, &again, "the next run does not give the right outputs");
        }
        if !self.strays().is_empty() {
            self.note(fault, &again, &format!("the next run leaves {:?}", self.strays()));
        }
        (ran, new)
    }

    pub fn note(&mut self, fault: &Fault, ran: &Ran, what: &str) {
        let told = ran.told.trim().replace('\n', " | ");
        self.broken.push(format!("{fault}: {what}; exit {:?}: {told}", ran.code));
    }

    /// Ends a test: nothing was noted, and faults were not few.
    pub fn hold(self, fewest: usize) {
        println!("{} faults", self.faults);
        assert!(self.broken.is_empty(), "{:#?}\nof {} faults", self.broken, self.faults);
        assert!(self.faults >= fewest, "only {} faults", self.faults);
    }

    /// A run that must fail: exit code 1 with a message that is none of our own mistakes, and the
    /// outputs that it replaced all the same are named.
    pub fn fails(&mut self, fault: &Fault) {
        let (ran, new) = self.suffer(fault);
        if ran.code != Some(1) {
            self.note(fault, &ran, "the run does not fail with 1");
        }
        self.speaks(fault, &ran);
        for name in new.into_iter().filter(|name| !ran.told.contains(name)) {
            self.note(fault, &ran, &format!("{name} was replaced and is not named"));
        }
    }

    /// A message is there, and none of our own mistakes.
    pub fn speaks(&mut self, fault: &Fault, ran: &Ran) {
        let told = ran.told.to_lowercase();
        if told.trim().is_empty() || told.contains("panicked") || told.contains("internal") {
            self.note(fault, ran, "the message is none for a user");
        }
    }

    /// A run that must not notice.
    pub fn endures(&mut self, fault: &Fault) {
        let (ran, new) = self.suffer(fault);
        if ran.code != Some(0) || new.len() != OUTPUTS.len() {
            self.note(fault, &ran, "the run does not succeed");
        }
    }

    /// A run that may fail, but does not succeed with wrong or old outputs.
    pub fn never_lies(&mut self, fault: &Fault) {
        let (ran, new) = self.suffer(fault);
        match ran.code {
            Some(0) if new.len() == OUTPUTS.len() => {}
            Some(1) => self.speaks(fault, &ran),
            _ => self.note(fault, &ran, "it says that it succeeded, or ends otherwise"),
        }
    }
}

/// At most `most` of the numbers 1 to `calls`, evenly spread, the first and the last among them; all
/// if the environment asks for all faults.
pub fn spread(calls: u64, most: u64) -> Vec<u64> {
    let all = std::env::var("POINTMILL_FAULTS").is_ok_and(|which| which == "all");
    if all || calls <= most {
        return (1..=calls).collect();
    }
    (0..most).map(|i| 1 + i * (calls - 1) / (most - 1)).collect()
}
