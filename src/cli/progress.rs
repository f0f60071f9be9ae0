//! Progress bars on a terminal's stderr.

use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use indicatif::{HumanCount, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

const KNOWN: &str =
    "{prefix:<10} {wide_bar} {pos_points} of {len_points} points, {rate}, {eta} left";
const UNKNOWN: &str = "{prefix:<10} {spinner} {pos_points} points, {rate}, {elapsed}";

/// Draws one bar, of the phase that a run is in.
pub(super) struct Bars {
    drawn: bool,
    bar: Mutex<Option<ProgressBar>>,
}

impl Bars {
    /// Bars that are drawn if they are `wanted` and stderr is a terminal.
    pub fn new(wanted: bool) -> Self {
        Bars { drawn: wanted && std::io::stderr().is_terminal(), bar: Mutex::new(None) }
    }

    /// Removes the bar, so that what is printed next stands alone.
    pub fn clear(&self) {
        if let Some(bar) = self.bar().take() {
            bar.finish_and_clear();
        }
    }

    /// A phase begins, with `total` points to do.
    pub fn phase(&self, name: &'static str, total: Option<u64>) {
        self.clear();
        if !self.drawn {
            return;
        }
        let target = ProgressDrawTarget::stderr_with_hz(10);
        let bar = ProgressBar::with_draw_target(total, target).with_prefix(name);
        bar.set_style(style(total.is_some()));
        bar.enable_steady_tick(Duration::from_millis(200));
        *self.bar() = Some(bar);
    }

    /// `points` more are done.
    pub fn advance(&self, points: u64) {
        if let Some(bar) = &*self.bar() {
            bar.inc(points);
        }
    }

    /// Calls `print` while no bar is in its way.
    pub fn beside(&self, print: impl FnOnce()) {
        match &*self.bar() {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }

    fn bar(&self) -> MutexGuard<'_, Option<ProgressBar>> {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner)
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
        let bars = Bars { drawn: true, bar: Mutex::new(None) };
        bars.phase("decode", Some(10));
        bars.bar().as_ref().unwrap().set_draw_target(ProgressDrawTarget::hidden());
        bars.advance(4);
        bars.advance(3);
        assert_eq!(bars.bar().as_ref().unwrap().position(), 7);
        bars.clear();
        assert!(bars.bar().is_none());
    }
}
