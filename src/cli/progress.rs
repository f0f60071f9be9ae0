//! Progress in text: a bar on a terminal's stderr, and how long each phase took.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{HumanCount, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::print;

const KNOWN: &str =
    "{prefix:<10} {wide_bar} {pos_points} of {len_points} points, {rate}, {eta} left";
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
        bar.set_style(style(total.is_some()));
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

fn style(total_known: bool) -> ProgressStyle {
    ProgressStyle::with_template(if total_known { KNOWN } else { UNKNOWN })
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
        for template in [KNOWN, UNKNOWN] {
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
}
