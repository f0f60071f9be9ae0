//! Many inputs, each made from one that came to something new.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use super::Target;
use super::harness::Harness;
use super::judge::shape;
use crate::support::random::Random;

/// Longer inputs are cut.
const LONGEST: usize = 128 << 10;
/// Inputs that are kept, at most.
const MOST_KEPT: usize = 4096;
/// Marks that begin with the same words (up to a colon) and count as new, at most: some hold parts of
/// the input after all.
const MOST_ALIKE: usize = 300;
/// Tries to make a finding smaller.
const TRIES: usize = 400;

/// An input that broke a promise.
#[derive(Debug, Clone)]
pub struct Finding {
    pub input: Vec<u8>,
    pub promise: String,
}

/// A target's corpus, and what its inputs came to so far.
pub struct Campaign {
    harness: Harness,
    target: Target,
    random: Random,
    corpus: Vec<Vec<u8>>,
    seeds: usize,
    marks: BTreeSet<String>,
    /// How many marks begin alike.
    alike: BTreeMap<String, usize>,
    /// Inputs taken, and those of them that were accepted.
    pub executions: u64,
    pub accepted: u64,
    /// One for each shape of broken promise.
    pub findings: BTreeMap<String, Finding>,
}

impl Campaign {
    /// Takes the seeds, of which none may break a promise, and `more` inputs to begin with.
    pub fn new(target: Target, most_time: Duration, seed: u64, more: Vec<Vec<u8>>) -> Self {
        let harness = Harness::new(target, most_time);
        let mut corpus = harness.seeds();
        corpus.extend(more);
        let mut campaign = Campaign {
            harness,
            target,
            random: Random(seed),
            seeds: corpus.len(),
            corpus: Vec::new(),
            marks: BTreeSet::new(),
            alike: BTreeMap::new(),
            executions: 0,
            accepted: 0,
            findings: BTreeMap::new(),
        };
        let home = campaign.harness.at_home();
        for input in corpus {
            campaign.take(&input);
            campaign.corpus.push(input);
        }
        drop(home);
        campaign
    }

    /// The target.
    pub fn name(&self) -> &'static str {
        self.target.name
    }

    /// Different outcomes so far.
    pub fn outcomes(&self) -> &BTreeSet<String> {
        &self.marks
    }

    /// Inputs that are kept.
    pub fn kept(&self) -> usize {
        self.corpus.len()
    }

    /// Takes `executions` inputs.
    pub fn run(&mut self, executions: u64) {
        let _home = self.harness.at_home();
        (0..executions).for_each(|_| self.step());
    }

    /// Takes inputs for some time.
    pub fn run_for(&mut self, time: Duration) {
        let _home = self.harness.at_home();
        let start = Instant::now();
        while start.elapsed() < time {
            self.step();
        }
    }

    fn step(&mut self) {
        let mut input = self.parent().clone();
        let other = self.parent_index();
        let rounds = 1 + self.random.below(1 << self.random.clone().below(4));
        for _ in 0..rounds {
            (self.target.mutate)(&mut self.random, &mut input, &self.corpus[other]);
        }
        input.truncate(LONGEST);
        if self.take(&input) {
            if self.corpus.len() < MOST_KEPT {
                self.corpus.push(input);
            } else {
                let at = self.seeds + self.random.below(MOST_KEPT - self.seeds);
                self.corpus[at] = input;
            }
        }
    }

    fn parent(&mut self) -> &Vec<u8> {
        let index = self.parent_index();
        &self.corpus[index]
    }

    /// A seed, one of those kept last, or any.
    fn parent_index(&mut self) -> usize {
        let len = self.corpus.len();
        match self.random.below(4) {
            0 => self.random.below(self.seeds),
            1 => len - 1 - self.random.below(len.div_ceil(4)),
            _ => self.random.below(len),
        }
    }

    /// Enters a mark; true if it is new.
    fn enter(&mut self, mark: String) -> bool {
        let begins = mark.split(':').next().unwrap_or_default();
        if self.marks.contains(&mark) || self.alike.get(begins) >= Some(&MOST_ALIKE) {
            return false;
        }
        *self.alike.entry(begins.to_owned()).or_default() += 1;
        self.marks.insert(mark)
    }

    /// Takes one input; true if it came to something new.
    fn take(&mut self, input: &[u8]) -> bool {
        self.executions += 1;
        match self.harness.judge(input) {
            Ok(outcome) => {
                self.accepted += u64::from(outcome.accepted);
                let mut new = false;
                for mark in outcome.marks {
                    new |= self.enter(mark);
                }
                new
            }
            Err(promise) => {
                let key = shape(&promise);
                if !self.findings.contains_key(&key) {
                    let input = self.smaller(input.to_vec(), &key);
                    self.findings.insert(key, Finding { input, promise });
                }
                false
            }
        }
    }

    /// A smaller input that breaks the same promise.
    fn smaller(&self, mut input: Vec<u8>, key: &str) -> Vec<u8> {
        let breaks = |input: &[u8]| self.harness.judge(input).is_err_and(|p| shape(&p) == key);
        let (mut tries, mut size) = (0, input.len().div_ceil(2));
        while size > 0 && tries < TRIES {
            let mut at = 0;
            while at < input.len() && tries < TRIES {
                let mut shorter = input.clone();
                shorter.drain(at..(at + size).min(input.len()));
                tries += 1;
                if breaks(&shorter) {
                    input = shorter;
                } else {
                    at += size;
                }
            }
            size /= 2;
        }
        input
    }
}
