//! Tendons of MuJoCo models by the dofs and bodies of the scene.

use super::carrier::Carrier;
use super::contacts::clusters::path;
use super::output_frames::mounted_on;
use crate::description::{self, OnLink};
use sim_physics::constants::lengths::{Length, Term};
use sim_physics::constants::site::Mount;
use sim_physics::constants::springs::{Plasticity, Tendon};
use sim_physics::constants::tendons::{Inner, Span, SpatialTendon, Wrap};
use sim_physics::constants::{Body, Motion};

/// What the lengths of a robot are made of.
#[derive(Clone, Copy)]
pub(super) struct Lengths<'a> {
    /// The first dof of each joint of the robot.
    pub dof_of: &'a [usize],
    /// All spatial tendons so far.
    pub tendons: &'a [SpatialTendon<f64>],
    /// The first one of the robot.
    pub first_tendon: usize,
}

impl Lengths<'_> {
    /// A length by the dofs of the scene.
    pub fn length(&self, length: &description::Length) -> Length<f64> {
        match length {
            description::Length::Joints(joints) => self.terms(joints).into(),
            description::Length::Spatial(tendon) => Length {
                terms: Vec::new(),
                tendon: Some(self.first_tendon + tendon),
            },
        }
    }

    /// Joints with one dof and their coefficients as dofs, each once.
    pub fn terms(&self, joints: &[(usize, f64)]) -> Vec<Term<f64>> {
        let all = joints.iter().map(|&(joint, coefficient)| Term {
            dof: self.dof_of[joint],
            coefficient,
        });
        all.collect()
    }

    /// The spring and damper of a tendon. Its rests begin at `place` if they are state.
    pub fn spring(&self, tendon: &description::Tendon, place: usize) -> Tendon<f64> {
        Tendon {
            length: self.length(&tendon.length),
            stiffness: tendon.stiffness,
            rest: tendon.rest,
            damping: tendon.damping,
            armature: tendon.armature,
            stiffness_curve: tendon.stiffness_curve,
            damping_curve: tendon.damping_curve,
            plasticity: plasticity(tendon.spring_yield, place),
        }
    }

    /// The dofs that change a length.
    pub fn dofs(&self, length: &Length<f64>) -> Vec<usize> {
        let mut dofs: Vec<usize> = length.terms.iter().map(|term| term.dof).collect();
        dofs.extend(length.tendon.iter().flat_map(|&k| &self.tendons[k].dofs));
        dofs
    }
}

/// How rests follow, from `place` on in the state; none where a spring does not yield.
pub(super) fn plasticity(spring_yield: Option<f64>, place: usize) -> Option<Plasticity<f64>> {
    spring_yield.map(|bound| Plasticity { place, bound })
}

/// Adds the spatial tendons of a robot to those before it.
pub(super) fn add_tendons(
    tendons: &mut Vec<SpatialTendon<f64>>,
    described: &[description::SpatialTendon],
    carriers: &[Carrier],
    bodies: &[Body<f64>],
) {
    for tendon in described {
        let first = tendons
            .last()
            .map_or(0, |last| last.first + last.dofs.len());
        tendons.push(spatial(tendon, carriers, bodies, first));
    }
}

/// A spatial tendon that a step does without.
pub(super) fn idle(
    tendon: &description::SpatialTendon,
    carriers: &[Carrier],
    bodies: &[Body<f64>],
) -> SpatialTendon<f64> {
    spatial(tendon, carriers, bodies, 0)
}

fn spatial(
    tendon: &description::SpatialTendon,
    carriers: &[Carrier],
    bodies: &[Body<f64>],
    first: usize,
) -> SpatialTendon<f64> {
    let spans: Vec<Span<f64>> = tendon.spans.iter().map(|s| span(s, carriers)).collect();
    let mounts = spans.iter().flat_map(mounts);
    let pulled: Vec<Option<usize>> = mounts.map(|mount| mount.body).collect();
    let mut carried: Vec<usize> = pulled.iter().copied().flatten().collect();
    carried.sort_unstable();
    carried.dedup();
    let mut dofs: Vec<usize> = carried
        .iter()
        .flat_map(|&body| path(bodies, body))
        .collect();
    dofs.sort_unstable();
    dofs.dedup();
    let moved_by = |dof: usize| -> Vec<usize> {
        let moved = carried.iter().copied();
        moved
            .filter(|&body| path(bodies, body).contains(&dof))
            .collect()
    };
    // what moves all of it changes nothing
    let is_fixed = pulled.contains(&None);
    dofs.retain(|&dof| is_fixed || moved_by(dof).len() < carried.len());
    let place = |body: usize| dofs.iter().position(|&dof| dof == bodies[body].dof);
    let free = (0..bodies.len()).filter(|&body| bodies[body].motion == Motion::Free);
    SpatialTendon {
        free_bodies: free.filter_map(|body| Some((body, place(body)?))).collect(),
        moved: dofs.iter().map(|&dof| moved_by(dof)).collect(),
        bodies: carried,
        spans,
        dofs,
        first,
    }
}

/// Where a piece pulls.
fn mounts(span: &Span<f64>) -> impl Iterator<Item = &Mount<f64>> {
    let around = span.wrap.as_ref().map(|wrap| &wrap.at);
    [&span.from, &span.to].into_iter().chain(around)
}

fn span(span: &description::Span, carriers: &[Carrier]) -> Span<f64> {
    Span {
        from: mounted_on(carriers, &span.from),
        to: mounted_on(carriers, &span.to),
        share: span.share,
        wrap: span.wrap.as_ref().map(|around| wrap(around, carriers)),
    }
}

fn wrap(wrap: &description::Wrap, carriers: &[Carrier]) -> Wrap<f64> {
    Wrap {
        at: mounted_on(carriers, &wrap.at),
        is_cylinder: wrap.is_cylinder,
        radius: wrap.radius,
        side: wrap.side.as_ref().map(|side| mounted_on(carriers, side)),
        inner: match &wrap.side {
            Some(side) => inner(wrap, side, carriers),
            None => Inner::Never,
        },
    }
}

/// Whether the side site is inside of the shape.
fn inner(wrap: &description::Wrap, side: &OnLink, carriers: &[Carrier]) -> Inner {
    let (at, site) = (&carriers[wrap.at.link], &carriers[side.link]);
    if at.body != site.body || at.tree != site.tree {
        return Inner::Sometimes;
    }
    let shape = at.pose.mul(&wrap.at.pose);
    let [x, y, z] = shape.inverse().transform(site.pose.mul(&side.pose).pos);
    // as in MuJoCo, inside of the sphere of its radius: also where it is a cylinder
    match (x * x + y * y + z * z).sqrt() < wrap.radius {
        true => Inner::Always,
        false => Inner::Never,
    }
}
