//! The generic kernels compiled once per instruction set, and the choice between them at run time.

use crate::{adam, bins, loss, project, project_backward, raster, simd};
use serde::{Deserialize, Serialize};

/// Instruction sets that the kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Simd {
    /// Whatever the compiler's baseline is: SSE2, NEON.
    Plain,
    /// AVX2 and FMA: 8 lanes.
    Avx2,
    /// AVX-512 F, VL, DQ, BW: 16 lanes.
    Avx512,
}

impl Simd {
    /// Best first; `Plain` is always there.
    pub fn available() -> Vec<Self> {
        let mut out = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            let avx512 = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("bmi2");
            if avx2 && avx512 {
                out.push(Self::Avx512);
            }
            if avx2 {
                out.push(Self::Avx2);
            }
        }
        out.push(Self::Plain);
        out
    }

    /// The fastest one of this CPU.
    pub fn best() -> Self {
        Self::available()[0]
    }
}

/// Entry points. Each takes its arguments and the number of the work item.
pub(crate) struct Kernels {
    pub project: unsafe fn(&project::Args, usize),
    pub bin: unsafe fn(&bins::Args, usize),
    pub forward: unsafe fn(&raster::ForwardArgs, usize),
    pub forward_extra: unsafe fn(&raster::ForwardArgs, usize),
    pub ssim: unsafe fn(&loss::SsimArgs, usize),
    pub loss: unsafe fn(&loss::Args, usize),
    pub backward: unsafe fn(&raster::BackwardArgs, usize),
    pub backward_extra: unsafe fn(&raster::BackwardArgs, usize),
    pub project_backward: unsafe fn(&project_backward::Args, usize),
    pub adam: unsafe fn(&adam::Args, usize),
}

macro_rules! compile {
    ($module:ident, $lanes:ty $(, $feature:literal)?) => {
        mod $module {
            use super::*;
            type T = $lanes;

            macro_rules! entry {
                ($name:ident, $kernel:path, $args:ty) => {
                    $(#[target_feature(enable = $feature)])?
                    unsafe fn $name(args: &$args, item: usize) {
                        unsafe { $kernel(args, item) }
                    }
                };
            }
            entry!(project, project::project::<T>, project::Args);
            entry!(bin, bins::bin::<T>, bins::Args);
            entry!(forward, raster::forward::<T, false>, raster::ForwardArgs);
            entry!(forward_extra, raster::forward::<T, true>, raster::ForwardArgs);
            entry!(ssim, loss::ssim_band::<T>, loss::SsimArgs);
            entry!(loss_band, loss::loss_band::<T>, loss::Args);
            entry!(backward, raster::backward::<T, false>, raster::BackwardArgs);
            entry!(backward_extra, raster::backward::<T, true>, raster::BackwardArgs);
            entry!(project_backward, project_backward::backward::<T>, project_backward::Args);
            entry!(adam, adam::adam::<T>, adam::Args);

            pub(super) static KERNELS: Kernels = Kernels {
                project,
                bin,
                forward,
                forward_extra,
                ssim,
                loss: loss_band,
                backward,
                backward_extra,
                project_backward,
                adam,
            };
        }
    };
}

compile!(plain, simd::Plain);
#[cfg(target_arch = "x86_64")]
compile!(avx2, simd::Avx2, "avx2,fma");
#[cfg(target_arch = "x86_64")]
compile!(avx512, simd::Avx512, "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi2");

/// The kernels for `simd`, or the plain ones when this CPU lacks it: never an illegal instruction.
pub(crate) fn kernels(simd: Simd) -> &'static Kernels {
    if !Simd::available().contains(&simd) {
        return &plain::KERNELS;
    }
    match simd {
        Simd::Plain => &plain::KERNELS,
        #[cfg(target_arch = "x86_64")]
        Simd::Avx2 => &avx2::KERNELS,
        #[cfg(target_arch = "x86_64")]
        Simd::Avx512 => &avx512::KERNELS,
        #[cfg(not(target_arch = "x86_64"))]
        _ => &plain::KERNELS,
    }
}
