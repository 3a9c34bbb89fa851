//! Live ranges of values and variables, and the cheapest cuts between statements for them.

use super::cost::Cost;
use super::items::{Item, Piece, bases, cost_of, uses_of};
use super::order::Limits;
use crate::ir::recording::Recording;
use crate::ir::tree::{Operand, Statement};
use crate::ir::uses::{Use, computed};
use crate::passes::lanes;
use std::ops::Range;

/// Live ranges, in the order of all items.
pub(super) struct LiveRanges<'a> {
    recording: &'a Recording,
    runs: &'a [Piece],
    /// Index of each run's first item.
    first: Vec<usize>,
    /// The item that computes a value, and the last one that uses it.
    made: Vec<usize>,
    last: Vec<usize>,
    /// The items that name a variable or a list, in order.
    named: Vec<Vec<Named>>,
    /// Items behind which there is no cut: a value that differs between the lanes of a world is still used.
    is_joined: Vec<bool>,
}

/// An item names a variable or a list.
#[derive(Clone, Copy)]
struct Named {
    at: usize,
    /// Does what it was before not matter?
    starts: bool,
    changes: bool,
}

/// What the choice of cuts needs of an item.
struct ItemSummary {
    cost: Cost,
    /// Do the lanes of a world share its work?
    is_wide: bool,
    /// Values that it uses, and those that it computes for later ones.
    uses: Vec<u32>,
    lasting: Vec<u32>,
    names: Vec<(u32, Named)>,
}

const NEVER: usize = usize::MAX;

/// Everything that an item names.
fn names_of(item: &Item, at: usize, recording: &Recording) -> Vec<(u32, Named)> {
    let assigns = matches!(item, Item::Run(Statement::Set { .. }));
    let mut names: Vec<(u32, Named)> = Vec::new();
    uses_of(item, &recording.values, &mut |used| {
        let (name, starts, changes) = match used {
            Use::Read(name) => (name, false, false),
            Use::Change(name) => (name, assigns, true),
            Use::Start(name) => (name, true, true),
            Use::Value(_) | Use::Index(_) => return,
        };
        match names.iter_mut().find(|(other, _)| *other == name) {
            Some((_, named)) => named.changes |= changes,
            None => names.push((
                name,
                Named {
                    at,
                    starts,
                    changes,
                },
            )),
        }
    });
    names
}

impl<'a> LiveRanges<'a> {
    pub(super) fn new(recording: &'a Recording, runs: &'a [Piece]) -> LiveRanges<'a> {
        let values = &recording.values;
        let mut ranges = LiveRanges {
            recording,
            runs,
            first: Vec::new(),
            made: vec![0; values.len()],
            last: vec![0; values.len()],
            named: vec![Vec::new(); recording.names],
            is_joined: Vec::new(),
        };
        let mut at = 1;
        for run in runs {
            ranges.first.push(at);
            for item in &run.items {
                if let Item::Run(statement) = item {
                    computed(std::slice::from_ref(statement), &mut |number| {
                        ranges.made[number as usize] = at;
                    });
                }
                let last = &mut ranges.last;
                uses_of(item, values, &mut |used| {
                    if let Use::Value(number) = used {
                        bases(number, values, &mut |base| last[base as usize] = at);
                    }
                });
                for (name, named) in names_of(item, at, recording) {
                    ranges.named[name as usize].push(named);
                }
                at += 1;
            }
        }
        for x in &recording.outputs {
            if let Operand::Value(number) = x {
                let last = &mut ranges.last;
                bases(*number, values, &mut |base| last[base as usize] = NEVER);
            }
        }
        ranges.is_joined = vec![false; at];
        let (varying, names) = lanes::varying(recording);
        for name in names {
            let named = &ranges.named[name as usize];
            if let (Some(first), Some(last)) = (named.first(), named.last()) {
                ranges.is_joined[first.at..last.at].fill(true);
            }
        }
        for (x, varies) in varying.into_iter().enumerate() {
            if varies && ranges.last[x] != NEVER {
                let lived = ranges.made[x]..ranges.last[x].max(ranges.made[x]);
                ranges.is_joined[lived].fill(true);
            }
        }
        ranges
    }

    /// Is a variable or a list used after an item of a run, before it starts anew?
    fn is_used_after(&self, name: u32, at: usize, run: &Piece) -> bool {
        let named = &self.named[name as usize];
        match named.get(named.partition_point(|n| n.at <= at)) {
            Some(next) => !next.starts,
            // perhaps in the next iteration
            None => !run.regions.is_empty() && named.iter().any(|n| !n.starts),
        }
    }

    fn summary(&self, item: &Item, at: usize) -> ItemSummary {
        let values = &self.recording.values;
        let (mut uses, mut lasting) = (Vec::new(), Vec::new());
        // entering or leaving a region writes a scalar
        let mut cost = Cost::WRITTEN_QUAD;
        if let Item::Run(statement) = item {
            cost = cost_of(statement, values);
            computed(std::slice::from_ref(statement), &mut |x| {
                if self.last[x as usize] > at {
                    lasting.push(x);
                }
            });
        }
        uses_of(item, values, &mut |used| {
            if let Use::Value(x) = used {
                bases(x, values, &mut |base| uses.push(base));
            }
        });
        uses.sort_unstable();
        uses.dedup();
        ItemSummary {
            cost,
            is_wide: self.recording.lanes > 1 && item.needs_lanes(values),
            uses,
            lasting,
            names: names_of(item, at, self.recording),
        }
    }

    /// The cheapest cuts of a run into pieces within limits, each of which costs `price` beside its statements.
    pub(super) fn partition(&self, run: usize, limits: &Limits, price: usize) -> Vec<Range<usize>> {
        let (most, prices) = (limits.kernel, &limits.prices);
        let (first, run) = (self.first[run], &self.runs[run]);
        let n = run.items.len();
        if n == 0 {
            return std::iter::once(0..0).collect();
        }
        let items = run.items.iter().zip(first..);
        let summaries: Vec<ItemSummary> = items.map(|(item, at)| self.summary(item, at)).collect();
        // cheapest[j]: of the first j items, with where the last of their pieces starts
        let mut cheapest = vec![(usize::MAX, 0); n + 1];
        cheapest[0].0 = 0;
        let mut is_read = vec![NEVER; self.recording.values.len()];
        // the piece that met a name last; whether it changed it; whether it is used after the piece
        let mut met = vec![(NEVER, false, false); self.recording.names];
        for i in 0..n {
            let mut body = Cost::default();
            // what every lane of a world computes again, if any work is shared: it takes no longer while threads are few, and as many
            // times as there are lanes once they fill the device
            let (mut alike, mut is_wide) = (Cost::default(), false);
            let (mut reads, mut lasting, mut kept) = (0, 0, 0);
            for (j, item) in summaries.iter().enumerate().skip(i) {
                let at = first + j;
                body += item.cost;
                is_wide |= item.is_wide;
                if !item.is_wide {
                    alike += item.cost;
                }
                for x in &item.uses {
                    let x = *x as usize;
                    if self.made[x] < first + i {
                        reads += usize::from(is_read[x] != i);
                        is_read[x] = i;
                    } else if self.last[x] == at && self.made[x] < at {
                        lasting -= 1;
                    }
                }
                lasting += item.lasting.len();
                for (name, named) in &item.names {
                    let met = &mut met[*name as usize];
                    if met.0 != i {
                        *met = (i, false, false);
                        reads += usize::from(!named.starts);
                    }
                    kept -= usize::from(met.2);
                    met.1 |= named.changes;
                    met.2 = met.1 && self.is_used_after(*name, at, run);
                    kept += usize::from(met.2);
                }
                let given = body + Cost::read(reads);
                let left = Cost::written(lasting + kept);
                if given.of_kernel(prices) > most && j > i && !self.is_joined[at - 1] {
                    break;
                }
                let size = (given + left).of_kernel(prices);
                let again = if is_wide { alike.total(prices) / 2 } else { 0 };
                let cost = cheapest[i].0.saturating_add(size + again + price);
                let fits = size <= most || j == i || self.is_joined[at - 1];
                if fits && !self.is_joined[at] && cost < cheapest[j + 1].0 {
                    cheapest[j + 1] = (cost, i);
                }
            }
        }
        assert!(
            cheapest[n].0 < usize::MAX,
            "values of lanes stay inside a run"
        );
        let mut ranges = Vec::new();
        let mut end = n;
        while end > 0 {
            let start = cheapest[end].1;
            ranges.push(start..end);
            end = start;
        }
        ranges.reverse();
        ranges
    }
}
