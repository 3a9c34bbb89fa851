//! Axes of a shape and a cylinder or an ellipsoid that GJK may start from, by the shapes' reaches. None of them is exact, but most pairs are
//! apart along one.

use super::hull_axes::{Reach, SeparatingAxis, better_axis};
use super::restart::{ClosedForm, DirectionSamples};
use crate::lane::Num;
use crate::math::vec3::Vec3;
use crate::step::collide::manifold::select::with_sign;
use crate::step::collide::narrow::ShapePose;

/// Two shapes by their reaches, in the frame of the second.
pub(in crate::step::collide) struct StartAxes<'a, F, A, B> {
    /// Pose of the first.
    pub pose: &'a ShapePose<F>,
    pub a: A,
    pub b: B,
}

/// The best axis so far.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct BestStart<F> {
    pub best: SeparatingAxis<F>,
}

impl<F: Num> BestStart<F> {
    /// The better of two; the first where they are equal.
    #[inline(always)]
    pub fn or(self, other: BestStart<F>) -> BestStart<F> {
        BestStart {
            best: better_axis(self.best, other.best, F::c(0.0)),
        }
    }
}

impl<F: Num, A: Reach<F> + Copy, B: Reach<F> + Copy> StartAxes<'_, F, A, B> {
    /// Restarts for penetration past a depth.
    #[inline(always)]
    pub fn samples(&self, depth: F) -> DirectionSamples<F, A, ClosedForm<B>> {
        DirectionSamples {
            axes: self.pose.axes,
            center: self.pose.center,
            a: self.a,
            b: ClosedForm(self.b),
            depth,
        }
    }

    /// The direction `d`, or the one against it; without length it is no axis.
    #[inline(always)]
    pub fn along(&self, d: Vec3<F>) -> BestStart<F> {
        // 1/|d|, guarded for a direction without length
        let square = d.dot(d);
        let unit = F::c(1.0).div(square.max(F::c(1e-16)).sqrt());
        // the second shape is at the origin: the normal points against the side of the first's centre
        let height = d.dot(self.pose.center);
        let normal = d * with_sign(-unit, height);
        // distance along the normal: |d · center|/|d| less both reaches
        let reach = self.a.reach(self.pose.axes.transpose_mul(normal)) + self.b.reach(normal);
        let distance = F::select(
            F::c(1e-14).lt(square),
            height.abs() * unit - reach,
            F::c(-1e18),
        );
        BestStart {
            best: SeparatingAxis { normal, distance },
        }
    }

    /// The axis of the cylinder.
    #[inline(always)]
    pub fn cylinder_axis(&self) -> BestStart<F> {
        self.own_axis(2)
    }

    /// An axis of the frame, that of the second shape.
    #[inline(always)]
    pub fn own_axis(&self, j: usize) -> BestStart<F> {
        let mut unit = Vec3::zero();
        unit[j] = F::c(1.0);
        self.along(unit)
    }

    /// An axis of the first shape.
    #[inline(always)]
    pub fn first_axis(&self, j: usize) -> BestStart<F> {
        self.along(self.pose.axes[j])
    }

    /// Across an axis of the first shape and that of the cylinder.
    #[inline(always)]
    pub fn across_both(&self, j: usize) -> BestStart<F> {
        self.along(self.pose.axes[j].cross(unit_z()))
    }

    /// From the axis of the cylinder straight to a point.
    #[inline(always)]
    pub fn radial(&self, x: Vec3<F>) -> BestStart<F> {
        self.along(Vec3([x[0], x[1], F::c(0.0)]))
    }
}

/// (0, 0, 1)
#[inline(always)]
fn unit_z<F: Num>() -> Vec3<F> {
    Vec3([F::c(0.0), F::c(0.0), F::c(1.0)])
}
