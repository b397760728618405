//! `hingecast import-object`

use super::{Outcome, Session};
use crate::cli::ImportObject;
use hingecast::failure::{Failure, Result};
use hingecast::import_object::{ImportConfig, import};
use hingecast_capture::object::ArticulatedObject;

pub fn run(session: &Session, args: &ImportObject) -> Result<Outcome> {
    for (flag, value) in [("--scale", args.scale), ("--density", args.density)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Failure::new(format!("{value} is not a positive number"), flag, "for instance 1"));
        }
    }
    let source = ArticulatedObject::resolve(&args.object)?;
    let config = ImportConfig { scale: args.scale, density: args.density };
    let imported = import(&source, &args.out, &config, &session.ui.stage("import"))?;
    let doubts = tried(&args.out, imported.diagonal)?;
    session.ui.say(&format!(
        "{} parts, {} collision pieces, {:.2} kg -> {}",
        imported.parts,
        imported.hulls,
        imported.mass,
        args.out.display()
    ));
    imported.joints.iter().for_each(|j| session.ui.say(&format!("  joint {j}")));
    imported.changes.iter().for_each(|c| session.ui.say(&format!("  changed: {c}")));
    doubts.iter().for_each(|d| session.ui.say(&format!("  doubt: {d}")));
    session.answer(&serde_json::json!({ "object": args.out, "imported": imported, "doubts": doubts }))?;
    Ok(Outcome::Done)
}

/// What MuJoCo says about it.
#[cfg(feature = "mujoco")]
fn tried(folder: &std::path::Path, diagonal: f64) -> Result<Vec<String>> {
    let check = hingecast_sim::check_file(&folder.join("robot.xml"), &hingecast_sim::CheckConfig::default())?;
    Ok(check.doubts(diagonal))
}

#[cfg(not(feature = "mujoco"))]
fn tried(_: &std::path::Path, _: f64) -> Result<Vec<String>> {
    Ok(vec!["not tried in a simulator: this hingecast was built without MuJoCo".to_string()])
}
