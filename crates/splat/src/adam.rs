//! Adam (Kingma & Ba 2015), sparse: a gaussian without any gradient in this step keeps its
//! parameters and moments.

use crate::params::plane;
use crate::project::{CHUNK, PlaneTable};
use crate::simd::Lanes;
use serde::{Deserialize, Serialize};

const BETA_1: f32 = 0.9;
const BETA_2: f32 = 0.999;
/// Squared epsilon: gradients of a mean over pixels are tiny, so epsilon must be far below them
/// (1e-15).
const EPS_SQUARED: f32 = 1e-30;

/// Learning rates: the largest change of a parameter per step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Rates {
    /// Scene units; 1e-4 to 1e-3 of the object's extent.
    pub means: f32,
    /// Natural-log units.
    pub scales: f32,
    /// Of the four numbers before they are normalised.
    pub quats: f32,
    /// Logit units.
    pub opacity: f32,
    /// Coefficients of degree 0; 1 unit is 0.28 of full brightness.
    pub sh0: f32,
    /// Coefficients of degree 1.
    pub sh1: f32,
}

impl Default for Rates {
    /// The rates of 3D Gaussian Splatting for an object of extent 1.
    fn default() -> Self {
        Self { means: 1.6e-4, scales: 5e-3, quats: 1e-3, opacity: 2.5e-2, sh0: 2.5e-3, sh1: 1.25e-4 }
    }
}

impl Rates {
    /// Everything still.
    pub const ZERO: Self = Self { means: 0.0, scales: 0.0, quats: 0.0, opacity: 0.0, sh0: 0.0, sh1: 0.0 };

    /// All rates times `factor`.
    pub fn scaled(self, factor: f32) -> Self {
        Self {
            means: self.means * factor,
            scales: self.scales * factor,
            quats: self.quats * factor,
            opacity: self.opacity * factor,
            sh0: self.sh0 * factor,
            sh1: self.sh1 * factor,
        }
    }

    fn per_plane(&self) -> [f32; plane::COUNT_DEGREE_1] {
        std::array::from_fn(|k| match k {
            0..plane::SCALES => self.means,
            plane::SCALES..plane::QUATS => self.scales,
            plane::QUATS..plane::OPACITY => self.quats,
            plane::OPACITY => self.opacity,
            plane::SH0..plane::SH1 => self.sh0,
            _ => self.sh1,
        })
    }
}

/// One Adam step on all planes.
pub(crate) struct Adam {
    params: PlaneTable,
    first: PlaneTable,
    second: PlaneTable,
    /// Rate divided by the bias correction of the first moment.
    rates: [f32; plane::COUNT_DEGREE_1],
    /// 1 / bias correction of the second moment.
    second_scale: f32,
}

impl Adam {
    /// `step` counts from 1.
    pub fn new(params: PlaneTable, first: PlaneTable, second: PlaneTable, rates: &Rates, step: u64) -> Self {
        let t = step.min(1_000_000) as i32;
        let correction = 1.0 - f64::from(BETA_1).powi(t);
        Self {
            params,
            first,
            second,
            rates: rates.per_plane().map(|r| (f64::from(r) / correction) as f32),
            second_scale: (1.0 / (1.0 - f64::from(BETA_2).powi(t))) as f32,
        }
    }
}

/// Updates gaussians `i .. i + N` by the gradients `d`.
///
/// # Safety
/// The CPU has the features of `T`; nobody else touches these gaussians.
#[inline(always)]
pub(crate) unsafe fn adam_vector<T: Lanes>(adam: &Adam, i: usize, count: usize, d: &[T; plane::COUNT_DEGREE_1]) {
    let zero = T::splat(0.0);
    let mut largest = zero;
    for value in d.iter().take(count) {
        largest = largest.max(*value).max(zero - *value);
    }
    let touched = largest.ge(T::splat(f32::MIN_POSITIVE));
    if T::bits(touched) == 0 {
        return;
    }
    for k in 0..count {
        unsafe {
            let m_old = adam.first.load::<T>(k, i);
            let v_old = adam.second.load::<T>(k, i);
            let m = m_old * T::splat(BETA_1) + d[k] * T::splat(1.0 - BETA_1);
            let v = v_old * T::splat(BETA_2) + d[k] * d[k] * T::splat(1.0 - BETA_2);
            adam.first.store(k, i, m.select(touched, m_old));
            adam.second.store(k, i, v.select(touched, v_old));
            let scale = v.fma(T::splat(adam.second_scale), T::splat(EPS_SQUARED)).rough_rsqrt();
            let change = (m * T::splat(adam.rates[k]) * scale).keep(touched);
            adam.params.store(k, i, adam.params.load::<T>(k, i) - change);
        }
    }
}

pub(crate) struct Args {
    pub adam: Adam,
    pub gradients: PlaneTable,
    pub len: usize,
    pub count: usize,
}

/// Adam on gradients in parameter layout.
///
/// # Safety
/// The CPU has the features of `T`; each chunk runs once.
#[inline(always)]
pub(crate) unsafe fn adam<T: Lanes>(args: &Args, chunk: usize) {
    let (lo, hi) = (chunk * CHUNK, ((chunk + 1) * CHUNK).min(args.len));
    let mut i = lo;
    while i < hi {
        let mut d = [T::splat(0.0); plane::COUNT_DEGREE_1];
        for k in 0..args.count {
            unsafe { d[k] = args.gradients.load::<T>(k, i) };
        }
        unsafe { adam_vector::<T>(&args.adam, i, args.count, &d) };
        i += T::N;
    }
}
