//! A film of play, by the commands of docs/recordings.md: a scan, a film, a twin's joints.

mod common;

use common::hingecast;

fn read(path: std::path::PathBuf) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn a_scan_and_a_film_become_parts_and_joints() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    hingecast(dir, "synth hinged_box --film -o film --views 20 --play-frames 40 --size 128 --scene room").done();
    let imported = hingecast(dir, "import film/scan --film film/play -o rec --film-states 12").done();
    assert!(imported.stderr.contains("cut into") && imported.stderr.contains("pictures left out"), "{imported}");
    let recording = read(dir.join("rec/transforms.json"));
    assert_eq!(recording["film"], true);
    hingecast(dir, "check rec").done();
    let built = hingecast(dir, "build rec -o run --preset fast --to parts").done();
    assert!(built.stderr.contains("hands:"), "{built}");
    let (found, truth) = (read(dir.join("run/parts/parts.json")), read(dir.join("film.truth/truth.json")));
    let joints = found["tree"]["joints"].as_array().unwrap();
    assert_eq!(joints.len(), 1, "{joints:?}");
    let (a, b) = (numbers(&joints[0]["screw"]["axis"]), numbers(&truth["tree"]["joints"][0]["screw"]["axis"]));
    let cosine: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
    assert!(cosine.abs() > 1f64.to_radians().cos(), "{a:?} {b:?}");
    // States are pictures at their times: rests, and moments of the motion.
    let (found, values) = (numbers(&joints[0]["values"]), numbers(&truth["tree"]["joints"][0]["values"]));
    let times = numbers(&truth["film_times"]);
    let sign = cosine.signum();
    for (state, q) in found.iter().enumerate().skip(1) {
        let frames = recording["frames"].as_array().unwrap().iter().filter(|f| f["state"] == state);
        let own: Vec<f64> = frames.map(|f| value_at(f["time"].as_f64().unwrap(), &times, &values)).collect();
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        assert!((sign * q - (mean - values[0])).abs() < 2f64.to_radians(), "state {state}: {q}, truth {mean}");
    }
}

/// Of a picture of the film, whose times follow the scan's value.
fn value_at(time: f64, times: &[f64], values: &[f64]) -> f64 {
    values[1 + times.iter().position(|t| (t - time).abs() < 1e-6).unwrap()]
}

#[test]
fn a_film_wants_one_scan() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("a")).unwrap();
    hingecast(dir.path(), "import a a --film a -o rec").refused("2 scans with a film", "--film");
}
