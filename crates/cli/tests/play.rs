//! A recording of play, with a hand in every training frame, through `check` and `build`.

mod common;

use common::hingecast;

#[test]
fn the_joint_is_found_although_a_hand_holds_the_part_in_every_frame() {
    let d = tempfile::tempdir().unwrap();
    hingecast(d.path(), "synth hinged_box --play -o rec --states 4 --views 8 --test-views 1 --size 80 -q").done();
    let check = hingecast(d.path(), "check rec").done();
    assert!(check.stderr.contains("8 with hidden pixels"), "{check}");
    hingecast(d.path(), "build rec -o run --to parts --set parts.sample=400 -q").done();

    let read = |path: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(d.path().join(path)).unwrap()).unwrap()
    };
    let (found, truth) = (&read("run/parts/parts.json")["tree"], &read("rec.truth/truth.json")["tree"]);
    // The hand is no part.
    assert_eq!(
        (found["parts"].as_array().unwrap().len(), found["joints"].as_array().unwrap().len()),
        (2, 1),
        "{found}"
    );
    let (joint, true_joint) = (&found["joints"][0], &truth["joints"][0]);
    assert_eq!(joint["screw"]["kind"], "revolute");
    let numbers =
        |v: &serde_json::Value| -> Vec<f64> { v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let (axis, pivot) = (numbers(&joint["screw"]["axis"]), numbers(&joint["screw"]["pivot"]));
    let true_pivot = numbers(&true_joint["screw"]["pivot"]);
    // True axis: x. A hundredth of a radian, half a millimetre.
    assert!(axis[0].abs() > 0.9999, "{axis:?}");
    assert!((1..3).all(|k| (pivot[k] - true_pivot[k]).abs() < 5e-4), "{pivot:?}, not {true_pivot:?}");
    let (values, true_values) = (numbers(&joint["values"]), numbers(&true_joint["values"]));
    for (q, t) in values.iter().zip(&true_values) {
        assert!((q.abs() - t.abs()).abs() < 0.01, "{values:?}, not {true_values:?}");
    }
    hingecast(d.path(), "synth hinged_box --play --occluders -o both").refused("--occluders", "synth");
}
