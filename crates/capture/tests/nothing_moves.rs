//! Recordings in which nothing moves are said to be such, at once.

mod common;

use common::{hinged_box, small};
use hingecast_capture::check::{Severity, check};
use hingecast_capture::synth::{Masks, Noise, Scenery, SynthConfig, World, synth};
use hingecast_geom::Progress;

/// Notes of the recording, and the findings of its check.
fn notes_and_findings(range: [f64; 2], noise: Noise) -> (Vec<String>, Vec<&'static str>) {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("rec");
    let ranges = [("hinge".to_string(), range)].into();
    let config = SynthConfig { ranges, noise, views: 10, size: 96, ..small() };
    let report = synth(&hinged_box(dir.path()), &config, &out, &Progress::default()).unwrap();
    let findings = check(&out, &Progress::default()).unwrap().findings;
    (report.notes, findings.iter().map(|f| f.code).collect())
}

#[test]
fn a_hinge_that_hardly_moves_is_named_by_synth_and_by_check() {
    for noise in [Noise::None, Noise::D435] {
        let (notes, findings) = notes_and_findings([0.0, 0.003], noise);
        assert_eq!(notes.len(), 2, "{notes:?}");
        assert!(notes[0].contains("'hinge' moves by 0.17 deg") && notes[1].contains("nothing"), "{notes:?}");
        assert!(findings.contains(&"nothing-moves"), "{findings:?}");
        let (notes, findings) = notes_and_findings([0.0, 0.4], noise);
        assert_eq!(notes, Vec::<String>::new());
        assert!(!findings.contains(&"nothing-moves"), "{findings:?}");
    }
}

/// In a room without masks, what moves may be too little for a check of few points: that something else
/// has to say.
#[test]
fn without_masks_it_stops_nobody() {
    for (masks, severity) in [(Masks::True, Severity::Error), (Masks::None, Severity::Warning)] {
        let dir = tempfile::tempdir().unwrap();
        let world = World { scene: Scenery::Room, masks, ..World::default() };
        let ranges = [("hinge".to_string(), [0.0, 0.0])].into();
        let config = SynthConfig { ranges, world, views: 10, size: 96, ..small() };
        let report = synth(&hinged_box(dir.path()), &config, &dir.path().join("rec"), &Progress::default()).unwrap();
        let findings = check(&report.recording, &Progress::default()).unwrap().findings;
        let said = findings.iter().find(|f| f.code == "nothing-moves").expect("nothing moves");
        assert_eq!(said.severity, severity);
    }
}
