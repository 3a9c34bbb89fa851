//! Whole programs: their source, and their results against the scalar backend.

use crate::{TABLE, accepted, c, toy};
use sim_physics::lane::{Cx, Num};
use sim_record::wgsl::{Corrections, ProgramOptions, wgsl};
use sim_record::{Recorded, record};

#[test]
fn constants_read_back_from_the_program_bit_for_bit() {
    let mut random = toy::Random(1);
    let mut constants = vec![
        1e-5f32,
        f32::MIN_POSITIVE,
        f32::MAX,
        -f32::MAX,
        1e-44,
        -0.1,
        16777216.0,
    ];
    constants.extend(
        std::iter::repeat_with(|| f32::from_bits(random.bits() as u32))
            .filter(|x| x.is_finite())
            .take(1000),
    );
    let recording = record(1, |_, x| {
        constants
            .iter()
            .map(|k| x[0].max(Recorded::k(*k)))
            .collect()
    });
    let recording = recording.expect("constants are recorded");
    let module = toy::validated(&wgsl(&recording, &ProgramOptions::default()));
    let mut literals = std::collections::HashSet::new();
    for (_, expression) in module.entry_points[0].function.expressions.iter() {
        if let naga::Expression::Literal(naga::Literal::F32(x)) = expression {
            literals.insert(x.to_bits());
        }
    }
    for k in constants {
        let bits = k.to_bits();
        // a negative number may be the negation of a literal
        assert!(
            literals.contains(&bits) || literals.contains(&(-k).to_bits()),
            "{k:?}"
        );
    }
}

#[test]
fn infinite_constants_become_the_largest_numbers() {
    let good = accepted(|_, x| {
        let infinity = Recorded::k(f32::INFINITY);
        vec![
            x[0].min(infinity),
            x[0].max(-infinity),
            Num::select(x[0].lt(x[1]), infinity, x[0]),
        ]
    });
    let program = wgsl(&good, &ProgramOptions::default());
    assert_eq!(good.statements().lets, 2, "a limit at infinity is none");
    assert!(
        program.contains("3.4028235e38f") && !program.contains("inf"),
        "{program}"
    );
}

#[test]
fn fields_and_names_of_a_program_are_the_callers() {
    let recording = accepted(|cx, x| {
        let row = cx.at(1);
        cx.store(TABLE, row, 1, x[1]);
        vec![x[0] + x[1]]
    });
    let options = ProgramOptions {
        entry: "kinematics".to_owned(),
        workgroup: 64,
        inputs: Some(vec![12, 7]),
        outputs: Some(vec![12]),
        ..ProgramOptions::default()
    };
    let program = wgsl(&recording, &options);
    let module = toy::validated(&program);
    assert_eq!(module.entry_points[0].name, "kinematics");
    for line in [
        "override workgroup: u32 = 64u;",
        "if (world >= worlds) { return; }",
        "let x1 = fields[1u * worlds + world].w;",
        "scratch[0u * worlds + world].w = x1;",
        "fields[3u * worlds + world].x = t2;",
    ] {
        assert!(program.contains(line), "{line} is not in\n{program}");
    }
}

#[test]
fn corrected_operations_are_functions() {
    let recording = accepted(|_, x| vec![x[0].fma(x[1], x[0]).div(x[1]), (x[0] * x[1]).sqrt()]);
    let corrections = Corrections {
        fma: true,
        quotient: true,
        root: true,
    };
    let options = ProgramOptions {
        corrections,
        ..ProgramOptions::default()
    };
    let program = wgsl(&recording, &options);
    toy::validated(&program);
    let [_, body] = program.split("@compute").collect::<Vec<_>>()[..] else {
        panic!("{program}");
    };
    for function in ["fused(x0, x1, x0)", "quotient(t", "root(t"] {
        assert!(body.contains(function), "{function} is not in\n{body}");
    }
    // the functions do not call the driver's fma either
    assert!(
        !program.contains("fma(") && !body.contains("sqrt("),
        "{program}"
    );
    let plain = wgsl(&recording, &ProgramOptions::default());
    assert!(plain.contains("fma(x0, x1, x0)") && !plain.contains("fn fused"));
}

#[test]
fn random_programs_evaluate_as_scalar_f32_runs() {
    let mut loops = 0;
    for seed in 0..300 {
        let mut random = toy::Random(seed);
        let steps = toy::program(&mut random, 3, 4, 12);
        let worlds = toy::worlds::<{ toy::INPUTS }>(&mut random, 24);
        let scalar = toy::on_cpu::<f32>(&steps, &worlds);
        let recording = toy::recorded(&steps);
        loops += recording.statements().loops;
        toy::validated(&wgsl(&recording, &ProgramOptions::default()));
        for (world, expected) in worlds.iter().zip(&scalar) {
            let got = recording.evaluate(world, &mut [0.0; toy::SCRATCH], &toy::tables());
            let same = got
                .iter()
                .zip(expected)
                .all(|(a, b)| toy::bits(*a) == toy::bits(*b));
            assert!(
                same,
                "seed {seed}: {got:?}, not {expected:?} from {world:?}, {steps:#?}"
            );
        }
    }
    assert!(loops > 1000, "the programs have loops: {loops}");
}

#[test]
fn recording_twice_gives_the_same_program() {
    let steps = toy::program(&mut toy::Random(3), 3, 4, 12);
    let options = ProgramOptions::default();
    assert_eq!(
        wgsl(&toy::recorded(&steps), &options),
        wgsl(&toy::recorded(&steps), &options)
    );
}

#[test]
fn five_thousand_statements_are_recorded_in_milliseconds() {
    let once = || {
        let start = std::time::Instant::now();
        let recording = record(2, |_, x| {
            let mut sum = x[0];
            for k in 0..5000 {
                sum = sum.fma(x[k % 2], c(k as f64));
            }
            vec![sum]
        });
        let taken = start.elapsed();
        assert!(recording.expect("a sum is recorded").statements().total() >= 5000);
        taken
    };
    // the fastest of several, so that a busy computer does not count; 1 ms is usual
    let fastest = (0..10).map(|_| once()).min().expect("it was recorded");
    assert!(fastest.as_millis() < 20, "{fastest:?}");
}
