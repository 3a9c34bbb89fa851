//! How shapes touch: the numbers of pairs, and the classes of their contacts.

use super::ModelError;
use super::description::Description;
use super::pairs::{Borne, Piece, Rules, contacts_of, pairs, pieces};
use super::paths::{Cluster, clusters};
use super::rows::{IMPEDANCE, contact_damping};
use super::surface::Surface;
use sim_physics::constants::clip::Cut;
use sim_physics::constants::contact::Cone;
use sim_physics::constants::contact::{
    COUNTS, Class, Column, Contacts, Group, Handles, Kind, MU_MIN, Memory, Pair, Run, pair, row,
};
use sim_physics::constants::params::Param;
use sim_physics::constants::{Constants, Coupled};
use sim_physics::lane::{Fixed, Table};
use sim_physics::math::factor::Pattern;
use std::collections::{BTreeMap, BTreeSet};

/// Finds the pairs and sorts them into classes.
pub(super) fn add_contacts(
    constants: &mut Constants<f64>,
    scene: &Description,
    borne: &[Borne<'_>],
    rules: &Rules<'_>,
) -> Result<(), ModelError> {
    let mut contacts = Contacts::none(scene.solver.cone, scene.solver.impratio);
    let pieces = pieces(borne, &mut contacts);
    let filtered = scene.filtered_pairs()?;
    let mut pairs = pairs(borne, &pieces, rules, &filtered);
    // by kinds, then in the order of the scene
    pairs.sort_by_key(|&(a, b)| (pieces[a].solid.kind, pieces[b].solid.kind, a, b));
    if pairs.is_empty() {
        constants.contacts = contacts;
        return Ok(());
    }
    let builder = Builder {
        constants,
        scene,
        borne,
        pieces: &pieces,
        rules,
        clusters: clusters(constants, borne.iter().filter_map(|b| b.body)),
    };
    let coupled = builder.fill(&mut contacts, &pairs);
    contacts.solids = pieces.iter().map(|piece| piece.solid.clone()).collect();
    constants.coupled = coupled;
    constants.contacts = contacts;
    Ok(())
}

struct Builder<'a> {
    constants: &'a Constants<f64>,
    scene: &'a Description,
    borne: &'a [Borne<'a>],
    pieces: &'a [Piece],
    rules: &'a Rules<'a>,
    clusters: Vec<Cluster>,
}

/// The two sides of a pair: bodies, and whether the first side is the pair's second shape.
struct Sides {
    first: Option<usize>,
    second: usize,
    flipped: bool,
}

impl Builder<'_> {
    fn body(&self, piece: usize) -> Option<usize> {
        self.pieces[piece].solid.body
    }

    fn cluster(&self, body: usize) -> usize {
        self.clusters
            .iter()
            .position(|cluster| cluster.bodies.contains(&body))
            .expect("every body that bears a shape is in a cluster")
    }

    /// What stands still is on the first side; of two that move, the earlier body.
    fn sides(&self, (a, b): (usize, usize)) -> Sides {
        match (self.body(a), self.body(b)) {
            (first, Some(second)) if first.is_none_or(|first| first < second) => Sides {
                first,
                second,
                flipped: false,
            },
            (Some(second), first) => Sides {
                first,
                second,
                flipped: true,
            },
            _ => unreachable!("two shapes that stand still are no pair"),
        }
    }

    fn fill(&self, contacts: &mut Contacts<f64>, pairs: &[(usize, usize)]) -> Coupled {
        let mut members: BTreeMap<(Option<usize>, usize), Vec<usize>> = BTreeMap::new();
        for (p, &pair) in pairs.iter().enumerate() {
            let sides = self.sides(pair);
            let key = (
                sides.first.map(|body| self.cluster(body)),
                self.cluster(sides.second),
            );
            members.entry(key).or_default().push(p);
        }
        let keys: Vec<_> = members.keys().copied().collect();
        let columns: Vec<Vec<(usize, bool)>> = keys.iter().map(|&key| self.columns(key)).collect();
        let widest = columns.iter().map(Vec::len).max().unwrap_or(0);
        let stride = pair::LEVERS + widest;
        let mut numbers = vec![0.0; pairs.len() * stride];
        let mut indices = vec![0; pairs.len() * pair::INDICES];
        contacts.pairs = vec![
            Pair {
                shapes: [0; 2],
                links: [None; 2],
                class: 0
            };
            pairs.len()
        ];
        for (k, members) in members.values().enumerate() {
            for &p in members {
                let sides = self.sides(pairs[p]);
                let row = &mut numbers[p * stride..(p + 1) * stride];
                self.numbers(pairs[p], &sides, &columns[k], row);
                let row = &mut indices[p * pair::INDICES..(p + 1) * pair::INDICES];
                self.indices(pairs[p], &sides, k, row);
                contacts.pairs[p] = self.names(pairs[p], &sides, k);
            }
        }
        contacts.groups = self.groups(pairs);
        let bounds: Vec<usize> = members
            .values()
            .map(|members| members.iter().map(|&p| self.bound(pairs[p])).sum())
            .collect();
        self.capacities(contacts, &bounds);
        let mut first = 0;
        for (k, members) in members.values().enumerate() {
            let class = self.class(&columns[k], members, &numbers, stride, keys[k]);
            let capacity = bounds[k].min(contacts.contacts_max);
            contacts.classes.push(Class {
                first,
                capacity,
                ..class
            });
            first += capacity;
        }
        // as many rows as a machine must reckon with that knows only how large classes are at most
        let [first_end, capacity_end] = contacts.row_ends();
        let rows = first_end + capacity_end - 2;
        self.lay_out(contacts, numbers, indices, stride, widest, rows);
        let coupled = self.coupled(contacts);
        for class in &mut contacts.classes {
            let pattern = match class.couples {
                true => &coupled.pattern,
                false => &self.constants.pattern,
            };
            let columns = &class.columns;
            for (row, entries) in columns.iter().zip(&mut class.entries) {
                let place = |column: usize| (column, pattern.at(row.dof, columns[column].dof));
                *entries = Run::of(entries.iter().flat_map(Run::columns).map(place));
            }
        }
        coupled
    }

    /// Dofs of a class, rising, and whether they are of the first side's tree.
    fn columns(&self, (first, second): (Option<usize>, usize)) -> Vec<(usize, bool)> {
        let second = &self.clusters[second];
        let mut columns: Vec<(usize, bool)> = second.dofs.iter().map(|&d| (d, false)).collect();
        if let Some(first) = first.map(|first| &self.clusters[first]) {
            let is_first = first.tree != second.tree;
            let more = first.dofs.iter().filter(|d| !second.dofs.contains(d));
            columns.extend(more.map(|&d| (d, is_first)));
        }
        columns.sort_unstable();
        columns
    }

    fn bound(&self, (a, b): (usize, usize)) -> usize {
        contacts_of((self.pieces[a].solid.kind, self.pieces[b].solid.kind))
    }

    fn numbers(
        &self,
        (a, b): (usize, usize),
        sides: &Sides,
        columns: &[(usize, bool)],
        row: &mut [f64],
    ) {
        let (a, b) = (&self.pieces[a], &self.pieces[b]);
        let (x, y) = (&self.borne[a.borne], &self.borne[b.borne]);
        let (s, t) = (&x.surface, &y.surface);
        let margin = s.margin + t.margin;
        let reach = margin + s.gap + t.gap;
        row[pair::REACH] = reach;
        row[pair::RADIUS] = a.radius + b.radius + reach;
        row[pair::RADIUS_A] = a.radius + reach;
        row[pair::RADIUS_B] = b.radius + reach;
        row[pair::SMALLER] = match a.solid.kind {
            Kind::Plane => b.radius,
            _ => a.radius.min(b.radius),
        };
        row[pair::SIZE_A..][..3].copy_from_slice(&a.size);
        row[pair::SIZE_B..][..3].copy_from_slice(&b.size);
        row[pair::FLIP] = if sides.flipped { -1.0 } else { 1.0 };
        row[pair::MARGIN] = margin;
        row[pair::MU] = s.mu.max(t.mu).max(MU_MIN);
        let condim = s.condim.max(t.condim);
        row[pair::RUBS] = if condim == 1 { 0.0 } else { 1.0 };
        row[pair::ROWS] = rows_of(self.scene.solver.cone, condim) as f64;
        let weight = |borne: &Borne<'_>| {
            borne
                .link
                .map_or(0.0, |link| self.rules.link_inverse_weight[link])
        };
        let weight = weight(x) + weight(y);
        row[pair::WEIGHT] = weight;
        // MuJoCo mixes the parameters of two geoms half and half
        let mean = |f: fn(&Surface) -> f64| 0.5 * (f(s) + f(t));
        let time_constant = mean(|s| 2.0 / s.kd).max(2.0 * self.scene.dt);
        let damping_ratio = mean(|s| 0.5 * s.kd / s.ke.sqrt());
        let natural = time_constant * damping_ratio * IMPEDANCE.d_max;
        row[pair::STIFFNESS] = 1.0 / (natural * natural);
        row[pair::DAMPING] = 2.0 / (IMPEDANCE.d_max * time_constant);
        row[pair::SLIDING] = contact_damping(
            mean(|s| s.kf),
            weight,
            self.scene.solver.impratio,
            self.scene.dt,
        );
        for (c, &(dof, _)) in columns.iter().enumerate() {
            let moves = |body: usize| f64::from(u8::from(self.moves(dof, body)));
            let lever = moves(sides.second) - sides.first.map_or(0.0, moves);
            row[pair::LEVERS + c] = lever;
        }
    }

    /// Does a dof move a body?
    fn moves(&self, dof: usize, body: usize) -> bool {
        let mut next = Some(body);
        while let Some(b) = next {
            if self.constants.bodies[b].dofs().contains(&dof) {
                return true;
            }
            next = self.constants.bodies[b].parent;
        }
        false
    }

    fn indices(&self, (a, b): (usize, usize), sides: &Sides, class: usize, row: &mut [u32]) {
        let world = self.constants.trees.len();
        let origin = |piece: usize| {
            self.body(piece)
                .map_or(world, |body| self.constants.bodies[body].tree)
        };
        let second = self.constants.bodies[sides.second].tree;
        for (place, value) in [
            (pair::SOLID_A, a),
            (pair::SOLID_B, b),
            (pair::ORIGIN_A, origin(a)),
            (pair::ORIGIN_B, origin(b)),
            (pair::ORIGIN, second),
            (pair::CLASS, class),
            (pair::HULL_A, self.pieces[a].hull),
            (pair::HULL_B, self.pieces[b].hull),
        ] {
            row[place] = u32::try_from(value).expect("scenes have fewer shapes than that");
        }
    }

    fn names(&self, (a, b): (usize, usize), sides: &Sides, class: usize) -> Pair {
        let (a, b) = match sides.flipped {
            false => (a, b),
            true => (b, a),
        };
        let borne = |piece: usize| &self.borne[self.pieces[piece].borne];
        Pair {
            shapes: [borne(a).number, borne(b).number],
            links: [borne(a).link, borne(b).link],
            class,
        }
    }

    fn groups(&self, pairs: &[(usize, usize)]) -> Vec<Group> {
        let mut groups: Vec<Group> = Vec::new();
        for (p, &(a, b)) in pairs.iter().enumerate() {
            let kinds = (self.pieces[a].solid.kind, self.pieces[b].solid.kind);
            match groups.last_mut() {
                Some(group) if group.kinds == kinds => group.end = p + 1,
                _ => groups.push(Group {
                    kinds,
                    first: p,
                    end: p + 1,
                }),
            }
        }
        groups
    }

    fn capacities(&self, contacts: &mut Contacts<f64>, bounds: &[usize]) {
        let most: usize = bounds.iter().sum();
        let of_a_contact = rows_of(self.scene.solver.cone, 3);
        contacts.contacts_max = self
            .scene
            .contacts_max
            .unwrap_or(most.min(DEFAULT_CONTACTS_MAX));
        let enough = contacts.contacts_max * of_a_contact;
        contacts.rows_max = self.scene.rows_max.unwrap_or(enough);
        contacts.may_overflow =
            contacts.contacts_max < most || contacts.rows_max < most * of_a_contact;
    }

    fn class(
        &self,
        columns: &[(usize, bool)],
        members: &[usize],
        numbers: &[f64],
        stride: usize,
        (first, second): (Option<usize>, usize),
    ) -> Class<f64> {
        let number = |p: usize, k: usize| numbers[p * stride + k];
        let shared = (0..pair::LEVERS + columns.len())
            .map(|k| {
                let x = number(members[0], k);
                members
                    .iter()
                    .all(|&p| number(p, k).to_bits() == x.to_bits())
                    .then_some(x)
            })
            .collect();
        let mut entries = vec![Vec::new(); columns.len()];
        let mut couples = false;
        for (c, &(row, _)) in columns.iter().enumerate() {
            for (o, &(column, _)) in columns[..=c].iter().enumerate() {
                let both = |&p: &usize| {
                    number(p, pair::LEVERS + c) != 0.0 && number(p, pair::LEVERS + o) != 0.0
                };
                if members.iter().any(both) {
                    // the place is known when all classes are
                    entries[c].push(Run {
                        column: o,
                        place: 0,
                        len: 1,
                    });
                    couples |= self.constants.pattern.find(row, column).is_none();
                }
            }
        }
        let part = |&(dof, _): &(usize, bool)| self.constants.pattern.part_of(dof);
        let parts: BTreeSet<usize> = columns.iter().map(part).collect();
        Class {
            trees: (
                first.map(|first| self.clusters[first].tree),
                self.clusters[second].tree,
            ),
            columns: columns
                .iter()
                .enumerate()
                .map(|(c, &(dof, is_first))| Column {
                    dof,
                    is_first,
                    lever: pair::LEVERS + c,
                })
                .collect(),
            runs: Run::of(columns.iter().enumerate().map(|(c, &(dof, _))| (c, dof))),
            entries,
            couples,
            parts: parts.into_iter().collect(),
            shared,
            first: 0,
            capacity: 0,
        }
    }

    fn lay_out(
        &self,
        contacts: &mut Contacts<f64>,
        numbers: Vec<f64>,
        indices: Vec<u32>,
        stride: usize,
        widest: usize,
        rows: usize,
    ) {
        let pairs = contacts.pairs.len();
        let tables = &mut contacts.tables;
        let fixed = |base, stride, rows| Fixed { base, stride, rows };
        let pair_numbers = fixed(tables.numbers.len(), stride, pairs);
        tables.numbers.extend(numbers);
        let pair_indices = fixed(tables.indices.len(), pair::INDICES, pairs);
        tables.indices.extend(indices);
        let class_rows = fixed(tables.indices.len(), 2, contacts.classes.len());
        for class in &contacts.classes {
            let index = |x: usize| u32::try_from(x).expect("capacities are small");
            tables
                .indices
                .extend([index(class.first), index(class.capacity)]);
        }
        contacts.handles = Handles {
            pair_numbers,
            pair_indices,
            class_rows,
        };
        let is_cylinder = |piece: &&Piece| piece.solid.kind == Kind::Cylinder;
        let cylinders = self.pieces.iter().filter(is_cylinder).count();
        let mut len = 0;
        // bases and strides of four: a GPU then reads and writes four numbers at a time
        let mut table = |stride: usize, rows: usize| {
            let stride = if stride == 1 {
                1
            } else {
                stride.next_multiple_of(4)
            };
            let base = len;
            len += (stride * rows).next_multiple_of(4);
            Table { base, stride, rows }
        };
        contacts.memory = Memory {
            poses: table(12, self.pieces.len()),
            origins: table(3, self.constants.trees.len() + 1),
            counts: table(1, contacts.classes.len() + COUNTS),
            rows: table(row::JACOBIAN + 3 * widest, rows),
            mu: match self.scene.params.contains(&Param::ShapeMu) {
                true => table(1, self.pieces.len()),
                false => contacts.memory.mu,
            },
            cut: match contacts.hulls.spans.rows + cylinders {
                0 => contacts.memory.cut,
                _ => Cut {
                    corners: table(Cut::CORNERS[1], Cut::CORNERS[0]),
                    candidates: table(Cut::CANDIDATES[1], Cut::CANDIDATES[0]),
                    edges: table(Cut::EDGES[1], Cut::EDGES[0]),
                },
            },
            len: 0,
        };
        contacts.memory.len = len;
    }

    /// The mass matrix's pattern with the couplings of contacts; empty if it has them all.
    fn coupled(&self, contacts: &Contacts<f64>) -> Coupled {
        if !contacts.couples() {
            return Coupled::default();
        }
        let pattern = &self.constants.pattern;
        let n = self.constants.dofs.len();
        let own = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let own: Vec<_> = own.filter(|&(i, j)| pattern.find(i, j).is_some()).collect();
        let more = contacts.classes.iter().flat_map(|class| {
            let dof = |c: usize| class.columns[c].dof;
            let pairs = class.entries.iter().enumerate();
            pairs.flat_map(move |(c, entries)| {
                let others = entries.iter().flat_map(Run::columns);
                others.map(move |other| (dof(c), dof(other)))
            })
        });
        let coupled = Pattern::new(n, own.iter().copied().chain(more));
        let mut places = vec![0; pattern.len()];
        for &(i, j) in &own {
            places[pattern.at(i, j)] = coupled.at(i, j);
        }
        Coupled {
            pattern: coupled,
            places,
        }
    }
}

/// Contacts that there is room for by default, where more could be found: a hundred shapes in a heap.
const DEFAULT_CONTACTS_MAX: usize = 512;

/// Constraint rows of a contact.
fn rows_of(cone: Cone, condim: usize) -> usize {
    match (cone, condim) {
        (_, 1) => 1,
        (Cone::Elliptic, dimensions) => dimensions,
        (Cone::Pyramidal, dimensions) => 2 * (dimensions - 1),
    }
}
