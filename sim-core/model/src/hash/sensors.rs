//! Sensors of models from MuJoCo.

use sim_physics::constants::sensors::{
    AccelerationSensor, Aim, AimedSensor, ContactRates, ContactSensor, Cutoff, DistancePart,
    DistanceSensor, Eye, FramePart, FrameSensor, LimitPart, Place, ProjectionSensor, RangeSensor,
    RayGeom, RayTables, Reduction, Sensor, SensorKind, Sensors, SubtreePart, TouchSensor,
    WrenchSensor, Zone, ZoneKind,
};

use super::text::{Text, View, view, words};

view! {
    Sensors<f64> as "Sensors":
        Always {
            "all": all,
            "scalars": scalars,
            "records": records,
            "pairs": pairs,
            "geoms": geoms,
        }
        Later { "triangles": triangles }
        => ranks;
    RayGeom<f64> as "RayGeom":
        Always { "at": at, "kind": kind, "size": size }
        Later { "boxes": boxes };
    RayTables as "RayTables":
        Always { "boxes": boxes, "spans": spans, "triangles": triangles };
    Sensor<f64> as "Sensor":
        Always { "kind": kind, "first": first, "cutoff": cutoff };
    Cutoff<f64> as "Cutoff":
        Always { "most": most, "is_two_sided": is_two_sided };
    FrameSensor<f64> as "FrameSensor":
        Always { "part": part, "of": of, "from": from, "is_local": is_local };
    Eye<f64> as "Eye":
        Always { "mount": mount, "aim": aim };
    AimedSensor<f64> as "AimedSensor":
        Always { "part": part, "of": of, "from": from };
    ProjectionSensor<f64> as "ProjectionSensor":
        Always { "camera": camera, "site": site, "focal": focal, "middle": middle };
    DistanceSensor<f64> as "DistanceSensor":
        Always { "pairs": pairs, "limit": limit, "part": part };
    AccelerationSensor<f64> as "AccelerationSensor":
        Always { "of": of, "is_angular": is_angular, "is_local": is_local };
    WrenchSensor<f64> as "WrenchSensor":
        Always { "site": site, "body": body, "is_torque": is_torque };
    TouchSensor<f64> as "TouchSensor":
        Always { "zone": zone, "column": column, "classes": classes };
    ContactSensor<f64> as "ContactSensor":
        Always {
            "zone": zone,
            "column": column,
            "classes": classes,
            "reduction": reduction,
            "records": records,
            "shows": shows,
            "capsules": capsules,
        }
        Later { "rates": rates };
    ContactRates as "ContactRates":
        Always { "shows": shows, "column": column, "bodies": bodies };
    Zone<f64> as "Zone":
        Always { "site": site, "kind": kind, "size": size };
}

words! {
    DistancePart: Distance "Distance", Normal "Normal", Ends "Ends";
    ZoneKind: Sphere "Sphere", Capsule "Capsule", Ellipsoid "Ellipsoid", Cylinder "Cylinder", Box "Box";
    Reduction: First "First", LeastDistance "LeastDistance", LargestForce "LargestForce", NetForce "NetForce";
    SubtreePart: Center "Center", Velocity "Velocity", AngularMomentum "AngularMomentum";
    LimitPart: Position "Position", Velocity "Velocity", Force "Force";
}

impl View for FramePart {
    fn write(&self, text: &mut Text) {
        match self {
            FramePart::Position => text.put("Position"),
            FramePart::Quat => text.put("Quat"),
            FramePart::Axis(axis) => text.tuple("Axis", &[axis]),
            FramePart::Velocity => text.put("Velocity"),
            FramePart::Spin => text.put("Spin"),
        }
    }
}

impl View for SensorKind<f64> {
    fn write(&self, text: &mut Text) {
        match self {
            SensorKind::Vector(mount, vector) => text.tuple("Vector", &[mount, vector]),
            SensorKind::Length(terms) => text.tuple("Length", &[terms]),
            SensorKind::Rate(terms) => text.tuple("Rate", &[terms]),
            SensorKind::ActuatorLength(actuator) => text.tuple("ActuatorLength", &[actuator]),
            SensorKind::ActuatorRate(actuator) => text.tuple("ActuatorRate", &[actuator]),
            SensorKind::BallQuat(coord) => text.tuple("BallQuat", &[coord]),
            SensorKind::BallRate(dof) => text.tuple("BallRate", &[dof]),
            SensorKind::Frame(frame) => text.tuple("Frame", &[frame]),
            SensorKind::Acceleration(frame) => text.tuple("Acceleration", &[frame]),
            SensorKind::Subtree(body, part) => text.tuple("Subtree", &[body, part]),
            SensorKind::Wrench(wrench) => text.tuple("Wrench", &[wrench]),
            SensorKind::ActuatorForces(actuators) => text.tuple("ActuatorForces", &[actuators]),
            SensorKind::DofActuatorForce(dof) => text.tuple("DofActuatorForce", &[dof]),
            SensorKind::DofLimit(dof, part) => text.tuple("DofLimit", &[dof, part]),
            SensorKind::TieLimit(ties, part) => text.tuple("TieLimit", &[ties, part]),
            SensorKind::Touch(touch) => text.tuple("Touch", &[touch]),
            SensorKind::Contact(contact) => text.tuple("Contact", &[contact]),
            // one that shows a distance has the text of the release that had no other
            SensorKind::Range(RangeSensor { site, geoms, shows }) => match shows {
                [true, false, false, false, false, false] => text.tuple("Range", &[site, geoms]),
                _ => text.tuple("Range", &[site, geoms, shows]),
            },
            SensorKind::Distance(distance) => text.tuple("Distance", &[distance]),
            SensorKind::Aimed(frame) => text.tuple("Aimed", &[frame]),
            SensorKind::Projection(projection) => text.tuple("Projection", &[projection]),
            SensorKind::Inside(zone, eye) => text.tuple("Inside", &[zone, eye]),
            SensorKind::PotentialEnergy(moment) => text.tuple("PotentialEnergy", &[moment]),
            SensorKind::KineticEnergy => text.put("KineticEnergy"),
            SensorKind::Clock => text.put("Clock"),
        }
    }
}

impl View for Aim<f64> {
    fn write(&self, text: &mut Text) {
        match self {
            Aim::Fixed => text.put("Fixed"),
            Aim::Follows(place, offset, axes) => text.tuple("Follows", &[place, offset, axes]),
            Aim::LooksAt(place) => text.tuple("LooksAt", &[place]),
        }
    }
}

impl View for Place<f64> {
    fn write(&self, text: &mut Text) {
        match self {
            Place::Origin(mount) => text.tuple("Origin", &[mount]),
            Place::Center(body) => text.tuple("Center", &[body]),
        }
    }
}
