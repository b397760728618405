//! Decoded views within a byte budget.
//!
//! Decoding three PNGs takes milliseconds, expanding a packed view a tenth of one. So views are
//! kept packed, 6 bytes a pixel, and the least recently used leave when the budget is full: 1500
//! views at 256 x 256 fit 590 MB.

use super::packed_depth::PackedDepth;
use super::{Recording, View, view};
use crate::CaptureError;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Shared by threads; `get` decodes outside the lock.
pub struct ViewCache {
    recording: Recording,
    budget_bytes: usize,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    views: HashMap<usize, (u64, Arc<Packed>)>,
    bytes: usize,
    clock: u64,
}

/// Lossless: depth files hold at most 16 bits except .npy, which stays f32.
struct Packed {
    camera: hingecast_geom::Camera,
    rgb: Vec<u8>,
    depth: PackedDepth,
    /// Bit 0 mask, bit 1 usable.
    flags: Vec<u8>,
}

impl ViewCache {
    /// `budget_bytes` bounds what is kept between calls; views that callers hold come on top.
    pub fn new(recording: &Recording, budget_bytes: usize) -> Self {
        Self { recording: recording.clone(), budget_bytes, kept: Mutex::default() }
    }

    /// The recording whose views these are.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The decoded view of a frame.
    ///
    /// # Errors
    /// As [`Recording::load`].
    pub fn get(&self, frame: usize) -> Result<Arc<View>, CaptureError> {
        if let Some(packed) = self.touch(frame) {
            return Ok(Arc::new(packed.unpack()));
        }
        let view = self.recording.load(frame)?;
        let scale = self.recording.frames[frame].depth_scale as f32;
        self.keep(frame, Arc::new(Packed::new(&view, scale)));
        Ok(Arc::new(view))
    }

    /// The decoded view of a frame, which is not kept any longer.
    ///
    /// # Errors
    /// As [`Recording::load`].
    pub fn take(&self, frame: usize) -> Result<View, CaptureError> {
        let gone = {
            let mut kept = self.lock();
            let gone = kept.views.remove(&frame);
            kept.bytes -= gone.as_ref().map_or(0, |(_, packed)| packed.bytes());
            gone
        };
        gone.map_or_else(|| self.recording.load(frame), |(_, packed)| Ok(packed.unpack()))
    }

    /// Decodes frames in parallel so that later `get`s are quick; stops adding when the budget is
    /// full.
    ///
    /// # Errors
    /// As [`Recording::load`], the first frame in the list that fails.
    pub fn prefetch(&self, frames: &[usize]) -> Result<(), CaptureError> {
        let failures: Vec<CaptureError> = frames
            .par_iter()
            .filter(|&&f| !self.full() && self.touch(f).is_none())
            .filter_map(|&f| self.get(f).err())
            .collect();
        failures.into_iter().next().map_or(Ok(()), Err)
    }

    /// Bytes kept at the moment.
    pub fn bytes(&self) -> usize {
        self.lock().bytes
    }

    fn full(&self) -> bool {
        self.lock().bytes >= self.budget_bytes
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Kept> {
        // A panic elsewhere leaves a consistent map: every change below is complete before the lock
        // opens.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn touch(&self, frame: usize) -> Option<Arc<Packed>> {
        let mut kept = self.lock();
        kept.clock += 1;
        let now = kept.clock;
        let (used, packed) = kept.views.get_mut(&frame)?;
        *used = now;
        Some(packed.clone())
    }

    fn keep(&self, frame: usize, packed: Arc<Packed>) {
        let size = packed.bytes();
        let mut kept = self.lock();
        if size > self.budget_bytes {
            return;
        }
        while kept.bytes + size > self.budget_bytes {
            let Some(oldest) = kept.views.iter().min_by_key(|(_, (used, _))| *used).map(|(&f, _)| f) else { break };
            if let Some((_, gone)) = kept.views.remove(&oldest) {
                kept.bytes -= gone.bytes();
            }
        }
        kept.clock += 1;
        let now = kept.clock;
        if let Some((_, before)) = kept.views.insert(frame, (now, packed)) {
            kept.bytes -= before.bytes();
        }
        kept.bytes += size;
    }
}

impl Packed {
    fn new(view: &View, scale: f32) -> Self {
        let flags = view.mask.iter().zip(&view.usable).map(|(m, u)| m | u << 1).collect();
        let depth = PackedDepth::new(&view.depth, scale);
        Self { camera: view.camera, rgb: view.rgb.clone(), depth, flags }
    }

    fn unpack(&self) -> View {
        view::View {
            camera: self.camera,
            rgb: self.rgb.clone(),
            depth: self.depth.unpack(),
            mask: self.flags.iter().map(|f| f & 1).collect(),
            usable: self.flags.iter().map(|f| f >> 1).collect(),
        }
    }

    fn bytes(&self) -> usize {
        self.rgb.len() + self.flags.len() + self.depth.bytes() + size_of::<Self>()
    }
}
