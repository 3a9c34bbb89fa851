//! The order of a program's statements: values are computed shortly before their use, so that few of them wait in registers.
//!
//! A driver keeps the order of a long kernel nearly as it is printed, and spills what does not fit. Physics code computes much in one
//! place that is used far below: the code of a stage follows the tree of links, not the life of its values. So the outermost statements
//! are put in a new order, by the greedy rule of Sethi and Ullman's register needs carried over to a graph: of all that has to be done
//! next, do what needs the fewest values that are not there yet, and its larger operands first. What may touch memory, variables or
//! other lanes keeps its order. The values are the same, bit for bit.

use crate::ir::recording::Recording;
use crate::ir::tree::{Op, Operand, Statement};
use crate::ir::uses::{Use, of_statement};
use std::collections::{BTreeSet, HashMap};

impl Recording {
    /// The recording with its outermost statements in an order for few live values. It gives the same bits. `goals` are outputs, by
    /// number, that are written together as soon as all of them are computed; the others wait for the end.
    ///
    /// # Panics
    /// If there is no such output.
    pub fn scheduled(&self, goals: &[Vec<usize>]) -> Recording {
        let graph = Graph::new(self, goals);
        let order = graph.order();
        Recording {
            body: order.iter().map(|k| self.body[*k].clone()).collect(),
            ..self.clone()
        }
    }
}

/// What each outermost statement needs.
struct Graph {
    /// Statements that must stand before each.
    needs: Vec<Vec<usize>>,
    /// All that a statement depends on, and the statement.
    cones: Vec<Set>,
    /// Statements that keep their order.
    effects: Vec<usize>,
    /// Statements that each goal depends on, with all that these need.
    goals: Vec<(Vec<usize>, Set)>,
}

impl Graph {
    fn new(recording: &Recording, goals: &[Vec<usize>]) -> Graph {
        let (body, values) = (&recording.body, &recording.values);
        let computed = |(k, statement): (usize, &Statement)| match statement {
            Statement::Let(number) => Some((*number, k)),
            _ => None,
        };
        let made: HashMap<u32, usize> = body.iter().enumerate().filter_map(computed).collect();
        let mut graph = Graph {
            needs: Vec::with_capacity(body.len()),
            cones: Vec::with_capacity(body.len()),
            effects: Vec::new(),
            goals: Vec::new(),
        };
        let mut started: HashMap<u32, usize> = HashMap::new();
        for (k, statement) in body.iter().enumerate() {
            let mut needs = BTreeSet::new();
            of_statement(statement, values, &mut |used| match used {
                Use::Value(number) => add_need(number, values, &made, &mut needs),
                Use::Read(name) | Use::Change(name) => needs.extend(started.get(&name)),
                Use::Index(_) | Use::Start(_) => {}
            });
            if let Statement::Var { name, .. } | Statement::List { name, .. } = statement {
                started.insert(*name, k);
            }
            if has_effect(statement, values) {
                needs.extend(graph.effects.last());
                graph.effects.push(k);
            }
            // what a block computes inside itself is no need of it
            needs.retain(|need| *need < k);
            let mut cone = graph.union(&needs, body.len());
            cone.insert(k);
            graph.needs.push(needs.into_iter().collect());
            graph.cones.push(cone);
        }
        for goal in goals {
            let mut needs = BTreeSet::new();
            for output in goal {
                if let Operand::Value(number) = recording.outputs[*output] {
                    add_need(number, values, &made, &mut needs);
                }
            }
            let cone = graph.union(&needs, body.len());
            graph.goals.push((needs.into_iter().collect(), cone));
        }
        graph
    }

    fn union(&self, needs: &BTreeSet<usize>, count: usize) -> Set {
        let mut cone = Set::new(count);
        needs.iter().for_each(|need| cone.add(&self.cones[*need]));
        cone
    }

    fn order(&self) -> Vec<usize> {
        let count = self.needs.len();
        let mut order = Order {
            graph: self,
            sizes: self.cones.iter().map(Set::count).collect(),
            done: Set::new(count),
            order: Vec::with_capacity(count),
        };
        let mut effects = self.effects.iter().copied().peekable();
        let mut goals: Vec<usize> = (0..self.goals.len()).collect();
        loop {
            while effects.peek().is_some_and(|k| order.done.has(*k)) {
                effects.next();
            }
            let missing = |goal: &usize| self.goals[*goal].1.count_without(&order.done);
            goals.retain(|goal| missing(goal) > 0);
            let best = goals.iter().copied().min_by_key(missing);
            let effect = effects
                .peek()
                .map(|k| (self.cones[*k].count_without(&order.done), *k));
            match (effect, best) {
                (Some((cost, k)), Some(goal)) if cost <= missing(&goal) => order.emit(&[k]),
                (Some((_, k)), None) => order.emit(&[k]),
                (_, Some(goal)) => order.emit(&self.goals[goal].0),
                (None, None) => break,
            }
        }
        // what only waiting outputs need
        let left: Vec<usize> = (0..count).filter(|k| !order.done.has(*k)).collect();
        left.iter().for_each(|k| order.emit(&[*k]));
        order.order
    }
}

struct Order<'a> {
    graph: &'a Graph,
    /// Size of each statement's cone.
    sizes: Vec<usize>,
    done: Set,
    order: Vec<usize>,
}

impl Order<'_> {
    /// Emits statements after all that they need, depth first, the larger cone first.
    fn emit(&mut self, statements: &[usize]) {
        let mut waiting = Vec::new();
        self.push(&mut waiting, statements);
        while let Some(k) = waiting.pop() {
            if self.done.has(k) {
                continue;
            }
            let needs = &self.graph.needs[k];
            if needs.iter().all(|need| self.done.has(*need)) {
                self.done.insert(k);
                self.order.push(k);
            } else {
                waiting.push(k);
                self.push(&mut waiting, needs);
            }
        }
    }

    /// What is pushed last is emitted first.
    fn push(&self, waiting: &mut Vec<usize>, statements: &[usize]) {
        let begin = waiting.len();
        waiting.extend(statements.iter().filter(|k| !self.done.has(**k)));
        waiting[begin..].sort_by_key(|k| (self.sizes[*k], *k));
    }
}

/// Adds the statement that computes a value. One that is written where it is used may have none: then those of its operands.
fn add_need(number: u32, values: &[Op], made: &HashMap<u32, usize>, needs: &mut BTreeSet<usize>) {
    let op = &values[number as usize];
    if let Some(k) = made.get(&number) {
        needs.insert(*k);
    } else if op.is_inline() {
        op.each_operand(|x| {
            if let Operand::Value(number) = x {
                add_need(number, values, made, needs);
            }
        });
    }
}

/// Does a statement depend on more than values, or change more than one?
fn has_effect(statement: &Statement, values: &[Op]) -> bool {
    match statement {
        Statement::Let(number) => matches!(
            values[*number as usize],
            Op::Get(_)
                | Op::Count(_)
                | Op::Load(_)
                | Op::LoadAt(..)
                | Op::Quad(_)
                | Op::FromLane(..)
                | Op::AcrossLanes(..)
        ),
        // it stands before all that names the variable or the list
        Statement::Var { .. } | Statement::List { .. } => false,
        _ => true,
    }
}

/// A set of statements, a bit for each.
struct Set(Vec<u64>);

impl Set {
    fn new(count: usize) -> Set {
        Set(vec![0; count.div_ceil(64)])
    }

    fn has(&self, k: usize) -> bool {
        self.0[k / 64] >> (k % 64) & 1 == 1
    }

    fn insert(&mut self, k: usize) {
        self.0[k / 64] |= 1 << (k % 64);
    }

    fn add(&mut self, other: &Set) {
        let words = self.0.iter_mut().zip(&other.0);
        words.for_each(|(word, more)| *word |= more);
    }

    fn count(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Members that are not in the other set.
    fn count_without(&self, other: &Set) -> usize {
        let words = self.0.iter().zip(&other.0);
        let new = words.map(|(word, other)| (word & !other).count_ones() as usize);
        new.sum()
    }
}
