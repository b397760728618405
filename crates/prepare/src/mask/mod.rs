//! The object without masks: what changes between states, and what that hangs on, cut off from
//! floor, table and wall.
//!
//! All states share a frame by now. Surface that another state looked through has moved; large flat
//! surfaces behind or below everything that moved are the room's. What is left falls into pieces that do
//! not touch, and the pieces with moved surface are the object.

mod changed;
mod pieces;
mod pixels;
mod planes;
mod whole;

pub(crate) use pixels::{around, without_blobs};

use crate::error::PrepareError;
use crate::scan::chosen;
use glam::{DMat3, DVec3, Vec3};
use hingecast_articulate::observe::cloud::{Cloud, gather};
use hingecast_articulate::observe::lattice::Lattice;
use hingecast_articulate::observe::witness::Witness;
use hingecast_articulate::{DepthView, Depths};
use hingecast_geom::Progress;
use pieces::Pieces;
use planes::Plane;
use serde::{Deserialize, Serialize};

/// Cells along the longest side of what is looked at.
const CELLS: usize = 144;
/// Half the edge of the box that is looked at, shares of the cameras' distance.
const REACH: f64 = 0.75;
/// Pixels of a view that are looked at, about.
const PIXELS: usize = 20_000;
/// Pixels across a view when it is asked what it looked through.
const ACROSS: usize = 320;
/// With less of what moved on it the object is not believed, or doubted.
const HARDLY: f64 = 0.3;
const MOSTLY: f64 = 0.6;
/// Fewer samples that moved, over all states, are none.
const FEW_MOVED: usize = 12;

/// The object's pixels, and how they were found.
#[derive(Clone, Debug)]
pub struct Masks {
    /// 1 = object. `[state][view]`, (h, w)
    pub masks: Vec<Vec<Vec<u8>>>,
    /// What was found on the way.
    pub report: MaskReport,
}

/// What a person says about where the object is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Wanted {
    /// Nothing: it is what moves, and what that hangs on.
    #[default]
    Moving,
    /// All that is in this box (lowest and highest corner, world frame, scene units) and not floor or wall.
    InBox([f32; 3], [f32; 3]),
    /// The thing at this place, world frame.
    At([f32; 3]),
}

/// What the room and the object were taken for.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MaskReport {
    /// Planes that were cut away: unit normal towards the cameras, distance from the origin along
    /// it, scene units.
    pub supports: Vec<([f32; 3], f32)>,
    /// Box of the object over all states, world frame, scene units.
    pub object: ([f32; 3], [f32; 3]),
    /// Share of the pixels with depth that are the object's, of each state.
    pub shares: Vec<f64>,
    /// What a person should look at.
    pub doubts: Vec<String>,
}

/// What is looked at, all states in one frame.
pub(crate) struct Room {
    pub lattice: Lattice,
    /// Oriented samples of each state inside the lattice.
    pub clouds: Vec<Cloud>,
    /// Which of them another state looked through. `[state][sample]`
    pub moved: Vec<Vec<bool>>,
}

/// Finds the object in recordings without masks, by what a person says about it. `film`: state 0 is a
/// scan, and the others are pictures of a film in which hands move the object; the object is what
/// leaves where the scan saw it, and hands are in the film's masks. Pixels of class `OBJECT` are those
/// with depth; cameras of all states are in one frame, in which `up` is up.
///
/// # Errors
/// Nothing that moves where only that tells, nothing at the place that is named, cameras that look at nothing
/// in common, a view that cannot be read, the wish to stop.
pub fn object_masks(
    depths: &mut dyn Depths,
    wanted: &Wanted,
    film: bool,
    up: DVec3,
    seed: u64,
    progress: &Progress,
) -> Result<Masks, PrepareError> {
    let n = depths.n_states();
    let lattice = looked_at(depths)?;
    let (mut clouds, mut witnesses) = (Vec::new(), Vec::new());
    for state in 0..n {
        progress.report(state, 2 * n, "what is there")?;
        let views = depths.views(state)?;
        let stride = views.first().map_or(1, |v| v.stride_for(PIXELS));
        clouds.push(inside(gather(&views, lattice.voxel, stride, 1), &lattice));
        witnesses.push(Witness::some(&views, ACROSS));
    }
    let moved = changed::moved(&clouds, &witnesses, &lattice);
    let mut room = Room { lattice, clouds, moved };
    let count: usize = room.moved.iter().flatten().filter(|m| **m).count();
    if count < FEW_MOVED && *wanted == Wanted::Moving {
        return Err(PrepareError::NothingMoved { samples: count });
    }
    let mut supports = planes::supports(&room, wanted, up.as_vec3(), seed);
    planes::widen(&mut supports, &depths.views(0)?, lattice.voxel);
    let mut pieces = Pieces::new(lattice);
    if film {
        // Hands and arms would connect what does not touch.
        room.clouds.truncate(1);
        room.moved.truncate(1);
    }
    for state in 0..room.clouds.len() {
        progress.report(n + state, 2 * n, "what moves")?;
        pieces.add(&depths.views(state)?, &supports);
    }
    let mut doubts = Vec::new();
    if supports.is_empty() {
        doubts.push("neither floor nor wall was found: they are in the masks, if there are any".into());
    }
    let object = match wanted {
        Wanted::InBox(lo, hi) => {
            let (lo, hi) = ((*lo).into(), (*hi).into());
            whole::boxed(&pieces, lo, hi, &mut doubts);
            pieces.inside(lo, hi).ok_or(PrepareError::NothingThere)?
        }
        Wanted::At(x) => pieces.at((*x).into()).ok_or(PrepareError::NothingThere)?,
        Wanted::Moving => {
            let (object, share) = pieces.object(&room, &mut doubts);
            if share < HARDLY {
                return Err(PrepareError::NoObject { percent: 100.0 * share });
            }
            if share < MOSTLY {
                doubts.push(format!("only {:.0} % of what moved is on the object that was found", 100.0 * share));
            }
            object
        }
    };
    // A person's box may well hold several.
    if !matches!(wanted, Wanted::InBox(..)) {
        whole::falls_apart(&pieces, &object, &mut doubts);
    }
    let mut masks = Vec::new();
    let mut shares = Vec::new();
    for state in 0..n {
        progress.report(state, n, "masks")?;
        let views = depths.views(state)?;
        let own = if film && state > 0 {
            pixels::of_film(&views, &object, &supports, &witnesses[0])
        } else {
            pixels::masks(&views, &object, &supports)
        };
        shares.push(pixels::share(&views, &own));
        masks.push(own);
    }
    pixels::doubts(&masks, &mut doubts);
    let (lo, hi) = object.bounds();
    let report = MaskReport {
        supports: supports.iter().map(|p: &Plane| (p.normal.to_array(), p.offset)).collect(),
        object: (lo.to_array(), hi.to_array()),
        shares,
        doubts,
    };
    Ok(Masks { masks, report })
}

/// A box around what the cameras look at together, no larger than what they see.
fn looked_at(depths: &mut dyn Depths) -> Result<Lattice, PrepareError> {
    let (lo, hi) = depths.extent()?;
    let (mut a, mut b, mut n) = (DMat3::ZERO, DVec3::ZERO, 0);
    let mut centres = Vec::new();
    for state in 0..depths.n_states() {
        for view in depths.views(state)? {
            let (c, d) = (view.camera.centre(), view.camera.camera_from_world.inverse().rotate(DVec3::Z));
            // Sum of (1 - d d') x = sum of (1 - d d') c.
            let p = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
            (a, b, n) = (a + p, b + p * c, n + 1);
            centres.push(c);
        }
    }
    if n < 3 || a.determinant().abs() < 1e-4 * f64::from(n).powi(3) {
        return Ok(Lattice::new(lo, hi, CELLS));
    }
    let focus = a.inverse() * b;
    let mut far: Vec<f64> = centres.iter().map(|c| c.distance(focus)).collect();
    far.sort_by(f64::total_cmp);
    let reach = Vec3::splat((REACH * far[far.len() / 2]) as f32);
    let (lo, hi) = (lo.max(focus.as_vec3() - reach), hi.min(focus.as_vec3() + reach));
    if (hi - lo).min_element() <= 0.0 {
        return Err(PrepareError::NoFocus);
    }
    Ok(Lattice::new(lo, hi, CELLS))
}

fn inside(cloud: Cloud, lattice: &Lattice) -> Cloud {
    let keep: Vec<usize> = (0..cloud.points.len()).filter(|&i| lattice.index(cloud.points[i]).is_some()).collect();
    chosen(&cloud, &keep)
}

/// World position of pixel `i`; `None` where it is not the object's or has no depth.
pub(crate) fn place(view: &DepthView, rot: &glam::Mat3, trans: Vec3, i: usize) -> Option<Vec3> {
    (view.class[i] == hingecast_articulate::OBJECT).then(|| unprojected(view, rot, trans, i))
}

/// World position of what pixel `i` measured; meaningless where it measured nothing.
pub(crate) fn unprojected(view: &DepthView, rot: &glam::Mat3, trans: Vec3, i: usize) -> Vec3 {
    let (c, w) = (&view.camera, view.camera.width);
    let (u, v) = ((i % w) as f32 + 0.5, (i / w) as f32 + 0.5);
    let ray = Vec3::new((u - c.cx as f32) / c.fx as f32, (v - c.cy as f32) / c.fy as f32, 1.0);
    *rot * (ray * view.depth[i]) + trans
}
