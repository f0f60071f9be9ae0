//! Standard input and output as the files that all else reads and writes: at positions, again and
//! again, from any thread.
//!
//! A pipe gives its bytes once, in their order. What reads a scan needs its header first, its table
//! of chunks, which is at the end, and then many places at once; what writes one mends the header
//! when all is written. So what comes in is set down in a file of no name, which is gone with the
//! process, however that ends; what goes out is written as any output is and copied when it is
//! complete.
//!
//! A process has one standard input, and it can be read once. That is why this is the one state
//! that belongs to no value: what was set down, and what ends waiting for it.

use std::fs::{self, File, Metadata};
use std::io::{self, IsTerminal, Read, Seek, Write};
use std::os::fd::{AsFd, IntoRawFd};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{CWD, Mode, OFlags, openat};
use rustix::io::Errno;

use super::threads::lock;
use crate::error::{STANDARD_INPUT, STANDARD_OUTPUT, shown};
use crate::{Error, ErrorKind, Result};

/// How users say both.
pub const DASH: &str = "-";

/// True if `path` means standard input.
pub fn is_input(path: &Path) -> bool {
    path == Path::new(STANDARD_INPUT)
}

/// True if `path` means standard output.
pub fn is_output(path: &Path) -> bool {
    path == Path::new(STANDARD_OUTPUT)
}

/// The path of an input that was typed.
pub fn input(typed: &str) -> PathBuf {
    PathBuf::from(if typed == DASH { STANDARD_INPUT } else { typed })
}

/// The path of an output that was typed.
pub fn output(typed: PathBuf) -> PathBuf {
    if typed == Path::new(DASH) { PathBuf::from(STANDARD_OUTPUT) } else { typed }
}

/// The file that is opened where `path` is: itself, or what standard input gave, which is read to
/// its end when it is first asked for.
///
/// # Errors
///
/// Standard input that is a terminal, or that cannot be read or set down, and
/// [`ErrorKind::Interrupted`] if it is not waited for any longer.
pub fn opened(path: &Path) -> Result<PathBuf> {
    if !is_input(path) {
        return Ok(path.to_owned());
    }
    static STATE: Mutex<InputState> = Mutex::new(InputState::Unread);
    let state = &mut *lock(&STATE);
    match state {
        InputState::Taken(path) => Ok(path.clone()),
        InputState::Spoilt => Err(Error::new(ErrorKind::Io, "it cannot be read twice").at(path)),
        InputState::Unread => {
            *state = InputState::Spoilt;
            let path = take(path)?;
            *state = InputState::Taken(path.clone());
            Ok(path)
        }
    }
}

/// What is known of the file at `path`, or of what standard input gave.
///
/// # Errors
///
/// As [`opened`], and what the system refuses to say.
pub fn about(path: &Path) -> Result<Metadata> {
    let failed = |e| Error::io(path, "find it", e);
    fs::metadata(opened(path)?).map_err(failed)
}

/// Refuses standard output that is a terminal, which would show the bytes of a file.
///
/// # Errors
///
/// That, and nothing else.
pub fn check_output() -> Result<()> {
    match io::stdout().is_terminal() {
        false => Ok(()),
        true => Err(Error::pipeline("this is a terminal, which cannot show a file of points")
            .at(STANDARD_OUTPUT)
            .help("pipe it into a program or a file, such as `… > scan.laz`, or name a file")),
    }
}

/// Copies a file to standard output.
///
/// # Errors
///
/// What the system refuses, and a reader who has gone: what it got is no whole file, and who stands
/// behind it may not know.
pub fn send(file: &Path) -> Result<()> {
    let failed = |e| Error::io(STANDARD_OUTPUT, "write to it", e);
    let mut from = File::open(file).map_err(|e| Error::io(file, "read it again", e))?;
    let out = io::stdout().as_fd().try_clone_to_owned().map_err(failed)?;
    match io::copy(&mut from, &mut File::from(out)) {
        Ok(_) => Ok(()),
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => {
            let told = "its reader has gone before all was written: what it got is cut off";
            Err(Error::new(ErrorKind::Io, told).at(STANDARD_OUTPUT))
        }
        Err(e) => Err(failed(e)),
    }
}

/// Bytes of standard input that are set down at once.
const BLOCK: usize = 1 << 18;

/// Set once standard input is not waited for any longer.
static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From now on standard input is not waited for once `stop` is set. The first to say so is heard.
#[cfg(feature = "cli")]
pub fn wait_until(stop: Arc<AtomicBool>) {
    STOP.get_or_init(|| stop);
}

/// What became of standard input.
enum InputState {
    Unread,
    /// It can be opened by this path.
    Taken(PathBuf),
    /// Reading it failed.
    Spoilt,
}

/// Sets down what standard input gives, which is called `path`: by which path it can be opened from
/// now on.
fn take(path: &Path) -> Result<PathBuf> {
    let input = io::stdin();
    if input.is_terminal() {
        let told = "nothing is piped into it, and it is a terminal";
        let help = "give a scan, such as `… < scan.laz` or `other-program | …`";
        return Err(Error::pipeline(told).at(path).help(help));
    }
    let reading = |e| Error::io(path, "read it", e);
    let mut input = File::from(input.as_fd().try_clone_to_owned().map_err(reading)?);
    // A file can be read as it is, if nothing of it was read before.
    // Elsewhere what is opened by its descriptor shares a place with it.
    let is_file = cfg!(target_os = "linux") && input.metadata().map_err(reading)?.is_file();
    if is_file && input.stream_position().is_ok_and(|at| at == 0) && File::open(path).is_ok() {
        return Ok(path.to_owned());
    }
    let folder = std::env::temp_dir();
    let mut file = nameless(&folder).map_err(|e| {
        Error::io(&folder, "set standard input down here", e)
            .help("`TMPDIR` names another folder for it")
    })?;
    let setting_down = |e| {
        Error::io(path, &format!("set it down in {}", shown(&folder)), e)
            .help("`TMPDIR` names another folder for it, on a disk with room for all of it")
    };
    let mut block = vec![0; BLOCK];
    loop {
        wait(&input, path)?;
        match input.read(&mut block) {
            Ok(0) => break,
            Ok(read) => file.write_all(&block[..read]).map_err(setting_down)?,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(reading(e)),
        }
    }
    // It stays open until the process ends, and is there as long.
    Ok(PathBuf::from(format!("/dev/fd/{}", file.into_raw_fd())))
}

/// Waits until there is something to read, or the end.
fn wait(input: &File, path: &Path) -> Result<()> {
    let a_while = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
    loop {
        if STOP.get().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            return Err(Error::interrupted());
        }
        match poll(&mut [PollFd::new(input, PollFlags::IN)], Some(&a_while)) {
            Ok(0) | Err(Errno::INTR) => {}
            Ok(_) => return Ok(()),
            Err(e) => return Err(Error::io(path, "wait for it", e.into())),
        }
    }
}

/// A new file in `folder` that has no name.
fn nameless(folder: &Path) -> io::Result<File> {
    let mode = Mode::RUSR | Mode::WUSR;
    #[cfg(target_os = "linux")]
    if let Ok(file) = openat(CWD, folder, OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC, mode) {
        return Ok(File::from(file));
    }
    let flags = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let mut attempt = 0u32;
    loop {
        let name = format!(".pointmill-input-{}-{attempt}", std::process::id());
        let path = folder.join(name);
        match openat(CWD, &path, flags, mode) {
            Ok(file) => {
                fs::remove_file(&path)?;
                return Ok(File::from(file));
            }
            Err(Errno::EXIST) if attempt < 1_000 => attempt += 1,
            Err(e) => return Err(e.into()),
        }
    }
}
