//! What holds of any tree in any state, by the definitions of mechanics.

use proptest::prelude::*;
use sim_engine::dynamics::Dynamics;
use sim_model::{Description, Inertial, Joint, JointKind, Link, Pose, Robot};
use sim_physics::arrays::Field;

const GRAVITY: f64 = 9.81;
/// Step of the difference quotient [s]: its third order and its rounding are both near 1e-10.
const MOMENT: f64 = 1e-5;

type Vec3 = [f64; 3];
type Quat = [f64; 4];

/// A number in [-1, 1) from a seed and a place: a smaller tree keeps what it has of a larger one.
fn noise(seed: u64, place: u64) -> f64 {
    let mut x =
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ place.wrapping_mul(0xd1b5_4a32_d192_ed03);
    for _ in 0..3 {
        x ^= x >> 31;
        x = x.wrapping_mul(0xd6e8_feb8_6659_fd93);
    }
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn noise3(seed: u64, place: u64) -> Vec3 {
    std::array::from_fn(|i| noise(seed, place + i as u64))
}

fn turn(seed: u64, place: u64) -> Quat {
    let q: Quat = std::array::from_fn(|i| noise(seed, place + i as u64));
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-3);
    q.map(|x| x / norm)
}

/// A tree of so many joints of every kind, on a fixed or a floating base.
fn tree(seed: u64, joints: usize, floating: bool) -> Robot {
    use JointKind::{Ball, Fixed, Planar, Prismatic, Revolute};
    let link = |k: usize| {
        let at = 1000 * k as u64;
        let mass = 1.0 + 0.8 * noise(seed, at);
        let edges = noise3(seed, at + 1).map(|x| 0.15 + 0.1 * x);
        let [a, b, c] = edges.map(|x| mass / 12.0 * x * x);
        Link {
            name: format!("l{k}"),
            inertial: Some(Inertial {
                mass,
                pos: noise3(seed, at + 10).map(|x| 0.2 * x),
                // a box, and a product of inertia far below its moments
                inertia: [
                    [b + c, 0.1 * a, 0.0],
                    [0.1 * a, a + c, 0.0],
                    [0.0, 0.0, a + b],
                ],
            }),
            collisions: Vec::new(),
        }
    };
    let joint = |k: usize| {
        let at = 1000 * k as u64 + 500;
        let share = 0.5 * (1.0 + noise(seed, at));
        let parent = k - 1 - (share * k.min(3) as f64) as usize;
        let kind =
            [Revolute, Prismatic, Ball, Planar, Fixed][(noise(seed, at + 1).abs() * 5.0) as usize];
        let axis = noise3(seed, at + 2).map(|x| x + 1e-3);
        let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        Joint {
            axis: axis.map(|x| x / length),
            origin: Pose {
                pos: noise3(seed, at + 10).map(|x| 0.3 * x),
                quat: turn(seed, at + 20),
            },
            ..Joint::new(kind, &format!("j{k}"), Some(parent), k)
        }
    };
    let mut robot = Robot {
        name: "tree".into(),
        pose: Pose {
            pos: noise3(seed, 1),
            quat: turn(seed, 5),
        },
        floating: false,
        self_collisions: false,
        links: (0..=joints).map(link).collect(),
        joints: (1..=joints).map(joint).collect(),
        notes: Vec::new(),
        warnings: Vec::new(),
        urdf: None,
        precompiled: None,
    };
    if floating {
        robot.float();
    }
    robot
}

/// A tree in a state.
struct Case {
    robot: Robot,
    dynamics: Dynamics,
    q: Vec<f64>,
    qd: Vec<f64>,
}

impl Case {
    fn new(seed: u64, joints: usize, floating: bool) -> Case {
        let robot = tree(seed, joints, floating);
        let mut scene = Description::new(1e-3, 1);
        scene.gravity = [0.0, 0.0, -GRAVITY];
        scene.robots.push(robot.clone());
        let model = scene.compile().expect("links of boxes compile");
        let mut q: Vec<f64> = (0..model.coords())
            .map(|k| noise(seed, 100_000 + k as u64))
            .collect();
        for first in model.constants().quaternions() {
            q[first..first + 4].copy_from_slice(&turn(seed, 200_000 + first as u64));
        }
        let qd = (0..model.dofs())
            .map(|k| 2.0 * noise(seed, 300_000 + k as u64))
            .collect();
        Case {
            robot,
            dynamics: Dynamics::new(model),
            q,
            qd,
        }
    }

    fn field(&mut self, field: Field, q: &[f64]) -> Vec<f64> {
        self.dynamics
            .evaluate(field, q, &self.qd)
            .expect("a state that fits")
    }

    /// Mass, rotation and centre of mass of each link, in the order of the bodies.
    fn bodies(&mut self, q: &[f64]) -> Vec<(Inertial, Quat, Vec3)> {
        let frames = self.field(Field::BodyQ, q);
        let order = self.robot.link_order();
        frames
            .chunks_exact(7)
            .zip(order)
            .map(|(frame, link)| {
                let inertial = self.robot.links[link]
                    .inertial
                    .expect("every link has mass");
                let quat: Quat = frame[3..].try_into().expect("four numbers");
                let arm = turned(quat, inertial.pos);
                (inertial, quat, std::array::from_fn(|i| frame[i] + arm[i]))
            })
            .collect()
    }

    /// Kinetic energy at other positions and these velocities [J].
    fn kinetic(&mut self, q: &[f64]) -> f64 {
        let momentum = product(&self.field(Field::MassMatrix, q), &self.qd);
        0.5 * dot(&momentum, &self.qd)
    }

    /// Potential energy [J].
    fn potential(&mut self, q: &[f64]) -> f64 {
        let bodies = self.bodies(q);
        bodies
            .iter()
            .map(|(inertial, _, center)| inertial.mass * GRAVITY * center[2])
            .sum()
    }

    /// Where the velocities lead in some seconds.
    fn moved(&self, seconds: f64) -> Vec<f64> {
        use sim_physics::constants::Motion;
        let mut q = self.q.clone();
        for body in &self.dynamics.model().constants().bodies {
            let (c, d) = (body.coord, body.dof);
            let three = |at: usize| std::array::from_fn::<f64, 3, _>(|i| self.qd[at + i] * seconds);
            match body.motion {
                Motion::Mocap => {}
                Motion::Revolute | Motion::Prismatic => q[c] += self.qd[d] * seconds,
                Motion::Ball => {
                    let turned = mul(self.quat(c), exp(three(d)));
                    q[c..c + 4].copy_from_slice(&turned);
                }
                Motion::Free => {
                    let before = self.quat(c + 3);
                    let after = mul(exp(three(d + 3)), before);
                    // the centre of mass moves with the velocity, and the frame turns about it
                    let (from, to, step) = (
                        turned(before, body.center),
                        turned(after, body.center),
                        three(d),
                    );
                    for i in 0..3 {
                        q[c + i] += from[i] + step[i] - to[i];
                    }
                    q[c + 3..c + 7].copy_from_slice(&after);
                }
            }
        }
        q
    }

    fn quat(&self, first: usize) -> Quat {
        self.q[first..first + 4].try_into().expect("four numbers")
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// A matrix, row by row, times a vector.
fn product(matrix: &[f64], x: &[f64]) -> Vec<f64> {
    matrix
        .chunks_exact(x.len().max(1))
        .map(|row| dot(row, x))
        .collect()
}

/// Turns a vector by a quaternion (x, y, z, w).
fn turned(q: Quat, a: Vec3) -> Vec3 {
    let cross = |a: Vec3, b: Vec3| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let axis = [q[0], q[1], q[2]];
    let t = cross(axis, a).map(|x| 2.0 * x);
    let u = cross(axis, t);
    std::array::from_fn(|i| a[i] + q[3] * t[i] + u[i])
}

fn mul(a: Quat, b: Quat) -> Quat {
    let [x, y, z] = vector_part(a, b);
    [
        x,
        y,
        z,
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    ]
}

/// Vector part of a quaternion product.
fn vector_part(a: Quat, b: Quat) -> Vec3 {
    [
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
        a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
    ]
}

/// The turn by a small rotation vector.
fn exp(turn: Vec3) -> Quat {
    let angle = dot(&turn, &turn).sqrt();
    let scale = if angle > 0.0 {
        (0.5 * angle).sin() / angle
    } else {
        0.5
    };
    let [x, y, z] = turn.map(|t| t * scale);
    [x, y, z, (0.5 * angle).cos()]
}

/// Largest difference relative to the largest entry.
fn off(got: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(got.len(), expected.len());
    let size = expected.iter().fold(1e-3_f64, |m, x| m.max(x.abs()));
    let pairs = got.iter().zip(expected);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size
}

/// Σ over links of Jᵀ diag(m, R I Rᵀ) J, from what the fields say of each link.
fn mass_matrix_of_jacobians(case: &mut Case) -> Vec<f64> {
    let n = case.qd.len();
    let q = case.q.clone();
    let jacobians = case.field(Field::BodyJacobian, &q);
    let mut matrix = vec![0.0; n * n];
    for (jacobian, (inertial, quat, _)) in
        jacobians.chunks_exact((6 * n).max(1)).zip(case.bodies(&q))
    {
        let column = |d: usize| std::array::from_fn::<f64, 6, _>(|row| jacobian[row * n + d]);
        let back = [-quat[0], -quat[1], -quat[2], quat[3]];
        for a in 0..n {
            let [x, y, z, rx, ry, rz] = column(a);
            let local = turned(back, [rx, ry, rz]);
            let spin = turned(
                quat,
                std::array::from_fn(|i| dot(&inertial.inertia[i], &local)),
            );
            let push = [x, y, z].map(|v| v * inertial.mass);
            let momentum = [push, spin].concat();
            for b in 0..n {
                matrix[a * n + b] += dot(&momentum, &column(b));
            }
        }
    }
    matrix
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn mass_matrix_is_the_sum_of_the_links_inertias_under_their_jacobians(
        seed in any::<u64>(), joints in 1_usize..14, floating in any::<bool>(),
    ) {
        let mut case = Case::new(seed, joints, floating);
        let q = case.q.clone();
        let (got, expected) = (case.field(Field::MassMatrix, &q), mass_matrix_of_jacobians(&mut case));
        prop_assert!(off(&got, &expected) < 1e-12, "{:e}", off(&got, &expected));
    }

    #[test]
    fn velocities_of_links_are_their_jacobians_times_those_of_joints(
        seed in any::<u64>(), joints in 1_usize..14, floating in any::<bool>(),
    ) {
        let mut case = Case::new(seed, joints, floating);
        let q = case.q.clone();
        let expected = product(&case.field(Field::BodyJacobian, &q), &case.qd.clone());
        let got = case.field(Field::BodyQd, &q);
        prop_assume!(!case.qd.is_empty());
        prop_assert!(off(&got, &expected) < 1e-12, "{:e}", off(&got, &expected));
    }

    #[test]
    fn forces_that_hold_the_velocities_do_the_work_that_the_energies_take_up(
        seed in any::<u64>(), joints in 1_usize..14, floating in any::<bool>(),
    ) {
        let mut case = Case::new(seed, joints, floating);
        let (q, ahead, behind) = (case.q.clone(), case.moved(MOMENT), case.moved(-MOMENT));
        let power = dot(&case.field(Field::BiasForce, &q), &case.qd.clone());
        let kinetic = case.kinetic(&ahead) - case.kinetic(&behind);
        let potential = case.potential(&ahead) - case.potential(&behind);
        let rate = (kinetic + potential) / (2.0 * MOMENT);
        let size = case.kinetic(&q) + power.abs() + 1.0;
        prop_assert!((power - rate).abs() < 1e-7 * size, "{power} W, but energy grows by {rate} W");
    }
}
