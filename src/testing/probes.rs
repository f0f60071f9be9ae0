//! Which questions a check asks of a scan, in the order in which their answers tell most: where one
//! promise is broken, others often are, and the first that is asked is named.

use super::answer::Sameness;
use super::bench::{Probe, ProbeKind};
use super::chain::Declared;
use super::promise::Promise;
use super::setup::{Setup, instruction_sets};
use crate::point::names;
use crate::stage::Order;
use crate::synth::Random;

const PLAIN: Setup = Setup::PLAIN;

/// The probes of a scan, chosen by `seed`.
pub(super) fn probes(declared: &Declared, seed: u64) -> Vec<Probe> {
    let mut random = Random::new(seed, 2);
    let mut up_to = |most: usize| 1 + (random.unit() * most as f64) as usize;
    let points = [1, 2, 3, 8, 24][up_to(5) - 1];
    let (threads, parts, batch) = (1 + up_to(3), 1 + up_to(6), up_to(40));
    let part = up_to(100) as f64 / 100.0;
    let tiles = Setup { tile_points: Some(points), ..PLAIN };
    let whole = Setup { whole_rims: true, ..tiles.clone() };
    let mut probes = vec![
        alone(Promise::Answers, PLAIN),
        same(Promise::Time, PLAIN, PLAIN),
        alone(Promise::Ledger, tiles.clone()),
    ];
    if !declared.record_numbers {
        probes.push(same(Promise::Order, PLAIN, Setup { shuffled: Some(seed), ..PLAIN }));
    }
    probes.push(same(Promise::Split, PLAIN, Setup { parts, batch, ..PLAIN }));
    if !declared.whole_records {
        let setup = Setup { altered: Some(seed), ..PLAIN };
        let axes = names::XYZ.map(str::to_owned);
        let kept = Sameness::Dimensions(declared.looked_at.iter().cloned().chain(axes).collect());
        probes.push(Probe { promise: Promise::Reads, kind: ProbeKind::Same(PLAIN, setup, kept) });
    }
    probes.push(same(Promise::Tiles, PLAIN, whole.clone()));
    probes.push(same(Promise::Reach, whole, tiles.clone()));
    if declared.streams {
        for setup in [
            Setup { behind_tiles: true, ..tiles.clone() },
            Setup { order: Order::Input, batch, ..PLAIN },
        ] {
            let kind = ProbeKind::Same(PLAIN, setup, Sameness::Records);
            probes.push(Probe { promise: Promise::Tiles, kind });
        }
    }
    let many = Setup { threads, parts, batch, ..tiles.clone() };
    probes.push(same(Promise::Threads, tiles.clone(), many.clone()));
    probes.extend(
        instruction_sets().map(|simd| same(Promise::Instructions, PLAIN, Setup { simd, ..PLAIN })),
    );
    probes.push(same(Promise::Budget, PLAIN, Setup { is_tight: true, ..tiles }));
    let setup = Setup { is_tight: seed.is_multiple_of(2), ..many };
    probes.push(Probe { promise: Promise::Stops, kind: ProbeKind::Stopped(setup, part) });
    probes
}

fn alone(promise: Promise, setup: Setup) -> Probe {
    Probe { promise, kind: ProbeKind::Alone(setup) }
}

fn same(promise: Promise, a: Setup, b: Setup) -> Probe {
    Probe { promise, kind: ProbeKind::Same(a, b, Sameness::Everything) }
}
