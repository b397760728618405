//! The flags. Units and defaults are in the help texts.

mod studies;
mod world;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use hingecast::config::{Method, Preset};
use hingecast::import_object::ImportConfig;
use hingecast::prepare::FILM_STATES;
use hingecast_capture::import;
use hingecast_capture::synth::Noise;
use std::path::PathBuf;
pub use studies::{Bench, Demos, Experiment, Rollout, Train};
pub use world::WorldSettings;

/// What a newcomer types first.
const EXAMPLES: &str = "\
First steps:
  hingecast demo                                   the whole path on a sample object, in a few minutes
  hingecast synth microwave -o rec                 record an object of objects/ (truth goes to rec.truth)
  hingecast check rec                              is the recording in order?
  hingecast build rec -o run                       recording -> run/twin (URDF, MJCF, meshes, gaussians)
  hingecast eval run --truth rec.truth             how far off is it?

Exit status: 0 done, 1 under a bar that you asked for, 2 error, 130 stopped by Ctrl-C.";

/// A scan and a film are two states, and the search for parts compares so many.
fn film_states(text: &str) -> Result<usize, String> {
    let most = hingecast::MOST_STATES;
    let n = text.parse().ok().filter(|n| (2..=most).contains(n));
    n.ok_or_else(|| format!("a whole number from 2 to {most} is expected"))
}

fn at_least_one(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| *n >= 1).ok_or_else(|| "a whole number from 1 is expected".to_string())
}

/// One of some words, as config files have them.
fn words<T>(all: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: serde::de::DeserializeOwned + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(all).map(|word| serde_json::from_value(word.into()).expect("a word of the list"))
}

/// A cast of a thing, with its hinges: RGB-D recordings of an articulated object become a twin that
/// MuJoCo runs.
#[derive(Parser, Debug)]
#[command(version, max_term_width = 110, after_help = EXAMPLES)]
pub struct Cli {
    #[command(subcommand)]
    pub verb: Verb,
    /// Machine-readable answer on stdout; everything human stays on stderr.
    #[arg(long, global = true)]
    pub json: bool,
    /// Nothing on stderr but errors, not even the answer: that comes with --json.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Worker threads, 1 to 256, or to 4 per core if that is more [default: all cores]. The results
    /// do not depend on it.
    #[arg(long, global = true, value_name = "N", value_parser = at_least_one)]
    pub threads: Option<usize>,
}

#[derive(Subcommand, Debug)]
pub enum Verb {
    /// Record a sample object, build its twin, write the report: the whole path in a few minutes.
    Demo(Demo),
    /// Render a recording of an articulated object (URDF, MJCF, PartNet-Mobility) together with its
    /// truth.
    Synth(Synth),
    /// Convert scans of apps (Record3D, Polycam, Stray Scanner, 3D Scanner App) and recordings of other
    /// layouts (COLMAP, BOP, TUM, nerfstudio, ArtGS, DTA, PARIS, ScrewSplat, Dynamic 3D Gaussians).
    Import(Import),
    /// Convert an object (PartNet-Mobility, URDF) for the simulator: convex collision pieces,
    /// joints, limits, masses.
    ImportObject(ImportObject),
    /// Say what is wrong with a recording and what to try; `--fix` repairs what is safe to repair.
    Check(Check),
    /// Find the object in a recording without masks - what moves, and what that hangs on - and write
    /// its masks into the recording, with a sheet of pictures to look at.
    Mask(Mask),
    /// Build the twin of a recording. Run again to resume; finished stages are kept.
    Build(Build),
    /// Compare a run with the truth of its recording.
    Eval(Eval),
    /// Write the report of a run again.
    Report(Report),
    /// Write a page in which the parts of a twin are dragged along their joints: one file, any browser.
    View(View),
    /// Record demonstrations of the robot arm opening an object or its twin; `--inspect` lists,
    /// plots and replays them.
    Demos(Demos),
    /// Clone a policy from demonstrations (robomimic HDF5). Run again to resume; `--sweep` tries
    /// many settings.
    Train(Train),
    /// Run a policy in seeded episodes on the true object, on its twin and on spoiled ones; compare
    /// in pairs.
    Rollout(Rollout),
    /// Ask what a twin is worth: policies trained on the object act on its twins and on spoiled
    /// ones, and back; one table, one plot.
    Experiment(Experiment),
    /// Record, build and evaluate a suite of objects; print the table of errors and times.
    Bench(Bench),
    /// Say what this machine has and lacks.
    Doctor,
}

#[derive(Args, Debug)]
pub struct Demo {
    /// Sample object to record.
    #[arg(default_value = "hinged_box")]
    pub object: String,
    /// Folder for recording and run [default: runs/demo/OBJECT].
    #[arg(long, short)]
    pub out: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub struct Synth {
    /// Folder or file of the object, or the name of a sample (objects/ here, in $HINGECAST_OBJECTS or
    /// above the program, as target/release is) or of one in $HINGECAST_DATA.
    pub object: String,
    /// Recording folder to write; the truth goes to <OUT>.truth.
    #[arg(long, short)]
    pub out: PathBuf,
    #[command(flatten)]
    pub settings: SynthSettings,
    /// Seed of cameras, play and noise.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
    /// Leave the truth folder out.
    #[arg(long)]
    pub no_truth: bool,
}

#[derive(Args, Debug, Clone)]
pub struct SynthSettings {
    /// Joint configurations; 2 = both ends.
    #[arg(long, default_value_t = 25, value_name = "N")]
    pub states: usize,
    /// Training cameras per state.
    #[arg(long, default_value_t = 60, value_name = "N")]
    pub views: usize,
    /// Held-out cameras per state.
    #[arg(long, default_value_t = 4, value_name = "N")]
    pub test_views: usize,
    /// Image width and height, pixels.
    #[arg(long, default_value_t = 256, value_name = "PIXELS")]
    pub size: usize,
    /// Sensor model: `none` is exact; `d435` has depth noise, holes, colour noise, ragged masks and
    /// poses off by 0.5 deg and 3 mm. `stereo` (blotches of 8 to 20 pixels, 3 mm at 1 m, growing
    /// with the square; holes) and `tof` (smooth, pixels that fly at edges, dark and steep surfaces
    /// too far by some mm) change depth and colour alone.
    #[arg(long, default_value = "none", value_parser = words::<Noise>(&["none", "d435", "stereo", "tof"]))]
    pub noise: Noise,
    /// A hand and forearm reach in on this share of the training frames [default without a value:
    /// 0.2].
    #[arg(long, value_name = "SHARE", num_args = 0..=1, default_missing_value = "0.2")]
    pub occluders: Option<f64>,
    /// A recording of play: in every training frame hands hold the parts that move, and move along,
    /// as cameras see a person who plays with the object; their pixels are masked, frames that show
    /// little else are marked.
    #[arg(long, conflicts_with = "occluders")]
    pub play: bool,
    /// A film: `OUT/scan`, a walk around the object of --views pictures, and `OUT/play`, one video in
    /// which hands move the joints while the camera moves, as an app leaves them: no masks, no
    /// states. `hingecast import OUT/scan --film OUT/play` takes them.
    #[arg(long, conflicts_with_all = ["occluders", "play", "states", "test_views", "masks", "trajectory", "push"])]
    pub film: bool,
    /// Pictures of the play of a film, ten a second.
    #[arg(long, default_value_t = 150, value_name = "N", requires = "film")]
    pub play_frames: usize,
    /// First and last value of a joint, radians (hinge) or scene units (slide); may be repeated
    /// [default: what it can do].
    #[arg(long = "range", value_name = "JOINT=FROM:TO")]
    pub ranges: Vec<String>,
    #[command(flatten)]
    pub world: WorldSettings,
}

#[derive(Args, Debug)]
pub struct Import {
    /// Folder of the recording to convert, or a .r3d or .zip. Several: one state each, in this order.
    #[arg(required = true, value_name = "SOURCE")]
    pub sources: Vec<PathBuf>,
    /// A film in which hands move the parts of what the only SOURCE, a scan, shows at rest; one camera,
    /// any layout. It is cut into states: rests, and single pictures between them [default: no film].
    #[arg(long, value_name = "PLAY")]
    pub film: Option<PathBuf>,
    /// States that a film is cut into at most, the scan among them.
    #[arg(long, default_value_t = FILM_STATES, value_name = "N", requires = "film", value_parser = film_states)]
    pub film_states: usize,
    /// Pictures of a film that are looked at, evenly spread over it.
    #[arg(long, default_value_t = import::FILM_PICTURES, value_name = "N", requires = "film", value_parser = at_least_one)]
    pub film_pictures: usize,
    /// Recording folder to write.
    #[arg(long, short)]
    pub out: PathBuf,
    /// Layout of the sources: auto, record3d, scanner3d, stray, polycam, colmap, bop, tum, nerfstudio,
    /// artgs, dta, paris, screwsplat or dynamic3dgs.
    #[arg(long, default_value = "auto")]
    pub format: String,
    /// Pixels of less confidence lose their depth, where the source has confidence maps: 0 low, 1
    /// medium, 2 high.
    #[arg(long, default_value_t = import::Config::default().min_confidence, value_name = "LEVEL", value_parser = clap::value_parser!(u8).range(0..=2))]
    pub min_confidence: u8,
    /// Of a film, only every so many-th picture.
    #[arg(long, default_value_t = import::Config::default().every, value_name = "N", value_parser = at_least_one)]
    pub every: usize,
    /// At most so many training pictures a state, evenly spread over what is there.
    #[arg(long, default_value_t = import::Config::default().max_views, value_name = "N", value_parser = at_least_one)]
    pub max_views: usize,
    /// Folder of masks that are named as the colour images are, such as a segmenter writes. With several
    /// sources once for each, in their order [default: the source's own].
    #[arg(long, value_name = "FOLDER")]
    pub masks: Vec<PathBuf>,
    /// The object's number (or numbers: 1,3) in masks that have one a thing [default: all but 0].
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..))]
    pub mask_id: Vec<u16>,
}

#[derive(Args, Debug)]
pub struct ImportObject {
    /// Folder or file of the object (mobility.urdf), or the name of a sample or of one in
    /// $HINGECAST_DATA.
    pub object: String,
    /// Object folder to write: robot.xml (MJCF), robot.urdf, meshes.
    #[arg(long, short)]
    pub out: PathBuf,
    /// All lengths times this. The simulator scales by itself what its arm cannot reach; leave it
    /// when twins of the same recordings shall fit.
    #[arg(long, default_value_t = ImportConfig::default().scale, value_name = "FACTOR")]
    pub scale: f64,
    /// Density of all parts, kg/m^3.
    #[arg(long, default_value_t = ImportConfig::default().density, value_name = "DENSITY")]
    pub density: f64,
}

#[derive(Args, Debug)]
pub struct Check {
    /// Recording folder (the one that holds transforms.json).
    pub recording: PathBuf,
    /// Page to write: findings, pictures with their masks, the states over each other from above. Its
    /// contact sheet lies beside it.
    #[arg(long, short, value_name = "PAGE.html")]
    pub out: Option<PathBuf>,
    /// Repair what is safe: the old transforms.json is kept beside the new one.
    #[arg(long)]
    pub fix: bool,
}

#[derive(Args, Debug)]
pub struct Mask {
    /// Recording folder (the one that holds transforms.json).
    pub recording: PathBuf,
    /// The object is all that is in this box and not floor or wall: lowest and highest corner, world
    /// frame, scene units [default: it is what moves, and what that hangs on].
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true, conflicts_with = "at")]
    pub r#box: Option<String>,
    /// The object is the thing that this pixel of a picture shows, for instance
    /// rgb/s000_v003.png:160,120.
    #[arg(long, value_name = "PICTURE:U,V")]
    pub at: Option<String>,
    /// Seed of the samples that are looked at.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
}

#[derive(Args, Debug)]
pub struct Build {
    /// Recording folder (the one that holds transforms.json).
    pub recording: PathBuf,
    /// Run folder [default: runs/<recording's name>].
    #[arg(long, short)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub settings: BuildSettings,
    /// First stage to redo even if it is done: parts, splat, joints or twin (method track: splat,
    /// motion, parts, joints, twin) [default: the first that is missing].
    #[arg(long, value_name = "STAGE")]
    pub from: Option<String>,
    /// Last stage to run [default: twin].
    #[arg(long, value_name = "STAGE")]
    pub to: Option<String>,
    /// Throw an existing run away first.
    #[arg(long)]
    pub fresh: bool,
    /// Build even where `check` finds what makes it vain: wrong unit of depth, frames that differ,
    /// nothing that moves.
    #[arg(long)]
    pub force: bool,
    /// Exit with 1 when the run has doubts.
    #[arg(long)]
    pub strict: bool,
}

#[derive(Args, Debug, Clone)]
pub struct BuildSettings {
    /// fast: 12 k gaussians, 1500 steps; default: 24 k, 4000; best: 40 k, 10 000 and finer meshes.
    #[arg(long, value_parser = words::<Preset>(&["fast", "default", "best"]), default_value = "default", hide_possible_values = true)]
    pub preset: Preset,
    /// How parts and joints are found; screw: by the depth of all states at once; track: the
    /// classical way, Dynamic 3D Gaussians' tracking, distance clustering, ICP, RANSAC axis
    /// [default: screw].
    #[arg(long, value_parser = words::<Method>(&["screw", "track"]), hide_possible_values = true)]
    pub method: Option<Method>,
    /// TOML file with settings; its keys beat the preset. A run's own config.toml shows all keys
    /// with units.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// One setting, for instance `fit.steps=2000` or `twin.density=800` (kg/m^3); beats the file.
    /// May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Seed of everything random in the build [default: 0].
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
}

#[derive(Args, Debug)]
pub struct Eval {
    /// Run folder, the -o of `hingecast build`.
    pub run: PathBuf,
    /// Truth folder of the run's recording: <RECORDING>.truth, as `hingecast synth` writes it.
    #[arg(long)]
    pub truth: PathBuf,
    /// Exit with 1 unless the twin keeps this bar. KEY: joint.axis_deg (at most, degrees),
    /// joint.pivot (at most, share of the diagonal: 0.01 = 1 %), psnr (at least, dB), parts (1 =
    /// the count must be right). May be repeated [default: no bar].
    #[arg(long = "fail-under", value_name = "KEY=VALUE")]
    pub bars: Vec<String>,
}

#[derive(Args, Debug)]
pub struct Report {
    /// Run folder, the -o of `hingecast build`.
    pub run: PathBuf,
}

#[derive(Args, Debug)]
pub struct View {
    /// Run folder, the -o of `hingecast build`, or a folder with a twin.json.
    pub path: PathBuf,
    /// The page [default: RUN/report/view.html, or view.html beside the twin.json].
    #[arg(long, short)]
    pub out: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// clap's own check: doubled names, unreachable arguments. `bench` once had two `--seed`.
    #[test]
    fn the_flags_are_consistent() {
        Cli::command().debug_assert();
    }
}
