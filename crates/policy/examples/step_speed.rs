//! Milliseconds per training step. `scripts/policy_reference.py speed` runs it in turns with
//! PyTorch: for every line on stdin it takes as many steps as the line says and answers with the
//! milliseconds of one.
//!
//!     cargo run --release -p hingecast-policy --example step_speed -- HIDDEN THREADS

use hingecast_policy::net::{Adam, Batch, NetConfig, Network, Workspace};
use std::time::Instant;

fn main() {
    let mut args = std::env::args().skip(1).map(|a| a.parse().expect("HIDDEN and THREADS are numbers"));
    let (rnn_hidden, threads) = (args.next().unwrap_or(400), args.next().unwrap_or(1));
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().expect("the first pool");
    let net = Network::new(&NetConfig { rnn_hidden, ..Default::default() }, 19);
    let mut parameters = net.initial_parameters(0);
    let mut adam = Adam::new(parameters.len());
    let mut workspace = Workspace::default();
    let (sequences, steps) = (100, 10);
    let mut rng = fastrand::Rng::with_seed(1);
    let mut random = |n: usize| -> Vec<f32> { (0..n).map(|_| (2.0 * rng.f64() - 1.0) as f32).collect() };
    let (observations, actions) = (random(sequences * steps * 19), random(sequences * steps * 7));
    let batch = Batch { sequences, steps, observations: &observations, actions: &actions };
    for line in std::io::stdin().lines().map_while(Result::ok) {
        let count: usize = line.trim().parse().unwrap_or(5);
        let start = Instant::now();
        for _ in 0..count {
            net.loss_and_gradient(&parameters, &batch, &mut workspace);
            adam.step(&mut parameters, &workspace.gradients(), 1e-4);
        }
        println!("{:.3}", start.elapsed().as_secs_f64() * 1e3 / count as f64);
    }
}
