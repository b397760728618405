//! From a recording to a twin in ten lines.
//!
//!     hingecast synth microwave -o rec --states 5 --views 24 --size 128
//!     cargo run --release -p hingecast --example build_twin -- rec run

use hingecast::artifacts::TwinFile;
use hingecast::{Config, Options, Preset, Silent, build};
use std::path::Path;

fn main() -> hingecast::Result<()> {
    let mut args = std::env::args().skip(1);
    let (recording, run) = (args.next().unwrap_or("rec".into()), args.next().unwrap_or("run".into()));
    let folder =
        build(Path::new(&recording), Path::new(&run), &Config::preset(Preset::Fast), &Options::default(), &Silent)?;
    let twin = TwinFile::read(&folder.root)?;
    for joint in &twin.tree.joints {
        let carries = &twin.tree.parts[joint.child];
        println!("{}: {:?}, carries {carries}, axis {:.4}", joint.name, joint.screw.kind, joint.screw.axis);
    }
    twin.doubts.iter().for_each(|doubt| println!("doubt: {doubt}"));
    println!("{}", folder.folder("twin").join("robot.urdf").display());
    Ok(())
}
