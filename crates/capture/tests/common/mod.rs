//! What several tests need.
#![allow(dead_code)]

pub mod dots;

use hingecast_capture::object::ArticulatedObject;
use hingecast_capture::synth::{SynthConfig, SynthReport, World, synth};
use hingecast_capture::{Recording, Truth};
use hingecast_geom::Progress;
use std::path::{Path, PathBuf};

/// A box with a hinged lid, 0.4 m wide, z up, metres.
pub const HINGED_BOX: &str = r#"<robot name="hinged_box">
  <link name="body"><visual><geometry><box size="0.4 0.3 0.2"/></geometry>
    <material name="red"><color rgba="0.8 0.2 0.1 1"/></material></visual></link>
  <link name="lid"><visual><origin xyz="0 -0.15 0.02"/><geometry><box size="0.38 0.28 0.03"/></geometry>
    <material name="blue"><color rgba="0.1 0.3 0.8 1"/></material></visual></link>
  <joint name="hinge" type="revolute"><origin xyz="0 0.15 0.1"/><axis xyz="-1 0 0"/><limit lower="0" upper="1.6"/>
    <parent link="body"/><child link="lid"/></joint>
</robot>"#;

pub fn hinged_box(dir: &Path) -> ArticulatedObject {
    let file = dir.join("box.urdf");
    std::fs::write(&file, HINGED_BOX).unwrap();
    ArticulatedObject::load(&file).unwrap()
}

pub fn small() -> SynthConfig {
    SynthConfig { states: 3, views: 6, test_views: 1, test_states: 1, size: 64, ..Default::default() }
}

/// A small recording of the hinged box in `dir/rec`.
pub fn record(dir: &Path, config: &SynthConfig) -> SynthReport {
    synth(&hinged_box(dir), config, &dir.join("rec"), &Progress::default()).unwrap()
}

/// The hinged box in a world.
pub fn with(world: World) -> SynthConfig {
    SynthConfig { world, ..small() }
}

/// A recording of the hinged box and its truth.
pub fn made(dir: &Path, config: &SynthConfig) -> (Recording, Truth) {
    let report = record(dir, config);
    (Recording::open(&report.recording).unwrap(), Truth::open(&report.truth.unwrap()).unwrap())
}

/// The real objects, when they are at hand.
pub fn dev_objects() -> Vec<PathBuf> {
    let Some(data) = std::env::var_os("HINGECAST_DATA") else {
        eprintln!("skipped: HINGECAST_DATA is not set, the PartNet-Mobility objects are not at hand");
        return Vec::new();
    };
    let folder = PathBuf::from(data).join("partnet-mobility-dev");
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut found: Vec<PathBuf> =
        entries.flatten().map(|e| e.path()).filter(|p| p.join("mobility.urdf").is_file()).collect();
    found.sort();
    found
}
