//! Frames.

use proptest::prelude::*;
use sim_model::Pose;

/// Roundings of a handful of products of numbers below 10.
const ROUNDING: f64 = 1e-13;

fn any_pose() -> impl Strategy<Value = Pose> {
    (
        prop::array::uniform3(-2.0..2.0_f64),
        prop::array::uniform3(-4.0..4.0_f64),
    )
        .prop_map(|(pos, rpy)| Pose::from_rpy(pos, rpy))
}

fn near(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|i| (a[i] - b[i]).abs() < ROUNDING)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn product_transforms_as_one_after_the_other(a in any_pose(), b in any_pose(), x in prop::array::uniform3(-2.0..2.0_f64)) {
        prop_assert!(near(a.mul(&b).transform(x), a.transform(b.transform(x))));
    }

    #[test]
    fn inverse_undoes(a in any_pose(), x in prop::array::uniform3(-2.0..2.0_f64)) {
        prop_assert!(near(a.inverse().transform(a.transform(x)), x));
        prop_assert!(near(a.mul(&a.inverse()).transform(x), x));
    }

    #[test]
    fn rpy_is_roll_then_pitch_then_yaw_about_fixed_axes(rpy in prop::array::uniform3(-4.0..4.0_f64), x in prop::array::uniform3(-2.0..2.0_f64)) {
        let roll = Pose::about([1.0, 0.0, 0.0], rpy[0]);
        let pitch = Pose::about([0.0, 1.0, 0.0], rpy[1]);
        let yaw = Pose::about([0.0, 0.0, 1.0], rpy[2]);
        prop_assert!(near(Pose::from_rpy([0.0; 3], rpy).rotate(x), yaw.rotate(pitch.rotate(roll.rotate(x)))));
    }

    #[test]
    fn rotation_is_orthonormal_even_from_a_rounded_quaternion(a in any_pose(), scale in 0.99..1.01_f64) {
        let r = Pose { quat: a.quat.map(|part| part * scale), ..a }.rotation();
        for i in 0..3 {
            for j in 0..3 {
                let dot: f64 = (0..3).map(|k| r[i][k] * r[j][k]).sum();
                prop_assert!((dot - f64::from(u8::from(i == j))).abs() < ROUNDING);
            }
        }
    }
}

#[test]
fn quarter_turn_about_z_turns_x_into_y() {
    let quarter = Pose::about([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_2);
    assert!(near(quarter.rotate([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]));
}

#[test]
fn normalizing_mends_roundings_and_leaves_slips_to_be_refused() {
    let rounded = Pose {
        pos: [0.0; 3],
        quat: [0.0, 0.0, 0.7, 0.7],
    }
    .normalized();
    assert!((rounded.quat_length() - 1.0).abs() < 1e-15);
    let slip = Pose {
        pos: [0.0; 3],
        quat: [0.0, 0.0, 1.0, 1.0],
    };
    assert_eq!(slip.normalized(), slip);
}
