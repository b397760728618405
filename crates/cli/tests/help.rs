//! The help texts say defaults and units, and `--json` answers are JSON.

mod common;

use common::hingecast;

const VERBS: [&str; 14] = [
    "demo",
    "synth",
    "import",
    "import-object",
    "check",
    "build",
    "eval",
    "report",
    "demos",
    "train",
    "rollout",
    "experiment",
    "bench",
    "doctor",
];

/// Flags that take a value say what holds without it; those with a unit say the unit.
#[test]
fn every_help_text_says_defaults_and_units() {
    let dir = tempfile::tempdir().unwrap();
    for verb in VERBS {
        let answer = hingecast(dir.path(), &format!("{verb} --help")).done();
        let text = answer.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
        for flag in text.split(" --").skip(1).filter(|f| f.contains(" <") || f.contains(" [<")) {
            let name = flag.split_whitespace().next().unwrap();
            // What must be given has no default.
            let required = ["out", "truth"].contains(&name) && !["demo", "build", "bench"].contains(&verb);
            let optional = ["config", "set", "against", "fail-under", "sweep"].contains(&name);
            assert!(
                required || optional || flag.contains("default"),
                "{verb} --{name} does not say its default\n{flag}"
            );
        }
        assert!(!text.contains("<RECORDING> Options"), "{verb} does not explain its argument");
    }
    let says = |verb: &str, words: &[&str]| {
        let text = hingecast(dir.path(), &format!("{verb} --help")).stdout;
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        words.iter().for_each(|w| assert!(text.contains(w), "{verb} --help does not say '{w}'"));
    };
    says("synth", &["pixels", "radians", "scene units", "deg", "mm"]);
    says("build", &["kg/m^3", "parts, splat, joints or twin"]);
    says("eval", &["degrees", "share of the", "dB"]);
    says("bench", &["MB", "pixels"]);
}

#[test]
fn the_front_page_lists_all_verbs_and_examples() {
    let dir = tempfile::tempdir().unwrap();
    let text = hingecast(dir.path(), "--help").done().stdout;
    for verb in VERBS {
        assert!(text.contains(&format!("\n  {verb} ")), "{verb}");
    }
    assert!(text.contains("Exit status"), "{text}");
}

#[test]
fn machine_answers_are_json() {
    let dir = tempfile::tempdir().unwrap();
    let doctor = hingecast(dir.path(), "doctor --json").done();
    assert!(doctor.json()["threads"].as_u64().unwrap() >= 1);
    assert!(!doctor.stderr.is_empty(), "the human answer stays on stderr");
    let synth = hingecast(dir.path(), "synth hinged_box -o rec --states 2 --views 3 --size 32 --json --quiet").done();
    assert_eq!(synth.json()["images"], 2 * (3 + 4));
    assert!(synth.stderr.is_empty(), "{synth}");
    let check = hingecast(dir.path(), "check rec --json");
    assert!(check.json()["states"].is_array(), "{check}");
    let imported = hingecast(dir.path(), "import rec -o again --json").done();
    assert_eq!(imported.json()["frames"], 14);
}
