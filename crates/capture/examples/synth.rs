//! Records a synthetic object: `cargo run --release -p hingecast-capture --example synth -- OBJECT
//! -o REC`.

use hingecast_capture::CaptureError;
use hingecast_capture::object::ArticulatedObject;
use hingecast_capture::synth::{SynthConfig, synth};
use hingecast_geom::Progress;
use std::path::PathBuf;

fn main() {
    if let Err(e) = run() {
        eprintln!("{e}");
        std::process::exit(2);
    }
}

fn run() -> Result<(), CaptureError> {
    let usage = |what: String| {
        CaptureError::new(
            what,
            "synth OBJECT -o REC [--states N] [--views N] [--test-views N] [--size N] [--seed N] [--range joint=lo:hi] [--noise d435|stereo|tof] [--occluders] [--walk] [--world JSON]",
            "give an object and an output folder",
        )
    };
    let (mut object, mut out, mut config) = (None, None, SynthConfig::default());
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or_else(|| usage(format!("{arg} needs a value")));
        let number = |text: String| text.parse::<usize>().map_err(|_| usage(format!("{text} is not a number")));
        match arg.as_str() {
            "-o" => out = Some(PathBuf::from(value()?)),
            "--states" => config.states = number(value()?)?,
            "--views" => config.views = number(value()?)?,
            "--test-views" => config.test_views = number(value()?)?,
            "--size" => config.size = number(value()?)?,
            "--seed" => config.seed = number(value()?)? as u64,
            "--noise" => {
                config.noise = serde_json::from_value(value()?.into()).map_err(|e| usage(format!("--noise: {e}")))?
            }
            "--occluders" => config.occluders = 0.25,
            "--world" => config.world = serde_json::from_str(&value()?).map_err(|e| usage(format!("--world: {e}")))?,
            "--walk" => config.same_cameras = false,
            "--range" => {
                let text = value()?;
                let parsed = text.split_once('=').and_then(|(name, r)| {
                    let (lo, hi) = r.split_once(':')?;
                    Some((name.to_string(), [lo.parse().ok()?, hi.parse().ok()?]))
                });
                let (name, range) = parsed.ok_or_else(|| usage(format!("--range {text}")))?;
                config.ranges.insert(name, range);
            }
            name => object = Some(name.to_string()),
        }
    }
    let (Some(object), Some(out)) = (object, out) else { return Err(usage("arguments are missing".into())) };
    let object = ArticulatedObject::load(&ArticulatedObject::resolve(&object)?)?;
    let start = std::time::Instant::now();
    let report = synth(&object, &config, &out, &Progress::default())?;
    println!("{} frames in {:.1} s -> {}", report.frames, start.elapsed().as_secs_f64(), report.recording.display());
    for ((name, [from, to]), joint) in report.ranges.iter().zip(&object.tree.joints) {
        println!("  {name} -> {}: {from:.3} .. {to:.3} of {:?}", object.tree.parts[joint.child], joint.limits);
    }
    Ok(())
}
