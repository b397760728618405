//! Hands in a film: what no part explains.
//!
//! The scan saw the thing with nobody in the picture. A place that a picture of the film shows belongs to
//! a part if, carried to where that part stood during the scan, the scan saw surface there, or could not
//! see. A hand moves along with a door, but where it would have been while the door was closed, the scan
//! looked through.

use crate::error::PrepareError;
use crate::mask::{around, unprojected, without_blobs};
use crate::scan::extent;
use glam::Vec3;
use hingecast_articulate::observe::sample::Motion;
use hingecast_articulate::observe::witness::{Witness, counted};
use hingecast_articulate::{DepthView, Depths, Labelled, OBJECT, OTHER};
use hingecast_geom::{KinematicTree, Pose, Progress};
use rayon::prelude::*;

/// Pixels across a view of the scan when it is asked.
const ACROSS: usize = 320;
/// Views of the scan that look through a place, at least, where nothing stood.
const THROUGH: usize = 2;
/// A part has at least this share of the samples that the scan has, and in the scan at least this share
/// of what it has in a state of the film; what has fewer is a hand itself.
const SEEN: f64 = 0.002;
const AS_MANY: f64 = 0.25;
/// Space around the object in which parts may have been hidden from the scan, shares of its longest side.
const AROUND_OBJECT: f32 = 0.02;
/// Pixels around one that decide with it, and the share of them that must say so.
const AROUND: isize = 2;
const AGREE: f64 = 0.5;
/// Hands are widened by so many pixels: edges mix colours, and fingers lie close to what they hold.
const WIDER: isize = 3;
/// Blobs of fewer pixels are no hand.
const SPECK: usize = 25;

/// The hands of a film.
#[derive(Clone, Debug)]
pub struct Hands {
    /// 1 = hand, of every view; of the scan, none. `[state][view]`, (h, w)
    pub masks: Vec<Vec<Vec<u8>>>,
    /// Share of the object's pixels in the film that are hands.
    pub share: f64,
    /// Parts that the scan has hardly any surface of: taken for hands.
    pub phantoms: usize,
}

/// What is believed of a film's parts before its hands are known.
#[derive(Clone, Copy, Debug)]
pub struct Belief<'a> {
    /// Parts and joints, with values of every state.
    pub tree: &'a KinematicTree,
    /// camera_from_world as corrected. `[state][view]`
    pub cameras: &'a [Vec<Pose>],
    /// Labelled surface.
    pub samples: &'a [Labelled],
}

/// Pixels with depth in states 1.. that no part of `found` explains; state 0 is the scan.
///
/// # Errors
/// A view that cannot be read, the wish to stop.
pub fn hands(depths: &mut dyn Depths, found: &Belief, progress: &Progress) -> Result<Hands, PrepareError> {
    let n = depths.n_states();
    let placed = |mut views: Vec<DepthView>, state: usize| {
        let cameras = found.cameras.get(state).into_iter().flatten();
        views.iter_mut().zip(cameras).for_each(|(v, c)| v.camera.camera_from_world = *c);
        views
    };
    let scan = placed(depths.views(0)?, 0);
    let witnesses = Witness::some(&scan, ACROSS);
    let inside = extent(&scan, AROUND_OBJECT).unwrap_or((Vec3::INFINITY, Vec3::NEG_INFINITY));
    let mut masks = vec![scan.iter().map(|v| vec![0; v.class.len()]).collect::<Vec<_>>()];
    let parts = believed(found);
    let (mut own, mut all) = (0u32, 0u32);
    for state in 1..n {
        progress.report(state, n, "hands")?;
        // Where each part stood during the scan, from where it stands now.
        let (before, now) = (found.tree.poses_at(0), found.tree.poses_at(state));
        let back: Vec<Pose> = parts.iter().map(|&p| before[p] * now[p].inverse()).collect();
        let views = placed(depths.views(state)?, state);
        let hidden: Vec<Vec<u8>> = views.par_iter().map(|view| of_view(view, &back, &witnesses, inside)).collect();
        for (view, hand) in views.iter().zip(&hidden) {
            all += view.class.iter().filter(|c| **c == OBJECT).count() as u32;
            own += view.class.iter().zip(hand).filter(|(c, h)| **c == OBJECT && **h == 1).count() as u32;
        }
        masks.push(hidden);
    }
    let phantoms = found.tree.parts.len() - parts.len();
    Ok(Hands { masks, share: f64::from(own) / f64::from(all.max(1)), phantoms })
}

/// The base and the parts that the scan has surface of.
fn believed(found: &Belief) -> Vec<usize> {
    let scan = || found.samples.iter().filter(|s| s.state == 0);
    let least = SEEN * scan().count() as f64;
    let states = found.cameras.len().max(2) as f64 - 1.0;
    let seen = |p: &usize| {
        let own = found.samples.iter().filter(|s| usize::from(s.part) == *p);
        let (scan, all) = own.fold((0.0, 0.0), |(scan, all), s| (scan + f64::from(u8::from(s.state == 0)), all + 1.0));
        scan >= least && scan >= AS_MANY * (all - scan) / states
    };
    (0..found.tree.parts.len()).filter(|p| found.tree.joint_of(*p).is_none() || seen(p)).collect()
}

/// 1 where a pixel shows a hand. `back`: a pose a part; `inside`: the box of the object in the scan.
fn of_view(view: &DepthView, back: &[Pose], witnesses: &[Witness], inside: (Vec3, Vec3)) -> Vec<u8> {
    let (w, h) = (view.camera.width, view.camera.height);
    let world_from_camera = view.camera.camera_from_world.inverse();
    let (rot, trans) = (world_from_camera.mat3().as_mat3(), world_from_camera.trans.as_vec3());
    let back: Vec<Motion> = back.iter().map(|p| Motion::from(*p)).collect();
    // 1: a hand; 0: explained; 2: nothing is asked.
    let says: Vec<u8> = (0..w * h)
        .map(|i| {
            // Beyond the mask as well: an arm reaches farther than the object does.
            if ![OBJECT, OTHER].contains(&view.class[i]) {
                return 2;
            }
            let x = unprojected(view, &rot, trans, i);
            let explains = |back: &Motion| {
                let x = back.apply(x);
                let (through, on) = counted(witnesses, x, 0.0);
                // Out of the object's box nothing of it can have hidden.
                let hidden = through < THROUGH && x.cmpge(inside.0).all() && x.cmple(inside.1).all();
                hidden || (on > 0 && on >= through)
            };
            // Of the room much was never seen.
            let room = view.class[i] == OTHER && counted(witnesses, x, 0.0).0 < THROUGH;
            u8::from(!room && !back.iter().any(explains))
        })
        .collect();
    let agrees = |i: usize| {
        let asked = around(i, AROUND, w, h).map(|j| says[j]).filter(|s| *s < 2);
        let (yes, all) = asked.fold((0u32, 0u32), |(yes, all), s| (yes + u32::from(s == 1), all + 1));
        f64::from(yes) >= AGREE * f64::from(all)
    };
    let mut agreed: Vec<u8> = (0..w * h).map(|i| u8::from(says[i] == 1 && agrees(i))).collect();
    without_blobs(&mut agreed, w, 1, SPECK);
    let mut out = vec![0u8; w * h];
    for i in (0..w * h).filter(|&i| agreed[i] == 1) {
        around(i, WIDER, w, h).for_each(|j| out[j] = 1);
    }
    out
}
