//! Models whose solver loops over a system in memory, since the code of its factor would make kernels too long.

use crate::backend::BackendError;
use sim_physics::constants::Constants;
use sim_physics::constants::rolled::RolledSystem;
use sim_physics::lane::Real;
use sim_physics::math::factor::Pattern;
use sim_physics::step::solver::is_spread;
use std::borrow::Cow;

/// Longest kernel for hardware [instructions]: a driver takes minutes for more. Only a loop can be so long, since it is not cut inside.
pub(super) const LONGEST: usize = 60_000;

/// Most products of a factor whose code is unrolled: about those of a full matrix of 50 dofs. A driver's compiler takes seconds for it,
/// and minutes for three times as much.
const PRODUCTS_MAX: usize = 20_000;

/// The pattern of the system with all contacts.
fn pattern<R: Real>(m: &Constants<R>) -> &Pattern {
    match m.contacts.couples() {
        true => &m.coupled.pattern,
        false => &m.pattern,
    }
}

/// Can contacts join so many dofs that code without loops over them is too long?
pub(in crate::backend::gpu) fn is_large(m: &Constants<f64>) -> bool {
    let pattern = pattern(m);
    let of_row = |row| (0..row).filter(|column| pattern.has(row, *column)).count();
    let counts = (0..m.dofs.len()).map(of_row);
    let products: usize = counts.map(|n| n * (n + 1) / 2).sum();
    !m.contacts.groups.is_empty() && products > PRODUCTS_MAX
}

/// Rounds of loops in a program, after which Mesa's software driver leaves them (`LP_MAX_TGSI_LOOP_ITERATIONS` in its sources).
const SOFTWARE_ROUNDS: usize = 65_535;

/// Refuses systems whose loops Mesa's software driver would leave before their end, which nothing tells.
pub(in crate::backend::gpu) fn check_software(m: &Constants<f32>) -> Result<(), BackendError> {
    if m.contacts.rolled.is_none() {
        return Ok(());
    }
    let pattern = pattern(m);
    let dofs = m.dofs.len();
    // a program may have the loops over contacts, one for each class, and those that eliminate and substitute, over half of a part each
    let parts: usize = pattern.parts().map(|part| part.len() * part.len()).sum();
    let rounds = dofs * (4 + m.contacts.classes.len() + m.contacts.contacts_max) + parts;
    match rounds <= SOFTWARE_ROUNDS {
        true => Ok(()),
        false => Err(BackendError::Program {
            reason: format!(
                "loops over its {dofs} dofs have up to {rounds} rounds, and Mesa's software driver leaves loops after {SOFTWARE_ROUNDS}"
            ),
        }),
    }
}

/// The constants with tables for loops, in a large model whose system does not fit the registers of so many threads of a world. The
/// evaluation has one thread per world: it needs the tables wherever it solves.
pub(in crate::backend::gpu) fn rolled(
    m: Cow<'_, Constants<f64>>,
    threads: usize,
    evaluation_solves: bool,
) -> Cow<'_, Constants<f64>> {
    // torsional friction has no spread system
    let turns = m.contacts.classes.iter().any(|class| class.turns.is_some());
    let is_shared = is_spread(threads, m.dofs.len()) && !turns && !evaluation_solves;
    // unrolled sums over contacts of all trees are long, too
    let mixes = m.contacts.classes.iter().any(|class| class.mixes);
    if is_shared || !(mixes || is_large(&m)) {
        return m;
    }
    let mut m = m.into_owned();
    RolledSystem::add_to(&mut m);
    Cow::Owned(m)
}
