//! What belongs to which part.

use crate::observe::evidence::Evidence;
use crate::observe::sample::Sample;

/// A sample and the part that it belongs to.
#[derive(Clone, Copy, Debug)]
pub struct Member {
    /// Where, and in which state.
    pub sample: Sample,
    /// Index of its part.
    pub part: usize,
    /// States that it is compared with, one bit each.
    pub shown: u64,
}

/// What belongs to which part.
#[derive(Clone, Debug)]
pub struct Owners {
    /// Part of every sample of the evidence.
    pub labels: Vec<u8>,
    /// Per part, the states that show it, one bit each.
    pub shown: Vec<u64>,
}

impl Owners {
    /// Samples of a part, from states that show it.
    pub fn members(&self, evidence: &Evidence, part: usize) -> Vec<Member> {
        self.all(evidence).filter(|m| m.part == part).collect()
    }

    /// Samples of all moving parts, from states that show these.
    pub fn moving(&self, evidence: &Evidence) -> Vec<Member> {
        self.all(evidence).filter(|m| m.part != 0).collect()
    }

    /// Samples of all parts, from states that show these.
    pub fn all<'a>(&'a self, evidence: &'a Evidence) -> impl Iterator<Item = Member> + 'a {
        let member = |(s, l): (&Sample, &u8)| Member { sample: *s, part: *l as usize, shown: self.shown[*l as usize] };
        let members = evidence.samples.iter().zip(&self.labels).map(member);
        members.filter(|m| m.shown >> m.sample.state & 1 == 1)
    }
}

/// At most `most` of some samples, shuffled.
pub fn subset(own: impl Iterator<Item = Sample>, most: usize, seed: u64) -> Vec<Sample> {
    let mut out: Vec<Sample> = own.collect();
    fastrand::Rng::with_seed(seed).shuffle(&mut out);
    out.truncate(most);
    out
}

/// Samples that ask for the value of a joint.
pub const ASKING: usize = 500;
