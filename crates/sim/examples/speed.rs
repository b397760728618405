//! Control steps per second: `cargo run --release --example speed -- [OBJECT] [SECONDS]`, on one
//! thread and on two. scripts/robosuite_speed.py measures robosuite's Python environment in the
//! same way.

use hingecast_sim::trial::make_task;
use hingecast_sim::{Env, Scene, SceneConfig, TaskKind, object};
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let path = object::model_file(Path::new(args.first().map_or("objects/covered_box", String::as_str)))?;
    let seconds: f64 = args.get(1).map_or(Ok(5.0), |n| n.parse())?;
    let task = make_task(&path, TaskKind::Open, None, None)?.task;
    let scene = Scene::new(&SceneConfig { object: path, spoil: Vec::new(), visuals: false }, &task)?;
    for threads in [1, 2] {
        let start = Instant::now();
        let steps: usize = std::thread::scope(|scope| {
            let run = |seed| work(Env::new(&scene), seed, seconds);
            let workers: Vec<_> = (0..threads).map(|seed| scope.spawn(move || run(seed))).collect();
            workers.into_iter().map(|w| w.join().expect("a worker does not panic")).sum()
        });
        println!("{threads} threads: {:.0} steps/s", steps as f64 / start.elapsed().as_secs_f64());
    }
    Ok(())
}

/// Random actions, a new episode every 200 steps, observations taken: what a rollout costs without
/// its policy.
fn work(mut env: Env, seed: u64, seconds: f64) -> usize {
    let mut rng = fastrand::Rng::with_seed(seed);
    let start = Instant::now();
    let mut steps = 0;
    while start.elapsed().as_secs_f64() < seconds {
        if steps % 200 == 0 {
            env.reset(rng.u64(..));
        }
        let action = std::array::from_fn(|_| 2.0 * rng.f64() - 1.0);
        env.step(&action).expect("finite actions");
        std::hint::black_box(env.observe());
        steps += 1;
    }
    steps
}
