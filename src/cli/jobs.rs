//! `new`: pipeline files for the jobs that users come with, to be changed.

use std::fs::OpenOptions;
use std::io;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::arguments::NewArguments;
use super::print;
use crate::error::{nearest, shown};
use crate::{Error, ErrorKind, Result};

/// The files of `pipelines/` by name.
macro_rules! jobs {
    ($($name:literal,)*) => {
        &[$(($name, include_str!(concat!("../../pipelines/", $name, ".toml"))),)*]
    };
}

/// Every file of `pipelines/`: a name and a text.
const JOBS: &[(&str, &str)] = jobs![
    "cad",
    "classes",
    "clean",
    "convert",
    "demo",
    "grid",
    "ground",
    "indoor",
    "mark",
    "normals",
    "outliers",
    "paper",
    "paper-outliers",
    "paper-random",
    "paper-uniform",
    "reduce",
    "resolutions",
    "split",
    "terrain",
    "tiles",
    "web",
];

/// Writes the file of a job, or lists the jobs.
pub(super) fn new(arguments: &NewArguments) -> Result<()> {
    let Some(job) = &arguments.job else {
        let width = JOBS.iter().map(|(name, _)| name.len()).max().unwrap_or_default();
        let line = |(name, text): &(&str, &str)| format!("{name:width$}  {}", about(text));
        return print::result(JOBS.iter().map(line).collect::<Vec<_>>().join("\n"));
    };
    let Some((name, text)) = JOBS.iter().find(|(name, _)| name == job) else {
        let names: Vec<String> = JOBS.iter().map(|(name, _)| (*name).to_owned()).collect();
        let near = nearest(job, &names).map(|near| format!("did you mean `{near}`? "));
        let help = format!("{}jobs: {}", near.unwrap_or_default(), names.join(", "));
        return Err(Error::pipeline(format!("there is no job `{job}`")).help(help));
    };
    let file = arguments.output.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.toml")));
    write(&file, &for_file(name, text, &file))?;
    let file = shown(&file).to_string();
    print::result(format_args!("{file} is written: change it, then `pointmill check {file}`"))
}

/// The text with its commands naming the file that it is written to, where a comment can.
fn for_file(name: &str, text: &str, file: &Path) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./".contains(c);
    match file.to_str().filter(|file| file.chars().all(is_plain)) {
        Some(file) => text.replace(&format!("pipelines/{name}.toml"), file),
        None => text.to_owned(),
    }
}

fn write(file: &Path, text: &str) -> Result<()> {
    let made = OpenOptions::new().write(true).create_new(true).open(file);
    let mut made = made.map_err(|e| match e.kind() {
        io::ErrorKind::AlreadyExists => Error::new(ErrorKind::Io, "this file exists")
            .at(file)
            .help("name another by `-o`, or remove this one"),
        _ => Error::io(file, "make the pipeline file", e),
    })?;
    made.write_all(text.as_bytes()).map_err(|e| Error::io(file, "write the pipeline file", e))
}

/// What a job is, in one sentence: the first of the comment that its file opens with.
fn about(text: &str) -> String {
    let lines = text.lines().map_while(|line| line.strip_prefix("# "));
    let words: Vec<&str> = lines.flat_map(str::split_whitespace).collect();
    let sentence = words.iter().position(|word| word.ends_with('.')).unwrap_or(words.len());
    words[..words.len().min(sentence + 1)].join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_pipelines_is_a_job_that_says_in_a_sentence_what_it_is() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
            .collect();
        files.sort();
        let jobs: Vec<&str> = JOBS.iter().map(|(name, _)| *name).collect();
        assert_eq!(jobs, files, "each in one line of JOBS, sorted");
        for (name, text) in JOBS {
            let about = about(text);
            assert!(about.len() > 20 && about.ends_with('.'), "{name}: {about}");
            assert!(text.contains(&format!("pipelines/{name}.toml")), "{name} says how it is run");
        }
    }

    #[test]
    fn commands_name_the_file_that_is_written() {
        let text = "# pointmill run pipelines/grid.toml\n";
        assert_eq!(for_file("grid", text, Path::new("a/b.toml")), "# pointmill run a/b.toml\n");
        assert_eq!(for_file("grid", text, Path::new("a\nb.toml")), text);
    }
}
