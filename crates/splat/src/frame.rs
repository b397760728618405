//! The passes of one image over reused buffers: project, sort, bin, draw; loss; back to pairs; back
//! to parameters.

use crate::bins::{self, Entry, Order};
use crate::error::SplatError;
use crate::kernels::Kernels;
use crate::loss::{self, BandSums, LossConfig, LossTerms};
use crate::median::{Hit, median};
use crate::params::Planes;
use crate::pool::{Pool, Shards};
use crate::project::{self, CHUNK, PlaneTable, Splat};
use crate::raster::{self, PLANES};
use crate::ssim::{self, BAND, Padded};
use crate::target::Target;
use crate::view::{FrameGradient, View};
use crate::{params::plane, project_backward};

/// Buffers of the image being worked on; they grow and stay.
#[derive(Default)]
pub(crate) struct FrameBuffers {
    pub view: View,
    pub background: [f32; 3],
    pub channels: usize,
    /// (len, channels)
    pub extra: Vec<f32>,
    splats: Vec<Splat>,
    rects: Vec<u32>,
    order: Order,
    tiles: Vec<Vec<Entry>>,
    used: Vec<u32>,
    /// r g b depth transmittance extra..., each `view.plane_len()` floats.
    pub image: Vec<f32>,
    /// Gradient by r g b depth alpha extra...
    pub gradient: Vec<f32>,
    rows: Vec<[f32; 16]>,
    extra_rows: Vec<f32>,
    written: Vec<u8>,
    ssim_x: [Vec<f32>; 3],
    ssim_derivatives: [[Vec<f32>; 3]; 3],
    frames: Vec<FrameGradient>,
}

pub(crate) fn grow<T: Clone + Default>(v: &mut Vec<T>, len: usize) {
    if v.len() < len {
        v.resize(len, T::default());
    }
}

fn chunks(params: &Planes) -> usize {
    params.padded(0).len().div_ceil(CHUNK)
}

impl FrameBuffers {
    /// Renders `view` into `image`. `extra` and `channels` were set by the caller.
    pub fn forward(
        &mut self,
        pool: &mut Pool,
        kernels: &Kernels,
        params: &Planes,
        groups: &[u16],
        view: View,
    ) -> Result<(), SplatError> {
        let len = params.padded(0).len();
        self.view = view;
        let view = &self.view;
        self.splats.resize(len, Splat::default());
        self.rects.resize(len, project::NO_RECT);
        let tiles = view.tiles_x * view.tiles_y;
        grow(&mut self.tiles, tiles);
        grow(&mut self.used, tiles);
        let image_len = (PLANES + self.channels) * view.plane_len();
        grow(&mut self.image, image_len);
        grow(&mut self.gradient, image_len);

        let args = project::Args {
            params: PlaneTable::read_only(params),
            len,
            sh1: params.count() == plane::COUNT_DEGREE_1,
            groups,
            view,
            splats: Shards::new(&mut self.splats),
            rects: Shards::new(&mut self.rects),
        };
        pool.run(chunks(params), |i| unsafe { (kernels.project)(&args, i) });

        self.order.build(&self.splats, &self.rects)?;

        let strips = pool.threads();
        let args = bins::Args {
            view,
            splats: &self.splats,
            rects: &self.rects,
            order: &self.order,
            tiles: Shards::new(&mut self.tiles),
            strips,
        };
        pool.run(strips, |i| unsafe { (kernels.bin)(&args, i) });

        let args = raster::ForwardArgs {
            view,
            splats: &self.splats,
            tiles: &self.tiles,
            background: self.background,
            extra: &self.extra,
            channels: self.channels,
            image: Shards::new(&mut self.image),
            used: Shards::new(&mut self.used),
        };
        let draw = if self.channels > 0 { kernels.forward_extra } else { kernels.forward };
        pool.run(tiles, |i| unsafe { draw(&args, i) });
        Ok(())
    }

    /// What every pixel of the last forward pass shows. (h, w)
    pub fn median(&self, pool: &mut Pool) -> Vec<Option<Hit>> {
        median(pool, &self.view, &self.splats, &self.tiles, &self.image)
    }

    /// Loss of `image` against `target`; fills the gradient's first five planes.
    pub fn loss(&mut self, pool: &mut Pool, kernels: &Kernels, target: &Target, config: &LossConfig) -> LossTerms {
        let view = &self.view;
        // Fits any crop of this picture, so that the planes keep their stride from view to view.
        let layout = Padded { width: view.stride(), height: view.height };
        let with_ssim = config.ssim > 0.0;
        let bands = if with_ssim { target.crop.height.div_ceil(BAND) } else { 0 };
        for plane in self.ssim_x.iter_mut().chain(self.ssim_derivatives.iter_mut().flatten()) {
            if with_ssim && plane.len() != layout.len() {
                // Another picture size: the margins lie elsewhere.
                plane.clear();
                plane.resize(layout.len(), 0.0);
            }
        }
        let mut ssim_sums = vec![0f64; 3 * bands];
        if with_ssim {
            let [x0, x1, x2] = &mut self.ssim_x;
            let x = [Shards::new(x0), Shards::new(x1), Shards::new(x2)];
            let derivatives = self.ssim_derivatives.each_mut().map(|c| c.each_mut().map(|p| Shards::new(p)));
            let image = &self.image;
            pool.run(3 * bands, |i| {
                let (channel, band) = (i / bands, i % bands);
                let [p1, p2, p3] = &derivatives[channel];
                loss::blend_band(view, target, image, &x[channel], [p1, p2, p3], layout, channel, band);
            });
            let args = loss::SsimArgs {
                target,
                x: self.ssim_x.each_ref().map(|x| x.as_slice()),
                layout,
                derivatives,
                sums: Shards::new(&mut ssim_sums),
                bands,
            };
            pool.run(3 * bands, |i| unsafe { (kernels.ssim)(&args, i) });
        }

        let image_bands = view.height.div_ceil(BAND);
        let mut sums: Vec<BandSums> = vec![[0.0; 4]; image_bands];
        let args = loss::Args {
            view,
            target,
            config,
            image: &self.image,
            scratch: self.ssim_x.each_ref().map(|x| ssim::Scratch { x, layout }),
            derivatives: self.ssim_derivatives.each_ref().map(|c| c.each_ref().map(|p| p.as_slice())),
            gradient: Shards::new(&mut self.gradient),
            sums: Shards::new(&mut sums),
        };
        pool.run(image_bands, |i| unsafe { (kernels.loss)(&args, i) });
        // Rows below the picture exist only to fill the last tiles.
        for k in 0..PLANES {
            let plane = &mut self.gradient[k * view.plane_len()..(k + 1) * view.plane_len()];
            plane[view.height * view.stride()..].fill(0.0);
        }
        loss::total(view, target, config, &sums, &ssim_sums)
    }

    /// The gradient image to one row of sums per (gaussian, tile) pair.
    pub fn backward(&mut self, pool: &mut Pool, kernels: &Kernels) {
        let slots = self.order.slots();
        grow(&mut self.rows, slots);
        grow(&mut self.extra_rows, slots * self.channels);
        self.written.clear();
        self.written.resize(slots, 0);
        let args = raster::BackwardArgs {
            view: &self.view,
            splats: &self.splats,
            tiles: &self.tiles,
            used: &self.used,
            extra: &self.extra,
            channels: self.channels,
            image: &self.image,
            gradient: &self.gradient,
            rows: Shards::new(&mut self.rows),
            extra_rows: Shards::new(&mut self.extra_rows),
            written: Shards::new(&mut self.written),
        };
        let kernel = if self.channels > 0 { kernels.backward_extra } else { kernels.backward };
        pool.run(self.view.tiles_x * self.view.tiles_y, |i| unsafe { kernel(&args, i) });
    }

    /// The pair rows to parameter gradients; returns the sums per group's frame.
    pub fn pairs_to_gradients(
        &mut self,
        pool: &mut Pool,
        kernels: &Kernels,
        params: &Planes,
        groups: &[u16],
        planes: &mut Planes,
        extra: &mut [f32],
    ) -> Vec<FrameGradient> {
        let (chunks, count) = (chunks(params), self.view.frames.len());
        self.frames.clear();
        self.frames.resize(chunks * count, [0.0; 15]);
        let args = project_backward::Args {
            params: PlaneTable::read_only(params),
            len: params.padded(0).len(),
            sh1: params.count() == plane::COUNT_DEGREE_1,
            groups,
            view: &self.view,
            rects: &self.rects,
            slot_base: &self.order.slot_base,
            rows: &self.rows,
            written: &self.written,
            output: project_backward::Output::Gradients {
                planes: PlaneTable::new(planes),
                frames: Shards::new(&mut self.frames),
                extra_rows: &self.extra_rows,
                extra: Shards::new(extra),
                channels: self.channels,
            },
        };
        pool.run(chunks, |i| unsafe { (kernels.project_backward)(&args, i) });
        let mut total = vec![[0.0; 15]; count];
        for (i, sums) in self.frames.iter().enumerate() {
            for k in 0..15 {
                total[i % count][k] += sums[k];
            }
        }
        total
    }

    /// The pair rows straight into Adam.
    pub fn pairs_to_adam(
        &mut self,
        pool: &mut Pool,
        kernels: &Kernels,
        params: &mut Planes,
        groups: &[u16],
        adam: crate::adam::Adam,
    ) {
        let chunks = chunks(params);
        let args = project_backward::Args {
            params: PlaneTable::new(params),
            len: params.padded(0).len(),
            sh1: params.count() == plane::COUNT_DEGREE_1,
            groups,
            view: &self.view,
            rects: &self.rects,
            slot_base: &self.order.slot_base,
            rows: &self.rows,
            written: &self.written,
            output: project_backward::Output::Update(adam),
        };
        pool.run(chunks, |i| unsafe { (kernels.project_backward)(&args, i) });
    }
}
