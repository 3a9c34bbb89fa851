//! Height scans for output: how far below a frame the ground is, at the points of a grid that turns with the frame's yaw.
//!
//! ```text
//! (x, y) = p + Rz(yaw) (i dx, j dy)     yaw of the frame's x axis on the level, i and j about the middle of the grid
//! d = p_z - z(x, y)                     z the highest of: planes, triangles of height fields
//! ```
//!
//! A ray reads the three samples of its triangle: it costs the same on a field of any size. d is negative where the ground is
//! above the frame.

use super::sites;
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::Kind;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::collide::Samples;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Parts of a direction below which a frame's x axis counts as vertical [–].
const LEVEL: f64 = 1e-6;

/// Distances of the ground below frames.
pub struct HeightScans;

impl Stage for HeightScans {
    const READS: &'static [A] = &[A::Rotation, A::Origin, A::Reference];
    const WRITES: &'static [A] = &[A::HeightScan];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.scans.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        scan(cx, m, b);
    }
}

/// Writes the distances of all scans.
#[inline(always)]
fn scan<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let c = C::F::c;
    for scan in &m.scans {
        let mount = &scan.mount;
        // p in two parts, reference point and the way from it, so that `f32` keeps the digits of their differences
        let (origin, center) = (
            sites::reference(&b.work, mount),
            sites::position(&b.work, mount),
        );
        // cos and sin of the yaw, from the part of the x axis on the level; the yaw of a vertical x axis is 0
        let forward = sites::axes(&b.work, mount)[0];
        let square = forward[0].fma(forward[0], forward[1] * forward[1]);
        let is_level = c(LEVEL * LEVEL).lt(square);
        let unit = c(1.0).div(square.max(c(LEVEL * LEVEL)).sqrt());
        let (cos, sin) = (
            C::F::select(is_level, forward[0] * unit, c(1.0)),
            C::F::select(is_level, forward[1] * unit, c(0.0)),
        );
        // rays count from the middle of the grid, along x first
        let middle = scan.counts.map(|count| 0.5 * (count as f64 - 1.0));
        let rays = &mut b.work.height_scan[scan.first..scan.first + scan.rays()];
        for (k, ray) in rays.iter_mut().enumerate() {
            let (i, j) = (k % scan.counts[0], k / scan.counts[0]);
            let x = c(i as f64 - middle[0]) * C::F::k(scan.spacing[0]);
            let y = c(j as f64 - middle[1]) * C::F::k(scan.spacing[1]);
            // Rz(yaw) (x, y)
            let (along, across) = (sin.fnma(y, cos * x), sin.fma(x, cos * y));
            // the ground above the frame's origin
            let mut height = c(-1e18);
            for &(place, row) in &scan.ground {
                let solid = &m.contacts.solids[place];
                let axes = Mat3::constant(solid.axes);
                let surface = match solid.kind {
                    // a field is static: constants take p and the ray into its axes
                    Kind::Field => {
                        let at = cx.at(row);
                        let (origin, center) =
                            (axes.transpose_mul(origin), axes.transpose_mul(center));
                        let samples = Samples::read(cx, m.contacts.fields, at, origin, center);
                        let way = axes.transpose_mul(Vec3([along, across, c(0.0)]));
                        samples.height_at(cx, way)
                    }
                    _ => {
                        // n · (x - s) = 0
                        let from = (origin - Vec3::constant(solid.center)) + center;
                        let (n, way) = (axes[2], Vec3([along, across, c(0.0)]));
                        -n.dot(from + way).div(n[2])
                    }
                };
                height = height.max(surface);
            }
            // d = p_z - z, at most the reach of the scan
            *ray = (-height).min(C::F::k(scan.reach));
        }
    }
}
