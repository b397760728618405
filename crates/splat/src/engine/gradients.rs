//! Losses, their gradients, and steps of the optimiser.

use super::*;

impl Engine {
    /// Loss of the current parameters, without gradients.
    ///
    /// # Errors
    /// Of the camera only; a [`Target`] has checked its own.
    pub fn loss(&mut self, target: &Target, config: &LossConfig) -> Result<LossTerms, SplatError> {
        self.forward(&target.camera, &RenderOptions { background: target.background, ..Default::default() })?;
        Ok(self.buffers.loss(&mut self.pool, self.kernels, target, config))
    }

    /// Loss, and its gradients by parameters, group poses and camera pose. `gradients` is
    /// overwritten.
    ///
    /// # Errors
    /// As [`Engine::loss`].
    pub fn loss_and_gradients(
        &mut self,
        target: &Target,
        config: &LossConfig,
        gradients: &mut Gradients,
    ) -> Result<LossTerms, SplatError> {
        let terms = self.loss(target, config)?;
        self.finish_gradients(&target.camera, gradients);
        Ok(terms)
    }

    /// As [`Engine::loss_and_gradients`], with extra channels and a loss on them:
    /// `extra_loss(rendered, gradient)` gets both as (channels, h, w) premultiplied planes, fills
    /// the gradient (zeros before) and returns its loss, which is added to `total`.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn loss_and_gradients_with_extra(
        &mut self,
        target: &Target,
        config: &LossConfig,
        extra: &[f32],
        channels: usize,
        extra_loss: impl FnOnce(&[f32], &mut [f32]) -> f64,
        gradients: &mut Gradients,
    ) -> Result<LossTerms, SplatError> {
        let render = self.render(&target.camera, &RenderOptions { background: target.background, extra, channels })?;
        let mut terms = self.buffers.loss(&mut self.pool, self.kernels, target, config);
        let mut by_extra = vec![0f32; render.extra.len()];
        terms.total += extra_loss(&render.extra, &mut by_extra);
        self.set_gradient_planes(PLANES, channels, &by_extra, 1);
        self.finish_gradients(&target.camera, gradients);
        Ok(terms)
    }

    /// Gradients of any scalar of the last render, given its gradient by the pixels. `gradients` is
    /// overwritten.
    ///
    /// # Errors
    /// Nothing was rendered since the parameters changed; wrong lengths.
    pub fn backward(&mut self, pixels: &PixelGradients, gradients: &mut Gradients) -> Result<(), SplatError> {
        let Some(camera) = self.rendered else { return Err(SplatError::NotRendered) };
        let count = camera.width * camera.height;
        let channels = self.buffers.channels;
        for (what, values, expected) in [
            ("gradient.rgb", &pixels.rgb, 3 * count),
            ("gradient.depth", &pixels.depth, count),
            ("gradient.alpha", &pixels.alpha, count),
            ("gradient.extra", &pixels.extra, channels * count),
        ] {
            if !values.is_empty() {
                check_len(what, values.len(), expected, "the size of the last render, or empty")?;
            }
        }
        self.set_gradient_planes(0, 3, &pixels.rgb, 3);
        self.set_gradient_planes(3, 1, &pixels.depth, 1);
        self.set_gradient_planes(4, 1, &pixels.alpha, 1);
        self.set_gradient_planes(PLANES, channels, &pixels.extra, 1);
        self.finish_gradients(&camera, gradients);
        Ok(())
    }

    /// Copies planes of the picture's size (`interleave` 1) or interleaved pixels into the padded
    /// gradient planes.
    fn set_gradient_planes(&mut self, first: usize, count: usize, values: &[f32], interleave: usize) {
        let view = &self.buffers.view;
        let (w, h, stride, len) = (view.width, view.height, view.stride(), view.plane_len());
        for k in 0..count {
            let plane = &mut self.buffers.gradient[(first + k) * len..(first + k + 1) * len];
            plane.fill(0.0);
            if values.is_empty() {
                continue;
            }
            for y in 0..h {
                for x in 0..w {
                    let i = y * w + x;
                    plane[y * stride + x] =
                        if interleave > 1 { values[i * interleave + k] } else { values[k * w * h + i] };
                }
            }
        }
    }

    fn finish_gradients(&mut self, camera: &Camera, gradients: &mut Gradients) {
        let (len, count) = (self.params.len(), self.params.count());
        if gradients.params.len() != len || gradients.params.count() != count {
            gradients.params = Planes::zeros(len, count);
        }
        let channels = self.buffers.channels;
        gradients.extra.resize(self.params.padded(0).len() * channels, 0.0);
        self.buffers.backward(&mut self.pool, self.kernels);
        let frames = self.buffers.pairs_to_gradients(
            &mut self.pool,
            self.kernels,
            &self.params,
            &self.groups,
            &mut gradients.params,
            &mut gradients.extra,
        );
        gradients.extra.truncate(len * channels);
        let at_rest = [Pose::IDENTITY];
        let poses = if self.poses.is_empty() { &at_rest[..] } else { &self.poses };
        gradients.poses.clear();
        gradients.poses.extend(frames.iter().zip(poses).map(|(sums, pose)| twist_gradient(sums, camera, pose)));
        gradients.camera = [0.0; 6];
        for twist in &gradients.poses {
            for k in 0..6 {
                gradients.camera[k] += twist[k];
            }
        }
    }

    /// One Adam step on gradients that other code may have added to. Gaussians whose gradients are
    /// all zero keep still.
    ///
    /// # Errors
    /// Gradients of another set, or not finite.
    pub fn adam_step(&mut self, gradients: &Gradients, rates: &Rates) -> Result<(), SplatError> {
        check_len("gradients.params", gradients.params.len(), self.len(), "one per gaussian")?;
        check_len("gradients.params planes", gradients.params.count(), self.params.count(), "one per parameter")?;
        for k in 0..gradients.params.count() {
            check_finite("gradients.params", gradients.params.plane(k))?;
        }
        self.rendered = None;
        let args = adam::Args {
            adam: self.next_adam(rates),
            gradients: PlaneTable::read_only(&gradients.params),
            len: self.params.padded(0).len(),
            count: self.params.count(),
        };
        let kernel = self.kernels.adam;
        self.pool.run(args.len.div_ceil(CHUNK), |i| unsafe { kernel(&args, i) });
        Ok(())
    }

    /// Loss, gradients and Adam in one go, without storing gradients: the same result as
    /// [`Engine::loss_and_gradients`] then [`Engine::adam_step`], faster.
    ///
    /// # Errors
    /// As [`Engine::loss`].
    pub fn step(&mut self, target: &Target, config: &LossConfig, rates: &Rates) -> Result<LossTerms, SplatError> {
        let terms = self.loss(target, config)?;
        self.buffers.backward(&mut self.pool, self.kernels);
        self.rendered = None;
        let adam = self.next_adam(rates);
        self.buffers.pairs_to_adam(&mut self.pool, self.kernels, &mut self.params, &self.groups, adam);
        Ok(terms)
    }

    fn next_adam(&mut self, rates: &Rates) -> Adam {
        self.steps += 1;
        Adam::new(
            PlaneTable::new(&mut self.params),
            PlaneTable::new(&mut self.first),
            PlaneTable::new(&mut self.second),
            rates,
            self.steps,
        )
    }
}
