//! `hingecast bench --joints`: parts and joints of every object under every protocol and seed.

use super::suite::{Named, record_once};
use super::{Outcome, Session, build, synth};
use crate::cli::Bench;
use hingecast::artifacts::Parts;
use hingecast::build::{Options, Stage};
use hingecast::config::Config;
use hingecast::eval::parts::{PartsEvaluation, evaluate_parts};
use hingecast::failure::{Failure, Result};
use hingecast::stage::write_json;
use hingecast_capture::Truth;
use hingecast_capture::synth::{Noise, SynthConfig};
use std::fmt::Write as _;

/// Name, states, views, noise.
const PROTOCOLS: [(&str, usize, usize, Noise); 6] = [
    ("25x60", 25, 60, Noise::None),
    ("25x60-d435", 25, 60, Noise::D435),
    ("5x48", 5, 48, Noise::None),
    ("5x48-d435", 5, 48, Noise::D435),
    ("2x100", 2, 100, Noise::None),
    ("2x100-d435", 2, 100, Noise::D435),
];

/// One cell of the grid.
#[derive(serde::Serialize)]
struct Row {
    protocol: String,
    seed: u64,
    #[serde(flatten)]
    evaluation: PartsEvaluation,
}

pub fn run(session: &Session, args: &Bench, suite: &[Named]) -> Result<Outcome> {
    let wanted: Vec<_> =
        PROTOCOLS.iter().filter(|p| args.protocols.is_empty() || args.protocols.iter().any(|n| n == p.0)).collect();
    if wanted.is_empty() {
        let all: Vec<&str> = PROTOCOLS.iter().map(|p| p.0).collect();
        return Err(Failure::new(
            "no such protocol",
            format!("--protocol {:?}", args.protocols),
            format!("one of {}", all.join(", ")),
        ));
    }
    let build_config = build::config(&args.build)?;
    let mut rows: Vec<Row> = Vec::new();
    let mut text = format!(
        "| protocol | runs | parts right | types right | parents right | axis deg mean / max | pivot mean | turn deg mean | slide mean | s mean |\n{}\n",
        "|---".repeat(10) + "|"
    );
    for (protocol, states, views, noise) in wanted {
        for seed in 0..args.seeds {
            let recording_seed = args.recording_seed + seed;
            let base = synth::config(&args.synth, recording_seed, true)?;
            let synth_config = SynthConfig { states: *states, views: *views, noise: *noise, test_views: 0, ..base };
            for object in suite {
                let place = args.out.join("joints").join(protocol).join(format!("seed{recording_seed}"));
                match one(session, object, &place, &synth_config, &build_config, args.tidy) {
                    Ok(evaluation) => {
                        session.ui.say(&line(protocol, &evaluation));
                        rows.push(Row { protocol: protocol.to_string(), seed: recording_seed, evaluation });
                    }
                    Err(failure) if failure.cancelled => return Err(failure),
                    // One broken object must not hide the others' figures.
                    Err(failure) => session.ui.complain(&failure),
                }
            }
        }
        let own: Vec<&PartsEvaluation> =
            rows.iter().filter(|r| r.protocol == *protocol).map(|r| &r.evaluation).collect();
        let _ = writeln!(text, "{}", summary(protocol, &own));
    }
    session.ui.say(&format!("\n{text}"));
    write_json(&args.out.join("joints.json"), &rows)?;
    let path = args.out.join("joints.md");
    hingecast_geom::staging::write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))?;
    session.answer(&rows)?;
    Ok(Outcome::Done)
}

fn one(
    session: &Session,
    object: &Named,
    place: &std::path::Path,
    synth_config: &SynthConfig,
    build_config: &Config,
    tidy: bool,
) -> Result<PartsEvaluation> {
    let (recording, run) = (place.join("recordings").join(&object.name), place.join("runs").join(&object.name));
    record_once(session, &object.argument, synth_config, &recording)?;
    let build_to = |stage: Stage| {
        let options = Options { to: Some(stage), ..session.options() };
        hingecast::build::build(&recording, &run, build_config, &options, &session.ui)
    };
    build_to(Stage::Parts)?;
    if !Parts::read(&run)?.information.is_empty() {
        // Noise: the pictures are asked as well.
        build_to(Stage::Joints)?;
    }
    let evaluation = evaluate_parts(&run, &Truth::folder_of(&recording))?;
    if tidy {
        super::suite::tidy(session, &recording);
    }
    Ok(evaluation)
}

fn line(protocol: &str, e: &PartsEvaluation) -> String {
    let joints: Vec<String> = e
        .joints
        .iter()
        .map(|j| {
            let found = j.found_type.map_or("missed".to_string(), |k| format!("{k:?}").to_lowercase());
            format!("{found} {:.3} deg, motion {:.4}", j.axis_deg, j.motion_mean)
        })
        .collect();
    format!(
        "{protocol} {}: {} of {} parts; {}; {:.0} s",
        e.object,
        e.found_parts,
        e.true_parts,
        joints.join("; "),
        e.secs
    )
}

/// One line of the table: means over joints of means over objects and seeds.
fn summary(protocol: &str, all: &[&PartsEvaluation]) -> String {
    let n = all.len();
    let right = |f: &dyn Fn(&PartsEvaluation) -> bool| all.iter().filter(|e| f(e)).count();
    let joints = || all.iter().flat_map(|e| &e.joints);
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let worst = joints().map(|j| j.axis_deg).fold(0.0, f64::max);
    let motion = |turns: bool| mean(joints().filter(|j| j.true_type.turns() == turns).map(|j| j.motion_mean).collect());
    format!(
        "| {protocol} | {n} | {} | {} | {} | {:.4} / {worst:.3} | {:.5} | {:.4} | {:.5} | {:.1} |",
        right(&|e| e.found_parts == e.true_parts),
        right(&|e| e.joints.iter().all(|j| j.type_right)),
        right(&|e| e.tree_accuracy == 1.0),
        mean(joints().map(|j| j.axis_deg).collect()),
        mean(joints().filter_map(|j| j.pivot).collect()),
        motion(true),
        motion(false),
        mean(all.iter().map(|e| e.secs).collect()),
    )
}
