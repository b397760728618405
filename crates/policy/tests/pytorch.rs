//! Numbers from robomimic's actor network and PyTorch's Adam: weights by name, first gradient, 200
//! losses on the same batches, weights at the end, and what the trained network says of
//! observations. `scripts/policy_reference.py curve` writes the files.

use hingecast_policy::net::{Adam, Batch, NetConfig, Network, Workspace};
use hingecast_policy::{Actor, ObsKey, Policy, PolicyConfig};
use safetensors::SafeTensors;
use std::path::Path;

struct Reference {
    bytes: Vec<u8>,
}

impl Reference {
    fn file(&self) -> SafeTensors<'_> {
        SafeTensors::deserialize(&self.bytes).unwrap()
    }

    fn f32s(&self, name: &str) -> Vec<f32> {
        let file = self.file();
        let bytes = file.tensor(name).unwrap().data();
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    /// All of the network's parameters of one kind: initial, gradient, final.
    fn all(&self, net: &Network, kind: &str) -> Vec<f32> {
        net.tensors.iter().flat_map(|t| self.f32s(&format!("{kind}.{}", t.name))).collect()
    }

    fn note(&self, key: &str) -> f64 {
        let (_, metadata) = SafeTensors::read_metadata(&self.bytes).unwrap();
        metadata.metadata().as_ref().unwrap()[key].parse().unwrap()
    }
}

fn compare(path: &Path) {
    let reference = Reference { bytes: std::fs::read(path).unwrap() };
    let shape = reference.file().tensor("observations").unwrap().shape().to_vec();
    let (pool, steps, inputs) = (shape[0], shape[1], shape[2]);
    let config = NetConfig {
        rnn_hidden: reference.note("hidden") as usize,
        min_std: reference.note("min_std"),
        ..NetConfig::default()
    };
    let net = Network::new(&config, inputs);
    let (observations, actions) = (reference.f32s("observations"), reference.f32s("actions"));
    let file = reference.file();
    let losses = file.tensor("losses").unwrap();
    let losses: Vec<f64> = losses.data().chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();

    let sequences = reference.note("batch") as usize;
    let mut parameters = reference.all(&net, "initial");
    let mut adam = Adam::new(parameters.len());
    let mut workspace = Workspace::default();
    let mut worst = 0.0f64;
    for (k, truth) in losses.iter().enumerate() {
        let rows = (0..sequences).map(|j| (k * sequences + j) % pool);
        let pick = |from: &[f32], width: usize| -> Vec<f32> {
            rows.clone().flat_map(|r| from[r * steps * width..(r + 1) * steps * width].to_vec()).collect()
        };
        let (x, a) = (pick(&observations, inputs), pick(&actions, 7));
        let batch = Batch { sequences, steps, observations: &x, actions: &a };
        let loss = net.loss_and_gradient(&parameters, &batch, &mut workspace);
        worst = worst.max((loss - truth).abs());
        if k == 0 {
            let truth = reference.all(&net, "gradient");
            let largest = truth.iter().fold(0.0f32, |m, g| m.max(g.abs()));
            for (i, truth) in truth.iter().enumerate() {
                let ours: f32 = workspace.gradients().iter().map(|g| g[i]).sum();
                assert!((ours - truth).abs() < 2e-6 * largest.max(1.0), "gradient [{i}]: {ours} instead of {truth}");
            }
        }
        adam.step(&mut parameters, &workspace.gradients(), reference.note("rate"));
    }
    println!("largest difference of {} losses: {worst:.2e}; last loss {:.4}", losses.len(), losses[losses.len() - 1]);
    assert!(losses.len() == 200 && worst < 1e-3, "{worst}");
    let moved: Vec<f32> = reference.all(&net, "final");
    let far = moved.iter().zip(&parameters).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
    assert!(f64::from(far) < 5.0 * reference.note("rate"), "weights differ by {far}");

    // The trained weights, put into a policy by their names, say what robomimic's network says in
    // evaluation.
    let obs = vec![ObsKey { key: "object".into(), width: inputs }];
    let policy = Policy::new(PolicyConfig::new(obs, steps, config, None, 200), moved).unwrap();
    let dir = tempfile::tempdir().unwrap();
    policy.save(dir.path()).unwrap();
    let policy = Policy::load(dir.path()).unwrap();
    let (means, weights) = (reference.f32s("means"), reference.f32s("weights"));
    let mut state = policy.net.initial_state();
    let mut actor = Actor::new(&policy, 0);
    for t in 0..steps {
        let x = &observations[t * inputs..(t + 1) * inputs];
        let outputs = policy.net.step(&policy.parameters, x, &mut state);
        let total: f32 = outputs[2].iter().map(|l| l.exp()).sum();
        for m in 0..5 {
            assert!((outputs[2][m].exp() / total - weights[5 * t + m]).abs() < 1e-5);
            for d in 0..7 {
                assert!((outputs[0][7 * m + d].tanh() - means[(5 * t + m) * 7 + d]).abs() < 1e-5);
            }
        }
        let seen = [("object".to_string(), x.iter().map(|v| f64::from(*v)).collect())].into();
        let action = actor.act(&seen).unwrap();
        let near = |m: usize| (0..7).all(|d| (action[d] - f64::from(means[(5 * t + m) * 7 + d])).abs() < 6e-4);
        assert!((0..5).any(near), "step {t}: {action:?} is none of the modes");
    }
}

#[test]
fn two_hundred_steps_as_pytorch_takes_them() {
    compare(Path::new("tests/data/curve.safetensors"));
}

/// The same at full size (19 -> 400 -> 400, batch 100, sequence 10, robomimic's settings for Lift).
/// HINGECAST_PYTHON names an interpreter with torch and robomimic.
#[test]
fn two_hundred_steps_at_full_size() {
    let Ok(python) = std::env::var("HINGECAST_PYTHON") else {
        println!("skipped: HINGECAST_PYTHON names no interpreter with torch and robomimic");
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("curve.safetensors");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/policy_reference.py");
    let said = std::process::Command::new(python).arg(script).arg("curve").arg(&path).arg("lift").output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    compare(&path);
}
