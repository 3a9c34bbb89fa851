//! Files by hand: those that exporters write, and malformed ones.

mod trained;

use proptest::prelude::*;

use super::*;
use crate::Runner;

/// A field of bytes.
pub(super) fn field(number: u64, bytes: &[u8]) -> Vec<u8> {
    let mut field = varint(number << 3 | 2);
    field.extend(varint(bytes.len() as u64));
    field.extend_from_slice(bytes);
    field
}

pub(super) fn number(number: u64, value: u64) -> Vec<u8> {
    [varint(number << 3), varint(value)].concat()
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// A `TensorProto` of single precision, in raw bytes.
pub(super) fn tensor(name: &str, shape: &[u64], values: &[f32]) -> Vec<u8> {
    let raw: Vec<u8> = values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    let axes: Vec<u8> = shape.iter().flat_map(|&n| number(1, n)).collect();
    [
        axes,
        number(2, 1),
        field(8, name.as_bytes()),
        field(9, &raw),
    ]
    .concat()
}

pub(super) fn node(
    operator: &str,
    inputs: &[&str],
    output: &str,
    attributes: &[Vec<u8>],
) -> Vec<u8> {
    let inputs: Vec<u8> = inputs
        .iter()
        .flat_map(|name| field(1, name.as_bytes()))
        .collect();
    let attributes: Vec<u8> = attributes
        .iter()
        .flat_map(|bytes| field(5, bytes))
        .collect();
    let name = format!("node_{output}");
    let texts = [
        field(2, output.as_bytes()),
        field(3, name.as_bytes()),
        field(4, operator.as_bytes()),
    ];
    [inputs, texts.concat(), attributes].concat()
}

pub(super) fn integer(name: &str, value: u64) -> Vec<u8> {
    [field(1, name.as_bytes()), number(3, value), number(20, 2)].concat()
}

fn float(name: &str, value: f32) -> Vec<u8> {
    let bytes = [varint(2 << 3 | 5), value.to_le_bytes().to_vec()].concat();
    [field(1, name.as_bytes()), bytes, number(20, 1)].concat()
}

/// A graph with the input `obs` of that size, if any, and the output `action`.
pub(super) fn file(nodes: &[Vec<u8>], tensors: &[Vec<u8>], size: Option<u64>) -> Vec<u8> {
    let all = |number, parts: &[Vec<u8>]| -> Vec<u8> {
        parts.iter().flat_map(|part| field(number, part)).collect()
    };
    let axes = [
        number(1, 0),
        size.map_or(Vec::new(), |size| number(1, size)),
    ];
    let shape: Vec<u8> = axes.iter().flat_map(|axis| field(1, axis)).collect();
    let tensor_type = field(1, &[number(1, 1), field(2, &shape)].concat());
    let input = [field(1, b"obs"), field(2, &tensor_type)].concat();
    let graph = [
        all(1, nodes),
        all(5, tensors),
        field(11, &input),
        field(12, &field(1, b"action")),
    ];
    let text = [field(1, b"joint_names"), field(2, b"hip,knee")].concat();
    [number(1, 8), field(7, &graph.concat()), field(14, &text)].concat()
}

fn no_files(file: &str, _: u64, _: u64) -> Result<Vec<u8>, String> {
    Err(format!("there is no file {file}"))
}

pub(super) fn parsed(bytes: &[u8]) -> Result<Policy, PolicyError> {
    read(bytes, None, &no_files)
}

pub(super) fn refused(nodes: &[Vec<u8>], tensors: &[Vec<u8>]) -> String {
    parsed(&file(nodes, tensors, Some(2)))
        .unwrap_err()
        .to_string()
}

fn evaluated(policy: &Policy, inputs: &[f32]) -> Vec<f32> {
    let mut outputs = vec![0.0; policy.network.outputs()];
    let run = Runner::new(&policy.network).run(inputs, &mut outputs, 1);
    run.unwrap();
    outputs
}

/// Weights of two outputs: the sum and the difference of two inputs.
fn weights(name: &str) -> Vec<u8> {
    tensor(name, &[2, 2], &[1.0, 1.0, 1.0, -1.0])
}

#[test]
fn a_normalised_perceptron_is_read_with_its_metadata() {
    let nodes = [
        node("Add", &["variance", "epsilon"], "sum", &[]),
        node("Sqrt", &["sum"], "spread", &[]),
        node("Sub", &["obs", "mean"], "moved", &[]),
        node("Div", &["moved", "spread"], "scaled", &[]),
        node("Clip", &["scaled", "low", ""], "clipped", &[]),
        node(
            "Gemm",
            &["clipped", "w", "b"],
            "hidden",
            &[integer("transB", 1)],
        ),
        node("LeakyRelu", &["hidden"], "active", &[float("alpha", 0.5)]),
        node("MatMul", &["active", "v"], "product", &[]),
        node("Add", &["c", "product"], "action", &[]),
    ];
    let tensors = [
        tensor("variance", &[1, 2], &[3.0, 8.0]),
        tensor("epsilon", &[], &[1.0]),
        tensor("mean", &[2], &[1.0, 2.0]),
        tensor("low", &[], &[-2.0]),
        weights("w"),
        tensor("b", &[2], &[0.0, 0.5]),
        tensor("v", &[2, 1], &[2.0, 4.0]),
        tensor("c", &[1], &[10.0]),
    ];
    for size in [Some(2), None] {
        let policy = parsed(&file(&nodes, &tensors, size)).unwrap();
        assert_eq!((&*policy.input, &*policy.output), ("obs", "action"));
        assert_eq!(
            policy.metadata,
            [("joint_names".to_owned(), "hip,knee".to_owned())]
        );
        // (5 - 1) / 2 = 2, (-7 - 2) / 3 = -3 → -2; 0 and 4.5; 2 · 0 + 4 · 4.5 + 10
        assert_eq!(evaluated(&policy, &[5.0, -7.0]), [28.0]);
        // (-3 - 1) / 2 = -2, (2 - 2) / 3 = 0; -2 and -1.5 → -1 and -0.75; -2 - 3 + 10
        assert_eq!(evaluated(&policy, &[-3.0, 2.0]), [5.0]);
    }
}

#[test]
fn other_forms_of_layers_are_read() {
    let silu = [
        node("Sigmoid", &["obs"], "gate", &[]),
        node("Mul", &["gate", "obs"], "action", &[]),
    ];
    let policy = parsed(&file(&silu, &[], Some(2))).unwrap();
    assert_eq!(policy.network.layers(), [crate::Layer::Silu]);
    let nodes = [
        node("Flatten", &["obs"], "flat", &[]),
        node("Sub", &["one", "flat"], "flipped", &[]),
        node(
            "BatchNormalization",
            &["flipped", "scale", "shift", "mean", "var"],
            "normal",
            &[float("epsilon", 0.0)],
        ),
        node("Max", &["normal", "one"], "action", &[]),
    ];
    let tensors = [
        tensor("one", &[], &[1.0]),
        tensor("scale", &[2], &[2.0, 3.0]),
        tensor("shift", &[2], &[5.0, 0.0]),
        tensor("mean", &[2], &[1.0, 1.0]),
        tensor("var", &[2], &[4.0, 4.0]),
    ];
    let policy = parsed(&file(&nodes, &tensors, Some(2))).unwrap();
    // (1 - 4 - 1) / 2 · 2 + 5, (1 - 4 - 1) / 2 · 3 → 1
    assert_eq!(evaluated(&policy, &[4.0, 4.0]), [1.0, 1.0]);
    assert_eq!(evaluated(&policy, &[0.0, -4.0]), [5.0, 6.0]);
}

#[test]
fn a_branch_that_the_output_does_not_need_may_have_any_operator() {
    let nodes = [
        node("LSTM", &["obs"], "value", &[]),
        node("Gemm", &["obs", "w"], "action", &[]),
    ];
    let policy = parsed(&file(&nodes, &[weights("w")], None)).unwrap();
    assert_eq!(evaluated(&policy, &[3.0, 1.0]), [4.0, 2.0]);
    let refused = read(
        &file(&nodes, &[weights("w")], None),
        Some("value"),
        &no_files,
    );
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("has no output `value`; give one of: action")
    );
}

#[test]
fn what_is_no_perceptron_is_refused_by_name() {
    let lstm = refused(&[node("LSTM", &["obs"], "action", &[])], &[]);
    assert!(
        lstm.contains("operator LSTM of node `node_action`"),
        "{lstm}"
    );
    let joined = refused(
        &[
            node("Tanh", &["obs"], "t", &[]),
            node("Add", &["obs", "t"], "action", &[]),
        ],
        &[],
    );
    assert!(joined.contains("joins two values"), "{joined}");
    let cyclic = refused(
        &[
            node("Tanh", &["b"], "a", &[]),
            node("Tanh", &["a"], "action", &[]),
        ],
        &[],
    );
    assert!(cyclic.contains("reads `b`"), "{cyclic}");
    let constant = refused(&[node("Identity", &["w"], "action", &[])], &[weights("w")]);
    assert!(constant.contains("depends on no input"), "{constant}");
    let nothing = refused(&[], &[]);
    assert!(
        nothing.contains("no node gives the output `action`"),
        "{nothing}"
    );
    let sizes = refused(
        &[node("Gemm", &["obs", "w"], "action", &[])],
        &[tensor("w", &[3, 1], &[1.0; 3])],
    );
    assert!(sizes.contains("a layer of 3 numbers"), "{sizes}");
    let biases = refused(
        &[node("Gemm", &["obs", "w", "b"], "action", &[])],
        &[weights("w"), tensor("b", &[3], &[0.0; 3])],
    );
    assert!(biases.contains("3 biases for 2 outputs"), "{biases}");
    let flipped = refused(
        &[node("Div", &["w", "obs"], "action", &[])],
        &[tensor("w", &[1], &[1.0])],
    );
    assert!(flipped.contains("divides a constant"), "{flipped}");
}

#[test]
fn tensors_that_do_not_fit_are_refused_by_name() {
    let gemm = [node("Gemm", &["obs", "w"], "action", &[])];
    let missing = refused(&gemm, &[tensor("w", &[2, 2], &[1.0; 3])]);
    assert!(
        missing.contains("tensor `w`: has the shape [2, 2]"),
        "{missing}"
    );
    let huge = refused(&gemm, &[tensor("w", &[1 << 40, 1 << 40], &[])]);
    assert!(huge.contains("tensor `w`"), "{huge}");
    let negative = refused(&gemm, &[tensor("w", &[u64::MAX, 2], &[])]);
    assert!(negative.contains("has the shape [-1, 2]"), "{negative}");
    let brain = [
        number(1, 1),
        number(2, 16),
        field(8, b"w"),
        field(9, &[0, 0]),
    ]
    .concat();
    let brain = refused(&gemm, &[brain]);
    assert!(
        brain.contains("tensor `w`: has bfloat16; export the policy in float32"),
        "{brain}"
    );
}

/// Weights in a file of their own.
fn beside(location: &str) -> Vec<u8> {
    let entry = |name: &str, text: &str| {
        field(
            13,
            &[field(1, name.as_bytes()), field(2, text.as_bytes())].concat(),
        )
    };
    let head = [
        number(1, 2),
        number(1, 2),
        number(2, 1),
        field(8, b"w"),
        number(14, 1),
    ]
    .concat();
    let place = [
        entry("location", location),
        entry("offset", "4"),
        entry("length", "16"),
    ];
    [head, place.concat()].concat()
}

#[test]
fn weights_beside_the_file_are_read_from_its_folder_alone() {
    let gemm = [node("Gemm", &["obs", "w"], "action", &[])];
    let external = |name: &str, offset, length| {
        assert_eq!((name, offset, length), ("policy.onnx.data", 4, 16));
        let weights = [1.0f32, 1.0, 1.0, -1.0];
        Ok(weights
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect())
    };
    let bytes = file(&gemm, &[beside("policy.onnx.data")], None);
    let policy = read(&bytes, None, &external).unwrap();
    assert_eq!(evaluated(&policy, &[3.0, 1.0]), [4.0, 2.0]);
    let missing = parsed(&bytes).unwrap_err().to_string();
    assert!(
        missing.contains("tensor `w`: there is no file policy.onnx.data"),
        "{missing}"
    );
    for outside in ["/etc/passwd", "../w", "a/../../w", "..\\w", "C:\\w", ""] {
        let refused = refused(&gemm, &[beside(outside)]);
        assert!(refused.contains("not in the folder"), "{refused}");
    }
}

#[test]
fn bytes_of_another_kind_are_refused() {
    for bytes in [
        &b""[..],
        b"PK\x03\x04",
        b"\x80\x80",
        b"not a model at all",
        &[0xff; 64],
    ] {
        let refused = parsed(bytes).unwrap_err().to_string();
        assert!(refused.starts_with("is no ONNX file: "), "{refused}");
    }
}

proptest! {
    #[test]
    fn no_damage_makes_it_panic(cut in 0usize..600, place in 0usize..600, byte in any::<u8>()) {
        let nodes = [
            node("Sub", &["obs", "mean"], "moved", &[]),
            node("Gemm", &["moved", "w"], "hidden", &[integer("transB", 1)]),
            node("Elu", &["hidden"], "action", &[float("alpha", 0.5)]),
        ];
        let tensors = [tensor("mean", &[2], &[1.0, 2.0]), beside("data"), weights("w")];
        let mut bytes = file(&nodes, &tensors, Some(2));
        let place = place % bytes.len();
        bytes[place] = byte;
        let _ = parsed(&bytes);
        bytes.truncate(cut % bytes.len());
        let _ = parsed(&bytes);
    }
}
