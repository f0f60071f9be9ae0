//! The files that a pipeline's stages name: no output replaces another or what is read.

use std::path::Path;

use super::draft::Draft;
use super::mistake::Mistake;
use super::place::TextPlace;
use crate::error::shown;
use crate::graph::{GraphStage, RunSettings};
use crate::host::{Files, Use};
use crate::stage::Role;

/// No file is written twice, and none over an input or over the pipeline, which is read from
/// `file`.
pub(super) fn check(
    file: Option<&Path>,
    draft: &Draft,
    stages: &[Option<GraphStage>],
    settings: &RunSettings,
    mistakes: &mut Vec<Mistake>,
) {
    let mut files = Files::default();
    file.iter().for_each(|path| files.read(path, Use::Pipeline));
    let mut outputs: Vec<(&Path, &TextPlace)> = Vec::new();
    for (draft, stage) in draft.stages.iter().zip(stages) {
        match stage.as_ref().map(|stage| &stage.role) {
            Some(Role::Source(source)) => {
                source.paths().iter().for_each(|path| files.read(path, Use::Input));
            }
            Some(Role::Sink(sink)) if sink.is_file() => {
                let key = |key| draft.keys.at(key);
                let at = key("path").or(key("folder")).unwrap_or(&draft.keys.place);
                outputs.push((sink.path(), at));
            }
            _ => {}
        }
    }
    if let Some(report) = &settings.report {
        outputs.push((report, draft.run.at("report").unwrap_or(&draft.run.place)));
    }
    for (path, at) in outputs {
        if let Err(clash) = files.write(path) {
            mistakes.push(Mistake::new(at.clone(), format!("{} {clash}", shown(path))));
        }
    }
}
