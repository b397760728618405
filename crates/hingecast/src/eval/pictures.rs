//! Held-out pictures: the twin's gaussians rendered where no training camera stood.

use crate::artifacts::{Joints, Splats};
use crate::failure::Result;
use crate::stage::RunFolder;
use crate::stages::labeller::Labeller;
use crate::stages::targets;
use hingecast_capture::{Recording, Split, Truth, ViewCache};
use hingecast_geom::{KinematicTree, Progress};
use hingecast_splat::metrics;
use hingecast_twin::BACKGROUND;
use serde::{Deserialize, Serialize};

/// Means over pictures.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PictureErrors {
    /// How many were compared.
    pub pictures: usize,
    /// dB over the whole picture.
    pub psnr: f64,
    /// 11 x 11 window, sigma 1.5; 1 = the same.
    pub ssim: f64,
    /// Scene units, over pixels valid in both.
    pub depth_mae: f64,
    /// Of the object's silhouette.
    pub mask_iou: f64,
    /// Mean over true parts that are in sight.
    pub label_miou: f64,
}

impl PictureErrors {
    fn add(&mut self, o: &PictureErrors) {
        self.pictures += 1;
        self.psnr += o.psnr;
        self.ssim += o.ssim;
        self.depth_mae += o.depth_mae;
        self.mask_iou += o.mask_iou;
        self.label_miou += o.label_miou;
    }

    fn mean(mut self) -> Self {
        let n = self.pictures.max(1) as f64;
        for x in [&mut self.psnr, &mut self.ssim, &mut self.depth_mae, &mut self.mask_iou, &mut self.label_miou] {
            *x /= n;
        }
        self
    }
}

/// Errors on the held-out cameras of the first state, and of the other recorded states.
pub fn errors(
    run: &RunFolder,
    tree: &KinematicTree,
    recording: &Recording,
    truth: &Truth,
    matching: &[Option<usize>],
    progress: &Progress,
) -> Result<(PictureErrors, PictureErrors)> {
    let gaussians = Splats::read(&run.root)?.gaussians;
    let found = Joints::read(&run.root)?;
    found.fit(&run.root, recording.n_states, gaussians.len())?;
    let cache = ViewCache::new(recording, 64 << 20);
    let background = targets::background(recording, &cache)?;
    let mut labeller = Labeller::new(&gaussians, &found.labels, run.record.threads)?;
    let (mut first, mut others) = (PictureErrors::default(), PictureErrors::default());
    for state in 0..recording.n_states {
        progress.check()?;
        labeller.pose(tree, &tree.values_at(state))?;
        for f in recording.frames_of(state, Split::Test) {
            let view = recording.load(f)?;
            let picture = labeller.render(&view.camera, background.0)?;
            let (w, h) = (view.camera.width, view.camera.height);
            let photo = targets::photo(&view, background);
            let true_mask: Vec<f32> = view.mask.iter().map(|m| *m as f32).collect();
            let labels = truth.labels(&recording.frames[f].color)?;
            let one = PictureErrors {
                pictures: 1,
                psnr: metrics::psnr(&picture.rgb, &photo),
                ssim: metrics::ssim(&picture.rgb, &photo, w, h),
                depth_mae: metrics::depth_mae(&picture.depth, &view.depth).unwrap_or(f64::NAN),
                mask_iou: metrics::mask_iou(&picture.alpha, &true_mask),
                label_miou: label_miou(&picture.parts, &labels, matching),
            };
            if state == 0 { first.add(&one) } else { others.add(&one) }
        }
    }
    Ok((first.mean(), others.mean()))
}

/// `found`: part ids; `truth`: true part id + 1, 0 = background.
fn label_miou(found: &[u8], truth: &[u8], matching: &[Option<usize>]) -> f64 {
    let (mut sum, mut n) = (0.0, 0);
    for (t, f) in matching.iter().enumerate() {
        let is_true = |i: usize| truth[i] as usize == t + 1;
        let is_found = |i: usize| f.is_some_and(|f| found[i] != BACKGROUND && found[i] as usize == f);
        let (mut both, mut either) = (0usize, 0usize);
        let mut in_sight = false;
        for i in 0..truth.len() {
            in_sight |= is_true(i);
            both += (is_true(i) && is_found(i)) as usize;
            either += (is_true(i) || is_found(i)) as usize;
        }
        if in_sight {
            sum += both as f64 / either.max(1) as f64;
            n += 1;
        }
    }
    sum / n.max(1) as f64
}
