//! Parts and joints from all states' depth at once (`--method screw`). `docs/method.md` has the equations.
//!
//! ```text
//! cloud, space   per state: oriented samples of the surface; a grid of surface, emptiness, and the unseen
//! cameras        poses corrected so that the views of a state agree
//! evidence       all states together: what do they say if this sample moved so?
//! hypotheses     screws from single correspondences        scan       one screw asked in all states
//! propose        the best of these, aligned, per parent     adopt      a proposal refined into a part
//! finals         the best proposals adopted, with their axes as found and along their faces
//! discover       parts one after another, by what they explain (jury) and how usual they are (plausible)
//! chains         what hangs on what
//! hidden         states that do not show a part
//! nearby         values a voxel or two beside the right one
//! settle         states' frames, all joints together (refine, twist)
//! askew          axes tried along faces and other axes, now that all parts are known (whole: how well a tree explains what moved)
//! alike          parts that moved nearly alike and were found as one (halves: the values of both; connected: who belongs to which)
//! straight       axes along their part's faces, where that explains as much
//! labels         which part a sample belongs to
//! borders        the same where parts meet, pixel by pixel
//! steady         noisy recordings: every view aligned to what stands still, then settled again
//! information    how sharply the depth holds the pose of every part
//! photometric    noisy recordings: joints and frames by pictures and depth together (pictures: gradients through the gaussians)
//! doubts         rivals, covariance, what was hardly seen
//! ```

mod adopt;
mod alike;
mod askew;
mod borders;
pub mod cameras;
mod chains;
pub mod cloud;
mod connected;
pub mod discover;
pub mod doubts;
pub mod evidence;
mod finals;
mod halves;
mod hidden;
mod hypotheses;
mod information;
mod jury;
pub mod labels;
pub mod nearby;
pub mod photometric;
mod pictures;
mod plausible;
mod propose;
pub mod refine;
mod scan;
pub mod settle;
pub mod space;
mod steady;
mod straight;
mod twist;
mod whole;

use cloud::DepthView;
use evidence::Evidence;
use glam::Vec3;
use hingecast_geom::{Cancelled, Certainty, KinematicTree, Pose, Progress};
pub use information::Information;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Cells of the grid along the object's longest side.
    pub cells: usize,
    /// No more moving parts than this.
    pub max_parts: usize,
    /// Correct camera poses by the depth, where it shows that they are off.
    pub align_cameras: bool,
    /// Decide labels where parts meet pixel by pixel, where depth is sharp. Twins come out better, joints stay the same.
    pub borders: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self { cells: 96, max_parts: 16, align_cameras: true, borders: true }
    }
}

/// A labelled piece of measured surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Labelled {
    pub state: usize,
    /// World frame.
    pub point: Vec3,
    pub part: u8,
}

/// Everything that the depth says about parts and joints.
pub struct Found {
    pub tree: KinematicTree,
    /// The surface of every state, one sample a voxel and facing, finer where parts meet.
    pub samples: Vec<Labelled>,
    /// Edge of a voxel, scene units.
    pub voxel: f32,
    /// Per state and view: camera_from_world as corrected.
    pub cameras: Vec<Vec<Pose>>,
    pub report: refine::Report,
    /// What the depth says about the pose of every part (see [`photometric`]); empty where depth is so sharp that pictures have nothing
    /// to add. [state][part]
    pub information: Vec<Vec<Information>>,
    /// Of each joint, in the tree's order.
    pub certainty: Vec<Certainty>,
    pub doubts: Vec<String>,
}

/// Corrects the cameras of every state by what its frame was off.
fn apply(rig: &[Pose], cameras: &mut [Vec<Pose>]) {
    for (views, rig) in cameras.iter_mut().zip(rig) {
        views.iter_mut().for_each(|c| *c = *c * rig.inverse());
    }
}

/// The views from where their cameras are.
fn corrected(mut views: Vec<DepthView>, cameras: &[Pose]) -> Vec<DepthView> {
    views.iter_mut().zip(cameras).for_each(|(view, pose)| view.camera.camera_from_world = *pose);
    views
}

/// Finds parts and joints. `extent`: box of the object over all states; `states(s)`: the views of state s.
///
/// At most [`evidence::MOST_STATES`] states.
///
/// # Errors
/// What `states` fails with, or the wish to stop.
pub fn run<E: From<Cancelled>>(
    n_states: usize,
    extent: (Vec3, Vec3),
    states: &mut dyn FnMut(usize) -> Result<Vec<DepthView>, E>,
    config: &Config,
    seed: u64,
    progress: &Progress,
) -> Result<Found, E> {
    let lattice = space::Lattice::new(extent.0, extent.1, config.cells);
    let mut cameras: Vec<Vec<Pose>> = Vec::new();
    let mut evidence = Evidence::gather::<E>(
        n_states,
        lattice,
        &mut |state| {
            progress.report(state, n_states, "surface and space")?;
            let mut views = states(state)?;
            if config.align_cameras {
                cameras::align(&mut views, lattice.voxel);
            }
            cameras.push(views.iter().map(|v| v.camera.camera_from_world).collect());
            Ok(views)
        },
        seed,
    )?;
    let discovery = discover::discover(&mut evidence, config.max_parts, seed, progress)?;
    progress.report(0, 1, "refining")?;
    let mut settled = settle::settle(&mut evidence, &discovery, seed);
    apply(&settled.rig, &mut cameras);
    let mut labels = labels::label_clouds(&evidence, &settled.tree, &settled.owners);
    let noisy = evidence.is_noisy();
    if config.align_cameras && noisy {
        let base = steady::base(&evidence, &labels);
        let before = evidence;
        evidence = Evidence::gather::<E>(
            n_states,
            lattice,
            &mut |state| {
                progress.report(state, n_states, "views of what stands still")?;
                let mut views = corrected(states(state)?, &cameras[state]);
                steady::align(&mut views, &before, state, &labels[state], &base);
                cameras[state] = views.iter().map(|v| v.camera.camera_from_world).collect();
                Ok(views)
            },
            seed,
        )?;
        drop(before);
        let found = settle::again(&evidence, settled.tree, discovery.cost);
        settled = settle::settle(&mut evidence, &found, seed);
        apply(&settled.rig, &mut cameras);
        labels = labels::label_clouds(&evidence, &settled.tree, &settled.owners);
    }
    let information = if noisy { information::of_parts(&evidence, &labels, &settled) } else { Vec::new() };
    let (doubts, certainty) = doubts::doubts(&evidence, &settled, &labels, seed);
    let samples = if noisy || !config.borders {
        let of_state = |(state, own): (usize, &Vec<u8>)| -> Vec<Labelled> {
            let points = &evidence.clouds[state].points;
            points.iter().zip(own).map(|(point, part)| Labelled { state, point: *point, part: *part }).collect()
        };
        labels.iter().enumerate().flat_map(of_state).collect()
    } else {
        borders::sharpen::<E>(&evidence, &settled.tree, &labels, &mut |state| {
            progress.report(state, n_states, "borders")?;
            Ok(corrected(states(state)?, &cameras[state]))
        })?
    };
    Ok(Found {
        samples,
        voxel: lattice.voxel,
        tree: settled.tree,
        cameras,
        report: settled.report,
        information,
        certainty,
        doubts,
    })
}
