//! Sensors about cameras and zones (MuJoCo: `mj_camlight`, `camprojection`, `insidesite`).
//!
//! ```text
//! z = (p - t) / |p - t|    x = e × z / |e × z|    y = z × x     a camera at p looks at t, e upwards
//! (u, v) = (w - fˣ x / z, h + fʸ y / z)                         (x, y, z) in the axes of a camera
//! ```
//!
//! As in MuJoCo, velocities of a camera are those of its body, also where something else turns it.
//! (w, h) is the middle of the picture, also where the principal point is elsewhere.

use super::zone::holds;
use super::{has, put};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::sensors::{
    Aim, AimedSensor, Eye, FramePart, Place, ProjectionSensor, SensorKind,
};
use crate::constants::site::Mount;
use crate::lane::{Cx, Num, Real};
use crate::math::spatial::{ANGULAR, LINEAR};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::outputs::sites::{axes, position, reference, to_local, velocity};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Length below which a vector has no direction, and least depth of a pixel (MuJoCo: `mjMINVAL`) [m].
const SHORT: f64 = 1e-15;

/// Sensors about cameras, and about what is in zones.
pub struct Cameras;

impl Stage for Cameras {
    const READS: &'static [A] = &[
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Velocity,
        A::SubtreeCenter,
        A::Sensordata,
    ];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        use SensorKind::*;
        has(m, |kind| {
            matches!(kind, Aimed(_) | Projection(_) | Inside(..))
        })
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
        for sensor in &m.sensors.all {
            let w = &mut b.work;
            match &sensor.kind {
                SensorKind::Aimed(frame) => {
                    let vector = property(m, w, frame);
                    put(&mut w.sensordata, sensor, &vector.0);
                }
                SensorKind::Projection(projection) => {
                    let place = pixel(m, w, projection);
                    put(&mut w.sensordata, sensor, &place);
                }
                SensorKind::Inside(zone, eye) => {
                    // the origin of the frame in the axes of the zone
                    let (place, _) = look(m, w, eye);
                    let apart = apart(w, [&eye.mount, &zone.site], place);
                    let point = to_local(w, &zone.site, apart - position(w, &zone.site));
                    let is_in = C::F::select(holds(zone, point), one, zero);
                    put(&mut w.sensordata, sensor, &[is_in]);
                }
                _ => {}
            }
        }
    }
}

/// A point from the reference point of one mount's tree, as seen from that of another one's.
#[inline(always)]
fn apart<F: Num>(w: &Workspace<F>, [of, to]: [&Mount<F::Real>; 2], point: Vec3<F>) -> Vec3<F> {
    // within a tree reference points cancel
    if of.tree == to.tree {
        return point;
    }
    point + (reference(w, of) - reference(w, to))
}

/// Where a camera is, from the reference point of its mount, and its axes by columns.
#[inline(always)]
fn look<F: Num>(
    m: &Constants<F::Real>,
    w: &Workspace<F>,
    eye: &Eye<F::Real>,
) -> (Vec3<F>, Mat3<F>) {
    // also a camera that looks at something has its place on its body
    let place = position(w, &eye.mount);
    match &eye.aim {
        Aim::Fixed => (place, axes(w, &eye.mount)),
        Aim::Follows(target, offset, axes) => {
            // the way from there and the axes stay as they are in the world
            let there = there(m, w, target, &eye.mount);
            (there + Vec3::constant(*offset), Mat3::constant(*axes))
        }
        Aim::LooksAt(target) => {
            // -z points to the target, x is level
            let z = unit(place - there(m, w, target, &eye.mount));
            let x = unit(Vec3([-z[1], z[0], F::c(0.0)]));
            (place, Mat3([x, z.cross(x), z]))
        }
    }
}

/// What a camera follows or looks at, from the reference point of a mount.
#[inline(always)]
fn there<F: Num>(
    m: &Constants<F::Real>,
    w: &Workspace<F>,
    place: &Place<F::Real>,
    mount: &Mount<F::Real>,
) -> Vec3<F> {
    match place {
        Place::Origin(frame) => apart(w, [frame, mount], position(w, frame)),
        // centres are from the reference point of their own tree
        Place::Center(body) => {
            let frame = &m.outputs.bodies[*body].frame;
            apart(w, [frame, mount], w.subtree_center[*body])
        }
    }
}

/// A vector with length 1; (1, 0, 0) where it has no direction.
#[inline(always)]
fn unit<F: Num>(v: Vec3<F>) -> Vec3<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    // a short vector is divided by 1, and does not count
    let length = v.dot(v).sqrt();
    let is_short = length.lt(F::c(SHORT));
    let inverse = one.div(F::select(is_short, one, length));
    Vec3([
        F::select(is_short, one, v[0] * inverse),
        F::select(is_short, zero, v[1] * inverse),
        F::select(is_short, zero, v[2] * inverse),
    ])
}

/// A property of a frame that is a vector.
#[inline(always)]
fn property<F: Num>(
    m: &Constants<F::Real>,
    w: &Workspace<F>,
    sensor: &AimedSensor<F::Real>,
) -> Vec3<F> {
    // the frame, from the reference point of its mount
    let of = &sensor.of;
    let (place, turned) = look(m, w, of);
    // in the world: p + r, an axis, v + ω × p, ω
    let [linear, angular] = velocity(w, &of.mount, place).0;
    let Some(from) = &sensor.from else {
        return match sensor.part {
            FramePart::Position => place + reference(w, &of.mount),
            FramePart::Axis(k) => turned[k],
            FramePart::Velocity => linear,
            FramePart::Spin | FramePart::Quat => angular,
        };
    };
    // from another frame: p - p', v - v' - ω' × (p - p'), ω - ω', in its axes
    let (origin, axes) = look(m, w, from);
    let way = apart(w, [&of.mount, &from.mount], place) - origin;
    let there = velocity(w, &from.mount, origin);
    let vector = match sensor.part {
        FramePart::Position => way,
        FramePart::Axis(k) => turned[k],
        FramePart::Velocity => linear - there[ANGULAR].cross_add(way, there[LINEAR]),
        FramePart::Spin | FramePart::Quat => angular - there[ANGULAR],
    };
    axes.transpose_mul(vector)
}

/// The pixel of a site.
#[inline(always)]
fn pixel<F: Num>(
    m: &Constants<F::Real>,
    w: &Workspace<F>,
    projection: &ProjectionSensor<F::Real>,
) -> [F; 2] {
    // the site in the axes of the camera, which looks along -z
    let (camera, site) = (&projection.camera, &projection.site);
    let (origin, axes) = look(m, w, camera);
    let way = apart(w, [site, &camera.mount], position(w, site)) - origin;
    let Vec3([x, y, z]) = axes.transpose_mul(way);
    // a depth of nearly 0 keeps its sign
    let (short, zero) = (F::c(SHORT), F::c(0.0));
    let least = F::select(z.lt(zero), -short, short);
    let depth = F::select(z.abs().lt(short), least, z);
    // rows of pixels count downwards from the upper edge, columns from the left one
    let [focal_x, focal_y] = projection.focal.map(F::k);
    let [middle_x, middle_y] = projection.middle.map(F::k);
    [
        middle_x - (focal_x * x).div(depth),
        middle_y + (focal_y * y).div(depth),
    ]
}
