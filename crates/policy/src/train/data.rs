//! Windows of demonstrations: one from every step, its end repeated where the demonstration is
//! over.
//!
//! As robomimic's `SequenceDataset` with pad_seq_length: the padded steps count like any other.

use super::TrainConfig;
use crate::policy::{Normalization, ObsKey, normalized};
use crate::{ACTION_SIZE, Demos, Episode, PolicyError};

/// robomimic adds this to every deviation, so that constant numbers do not divide by zero.
const LEAST_STD: f64 = 1e-3;

/// Demonstrations as training wants them: prepared rows, and windows into them.
pub struct Dataset {
    /// What is observed, in alphabetical order: the columns of the rows.
    pub obs: Vec<ObsKey>,
    /// What was done to the rows; `None`: nothing.
    pub normalization: Option<Normalization>,
    inputs: usize,
    /// (steps of all demonstrations, inputs), normalised.
    observations: Vec<f32>,
    /// (steps of all demonstrations, 7)
    actions: Vec<f32>,
    /// Windows to learn from, one from every step.
    pub train: Vec<Window>,
    /// Windows to validate with; may be empty.
    pub valid: Vec<Window>,
    /// Demonstrations to learn from.
    pub train_demos: usize,
    /// Demonstrations to validate with.
    pub valid_demos: usize,
}

/// First row, and the row after the demonstration's last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    first: usize,
    end: usize,
}

impl Dataset {
    /// Joins the wanted observations into rows, normalises them, and splits the demonstrations.
    ///
    /// # Errors
    /// An observation that the demonstrations lack, actions outside [-1, 1], masks without
    /// demonstrations.
    pub fn new(demos: &Demos, config: &TrainConfig) -> Result<Self, PolicyError> {
        let Some(first) = demos.episodes.first() else {
            let hint = "record some: hingecast demos";
            return Err(PolicyError::new("no demonstrations", "data: 0 groups demo_<i>", hint));
        };
        let obs = obs_keys(first, &config.obs)?;
        let inputs = obs.iter().map(|k| k.width).sum();
        for (i, episode) in demos.episodes.iter().enumerate() {
            check_actions(i, episode)?;
        }
        let (train, valid) = split(demos, config)?;

        // All rows, in f64 until the statistics are known.
        let mut rows = Vec::with_capacity(demos.steps() * inputs);
        let mut spans = Vec::with_capacity(demos.episodes.len());
        for episode in &demos.episodes {
            let start = rows.len() / inputs;
            for t in 0..episode.actions.len() {
                obs.iter().for_each(|k| rows.extend(&episode.obs[&k.key][t]));
            }
            spans.push(start..rows.len() / inputs);
        }
        let normalization = config.normalize_obs.then(|| {
            let seen = train.iter().flat_map(|i| rows[spans[*i].start * inputs..spans[*i].end * inputs].chunks(inputs));
            statistics(seen, inputs)
        });
        let observations = rows.chunks(inputs).flat_map(|row| normalized(row, normalization.as_ref())).collect();
        let actions = demos.episodes.iter().flat_map(|e| e.actions.iter().flatten().map(|a| *a as f32)).collect();
        let windows = |episodes: &[usize]| -> Vec<Window> {
            let spans = episodes.iter().map(|i| spans[*i].clone());
            spans.flat_map(|span| span.clone().map(move |first| Window { first, end: span.end })).collect()
        };
        Ok(Self {
            train_demos: train.len(),
            valid_demos: valid.len(),
            train: windows(&train),
            valid: windows(&valid),
            obs,
            normalization,
            inputs,
            observations,
            actions,
        })
    }

    /// Observations (windows, steps, inputs) and actions (windows, steps, 7) of some windows.
    pub fn gather(
        &self,
        windows: impl Iterator<Item = Window>,
        steps: usize,
        observations: &mut Vec<f32>,
        actions: &mut Vec<f32>,
    ) {
        observations.clear();
        actions.clear();
        for Window { first, end } in windows {
            for t in 0..steps {
                let row = (first + t).min(end - 1);
                observations.extend(&self.observations[row * self.inputs..(row + 1) * self.inputs]);
                actions.extend(&self.actions[row * ACTION_SIZE..(row + 1) * ACTION_SIZE]);
            }
        }
    }

    /// Changes whenever the numbers or the split do.
    pub fn fingerprint(&self) -> String {
        let mut hash = xxhash_rust::xxh3::Xxh3::new();
        for values in [&self.observations, &self.actions] {
            hash.update(&(values.len() as u64).to_le_bytes());
            values.iter().for_each(|v| hash.update(&v.to_le_bytes()));
        }
        for windows in [&self.train, &self.valid] {
            hash.update(&(windows.len() as u64).to_le_bytes());
            for w in windows {
                hash.update(&(w.first as u64).to_le_bytes());
                hash.update(&(w.end as u64).to_le_bytes());
            }
        }
        format!("{:032x}", hash.digest128())
    }
}

/// The wanted keys in alphabetical order, as robomimic has them.
fn obs_keys(episode: &Episode, wanted: &[String]) -> Result<Vec<ObsKey>, PolicyError> {
    let mut wanted = wanted.to_vec();
    wanted.sort();
    wanted.dedup();
    let found = wanted.into_iter().map(|key| match episode.obs.get(&key) {
        Some(rows) => Ok(ObsKey { width: rows[0].len(), key }),
        None => {
            let there: Vec<&str> = episode.obs.keys().map(String::as_str).collect();
            Err(PolicyError::new(
                format!("the demonstrations lack the observation {key}"),
                format!("data/demo_0/obs: {}", there.join(", ")),
                "set obs to what is there, for instance --set 'obs=[\"object\", \"robot0_eef_pos\"]'",
            ))
        }
    });
    found.collect()
}

/// The heads' tanh reaches nothing outside [-1, 1].
fn check_actions(i: usize, episode: &Episode) -> Result<(), PolicyError> {
    for (t, action) in episode.actions.iter().enumerate() {
        if let Some(k) = action.iter().position(|a| !(a.abs() <= 1.0 + 1e-6)) {
            return Err(PolicyError::new(
                "an action outside [-1, 1]",
                format!("data/demo_{i}/actions[{t}][{k}] = {}", action[k]),
                "record normalised actions; robomimic's environments take them within [-1, 1]",
            ));
        }
    }
    Ok(())
}

/// Episodes to learn from and to validate with: by the file's masks, or drawn with the seed.
fn split(demos: &Demos, config: &TrainConfig) -> Result<(Vec<usize>, Vec<usize>), PolicyError> {
    let masks = (demos.subset(&config.train_mask), demos.subset(&config.valid_mask));
    if let (Some(train), valid) = masks {
        if train.is_empty() {
            let hint = "write the masks again, or name another one: --set train_mask=NAME";
            return Err(PolicyError::new(
                "no demonstrations to learn from",
                format!("mask/{}: empty", config.train_mask),
                hint,
            ));
        }
        demos.masks_apart(&config.train_mask, &config.valid_mask)?;
        return Ok((train, valid.unwrap_or_default()));
    }
    let count = demos.episodes.len();
    let mut order: Vec<usize> = (0..count).collect();
    fastrand::Rng::with_seed(config.seed).shuffle(&mut order);
    // One is kept for learning whatever the share says.
    let valid = ((count as f64 * config.valid_share).round() as usize).min(count - 1);
    let mut train = order.split_off(valid);
    train.sort_unstable();
    order.sort_unstable();
    Ok((train, order))
}

/// Mean and deviation of every column.
fn statistics<'a>(rows: impl Iterator<Item = &'a [f64]> + Clone, width: usize) -> Normalization {
    let (mut mean, mut std, mut count) = (vec![0.0; width], vec![0.0; width], 0.0);
    for row in rows.clone() {
        count += 1.0;
        mean.iter_mut().zip(row).for_each(|(m, v)| *m += v);
    }
    mean.iter_mut().for_each(|m| *m /= count);
    for row in rows {
        std.iter_mut().zip(row.iter().zip(&mean)).for_each(|(s, (v, m))| *s += (v - m) * (v - m));
    }
    std.iter_mut().for_each(|s| *s = (*s / count).sqrt() + LEAST_STD);
    Normalization { mean, std }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Preset;

    /// Episode i has 3 + i steps; its one observation counts 100 i + t, its actions are t / 100.
    fn demos(count: usize) -> Demos {
        let episode = |i: usize| Episode {
            actions: (0..3 + i).map(|t| [t as f64 / 100.0; 7]).collect(),
            obs: [("b".to_string(), (0..3 + i).map(|t| vec![(100 * i + t) as f64, 5.0]).collect())].into(),
            ..Default::default()
        };
        Demos { episodes: (0..count).map(episode).collect(), ..Default::default() }
    }

    fn config() -> TrainConfig {
        TrainConfig { obs: vec!["b".into()], seq_length: 4, ..TrainConfig::preset(Preset::BcRnn) }
    }

    #[test]
    fn windows_start_everywhere_and_repeat_the_end() {
        let mut demos = demos(2);
        demos.masks.insert("train".into(), vec!["demo_1".into()]);
        let data = Dataset::new(&demos, &config()).unwrap();
        assert_eq!((data.train.len(), data.valid.len()), (4, 0));
        let (mut x, mut a) = (vec![], vec![]);
        data.gather([data.train[0], data.train[2]].into_iter(), 4, &mut x, &mut a);
        let first: Vec<f32> = x.iter().step_by(2).copied().collect();
        assert_eq!(first, [100.0, 101.0, 102.0, 103.0, 102.0, 103.0, 103.0, 103.0]);
        assert_eq!((a.len(), a[0], a[7 * 7]), (2 * 4 * 7, 0.0, 0.03));
    }

    #[test]
    fn statistics_are_those_of_the_training_share() {
        let mut demos = demos(3);
        demos.masks.insert("train".into(), vec!["demo_0".into()]);
        let data = Dataset::new(&demos, &TrainConfig { normalize_obs: true, ..config() }).unwrap();
        let n = data.normalization.as_ref().unwrap();
        assert_eq!(n.mean, [1.0, 5.0]);
        assert!((n.std[0] - ((2.0f64 / 3.0).sqrt() + 1e-3)).abs() < 1e-12 && n.std[1] == 1e-3, "{n:?}");
        assert_eq!(data.observations[..2], [(-1.0 / n.std[0]) as f32, 0.0]);
    }

    #[test]
    fn without_masks_a_seeded_tenth_validates() {
        let demos = demos(30);
        let data = Dataset::new(&demos, &config()).unwrap();
        assert_eq!((data.train_demos, data.valid_demos), (27, 3));
        assert_eq!(data.train.len() + data.valid.len(), demos.steps());
        let again = Dataset::new(&demos, &config()).unwrap();
        assert_eq!(data.fingerprint(), again.fingerprint());
        let other = Dataset::new(&demos, &TrainConfig { seed: 1, ..config() }).unwrap();
        assert_ne!(data.fingerprint(), other.fingerprint());
        let single = Dataset::new(&super::tests::demos(1), &config()).unwrap();
        assert_eq!((single.train_demos, single.valid_demos), (1, 0));
    }

    /// Masks of any name; robomimic refuses the same.
    #[test]
    fn what_validates_is_not_learnt_from() {
        let mut demos = demos(4);
        demos.masks.insert("mine".into(), vec!["demo_0".into(), "demo_2".into()]);
        demos.masks.insert("valid".into(), vec!["demo_2".into(), "demo_3".into()]);
        let e = Dataset::new(&demos, &TrainConfig { train_mask: "mine".into(), ..config() }).err().unwrap();
        assert_eq!(e.place, "mask/mine and mask/valid: demo_2");
        assert!(Dataset::new(&demos, &config()).is_ok(), "the mask mine is not used");
    }

    #[test]
    fn what_cannot_be_learnt_is_refused() {
        let mut odd = demos(2);
        odd.episodes[1].actions[2][6] = 1.5;
        let e = Dataset::new(&odd, &config()).err().unwrap();
        assert_eq!(e.place, "data/demo_1/actions[2][6] = 1.5");
        let e = Dataset::new(&demos(2), &TrainConfig { obs: vec!["object".into()], ..config() }).err().unwrap();
        assert!(e.what.ends_with("object") && e.place == "data/demo_0/obs: b", "{e}");
    }
}
