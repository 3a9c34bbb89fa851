//! Questions of clients that no client of ours asks.

use sim_daemon::outside::Worlds;

const SCENE: &str = r#"
dt = 0.002
substeps = 1

[[shape]]
name = "box"
type = "box"
half_extents = [0.1, 0.1, 0.1]
body = "cube"
density = 400.0

[[body]]
name = "cube"
pos = [0.0, 0.0, 0.2]
"#;

#[test]
fn a_rollout_whose_answer_needs_more_bytes_than_are_counted_is_refused() {
    let folder = std::env::temp_dir();
    let path = folder.join(format!("tightloop-questions-{}", std::process::id()));
    let mut worlds = Worlds::new(SCENE, &folder);
    let mut ask = |frames: u64| {
        let question = format!(
            r#"{{"frames":{frames},"first":0,"size":1,"layers":[{{"linear":{{"inputs":1,"outputs":1}}}}],
            "terms":[{{"source":"last_action","minus":[],"scale":[],"clip":null,"history":1}}],"clip":null,
            "drives":[],"inputs":[],"commands":[],"fields":["joint_q"],"collects":[false,false],"lengths":[2,0]}}"#
        );
        let length = (question.len() as u64).to_le_bytes();
        let bytes = [&length[..], question.as_bytes(), &[0; 16]].concat();
        std::fs::write(&path, bytes).unwrap();
        worlds.rollout(&path)
    };
    // two worlds of 7 coordinates in f32, from a multiple of 64 bytes on, then the policy's memory: 2 values of f64 per world
    assert_eq!(ask(3), Ok(192 + 32));
    // twice the bytes of these frames are 2⁶⁴ and a few more
    let refused = ask((1 << 63) / 56 + 1).unwrap_err();
    assert!(refused.contains("of memory"), "{refused}");
    std::fs::remove_file(&path).unwrap();
}
