//! Loss and gradients of every kind of network against the slow twin and its central differences.

use hingecast_policy::net::{Batch, Head, NetConfig, Network, Workspace, reference};

fn random(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = fastrand::Rng::with_seed(seed);
    (0..n).map(|_| (2.0 * rng.f64() - 1.0) as f32).collect()
}

/// More sequences than one part of a batch has, so that parts are added too.
fn check(config: NetConfig, steps: usize) {
    let (inputs, sequences) = (5, 60);
    let net = Network::new(&config, inputs);
    // Larger than the usual initial values: every gate and activation leaves its linear middle.
    let parameters: Vec<f32> = net.initial_parameters(1).iter().map(|p| 2.0 * p).collect();
    let (observations, actions) = (random(sequences * steps * inputs, 2), random(sequences * steps * 7, 3));
    let batch = Batch { sequences, steps, observations: &observations, actions: &actions };
    let mut workspace = Workspace::default();
    let loss = net.loss_and_gradient(&parameters, &batch, &mut workspace);
    assert_eq!(loss, net.loss(&parameters, &batch, &mut Workspace::default()));

    let mut exact: Vec<f64> = parameters.iter().map(|p| f64::from(*p)).collect();
    let truth = reference::loss(&net, &exact, &batch);
    assert!((loss - truth).abs() < 1e-5 * truth.abs().max(1.0), "{config:?}: loss {loss}, reference {truth}");

    let gradients = workspace.gradients();
    assert_eq!(gradients.len(), 2);
    let mut rng = fastrand::Rng::with_seed(4);
    for tensor in &net.tensors {
        let gradient = |k: usize| gradients.iter().map(|g| f64::from(g[k])).sum::<f64>();
        let largest = tensor.range.clone().map(|k| gradient(k).abs()).fold(0.0, f64::max);
        assert!(largest > 0.0, "{} has no gradient", tensor.name);
        for _ in 0..12 {
            let k = rng.usize(tensor.range.clone());
            let (step, here) = (1e-5, exact[k]);
            exact[k] = here + step;
            let above = reference::loss(&net, &exact, &batch);
            exact[k] = here - step;
            let below = reference::loss(&net, &exact, &batch);
            exact[k] = here;
            let truth = (above - below) / (2.0 * step);
            let error = (gradient(k) - truth).abs();
            assert!(error < 1e-4 * largest + 1e-8, "{}[{k}]: {} instead of {truth}", tensor.name, gradient(k));
        }
    }
}

#[test]
fn lstm_with_mixture() {
    // A wide min_std, or single steps would hang on one mode's tail.
    check(NetConfig { rnn_hidden: 9, num_modes: 3, min_std: 0.2, ..Default::default() }, 4);
}

#[test]
fn lstm_with_mlp_and_action() {
    check(NetConfig { rnn_hidden: 9, actor_layer_dims: vec![11, 6], head: Head::Action, ..Default::default() }, 3);
}

#[test]
fn mlp_with_gaussian() {
    let net = NetConfig { rnn_layers: 0, actor_layer_dims: vec![12, 10], head: Head::Gaussian, ..Default::default() };
    check(NetConfig { init_std: 0.5, min_std: 0.05, ..net }, 1);
}

#[test]
fn mlp_with_mixture_and_lstm_with_gaussian() {
    check(NetConfig { rnn_layers: 0, actor_layer_dims: vec![12], num_modes: 2, min_std: 0.2, ..Default::default() }, 1);
    check(NetConfig { rnn_layers: 3, rnn_hidden: 7, head: Head::Gaussian, init_std: 0.5, ..Default::default() }, 5);
}

/// The step by step form of rollouts says what the batch form says.
#[test]
fn one_at_a_time_is_the_same_network() {
    let net = Network::new(
        &NetConfig { rnn_hidden: 20, actor_layer_dims: vec![9], head: Head::Action, ..Default::default() },
        5,
    );
    let parameters = net.initial_parameters(5);
    let observations = random(6 * 5, 6);
    let mut state = net.initial_state();
    let actions: Vec<f32> = observations
        .chunks_exact(5)
        .flat_map(|x| net.step(&parameters, x, &mut state).remove(0))
        .map(f32::tanh)
        .collect();
    let batch = Batch { sequences: 1, steps: 6, observations: &observations, actions: &actions };
    let loss = net.loss(&parameters, &batch, &mut Workspace::default());
    assert!(loss < 1e-13, "mean squared difference {loss}");
    assert_ne!(state, net.initial_state());
}

/// One thread or four: the same bits.
#[test]
fn threads_do_not_change_a_bit() {
    let net = Network::new(&NetConfig { rnn_hidden: 24, ..Default::default() }, 6);
    let parameters = net.initial_parameters(1);
    let (observations, actions) = (random(230 * 4 * 6, 2), random(230 * 4 * 7, 3));
    let batch = Batch { sequences: 230, steps: 4, observations: &observations, actions: &actions };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut p = parameters.clone();
            let mut workspace = Workspace::default();
            let mut adam = hingecast_policy::net::Adam::new(p.len());
            for _ in 0..3 {
                net.loss_and_gradient(&p, &batch, &mut workspace);
                adam.step(&mut p, &workspace.gradients(), 1e-3);
            }
            (p, adam)
        })
    };
    assert_eq!(run(1), run(4));
}
