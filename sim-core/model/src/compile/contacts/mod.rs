//! Contacts of a scene: pairs of shapes, sorted into classes whose contacts depend on the same dofs.

pub(super) mod clusters;
mod fields;
mod memory;
mod pairs;
pub(super) mod pieces;
mod reference;
pub(super) mod sensors;
mod surface_extras;
mod varying;

use crate::description::Description;
use crate::error::ModelError;
use clusters::clusters;
use fields::add_fields;
use pairs::ContactBuilder;
use pieces::{PlacedShape, Rules, contacts_of, pairs, pieces};
use sensors::add_touched_bodies;
use sim_physics::constants::contact::{
    Class, Column, Cone, Contacts, FrictionCombine, Kind, Pair, PairImpedances, Run,
    VaryingSurfaces, pair, row, rule, skew,
};
use sim_physics::constants::pair_groups::Group;
use sim_physics::constants::params::Param;
use sim_physics::constants::{Constants, Coupled, Impedance};
use sim_physics::lane::Fixed;
use sim_physics::math::factor::{Pattern, UpdatePath};
use sim_physics::step::constraints::contact_rows::{EDGES_MAX, edge_stiffness};
use std::collections::{BTreeMap, BTreeSet};

/// Stiffness of a contact over the mass of what it moves, above which single precision may lose that mass in their sum [–]. Levers
/// make the entries of a matrix ten times as stiff, so this is a tenth of what the solver allows there.
const STIFFNESS_MAX: f64 = 3e4;

/// Finds the pairs and sorts them into classes.
pub(super) fn add_contacts(
    constants: &mut Constants<f64>,
    scene: &Description,
    shapes: &[PlacedShape<'_>],
    rules: &Rules<'_>,
) -> Result<(), ModelError> {
    let mut contacts = Contacts::none(scene.solver.cone, scene.solver.impratio);
    let pieces = pieces(scene, shapes, &mut contacts);
    let filtered = scene.filtered_pairs()?;
    let mut pairs = pairs(shapes, &pieces, rules, &filtered)?;
    // by kind, then in scene order
    pairs.sort_by_key(|&(a, b)| (pieces[a].solid.kind, pieces[b].solid.kind, a, b));
    if pairs.is_empty() {
        constants.contacts = contacts;
        return Ok(());
    }
    let varies = |param| scene.params.contains(&param);
    let pairs_vary = varies(Param::PairFriction) && rules.pairs().next().is_some();
    contacts.varying = VaryingSurfaces {
        mu: varies(Param::ShapeMu) || pairs_vary,
        turning: varies(Param::ShapeMuTorsional) || varies(Param::ShapeMuRolling) || pairs_vary,
        weight: varies(Param::BodyInvweight0),
        softness: varies(Param::ShapeSolref) || varies(Param::ShapeSolimp),
        pairs: pairs_vary,
    };
    let builder = ContactBuilder {
        constants,
        scene,
        shapes,
        pieces: &pieces,
        rules,
        clusters: clusters(constants, shapes.iter().filter_map(|shape| shape.body)),
    };
    let coupled = builder.fill(&mut contacts, &pairs);
    let numbers = contacts.handles.pair_numbers;
    let reaches: Vec<f64> = (0..pairs.len())
        .map(|p| contacts.tables.numbers[numbers.base + p * numbers.stride + pair::REACH])
        .collect();
    let names = scene.shape_names();
    add_fields(
        &mut contacts,
        shapes,
        &pieces,
        &pairs,
        |p| reaches[p],
        &names,
    )?;
    builder.add_impedances(&mut contacts, &pairs);
    contacts.solids = pieces.iter().map(|piece| piece.solid.clone()).collect();
    constants.coupled = coupled;
    constants.contacts = contacts;
    add_touched_bodies(constants);
    Ok(())
}

impl ContactBuilder<'_> {
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
        let mu: Vec<f64> = (0..pairs.len())
            .map(|p| numbers[p * stride + pair::MU])
            .collect();
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
        let is_wide = self.add_turning(contacts, pairs);
        contacts.varying.turning &= is_wide;
        // a backend that knows only the largest size of each class must provide this many rows
        let [first_end, capacity_end] = contacts.row_ends();
        let rows = first_end + capacity_end - 2;
        self.lay_out(contacts, numbers, indices, stride, widest, rows);
        let ratios: Vec<[f64; 2]> = pairs.iter().map(|&pair| self.turning(pair)).collect();
        if is_wide {
            contacts.turning = Fixed {
                base: contacts.tables.numbers.len(),
                stride: 2,
                rows: pairs.len(),
            };
            contacts.tables.numbers.extend(ratios.as_flattened());
        }
        self.add_skew(contacts, pairs);
        self.add_combine(contacts, pairs);
        self.add_mixing(contacts, pairs);
        self.add_named_pairs(contacts, pairs);
        self.add_surface_velocities(contacts, pairs);
        self.add_adhesion(contacts, pairs);
        contacts.two_point_capsule_boxes = pairs.iter().any(|&pair| self.is_capsule_box_geom(pair));
        contacts.are_stiff = self.are_stiff(pairs, &mu);
        let coupled = self.coupled(contacts);
        for class in &mut contacts.classes {
            let pattern = match class.couples {
                true => &coupled.pattern,
                false => &self.constants.pattern,
            };
            let columns = &class.columns;
            for (row, entries) in columns.iter().zip(&mut class.entries) {
                let place = |column: usize| (column, pattern.at(row.dof, columns[column].dof));
                *entries = Run::from_columns(entries.iter().flat_map(Run::columns).map(place));
            }
            if contacts.are_stiff {
                let dofs: Vec<usize> = columns.iter().map(|column| column.dof).collect();
                class.update_path = UpdatePath::new(pattern, &dofs);
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

    /// Whether some contact may be [`STIFFNESS_MAX`] times as stiff as its bodies are heavy; `mu` are the coefficients of friction.
    fn are_stiff(&self, pairs: &[(usize, usize)], mu: &[f64]) -> bool {
        let impratio = self.scene.solver.impratio;
        let varies = |param| self.scene.params.contains(&param);
        // an impedance that varies may come near 1
        if varies(Param::ShapeSolimp) {
            return true;
        }
        let varies = varies(Param::ShapeMu) || varies(Param::PairFriction);
        pairs.iter().zip(mu).any(|(&pair, &mu)| {
            let impedance = self.impedance(pair);
            let d = impedance.d_min.max(impedance.d_max);
            // D is d / (1 - d) over the inverse weight of the bodies; friction is impratio times as stiff, and a pyramid has four edges
            let ratio = match self.scene.solver.cone {
                Cone::Elliptic => impratio,
                Cone::Pyramidal if varies => 4.0 * EDGES_MAX,
                Cone::Pyramidal => 4.0 * edge_stiffness(impratio, mu).min(EDGES_MAX),
            };
            // and a longer tangent is stiffer by its square
            let longest = self.skew(pair)[skew::SLIDE].max(1.0);
            d / (1.0 - d) * ratio * longest * longest > STIFFNESS_MAX
        })
    }

    /// Gives pairs their impedances, unless all have that of the scene.
    fn add_impedances(&self, contacts: &mut Contacts<f64>, pairs: &[(usize, usize)]) {
        let mut impedances: Vec<Impedance<f64>> = Vec::new();
        let mut of_pairs = Vec::new();
        for &pair in pairs {
            let impedance = self.impedance(pair);
            let place = impedances.iter().position(|known| *known == impedance);
            of_pairs.push(place.unwrap_or(impedances.len()));
            if place.is_none() {
                impedances.push(impedance);
            }
        }
        if impedances == [self.constants.contact_impedance] {
            return;
        }
        let of_class = |class| {
            let placed_pairs = contacts.pairs.iter().zip(&of_pairs);
            let placed_pairs = placed_pairs.filter(|(pair, _)| pair.class == class);
            let places: BTreeSet<usize> = placed_pairs.map(|(_, &place)| place).collect();
            places.into_iter().collect()
        };
        let of_classes = (0..contacts.classes.len()).map(of_class).collect();
        let of_pair = Fixed {
            base: contacts.tables.numbers.len(),
            stride: 1,
            rows: pairs.len(),
        };
        let places = of_pairs.iter().map(|&place| place as f64);
        contacts.tables.numbers.extend(places);
        contacts.impedances = PairImpedances {
            all: impedances,
            of_pair,
            of_classes,
        };
    }

    /// Gives classes that have torsional friction a second block of rows. Returns whether there is any.
    fn add_turning(&self, contacts: &mut Contacts<f64>, pairs: &[(usize, usize)]) -> bool {
        for (pair, &of) in contacts.pairs.iter().zip(pairs) {
            if self.turning(of)[0] > 0.0 {
                let class = &mut contacts.classes[pair.class];
                class.turns = Some(row::JACOBIAN + 3 * class.columns.len());
            }
        }
        contacts.classes.iter().any(|class| class.turns.is_some())
    }

    /// Notes how friction combines, and of each pair whose friction counts where it varies.
    fn add_combine(&self, contacts: &mut Contacts<f64>, pairs: &[(usize, usize)]) {
        contacts.combine = self.scene.friction_combine;
        let mut rules: Vec<f64> = pairs.iter().map(|&pair| self.friction_rule(pair)).collect();
        let varies = contacts.varying.mu || contacts.varying.turning;
        contacts.has_rules = varies && rules.iter().any(|&rule| rule > rule::LARGER);
        if !contacts.has_rules {
            rules
                .iter_mut()
                .for_each(|rule| *rule = rule.min(rule::LARGER));
            if contacts.combine == FrictionCombine::Max || !rules.contains(&rule::LARGER) {
                return;
            }
        }
        contacts.keeps_max = Fixed {
            base: contacts.tables.numbers.len(),
            stride: 1,
            rows: pairs.len(),
        };
        contacts.tables.numbers.extend(rules);
    }

    /// Whether a pair is of a capsule and a box, one of which is a geom of MuJoCo's.
    fn is_capsule_box_geom(&self, (a, b): (usize, usize)) -> bool {
        let [a, b] = [a, b].map(|piece| &self.pieces[piece]);
        let [x, y] = [a, b].map(|piece| &self.shapes[piece.shape]);
        (a.solid.kind, b.solid.kind) == (Kind::Capsule, Kind::Box) && self.geom_pair(x, y).is_some()
    }

    fn bound(&self, (a, b): (usize, usize)) -> usize {
        contacts_of((self.pieces[a].solid.kind, self.pieces[b].solid.kind))
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
                    couples |= !self.constants.pattern.has(row, column);
                }
            }
        }
        let part = |&(dof, _): &(usize, bool)| self.constants.pattern.part_of(dof);
        let parts: BTreeSet<usize> = columns.iter().map(part).collect();
        let trees = (
            first.map(|first| self.clusters[first].tree),
            self.clusters[second].tree,
        );
        Class {
            trees,
            mixes: false,
            columns: columns
                .iter()
                .enumerate()
                .map(|(c, &(dof, is_first))| Column {
                    dof,
                    is_first,
                    tree: trees.0.filter(|_| is_first).unwrap_or(trees.1),
                    lever: pair::LEVERS + c,
                })
                .collect(),
            runs: Run::from_columns(columns.iter().enumerate().map(|(c, &(dof, _))| (c, dof))),
            entries,
            couples,
            // as the places of entries
            update_path: UpdatePath::default(),
            parts: parts.into_iter().collect(),
            shared,
            first: 0,
            capacity: 0,
            turns: None,
        }
    }

    /// The mass matrix's pattern with the couplings of contacts; empty if it has them all.
    fn coupled(&self, contacts: &Contacts<f64>) -> Coupled {
        if !contacts.couples() {
            return Coupled::default();
        }
        let pattern = &self.constants.pattern;
        let n = self.constants.dofs.len();
        let lower_entries = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let lower_entries: Vec<_> = lower_entries
            .filter(|&(i, j)| pattern.find(i, j).is_some())
            .collect();
        let more = contacts.classes.iter().flat_map(|class| {
            let dof = |c: usize| class.columns[c].dof;
            let pairs = class.entries.iter().enumerate();
            pairs.flat_map(move |(c, entries)| {
                let others = entries.iter().flat_map(Run::columns);
                others.map(move |other| (dof(c), dof(other)))
            })
        });
        let coupled = Pattern::new(n, lower_entries.iter().copied().chain(more));
        let mut places = vec![0; pattern.len()];
        for &(i, j) in &lower_entries {
            places[pattern.at(i, j)] = coupled.at(i, j);
        }
        Coupled {
            pattern: coupled,
            places,
        }
    }
}
