//! Waveform packets in a file of their own (LAS 1.4 R15, section 2.4, bit 2 of the global
//! encoding): it has the name of the LAS file and the extension `wdp`.

use std::path::{Path, PathBuf};

use super::fields::encoding;
use super::file::InputFile;
use super::format::has_waveforms;
use super::header::Header;
use crate::error::shown;

/// The extension of such files.
pub const EXTENSION: &str = "wdp";

/// The file that the records of a LAS file refer to.
pub struct Waveforms {
    /// Its path, if it is there.
    pub there: Option<PathBuf>,
    /// What the user should know if it is not.
    pub missing: Option<String>,
}

impl Waveforms {
    /// Those of the file at `path`.
    pub fn of(path: &Path, header: &Header) -> Self {
        let bits = header.encoding() & (encoding::WAVEFORM_INTERNAL | encoding::WAVEFORM_EXTERNAL);
        if !has_waveforms(header.format()) || bits & encoding::WAVEFORM_INTERNAL != 0 {
            return Waveforms { there: None, missing: None };
        }
        let there = named(path);
        let told = there.is_none() && bits & encoding::WAVEFORM_EXTERNAL != 0;
        let missing = told.then(|| {
            format!(
                "its records refer to waveforms in {}, which is not there: those of outputs will \
                 refer to nothing",
                shown(&path.with_extension(EXTENSION))
            )
        });
        Waveforms { there, missing }
    }
}

/// The file of waveforms that the name of `path` means.
fn named(path: &Path) -> Option<PathBuf> {
    let names = [EXTENSION, "WDP"].map(|extension| path.with_extension(extension));
    names.into_iter().find(|path| path.is_file())
}

/// The file of waveforms that a LAS file refers to, and the extension that it has beside outputs;
/// None as well for what is no LAS file, which whoever reads its points will be told.
pub fn beside(path: &Path) -> Option<(PathBuf, &'static str)> {
    named(path)?;
    let header = Header::read(&InputFile::open(path).ok()?).ok()?;
    Waveforms::of(path, &header).there.map(|file| (file, EXTENSION))
}
