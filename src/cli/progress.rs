//! Progress in text: a bar on a terminal's stderr, and how long each phase took.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{
    HumanCount, MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle,
};

use super::print;

const KNOWN: &str =
    "{prefix:<10} {wide_bar} {pos_points} of {len_points} points, {rate}, {eta} left";
/// Of a file among several: its name, and the phase that its run is in.
const FILE: &str = "{prefix:<24!} {msg:<8} {wide_bar} {pos_points} of {len_points} points";
const FILE_UNKNOWN: &str = "{prefix:<24!} {msg:<8} {spinner} {pos_points} points";
const FILES: &str = "{prefix:<24} {wide_bar} {pos} of {len} files, {elapsed}";
const UNKNOWN: &str = "{prefix:<10} {spinner} {pos_points} points, {rate}, {elapsed}";

/// Draws one bar, of the phase that a run is in.
pub(super) struct Bars {
    drawn: bool,
    verbose: bool,
    open: Option<(&'static str, Instant, ProgressBar)>,
}

impl Bars {
    /// The time between two pictures of a bar.
    pub const EVERY: Duration = Duration::from_millis(100);

    /// Bars that are drawn if they are `wanted` and stderr is a terminal; if `verbose`, the time of
    /// a phase is told when it is over.
    pub fn new(wanted: bool, verbose: bool) -> Self {
        Bars { drawn: wanted && std::io::stderr().is_terminal(), verbose, open: None }
    }

    /// A phase begins, with `total` points to do.
    pub fn begin(&mut self, name: &'static str, total: Option<u64>) {
        let target = match self.drawn {
            true => ProgressDrawTarget::stderr(),
            false => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(total, target).with_prefix(name);
        bar.set_style(style(if total.is_some() { KNOWN } else { UNKNOWN }));
        self.open = Some((name, Instant::now(), bar));
    }

    /// So many points of the phase are done.
    pub fn advance(&self, done: u64) {
        if let Some((.., bar)) = &self.open {
            bar.set_position(done);
            bar.tick();
        }
    }

    /// The phase is over; what is printed next stands alone.
    pub fn end(&mut self) {
        let Some((name, since, bar)) = self.open.take() else { return };
        bar.finish_and_clear();
        if self.verbose {
            print::message(format_args!("{name:8} {:.1} s", since.elapsed().as_secs_f64()));
        }
    }

    /// Calls `print` while no bar is in its way.
    pub fn beside(&self, print: impl FnOnce()) {
        match &self.open {
            Some((.., bar)) => bar.suspend(print),
            None => print(),
        }
    }
}

/// Draws a bar for each of several runs that work at once, and below them one for all.
pub(super) struct ManyBars {
    all: MultiProgress,
    whole: ProgressBar,
}

impl ManyBars {
    /// Bars of `files` runs; None where no bar is drawn.
    pub fn new(files: usize) -> Option<ManyBars> {
        let drawn = std::io::stderr().is_terminal();
        drawn.then(|| ManyBars::on(ProgressDrawTarget::stderr(), files))
    }

    fn on(target: ProgressDrawTarget, files: usize) -> ManyBars {
        let all = MultiProgress::with_draw_target(target);
        let whole = all.add(ProgressBar::new(files as u64).with_prefix("all files"));
        whole.set_style(style(FILES));
        whole.tick();
        ManyBars { all, whole }
    }

    /// The bar of a run, of the input of this name, which is drawn from its first phase on.
    pub fn one(&self, name: &str) -> FileBar {
        // The end of a path tells it from others.
        let letters: Vec<char> = name.chars().collect();
        let name: String = letters[letters.len().saturating_sub(NAME)..].iter().collect();
        FileBar { all: self.all.clone(), whole: self.whole.clone(), name, bar: None }
    }

    /// One run more is over.
    pub fn done(&self) {
        self.whole.inc(1);
    }

    /// All of them are: what is printed next stands alone.
    pub fn end(&self) {
        self.whole.finish_and_clear();
    }

    /// Calls `print` while no bar is in its way.
    pub fn beside(&self, print: impl FnOnce()) {
        self.all.suspend(print);
    }
}

/// Letters of a name that stand before a bar.
const NAME: usize = 24;

/// The bar of one of several runs.
pub(super) struct FileBar {
    all: MultiProgress,
    whole: ProgressBar,
    name: String,
    bar: Option<ProgressBar>,
}

impl FileBar {
    /// A phase begins, with `total` points to do.
    pub fn begin(&mut self, phase: &'static str, total: Option<u64>) {
        self.end();
        let bar = ProgressBar::no_length().with_prefix(self.name.clone()).with_message(phase);
        if let Some(total) = total {
            bar.set_length(total);
        }
        bar.set_style(style(if total.is_some() { FILE } else { FILE_UNKNOWN }));
        self.bar = Some(self.all.insert_before(&self.whole, bar));
    }

    /// So many points of the phase are done.
    pub fn advance(&self, done: u64) {
        if let Some(bar) = &self.bar {
            bar.set_position(done);
            bar.tick();
        }
    }

    /// The phase is over.
    pub fn end(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
            self.all.remove(&bar);
        }
    }
}

impl Drop for FileBar {
    fn drop(&mut self) {
        self.end();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .with_key("pos_points", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let _ = write!(out, "{}", HumanCount(state.pos()));
        })
        .with_key("len_points", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let _ = write!(out, "{}", HumanCount(state.len().unwrap_or_default()));
        })
        .with_key("rate", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let _ = write!(out, "{:.2} Mpts/s", state.per_sec() / 1e6);
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_templates_are_well_formed() {
        for template in [KNOWN, UNKNOWN, FILE, FILE_UNKNOWN, FILES] {
            assert!(ProgressStyle::with_template(template).is_ok(), "{template}");
        }
    }

    #[test]
    fn a_bar_that_is_drawn_nowhere_counts() {
        let mut bars = Bars { drawn: false, verbose: false, open: None };
        bars.begin("decode", Some(10));
        bars.advance(4);
        bars.advance(7);
        assert_eq!(bars.open.as_ref().unwrap().2.position(), 7);
        bars.end();
        assert!(bars.open.is_none());
    }

    #[test]
    fn several_runs_have_a_bar_each_and_one_for_all() {
        let bars = ManyBars::on(ProgressDrawTarget::hidden(), 3);
        let mut files = ["a.laz", "a/way/that/is/longer/than/a/name.laz"].map(|n| bars.one(n));
        assert_eq!(files[1].name, "is/longer/than/a/name.laz"[1..]);
        files.iter_mut().for_each(|file| file.begin("convert", Some(10)));
        files[1].advance(7);
        assert_eq!(files[1].bar.as_ref().unwrap().position(), 7);
        bars.beside(|| ());
        files[1].advance(8);
        files[1].begin("write", None);
        let position = |file: &FileBar| file.bar.as_ref().unwrap().position();
        assert_eq!(files.each_ref().map(position), [0, 0]);
        drop(files);
        bars.done();
        assert_eq!((bars.whole.position(), bars.whole.length()), (1, Some(3)));
        bars.end();
    }
}
