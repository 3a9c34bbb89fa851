//! Loops that are left at their end: what little stands behind the last stop becomes a block before it, so that it needs no kernel of its own.

use crate::Recording;
use crate::tree::{Op, Operand, Statement, Unary};

/// Statements that are little [–].
const LITTLE: usize = 40;

/// The same text, with such stops at the end of their loops.
pub(super) fn with_stops_last(recording: &Recording) -> Recording {
    let mut recording = recording.clone();
    move_stops(&mut recording.body, &mut recording.values);
    recording
}

fn move_stops(body: &mut Vec<Statement>, values: &mut Vec<Op>) {
    let stop = body.iter().rposition(|s| matches!(s, Statement::Stop(_)));
    let is_plain = |s: &Statement| matches!(s, Statement::Let(_) | Statement::Set { .. });
    if let Some(at) = stop
        && let Statement::Stop(mask @ Operand::Value(_)) = body[at]
        && (at + 2..at + LITTLE).contains(&body.len())
        && body[at + 1..].iter().all(is_plain)
    {
        let rest = body.split_off(at + 1);
        let stop = body.pop().expect("the stop");
        let stays = values.len() as u32;
        values.push(Op::Unary(Unary::Not, mask));
        body.push(Statement::Let(stays));
        body.push(Statement::When {
            mask: Operand::Value(stays),
            body: rest,
        });
        body.push(stop);
    }
    for statement in body {
        if let Statement::When { body, .. }
        | Statement::Push { body, .. }
        | Statement::Loop { body, .. } = statement
        {
            move_stops(body, values);
        }
    }
}
