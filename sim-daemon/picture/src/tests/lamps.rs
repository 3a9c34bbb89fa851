//! Lamps of a scene: what reaches a sheet, by the equations of `lamps.rs`.

use super::{HEIGHT, RED, WIDTH, at, ball, drawn, sheet, shot};
use crate::vector::Vector;
use crate::{Lamp, Rgb, Shot, View};

/// Shines from far above.
fn lamp() -> Lamp {
    Lamp {
        position: None,
        direction: [0.0, 0.0, -2.0],
        ambient: [0.1; 3],
        diffuse: [0.5, 0.4, 0.3],
        specular: [0.0; 3],
        attenuation: [1.0, 0.0, 0.0],
        cutoff: std::f32::consts::PI,
        exponent: 0.0,
        shadows: false,
    }
}

/// The pixel that shows a place of a large sheet at z = 0 from above, with a ball over the origin if there is one.
fn pixel([x, y]: [f64; 2], lamp: Lamp, height: Option<f64>) -> Rgb {
    let mut instances = vec![at(0, [0.0; 3])];
    instances.extend(height.map(|height| at(1, [0.0, 0.0, height])));
    let eye: Vector = [x, y - 3.0, 3.0];
    let up = [0.0, 0.0, 1.0];
    let view = View::looking(eye, [x, y, 0.0], up, 0.1, [WIDTH, HEIGHT]);
    let shot = Shot {
        view,
        lamps: &[lamp],
        ..shot(&instances)
    };
    let meshes = vec![sheet(5.0, [200, 200, 200, 255]), ball(0.2, 12, RED)];
    drawn(meshes, &shot)[HEIGHT / 2 * WIDTH + WIDTH / 2]
}

fn is_near(pixel: Rgb, wanted: [f64; 3]) -> bool {
    (0..3).all(|k| (f64::from(pixel[k]) - wanted[k]).abs() <= 1.0)
}

#[test]
fn a_surface_has_the_sum_of_ambient_and_diffuse_light() {
    let sum = |facing: f64| [0.5, 0.4, 0.3].map(|diffuse| 200.0 * (0.1 + diffuse * facing));
    assert!(is_near(pixel([0.3, 0.2], lamp(), None), sum(1.0)));
    let aslant = Lamp {
        direction: [0.6, 0.0, -0.8],
        ..lamp()
    };
    assert!(is_near(pixel([0.3, 0.2], aslant, None), sum(0.8)));
    let below = Lamp {
        direction: [0.0, 0.0, 1.0],
        ..lamp()
    };
    assert!(is_near(pixel([0.3, 0.2], below, None), sum(0.0)));
}

#[test]
fn a_lamp_at_a_place_fades_with_the_distance_and_off_its_axis() {
    let spot = Lamp {
        position: Some([0.0, 0.0, 2.0]),
        attenuation: [1.0, 0.25, 0.125],
        cutoff: 0.6,
        exponent: 2.0,
        ..lamp()
    };
    let wanted = |aside: f64| {
        let distance = aside.hypot(2.0);
        let cosine = 2.0 / distance;
        let fade = cosine.powi(2) / (1.0 + 0.25 * distance + 0.125 * distance.powi(2));
        [0.5, 0.4, 0.3].map(|diffuse| 200.0 * fade * (0.1 + diffuse * cosine))
    };
    assert!(is_near(pixel([0.0, 0.0], spot, None), wanted(0.0)));
    assert!(is_near(pixel([1.0, 0.0], spot, None), wanted(1.0)));
    // beyond the cone, whose half angle is 0.6 rad
    assert_eq!(pixel([1.6, 0.0], spot, None), [0; 3]);
}

#[test]
fn a_lamp_that_casts_shadows_leaves_its_ambient_light_behind_a_ball() {
    let casts = Lamp {
        shadows: true,
        ..lamp()
    };
    let above = Some(0.5);
    assert!(is_near(pixel([0.0, 0.0], casts, above), [20.0; 3]));
    assert_eq!(
        pixel([0.0, 0.0], lamp(), above),
        pixel([0.0, 0.0], lamp(), None)
    );
    assert_eq!(
        pixel([0.9, 0.0], casts, above),
        pixel([0.9, 0.0], lamp(), None)
    );
}

#[test]
fn a_lamp_has_a_highlight_where_a_surface_mirrors_it() {
    let glossy = Lamp {
        direction: [0.0, 1.0, -1.0],
        specular: [0.2; 3],
        diffuse: [0.0; 3],
        ..lamp()
    };
    // the ray falls at 45°, so the sheet mirrors light that comes from beyond it
    let mirrored = Lamp {
        direction: [0.0, -1.0, -1.0],
        ..glossy
    };
    assert!(is_near(pixel([0.0, 0.0], glossy, None), [20.0; 3]));
    let light = 20.0 + 0.5 * 0.2 * 255.0;
    assert!(is_near(pixel([0.0, 0.0], mirrored, None), [light; 3]));
}
