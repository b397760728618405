//! A trained policy: weights, the network's shape, and how observations are prepared for it.
//!
//! A folder with `policy.json` (all but the weights) and `policy.safetensors` (robomimic's names,
//! f32). Both are open formats; weights of another program with the same names and shapes can be
//! put in place.

use crate::PolicyError;
use crate::net::{NetConfig, Network};
use hingecast_geom::staging::write_whole;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Grows when the meaning of the files changes.
const FORMAT: &str = "hingecast-policy-1";

/// An observation that the policy looks at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObsKey {
    /// Its name in the demonstrations and the environment.
    pub key: String,
    /// How many numbers.
    pub width: usize,
}

/// (x - mean) / std, for every number of the observation in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normalization {
    /// Mean of every number. (inputs)
    pub mean: Vec<f64>,
    /// What every number is divided by, above 0. (inputs)
    pub std: Vec<f64>,
}

/// `policy.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyConfig {
    /// Name and version of the format.
    pub format: String,
    /// In alphabetical order, which is the order of their numbers in the network's input.
    pub obs: Vec<ObsKey>,
    /// Steps after which a rollout forgets the hidden state (robomimic's rnn.horizon).
    pub horizon: usize,
    /// Shape of the network.
    pub net: NetConfig,
    /// `None`: observations go in as they are.
    pub normalization: Option<Normalization>,
    /// Training steps that the weights have seen.
    pub steps: u64,
}

impl PolicyConfig {
    /// A configuration in the present format; `obs` in alphabetical order.
    pub fn new(
        obs: Vec<ObsKey>,
        horizon: usize,
        net: NetConfig,
        normalization: Option<Normalization>,
        steps: u64,
    ) -> Self {
        Self { format: FORMAT.to_string(), obs, horizon, net, normalization, steps }
    }

    /// Numbers of an observation.
    pub fn inputs(&self) -> usize {
        self.obs.iter().fold(0, |sum, k| sum.saturating_add(k.width))
    }
}

/// Weights with all that is needed to act by them.
#[derive(Clone, Debug)]
pub struct Policy {
    /// What `policy.json` holds.
    pub config: PolicyConfig,
    /// Where each parameter lies.
    pub net: Network,
    /// The weights, in the network's order.
    pub parameters: Vec<f32>,
}

impl Policy {
    /// A policy from its parts.
    ///
    /// # Errors
    /// A normalisation of other sizes than the observations, and whatever else [`Policy::load`]
    /// would not read again; parameters of another network.
    pub fn new(config: PolicyConfig, parameters: Vec<f32>) -> Result<Self, PolicyError> {
        let refuse = |what: String| {
            PolicyError::new(what, "the policy's configuration", "take net, obs and normalization of one training")
        };
        config.check().map_err(refuse)?;
        let net = Network::new(&config.net, config.inputs());
        if parameters.len() != net.parameters() {
            return Err(refuse(format!("{} weights, {} are expected", parameters.len(), net.parameters())));
        }
        Ok(Self { config, net, parameters })
    }

    /// Writes `policy.safetensors`, then `policy.json`: where the second is, the first is whole.
    ///
    /// # Errors
    /// The folder cannot be made or written.
    pub fn save(&self, folder: &Path) -> Result<(), PolicyError> {
        std::fs::create_dir_all(folder).map_err(|e| PolicyError::write(folder, e))?;
        let path = folder.join("policy.safetensors");
        let bytes = tensors_to_bytes(&self.net, &[("", &self.parameters)], None);
        write_whole(&path, &bytes).map_err(|e| PolicyError::write(&path, e))?;
        let path = folder.join("policy.json");
        let text = serde_json::to_string_pretty(&self.config).expect("plain data") + "\n";
        write_whole(&path, text.as_bytes()).map_err(|e| PolicyError::write(&path, e))
    }

    /// Reads what [`Policy::save`] wrote.
    ///
    /// # Errors
    /// A folder without a policy, damaged files, weights of another network, NaN among them.
    pub fn load(folder: &Path) -> Result<Self, PolicyError> {
        let path = folder.join("policy.json");
        let text = std::fs::read(&path).map_err(|e| {
            let hint = "give the folder that `hingecast train -o` wrote; an unfinished training has no policy.json yet";
            PolicyError::new(format!("not a policy: {e}"), path.display().to_string(), hint)
        })?;
        let damaged = |what: String| {
            PolicyError::new(what, path.display().to_string(), "train again, or restore the file that `train` wrote")
        };
        let config: PolicyConfig =
            serde_json::from_slice(&text).map_err(|e| damaged(format!("not a policy's configuration: {e}")))?;
        config.check().map_err(damaged)?;

        let path = folder.join("policy.safetensors");
        let bytes = std::fs::read(&path).map_err(|e| PolicyError::read(&path, e))?;
        let net = Network::new(&config.net, config.inputs());
        let file = SafeTensors::deserialize(&bytes).map_err(|e| not_safetensors(&path, e))?;
        let parameters = parameters_from(&net, &file, "", &path)?;
        Ok(Self { config, net, parameters })
    }

    /// The network's input for one observation: its keys in order, normalised.
    ///
    /// # Errors
    /// A key that is missing, of another width, or not finite.
    pub fn input(&self, obs: &BTreeMap<String, Vec<f64>>) -> Result<Vec<f32>, PolicyError> {
        let mut x = Vec::with_capacity(self.config.inputs());
        for ObsKey { key, width } in &self.config.obs {
            let refuse = |what: &str, value: String| {
                let hint = "the policy needs the observations that it was trained on; policy.json lists them";
                Err(PolicyError::new(what, format!("observation {key}: {value}"), hint))
            };
            let Some(values) = obs.get(key) else {
                let there: Vec<&str> = obs.keys().map(String::as_str).collect();
                return refuse("an observation is missing", format!("not among {}", there.join(", ")));
            };
            if values.len() != *width {
                let what = "an observation of another size";
                return refuse(what, format!("{} numbers, {width} expected", values.len()));
            }
            if let Some(k) = values.iter().position(|v| !v.is_finite()) {
                return refuse("an observation is not finite", format!("[{k}] = {}", values[k]));
            }
            x.extend(values);
        }
        Ok(normalized(&x, self.config.normalization.as_ref()))
    }
}

impl PolicyConfig {
    /// What a damaged or hand-written `policy.json` may get wrong.
    fn check(&self) -> Result<(), String> {
        let n = self.inputs();
        let large = |v: usize| v > 100_000;
        if self.format != FORMAT {
            return Err(format!("format = {:?}, this version reads {FORMAT:?}", self.format));
        }
        if n == 0 || large(n) || self.horizon == 0 {
            return Err(format!("{n} observed numbers, horizon {}: both must be 1 or more", self.horizon));
        }
        self.net.check()?;
        if let Some(Normalization { mean, std }) = &self.normalization {
            let usable = mean.iter().all(|m| m.is_finite()) && std.iter().all(|s| s.is_finite() && *s > 0.0);
            if mean.len() != n || std.len() != n || !usable {
                let sizes = format!("{} means, {} stds, {n} observed numbers", mean.len(), std.len());
                return Err(format!("normalization that does not fit or is not finite: {sizes}"));
            }
        }
        Ok(())
    }
}

/// In f64, then rounded once: training and rollouts see the same bits.
pub(crate) fn normalized(x: &[f64], by: Option<&Normalization>) -> Vec<f32> {
    match by {
        None => x.iter().map(|v| *v as f32).collect(),
        Some(Normalization { mean, std }) => {
            x.iter().zip(mean.iter().zip(std)).map(|(v, (m, s))| ((v - m) / s) as f32).collect()
        }
    }
}

/// The network's tensors under its names, each group with a prefix of its own; and one more tensor
/// with one note, since several notes would come out in a different order every time.
pub(crate) fn tensors_to_bytes(
    net: &Network,
    groups: &[(&str, &[f32])],
    extra: Option<(&str, &[f64], String)>,
) -> Vec<u8> {
    let mut data: Vec<(String, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
    for (prefix, values) in groups {
        for t in &net.tensors {
            let bytes = values[t.range.clone()].iter().flat_map(|v| v.to_le_bytes()).collect();
            data.push((format!("{prefix}{}", t.name), Dtype::F32, t.shape.clone(), bytes));
        }
    }
    let mut metadata = None;
    if let Some((name, values, note)) = extra {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        data.push((name.to_string(), Dtype::F64, vec![values.len()], bytes));
        metadata = Some([("note".to_string(), note)].into());
    }
    let views = data.iter().map(|(name, dtype, shape, bytes)| {
        (name.as_str(), TensorView::new(*dtype, shape.clone(), bytes).expect("bytes of this shape"))
    });
    safetensors::serialize(views, metadata).expect("distinct names")
}

pub(crate) fn not_safetensors(path: &Path, e: impl std::fmt::Display) -> PolicyError {
    PolicyError::new(
        format!("not a whole safetensors file: {e}"),
        path.display().to_string(),
        "train again, or restore the file",
    )
}

/// All of the network's tensors out of a file; others in it are ignored (robomimic's checkpoints
/// hold some twice).
pub(crate) fn parameters_from(
    net: &Network,
    file: &SafeTensors,
    prefix: &str,
    path: &Path,
) -> Result<Vec<f32>, PolicyError> {
    let mut out = Vec::new();
    for tensor in &net.tensors {
        let name = format!("{prefix}{}", tensor.name);
        let refuse = |what: &str, value: String| {
            let hint = "policy.json must describe the network that these weights belong to; or train again";
            PolicyError::new(what, format!("{}, {name}: {value}", path.display()), hint)
        };
        let view = file.tensor(&name).map_err(|_| refuse("a weight is missing", "not there".to_string()))?;
        if view.shape() != tensor.shape || view.dtype() != Dtype::F32 {
            let found = format!("{:?} {:?}, expected F32 {:?}", view.dtype(), view.shape(), tensor.shape);
            return Err(refuse("a weight of another shape or type", found));
        }
        let values = view.data().chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes")));
        for (i, value) in values.enumerate() {
            if !value.is_finite() {
                return Err(refuse("a weight is not finite", format!("[{i}] = {value}")));
            }
            out.push(value);
        }
    }
    Ok(out)
}
