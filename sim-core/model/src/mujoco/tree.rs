//! Bodies and joints of a model as links and joints of one robot.

use super::constraints;
use super::format::ModelFile;
use super::frame;
use super::frames;
use super::names::names;
use super::options::{MujocoOptions, contact_override, has_flag, integrator};
use super::reflected::{self, Driven, Share};
use super::{passive, plasticity, tendons};
use crate::description::{
    Compensator, Inertial, Joint, JointDof, JointExtras, JointKind, Link, Precompiled, Robot,
    SensorParts,
};
use crate::error::ModelError;
use crate::pose::Pose;
use crate::softness::Softness;
use sim_physics::constants::hull::reference::{ITERATIONS_MAX, Limits};

/// Links and joints, without shapes and actuators.
pub(super) fn robot(file: &ModelFile, options: &MujocoOptions) -> Result<Robot, ModelError> {
    let bodies = file.rows("body_parentid");
    if bodies == 0 {
        return Err(file.fault("has no bodies".to_owned()));
    }
    let parents = file.indices("body_parentid", bodies, bodies)?;
    if (1..bodies).any(|body| parents[body].is_none_or(|parent| parent >= body)) {
        return Err(file.fault("has bodies before their parents".to_owned()));
    }
    let mut robot = Robot {
        name: options.name.clone(),
        pose: options.pose.normalized(),
        floating: false,
        self_collisions: true,
        links: links(file, bodies)?,
        joints: Vec::new(),
        notes: Vec::new(),
        warnings: Vec::new(),
        urdf: None,
        precompiled: None,
    };
    let mut parts = parts(file, bodies, &parents)?;
    add_joints(file, options, &parents, &mut robot, &mut parts)?;
    let dofs: usize = robot.joints.iter().map(|joint| joint.dofs.len()).sum();
    if dofs != file.rows("dof_armature") {
        return Err(file.fault("has dofs without joints".to_owned()));
    }
    let coords: usize = robot.joints.iter().map(|joint| joint.q.len()).sum();
    if coords != file.rows("qpos0") {
        return Err(file.fault("has coordinates without joints".to_owned()));
    }
    constraints::add_constraints(file, &robot, &mut parts)?;
    robot.precompiled = Some(Box::new(parts));
    Ok(robot)
}

fn links(file: &ModelFile, bodies: usize) -> Result<Vec<Link>, ModelError> {
    let names = names(file, "body", bodies)?;
    let masses = file.reals("body_mass", bodies)?;
    let centers = file.vectors::<3>("body_ipos", bodies)?;
    let turns = file.vectors::<4>("body_iquat", bodies)?;
    let moments = file.vectors::<3>("body_inertia", bodies)?;
    let links = names.into_iter().enumerate().map(|(body, name)| {
        let [x, y, z] = moments[body];
        let principal = frame([0.0; 3], turns[body]);
        let inertial = Inertial {
            mass: masses[body],
            pos: centers[body],
            inertia: principal.rotate_tensor([[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]),
        };
        Link {
            name,
            inertial: (masses[body] > 0.0 || x + y + z > 0.0).then_some(inertial),
            collisions: Vec::new(),
        }
    });
    Ok(links.collect())
}

fn parts(
    file: &ModelFile,
    bodies: usize,
    parents: &[Option<usize>],
) -> Result<Precompiled, ModelError> {
    let welds = file.indices("body_weldid", bodies, bodies)?;
    let weights = file.vectors::<2>("body_invweight0", bodies)?;
    let signatures = file.integers("exclude_signature", file.rows("exclude_signature"))?;
    // two numbers of bodies in one
    let excludes = signatures.into_iter().map(|signature| {
        [signature >> 16, signature & 0xffff].map(|body| usize::try_from(body).unwrap_or(0))
    });
    let numbers = file.indices("body_mocapid", bodies, bodies)?;
    let mut mocaps: Vec<(usize, usize)> = numbers
        .into_iter()
        .enumerate()
        .filter_map(|(body, number)| Some((number?, body)))
        .collect();
    mocaps.sort_unstable();
    let mocaps = mocaps.iter().map(|&(_, body)| body);
    if !mocaps.clone().is_sorted() {
        return Err(file.fault("has mocap bodies in another order than its bodies".to_owned()));
    }
    let (drags, ellipsoids_in_fluid) = passive::in_medium(file, bodies)?;
    Ok(Precompiled {
        keyframes: super::keyframes::keyframes(file)?,
        mocaps: mocaps.collect(),
        link_inverse_weight: weights.into_iter().map(|[linear, _]| linear).collect(),
        dof_inverse_weight: file.reals("dof_invweight0", file.rows("dof_armature"))?,
        mean_inertia: file.real("stat.meaninertia")?,
        joints: Vec::new(),
        equalities: super::constraints::equalities(file)?,
        constraints: Vec::new(),
        drags,
        ellipsoids_in_fluid,
        compensations: passive::compensations(file, bodies)?,
        spatial_tendons: Vec::new(),
        tendons: Vec::new(),
        actuators: Vec::new(),
        tendon_bounds: tendons::bounds(file)?,
        welds: welds.into_iter().map(|weld| weld.unwrap_or(0)).collect(),
        parents: parents.iter().map(|parent| parent.unwrap_or(0)).collect(),
        excludes: excludes.collect(),
        pairs: Vec::new(),
        contact_override: contact_override(file)?,
        touches_parent: has_flag(file, "mjDSBL_FILTERPARENT")?,
        integrator: integrator(file)?,
        ls_tolerance: file.real_or("opt.ls_tolerance", LS_TOLERANCE)?,
        noslip: (
            usize::try_from(file.integer("opt.noslip_iterations")?).unwrap_or(0),
            file.real_or("opt.noslip_tolerance", NOSLIP_TOLERANCE)?,
        ),
        contact_search: contact_search(file)?,
        islands: !has_flag(file, "mjDSBL_ISLAND")?,
        warm_start: !has_flag(file, "mjDSBL_WARMSTART")?,
        implicit_damping: !has_flag(file, "mjDSBL_EULERDAMP")?,
        safe_references: !has_flag(file, "mjDSBL_REFSAFE")?,
        frames: frames::frames(file, bodies)?,
        sensors: SensorParts::default(),
    })
}

/// When the search for contacts ends, as MuJoCo's does by default for files that older versions wrote; none for models that ask
/// for another one.
fn contact_search(file: &ModelFile) -> Result<Option<Limits>, ModelError> {
    if has_flag(file, "mjDSBL_NATIVECCD")? {
        return Ok(None);
    }
    let usual = Limits::default();
    let tolerance = file.real_or("opt.ccd_tolerance", usual.tolerance)?;
    if !tolerance.is_finite() {
        return Err(file.fault(format!("opt.ccd_tolerance is {tolerance}; give a number")));
    }
    let iterations = match file.rows("opt.ccd_iterations") {
        0 => usual.iterations,
        _ => usize::try_from(file.integer("opt.ccd_iterations")?).unwrap_or(0),
    };
    Ok(Some(Limits {
        iterations: iterations.clamp(1, ITERATIONS_MAX),
        tolerance: tolerance.max(TOLERANCE_MIN),
        several: !has_flag(file, "mjDSBL_MULTICCD")?,
    }))
}

/// Least `ccd_tolerance`, below which lengths count as 0 (MuJoCo: `mjMINVAL`) [m].
const TOLERANCE_MIN: f64 = 1e-15;
/// `ls_tolerance` of files that older versions wrote: MuJoCo's default [–].
const LS_TOLERANCE: f64 = 0.01;
/// The same of `noslip_tolerance` [–].
const NOSLIP_TOLERANCE: f64 = 1e-6;

/// Arrays of joints and dofs.
struct JointArrays {
    names: Vec<String>,
    kinds: Vec<JointKind>,
    bodies: Vec<Option<usize>>,
    dofs: Vec<Option<usize>>,
    coords: Vec<Option<usize>>,
    anchors: Vec<[f64; 3]>,
    axes: Vec<[f64; 3]>,
    is_limited: Vec<i64>,
    ranges: Vec<[f64; 2]>,
    margins: Vec<f64>,
    stiffness: Vec<f64>,
    stiffness_curves: Vec<[f64; 2]>,
    limits: Vec<Softness>,
    is_bounded: Vec<i64>,
    bounds: Vec<[f64; 2]>,
    damping: Vec<f64>,
    damping_curves: Vec<[f64; 2]>,
    armature: Vec<f64>,
    shares: Vec<Share>,
    friction: Vec<f64>,
    frictions: Vec<Softness>,
    qpos0: Vec<f64>,
    qpos_spring: Vec<f64>,
    yields: Vec<Option<f64>>,
    compensators: Vec<Compensator>,
}

impl JointArrays {
    fn read(file: &ModelFile) -> Result<JointArrays, ModelError> {
        let (joints, dofs) = (file.rows("jnt_type"), file.rows("dof_armature"));
        let (coords, bodies) = (file.rows("qpos0"), file.rows("body_parentid"));
        let kinds = file
            .kinds("jnt_type", joints)?
            .into_iter()
            .map(|kind| match kind.as_str() {
                "mjJNT_FREE" => Ok(JointKind::Free),
                "mjJNT_BALL" => Ok(JointKind::Ball),
                "mjJNT_SLIDE" => Ok(JointKind::Prismatic),
                "mjJNT_HINGE" => Ok(JointKind::Revolute),
                _ => Err(file.fault(format!("has joints of the unknown kind {kind}"))),
            });
        let none = has_flag(file, "mjDSBL_CONSTRAINT")?;
        let off = |flag: &str| Ok::<bool, ModelError>(none || has_flag(file, flag)?);
        let kept = |values: Vec<f64>, is_off: bool| match is_off {
            true => vec![0.0; values.len()],
            false => values,
        };
        let limits_off = off("mjDSBL_LIMIT")?;
        let friction_off = off("mjDSBL_FRICTIONLOSS")?;
        let springs_off = has_flag(file, "mjDSBL_SPRING")?;
        let dampers_off = has_flag(file, "mjDSBL_DAMPER")?;
        let is_limited = match limits_off {
            true => vec![0; joints],
            false => file.integers("jnt_limited", joints)?,
        };
        Ok(JointArrays {
            names: names(file, "joint", joints)?,
            kinds: kinds.collect::<Result<_, _>>()?,
            bodies: file.indices("jnt_bodyid", joints, bodies)?,
            dofs: file.indices("jnt_dofadr", joints, dofs)?,
            coords: file.indices("jnt_qposadr", joints, coords)?,
            anchors: file.vectors("jnt_pos", joints)?,
            axes: file.vectors("jnt_axis", joints)?,
            is_limited,
            ranges: file.vectors("jnt_range", joints)?,
            margins: file.reals("jnt_margin", joints)?,
            stiffness: kept(file.reals("jnt_stiffness", joints)?, springs_off),
            stiffness_curves: file.curves("jnt_stiffnesspoly", joints, springs_off)?,
            limits: softness(file, "jnt", joints)?,
            is_bounded: file.integers("jnt_actfrclimited", joints)?,
            bounds: file.vectors("jnt_actfrcrange", joints)?,
            damping: kept(file.reals("dof_damping", dofs)?, dampers_off),
            damping_curves: file.curves("dof_dampingpoly", dofs, dampers_off)?,
            armature: file.reals("dof_armature", dofs)?,
            shares: reflected::shares(file, Driven::Joint, joints)?,
            friction: kept(file.reals("dof_frictionloss", dofs)?, friction_off),
            frictions: softness(file, "dof", dofs)?,
            qpos0: file.reals("qpos0", coords)?,
            qpos_spring: file.reals("qpos_spring", coords)?,
            yields: plasticity::yields(file, "jnt", joints)?,
            compensators: passive::compensators(file, joints)?,
        })
    }
}

/// `solref` and `solimp` of elements.
pub(super) fn softness(
    file: &ModelFile,
    prefix: &str,
    count: usize,
) -> Result<Vec<Softness>, ModelError> {
    let solref = file.vectors::<2>(&format!("{prefix}_solref"), count)?;
    let solimp = file.vectors::<5>(&format!("{prefix}_solimp"), count)?;
    let pairs = solref.into_iter().zip(solimp);
    Ok(pairs
        .map(|(solref, solimp)| Softness { solref, solimp })
        .collect())
}

fn add_joints(
    file: &ModelFile,
    options: &MujocoOptions,
    parents: &[Option<usize>],
    robot: &mut Robot,
    parts: &mut Precompiled,
) -> Result<(), ModelError> {
    let bodies = robot.links.len();
    let places = file.vectors::<3>("body_pos", bodies)?;
    let turns = file.vectors::<4>("body_quat", bodies)?;
    let all = JointArrays::read(file)?;
    for body in 1..bodies {
        let joints: Vec<usize> = (0..all.kinds.len())
            .filter(|&joint| all.bodies[joint] == Some(body))
            .collect();
        let origin = frame(places[body], turns[body]);
        if joints.is_empty() {
            let taken = |name: &String| all.names.contains(name);
            let names = (1..).map(|count| format!("{} (fixed{count})", robot.links[body].name));
            let name = names
                .into_iter()
                .find(|name| !taken(name))
                .unwrap_or_default();
            let mut joint = Joint::fixed(&name, parents[body].unwrap_or(0), body);
            joint.origin = origin;
            robot.joints.push(joint);
            parts.joints.push(JointExtras::default());
        }
        for (place, joint) in joints.into_iter().enumerate() {
            let (mut joint, mut extras) =
                all.joint(file, joint, body, parents[body].unwrap_or(0))?;
            if place == 0 {
                joint.origin = origin;
            }
            if joint.kind == JointKind::Free {
                joint.parent = Some(0);
                let start = options.pose.mul(&Pose {
                    pos: [joint.q[0], joint.q[1], joint.q[2]],
                    quat: [joint.q[3], joint.q[4], joint.q[5], joint.q[6]],
                });
                joint.q[..3].copy_from_slice(&start.pos);
                joint.q[3..].copy_from_slice(&start.quat);
                extras.spring_pose = options.pose.mul(&extras.spring_pose);
            }
            robot.joints.push(joint);
            parts.joints.push(extras);
        }
    }
    Ok(())
}

impl JointArrays {
    /// Joint number `k`, without the place of its link.
    fn joint(
        &self,
        file: &ModelFile,
        k: usize,
        body: usize,
        parent: usize,
    ) -> Result<(Joint, JointExtras), ModelError> {
        let kind = self.kinds[k];
        let mut joint = Joint::new(kind, &self.names[k], Some(parent), body);
        let (coords, dofs) = (kind.coord_names().len(), kind.dof_names().len());
        let whole = |first: Option<usize>, count: usize, end: usize| {
            let first = first.filter(|first| first + count <= end);
            first.ok_or_else(|| file.fault(format!("has no dofs for joint `{}`", self.names[k])))
        };
        let dof = whole(self.dofs[k], dofs, self.armature.len())?;
        let coord = whole(self.coords[k], coords, self.qpos0.len())?;
        joint.q.copy_from_slice(&self.qpos0[coord..coord + coords]);
        match kind {
            JointKind::Ball => joint.q.rotate_left(1),
            JointKind::Free => joint.q[3..].rotate_left(1),
            _ => {
                joint.axis = self.axes[k];
                joint.range = (self.is_limited[k] != 0).then_some(self.ranges[k]);
            }
        }
        let share = self.shares[k];
        joint.dofs = (dof..dof + dofs)
            .map(|dof| JointDof {
                damping: self.damping[dof] + share.damping,
                friction: self.friction[dof],
                armature: self.armature[dof] + share.armature,
                target_q: Some(0.0),
                ..JointDof::default()
            })
            .collect();
        let is_scalar = dofs == 1;
        let mut damping_curves = [[0.0; 2]; 6];
        for (curve, known) in damping_curves
            .iter_mut()
            .zip(&self.damping_curves[dof..dof + dofs])
        {
            *curve = share.damped(*known);
        }
        let extras = JointExtras {
            anchor: if kind == JointKind::Free {
                [0.0; 3]
            } else {
                self.anchors[k]
            },
            reference: if is_scalar { self.qpos0[coord] } else { 0.0 },
            stiffness: self.stiffness[k],
            stiffness_curve: self.stiffness_curves[k],
            damping_curves,
            spring_ref: if is_scalar {
                self.qpos_spring[coord]
            } else {
                0.0
            },
            spring_pose: spring_pose(kind, &self.qpos_spring[coord..coord + coords]),
            spring_yield: self.yields[k],
            compensator: self.compensators[k],
            limit: self.limits[k],
            margin: self.margins[k],
            friction: self.frictions[dof],
            actuator_range: (self.is_bounded[k] != 0).then_some(self.bounds[k]),
        };
        Ok((joint, extras))
    }
}

/// The pose without force of the spring of a ball or a free joint.
fn spring_pose(kind: JointKind, coords: &[f64]) -> Pose {
    let [x, y, z, w, a, b, c] = match (kind, coords) {
        (JointKind::Ball, &[w, a, b, c]) => [0.0, 0.0, 0.0, w, a, b, c],
        (JointKind::Free, &[x, y, z, w, a, b, c]) => [x, y, z, w, a, b, c],
        _ => return Pose::identity(),
    };
    frame([x, y, z], [w, a, b, c])
}
