//! Files that name more than they have.

use super::chain::CONSTANTS_MAX;
use super::tensor::within;
use super::tests::{field, file, integer, node, number, parsed, refused, tensor};

/// A tensor without numbers, of that shape.
fn empty(name: &str, shape: &[u64]) -> Vec<u8> {
    tensor(name, shape, &[])
}

#[test]
fn an_axis_of_none_or_of_too_many_entries_is_refused_before_any_loop() {
    for shape in [
        &[0, u64::MAX >> 1][..],
        &[1 << 40, 0],
        &[0, 0],
        &[(1 << 24) + 1, 1],
    ] {
        for transposed in [0, 1] {
            let gemm = node(
                "Gemm",
                &["obs", "w"],
                "action",
                &[integer("transB", transposed)],
            );
            let reason = refused(&[gemm], &[empty("w", shape)]);
            assert!(
                reason.contains("axes have 1 to 16777216 entries"),
                "{reason}"
            );
        }
    }
}

#[test]
fn a_small_file_cannot_have_more_parameters_than_its_layers_may() {
    // an input of 2¹⁸ values, with a factor for each in five layers
    let names: Vec<String> = (0..5).map(|k| format!("x{k}")).collect();
    let mut nodes = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let before = if k == 0 { "obs" } else { &names[k - 1] };
        nodes.push(node("Mul", &[before, "two"], name, &[]));
    }
    nodes.push(node("Identity", &["x4"], "action", &[]));
    let bytes = file(&nodes, &[tensor("two", &[], &[2.0])], Some(1 << 18));
    let reason = parsed(&bytes).unwrap_err().to_string();
    assert!(
        reason.contains(&format!("more than {CONSTANTS_MAX} parameters")),
        "{reason}"
    );
}

#[test]
fn weights_that_many_layers_share_count_for_each_of_them() {
    // 2¹⁸ weights; five layers have more than 2²⁰ of them
    let values = vec![0.0; 1 << 18];
    let mut nodes: Vec<_> = (0..5)
        .map(|k| node("MatMul", &["obs", "w"], &format!("x{k}"), &[]))
        .collect();
    nodes.push(node("Identity", &["x0"], "action", &[]));
    let reason = refused(&nodes, &[tensor("w", &[1 << 9, 1 << 9], &values)]);
    assert!(reason.contains("computes more than"), "{reason}");
}

#[test]
fn all_weights_beside_a_file_share_one_budget() {
    let external = |_: &str, _: u64, length: u64| Ok(vec![0; length as usize]);
    let read = within(&external, 40);
    assert_eq!(read("data", 0, 16).unwrap().len(), 16);
    assert_eq!(read("data", 0, 16).unwrap().len(), 16);
    let reason = read("data", 0, 16).unwrap_err();
    assert!(reason.contains("have more than 40 bytes"), "{reason}");
    assert_eq!(read("data", 0, 8).unwrap().len(), 8);
    // one tensor of 2³⁰ or of 2⁶³ numbers is refused before it is read
    let location = [field(1, b"location"), field(2, b"data")].concat();
    for axes in [&[1 << 15, 1 << 15][..], &[1 << 24, 1 << 24, 1 << 15]] {
        let mut huge: Vec<_> = axes.iter().map(|&axis| number(1, axis)).collect();
        huge.extend([number(2, 1), field(8, b"w"), number(14, 1)]);
        huge.push(field(13, &location));
        let gemm = node("Gemm", &["obs", "w"], "action", &[]);
        let reason = refused(&[gemm], &[huge.concat()]);
        assert!(
            reason.contains("have more than 1073741824 bytes"),
            "{reason}"
        );
    }
}

#[test]
fn the_input_is_the_first_argument_where_the_order_matters() {
    for operator in ["Relu", "Clip", "Reshape", "LeakyRelu", "Tanh", "MatMul"] {
        let swapped = node(operator, &["one", "obs"], "action", &[]);
        let reason = refused(&[swapped], &[tensor("one", &[1, 1], &[1.0])]);
        assert!(reason.contains("not its first argument"), "{reason}");
    }
    let missing = refused(&[node("Clip", &["", "obs"], "action", &[])], &[]);
    assert!(missing.contains("not its first argument"), "{missing}");
    for operator in ["Add", "Mul", "Sub", "Max", "Min"] {
        let swapped = node(operator, &["one", "obs"], "action", &[]);
        let bytes = file(&[swapped], &[tensor("one", &[], &[1.0])], Some(2));
        assert!(parsed(&bytes).is_ok(), "{operator}");
    }
}

#[test]
fn rows_are_reshaped_to_the_same_width_alone() {
    let reshaped = |shape: [f32; 2]| {
        let nodes = [node("Reshape", &["obs", "shape"], "action", &[])];
        let bytes = file(&nodes, &[tensor("shape", &[2], &shape)], Some(2));
        parsed(&bytes).map_err(|error| error.to_string())
    };
    for shape in [[-1.0, 2.0], [0.0, 2.0], [0.0, -1.0], [-1.0, 0.0]] {
        assert!(reshaped(shape).is_ok(), "{shape:?}");
    }
    for shape in [[-1.0, 1.0], [-1.0, 4.0]] {
        let reason = reshaped(shape).unwrap_err();
        assert!(reason.contains("give those of the same width"), "{reason}");
    }
    for shape in [[2.0, -1.0], [-1.0, -1.0], [1.0, 2.0], [-1.0, f32::NAN]] {
        let reason = reshaped(shape).unwrap_err();
        assert!(reason.contains("give it (-1, width)"), "{reason}");
    }
}
