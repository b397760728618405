//! Joints out of depth images of your own: no run folder, no settings file, just cameras and depth.
//!
//! The images come out of a recording here; whatever fills a `DepthView` does as well: an OpenCV
//! camera with its `camera_from_world`, z per pixel in any one unit, and per pixel whether it shows
//! the object, what lies behind it, or nothing that one could know.
//!
//!     cargo run --release -p hingecast --example find_joints -- rec

use hingecast_articulate::{BACKGROUND, Config, DepthView, OBJECT, UNKNOWN, find};
use hingecast_capture::{Recording, Split};
use hingecast_geom::Progress;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let recording = Recording::open(std::env::args().nth(1).unwrap_or("rec".into()).as_ref())?;
    let view = |frame: usize| -> Result<DepthView, hingecast_capture::CaptureError> {
        let seen = recording.load(frame)?;
        let class = seen.depth.iter().zip(&seen.mask).map(|(z, mask)| match (*z > 0.0, mask) {
            (true, 1) => OBJECT,
            (false, 0) => BACKGROUND,
            _ => UNKNOWN,
        });
        Ok(DepthView { camera: seen.camera, class: class.collect(), depth: seen.depth })
    };
    let state = |s: usize| recording.frames_of(s, Split::Train).into_iter().map(view).collect();
    let mut states: Vec<Vec<DepthView>> = (0..recording.n_states).map(state).collect::<Result<_, _>>()?;

    let found = find(&mut states, &Config { cells: 72, ..Config::default() }, &Progress::default())?;
    for (joint, sure) in found.tree.joints.iter().zip(&found.certainty) {
        println!(
            "{} on {}: {:?}, axis {:.4} +- {:.3} deg, values {:.3?}",
            joint.name, found.tree.parts[joint.parent], joint.screw.kind, joint.screw.axis, sure.axis_deg, joint.values
        );
    }
    found.doubts.iter().for_each(|doubt| println!("doubt: {doubt}"));
    Ok(())
}
