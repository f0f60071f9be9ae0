//! The stages at both ends of a pipeline, from their keys to sources and sinks.

use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

use super::kinds::{Format, Read, Write, unknown_extension};
use super::outputs::Outputs;
use super::{connect, inputs};
use crate::error::shown;
use crate::stage::{OpenSource, Role};
use crate::stage::{StageKind, StagePlace};
use crate::{Error, Result};

impl Read {
    /// The source of these files, none of which is opened yet.
    ///
    /// # Errors
    ///
    /// A path that names no file, a file whose name tells no format, and files of which the records
    /// are not alike.
    pub fn source(&self) -> Result<Box<dyn OpenSource>> {
        let files = inputs::expand(&self.path)?;
        let known = |file: &PathBuf| self.format.or(Format::of(file));
        // A file that is not there is told when it is opened, whatever its name.
        let missing = files.iter().find_map(known).unwrap_or(Format::Las);
        let mut formats = Vec::new();
        for file in &files {
            formats.push(match known(file) {
                Some(format) => format,
                None if std::fs::metadata(file).is_err() => missing,
                None => return Err(unknown_extension(file, "read.format")),
            });
        }
        if let Some(i) = formats.iter().position(|f| !f.same_records(formats[0])) {
            let (a, b) = (shown(&files[0]), shown(&files[i]));
            let help = "read one of the two formats, or convert first";
            let told = format!("{a} and {b} cannot be read together: LAS and PLY records differ");
            return Err(Error::pipeline(told).help(help));
        }
        Ok(connect::read(files, &formats))
    }
}

impl StageKind for Read {
    const KIND: &'static str = "read";
    const ABOUT: &'static str = "Reads LAS, LAZ or PLY files.";
    const PLACES: &'static [&'static str] = &["path", "format"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        Ok(Role::Source(self.source().map_err(|error| at.blame("path", error))?))
    }
}

impl StageKind for Write {
    const KIND: &'static str = "write";
    const ABOUT: &'static str = "Writes a LAS, LAZ or PLY file, or one for each input.";
    const PLACES: &'static [&'static str] = &["path", "folder"];
    const EITHER: &'static [&'static str] = &["path", "folder"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        let check = |format| self.check(format).map_err(|(key, error)| at.blame(key, error));
        match (self.path.clone(), self.folder.clone()) {
            (Some(_), Some(_)) => {
                let told = "`write.path` makes one file and `write.folder` one for each input: give one of them";
                Err(at.blame("folder", Error::pipeline(told)))
            }
            (None, None) => Err(Error::pipeline("a `write` needs `write.path` or `write.folder`")
                .help("`write.path` is one file, `write.folder` gets one for each input")),
            (Some(path), None) if path.as_os_str().as_bytes().ends_with(b"/") || path.is_dir() => {
                let told = format!("`{}` is a folder, not a file to write", shown(&path));
                let help = format!(
                    "name a file in it, such as `{}`, or give the folder as `write.folder`, which gets \
                     a file for each input",
                    shown(&path.join("out.laz"))
                );
                Err(at.blame("path", Error::pipeline(told).help(help)))
            }
            (Some(path), None) => {
                let Some(format) = self.format.or(Format::of(&path)) else {
                    return Err(at.blame("path", unknown_extension(&path, "write.format")));
                };
                if let Some(plain) = Format::without_copc(&path) {
                    let told = format!("`{}` is named as COPC, which is not written", shown(&path));
                    let help = format!("name it `{}`: it is plain LAZ", shown(&plain));
                    return Err(at.blame("path", Error::pipeline(told).help(help)));
                }
                check(format)?;
                let output = connect::Output { write: self, path, format, of_one: false };
                Ok(Role::Sink(Box::new(output)))
            }
            (None, Some(folder)) => {
                self.format.map_or(Ok(()), check)?;
                Ok(Role::Sink(Box::new(Outputs { write: self, folder })))
            }
        }
    }
}
