//! Parts and joints of every object of a suite under every protocol and seed, without meshes.

use crate::host::Host;
use crate::suite::{Named, record_once, tidy};
use hingecast::artifacts::Parts;
use hingecast::build::{Options, Stage};
use hingecast::config::Config;
use hingecast::eval::parts::{PartsEvaluation, evaluate_parts};
use hingecast::failure::{Failure, Result};
use hingecast_capture::Truth;
use hingecast_capture::synth::{Noise, SynthConfig};
use std::fmt::Write as _;
use std::path::Path;

/// Name, states, views, noise.
const PROTOCOLS: [(&str, usize, usize, Noise); 6] = [
    ("25x60", 25, 60, Noise::None),
    ("25x60-d435", 25, 60, Noise::D435),
    ("5x48", 5, 48, Noise::None),
    ("5x48-d435", 5, 48, Noise::D435),
    ("2x100", 2, 100, Noise::None),
    ("2x100-d435", 2, 100, Noise::D435),
];

/// One cell of the grid: one recording of one object.
#[derive(serde::Serialize)]
pub struct Row {
    /// Name of the protocol, such as `25x60-d435`: states x views, and the camera's noise.
    pub protocol: String,
    /// Seed of the recording.
    pub seed: u64,
    /// Which parts and joints were found, and how far off they are; its fields stand beside these
    /// two in the JSON.
    #[serde(flatten)]
    pub evaluation: PartsEvaluation,
}

/// What a grid is asked for.
pub struct Request<'a> {
    /// Objects, as [`crate::suite::objects`] answers them.
    pub suite: &'a [Named],
    /// Names of protocols; all if empty. A name that does not exist is passed over beside one that
    /// does.
    pub protocols: &'a [String],
    /// Number of seeds, from `first_seed` on.
    pub seeds: u64,
    /// Seed of the first recording of each object; the next have the numbers after it.
    pub first_seed: u64,
    /// Recordings, but for what the protocol says: states, views, noise, seed, no test views.
    pub synth: &'a SynthConfig,
    /// Settings of the search for parts; its method must be `screw`.
    pub build: &'a Config,
    /// Recordings and runs go to `joints/PROTOCOL/seedN` in this folder.
    pub out: &'a Path,
    /// Remove each recording when its run is evaluated.
    pub tidy: bool,
}

/// Runs the grid; answers its cells and the table in Markdown, one line a protocol. A recording
/// that is there with the same settings is used again.
///
/// # Errors
/// None of the named protocols exists; the wish to stop. An object that fails is told and left out.
pub fn run(host: &Host, request: &Request) -> Result<(Vec<Row>, String)> {
    let asked = |name: &str| request.protocols.is_empty() || request.protocols.iter().any(|n| n == name);
    let wanted: Vec<_> = PROTOCOLS.iter().filter(|p| asked(p.0)).collect();
    if wanted.is_empty() {
        let all: Vec<&str> = PROTOCOLS.iter().map(|p| p.0).collect();
        return Err(Failure::new(
            "no such protocol",
            format!("--protocol {:?}", request.protocols),
            format!("one of {}", all.join(", ")),
        ));
    }
    let mut rows: Vec<Row> = Vec::new();
    let mut text = format!(
        "| protocol | runs | parts right | types right | parents right | axis deg mean / max | pivot mean | turn deg mean | \
         slide mean | s mean |\n{}\n",
        "|---".repeat(10) + "|"
    );
    for (protocol, states, views, noise) in wanted {
        for seed in request.first_seed..request.first_seed + request.seeds {
            let base = SynthConfig { seed, ..request.synth.clone() };
            let synth_config = SynthConfig { states: *states, views: *views, noise: *noise, test_views: 0, ..base };
            let place = request.out.join("joints").join(protocol).join(format!("seed{seed}"));
            for object in request.suite {
                match one(host, request, object, &place, &synth_config) {
                    Ok(evaluation) => {
                        host.watcher.say(&line(protocol, &evaluation));
                        rows.push(Row { protocol: protocol.to_string(), seed, evaluation });
                    }
                    Err(failure) if failure.cancelled => return Err(failure),
                    // One broken object must not hide the others' figures.
                    Err(failure) => host.watcher.complain(&failure),
                }
            }
        }
        let own: Vec<&PartsEvaluation> =
            rows.iter().filter(|r| r.protocol == *protocol).map(|r| &r.evaluation).collect();
        let _ = writeln!(text, "{}", summary(protocol, &own));
    }
    Ok((rows, text))
}

fn one(
    host: &Host,
    request: &Request,
    object: &Named,
    place: &Path,
    synth_config: &SynthConfig,
) -> Result<PartsEvaluation> {
    let (recording, run) = (place.join("recordings").join(&object.name), place.join("runs").join(&object.name));
    record_once(host, &object.argument, synth_config, &recording)?;
    let build_to = |stage: Stage| {
        let options = Options { to: Some(stage), ..host.options() };
        hingecast::build::build(&recording, &run, request.build, &options, host.watcher)
    };
    build_to(Stage::Parts)?;
    if !Parts::read(&run)?.information.is_empty() {
        // Noise: the pictures are asked as well.
        build_to(Stage::Joints)?;
    }
    let evaluation = evaluate_parts(&run, &Truth::folder_of(&recording))?;
    if request.tidy {
        tidy(host, &recording);
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
