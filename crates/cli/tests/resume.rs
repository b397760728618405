//! Killed or stopped, the same command goes on and ends with the same bytes as if nothing had
//! happened.

mod common;

use common::{TINY, assert_same_bytes, hingecast, start, tiny_recording, wait};
use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Waits until `file` is there, or the build ended before (on a fast machine: then there is nothing
/// to interrupt).
fn await_file(child: &mut Child, file: &Path) -> bool {
    let start = Instant::now();
    while !file.exists() {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        assert!(start.elapsed() < Duration::from_secs(300), "{} never came", file.display());
        std::thread::sleep(Duration::from_millis(2));
    }
    true
}

fn interrupt(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

#[test]
fn a_killed_or_stopped_build_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    hingecast(dir, &format!("build rec -o whole --method track -q {TINY}")).done();

    // Killed while it carries the gaussians from state to state.
    let line = format!("build rec -o killed --method track {TINY}");
    let mut child = start(dir, &line);
    await_file(&mut child, &dir.join("killed/motion/state_001.ply"));
    child.kill().unwrap();
    wait(&line, child);
    assert!(!dir.join("killed/twin/twin.json").exists(), "the build was over before it was killed");
    let resumed = hingecast(dir, &line).done();
    assert!(resumed.stderr.contains("splat   kept"), "{resumed}");

    // Stopped with Ctrl-C at the same place.
    let line = format!("build rec -o stopped --method track {TINY}");
    let mut child = start(dir, &line);
    await_file(&mut child, &dir.join("stopped/motion/state_001.ply"));
    interrupt(&child);
    let stopped = wait(&line, child);
    assert_eq!(stopped.code, Some(130), "{stopped}");
    assert!(stopped.stderr.contains("run the same command again"), "{stopped}");
    assert!(!dir.join("stopped/twin/twin.json").exists(), "{stopped}");
    hingecast(dir, &line).done();

    for run in ["killed", "stopped"] {
        for stage in ["splat", "motion", "parts", "joints", "twin"] {
            assert_same_bytes(&dir.join("whole").join(stage), &dir.join(run).join(stage));
        }
    }
}

/// `kill -9` in the middle of the fit: a checkpoint or a fresh start, but never half a stage taken
/// for a whole one.
#[test]
fn a_build_killed_during_the_fit_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    let long = "--set fit.steps=1200 --set fit.gaussians=2000 --to splat";
    hingecast(dir, &format!("build rec -o whole -q {long}")).done();
    let line = format!("build rec -o killed {long}");
    for millis in [150, 600] {
        let mut child = start(dir, &line);
        await_file(&mut child, &dir.join("killed/splat/stamp"));
        std::thread::sleep(Duration::from_millis(millis));
        child.kill().unwrap();
        wait(&line, child);
    }
    hingecast(dir, &line).done();
    assert_same_bytes(&dir.join("whole/splat"), &dir.join("killed/splat"));
}

/// A changed setting redoes its stage and everything after it, nothing before.
#[test]
fn a_changed_setting_redoes_what_depends_on_it() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    hingecast(dir, &format!("build rec -o run -q {TINY}")).done();
    let again = hingecast(dir, &format!("build rec -o run {TINY} --set twin.density=800")).done();
    let kept = |stage: &str| again.stderr.contains(&format!("{stage:<7} kept"));
    assert!(["parts", "splat", "joints"].into_iter().all(kept), "{again}");
    assert!(!kept("twin"), "{again}");
    let forced = hingecast(dir, &format!("build rec -o run --from joints {TINY} --set twin.density=800")).done();
    assert_eq!(forced.stderr.matches("kept").count(), 2, "{forced}");
}
