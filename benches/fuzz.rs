//! Fuzzing for hours: `cargo bench --bench fuzz`. CONTRIBUTING.md tells how.
//!
//! Targets take turns in a process of their own, which this one watches: an input that ends the
//! process, or on which it hangs, is a finding as any other, and the rest of the time goes on with
//! another seed.

#![allow(clippy::print_stdout, reason = "a program for the terminal")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a harness may panic: not on inputs")]

#[path = "../tests/fuzzing/mod.rs"]
mod fuzzing;
#[path = "../tests/support/mod.rs"]
mod support;

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};
use std::{env, fs, thread};

use fuzzing::campaign::Campaign;
use fuzzing::judge::shape;
use fuzzing::{TARGETS, Target};

#[global_allocator]
static COUNTED: support::allocator::Counted = support::allocator::Counted;

/// Time that one input may take.
const MOST_TIME: Duration = Duration::from_secs(2);
/// Time after which the process hangs.
const HANGS: Duration = Duration::from_secs(120);
/// Turn of one target.
const TURN: Duration = Duration::from_secs(60);

/// What the environment asks for.
struct Wanted {
    seconds: u64,
    seed: u64,
    findings: PathBuf,
    targets: Vec<Target>,
}

impl Wanted {
    fn read() -> Self {
        let number = |name: &str, default| match env::var(name) {
            Ok(text) => text.parse().unwrap_or_else(|_| panic!("{name} is a whole number")),
            Err(_) => default,
        };
        let named = env::var("POINTMILL_FUZZ_TARGETS").unwrap_or_default();
        let wanted = |t: &Target| named.is_empty() || named.split(',').any(|name| name == t.name);
        let targets: Vec<Target> = TARGETS.into_iter().filter(wanted).collect();
        assert!(!targets.is_empty(), "POINTMILL_FUZZ_TARGETS names none of the targets");
        let findings = env::var_os("POINTMILL_FUZZ_FINDINGS").map(PathBuf::from);
        Wanted {
            seconds: number("POINTMILL_FUZZ_SECONDS", 60),
            seed: number("POINTMILL_FUZZ_SEED", 1),
            findings: findings.unwrap_or_else(|| "target/fuzz-findings".into()),
            targets,
        }
    }
}

fn main() {
    let wanted = Wanted::read();
    fs::create_dir_all(&wanted.findings).expect("a folder for findings");
    match env::var_os("POINTMILL_FUZZ_WORK") {
        Some(_) => fuzz(&wanted),
        None => watch(&wanted),
    }
}

/// Starts processes that fuzz, until the time is over; keeps what ended one of them.
fn watch(wanted: &Wanted) {
    let findings = fs::canonicalize(&wanted.findings).expect("the folder of findings");
    let start = Instant::now();
    for round in 0.. {
        let left = wanted.seconds.saturating_sub(start.elapsed().as_secs());
        if left == 0 {
            break;
        }
        let shared = Path::new("/dev/shm");
        let folder = if shared.is_dir() { shared.to_owned() } else { env::temp_dir() };
        let work = tempfile::tempdir_in(folder).expect("a folder to work in");
        let child = Command::new(env::current_exe().expect("this program"))
            .env("POINTMILL_FUZZ_WORK", work.path())
            .env("POINTMILL_FUZZ_SECONDS", left.to_string())
            .env("POINTMILL_FUZZ_SEED", (wanted.seed + round).to_string())
            .env("POINTMILL_FUZZ_FINDINGS", &findings)
            .spawn()
            .expect("a process that fuzzes");
        if let Some(how) = ended(child, work.path()) {
            keep_last(work.path(), &findings, &how);
        }
    }
    println!("{} s are over; findings are in {}", wanted.seconds, findings.display());
}

/// How the process ended, if not as it should.
fn ended(mut child: Child, work: &Path) -> Option<String> {
    loop {
        thread::sleep(Duration::from_millis(300));
        if let Some(status) = child.try_wait().expect("a process to wait for") {
            return (!status.success()).then(|| format!("it ends the process: {status}"));
        }
        let last = latest(work).and_then(|file| fs::metadata(file).ok()?.modified().ok());
        if last.and_then(|at| at.elapsed().ok()).is_some_and(|age| age > HANGS) {
            child.kill().and_then(|()| child.wait()).expect("a process that ends");
            return Some("it hangs".to_owned());
        }
    }
}

/// The input that was written last, in the folder of its target.
fn latest(work: &Path) -> Option<PathBuf> {
    let inputs =
        fs::read_dir(work).ok()?.filter_map(|entry| Some(entry.ok()?.path().join("input")));
    inputs.max_by_key(|file| fs::metadata(file).and_then(|m| m.modified()).ok())
}

fn keep_last(work: &Path, findings: &Path, how: &str) {
    let Some(input) = latest(work).and_then(|file| fs::read(file).ok()) else { return };
    let target = fs::read_to_string(work.join("target")).unwrap_or_default();
    // What ends a process has no shape: the input itself is its name.
    keep(findings, &target, &hash(&input), &input, how);
}

fn hash(of: impl Hash) -> String {
    let mut hasher = DefaultHasher::new();
    of.hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

/// Writes a finding and why it is one; a finding of that name stays.
fn keep(findings: &Path, target: &str, name: &str, input: &[u8], promise: &str) {
    let file = findings.join(format!("{target}-{name}"));
    if file.exists() {
        return;
    }
    println!("FINDING {}: {promise}", file.display());
    fs::write(&file, input).expect("a place for the finding");
    fs::write(file.with_extension("txt"), promise).expect("a place for its cause");
}

/// Fuzzes all targets in turn.
fn fuzz(wanted: &Wanted) {
    let start = Instant::now();
    let work = PathBuf::from(env::var_os("POINTMILL_FUZZ_WORK").expect("a folder to work in"));
    let time = Duration::from_secs(wanted.seconds);
    let turn = TURN.min(time / wanted.targets.len() as u32);
    let mut told: BTreeSet<String> = BTreeSet::new();
    let mut all: Vec<Option<Campaign>> = wanted.targets.iter().map(|_| None).collect();
    let mut executions = vec![0u64; all.len()];
    while start.elapsed() < time {
        for (i, target) in wanted.targets.iter().enumerate() {
            fs::write(work.join("target"), target.name).expect("a place for the target's name");
            let begin = || Campaign::new(*target, MOST_TIME, wanted.seed, Vec::new());
            let mut campaign = all[i].take().unwrap_or_else(begin);
            let before = campaign.executions;
            campaign.run_for(turn.min(time.saturating_sub(start.elapsed())));
            executions[i] += campaign.executions - before;
            for (key, finding) in &campaign.findings {
                if told.insert(format!("{} {key}", target.name)) {
                    let (input, promise) = (&finding.input, &finding.promise);
                    keep(&wanted.findings, target.name, &hash(shape(promise)), input, promise);
                }
            }
            println!(
                "{:>6} s  {:<9} {:>10} inputs, {:>9} accepted, {:>5} outcomes, {:>4} kept, {} findings",
                start.elapsed().as_secs(),
                target.name,
                executions[i],
                campaign.accepted,
                campaign.outcomes().len(),
                campaign.kept(),
                campaign.findings.len(),
            );
            all[i] = Some(campaign);
        }
    }
}
