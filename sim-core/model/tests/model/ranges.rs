//! Ranges of parameters: what names mean, which one holds, and what is refused.

use proptest::prelude::*;
use sim_model::{Body, Collision, Description, Distribution, ParamDraw, Pose, Shape, UrdfOptions};
use sim_physics::constants::params::Param;

use crate::build::{INERTIAL, joint, link};

const SOME: Distribution = Distribution::Uniform {
    low: 0.5,
    high: 0.75,
};

/// `arm` with the joints `hinge` and `ball`, a floating `dog` of the same file, a cube, and the ground.
fn scene() -> Description {
    let text = link("base", INERTIAL)
        + &link("upper", INERTIAL)
        + &link("lower", INERTIAL)
        + &joint(
            "hinge",
            "continuous",
            "base",
            "upper",
            "<axis xyz=\"0 1 0\"/>",
        )
        + &joint("ball", "spherical", "upper", "lower", "");
    let text = format!("<robot name=\"r\">\n{text}</robot>");
    let mut scene = Description::new(0.002, 1);
    for (name, floating) in [("arm", false), ("dog", true)] {
        let options = UrdfOptions {
            floating,
            ..UrdfOptions::named(name)
        };
        let robot = sim_model::Robot::from_urdf_text(&text, "x.urdf", options).unwrap();
        scene.add_robot(robot).unwrap();
    }
    let half_extents = [0.1; 3];
    let shape = |name: &str| {
        let shape = Shape::Box { half_extents };
        Collision::new(Some(name.to_owned()), shape, Pose::identity())
    };
    let mut cube = Body::new("cube", Pose::identity());
    cube.shapes.push((shape("box"), 1000.0));
    cube.shapes.push((shape("lid"), 1000.0));
    scene.add_body(cube).unwrap();
    scene.add_shape("ground", Shape::Plane, Pose::identity());
    scene.add_link_shape("arm", "lower", shape("tip")).unwrap();
    scene
}

fn with(ranges: &[(Param, &str, Distribution)]) -> Description {
    let mut scene = scene();
    for &(param, name, distribution) in ranges {
        let of_param = scene.param_ranges.entry(param).or_default();
        of_param.insert(name.to_owned(), distribution);
    }
    scene
}

fn draws(ranges: &[(Param, &str, Distribution)]) -> Vec<ParamDraw> {
    let model = with(ranges).compile().unwrap();
    for (param, ..) in ranges {
        assert!(model.constants().varying.first(*param).is_some());
    }
    model.start().params.clone()
}

/// Columns that one name draws.
fn columns(param: Param, name: &str) -> Vec<usize> {
    let draws = draws(&[(param, name, SOME)]);
    assert!(
        draws
            .iter()
            .all(|draw| (draw.param, draw.distribution) == (param, SOME))
    );
    draws.iter().map(|draw| draw.column).collect()
}

#[test]
fn names_mean_what_arrays_call_by_them() {
    let model = scene().compile().unwrap();
    let places = |names: &[String], meant: &[&str]| -> Vec<usize> {
        let place = |name: &&str| names.iter().position(|other| other == name).unwrap();
        let mut places: Vec<usize> = meant.iter().map(place).collect();
        places.sort_unstable();
        places
    };
    let dofs = |meant: &[&str]| places(model.dof_names(), meant);
    let ball = ["arm/ball.wx", "arm/ball.wy", "arm/ball.wz"];
    let arm = [&["arm/hinge"][..], &ball].concat();
    for (name, meant) in [
        ("arm", &arm[..]),
        ("arm/hinge", &["arm/hinge"]),
        ("arm/ball", &ball),
        ("arm/ball.wy", &["arm/ball.wy"]),
    ] {
        assert_eq!(columns(Param::JointDamping, name), dofs(meant), "{name}");
        assert_eq!(columns(Param::JointTargetKd, name), dofs(meant), "{name}");
    }
    // a free joint has damping and armature, but no drive
    assert_eq!(columns(Param::JointArmature, "cube").len(), 6);
    let dog = ["dog/hinge", "dog/ball.wx", "dog/ball.wy", "dog/ball.wz"];
    assert_eq!(columns(Param::JointEffortLimit, "dog"), dofs(&dog));
    assert_eq!(columns(Param::JointArmature, "dog").len(), 10);

    let bodies = |meant: &[&str]| places(model.body_names(), meant);
    for (name, meant) in [
        ("arm", &["arm/base", "arm/upper", "arm/lower"][..]),
        ("dog/upper", &["dog/upper"]),
        ("cube", &["cube/body"]),
    ] {
        assert_eq!(columns(Param::BodyMassScale, name), bodies(meant), "{name}");
    }
    let shapes = |meant: &[&str]| places(model.shape_names(), meant);
    for (name, meant) in [
        ("ground", &["ground"][..]),
        ("cube", &["cube/box", "cube/lid"]),
        ("cube/lid", &["cube/lid"]),
        ("arm", &["arm/lower/tip"]),
        ("arm/lower", &["arm/lower/tip"]),
        ("arm/lower/tip", &["arm/lower/tip"]),
    ] {
        assert_eq!(columns(Param::ShapeMu, name), shapes(meant), "{name}");
    }
    assert_eq!(columns(Param::Gravity, "y"), [1]);
}

#[test]
fn the_more_special_name_holds() {
    let other = |high| Distribution::Uniform { low: 0.0, high };
    let (joint, part) = (other(2.0), other(3.0));
    let drawn = draws(&[
        (Param::JointDamping, "arm", SOME),
        (Param::JointDamping, "arm/ball", joint),
        (Param::JointDamping, "arm/ball.wy", part),
        (Param::ShapeMu, "cube", SOME),
        (Param::ShapeMu, "cube/lid", part),
    ]);
    let distributions: Vec<Distribution> = drawn.iter().map(|draw| draw.distribution).collect();
    assert_eq!(distributions, [SOME, joint, part, joint, SOME, part]);
}

#[test]
fn ranges_are_part_of_the_hash() {
    let hash = |ranges: &[(Param, &str, Distribution)]| with(ranges).compile().unwrap().hash();
    let wider = Distribution::Uniform {
        low: 0.5,
        high: 0.76,
    };
    let hashes = [
        hash(&[]),
        hash(&[(Param::Gravity, "x", SOME)]),
        hash(&[(Param::Gravity, "x", wider)]),
        hash(&[(Param::Gravity, "y", SOME)]),
    ];
    for (i, a) in hashes.iter().enumerate() {
        assert!(hashes[..i].iter().all(|b| a != b), "{i}");
    }
}

#[test]
fn ranges_that_cannot_be_are_refused_by_name() {
    let uniform = |low, high| Distribution::Uniform { low, high };
    let normal = |mean, std| Distribution::Normal { mean, std };
    for (param, name, distribution, message) in [
        (
            Param::BodyF,
            "arm",
            SOME,
            "randomize: body_f of `arm`: it is a load, which a reset clears; write it with the steps that it acts in",
        ),
        (
            Param::ShapeMu,
            "cube/top",
            SOME,
            "randomize: shape_mu of `cube/top`: nothing that it varies has this name; there are: `cube/box`, `cube/lid`",
        ),
        (
            Param::BodyMassScale,
            "arm/",
            SOME,
            "randomize: body_mass_scale of `arm/`: nothing that it varies has this name; there are: `arm/base`, `arm/upper`, `arm/lower`",
        ),
        (
            Param::ShapeMu,
            "cub",
            SOME,
            "randomize: shape_mu of `cub`: nothing that it varies has this name; there are: `ground`, `arm`, `cube`",
        ),
        (
            Param::JointTargetKe,
            "cube",
            SOME,
            "randomize: joint_target_ke of `cube`: nothing that it varies has this name; there are: `arm`, `dog`",
        ),
        (
            Param::Gravity,
            "w",
            SOME,
            "randomize: gravity of `w`: nothing that it varies has this name; there are: `x`, `y`, `z`",
        ),
        (
            Param::Gravity,
            "",
            SOME,
            "randomize: gravity: give distributions by name; there are: `x`, `y`, `z`",
        ),
        (
            Param::ShapeMu,
            "ground",
            uniform(-0.1, 1.0),
            "randomize: shape_mu of `ground`: low is -0.1; give at least 0",
        ),
        (
            Param::BodyMassScale,
            "arm",
            uniform(0.0, 1.0),
            "randomize: body_mass_scale of `arm`: low is 0; give at least 0.001",
        ),
        (
            Param::JointDamping,
            "arm",
            normal(-1.0, 1.0),
            "randomize: joint_damping of `arm`: mean is -1; give at least 0",
        ),
        (
            Param::JointDamping,
            "arm",
            normal(1.0, -1.0),
            "randomize: joint_damping of `arm`: std is -1; it must not be negative",
        ),
        (
            Param::JointDamping,
            "arm",
            uniform(2.0, 1.0),
            "randomize: joint_damping of `arm`: low is 2 and high is 1; low must not be above high",
        ),
        (
            Param::JointDamping,
            "arm",
            uniform(f64::NAN, 1.0),
            "randomize: joint_damping of `arm`: low is NaN; give a finite number",
        ),
        (
            Param::JointEffortLimit,
            "arm",
            uniform(1.0, 1e7),
            "randomize: joint_effort_limit of `arm`: high is 1e7; give at most 1e6",
        ),
    ] {
        let refused = with(&[(param, name, distribution)]).validate().unwrap_err();
        assert_eq!(refused.to_string(), message);
    }
}

/// Numbers of every kind, those that make sense more often.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![3 => 0.0..10.0f64, 1 => -1e7..1e7f64, 1 => any::<f64>()]
}

fn any_distribution() -> impl Strategy<Value = Distribution> {
    (any::<bool>(), any_number(), any_number()).prop_map(|(is_uniform, a, b)| match is_uniform {
        true => Distribution::Uniform { low: a, high: b },
        false => Distribution::Normal { mean: a, std: b },
    })
}

fn any_name() -> impl Strategy<Value = String> {
    let known = [
        "",
        "x",
        "z",
        "arm",
        "arm/hinge",
        "arm/ball",
        "arm/ball.wx",
        "arm/upper",
        "dog",
        "cube",
        "cube/body",
        "cube/box",
        "ground",
        "arm/lower/tip",
        "arm/",
        "/",
    ];
    let known = prop::sample::select(known.map(str::to_owned).to_vec());
    prop_oneof![9 => known, 1 => ".{0,6}"]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_range_is_refused_by_name_or_drawn_within_its_parameter(
        ranges in prop::collection::vec(
            (prop::sample::select(Param::ALL.to_vec()), any_name(), any_distribution()),
            1..4,
        ),
    ) {
        let mut scene = scene();
        for (param, name, distribution) in &ranges {
            let of_param = scene.param_ranges.entry(*param).or_default();
            of_param.insert(name.clone(), *distribution);
        }
        match scene.compile() {
            Err(error) => {
                let message = error.to_string();
                let names = ranges.iter().map(|(param, ..)| format!("randomize: {}", param.row().name));
                prop_assert!(names.into_iter().any(|name| message.starts_with(&name)), "{}", message);
            }
            Ok(model) => {
                for draw in &model.start().params {
                    prop_assert!(!draw.param.is_load() && draw.column < draw.param.columns(&model.sizes()));
                    let least = draw.param.row().least.unwrap_or(f64::NEG_INFINITY);
                    let number = match draw.distribution {
                        Distribution::Uniform { low, high } => {
                            prop_assert!(low <= high && high <= 1e6);
                            low
                        }
                        Distribution::Normal { mean, std } => {
                            prop_assert!((0.0..=1e6).contains(&std));
                            mean
                        }
                    };
                    prop_assert!(number >= least && number.abs() <= 1e6);
                }
            }
        }
    }
}
