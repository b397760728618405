//! A joint of a finished run gets a name and limits of a person's choice, and the twin is exported
//! again. Only the stages from `joints` on run; surfaces, gaussians and joints that were found are
//! kept.
//!
//!     cargo run --release -p hingecast --example edit_joint -- rec run joint_1 door 0 95

use hingecast::overrides::JointOverride;
use hingecast::{Config, Options, Preset, Silent, build};
use std::path::Path;

fn main() -> hingecast::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [recording, run, joint, name, lower, upper] = &args[..] else {
        eprintln!("RECORDING RUN JOINT NAME LOWER UPPER (degrees, or scene units of a slide)");
        std::process::exit(2);
    };
    let number = |text: &str| text.parse::<f64>().unwrap_or(f64::NAN);
    // The settings that the run was built with, and the correction on top.
    let saved = Path::new(run).join("config.toml");
    let mut config = Config::resolve(Preset::Default, saved.is_file().then_some(saved.as_path()), &[])?;
    config.joint.push(JointOverride {
        joint: joint.clone(),
        name: Some(name.clone()),
        limits: Some([number(lower), number(upper)]),
        ..JointOverride::default()
    });
    let folder = build(Path::new(recording), Path::new(run), &config, &Options::default(), &Silent)?;
    println!("{}", folder.folder("twin").join("robot.xml").display());
    Ok(())
}
