//! Scenes as chance has them: trees of every kind of joint, bodies of every shape, every option of a scene.

use super::dice::Dice;
use super::shapes::every_kind;
use sim_model::{
    Body, Collision, Cone, ContactSensor, Description, Distribution, Inertial, Joint, JointDof,
    JointKind, Link, Mimic, Pose, Robot, Site, Solver, Surface, TargetMode,
};
use sim_physics::constants::params::Param;

/// Kinds of joints, the usual ones more often.
const KINDS: [JointKind; 8] = [
    JointKind::Revolute,
    JointKind::Revolute,
    JointKind::Revolute,
    JointKind::Prismatic,
    JointKind::Ball,
    JointKind::Planar,
    JointKind::Fixed,
    JointKind::Free,
];

/// A scene; `is_drawn` is whether its worlds start where they are drawn.
pub fn any_scene(dice: &mut Dice, is_drawn: bool) -> Description {
    let dt = 1.0 / dice.pick(&[120.0, 480.0, 1000.0]);
    let mut scene = Description::new(dt, 1 + dice.below(4));
    if dice.chance(0.3) {
        scene.gravity = [(); 3].map(|()| 10.0 * dice.number());
    }
    scene.solver = Solver {
        iterations: dice.pick(&[1, 3, 20, 50]),
        ls_iterations: dice.pick(&[1, 5, 100]),
        tolerance: dice.pick(&[0.0, 1e-8, 1e-4]),
        cone: dice.pick(&[Cone::Elliptic, Cone::Pyramidal]),
        impratio: dice.pick(&[1.0, 30.0, 1000.0, 1e5]),
    };
    scene.contacts_max = dice.chance(0.4).then(|| 1 + dice.below(12));
    scene.rows_max = dice.chance(0.2).then(|| 4 + dice.below(40));
    if dice.chance(0.7) {
        scene.add_ground("ground", dice.between(-0.3, 0.0)).surface = any_surface(dice);
    }
    for _ in 0..dice.below(3) {
        let size = dice.between(0.05, 0.3);
        let (shape, pose) = (dice.pick(&every_kind(size)), any_pose(dice, 0.4));
        scene.add_shape("", shape, pose).surface = any_surface(dice);
    }
    let (robots, bodies) = (dice.below(3), dice.below(4));
    for k in 0..robots {
        let robot = any_robot(dice, &format!("r{k}"));
        scene.add_robot(robot).unwrap();
    }
    for k in 0..bodies {
        let body = any_body(dice, &format!("b{k}"));
        scene.add_body(body).unwrap();
    }
    let names = scene.shape_names();
    if names.len() > 1 && dice.chance(0.2) {
        scene.filters.push([dice.pick(&names), dice.pick(&names)]);
    }
    add_sensors(dice, &mut scene, &names);
    let share = dice.pick(&[0.0, 0.4, 1.0]);
    let has_noise = dice.chance(0.3);
    let varies = |param: &Param| dice.chance(share) && (has_noise || !is_noise(*param));
    scene.params.extend(Param::ALL.into_iter().filter(varies));
    scene.command_delay_max = dice.chance(0.3).then(|| 1 + dice.below(3 * scene.substeps));
    if is_drawn {
        draw_params(dice, &mut scene);
        draw_starts(dice, &mut scene);
    }
    scene
}

/// Is it the size of what is drawn for each frame?
pub fn is_noise(param: Param) -> bool {
    param.row().name.ends_with("_noise")
}

/// Sites in the world and on links, some measured from the one before; sums of contact forces.
fn add_sensors(dice: &mut Dice, scene: &mut Description, shapes: &[String]) {
    let links = scene.robots.iter().flat_map(|robot| {
        let is_body = robot.links.len() == 1 && robot.links[0].name == "body";
        let name = move |link: &Link| match is_body {
            true => robot.name.clone(),
            false => format!("{}/{}", robot.name, link.name),
        };
        robot.links.iter().map(name)
    });
    let links: Vec<String> = links.collect();
    for k in 0..dice.below(4) {
        let is_borne = !links.is_empty() && dice.chance(0.8);
        let site = Site {
            name: format!("s{k}"),
            body: is_borne.then(|| dice.pick(&links)),
            pose: any_pose(dice, 0.3),
            relative_to: (k > 0 && dice.chance(0.5)).then(|| format!("s{}", k - 1)),
            damping: Site::DAMPING,
        };
        scene.sites.push(site);
    }
    if !shapes.is_empty() && dice.chance(0.5) {
        scene.contact_sensors.push(ContactSensor {
            name: "sum".to_owned(),
            of: dice.pick(shapes),
            against: dice.chance(0.3).then(|| dice.pick(shapes)),
        });
    }
}

fn any_pose(dice: &mut Dice, size: f64) -> Pose {
    let pos = [(); 3].map(|()| size * dice.number());
    Pose::from_rpy(pos, [(); 3].map(|()| 3.0 * dice.number()))
}

fn any_surface(dice: &mut Dice) -> Surface {
    Surface {
        mu: dice.pick(&[0.0, 0.4, 1.0, 2.0]),
        ke: dice.order(100.0, 1e5),
        kd: dice.order(10.0, 1000.0),
        kf: dice.order(10.0, 1000.0),
        margin: dice.pick(&[0.0, 0.0, 0.01]),
        gap: dice.pick(&[0.0, 0.0, 0.02]),
        condim: dice.pick(&[1, 3, 3]),
        group: dice.pick(&[1, 1, 1, 1, -1, 2, 0]),
    }
}

fn any_collision(dice: &mut Dice, size: f64) -> Collision {
    let size = size * dice.between(0.3, 1.0);
    let pose = any_pose(dice, size);
    Collision {
        surface: any_surface(dice),
        geom: None,
        ..Collision::new(None, dice.pick(&every_kind(size)), pose)
    }
}

fn any_body(dice: &mut Dice, name: &str) -> Body {
    let mut body = Body::new(name, any_pose(dice, 0.3));
    body.fixed = dice.chance(0.1);
    for _ in 0..1 + dice.below(2) {
        let density = dice.order(30.0, 8000.0);
        body.shapes.push((any_collision(dice, 0.15), density));
    }
    body
}

/// A box of some mass, turned and set off.
fn any_inertial(dice: &mut Dice) -> Inertial {
    let mass = dice.pick(&[(0.1, 10.0), (1e-3, 100.0)]);
    let mass = dice.order(mass.0, mass.1);
    let [x, y, z] = [(); 3].map(|()| dice.between(0.02, 0.3));
    let moments = [y * y + z * z, z * z + x * x, x * x + y * y].map(|square| mass / 12.0 * square);
    let pose = any_pose(dice, 0.1);
    let turn = pose.rotation();
    let entry = |i: usize, j: usize| (0..3).map(|k| turn[i][k] * moments[k] * turn[j][k]).sum();
    Inertial {
        mass,
        pos: pose.pos,
        inertia: [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i.min(j), i.max(j)))),
    }
}

fn any_robot(dice: &mut Dice, name: &str) -> Robot {
    let links = 2 + dice.below(6);
    let mut robot = Robot {
        name: name.to_owned(),
        pose: any_pose(dice, 0.3),
        floating: false,
        self_collisions: dice.chance(0.5),
        links: Vec::new(),
        joints: Vec::new(),
        notes: Vec::new(),
        warnings: Vec::new(),
        urdf: None,
        precompiled: None,
    };
    for k in 0..links {
        let mut link = Link {
            name: format!("l{k}"),
            inertial: Some(any_inertial(dice)),
            collisions: Vec::new(),
        };
        for _ in 0..dice.below(3) {
            link.collisions.push(any_collision(dice, 0.12));
        }
        robot.links.push(link);
        if k > 0 {
            let joint = any_joint(dice, &robot, k);
            robot.joints.push(joint);
        }
    }
    let has_free = (robot.joints.iter()).any(|joint| joint.kind == JointKind::Free);
    if !has_free && dice.chance(0.5) {
        robot.float();
    }
    robot
}

/// The joint of a link to one of those before it.
fn any_joint(dice: &mut Dice, robot: &Robot, child: usize) -> Joint {
    // a free joint hangs from a link that does not move, and such is the root alone
    let kind = dice.pick(&KINDS);
    let parent = if kind == JointKind::Free {
        0
    } else {
        dice.below(child)
    };
    let mut joint = Joint::new(kind, &format!("j{child}"), Some(parent), child);
    joint.origin = any_pose(dice, 0.25);
    if dice.chance(0.5) {
        let [x, y, z] = [(); 3].map(|()| dice.number() + 1e-3);
        let length = (x * x + y * y + z * z).sqrt();
        joint.axis = [x / length, y / length, z / length];
    }
    if kind == JointKind::Free {
        return joint;
    }
    joint.dofs = joint.dofs.iter().map(|_| any_dof(dice)).collect();
    if matches!(kind, JointKind::Revolute | JointKind::Prismatic) {
        joint.q = vec![0.3 * dice.number()];
        let range = [-dice.between(0.0, 1.0), dice.between(0.0, 1.0)];
        joint.range = dice.chance(0.5).then_some(range);
        let leads = |joint: &Joint| {
            matches!(joint.kind, JointKind::Revolute | JointKind::Prismatic)
                && joint.mimic.is_none()
        };
        let leaders: Vec<usize> = (0..robot.joints.len())
            .filter(|&k| leads(&robot.joints[k]))
            .collect();
        if !leaders.is_empty() && dice.chance(0.3) {
            joint.mimic = Some(Mimic {
                joint: dice.pick(&leaders),
                multiplier: 2.0 * dice.number(),
                offset: 0.2 * dice.number(),
            });
        }
    }
    joint
}

fn any_dof(dice: &mut Dice) -> JointDof {
    let sometimes = |dice: &mut Dice, low: f64, high: f64| match dice.chance(0.5) {
        true => dice.order(low, high),
        false => 0.0,
    };
    JointDof {
        damping: sometimes(dice, 0.01, 2.0),
        friction: sometimes(dice, 0.01, 2.0),
        armature: sometimes(dice, 1e-3, 0.3),
        effort_limit: dice.chance(0.3).then(|| dice.order(0.1, 100.0)),
        target_q: dice.chance(0.3).then(|| dice.number()),
        target_qd: dice.pick(&[0.0, 0.5]),
        target_mode: dice.pick(&[TargetMode::Position, TargetMode::Velocity, TargetMode::Both]),
        target_ke: sometimes(dice, 1.0, 1000.0),
        target_kd: sometimes(dice, 0.1, 50.0),
        ..JointDof::default()
    }
}

/// Parameters that a reset draws: gravity, a delay, and masses and damping of whole robots.
fn draw_params(dice: &mut Dice, scene: &mut Description) {
    let (low, high) = (dice.between(0.5, 1.0), dice.between(1.0, 2.0));
    let uniform = |low: f64, high: f64| Distribution::Uniform { low, high };
    let mut draw = |param: Param, name: &str, distribution| {
        let ranges = scene.param_ranges.entry(param).or_default();
        ranges.insert(name.to_owned(), distribution);
    };
    if dice.chance(0.5) {
        draw(Param::Gravity, "z", uniform(-12.0, -3.0));
    }
    if dice.chance(0.3) {
        draw(Param::CommandDelay, "", uniform(0.0, 1.0));
    }
    for robot in scene
        .robots
        .iter()
        .map(|robot| robot.name.clone())
        .collect::<Vec<_>>()
    {
        if dice.chance(0.3) {
            draw(Param::BodyMassScale, &robot, uniform(low, high));
        }
    }
}

/// Starts that are drawn for half of the dofs.
fn draw_starts(dice: &mut Dice, scene: &mut Description) {
    let joints = scene.robots.iter_mut().flat_map(|robot| &mut robot.joints);
    for joint in joints.filter(|joint| joint.mimic.is_none()) {
        for dof in &mut joint.dofs {
            let (low, high) = (-dice.between(0.0, 0.3), dice.between(0.0, 0.3));
            let offsets = [
                Distribution::Uniform { low, high },
                Distribution::Normal {
                    mean: low,
                    std: high,
                },
            ];
            dof.offset_q = dice.chance(0.5).then(|| dice.pick(&offsets));
            dof.offset_qd = dice.chance(0.5).then(|| dice.pick(&offsets));
        }
    }
}
