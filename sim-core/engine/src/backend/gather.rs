//! Fields out of a block: what a frame shows of a world, in the order of its row.

use sim_physics::arrays::{Field, Flat, Source, Workspace};
use sim_physics::constants::Constants;
use sim_physics::lane::{Cx, Num};
use sim_physics::math::spatial::Spatial;
use sim_physics::step::tree::generalized;
use sim_physics::step::{BlockOf, ConstantsOf};

/// Gathers a field that is neither of contacts nor a counter, one number per element.
#[inline(always)]
pub(super) fn gather<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    field: Field,
    to: &mut [C::F],
) {
    let w = &b.work;
    match field.row().source {
        Source::Array(array) => match b.array(array) {
            Flat::Cells(cells) => copy_cells(cx, cells, to),
            Flat::Values(values) => to.copy_from_slice(values),
        },
        _ => match field {
            Field::MassMatrix => mass_matrix(m, w, to),
            Field::Qpos => qpos(cx, m, b, to),
            Field::Qvel => generalized::velocities(cx, m, b, to),
            Field::Qacc => generalized::accelerations(cx, m, b, to),
            Field::QfrcActuator => joint_forces(m, w, &w.qfrc_actuator, to),
            Field::QfrcPassive => joint_forces(m, w, &w.passive_force, to),
            Field::QfrcBias => generalized::bias(cx, m, b, to),
            Field::QfrcConstraint => {
                copy_cells(cx, &b.constraint_force, to);
                generalized::turn_forces(m, w, to);
            }
            Field::BodyJacobian => body_jacobian(m, w, to),
            Field::SiteInverseJacobian => inverse_jacobian(m, w, to),
            Field::EfcJ => jacobian(cx, m, &b.efc_weight, [&w.limit_side, &w.row_jacobian], to),
            _ => unreachable!("`{}` is not gathered", field.row().name),
        },
    }
}

#[inline(always)]
fn copy_cells<C: Cx>(cx: &C, cells: &[C::V], to: &mut [C::F]) {
    assert_eq!(cells.len(), to.len());
    for (x, cell) in to.iter_mut().zip(cells) {
        *x = cx.get(cell);
    }
}

/// Positions with the scalar part of quaternions first.
#[inline(always)]
fn qpos<C: Cx>(cx: &C, m: &ConstantsOf<C>, b: &BlockOf<C>, to: &mut [C::F]) {
    copy_cells(cx, &b.joint_q, to);
    for first in m.quaternions() {
        to[first..first + 4].rotate_right(1);
    }
}

/// Forces of dofs as MuJoCo has them; an array without entries is 0.
#[inline(always)]
fn joint_forces<F: Num>(m: &Constants<F::Real>, w: &Workspace<F>, from: &[F], to: &mut [F]) {
    if from.is_empty() {
        to.fill(F::c(0.0));
    } else {
        to.copy_from_slice(from);
        generalized::turn_forces(m, w, to);
    }
}

/// The joint-space inertia in full, `(dofs, dofs)`.
#[inline(always)]
fn mass_matrix<F: Num>(m: &Constants<F::Real>, w: &Workspace<F>, to: &mut [F]) {
    let dofs = m.dofs.len();
    for i in 0..dofs {
        for j in 0..dofs {
            to[i * dofs + j] = match m.pattern.find(i, j) {
                Some(place) => w.mass_matrix[place],
                None => F::c(0.0),
            };
        }
    }
}

/// Link Jacobians in full, `(bodies, 6, dofs)`: the motion of each dof on the path to the root, at the link's centre of mass.
#[inline(always)]
fn body_jacobian<F: Num>(m: &Constants<F::Real>, w: &Workspace<F>, to: &mut [F]) {
    let dofs = m.dofs.len();
    to.fill(F::c(0.0));
    for (k, frame) in m.frames.iter().enumerate() {
        let rows = &mut to[k * 6 * dofs..(k + 1) * 6 * dofs];
        let mut next = frame.body;
        while let Some(b) = next {
            for d in m.bodies[b].dofs() {
                let Spatial([linear, angular]) = w.motion[d];
                let moved = angular.cross_add(w.link_center[k], linear);
                for i in 0..3 {
                    rows[i * dofs + d] = moved[i];
                    rows[(3 + i) * dofs + d] = angular[i];
                }
            }
            next = m.bodies[b].parent;
        }
    }
}

/// Inverse Jacobians of the sites in full, `(sites, dofs, 6)`.
#[inline(always)]
fn inverse_jacobian<F: Num>(m: &Constants<F::Real>, w: &Workspace<F>, to: &mut [F]) {
    let dofs = m.dofs.len();
    to.fill(F::c(0.0));
    let mut rows = w.site_inverse.iter();
    for (k, site) in m.sites.iter().enumerate() {
        for (column, row) in site.columns.iter().zip(rows.by_ref()) {
            let at = 6 * (k * dofs + column.dof);
            to[at..at + 6].copy_from_slice(row);
        }
    }
}

/// The constraint Jacobian in full, `(rows, dofs)`.
#[inline(always)]
fn jacobian<C: Cx>(
    cx: &C,
    m: &ConstantsOf<C>,
    weight: &[C::V],
    [side, ties]: [&[C::F]; 2],
    to: &mut [C::F],
) {
    let (dofs, zero, one) = (m.dofs.len(), C::F::c(0.0), C::F::c(1.0));
    to.fill(zero);
    let mut row = 0;
    for e in &m.equalities {
        to[row * dofs + e.follower] = one;
        to[row * dofs + e.leader] = -C::F::k(e.multiplier);
        row += 1;
    }
    for f in &m.frictions {
        to[row * dofs + f.dof] = one;
        row += 1;
    }
    for (l, side) in m.limits.iter().zip(side) {
        to[row * dofs + l.dof] = C::F::select(zero.lt(cx.get(&weight[row])), *side, zero);
        row += 1;
    }
    for tie in &m.ties {
        for tie_row in 0..tie.rows {
            let active = zero.lt(cx.get(&weight[row]));
            for (entry, &dof) in ties[tie.jacobian(tie_row)].iter().zip(&tie.dofs) {
                to[row * dofs + dof] = C::F::select(active, *entry, zero);
            }
            row += 1;
        }
    }
}
