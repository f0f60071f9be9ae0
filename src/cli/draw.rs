//! One thread that draws what a run does, and the channel through which it is told.
//!
//! A run calls its watch from all of its threads. What they say goes through one bounded channel to
//! the thread that owns bar and lines: nothing needs a lock, lines never mix, and all is drawn in
//! the order in which it was said. How many points are done is not said, since every batch would be
//! an event: the threads add to one counter, at which the drawing thread looks a few times a
//! second. A terminal that takes nothing (Ctrl-S) therefore holds a run up only when the channel is
//! full.

use std::borrow::Cow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};

use crate::engine::Watch;
use crate::report::Decision;
use crate::{Error, ErrorKind, Result};

/// Events that may wait to be drawn.
const WAITING: usize = 64;

/// How a run is drawn, by one thread. Nothing, unless a method is written.
pub(super) trait Draw: Send {
    /// The time between two looks at how many points are done.
    fn every(&self) -> Duration {
        Duration::from_secs(1)
    }

    /// A phase begins, with `total` points to do.
    fn begin(&mut self, _name: &'static str, _total: Option<u64>) {}

    /// So many points of the phase are done.
    fn advance(&mut self, _done: u64) {}

    /// The phase is over, if one was open, with so many points done.
    fn end(&mut self, _done: u64) {}

    /// Something that the user should know.
    fn warn(&mut self, _message: &str) {}

    /// Stages chose these values.
    fn chose(&mut self, _values: &[Decision]) {}
}

/// Draws nothing.
pub(super) struct Nothing;

impl Draw for Nothing {}

/// A warning of one input of many: it names it.
pub(super) fn of_input<'a>(input: Option<&str>, message: &'a str) -> Cow<'a, str> {
    match input.filter(|input| !message.contains(input)) {
        Some(input) => format!("{input}: {message}").into(),
        None => message.into(),
    }
}

/// What is said to the drawing thread.
enum Event {
    /// The open phase is over, with so many points done, and another one begins.
    Phase {
        done: u64,
        name: &'static str,
        total: Option<u64>,
    },
    Warning(String),
    Chosen(Vec<Decision>),
    /// The run is done, with so many points of its last phase.
    Done(u64),
}

/// The watch of a run that is drawn.
struct Telling<'a> {
    events: Sender<Event>,
    done: &'a AtomicU64,
    cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl Telling<'_> {
    fn tell(&self, event: Event) {
        // The drawing thread hears until this watch is gone.
        let _ = self.events.send(event);
    }
}

impl Watch for Telling<'_> {
    fn phase(&self, name: &'static str, total: Option<u64>) {
        let done = self.done.swap(0, Ordering::Relaxed);
        self.tell(Event::Phase { done, name, total });
    }

    fn advance(&self, points: u64) {
        self.done.fetch_add(points, Ordering::Relaxed);
    }

    fn warn(&self, message: &str) {
        self.tell(Event::Warning(message.to_owned()));
    }

    fn chose(&self, values: &[Decision]) {
        self.tell(Event::Chosen(values.to_vec()));
    }

    fn cancelled(&self) -> bool {
        (self.cancelled)()
    }
}

/// Calls `run` with a watch of which `draw` draws what it is told; all is drawn when this returns.
/// The run hears from `cancelled` whether to stop.
pub(super) fn watched<T>(
    draw: &mut dyn Draw,
    cancelled: &(dyn Fn() -> bool + Sync),
    run: impl FnOnce(&dyn Watch) -> Result<T>,
) -> Result<T> {
    let (events, heard) = bounded(WAITING);
    let done = &AtomicU64::new(0);
    thread::scope(|scope| {
        let refused = |cause| {
            let error = Error::new(ErrorKind::Io, "the system refuses to start a thread");
            error.because(cause)
        };
        let listen = move || listen(draw, &heard, done);
        thread::Builder::new().spawn_scoped(scope, listen).map_err(refused)?;
        // Gone at the end of this closure, by a panic too, which ends the thread.
        let watch = Telling { events, done, cancelled };
        run(&watch).inspect(|_| watch.tell(Event::Done(done.load(Ordering::Relaxed))))
    })
}

/// Draws until nobody is left to say anything.
fn listen(draw: &mut dyn Draw, heard: &Receiver<Event>, done: &AtomicU64) {
    loop {
        match heard.recv_timeout(draw.every()) {
            Ok(Event::Phase { done, name, total }) => {
                draw.end(done);
                draw.begin(name, total);
            }
            Ok(Event::Warning(message)) => draw.warn(&message),
            Ok(Event::Chosen(values)) => draw.chose(&values),
            Ok(Event::Done(done)) => draw.end(done),
            Err(RecvTimeoutError::Timeout) => draw.advance(done.load(Ordering::Relaxed)),
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;

    /// What was drawn, a line each, by which thread.
    #[derive(Default)]
    struct Listed(String, Option<thread::ThreadId>);

    impl Listed {
        fn line(&mut self, line: std::fmt::Arguments<'_>) {
            assert_eq!(*self.1.get_or_insert(thread::current().id()), thread::current().id());
            writeln!(self.0, "{line}").unwrap();
        }
    }

    impl Draw for Listed {
        fn every(&self) -> Duration {
            Duration::from_millis(1)
        }
        fn begin(&mut self, name: &'static str, total: Option<u64>) {
            self.line(format_args!("begin {name} {total:?}"));
        }
        fn end(&mut self, done: u64) {
            self.line(format_args!("end {done}"));
        }
        fn warn(&mut self, message: &str) {
            self.line(format_args!("warn {message}"));
        }
    }

    /// A run of two phases on several threads, which says more than may wait at once.
    fn work(watch: &dyn Watch) {
        watch.phase("decode", Some(600));
        thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| (0..100).for_each(|_| watch.advance(2)));
            }
        });
        (0..2 * WAITING).for_each(|n| watch.warn(&n.to_string()));
        watch.phase("merge", None);
        watch.advance(7);
    }

    #[test]
    fn all_that_a_run_says_is_drawn_in_order_by_one_thread_when_it_returns() {
        let mut listed = Listed::default();
        watched(&mut listed, &|| false, |watch| {
            work(watch);
            Ok(())
        })
        .unwrap();
        let warnings: String = (0..2 * WAITING).map(|n| format!("warn {n}\n")).collect();
        let phases = ["end 0\nbegin decode Some(600)\n", "end 600\nbegin merge None\nend 7\n"];
        assert_eq!(listed.0, format!("{}{warnings}{}", phases[0], phases[1]));
        assert_ne!(listed.1, Some(thread::current().id()));
    }

    #[test]
    fn the_open_phase_of_a_run_that_fails_is_not_told_to_be_over() {
        let mut listed = Listed::default();
        let failed = watched(&mut listed, &|| true, |watch| {
            work(watch);
            if watch.cancelled() { Err(Error::interrupted()) } else { Ok(()) }
        });
        assert_eq!(failed.unwrap_err().kind(), ErrorKind::Interrupted);
        assert!(listed.0.ends_with("begin merge None\n"), "{}", listed.0);
    }
}
