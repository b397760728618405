//! The labelled views that the twin is fused from, decoded once.
//!
//! A view is packed as soon as its pixels have parts (the label takes the place of mask and
//! occlusion) and shown from memory from then on, as far as the budget reaches; what does not fit
//! is decoded again whenever it is shown.

use super::inputs::Inputs;
use crate::failure::Result;
use hingecast_capture::{PackedDepth, View};
use hingecast_geom::Camera;
use hingecast_twin::Observation;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One view with the part of every pixel.
struct Packed {
    camera: Camera,
    depth: PackedDepth,
    labels: Vec<u8>,
    rgb: Vec<u8>,
}

/// All of them, in the order of their frames.
pub struct Observations<'a> {
    inputs: &'a Inputs<'a>,
    frames: Vec<usize>,
    /// Bytes that may be kept.
    budget: usize,
    kept: Vec<Kept>,
    loads: AtomicUsize,
}

enum Kept {
    Whole(Packed),
    /// The budget was full: the rest is decoded again.
    Labels(Vec<u8>),
}

impl<'a> Observations<'a> {
    /// None yet; at most `budget` bytes are kept.
    pub fn new(inputs: &'a Inputs<'a>, frames: &[usize], budget: usize) -> Self {
        Self { inputs, frames: frames.to_vec(), budget, kept: Vec::new(), loads: AtomicUsize::new(0) }
    }

    /// Labels all views by `label(view, state)`, several at a time.
    ///
    /// # Errors
    /// When a picture cannot be read.
    pub fn label(&mut self, label: &(dyn Fn(&View, usize) -> Vec<u8> + Sync)) -> Result<()> {
        /// Views held decoded at once.
        const BATCH: usize = 64;
        for batch in self.frames.clone().chunks(BATCH) {
            let one = |&f: &usize| -> Result<(View, Vec<u8>)> {
                let view = self.load(f)?;
                let labels = label(&view, self.inputs.recording.frames[f].state);
                Ok((view, labels))
            };
            let views: Vec<(View, Vec<u8>)> = batch.par_iter().map(one).collect::<Result<_>>()?;
            views.into_iter().for_each(|(view, labels)| self.push(&view, labels));
        }
        Ok(())
    }

    /// The next view, decoded.
    ///
    /// # Errors
    /// When a picture cannot be read.
    pub fn load(&self, frame: usize) -> Result<View> {
        self.loads.fetch_add(1, Ordering::Relaxed);
        self.inputs.take_view(frame)
    }

    /// Keeps the next view with its labels.
    pub fn push(&mut self, view: &View, labels: Vec<u8>) {
        let scale = self.inputs.recording.frames[self.frames[self.kept.len()]].depth_scale as f32;
        let packed = pack(view, labels, scale);
        let size = packed.depth.bytes() + packed.labels.len() + packed.rgb.len();
        let fits = size <= self.budget;
        self.budget -= if fits { size } else { 0 };
        self.kept.push(if fits { Kept::Whole(packed) } else { Kept::Labels(packed.labels) });
    }

    /// Takes all labels out, to be changed and put back by [`set_labels`](Self::set_labels). `[view]`
    pub fn take_labels(&mut self) -> Vec<Vec<u8>> {
        self.kept.iter_mut().map(|k| std::mem::take(k.labels())).collect()
    }

    /// Puts labels back. `[view]`
    pub fn set_labels(&mut self, labels: Vec<Vec<u8>>) {
        self.kept.iter_mut().zip(labels).for_each(|(k, new)| *k.labels() = new);
    }

    /// Number of views.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// How often views were decoded so far.
    pub fn loads(&self) -> usize {
        self.loads.load(Ordering::Relaxed)
    }

    /// One view as the twin's stages want it.
    ///
    /// # Errors
    /// When its picture has to be read again and cannot be.
    pub fn get(&self, k: usize) -> Result<Observation> {
        let state = self.inputs.recording.frames[self.frames[k]].state;
        Ok(match &self.kept[k] {
            Kept::Whole(p) => Observation {
                state,
                camera: p.camera,
                depth: p.depth.unpack(),
                labels: p.labels.clone(),
                rgb: p.rgb.clone(),
            },
            Kept::Labels(labels) => {
                let view = self.load(self.frames[k])?;
                let depth = depth_of_object(&view);
                Observation { state, camera: view.camera, depth, labels: labels.clone(), rgb: view.rgb }
            }
        })
    }
}

impl Kept {
    fn labels(&mut self) -> &mut Vec<u8> {
        match self {
            Self::Whole(packed) => &mut packed.labels,
            Self::Labels(labels) => labels,
        }
    }
}

/// Depth of a hand is not depth of the object.
fn depth_of_object(view: &View) -> Vec<f32> {
    view.depth.iter().zip(&view.usable).map(|(d, u)| if *u == 1 { *d } else { 0.0 }).collect()
}

fn pack(view: &View, labels: Vec<u8>, scale: f32) -> Packed {
    Packed {
        camera: view.camera,
        depth: PackedDepth::new(&depth_of_object(view), scale),
        labels,
        rgb: view.rgb.clone(),
    }
}
