//! The engine: a set of gaussians with its optimiser state, rendered and differentiated on the CPU.

mod gradients;

use crate::adam::{self, Adam, Rates};
use crate::error::{SplatError, check_finite, check_len};
use crate::frame::FrameBuffers;
use crate::kernels::{Kernels, Simd, kernels};
use crate::loss::{LossConfig, LossTerms};
use crate::median::Hit;
use crate::params::{PAD, Planes, plane};
use crate::pool::Pool;
use crate::project::{CHUNK, PlaneTable};
use crate::raster::{MAX_EXTRA, PLANES};
use crate::target::Target;
use crate::view::{View, twist_gradient};
use hingecast_geom::{Camera, Gaussians, Pose};

/// What to draw besides colour, depth and alpha.
#[derive(Clone, Copy, Debug, Default)]
pub struct RenderOptions<'a> {
    /// Colour behind the gaussians, rgb, 0..1.
    pub background: [f32; 3],
    /// Values blended like colours (labels, one-hot parts, normals): (gaussians, channels),
    /// gaussian-major.
    pub extra: &'a [f32],
    /// 0..=32
    pub channels: usize,
}

/// A rendered picture, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Render {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// (h, w, 3) over the background.
    pub rgb: Vec<f32>,
    /// (h, w) premultiplied: sum of w_i z_i. See [`Render::depth_normalised`].
    pub depth: Vec<f32>,
    /// (h, w) sum of w_i, 0..1.
    pub alpha: Vec<f32>,
    /// (channels, h, w) premultiplied: sum of w_i e_i; divide by alpha for the mean value.
    pub extra: Vec<f32>,
}

impl Render {
    /// z in scene units where alpha is above one half, 0 (unknown) elsewhere. (h, w)
    pub fn depth_normalised(&self) -> Vec<f32> {
        self.depth.iter().zip(&self.alpha).map(|(d, a)| if *a > 0.5 { d / a } else { 0.0 }).collect()
    }
}

/// Gradient of a scalar by the pixels of the last render; an empty vector counts as zero.
#[derive(Clone, Debug, Default)]
pub struct PixelGradients {
    /// (h, w, 3)
    pub rgb: Vec<f32>,
    /// (h, w) by the premultiplied depth.
    pub depth: Vec<f32>,
    /// (h, w)
    pub alpha: Vec<f32>,
    /// (channels, h, w) by the premultiplied extra channels.
    pub extra: Vec<f32>,
}

/// Gradients of a scalar by everything that the engine can move.
#[derive(Clone, Debug, Default)]
pub struct Gradients {
    /// By the (canonical) parameters, in parameter layout. Add regularisers here before
    /// [`Engine::adam_step`].
    pub params: Planes,
    /// By each group's pose: world_from_group <- exp(xi) * world_from_group, xi = (vx vy vz wx wy
    /// wz), translation first, world frame, rotation about the world origin. Length 1 (moving
    /// everything) without groups.
    pub poses: Vec<[f64; 6]>,
    /// The same twist applied to the whole world: camera_from_world <- camera_from_world * exp(xi).
    /// Sum of `poses`.
    pub camera: [f64; 6],
    /// By the extra values of the last render. (gaussians, channels)
    pub extra: Vec<f32>,
}

/// Gaussians, Adam state, buffers and threads. One image at a time.
pub struct Engine {
    params: Planes,
    first: Planes,
    second: Planes,
    steps: u64,
    /// Group per gaussian, padded; empty without groups.
    groups: Vec<u16>,
    poses: Vec<Pose>,
    pool: Pool,
    kernels: &'static Kernels,
    simd: Simd,
    buffers: FrameBuffers,
    /// Camera of the picture in `buffers`, while the parameters are those it was rendered with.
    rendered: Option<Camera>,
}

impl Engine {
    /// `threads` counts the caller; 0 counts as 1. The results do not depend on it.
    ///
    /// # Errors
    /// Empty sets, arrays of different lengths, NaN or inf.
    pub fn from_gaussians(gaussians: &Gaussians, threads: usize) -> Result<Self, SplatError> {
        Self::with_simd(gaussians, threads, Simd::best())
    }

    /// As [`Engine::from_gaussians`] with a chosen instruction set; one that the CPU lacks falls
    /// back to plain code.
    ///
    /// # Errors
    /// As [`Engine::from_gaussians`].
    pub fn with_simd(gaussians: &Gaussians, threads: usize, simd: Simd) -> Result<Self, SplatError> {
        let params = Planes::from_gaussians(gaussians)?;
        let moments = Planes::zeros(params.len(), params.count());
        Ok(Self {
            first: moments.clone(),
            second: moments,
            params,
            steps: 0,
            groups: Vec::new(),
            poses: Vec::new(),
            pool: Pool::new(threads),
            kernels: kernels(simd),
            simd,
            buffers: FrameBuffers::default(),
            rendered: None,
        })
    }

    /// Number of gaussians.
    pub fn len(&self) -> usize {
        self.params.len()
    }

    /// Never true: an empty set is refused.
    pub fn is_empty(&self) -> bool {
        self.params.is_empty()
    }

    /// The instruction set asked for; it counts as plain where the CPU lacks it.
    pub fn simd(&self) -> Simd {
        self.simd
    }

    /// The (canonical) gaussians in interchange layout.
    pub fn gaussians(&self) -> Gaussians {
        self.params.to_gaussians()
    }

    /// Parameters as planes.
    pub fn params(&self) -> &Planes {
        &self.params
    }

    /// Parameters to change in place. Keep them finite.
    pub fn params_mut(&mut self) -> &mut Planes {
        self.rendered = None;
        &mut self.params
    }

    /// Adam's first and second moments and the number of steps taken.
    pub fn moments(&self) -> (&Planes, &Planes, u64) {
        (&self.first, &self.second, self.steps)
    }

    /// Parameters and moments to change in place (relocation, checkpoints).
    pub(crate) fn state_mut(&mut self) -> (&mut Planes, &mut Planes, &mut Planes, &mut u64) {
        self.rendered = None;
        (&mut self.params, &mut self.first, &mut self.second, &mut self.steps)
    }

    /// Forgets Adam's state.
    pub fn reset_moments(&mut self) {
        self.first = Planes::zeros(self.params.len(), self.params.count());
        self.second = self.first.clone();
        self.steps = 0;
    }

    /// From now on gaussian i is drawn at `world_from_group[groups[i]]` times its canonical pose.
    /// View-dependent colour turns with the group. Empty slices: one group at rest. Sorting
    /// gaussians by group is faster.
    ///
    /// # Errors
    /// Not one group per gaussian, a group without pose, a pose that is not finite.
    pub fn set_groups(&mut self, groups: &[u16], world_from_group: &[Pose]) -> Result<(), SplatError> {
        if groups.is_empty() && world_from_group.is_empty() {
            self.groups.clear();
            self.poses.clear();
            self.rendered = None;
            return Ok(());
        }
        check_len("groups", groups.len(), self.len(), "one per gaussian")?;
        if let Some(g) = groups.iter().find(|g| usize::from(**g) >= world_from_group.len()) {
            return Err(SplatError::Range { what: "groups", value: f64::from(*g), range: "0..number of poses" });
        }
        let mut padded = groups.to_vec();
        padded.resize(self.len().next_multiple_of(PAD), *groups.last().unwrap_or(&0));
        self.groups = padded;
        self.poses.clear();
        self.set_poses_unchecked_len(world_from_group)
    }

    /// New poses for the groups of [`Engine::set_groups`].
    ///
    /// # Errors
    /// Not as many as before, or not finite.
    pub fn set_poses(&mut self, world_from_group: &[Pose]) -> Result<(), SplatError> {
        check_len("world_from_group", world_from_group.len(), self.poses.len(), "one per group")?;
        self.set_poses_unchecked_len(world_from_group)
    }

    fn set_poses_unchecked_len(&mut self, world_from_group: &[Pose]) -> Result<(), SplatError> {
        for pose in world_from_group {
            if !(pose.rot.is_finite() && pose.trans.is_finite()) {
                return Err(SplatError::Range { what: "world_from_group", value: f64::NAN, range: "the finite poses" });
            }
        }
        self.rendered = None;
        self.poses = world_from_group.to_vec();
        Ok(())
    }

    /// `world_from_group` of every group; empty without groups.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Group per gaussian; empty without groups.
    pub fn groups(&self) -> &[u16] {
        &self.groups[..self.groups.len().min(self.len())]
    }

    /// Draws the gaussians as `camera` sees them.
    ///
    /// # Errors
    /// An impossible camera, extra values of the wrong length or not finite, too many channels.
    pub fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<Render, SplatError> {
        self.forward(camera, options)?;
        let b = &self.buffers;
        let (w, h) = (camera.width, camera.height);
        let (stride, plane_len) = (b.view.stride(), b.view.plane_len());
        let plane = |k: usize| (0..h).flat_map(move |y| &b.image[k * plane_len + y * stride..][..w]).copied();
        let mut rgb = vec![0f32; 3 * w * h];
        for c in 0..3 {
            for (to, v) in rgb[c..].iter_mut().step_by(3).zip(plane(c)) {
                *to = v;
            }
        }
        Ok(Render {
            width: w,
            height: h,
            rgb,
            depth: plane(3).collect(),
            alpha: plane(4).map(|t| 1.0 - t).collect(),
            extra: (0..options.channels).flat_map(|c| plane(PLANES + c)).collect(),
        })
    }

    /// The gaussian that each pixel of the last render shows: where half of the light is gone. (h,
    /// w)
    ///
    /// # Errors
    /// Nothing was rendered since the parameters changed.
    pub fn median(&mut self) -> Result<Vec<Option<Hit>>, SplatError> {
        if self.rendered.is_none() {
            return Err(SplatError::NotRendered);
        }
        Ok(self.buffers.median(&mut self.pool))
    }

    /// Renders into the buffers.
    fn forward(&mut self, camera: &Camera, options: &RenderOptions) -> Result<(), SplatError> {
        self.rendered = None;
        let view = View::new(camera, &self.poses)?;
        check_finite("background", &options.background)?;
        if options.channels > MAX_EXTRA {
            return Err(SplatError::Range { what: "channels", value: options.channels as f64, range: "0..=32" });
        }
        check_len("extra", options.extra.len(), self.len() * options.channels, "gaussians x channels")?;
        check_finite("extra", options.extra)?;
        self.buffers.background = options.background;
        self.buffers.channels = options.channels;
        self.buffers.extra.clear();
        self.buffers.extra.extend_from_slice(options.extra);
        self.buffers.extra.resize(self.params.padded(0).len() * options.channels, 0.0);
        self.buffers.forward(&mut self.pool, self.kernels, &self.params, &self.groups, view)?;
        self.rendered = Some(*camera);
        Ok(())
    }

    /// Opacity in (0, 1) of every gaussian.
    pub fn opacities(&self) -> Vec<f32> {
        self.params.plane(plane::OPACITY).iter().map(|x| 1.0 / (1.0 + (-x).exp())).collect()
    }
}
