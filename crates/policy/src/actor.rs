//! A policy in one rollout: hidden state, the step at which it is forgotten, and the dice of the
//! mixture.

use crate::net::{State, sample};
use crate::policy::Policy;
use crate::{ACTION_SIZE, PolicyError};
use std::collections::BTreeMap;

/// Acts step by step. Same policy, seed and observations: same actions, bit by bit.
pub struct Actor<'a> {
    policy: &'a Policy,
    rng: fastrand::Rng,
    state: State,
    /// Steps since the state was last forgotten.
    age: usize,
}

impl<'a> Actor<'a> {
    /// `seed`: of this rollout's choices among the modes of the mixture, and of its
    /// [`crate::net::EVAL_STD`] of noise.
    pub fn new(policy: &'a Policy, seed: u64) -> Self {
        Self { policy, rng: fastrand::Rng::with_seed(seed), state: policy.net.initial_state(), age: 0 }
    }

    /// Forgets what was seen. The dice go on: for an episode that can be repeated alone take a new
    /// actor with its seed.
    pub fn reset(&mut self) {
        self.state = self.policy.net.initial_state();
        self.age = 0;
    }

    /// The next action, each number within [-1, 1] but for the noise of 1e-4. As robomimic does,
    /// the hidden state is forgotten every `horizon` steps: in training it never grew older.
    ///
    /// # Errors
    /// An observation that is missing, of another size, or not finite.
    pub fn act(&mut self, obs: &BTreeMap<String, Vec<f64>>) -> Result<[f64; ACTION_SIZE], PolicyError> {
        let input = self.policy.input(obs)?;
        if self.age == self.policy.config.horizon {
            self.reset();
        }
        self.age += 1;
        let outputs = self.policy.net.step(&self.policy.parameters, &input, &mut self.state);
        Ok(sample(&self.policy.config.net, &outputs, &mut self.rng))
    }
}
