//! The recurrent policy of robomimic's size: a step of training, and an action in a rollout.
//! `cargo bench -p hingecast-policy`; `examples/step_speed.rs` compares with PyTorch.

use divan::{Bencher, black_box};
use hingecast_policy::ACTION_SIZE;
use hingecast_policy::net::{Adam, Batch, NetConfig, Network, Workspace};

/// Numbers of an observation.
const INPUTS: usize = 19;
/// A batch: sequences and their steps.
const SEQUENCES: usize = 100;
const STEPS: usize = 10;
/// Hidden numbers: a quick policy, and robomimic's default.
const HIDDEN: [usize; 2] = [100, 400];

fn main() {
    divan::main();
}

fn network(rnn_hidden: usize) -> (Network, Vec<f32>) {
    let net = Network::new(&NetConfig { rnn_hidden, ..NetConfig::default() }, INPUTS);
    let parameters = net.initial_parameters(0);
    (net, parameters)
}

/// Observations and actions of a batch.
fn numbers() -> (Vec<f32>, Vec<f32>) {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut some = |n: usize| -> Vec<f32> { (0..n).map(|_| 2.0 * rng.f32() - 1.0).collect() };
    (some(SEQUENCES * STEPS * INPUTS), some(SEQUENCES * STEPS * ACTION_SIZE))
}

fn batch(numbers: &(Vec<f32>, Vec<f32>)) -> Batch<'_> {
    Batch { sequences: SEQUENCES, steps: STEPS, observations: &numbers.0, actions: &numbers.1 }
}

#[divan::bench(args = HIDDEN, max_time = 5)]
fn forward(bencher: Bencher, hidden: usize) {
    let ((net, parameters), numbers) = (network(hidden), numbers());
    let mut workspace = Workspace::default();
    bencher.bench_local(|| net.loss(black_box(&parameters), &batch(&numbers), &mut workspace));
}

#[divan::bench(args = HIDDEN, max_time = 5)]
fn forward_and_backward(bencher: Bencher, hidden: usize) {
    let ((net, parameters), numbers) = (network(hidden), numbers());
    let mut workspace = Workspace::default();
    bencher.bench_local(|| net.loss_and_gradient(black_box(&parameters), &batch(&numbers), &mut workspace));
}

#[divan::bench(args = HIDDEN)]
fn adam(bencher: Bencher, hidden: usize) {
    let ((net, mut parameters), numbers) = (network(hidden), numbers());
    let mut workspace = Workspace::default();
    net.loss_and_gradient(&parameters, &batch(&numbers), &mut workspace);
    let mut adam = Adam::new(parameters.len());
    bencher.bench_local(|| adam.step(&mut parameters, &workspace.gradients(), black_box(1e-6)));
}

/// One action of a rollout.
#[divan::bench(args = HIDDEN)]
fn act(bencher: Bencher, hidden: usize) {
    let ((net, parameters), numbers) = (network(hidden), numbers());
    let mut state = net.initial_state();
    bencher.bench_local(|| net.step(&parameters, black_box(&numbers.0[..INPUTS]), &mut state));
}
