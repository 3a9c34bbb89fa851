//! Threads per workgroup, and per world. Measured on an H100; other cards were not.

use super::rolled::is_large;
use sim_device::{AdapterInfo, AdapterKind};
use sim_physics::constants::Constants;
use sim_physics::step::solver::is_spread;
use sim_record::wgsl::Exchange;

/// Threads of a subgroup of most GPUs, and of the software driver's workgroups of physics.
pub(in crate::backend::gpu) const SUBGROUP: u32 = 32;

/// Bookkeeping and output.
pub(in crate::backend::gpu) const BOOKKEEPING: u32 = 64;

/// Kernels of physics need many registers: a workgroup is one subgroup, so that none waits for another and no thread of it idles.
/// A driver that does not tell its subgroups reports at most 128 threads; more than 64 no GPU has.
pub(in crate::backend::gpu) fn physics(info: &AdapterInfo) -> u32 {
    match info.kind {
        AdapterKind::Software => SUBGROUP,
        _ => info.subgroup_max.clamp(SUBGROUP, BOOKKEEPING),
    }
}

/// Threads that share a world where contacts can be: the rows of its contacts, and the columns of its system. With eight, a subgroup of
/// 32 has four worlds, which wait for the slowest of four instead of 32.
const WORLD_THREADS: usize = 8;

/// The least threads of a subgroup: 32 where a driver does not tell.
fn subgroup(info: &AdapterInfo) -> u32 {
    match info.subgroup_max > BOOKKEEPING {
        true => SUBGROUP,
        false => info.subgroup_min,
    }
}

/// The threads of a world on an adapter. The software driver computes on the CPU, and more threads only add work there.
pub(in crate::backend::gpu) fn of_world(info: &AdapterInfo, m: &Constants<f64>) -> usize {
    match info.kind {
        AdapterKind::Software => 1,
        _ if !info.shuffles => 1,
        _ => for_model(m, subgroup(info)),
    }
}

/// The threads of a world where subgroups have at least so many: more of them where eight cannot keep the solver's system in registers. A
/// world stays inside a subgroup. Torsional friction has no system in registers. Loops over a large system take as many threads as there
/// are.
pub(in crate::backend::gpu) fn for_model(m: &Constants<f64>, subgroup: u32) -> usize {
    let numbers = [WORLD_THREADS, 2 * WORLD_THREADS, SUBGROUP as usize];
    let mut fitting = numbers
        .into_iter()
        .filter(|threads| *threads <= subgroup as usize);
    let turns = m.contacts.classes.iter().any(|class| class.turns.is_some());
    let mut shared = fitting
        .clone()
        .filter(|threads| is_spread(*threads, m.dofs.len()));
    let shared = if turns { None } else { shared.next() };
    let usual = match is_large(m) {
        true => fitting.next_back(),
        false => fitting.next(),
    };
    shared.or(usual).unwrap_or(1)
}

/// How so many threads of a world exchange values: by shuffles, where a world stays inside a subgroup.
pub(in crate::backend::gpu) fn exchange(info: &AdapterInfo, threads: usize) -> Exchange {
    match info.shuffles && threads <= subgroup(info) as usize {
        true => Exchange::Subgroup,
        false => Exchange::Workgroup,
    }
}
