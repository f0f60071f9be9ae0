//! Takes one input at a time to a target: panics, time and memory are promises too.

use std::cell::RefCell;
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};
use std::time::{Duration, Instant};

use super::Target;
use super::judge::Judgement;
use crate::support::allocator;

/// Bytes that any input may cost, and bytes for each of its own.
const FREE_BYTES: usize = 64 << 20;
const BYTES_A_BYTE: usize = 64;

/// Targets whose files are relative to the working directory take turns.
static HOME: Mutex<()> = Mutex::new(());

/// A target, a folder for its files, and how long it may take.
pub struct Harness {
    target: Target,
    folder: tempfile::TempDir,
    input: PathBuf,
    most_time: Duration,
}

impl Harness {
    /// For inputs that take `most_time` at most.
    pub fn new(target: Target, most_time: Duration) -> Self {
        hear_panics();
        let folder = tempfile::tempdir_in(fast_folder()).expect("a folder for inputs");
        let input = folder.path().join("input");
        Harness { target, folder, input, most_time }
    }

    /// Inputs to begin with.
    pub fn seeds(&self) -> Vec<Vec<u8>> {
        (self.target.seeds)(self.folder.path())
    }

    /// Makes its folder the working directory, where the target needs that, for as long as the
    /// result lives. To be called before any input is judged.
    #[must_use]
    pub fn at_home(&self) -> Option<MutexGuard<'static, ()>> {
        self.target.at_home.then(|| {
            let guard = HOME.lock().unwrap_or_else(PoisonError::into_inner);
            std::env::set_current_dir(self.folder.path()).expect("a working directory");
            guard
        })
    }

    /// Takes an input.
    pub fn judge(&self, input: &[u8]) -> Judgement {
        std::fs::write(&self.input, input).expect("a place for the input");
        let (judgement, time) = self.once(input);
        if time <= self.most_time {
            return judgement;
        }
        // Other processes may have had the processor meanwhile: its own time counts.
        let before = processor_time();
        let (_, time) = self.once(input);
        let own = processor_time().zip(before).map_or(time, |(now, before)| now - before);
        if own > self.most_time {
            return Err(format!("it takes {:.1} s", own.as_secs_f64()));
        }
        judgement
    }

    fn once(&self, input: &[u8]) -> (Judgement, Duration) {
        let start = Instant::now();
        let judge =
            || panic::catch_unwind(AssertUnwindSafe(|| (self.target.judge)(&self.input, input)));
        LISTENS.set(true);
        let (result, peak) = allocator::peak_of(judge);
        LISTENS.set(false);
        let time = start.elapsed();
        let judgement = match result {
            Ok(judgement) => judgement,
            Err(_) => Err(format!("it panics: {}", HEARD.take())),
        };
        let most = FREE_BYTES + BYTES_A_BYTE * input.len();
        if judgement.is_ok() && peak > most {
            return (Err(format!("it holds {peak} bytes, of {most} that it may")), time);
        }
        (judgement, time)
    }
}

/// Time that this thread had a processor, where the system tells it.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split(' ').next()?.parse().ok().map(Duration::from_nanos)
}

/// A folder in memory where there is one: thousands of files are written and brought to disk.
fn fast_folder() -> PathBuf {
    match std::env::var_os("POINTMILL_FUZZ_WORK") {
        Some(folder) => folder.into(),
        None if Path::new("/dev/shm").is_dir() => "/dev/shm".into(),
        None => std::env::temp_dir(),
    }
}

thread_local! {
    static LISTENS: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
    static HEARD: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps the message of a panic that an input causes, instead of printing it.
fn hear_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let told = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if LISTENS.get() {
                HEARD.set(info.to_string().replace('\n', " "));
            } else {
                told(info);
            }
        }));
    });
}
