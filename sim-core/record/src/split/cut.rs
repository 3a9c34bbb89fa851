//! Where a text is cut: into pieces, each of which becomes a kernel.

use super::cost::{self, Cost};
use super::flow::Flow;
use super::uses::{Use, of_op, of_statement};
use super::{Limits, Part};
use crate::Recording;
use crate::tree::{Op, Operand, Rounds, Row, Statement, Unary};

/// A loop or a block that is cut inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// The loop's index and where it starts; none for a block.
    pub index: Option<(u32, usize)>,
    /// How often it runs, at most.
    pub rounds: usize,
}

/// Fields of a frame: is a world out of it, and in which round. Those of the first frame come first.
pub(super) const FRAME: u32 = 4;

/// What a piece does, in order.
#[derive(Clone, Debug)]
pub(super) enum Item {
    Run(Statement),
    /// A world enters a frame; where there is a mask, only if it holds.
    Enter(usize, Option<Operand>),
    /// A world leaves a frame where the mask holds.
    Leave(usize, Operand),
    /// Counts a frame's index.
    Next(usize),
}

/// Statements between two cuts.
#[derive(Clone, Debug, Default)]
pub(super) struct Piece {
    pub items: Vec<Item>,
    /// The frames around it, the outermost first.
    pub frames: Vec<usize>,
}

/// A text in pieces.
pub(super) struct Pieces {
    pub pieces: Vec<Piece>,
    pub frames: Vec<Frame>,
    pub order: Vec<Part>,
}

pub(super) fn pieces(recording: &Recording, limits: Limits, spare: u32) -> Pieces {
    let mut cutter = Cutter {
        recording,
        limits,
        spare,
        frames: Vec::new(),
        runs: Vec::new(),
    };
    let mut order = Vec::new();
    let mut last = cutter.level(&recording.body, &[], &mut order);
    if order.is_empty() || !last.items.is_empty() {
        cutter.end_run(&mut last, &mut order);
    } else if let Some(Part::Repeat { .. }) = order.last() {
        // outputs are written outside of all frames
        cutter.end_run(&mut last, &mut order);
    }
    let Cutter { frames, runs, .. } = cutter;
    let flow = Flow::new(recording, &runs);
    let mut pieces = Vec::new();
    let mut pieces_of_run = Vec::new();
    for (k, run) in runs.iter().enumerate() {
        let from = pieces.len();
        let repeats = run.frames.iter().any(|frame| frames[*frame].rounds > 1);
        let price = if repeats { limits.dispatch } else { 0 };
        for range in flow.cut(k, limits.kernel, price) {
            pieces.push(Piece {
                items: run.items[range].to_vec(),
                frames: run.frames.clone(),
            });
        }
        pieces_of_run.push(from..pieces.len());
    }
    Pieces {
        pieces,
        frames,
        order: expanded(&order, &pieces_of_run),
    }
}

/// The order of pieces from that of runs.
fn expanded(order: &[Part], pieces: &[std::ops::Range<usize>]) -> Vec<Part> {
    let part = |part: &Part| match part {
        Part::Kernel(run) => pieces[*run].clone().map(Part::Kernel).collect(),
        Part::Repeat { rounds, parts, out } => vec![Part::Repeat {
            rounds: *rounds,
            parts: expanded(parts, pieces),
            out: *out,
        }],
    };
    order.iter().flat_map(part).collect()
}

struct Cutter<'a> {
    recording: &'a Recording,
    limits: Limits,
    spare: u32,
    frames: Vec<Frame>,
    /// Statements between cuts that have to be.
    runs: Vec<Piece>,
}

impl Cutter<'_> {
    /// Cuts the statements of a level where it has to be; returns what the last run holds, which may go on.
    fn level(&mut self, body: &[Statement], around: &[usize], order: &mut Vec<Part>) -> Piece {
        let empty = || Piece {
            items: Vec::new(),
            frames: around.to_vec(),
        };
        let mut run = empty();
        for (k, statement) in body.iter().enumerate() {
            let (index, rounds, mask, inside) = match statement {
                // only the innermost frame can be a loop here: a text stops a loop at the level of its body
                Statement::Stop(mask) => {
                    let frame = *around.last().expect("a loop is left inside a loop");
                    run.items.push(Item::Leave(frame, *mask));
                    // behind it a world is out, but for the count of its rounds
                    if k + 1 < body.len() {
                        self.end_run(&mut run, order);
                    }
                    continue;
                }
                Statement::Loop {
                    index,
                    rounds:
                        Rounds::Span {
                            first: Row::At(first),
                            end: Row::At(end),
                        },
                    body,
                } if self.is_cut(statement, end.saturating_sub(*first)) => {
                    let index = Some((*index, *first));
                    (index, end.saturating_sub(*first), None, body)
                }
                Statement::When { mask, body } if self.is_cut(statement, 1) => {
                    (None, 1, Some(*mask), body)
                }
                _ => {
                    run.items.push(Item::Run(statement.clone()));
                    continue;
                }
            };
            let number = self.frames.len();
            self.frames.push(Frame { index, rounds });
            run.items.push(Item::Enter(number, mask));
            self.end_run(&mut run, order);
            let around: Vec<usize> = around.iter().copied().chain([number]).collect();
            let mut parts = Vec::new();
            let mut last = self.level(inside, &around, &mut parts);
            if rounds > 1 {
                last.items.push(Item::Next(number));
            }
            if !last.items.is_empty() {
                self.end_run(&mut last, &mut parts);
            }
            let out = Some(self.spare + number as u32 * FRAME);
            order.push(Part::Repeat { rounds, parts, out });
        }
        run
    }

    /// Ends a run; the next one starts empty.
    fn end_run(&mut self, run: &mut Piece, order: &mut Vec<Part>) {
        let next = Piece {
            items: Vec::new(),
            frames: run.frames.clone(),
        };
        order.push(Part::Kernel(self.runs.len()));
        self.runs.push(std::mem::replace(run, next));
    }

    /// Is a loop or a block cut inside?
    fn is_cut(&self, statement: &Statement, rounds: usize) -> bool {
        let most = match rounds {
            1 => self.limits.kernel,
            _ => self.limits.repeated,
        };
        cost_of(statement, &self.recording.values).total() > most
    }
}

/// Of a statement with what is inside it.
pub(super) fn cost_of(statement: &Statement, values: &[Op]) -> Cost {
    match statement {
        Statement::When { .. } | Statement::Push { .. } | Statement::Loop { .. } => {
            let (body, values) = crate::pack::pack(std::slice::from_ref(statement), values);
            cost::of_packed(&body, &values)
        }
        _ => cost::of_simple(statement, values),
    }
}

/// Is it cheaper to compute a value again than to keep it?
pub(super) fn is_computed_again(op: &Op, values: &[Op]) -> bool {
    let is_given = |x: Operand| match x {
        Operand::Value(number) => matches!(values[number as usize], Op::Input(_)),
        _ => true,
    };
    match op {
        Op::Input(_) | Op::Unary(Unary::Neg | Unary::Not, _) => true,
        Op::Unary(_, x) => is_given(*x),
        Op::Binary(_, a, b) => {
            let inputs = [a, b]
                .iter()
                .filter(|x| matches!(x, Operand::Value(_)))
                .count();
            is_given(*a) && is_given(*b) && inputs == 1
        }
        Op::Constant(entry) | Op::Index { entry, .. } => matches!(entry.row, Row::At(_)),
        _ => false,
    }
}

/// Values that a piece has to be given so that it can have a value: those that are not computed again.
pub(super) fn bases(number: u32, values: &[Op], f: &mut impl FnMut(u32)) {
    let op = &values[number as usize];
    if matches!(op, Op::Input(_)) || !is_computed_again(op, values) {
        return f(number);
    }
    let mut operands = Vec::new();
    of_op(op, &mut |used| {
        if let Use::Value(x) = used {
            operands.push(x);
        }
    });
    operands.iter().for_each(|x| bases(*x, values, f));
}

/// Calls `f` with everything an item names.
pub(super) fn uses_of(item: &Item, values: &[Op], f: &mut impl FnMut(Use)) {
    match item {
        Item::Run(statement) => of_statement(statement, values, f),
        Item::Enter(_, mask) => {
            if let Some(Operand::Value(number)) = mask {
                f(Use::Value(*number));
            }
        }
        Item::Leave(_, mask) => {
            if let Operand::Value(number) = mask {
                f(Use::Value(*number));
            }
        }
        Item::Next(_) => {}
    }
}
