//! `hingecast synth`

use super::{Outcome, Session};
use crate::cli::{Synth, SynthSettings};
use hingecast::failure::{Failure, Result};
use hingecast_capture::synth::SynthConfig;
use std::collections::BTreeMap;

pub fn config(settings: &SynthSettings, seed: u64, truth: bool) -> Result<SynthConfig> {
    let mut ranges = BTreeMap::new();
    for text in &settings.ranges {
        let parsed = text.split_once('=').and_then(|(name, range)| {
            let (from, to) = range.split_once(':')?;
            Some((name.to_string(), [from.parse().ok()?, to.parse().ok()?]))
        });
        let (name, range) = parsed.ok_or_else(|| {
            Failure::new(
                format!("'{text}' is not JOINT=FROM:TO"),
                "--range",
                "for instance --range hinge=0:1.57 (radians)",
            )
        })?;
        ranges.insert(name, range);
    }
    Ok(SynthConfig {
        states: settings.states,
        views: settings.views,
        test_views: settings.test_views,
        size: settings.size,
        noise: settings.noise,
        occluders: settings.occluders.unwrap_or(0.0),
        play: settings.play,
        film: settings.film.then_some(settings.play_frames),
        world: settings.world.world(settings.film),
        ranges,
        truth,
        seed,
        ..Default::default()
    })
}

pub fn run(session: &Session, args: &Synth) -> Result<Outcome> {
    let start = std::time::Instant::now();
    let settings = config(&args.settings, args.seed, !args.no_truth)?;
    let report = hingecast_study::suite::record(&session.host(), &args.object, &settings, &args.out)?;
    let secs = start.elapsed().as_secs_f64();
    session.ui.say(&format!("{} images in {secs:.1} s -> {}", report.frames, report.recording.display()));
    for (name, [from, to]) in &report.ranges {
        session.ui.say(&format!("  {name}: {from:.3} .. {to:.3} (radians; slides: scene units)"));
    }
    session.answer(&serde_json::json!({
        "recording": report.recording, "truth": report.truth, "images": report.frames, "secs": secs,
    }))?;
    Ok(Outcome::Done)
}
