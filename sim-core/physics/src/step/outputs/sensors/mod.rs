//! Sensors of MuJoCo models, for output (MuJoCo: `mj_sensorPos`, `mj_sensorVel`, `mj_sensorAcc`).
//!
//! Each stage evaluates the sensors that need the same arrays, so a model without force sensors needs no accelerations.
//! A cutoff bounds what a sensor shows.

mod cameras;
mod contact_rates;
pub mod contacts;
mod distances;
mod forces;
mod ray_meshes;
mod rays;
mod states;
mod zone;

pub use cameras::Cameras;
pub use contacts::Contacts;
pub use forces::{Accelerations, Energies, Forces, Wrenches};
pub use rays::Rays;
pub use states::{States, Subtrees};

use crate::constants::Constants;
use crate::constants::sensors::{Cutoff, Sensor, SensorKind};
use crate::lane::{Num, Real};

/// Does the model have a sensor of some kinds?
fn has<R: Real>(m: &Constants<R>, kinds: impl Fn(&SensorKind<R>) -> bool) -> bool {
    m.sensors.all.iter().any(|sensor| kinds(&sensor.kind))
}

/// Writes the scalars of a sensor, in its bounds.
#[inline(always)]
fn put<F: Num>(data: &mut [F], sensor: &Sensor<F::Real>, scalars: &[F]) {
    put_at(data, sensor.first, sensor.cutoff.as_ref(), scalars);
}

/// Writes scalars from a place on, in bounds if there are any.
#[inline(always)]
fn put_at<F: Num>(data: &mut [F], first: usize, cutoff: Option<&Cutoff<F::Real>>, scalars: &[F]) {
    for (to, x) in data[first..].iter_mut().zip(scalars) {
        *to = match cutoff {
            None => *x,
            Some(cutoff) => {
                let most = F::k(cutoff.most);
                // MuJoCo bounds a sensor of positive values from above only
                let bounded = x.min(most);
                if cutoff.is_two_sided {
                    bounded.max(-most)
                } else {
                    bounded
                }
            }
        };
    }
}
