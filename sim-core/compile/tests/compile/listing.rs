//! Programs for people, and how long they may be.

use super::{addresses, compiled, tables, targets};
use sim_compile::{CompileError, Places, Program};
use sim_physics::lane::{Cx, Num};
use sim_physics::times;
use sim_record::record;

#[test]
fn a_program_that_would_be_too_long_is_refused() {
    let chain = |length: usize| {
        let recording = record(2, |_, x| {
            vec![(0..length).fold(x[0], |sum, _| sum.fma(sum, x[1]))]
        });
        recording.unwrap()
    };
    for (target, _) in targets() {
        assert!(compiled(&chain(100_000), target).is_ok());
        let error = compiled(&chain(200_001), target).unwrap_err();
        assert!(matches!(error, CompileError::TooLong { .. }), "{error}");
    }
}

#[test]
fn a_listing_has_every_instruction_of_the_program() {
    let recording = record(2, |cx, x| {
        cx.begin_part("first");
        let product = x[0] * x[1];
        cx.begin_part("second");
        let mut sum = cx.var(product);
        times!(cx, 3, {
            let more = cx.get(&sum).fma(x[0], product);
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    let recording = recording.unwrap();
    let places = Places {
        inputs: &addresses(0, 2),
        outputs: &addresses(1, 1),
        memory: None,
    };
    for (target, _) in targets() {
        let program = Program::new(&recording, &places, &tables(), target).unwrap();
        let lines = Program::listing(&recording, &places, &tables(), target).unwrap();
        let instructions: Vec<&String> = lines.iter().flat_map(|line| &line.instructions).collect();
        assert_eq!(instructions.len(), program.size().instructions);
        let bytes: usize = lines.iter().map(|line| line.bytes).sum();
        assert_eq!(bytes, program.size().bytes);
        let texts_of = |part: &str| {
            let lines = lines
                .iter()
                .filter(|line| line.origin.is_some_and(|o| o.part == part));
            let texts: Vec<String> = lines.flat_map(|line| line.instructions.clone()).collect();
            texts.join("\n")
        };
        assert!(texts_of("first").contains("vmulps"), "{lines:?}");
        assert!(texts_of("second").contains("vfmadd"), "{lines:?}");
        // the loop jumps back to where it begins, inside the program
        let jump = instructions
            .iter()
            .find(|text| text.starts_with("jmp"))
            .unwrap();
        let target = jump.trim_start_matches("jmp ").trim_end_matches('h');
        let target = usize::from_str_radix(target, 16).unwrap();
        assert!(0 < target && target < bytes, "{jump}");
        // its parts are the program
        let parts: Vec<_> = program.parts().collect();
        assert_eq!(
            parts.iter().map(|(_, bytes, _)| bytes).sum::<usize>(),
            bytes
        );
        let names: Vec<&str> = parts.iter().map(|(.., name)| *name).collect();
        assert_eq!(
            names,
            ["entry and exit", "first", "second", "entry and exit"]
        );
    }
}
