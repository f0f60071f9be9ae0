//! The stages at both ends of a pipeline, from their keys to sources and sinks.

use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;
use std::sync::Arc;

use super::checked::{check, check_read, unknown_extension};
use super::kinds::{OutputOrder, Read, Write};
use super::outputs::Outputs;
use super::split::{SplitFiles, pattern};
use super::{connect, inputs};
use crate::error::shown;
use crate::host::standard;
use crate::io::sniff::first_bytes;
use crate::stage::{
    Format, Formats, OpenSource, Order, Role, RoleName, StageKind, StagePlace, Unread,
};
use crate::{Error, Result};

impl Read {
    /// The source of these files, each of one of `formats`; none of them is opened yet.
    ///
    /// # Errors
    ///
    /// A path that names no file, a file of which neither name nor first bytes tell a format, and
    /// files of which the records are not alike.
    pub fn source(&self, formats: &Formats) -> Result<Box<dyn OpenSource>> {
        let format = self.files(formats)?;
        check_read(&self.keys(), &*format.1, formats).map_err(|(_, error)| error)?;
        Ok(self.opened(format, formats))
    }

    fn opened(
        &self,
        (files, format): (Vec<PathBuf>, Arc<dyn Format>),
        formats: &Formats,
    ) -> Box<dyn OpenSource> {
        let (keys, formats) = (self.keys(), formats.clone());
        Box::new(connect::InputFiles { files, format, keys, formats })
    }

    /// The files, and a format of theirs.
    fn files(&self, formats: &Formats) -> Result<(Vec<PathBuf>, Arc<dyn Format>)> {
        let files = inputs::expand(&self.path, formats)?;
        let piped = files.iter().find(|file| standard::is_input(file));
        if let Some(piped) = piped
            && first_bytes(piped)?.is_empty()
        {
            let help = "what should have written it failed, or nothing is piped into it";
            return Err(Error::data(piped, "nothing came from it").help(help));
        }
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
        Ok((files, format))
    }
}

impl StageKind for Read {
    const KIND: &'static str = "read";
    const ROLE: RoleName = RoleName::Source;
    const ABOUT: &'static str = "Reads LAS, LAZ, COPC, PLY, PCD, E57, texts and others.";
    const MAIN: Option<&'static str> = Some("path");
    const PLACES: &'static [&'static str] = &["path", "format"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        if at.is_unread() {
            let paths = self.path.iter().map(PathBuf::from).collect();
            return Ok(Role::Source(Box::new(Unread { paths })));
        }
        let formats = at.formats();
        let found = self.files(formats).map_err(|error| at.blame("path", error))?;
        let checked = check_read(&self.keys(), &*found.1, formats);
        checked.map_err(|(key, error)| at.blame(key, error))?;
        Ok(Role::Source(self.opened(found, formats)))
    }
}

impl StageKind for Write {
    const KIND: &'static str = "write";
    const ROLE: RoleName = RoleName::Sink;
    const ABOUT: &'static str =
        "Writes a file of points, one for each input, or several into which the points are split.";
    const MAIN: Option<&'static str> = Some("path");
    const PLACES: &'static [&'static str] = &["path", "folder"];
    const EITHER: &'static [&'static str] = &["path", "folder"];

    fn build(self, at: &StagePlace) -> Result<Role> {
        match (self.path.clone().map(standard::output), self.folder.clone()) {
            (Some(_), Some(_)) => {
                let told = "`write.path` makes one file and `write.folder` one for each input: \
                            give one of them";
                Err(at.blame("folder", Error::pipeline(told)))
            }
            (None, None) => Err(Error::pipeline("a `write` needs `write.path` or `write.folder`")
                .help("`write.path` is one file, `write.folder` gets one for each input")),
            (Some(path), None) => self.file(path, at),
            (None, Some(folder)) => self.each(folder, at),
        }
    }
}

impl Write {
    /// The sink of one file, or of a file for each square.
    fn file(&self, path: PathBuf, at: &StagePlace) -> Result<Role> {
        let formats = at.formats();
        if path.as_os_str().as_bytes().ends_with(b"/") || path.is_dir() {
            let told = format!("`{}` is a folder, not a file to write", shown(&path));
            let help = format!(
                "name a file in it, such as `{}`, or give the folder as `write.folder`, which \
                 gets a file for each input",
                shown(&path.join("out.laz"))
            );
            return Err(at.blame("path", Error::pipeline(told).help(help)));
        }
        let asked = self.format.as_ref().map(|name| formats.named(name)).transpose()?;
        let Some(format) = asked.or(formats.of(&path)) else {
            let unknown = unknown_extension(&path, "write.format", formats);
            return Err(at.blame("path", unknown));
        };
        let order = self.order_in(&**format, at)?;
        let keys = self.keys(path);
        let checked = check(&keys, &**format, formats);
        checked.map_err(|(key, error)| at.blame(key, error))?;
        let (format, formats) = (format.clone(), formats.clone());
        let file = connect::OutputFile { keys, order, format, formats, of_one: false };
        self.split(file, at)
    }

    /// The order of the records in files of `format`.
    fn order_in(&self, format: &dyn Format, at: &StagePlace) -> Result<Order> {
        let Some(other) = format.arranged() else { return Ok(self.stage_order()) };
        let is = format.name().to_uppercase();
        if self.order == Some(OutputOrder::Input) {
            let told = format!("{is} has an order of its own, not that of the input");
            return Err(at.blame("order", Error::pipeline(told)));
        }
        if self.bytes.is_some() {
            let told = format!("how many bytes {is} takes is known when a file of it is complete");
            let help = format!("give `write.points` instead, or write `{other}`");
            return Err(at.blame("bytes", Error::pipeline(told).help(help)));
        }
        Ok(Order::Canonical)
    }

    /// The sink of `file`, or of several into which it is split.
    fn split(&self, file: connect::OutputFile, at: &StagePlace) -> Result<Role> {
        let mut splits = self.splits().into_iter();
        match (splits.next(), splits.next()) {
            (Some((one, _)), Some((other, _))) => {
                let told = format!("`write.{one}` and `write.{other}` both split the output");
                let help = "give one of them, and split each of the files by the other later";
                Err(at.blame(other, Error::pipeline(told).help(help)))
            }
            (Some((_, by)), None) => {
                let split = SplitFiles { file, by };
                split.check().map_err(|error| at.blame("path", error))?;
                Ok(Role::Sink(Box::new(split)))
            }
            (None, _) => match pattern(&file.keys.path) {
                None => Ok(Role::Sink(Box::new(file))),
                Some((place, key)) => {
                    let told = format!(
                        "a path with `{place}` is one of several, and nothing says into which \
                         files the points are split"
                    );
                    let help = format!("give {key}");
                    Err(at.blame("path", Error::pipeline(told).help(help)))
                }
            },
        }
    }

    /// The sink of a file for each input.
    fn each(&self, folder: PathBuf, at: &StagePlace) -> Result<Role> {
        let formats = at.formats();
        if let Some((key, by)) = self.splits().first() {
            let told = format!(
                "`write.{key}` splits the output of `write.path`, and `write.folder` has a file \
                 for each input"
            );
            let such = by.places().join("_");
            let help = format!("give a path such as `path = \"{such}.laz\"` instead of the folder");
            return Err(at.blame(key, Error::pipeline(told).help(help)));
        }
        let asked = self.format.as_ref().map(|name| formats.named(name)).transpose()?;
        let keys = self.keys(folder);
        if let Some(format) = asked {
            let checked = check(&keys, &**format, formats);
            checked.map_err(|(key, error)| at.blame(key, error))?;
        }
        let order = asked.map(|format| self.order_in(&**format, at)).transpose()?;
        let (order, format) = (order.unwrap_or(self.stage_order()), asked.cloned());
        Ok(Role::Sink(Box::new(Outputs { keys, order, format, formats: formats.clone() })))
    }
}
