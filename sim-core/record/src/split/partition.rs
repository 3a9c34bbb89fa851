//! Partitions a recording into pieces, each of which becomes a kernel.

use super::items::{Item, Piece, Pieces, REGION_FIELDS, Region, bases, cost_of};
use super::live_ranges::LiveRanges;
use super::order::{Limits, Part};
use crate::ir::recording::Recording;
use crate::ir::tree::{Bounds, Op, Row, Statement};
use crate::ir::uses::{Use, computed, of_statement};
use crate::passes::lanes;
use std::collections::HashSet;

pub(super) fn pieces(recording: &Recording, limits: Limits, spare: u32) -> Pieces {
    let mut cutter = Cutter {
        recording,
        limits,
        spare,
        of_lanes: OfLanes::new(recording),
        regions: Vec::new(),
        runs: Vec::new(),
    };
    let mut order = Vec::new();
    let mut last = cutter.level(&recording.body, &[], &mut order);
    if order.is_empty() || !last.items.is_empty() {
        cutter.end_run(&mut last, &mut order);
    } else if let Some(Part::Repeat { .. }) = order.last() {
        // outputs are written outside of all regions
        cutter.end_run(&mut last, &mut order);
    }
    let Cutter { regions, runs, .. } = cutter;
    let ranges = LiveRanges::new(recording, &runs);
    let mut pieces = Vec::new();
    let mut pieces_of_run = Vec::new();
    for (k, run) in runs.iter().enumerate() {
        let from = pieces.len();
        let repeats = run
            .regions
            .iter()
            .any(|region| regions[*region].iterations > 1);
        let price = match repeats {
            true => limits.repeated_dispatch,
            false => limits.dispatch,
        };
        for range in ranges.partition(k, &limits, price) {
            pieces.push(Piece {
                items: run.items[range].to_vec(),
                regions: run.regions.clone(),
            });
        }
        pieces_of_run.push(from..pieces.len());
    }
    Pieces {
        pieces,
        regions,
        order: expanded(&order, &pieces_of_run),
    }
}

/// The order of pieces from that of runs.
fn expanded(order: &[Part], pieces: &[std::ops::Range<usize>]) -> Vec<Part> {
    let part = |part: &Part| match part {
        Part::Kernel(run) => pieces[*run].clone().map(Part::Kernel).collect(),
        Part::Repeat {
            iterations,
            parts,
            exited,
        } => vec![Part::Repeat {
            iterations: *iterations,
            parts: expanded(parts, pieces),
            exited: *exited,
        }],
    };
    order.iter().flat_map(part).collect()
}

struct Cutter<'a> {
    recording: &'a Recording,
    limits: Limits,
    spare: u32,
    of_lanes: OfLanes,
    regions: Vec<Region>,
    /// Statements between cuts that have to be.
    runs: Vec<Piece>,
}

impl Cutter<'_> {
    /// Cuts the statements of a level where it has to be; returns what the last run holds, which may go on.
    fn level(&mut self, body: &[Statement], around: &[usize], order: &mut Vec<Part>) -> Piece {
        let empty = || Piece {
            items: Vec::new(),
            regions: around.to_vec(),
        };
        let mut run = empty();
        for (k, statement) in body.iter().enumerate() {
            let (index, iterations, mask, inside) = match statement {
                // only the innermost region can be a loop here: a stop stands at the level of its loop's body
                Statement::Stop(mask) => {
                    let region = *around.last().expect("a loop is left inside a loop");
                    run.items.push(Item::Leave(region, *mask));
                    // behind it a world has left, but its iterations are still counted
                    if k + 1 < body.len() {
                        self.end_run(&mut run, order);
                    }
                    continue;
                }
                Statement::Loop {
                    index,
                    bounds:
                        Bounds::Span {
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
            let number = self.regions.len();
            self.regions.push(Region { index, iterations });
            run.items.push(Item::Enter(number, mask));
            self.end_run(&mut run, order);
            let around: Vec<usize> = around.iter().copied().chain([number]).collect();
            let mut parts = Vec::new();
            let mut last = self.level(inside, &around, &mut parts);
            if iterations > 1 {
                last.items.push(Item::Next(number));
            }
            if !last.items.is_empty() {
                self.end_run(&mut last, &mut parts);
            }
            let exited = Some(self.spare + number as u32 * REGION_FIELDS);
            order.push(Part::Repeat {
                iterations,
                parts,
                exited,
            });
        }
        run
    }

    /// Ends a run; the next one starts empty.
    fn end_run(&mut self, run: &mut Piece, order: &mut Vec<Part>) {
        let next = Piece {
            items: Vec::new(),
            regions: run.regions.clone(),
        };
        order.push(Part::Kernel(self.runs.len()));
        self.runs.push(std::mem::replace(run, next));
    }

    /// Is a loop or a block cut inside? What differs between the lanes of a world cannot cross from kernel to kernel.
    fn is_cut(&self, statement: &Statement, iterations: usize) -> bool {
        let values = &self.recording.values;
        let most = match iterations {
            1 => self.limits.kernel,
            _ => self.limits.repeated,
        };
        cost_of(statement, values).total(&self.limits.prices) > most
            && !self.of_lanes.are_given(statement, values)
    }
}

/// Values and variables that differ between the lanes of a world.
struct OfLanes {
    values: Vec<bool>,
    names: HashSet<u32>,
}

impl OfLanes {
    fn new(recording: &Recording) -> OfLanes {
        let (values, names) = lanes::varying(recording);
        OfLanes { values, names }
    }

    /// Does a statement use any that it has not made itself?
    fn are_given(&self, statement: &Statement, values: &[Op]) -> bool {
        let (mut made, mut started, mut given) = (HashSet::new(), HashSet::new(), false);
        computed(std::slice::from_ref(statement), &mut |x| {
            made.insert(x);
        });
        of_statement(statement, values, &mut |used| match used {
            Use::Value(number) => bases(number, values, &mut |base| {
                given |= self.values[base as usize] && !made.contains(&base);
            }),
            Use::Start(name) => {
                started.insert(name);
            }
            Use::Read(name) | Use::Change(name) => {
                given |= self.names.contains(&name) && !started.contains(&name);
            }
            Use::Index(_) => {}
        });
        given
    }
}
