//! Out of a block, into the arena: the one place where lane order becomes world-major.

use super::chunk::Chunk;
use sim_core::batch::{Field, Slot, Workspace};
use sim_core::lane::{Lane, Num};
use sim_core::math::vec3::cross_add;
use sim_core::model::constants::Constants;
use std::ops::Range;

/// The arena of a frame, shared by the threads that write it.
#[derive(Clone, Copy)]
pub struct Arena {
    base: *mut u8,
    bytes: usize,
}

// SAFETY: threads write disjoint rows only (contract of `put` and `export`).
unsafe impl Send for Arena {}
// SAFETY: as above.
unsafe impl Sync for Arena {}

impl Arena {
    pub fn new(words: &mut [u64]) -> Arena {
        Arena {
            base: words.as_mut_ptr().cast(),
            bytes: size_of_val(words),
        }
    }

    /// The elements of a slot that belong to some worlds.
    ///
    /// # Safety
    /// The memory behind the arena lives, and nobody else uses these rows.
    #[inline(always)]
    pub(super) unsafe fn rows<'a, T: Copy>(
        self,
        slot: &Slot,
        worlds: &Range<usize>,
    ) -> &'a mut [T] {
        let elements: usize = slot.shape[1..].iter().product();
        assert!(size_of::<T>() == slot.dtype.bytes() && worlds.end <= slot.shape[0]);
        assert!(slot.offset + slot.bytes <= self.bytes);
        let first = slot.offset + worlds.start * elements * size_of::<T>();
        // SAFETY: inside the arena (asserted), aligned since offsets are multiples of 64 and the base
        // of 8; alive and exclusive by contract.
        unsafe {
            std::slice::from_raw_parts_mut(self.base.add(first).cast(), worlds.len() * elements)
        }
    }

    /// Writes one number a world.
    ///
    /// # Safety
    /// As [`Arena::rows`].
    #[inline(always)]
    pub unsafe fn put<T: Copy>(
        self,
        slot: &Slot,
        worlds: Range<usize>,
        value: impl Fn(usize) -> T,
    ) {
        // SAFETY: by contract.
        let rows = unsafe { self.rows::<T>(slot, &worlds) };
        for (x, world) in rows.iter_mut().zip(worlds) {
            *x = value(world);
        }
    }
}

/// Writes a field of a block, for the worlds of `worlds` (one a lane, from lane 0).
///
/// # Safety
/// As [`Arena::rows`].
#[inline(always)]
pub(super) unsafe fn export<F: Lane>(
    chunk: &mut Chunk<F>,
    m: &Constants<F::Real>,
    slot: &Slot,
    worlds: Range<usize>,
    arena: Arena,
) {
    let n: usize = slot.shape[1..].iter().product();
    stage(chunk, m, slot.field, n);
    // SAFETY: by contract.
    let rows = unsafe { arena.rows::<F::Real>(slot, &worlds) };
    // four numbers at a time where every lane is a world; number by number this took a twelfth of a step
    let mut first = 0;
    if worlds.len() == F::WIDTH {
        for four in chunk.staging[..n].as_chunks().0 {
            F::store_rows(*four, &mut rows[first..], n);
            first += 4;
        }
    }
    let lanes = &mut chunk.lanes[..(n - first) * F::WIDTH];
    for (x, lanes) in chunk.staging[first..n]
        .iter()
        .zip(lanes.chunks_exact_mut(F::WIDTH))
    {
        x.store(lanes);
    }
    for (lane, row) in rows.chunks_exact_mut(n.max(1)).enumerate() {
        for (x, lanes) in row[first..].iter_mut().zip(lanes.chunks_exact(F::WIDTH)) {
            *x = lanes[lane];
        }
    }
}

/// Gathers a field, one register an element.
#[inline(always)]
fn stage<F: Lane>(chunk: &mut Chunk<F>, m: &Constants<F::Real>, field: Field, n: usize) {
    let (b, w, to) = (&chunk.block, &chunk.block.work, &mut chunk.staging[..n]);
    match field {
        Field::JointQ | Field::JointQMeasured => to.copy_from_slice(&b.joint_q),
        Field::JointQd | Field::JointQdMeasured => to.copy_from_slice(&b.joint_qd),
        Field::JointQdd => to.copy_from_slice(&b.joint_qdd),
        Field::JointF => to.copy_from_slice(&b.joint_f),
        Field::JointTargetQ => to.copy_from_slice(&b.joint_target_q),
        Field::JointTargetQd => to.copy_from_slice(&b.joint_target_qd),
        Field::BodyQ => to.copy_from_slice(w.body_q.as_flattened()),
        Field::BodyQd => to.copy_from_slice(w.body_qd.as_flattened().as_flattened()),
        Field::JointTorque => to.copy_from_slice(&w.joint_torque),
        Field::SiteQ => to.copy_from_slice(w.site_q.as_flattened()),
        Field::SiteQd => to.copy_from_slice(w.site_qd.as_flattened().as_flattened()),
        Field::Gyro => to.copy_from_slice(w.gyro.as_flattened()),
        Field::Accelerometer => to.copy_from_slice(w.accelerometer.as_flattened()),
        Field::SiteInverseJacobian => inverse_jacobian(m, w, to),
        Field::BodyJacobian => body_jacobian(m, w, to),
        Field::BiasForce => to.copy_from_slice(&w.bias_force),
        Field::SmoothForce => to.copy_from_slice(&w.smooth_force),
        Field::ConstraintForce => to.copy_from_slice(&b.constraint_force),
        Field::EfcD => to.copy_from_slice(&b.efc_weight),
        Field::EfcAref => to.copy_from_slice(&b.efc_aref),
        Field::EfcForce => to.copy_from_slice(&b.efc_force),
        Field::MassMatrix => {
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
        Field::EfcJ => jacobian(m, &b.efc_weight, &w.limit_side, to),
        _ => unreachable!("`{}` is not staged", field.row().name),
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
                let [linear, angular] = w.motion[d];
                let moved = cross_add(angular, w.link_center[k], linear);
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
fn jacobian<F: Num>(m: &Constants<F::Real>, weight: &[F], side: &[F], to: &mut [F]) {
    let (dofs, zero, one) = (m.dofs.len(), F::c(0.0), F::c(1.0));
    to.fill(zero);
    let mut row = 0;
    for e in &m.equalities {
        to[row * dofs + e.follower] = one;
        to[row * dofs + e.leader] = -F::k(e.multiplier);
        row += 1;
    }
    for f in &m.frictions {
        to[row * dofs + f.dof] = one;
        row += 1;
    }
    for (l, side) in m.limits.iter().zip(side) {
        to[row * dofs + l.dof] = F::select(zero.lt(weight[row]), *side, zero);
        row += 1;
    }
}
