//! What the entries of a value array are, and how they lie flat.

use crate::lane::Num;
use crate::math::spatial;
use crate::math::vec3;
use bytemuck::TransparentWrapper;

/// An entry of a value array: one scalar, or several.
pub trait Element<F>: Copy {
    /// Scalars of an entry.
    const SCALARS: usize;
    /// All scalars 0.
    fn zero() -> Self;
    /// The scalars of entries, in order.
    fn flat(entries: &[Self]) -> &[F];
    /// The scalars of entries, in order.
    fn flat_mut(entries: &mut [Self]) -> &mut [F];
}

/// One scalar.
pub type Scalar<F> = F;
/// Three scalars.
pub type Vec3<F> = vec3::Vec3<F>;
/// Three columns.
pub type Mat3<F> = vec3::Mat3<F>;
/// Linear part, then angular part.
pub type Spatial<F> = spatial::Spatial<F>;
/// Ten scalars, see [`spatial::Inertia`].
pub type Inertia<F> = spatial::Inertia<F>;
/// x, y, z, w
pub type Quat<F> = [F; 4];
/// w, x, y, z
pub type MujocoQuat<F> = [F; 4];
/// A rotation matrix, row by row.
pub type MujocoMat<F> = [F; 9];
/// A displacement: linear part, then angular part.
pub type Row6<F> = [F; 6];
/// An inertia as MuJoCo has it: xx, yy, zz, xy, xz, yz, first moment, mass.
pub type MujocoInertia<F> = [F; 10];
/// Position, then quaternion (x, y, z, w).
pub type Pose<F> = [F; 7];

impl<F: Num> Element<F> for F {
    const SCALARS: usize = 1;
    fn zero() -> F {
        F::c(0.0)
    }
    fn flat(entries: &[F]) -> &[F] {
        entries
    }
    fn flat_mut(entries: &mut [F]) -> &mut [F] {
        entries
    }
}

impl<F: Num, const N: usize> Element<F> for [F; N] {
    const SCALARS: usize = N;
    fn zero() -> Self {
        [F::c(0.0); N]
    }
    fn flat(entries: &[Self]) -> &[F] {
        entries.as_flattened()
    }
    fn flat_mut(entries: &mut [Self]) -> &mut [F] {
        entries.as_flattened_mut()
    }
}

macro_rules! transparent {
    ($($wrapper:ident over $count:literal $part:ty;)*) => {
        $(impl<F: Num> Element<F> for $wrapper<F> {
            const SCALARS: usize = $count * <$part as Element<F>>::SCALARS;
            fn zero() -> Self {
                $wrapper::zero()
            }
            fn flat(entries: &[Self]) -> &[F] {
                <$part as Element<F>>::flat($wrapper::peel_slice(entries).as_flattened())
            }
            fn flat_mut(entries: &mut [Self]) -> &mut [F] {
                <$part as Element<F>>::flat_mut($wrapper::peel_slice_mut(entries).as_flattened_mut())
            }
        })*
    };
}

transparent! {
    Vec3 over 3 F;
    Mat3 over 3 Vec3<F>;
    Spatial over 2 Vec3<F>;
    Inertia over 10 F;
}
