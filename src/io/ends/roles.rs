//! The stages at both ends of a pipeline, from their keys to sources and sinks.

use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

use super::kinds::{Read, Write, unknown_extension};
use super::outputs::Outputs;
use super::{connect, inputs, kinds};
use crate::error::shown;
use crate::io::sniff::first_bytes;
use crate::stage::{Format, Formats, OpenSource, Role, RoleName, StageKind, StagePlace, WriteKeys};
use crate::{Error, Result};

impl Read {
    /// The source of these files, each of one of `formats`; none of them is opened yet.
    ///
    /// # Errors
    ///
    /// A path that names no file, a file of which neither name nor first bytes tell a format, and
    /// files of which the records are not alike.
    pub fn source(&self, formats: &Formats) -> Result<Box<dyn OpenSource>> {
        let files = inputs::expand(&self.path, formats)?;
        let asked = self.format.as_ref().map(|name| formats.named(name)).transpose()?;
        let sniffed = |file: &PathBuf| formats.sniffed(&first_bytes(file).ok()?);
        let known = |file: &PathBuf| asked.or(formats.of(file)).or_else(|| sniffed(file));
        // A file that is not there is told when it is opened, whatever its name.
        let missing = files.iter().find_map(known).or(formats.iter().next());
        let mut all = Vec::new();
        for file in &files {
            let missing = || missing.filter(|_| std::fs::metadata(file).is_err());
            let format = known(file).or_else(missing);
            all.push(format.ok_or_else(|| unknown_extension(file, "read.format", formats))?);
        }
        let families: Vec<&str> = all.iter().map(|format| format.family()).collect();
        if let Some(i) = families.iter().position(|family| *family != families[0]) {
            let (a, b) = (shown(&files[0]), shown(&files[i]));
            let mut both = [families[0], families[i]];
            both.sort_unstable();
            let told = format!(
                "{a} and {b} cannot be read together: {} records differ",
                both.join(" and ")
            );
            let help = "read one of the two formats, or convert first";
            return Err(Error::pipeline(told).help(help));
        }
        let format = all[0].clone();
        Ok(Box::new(connect::InputFiles { files, format, formats: formats.clone() }))
    }
}

impl StageKind for Read {
    const KIND: &'static str = "read";
    const ROLE: RoleName = RoleName::Source;
    const ABOUT: &'static str = "Reads LAS, LAZ or PLY files.";
    const MAIN: Option<&'static str> = Some("path");
    const PLACES: &'static [&'static str] = &["path", "format"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        Ok(Role::Source(self.source(at.formats()).map_err(|error| at.blame("path", error))?))
    }
}

impl StageKind for Write {
    const KIND: &'static str = "write";
    const ROLE: RoleName = RoleName::Sink;
    const ABOUT: &'static str = "Writes a LAS, LAZ or PLY file, or one for each input.";
    const MAIN: Option<&'static str> = Some("path");
    const PLACES: &'static [&'static str] = &["path", "folder"];
    const EITHER: &'static [&'static str] = &["path", "folder"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        let formats = at.formats();
        let check = |keys: &WriteKeys, format: &dyn Format| {
            kinds::check(keys, format, formats).map_err(|(key, error)| at.blame(key, error))
        };
        let asked = self.format.as_ref().map(|name| formats.named(name)).transpose()?;
        match (self.path.clone(), self.folder.clone()) {
            (Some(_), Some(_)) => {
                let told = "`write.path` makes one file and `write.folder` one for each input: \
                            give one of them";
                Err(at.blame("folder", Error::pipeline(told)))
            }
            (None, None) => Err(Error::pipeline("a `write` needs `write.path` or `write.folder`")
                .help("`write.path` is one file, `write.folder` gets one for each input")),
            (Some(path), None) if path.as_os_str().as_bytes().ends_with(b"/") || path.is_dir() => {
                let told = format!("`{}` is a folder, not a file to write", shown(&path));
                let help = format!(
                    "name a file in it, such as `{}`, or give the folder as `write.folder`, which \
                     gets a file for each input",
                    shown(&path.join("out.laz"))
                );
                Err(at.blame("path", Error::pipeline(told).help(help)))
            }
            (Some(path), None) => {
                let Some(format) = asked.or(formats.of(&path)) else {
                    let unknown = unknown_extension(&path, "write.format", formats);
                    return Err(at.blame("path", unknown));
                };
                let named = formats.of(&path);
                if let Some((what, plain)) = named.and_then(|named| named.promises(&path)) {
                    let path = shown(&path);
                    let told = format!("`{path}` is named as {what}, which is not written");
                    let is = named.map_or("", |named| named.name()).to_uppercase();
                    let help = format!("name it `{}`: it is plain {is}", shown(&plain));
                    return Err(at.blame("path", Error::pipeline(told).help(help)));
                }
                let keys = self.keys(path);
                check(&keys, &**format)?;
                let (format, formats) = (format.clone(), formats.clone());
                let order = self.stage_order();
                let output = connect::OutputFile { keys, order, format, formats, of_one: false };
                Ok(Role::Sink(Box::new(output)))
            }
            (None, Some(folder)) => {
                let keys = self.keys(folder);
                asked.map_or(Ok(()), |format| check(&keys, &**format))?;
                let (order, format) = (self.stage_order(), asked.cloned());
                Ok(Role::Sink(Box::new(Outputs { keys, order, format, formats: formats.clone() })))
            }
        }
    }
}
