//! Files that the project's own examples write, and weights as they store them.

use super::{PolicyError, evaluated, field, file, integer, node, number, parsed, read, refused};

/// The policies that see: they have filters, which no multilayer perceptron has.
const SEEING: [&str; 1] = ["FrankaPickCubeDepth"];

#[test]
fn every_committed_policy_is_read_but_those_that_see() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/trained");
    let mut count = 0;
    let mut refused = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "onnx") {
            continue;
        }
        let policy = match parsed(&std::fs::read(&path).unwrap()) {
            Ok(policy) => policy,
            Err(error) => {
                assert!(
                    matches!(error, PolicyError::Operator { .. }),
                    "{path:?}: {error}"
                );
                refused.push(path.file_stem().unwrap().to_str().unwrap().to_owned());
                continue;
            }
        };
        let sizes = |name: &str| {
            let texts = policy.metadata.iter().find(|(known, _)| known == name);
            texts.unwrap().1.split(',').count()
        };
        assert_eq!(
            policy.network.inputs(),
            sizes("observation_low"),
            "{path:?}"
        );
        assert_eq!(policy.network.outputs(), sizes("action_low"), "{path:?}");
        count += 1;
    }
    assert!(count >= 9);
    assert_eq!(refused, SEEING);
}

/// A matrix of two rows of two numbers in half precision, and the nodes that take it.
fn halves(values: &[u8]) -> (Vec<u8>, [Vec<u8>; 2]) {
    let shape = [number(1, 2), number(1, 2)].concat();
    let half = [&shape[..], &number(2, 10), &field(8, b"half"), values].concat();
    let nodes = [
        node("Cast", &["half"], "w", &[integer("to", 1)]),
        node("Gemm", &["obs", "w"], "action", &[integer("transB", 1)]),
    ];
    (half, nodes)
}

/// `examples/policy_file.py --half` writes such weights, raw; other exporters write their bits as integers, or beside the
/// file.
#[test]
fn weights_in_half_precision_are_read() {
    // 1, -2, 0.5 and 2⁻²⁴, the least that half precision has (IEEE 754)
    let bits = [0x3c00_u16, 0xc000, 0x3800, 0x0001];
    let raw: Vec<u8> = bits.iter().flat_map(|bits| bits.to_le_bytes()).collect();
    let integers = bits.iter().flat_map(|&bits| number(5, bits.into()));
    let place = [field(1, b"location"), field(2, b"data")].concat();
    let beside = [number(14, 1), field(13, &place)].concat();
    let file_beside = |name: &str, offset: u64, length: u64| {
        assert_eq!((name, offset, length), ("data", 0, 8));
        Ok(raw.clone())
    };
    for values in [field(9, &raw), integers.collect(), beside] {
        let (half, nodes) = halves(&values);
        let policy = read(&file(&nodes, &[half], Some(2)), None, &file_beside).unwrap();
        let expected = [1.0 - 2.0, 0.5 + 2f32.powi(-24)];
        assert_eq!(evaluated(&policy, &[1.0, 1.0]), expected);
    }
}

#[test]
fn bits_that_half_precision_does_not_have_are_refused() {
    for wrong in [0x1_3c00, u64::MAX] {
        let bits = [0x3c00, 0x3c00, wrong, 0x3c00].map(|bits| number(5, bits));
        let (half, nodes) = halves(&bits.concat());
        let refused = refused(&nodes, &[half]);
        assert!(
            refused.contains("as the bits of a float16; export the policy anew"),
            "{refused}"
        );
    }
}
