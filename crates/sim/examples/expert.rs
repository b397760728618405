//! How often the demonstrator succeeds: `cargo run --release --example expert -- OBJECT
//! [open|close|hinged-box] [EPISODES]`.

use hingecast_sim::trial::{demonstrate, make_task};
use hingecast_sim::{Env, Outcome, Scene, SceneConfig, TaskKind, object};
use std::collections::BTreeMap;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let path = object::model_file(Path::new(args.first().ok_or("which object?")?))?;
    let kind = args.get(1).and_then(|n| TaskKind::from_name(n)).unwrap_or(TaskKind::Open);
    let episodes: u64 = args.get(2).map_or(Ok(100), |n| n.parse())?;
    let start = std::time::Instant::now();
    let made = make_task(&path, kind, None, None)?;
    println!("{:.1} s for the task ({} of {} tries)", start.elapsed().as_secs_f64(), made.worked, made.of);
    println!("{}", serde_json::to_string_pretty(&made.task)?);
    let scene = Scene::new(&SceneConfig { object: path, spoil: Vec::new(), visuals: false }, &made.task)?;
    let mut env = Env::new(&scene);
    let mut ends: BTreeMap<Outcome, usize> = BTreeMap::new();
    let (mut steps, start) = (0usize, std::time::Instant::now());
    for seed in 0..episodes {
        let outcome = demonstrate(&mut env, seed, |_, _| steps += 1)?;
        *ends.entry(outcome).or_default() += 1;
    }
    let secs = start.elapsed().as_secs_f64();
    println!("{ends:?}, {:.0} steps an episode, {:.0} steps/s", steps as f64 / episodes as f64, steps as f64 / secs);
    Ok(())
}
