//! Flags of the verbs that ask what a twin is worth.

use super::{BuildSettings, SynthSettings, at_least_one};
use clap::Args;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub struct Train {
    /// Demonstrations in robomimic's HDF5 layout.
    pub demos: PathBuf,
    /// Policy folder to write: weights (safetensors), policy.json, losses, train.toml with all
    /// settings.
    #[arg(long, short)]
    pub out: PathBuf,
    /// bc-rnn-fast: LSTM of 100, 6000 steps, minutes on two cores; bc-rnn: robomimic's settings for
    /// Lift, LSTM of 400, 200 000 steps, hours; bc: an MLP that sees one step.
    #[arg(long, default_value = "bc-rnn-fast", value_parser = ["bc-rnn-fast", "bc-rnn", "bc"], hide_possible_values = true)]
    pub preset: String,
    /// TOML file with settings; its keys beat the preset. A policy's own train.toml shows all keys
    /// with their values.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// One setting, for instance `learning_rate=3e-4` or `net.rnn_hidden=200`; beats the file. May
    /// be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Training steps, one batch each [default: of the preset].
    #[arg(long, value_name = "N")]
    pub steps: Option<usize>,
    /// Seed of initial weights, batches and split [default: 0].
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Train once per combination of the settings in this TOML file, each in a folder of its own
    /// below OUT; as many at a time as there are threads; table and plot at the end. docs/policy.md
    /// shows such a file.
    #[arg(long, value_name = "FILE")]
    pub sweep: Option<PathBuf>,
    /// Episodes that every policy of a sweep is rolled out in, where the demonstrations' world is
    /// at hand; 0 = none.
    #[arg(long, default_value_t = 50, value_name = "N")]
    pub rollouts: usize,
}

#[derive(Args, Debug)]
pub struct Bench {
    /// `ours` (objects/), `real` ($HINGECAST_DATA), `all`, or object names.
    #[arg(default_value = "ours")]
    pub suite: Vec<String>,
    /// Folder for recordings and runs; existing ones are reused.
    #[arg(long, short, default_value = "runs/bench")]
    pub out: PathBuf,
    #[command(flatten)]
    pub synth: SynthSettings,
    #[command(flatten)]
    pub build: BuildSettings,
    /// Compare with the table of an earlier bench (its bench.json); exit 1 when a figure got
    /// clearly worse.
    #[arg(long, value_name = "FILE")]
    pub against: Option<PathBuf>,
    /// Seed of cameras, play and noise of the recordings.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub recording_seed: u64,
    /// Only parts and joints, under protocols of 25, 5 and 2 states with and without noise; the
    /// method is screw. Smaller pictures make it quicker.
    #[arg(long)]
    pub joints: bool,
    /// For the bench of joints: 25x60, 25x60-d435, 5x48, 5x48-d435, 2x100 or 2x100-d435 (states x
    /// views); may be repeated [default: all].
    #[arg(long = "protocol", value_name = "NAME")]
    pub protocols: Vec<String>,
    /// For the bench of joints: recordings of each object, with consecutive seeds.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seeds: u64,
    /// Delete each recording once it is evaluated (56 MB per object at the defaults).
    #[arg(long)]
    pub tidy: bool,
}

#[derive(Args, Debug)]
pub struct Demos {
    /// open: through half of the joint's range; close; hinged-box: the seed's two blocks, which
    /// lifting solves too.
    #[arg(long, default_value = "open", value_parser = ["open", "close", "hinged-box"])]
    pub task: String,
    /// Folder or file of the object, or the name of a sample [default: covered_box; hinged_blocks
    /// for hinged-box].
    #[arg(long, value_name = "OBJECT")]
    pub object: Option<String>,
    /// Record on the twin of this run instead [default: on the object].
    #[arg(long, value_name = "RUN", conflicts_with = "object")]
    pub twin: Option<PathBuf>,
    /// Which joint moves, by its name in the model [default: the one that is easiest to grasp].
    #[arg(long, value_name = "NAME")]
    pub joint: Option<String>,
    /// Simulated metres per unit of the model file [default: at most 1, so that the arm reaches all
    /// of the joint's way].
    #[arg(long, value_name = "FACTOR")]
    pub scale: Option<f64>,
    /// Who demonstrates; teleop: you, at the keyboard of this terminal, 20 Hz. Each episode is in
    /// the file once it is kept; the same command goes on with the file.
    #[arg(long, default_value = "scripted", value_parser = ["scripted", "teleop"])]
    pub expert: String,
    /// Successful episodes to record (teleop: episodes to keep, unless you quit before).
    #[arg(short, default_value_t = 300, value_name = "N", value_parser = at_least_one)]
    pub n: usize,
    /// File to write, robomimic's HDF5; needed unless --inspect is given [default: none].
    #[arg(long, short, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Seed of places, starts and imperfections.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
    /// List and plot this file and replay it; exit 1 unless every state comes out with the same
    /// bits [default: none].
    #[arg(long, value_name = "FILE")]
    pub inspect: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub struct Rollout {
    /// Folder of the policy, the -o of `hingecast train`.
    pub policy: PathBuf,
    /// The true object: folder, file or name of a sample [default: what the demonstrations were
    /// recorded on].
    #[arg(long, value_name = "OBJECT")]
    pub object: Option<String>,
    /// Run whose twin takes the object's place; both given: same seeds, compared in pairs [default:
    /// none].
    #[arg(long, value_name = "RUN")]
    pub twin: Option<PathBuf>,
    /// Also on the object spoiled on purpose: axis=DEGREES, pivot=MM, limits=SHARE, edge (the hinge
    /// on the opposite edge); joined by commas for several at once; may be repeated, each is a
    /// world of its own [default: none].
    #[arg(long, value_name = "HOW")]
    pub spoil: Vec<String>,
    /// Demonstrations whose task (place, grasp, size) holds here [default: those that the policy
    /// was trained on; without a note of them the task is made from the object].
    #[arg(long, value_name = "FILE")]
    pub demos: Option<PathBuf>,
    /// Episodes in every world.
    #[arg(short, default_value_t = 200, value_name = "N", value_parser = at_least_one)]
    pub n: usize,
    /// Seed of the episodes; that of the demonstrations (0) would begin where they began.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// Folder for the report: index.html, rollout.json, a strip of pictures of each kind of end
    /// [default: none, only the answer].
    #[arg(long, short, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub struct Experiment {
    /// Object names, `ours` (objects/), `real` ($HINGECAST_DATA) or `all`.
    #[arg(default_values_t = ["covered_box", "microwave", "cabinet_two_door", "three_drawers"].map(String::from))]
    pub objects: Vec<String>,
    /// Folder to write: experiment.md, .csv, .json and .svg, and a folder of each object with all
    /// that was made on the way. Run again to go on.
    #[arg(long, short)]
    pub out: PathBuf,
    /// Recordings to take instead of rendering: <FOLDER>/<object>; what is not there is rendered
    /// [default: none].
    #[arg(long, value_name = "FOLDER")]
    pub recordings: Option<PathBuf>,
    /// Runs of `hingecast build` to take instead of building: <FOLDER>/<object>, for the twin whose
    /// method they have; may be repeated; what is not there is built [default: none].
    #[arg(long, value_name = "FOLDER")]
    pub runs: Vec<PathBuf>,
    /// A world besides the true object: twin, track (the classical method's twin), axis=DEGREES,
    /// pivot=MM (simulated), limits=SHARE, edge, or back (a policy from the twin on the true
    /// object); may be repeated [default: twin, track, axis=3, axis=10, axis=30, pivot=3, pivot=10,
    /// pivot=30, limits=0.5, edge, back].
    #[arg(long = "world", value_name = "NAME")]
    pub worlds: Vec<String>,
    /// Demonstrations on each object, and on each twin for `back`.
    #[arg(short, long, default_value_t = 300, value_name = "N", value_parser = at_least_one)]
    pub demos: usize,
    /// Episodes of each policy on the true object, on twins and for `back`.
    #[arg(short, long, default_value_t = 200, value_name = "N", value_parser = at_least_one)]
    pub episodes: usize,
    /// Episodes of each policy on each spoiled object, at most as many [default: as --episodes].
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    pub spoiled_episodes: Option<usize>,
    /// Policies trained on the same demonstrations, with seeds 0, 1, ...
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = at_least_one)]
    pub train_seeds: usize,
    /// Preset of the policies, as in `train`.
    #[arg(long, default_value = "bc-rnn-fast", value_parser = ["bc-rnn-fast", "bc-rnn", "bc"])]
    pub policy: String,
    /// One setting of the training, for instance `steps=3000`; may be repeated [default: those of
    /// the preset].
    #[arg(long = "policy-set", value_name = "KEY=VALUE")]
    pub policy_set: Vec<String>,
    #[command(flatten)]
    pub synth: SynthSettings,
    #[command(flatten)]
    pub build: BuildSettings,
    /// Seed of cameras, play and noise of the recordings.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub recording_seed: u64,
}
