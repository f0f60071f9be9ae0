//! What the template of a page is filled with.

use askama::Template;

use super::branch::{BranchView, Tiles};
use super::scenes::{PlaceView, SceneView, draw};
use super::source::PageSource;
use super::words;
use crate::Result;
use crate::report::{FileFigures, Outcome};

/// A page.
#[derive(Template)]
#[template(path = "page.html")]
pub(super) struct Page {
    title: String,
    version: String,
    /// True if all rules hold; None without rules.
    passed: Option<bool>,
    branches: Vec<BranchView>,
    scenes: Vec<SceneView>,
    has_after: bool,
    places: Vec<PlaceView>,
    warnings: Vec<String>,
    files: Vec<FileView>,
    /// The command that makes the outputs again; None where they do not note how they were made.
    again: Option<String>,
    missing: Vec<String>,
}

/// A file that was read or written.
struct FileView {
    role: &'static str,
    path: String,
    points: String,
    bytes: String,
    /// In hexadecimal; empty where it is not known.
    sha256: String,
}

impl Page {
    /// Of a run.
    pub fn of(mut source: PageSource<'_>) -> Result<Page> {
        let report = source.report;
        let mut missing = Vec::new();
        let results: Vec<&Outcome> =
            std::iter::once(&report.result).chain(&report.further).collect();
        let mut lines = std::mem::take(&mut source.tiles).into_iter();
        let (mut branches, mut worst, mut spacing) = (Vec::new(), Vec::new(), 0.0);
        for (n, result) in results.iter().enumerate() {
            let tiles = match lines.next() {
                Some(mut lines) => Tiles::read(result, &mut *lines)?,
                None => None,
            };
            if let (0, Some(tiles)) = (n, &tiles) {
                let apart = result.tile_side.unwrap_or(0.0) / 2.0;
                (worst, spacing) = (tiles.worst.places(apart), tiles.map.spacing());
            }
            let place = (n, results.len());
            branches.push(BranchView::of(result, tiles.as_ref(), place, source.unit)?);
        }
        let (scenes, places) = draw(&source, (&worst, spacing), &mut missing);
        let again = again(&report.run.outputs);
        not_measured(&results, again.is_some(), &mut missing);
        let verdicts: Vec<bool> =
            results.iter().filter_map(|r| r.accept.as_ref()).map(|v| v.passed).collect();
        Ok(Page {
            title: title(&report.run.inputs),
            version: report.run.version.clone(),
            passed: (!verdicts.is_empty()).then(|| verdicts.iter().all(|passed| *passed)),
            branches,
            scenes,
            has_after: source.after.as_ref().is_ok_and(|after| after.points() > 0),
            places,
            warnings: warnings(&report.run.warnings),
            files: files(&report.run.inputs, &report.run.outputs),
            again,
            missing,
        })
    }
}

/// What was reduced, by the names of the inputs.
fn title(inputs: &[FileFigures]) -> String {
    let name = |file: &FileFigures| {
        let path = std::path::Path::new(&file.path);
        let name = path.file_name().map_or(path.as_os_str(), |name| name);
        crate::error::shown(std::path::Path::new(name)).to_string()
    };
    match inputs {
        [] => "A made-up scan".to_owned(),
        [one] => name(one),
        [first, others @ ..] => {
            let more = words::count(others.len() as u64);
            format!("{} and {more} more", name(first))
        }
    }
}

/// The command that makes the outputs again, by the first of them that has a hash.
fn again(outputs: &[FileFigures]) -> Option<String> {
    let noted = outputs.iter().find(|file| file.sha256.is_some())?;
    let path = crate::error::shown(std::path::Path::new(&noted.path)).to_string();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:".contains(c);
    let quoted = match path.chars().all(is_plain) {
        true => path,
        false => format!("'{}'", path.replace('\'', "'\\''")),
    };
    Some(format!("pointmill reproduce {quoted}"))
}

/// Warnings that a page lists.
const MOST_WARNINGS: usize = 60;

/// The first of them, and how many more there are.
fn warnings(all: &[String]) -> Vec<String> {
    let mut told = all.to_vec();
    if let Some(more) = all.len().checked_sub(MOST_WARNINGS).filter(|more| *more > 0) {
        told.truncate(MOST_WARNINGS);
        told.push(format!("and {} more, which a report as JSON has", words::count(more as u64)));
    }
    told
}

/// Files of each role that a page lists.
const MOST_FILES: usize = 60;

fn files(inputs: &[FileFigures], outputs: &[FileFigures]) -> Vec<FileView> {
    let mut all = Vec::new();
    for (role, files) in [("input", inputs), ("output", outputs)] {
        all.extend(files.iter().take(MOST_FILES).map(|file| FileView {
            role,
            path: crate::error::shown(std::path::Path::new(&file.path)).to_string(),
            points: words::count(file.points),
            bytes: words::bytes(file.bytes),
            sha256: file.sha256.clone().unwrap_or_default(),
        }));
        if let Some(others) = files.len().checked_sub(MOST_FILES).filter(|others| *others > 0) {
            all.push(FileView {
                role,
                path: format!("and {} more", words::count(others as u64)),
                points: words::count(files[MOST_FILES..].iter().map(|file| file.points).sum()),
                bytes: String::new(),
                sha256: String::new(),
            });
        }
    }
    all
}

/// Adds what a reader may look for and nobody measured.
fn not_measured(results: &[&Outcome], has_hashes: bool, missing: &mut Vec<String>) {
    let any = |of: fn(&Outcome) -> bool| results.iter().any(|result| of(result));
    let mut say = |told: &str| missing.push(told.to_owned());
    if any(|result| result.totals.is_none()) {
        say(
            "Deviations, planes and maps: a pipeline that streams has no tiles to measure them in.",
        );
    } else if any(|result| {
        let removed = result.ledger.removed_records() > 0;
        removed && result.totals.is_some_and(|totals| totals.deviation.is_none())
    }) {
        say("How far removed points are off: no stage says what stands for them.");
    }
    for result in results {
        let deviation = result.totals.and_then(|totals| totals.deviation);
        let measured = deviation.map_or(0, |deviation| deviation.points);
        let others = result.ledger.removed_records().saturating_sub(measured);
        if measured > 0 && others > 0 {
            let others = words::count(others);
            say(&format!("How far {others} removed points are off: nothing stands for them."));
        }
    }
    let has_baseline = |result: &Outcome| result.totals.is_some_and(|t| t.baseline.is_some());
    if any(|result| result.ledger.removed_records() > 0) && !results.iter().any(|r| has_baseline(r))
    {
        say(
            "A voxel grid of as many points: it is measured where stages choose points by normals \
             or in rounds (`cells`, `graded`), and remove some of them.",
        );
    }
    if any(|result| result.accept.is_none()) {
        say("Whether the result is good enough: nobody gave rules by which it is accepted.");
    }
    if !has_hashes {
        say("Hashes of the inputs and outputs: outputs do not note how they were made.");
    }
    say("Errors of the scan itself: how far its points are from what was scanned.");
    say("How far each place is from the nearest point that was kept: `pointmill verify` measures \
         that, and checks that each kept record is one of the inputs.");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_files_are_listed_in_part() {
        let file = |n: usize| FileFigures {
            path: format!("d/{n}.laz"),
            points: 2,
            bytes: None,
            sha256: None,
        };
        let many: Vec<String> = (0..MOST_WARNINGS + 2).map(|n| format!("file {n}")).collect();
        let told = warnings(&many);
        assert_eq!(told.len(), MOST_WARNINGS + 1);
        assert_eq!(told[MOST_WARNINGS], "and 2 more, which a report as JSON has");
        assert_eq!(warnings(&many[..MOST_WARNINGS]), many[..MOST_WARNINGS]);
        let inputs: Vec<FileFigures> = (0..MOST_FILES + 3).map(file).collect();
        let rows = files(&inputs, &inputs[..1]);
        assert_eq!(rows.len(), MOST_FILES + 2);
        assert_eq!(
            (rows[MOST_FILES].path.as_str(), &*rows[MOST_FILES].points),
            ("and 3 more", "6")
        );
        assert_eq!(title(&inputs), "0.laz and 62 more");
        assert_eq!(title(&[]), "A made-up scan");
    }
}
