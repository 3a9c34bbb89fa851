//! Sensors of MuJoCo models by the dofs and bodies of the scene.

use super::bodies::BodyBuilder;
use super::carrier::Carrier;
use super::output_frames::mounted_on;
use super::tendons::Lengths;
use crate::description::{AimPart, EyePart, OnLink, Robot, Sense, SensorParts, ZonePart};
use crate::model::SensorInfo;
use crate::pose::Pose;
use sim_physics::constants::outputs::OutputFrames;
use sim_physics::constants::sensors::{
    AccelerationSensor, Aim, AimedSensor, ContactRates, ContactSensor, Cutoff, DistanceSensor, Eye,
    FrameSensor, Place, ProjectionSensor, RangeSensor, RayGeom, Sensor, SensorKind, Sensors,
    TouchSensor, WrenchSensor, Zone,
};
use sim_physics::constants::site::Mount;
use sim_physics::constants::{Dof, Tree};

/// What a model's sensors refer to.
struct Scope<'a> {
    /// The first dof of each joint of the robot.
    dof_of: &'a [usize],
    /// Its dofs and tendons.
    lengths: Lengths<'a>,
    /// Of each link of the robot.
    carriers: &'a [Carrier],
    /// The link that each is welded to, or itself.
    welds: &'a [usize],
    dofs: &'a [Dof<f64>],
    trees: &'a [Tree<f64>],
    frames: &'a OutputFrames<f64>,
    /// Its first body among those of MuJoCo models.
    first_body: usize,
    /// Its first actuator.
    first_actuator: usize,
    /// Its first constraint.
    first_constraint: usize,
    /// Its first geom among those that rangefinders see.
    first_ray_geom: usize,
}

impl BodyBuilder {
    /// Adds the sensors of a robot whose first body, actuator, constraint and tendon are given.
    pub(super) fn add_sensors(
        &mut self,
        robot: &Robot,
        dof_of: &[usize],
        carriers: &[Carrier],
        [first_body, first_actuator, first_constraint, first_tendon]: [usize; 4],
    ) {
        let Some(parts) = &robot.precompiled else {
            return;
        };
        let first = self.sensors.scalars;
        let refused = parts.sensors.refused.iter();
        self.sensor_infos
            .extend(parts.sensors.all.iter().map(|sensor| SensorInfo {
                name: format!("{}/{}", robot.name, sensor.name),
                place: first + sensor.place.start..first + sensor.place.end,
            }));
        self.refused_sensors
            .extend(refused.map(|what| format!("model `{}`: {what}", robot.name)));
        let scope = Scope {
            dof_of,
            lengths: Lengths {
                dof_of,
                tendons: &self.tendons,
                first_tendon,
            },
            carriers,
            welds: &parts.welds,
            dofs: &self.dofs,
            trees: &self.trees,
            frames: &self.outputs,
            first_body,
            first_actuator,
            first_constraint,
            first_ray_geom: self.sensors.geoms.len(),
        };
        let moment = scope.static_moment();
        for (sum, x) in self.static_moment.iter_mut().zip(moment) {
            *sum += x;
        }
        add_sensors(&mut self.sensors, &parts.sensors, &scope);
    }
}

/// Adds the sensors of a model. Until ties are known, limits name constraints.
fn add_sensors(sensors: &mut Sensors<f64>, parts: &SensorParts, scope: &Scope<'_>) {
    let first = sensors.scalars;
    sensors.geoms.extend(parts.geoms.iter().map(|geom| RayGeom {
        at: mounted_on(scope.carriers, &geom.on),
        kind: geom.kind,
        size: geom.size,
        boxes: None,
    }));
    for sensor in &parts.all {
        let Some(sense) = &sensor.sense else { continue };
        sensors.all.push(Sensor {
            kind: scope.kind(sense),
            first: first + sensor.place.start,
            cutoff: sensor
                .cutoff
                .map(|(most, is_two_sided)| Cutoff { most, is_two_sided }),
        });
    }
    sensors.scalars += parts.scalars;
}

impl Scope<'_> {
    fn kind(&self, sense: &Sense) -> SensorKind<f64> {
        let mount = |on| mounted_on(self.carriers, on);
        match sense {
            Sense::Vector(site, vector) => SensorKind::Vector(mount(site), *vector),
            Sense::Length { of, is_rate } => match is_rate {
                true => SensorKind::Rate(self.lengths.length(of)),
                false => SensorKind::Length(self.lengths.length(of)),
            },
            Sense::Actuator { actuator, is_rate } => match is_rate {
                true => SensorKind::ActuatorRate(self.first_actuator + actuator),
                false => SensorKind::ActuatorLength(self.first_actuator + actuator),
            },
            Sense::Ball { joint, is_rate } => {
                let dof = self.dof_of[*joint];
                match is_rate {
                    true => SensorKind::BallRate(dof),
                    false => SensorKind::BallQuat(self.dofs[dof].coord),
                }
            }
            Sense::Frame {
                part,
                of,
                from,
                is_local,
            } => SensorKind::Frame(FrameSensor {
                part: *part,
                of: mount(of),
                from: from.as_ref().map(mount),
                is_local: *is_local,
            }),
            Sense::Acceleration {
                of,
                is_angular,
                is_local,
            } => SensorKind::Acceleration(AccelerationSensor {
                of: match self.welds[of.link] {
                    // what MuJoCo welds to the world feels nothing, wherever it is put
                    0 => Mount {
                        body: None,
                        ..mount(of)
                    },
                    _ => mount(of),
                },
                is_angular: *is_angular,
                is_local: *is_local,
            }),
            Sense::Subtree(link, part) => SensorKind::Subtree(self.first_body + link, *part),
            Sense::Wrench { site, is_torque } => SensorKind::Wrench(WrenchSensor {
                site: mount(site),
                body: self.first_body + site.link,
                is_torque: *is_torque,
            }),
            Sense::ActuatorForces(actuators) => {
                let actuators = actuators
                    .iter()
                    .map(|actuator| self.first_actuator + actuator);
                SensorKind::ActuatorForces(actuators.collect())
            }
            Sense::JointActuatorForce(joint) => SensorKind::DofActuatorForce(self.dof_of[*joint]),
            Sense::JointLimit(joint, part) => SensorKind::DofLimit(self.dof_of[*joint], *part),
            Sense::ConstraintLimit(constraint, part) => {
                let constraints = constraint
                    .iter()
                    .map(|constraint| self.first_constraint + constraint);
                SensorKind::TieLimit(constraints.collect(), *part)
            }
            Sense::Touch(zone) => SensorKind::Touch(TouchSensor {
                zone: self.zone(zone),
                column: 0,
                classes: Vec::new(),
            }),
            Sense::Contact {
                zone,
                reduction,
                records,
                shows,
                rates,
                ..
            } => SensorKind::Contact(ContactSensor {
                zone: zone.as_ref().map(|zone| self.zone(zone)),
                column: 0,
                classes: Vec::new(),
                reduction: *reduction,
                records: *records,
                shows: *shows,
                capsules: Vec::new(),
                rates: rates.contains(&true).then(|| ContactRates {
                    shows: *rates,
                    column: 0,
                    bodies: Vec::new(),
                }),
            }),
            Sense::Range { site, geoms, shows } => {
                let geoms = geoms.iter().map(|geom| self.first_ray_geom + geom);
                SensorKind::Range(RangeSensor {
                    site: mount(site),
                    geoms: geoms.collect(),
                    shows: *shows,
                })
            }
            Sense::Distance { pairs, limit, part } => {
                let pairs = pairs.iter();
                SensorKind::Distance(DistanceSensor {
                    pairs: pairs
                        .map(|pair| pair.map(|geom| self.first_ray_geom + geom))
                        .collect(),
                    limit: *limit,
                    part: *part,
                })
            }
            Sense::Aimed { part, of, from } => SensorKind::Aimed(AimedSensor {
                part: *part,
                of: self.eye(of),
                from: from.as_ref().map(|from| self.eye(from)),
            }),
            Sense::Projection {
                camera,
                site,
                focal,
                middle,
            } => SensorKind::Projection(ProjectionSensor {
                camera: self.eye(camera),
                site: mount(site),
                focal: *focal,
                middle: *middle,
            }),
            Sense::Inside(zone, eye) => SensorKind::Inside(self.zone(zone), self.eye(eye)),
            Sense::PotentialEnergy => SensorKind::PotentialEnergy([0.0; 3]),
            Sense::KineticEnergy => SensorKind::KineticEnergy,
            Sense::Clock => SensorKind::Clock,
        }
    }

    fn zone(&self, zone: &ZonePart) -> Zone<f64> {
        Zone {
            site: mounted_on(self.carriers, &zone.site),
            kind: zone.kind,
            size: zone.size,
        }
    }

    fn eye(&self, eye: &EyePart) -> Eye<f64> {
        let place = |link: usize, is_center| match is_center {
            true => Place::Center(self.first_body + link),
            false => {
                let on = OnLink {
                    link,
                    pose: Pose::identity(),
                    is_inertial: false,
                };
                Place::Origin(mounted_on(self.carriers, &on))
            }
        };
        Eye {
            mount: mounted_on(self.carriers, &eye.on),
            aim: match eye.aim {
                AimPart::Fixed => Aim::Fixed,
                AimPart::LooksAt { link, is_center } => Aim::LooksAt(place(link, is_center)),
                AimPart::Follows {
                    is_center,
                    offset,
                    axes,
                } => {
                    // link 0 is the model's world, which the scene may turn
                    let world = &self.carriers[0].pose;
                    let column = |k: usize| world.rotate(axes.map(|row| row[k]));
                    let followed = place(eye.on.link, is_center);
                    Aim::Follows(followed, world.rotate(offset), [0, 1, 2].map(column))
                }
            },
        }
    }

    /// First moment of what stands still [kg·m].
    fn static_moment(&self) -> [f64; 3] {
        let bodies = &self.frames.bodies[self.first_body..];
        let fixed = bodies.iter().filter(|body| body.frame.body.is_none());
        fixed.fold([0.0; 3], |sum, body| {
            let base = body
                .inertial
                .tree
                .map_or([0.0; 3], |tree| self.trees[tree].base);
            std::array::from_fn(|i| sum[i] + body.mass * (base[i] + body.inertial.position[i]))
        })
    }
}

/// Gives potential energies the first moment of what stands still in all models, and limits their ties.
///
/// `constraint_of_tie` has the constraint of each tie.
pub(super) fn finish_sensors(
    sensors: &mut Sensors<f64>,
    static_moment: [f64; 3],
    constraint_of_tie: &[usize],
) {
    for sensor in &mut sensors.all {
        match &mut sensor.kind {
            SensorKind::PotentialEnergy(moment) => *moment = static_moment,
            SensorKind::TieLimit(ties, _) => {
                let constraints = std::mem::take(ties);
                let numbered_ties = constraint_of_tie.iter().enumerate();
                let limited_ties =
                    numbered_ties.filter(|(_, constraint)| constraints.contains(constraint));
                ties.extend(limited_ties.map(|(tie, _)| tie));
            }
            _ => {}
        }
    }
}
