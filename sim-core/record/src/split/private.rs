//! Private variables: they are read only where they were set. Their value before an iteration does not matter, so they need not cross
//! from one iteration to the next.
//!
//! Physics code sets such a variable under a mask, adds to it in loops, and reads it under the same mask. The other worlds keep an old
//! value, which nothing reads. The solver's coupled system is of this kind.

use super::items::{Item, Piece};
use crate::ir::tree::{Op, Operand, Statement};
use crate::ir::uses::{Use, of_op, of_statement};
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// The variables of each piece that are its own in this sense.
pub(super) fn private(pieces: &[Piece], values: &[Op]) -> Vec<BTreeSet<u32>> {
    let mut mentions: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
    for (p, piece) in pieces.iter().enumerate() {
        for item in &piece.items {
            let Item::Run(statement) = item else { continue };
            of_statement(statement, values, &mut |used| match used {
                Use::Read(name) | Use::Change(name) => {
                    mentions.entry(name).or_default().insert(p);
                }
                // where it starts before its loop does not matter
                _ => {}
            });
        }
    }
    let mut private_names = vec![BTreeSet::new(); pieces.len()];
    for (name, of) in mentions {
        let mut of = of.into_iter();
        if let (Some(p), None) = (of.next(), of.next())
            && !pieces[p].regions.is_empty()
            && is_private(name, &pieces[p], values)
        {
            private_names[p].insert(name);
        }
    }
    private_names
}

fn is_private(name: u32, piece: &Piece, values: &[Op]) -> bool {
    let mut set_under: Option<Operand> = None;
    for item in &piece.items {
        let Item::Run(statement) = item else { continue };
        let mut named = false;
        of_statement(statement, values, &mut |used| {
            named |= matches!(used, Use::Read(n) | Use::Change(n) | Use::Start(n) if n == name);
        });
        if !named {
            continue;
        }
        let fits = match (statement, set_under) {
            (Statement::When { mask, body }, None) => {
                set_under = Some(*mask);
                starts(name, body, values)
            }
            (Statement::When { mask, .. }, Some(known)) => *mask == known,
            (Statement::Loop { body, .. }, Some(_)) => {
                feeds_itself(name, body, values, &mut HashSet::new())
            }
            _ => false,
        };
        if !fits {
            return false;
        }
    }
    set_under.is_some()
}

/// Is the variable set before anything in a block reads it?
fn starts(name: u32, body: &[Statement], values: &[Op]) -> bool {
    for statement in body {
        if matches!(statement, Statement::Set { name: n, .. } if *n == name) {
            return true;
        }
        let mut named = false;
        of_statement(statement, values, &mut |used| {
            named |= matches!(used, Use::Read(n) | Use::Change(n) | Use::Start(n) if n == name);
        });
        if named {
            return false;
        }
    }
    false
}

/// Does what a variable held reach nothing but itself? `held` are the values made of it.
fn feeds_itself(name: u32, body: &[Statement], values: &[Op], held: &mut HashSet<u32>) -> bool {
    let is_held =
        |x: &Operand, held: &HashSet<u32>| matches!(x, Operand::Value(n) if held.contains(n));
    body.iter().all(|statement| match statement {
        Statement::Let(number) => {
            let mut of_it = false;
            of_op(&values[*number as usize], &mut |used| match used {
                Use::Read(n) => of_it |= n == name,
                Use::Value(n) => of_it |= held.contains(&n),
                _ => {}
            });
            if of_it {
                held.insert(*number);
            }
            true
        }
        Statement::Set { name: to, value } => *to == name || !is_held(value, held),
        Statement::When { mask, body } => {
            !is_held(mask, held) && feeds_itself(name, body, values, held)
        }
        // other statements are not analysed: none of them may name a value of the variable
        other => {
            let mut fits = true;
            of_statement(other, values, &mut |used| match used {
                Use::Value(n) => fits &= !held.contains(&n),
                Use::Read(n) | Use::Change(n) | Use::Start(n) => fits &= n != name,
                Use::Index(_) => {}
            });
            fits
        }
    })
}
