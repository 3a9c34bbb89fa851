//! Pairs of convex pieces as table rows: what the narrow phase and the contact constraints read of each pair.

use super::super::constraint_rows::{IMPEDANCE, contact_damping};
use super::clusters::Cluster;
use super::pieces::{Piece, PlacedShape, Rules, geom_of, named_pair, overriding};
use crate::description::Description;
use crate::geom_contact::GeomContact;
use crate::softness::Softness;
use crate::surface::Surface;
use sim_physics::constants::contact::{Cone, Contacts, Kind, MU_MIN, Pair, WEIGHT_MIN, pair, skew};
use sim_physics::constants::{Constants, Impedance};
use sim_physics::lane::Fixed;

/// What the tables of contacts are built from.
pub(super) struct ContactBuilder<'a> {
    pub constants: &'a Constants<f64>,
    pub scene: &'a Description,
    pub shapes: &'a [PlacedShape<'a>],
    pub pieces: &'a [Piece],
    pub rules: &'a Rules<'a>,
    pub clusters: Vec<Cluster>,
}

/// The two sides of a pair: bodies, and whether the first side is the pair's second shape.
pub(super) struct Sides {
    pub first: Option<usize>,
    pub second: usize,
    pub flipped: bool,
}

impl ContactBuilder<'_> {
    pub(super) fn body(&self, piece: usize) -> Option<usize> {
        self.pieces[piece].solid.body
    }

    pub(super) fn cluster(&self, body: usize) -> usize {
        self.clusters
            .iter()
            .position(|cluster| cluster.bodies.contains(&body))
            .expect("every body with a shape is in a cluster")
    }

    /// A static shape is the first side. Of two bodies, the earlier one is.
    pub(super) fn sides(&self, (a, b): (usize, usize)) -> Sides {
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

    pub(super) fn numbers(
        &self,
        (a, b): (usize, usize),
        sides: &Sides,
        columns: &[(usize, bool)],
        row: &mut [f64],
    ) {
        let (a, b) = (&self.pieces[a], &self.pieces[b]);
        let (x, y) = (&self.shapes[a.shape], &self.shapes[b.shape]);
        let (s, t) = (&x.surface, &y.surface);
        let geom = self.geom_pair(x, y);
        let (margin, gap) = match &geom {
            Some(geom) => (geom.margin, geom.gap),
            None => (s.margin + t.margin, s.gap + t.gap),
        };
        let reach = margin + gap;
        row[pair::REACH] = reach;
        row[pair::RADIUS] = a.radius + b.radius + reach;
        row[pair::RADIUS_A] = a.radius + reach;
        row[pair::RADIUS_B] = b.radius + reach;
        row[pair::SMALLER] = match a.solid.kind {
            Kind::Plane | Kind::Field => b.radius,
            _ => a.radius.min(b.radius),
        };
        row[pair::SIZE_A..][..3].copy_from_slice(&a.size);
        row[pair::SIZE_B..][..3].copy_from_slice(&b.size);
        row[pair::FLIP] = if sides.flipped { -1.0 } else { 1.0 };
        row[pair::MARGIN] = margin;
        let mu = geom.as_ref().map_or(
            self.scene.friction_combine.coefficient(s.mu, t.mu),
            |geom| geom.friction[0],
        );
        row[pair::MU] = mu.max(MU_MIN);
        let condim = geom
            .as_ref()
            .map_or(s.condim.max(t.condim), |geom| geom.condim);
        row[pair::RUBS] = if condim == 1 { 0.0 } else { 1.0 };
        row[pair::ROWS] = rows_of(self.scene.solver.cone, condim) as f64;
        let weight = |shape: &PlacedShape<'_>| {
            shape
                .link
                .map_or(0.0, |link| self.rules.link_inverse_weight[link])
        };
        let weight = (weight(x) + weight(y)).max(WEIGHT_MIN);
        row[pair::WEIGHT] = weight;
        for (c, &(dof, _)) in columns.iter().enumerate() {
            let moves = |body: usize| f64::from(u8::from(self.moves(dof, body)));
            let lever = moves(sides.second) - sides.first.map_or(0.0, moves);
            row[pair::LEVERS + c] = lever;
        }
        if let Some(geom) = geom {
            let is_safe = self.has_safe_references();
            let (stiffness, damping) = geom.softness.reference(self.scene.dt, is_safe);
            row[pair::STIFFNESS] = stiffness;
            row[pair::DAMPING] = damping;
            let named = named_pair(x, y, self.rules).filter(|_| !self.is_overridden(x, y));
            let sliding = named.and_then(|pair| pair.sliding);
            let sliding = sliding.map(|solref| Softness {
                solref,
                ..geom.softness
            });
            let sliding = sliding.map(|softness| softness.reference(self.scene.dt, is_safe).1);
            row[pair::SLIDING] = sliding.unwrap_or(damping);
            return;
        }
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
    }

    /// Whether time constants of MuJoCo's geoms are at least two steps.
    pub(super) fn has_safe_references(&self) -> bool {
        let mut models = self.rules.precompiled.iter().flatten();
        models.all(|parts| parts.safe_references)
    }

    /// What the contact of two shapes is like where one of them is a geom of MuJoCo's.
    pub(super) fn geom_pair(
        &self,
        x: &PlacedShape<'_>,
        y: &PlacedShape<'_>,
    ) -> Option<GeomContact> {
        let contact = match named_pair(x, y, self.rules) {
            Some(pair) => pair.contact,
            None if x.geom.is_some() || y.geom.is_some() => geom_of(x).combined(&geom_of(y)),
            None => return None,
        };
        Some(match overriding(x, y, self.rules) {
            Some(by) => contact.overridden(by),
            None => contact,
        })
    }

    /// Whether the contacts of two geoms have none of their own parameters.
    pub(super) fn is_overridden(&self, x: &PlacedShape<'_>, y: &PlacedShape<'_>) -> bool {
        overriding(x, y, self.rules).is_some()
    }

    /// Torsional and rolling friction of a pair over its sliding friction.
    pub(super) fn turning(&self, (a, b): (usize, usize)) -> [f64; 2] {
        let [x, y] = [a, b].map(|piece| &self.shapes[self.pieces[piece].shape]);
        let Some(geom) = self.geom_pair(x, y) else {
            return [0.0; 2];
        };
        let [slide, twist, roll] = geom.friction.map(|mu| mu.max(MU_MIN));
        match geom.condim {
            6 => [twist / slide, roll / slide],
            4 => [twist / slide, 0.0],
            _ => [0.0; 2],
        }
    }

    /// Notes how friction differs between the tangents, if it does in any pair.
    pub(super) fn add_skew(&self, contacts: &mut Contacts<f64>, pairs: &[(usize, usize)]) {
        let skews: Vec<_> = pairs.iter().map(|&pair| self.skew(pair)).collect();
        if skews.iter().all(|skew| *skew == [1.0; skew::COLUMNS]) {
            return;
        }
        contacts.skew = Fixed {
            base: contacts.tables.numbers.len(),
            stride: skew::COLUMNS,
            rows: pairs.len(),
        };
        contacts.tables.numbers.extend(skews.as_flattened());
    }

    /// How the friction of a pair differs between the tangents, by the columns of its table.
    pub(super) fn skew(&self, (a, b): (usize, usize)) -> [f64; skew::COLUMNS] {
        let [x, y] = [a, b].map(|piece| &self.shapes[self.pieces[piece].shape]);
        let of_model = overriding(x, y, self.rules).map(|by| by.second);
        let of_pair = named_pair(x, y, self.rules).map(|pair| pair.second);
        let (Some([second, about_second]), Some(contact)) =
            (of_model.or(of_pair), self.geom_pair(x, y))
        else {
            return [1.0; skew::COLUMNS];
        };
        // friction over friction, as MuJoCo bounds both
        let over = |second: f64, first: f64| second.max(MU_MIN) / first.max(MU_MIN);
        let [first, _, about_first] = contact.friction;
        let slide = match contact.condim {
            1 => 1.0,
            _ => over(second, first),
        };
        let roll = match contact.condim {
            6 => over(about_second, about_first),
            _ => 1.0,
        };
        [slide, roll / slide]
    }

    /// The impedance of a pair's contacts.
    pub(super) fn impedance(&self, (a, b): (usize, usize)) -> Impedance<f64> {
        let [x, y] = [a, b].map(|piece| &self.shapes[self.pieces[piece].shape]);
        self.geom_pair(x, y)
            .map_or(IMPEDANCE, |geom| geom.softness.impedance())
    }

    /// Whether a dof moves a body.
    pub(super) fn moves(&self, dof: usize, body: usize) -> bool {
        let mut next = Some(body);
        while let Some(b) = next {
            if self.constants.bodies[b].dofs().contains(&dof) {
                return true;
            }
            next = self.constants.bodies[b].parent;
        }
        false
    }

    pub(super) fn indices(
        &self,
        (a, b): (usize, usize),
        sides: &Sides,
        class: usize,
        row: &mut [u32],
    ) {
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

    pub(super) fn names(&self, (a, b): (usize, usize), sides: &Sides, class: usize) -> Pair {
        let (a, b) = match sides.flipped {
            false => (a, b),
            true => (b, a),
        };
        let shape = |piece: usize| &self.shapes[self.pieces[piece].shape];
        Pair {
            shapes: [shape(a).number, shape(b).number],
            links: [shape(a).link, shape(b).link],
            class,
        }
    }
}

/// Constraint rows of a contact.
pub(super) fn rows_of(cone: Cone, condim: usize) -> usize {
    match (cone, condim) {
        (_, 1) => 1,
        (Cone::Elliptic, dimensions) => dimensions,
        (Cone::Pyramidal, dimensions) => 2 * (dimensions - 1),
    }
}
