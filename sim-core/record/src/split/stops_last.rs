//! Moves a stop to the end of its loop: the few statements behind it become a block before it, and need no kernel of their own.

use crate::ir::recording::Recording;
use crate::ir::tree::{Op, Operand, Statement, Unary};

/// Most statements behind a stop that are moved.
const MOVED_MAX: usize = 40;

/// The recording with such stops moved to the end of their loops.
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
        && (at + 2..at + MOVED_MAX).contains(&body.len())
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
