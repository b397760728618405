//! Parts and joints from all states' depth at once. `docs/method.md` has the equations.

use crate::config::Config;
use crate::depths::{Depths, check_views};
use crate::doubt::Doubt;
use crate::error::ArticulateError;
use crate::label::boundaries::sharpen;
use crate::label::by_evidence::label_clouds;
use crate::label::labelled::Labelled;
use crate::model::estimate::{Discovery, Estimate, FitReport};
use crate::observe::depth_view::DepthView;
use crate::observe::evidence::{Evidence, MOST_STATES};
use crate::observe::lattice::Lattice;
use crate::observe::witness::Witness;
use crate::observe::{align_to_base, cameras, mask_votes};
use crate::passes::driver::{PassRecord, settle};
use crate::passes::known;
use crate::pictures::information::{Information, of_parts};
use crate::resample;
use crate::search::discover::discover;
use crate::shown::{Shown, shown};
use crate::value_by_views;
use crate::weigh_doubts::{Believed, weigh_doubts};
use hingecast_geom::{Certainty, KinematicTree, Pose, Progress};

/// Everything that the depth says about parts and joints.
pub struct Articulation {
    /// Parts and joints, with a value of every joint in every state. State 0 is the canonical
    /// configuration.
    pub tree: KinematicTree,
    /// The surface of every state, one sample a voxel and facing, finer where parts meet.
    pub samples: Vec<Labelled>,
    /// Edge of a voxel, scene units.
    pub voxel: f32,
    /// Per state and view: camera_from_world as corrected.
    pub cameras: Vec<Vec<Pose>>,
    /// What the last fit knew.
    pub report: FitReport,
    /// What the depth says about the pose of every part (see [`crate::pictures`]); empty where
    /// depth is so sharp that pictures have nothing to add. `[state][part]`
    pub information: Vec<Vec<Information>>,
    /// Of each joint, in the tree's order.
    pub certainty: Vec<Certainty>,
    /// How views judge the motion of each joint, in the tree's order.
    pub shown: Vec<Shown>,
    /// Gravest first.
    pub doubts: Vec<Doubt>,
    /// What every pass did, in order.
    pub trace: Vec<PassRecord>,
}

/// Finds parts and joints.
///
/// # Errors
/// No state or more than [`MOST_STATES`], an extent or a view that is empty or not finite, a pass
/// to skip that does not exist; what `depths` fails with; the wish to stop.
///
/// # Examples
/// ```
/// use glam::{DVec2, DVec3};
/// use hingecast_articulate::{Config, DepthView, find};
/// use hingecast_geom::{Camera, Progress};
///
/// // Depth of a box, [-1, 1] x [-0.6, 0.6] x [0, 0.5], that slides along x over a table at z = 0; in every state 12 views.
/// let z_at = |eye: DVec3, ray: DVec3, x: f64| {
///     let (lo, hi) = (DVec3::new(x - 1.0, -0.6, 0.0), DVec3::new(x + 1.0, 0.6, 0.5));
///     let (a, b) = ((lo - eye) / ray, (hi - eye) / ray);
///     let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
///     let table = -eye.z / ray.z;
///     let on_table = eye + ray * table;
///     let hits_table = table > 0.0 && on_table.x.abs() < 2.0 && on_table.y.abs() < 1.0;
///     if enter < leave { Some(enter) } else { hits_table.then_some(table) }
/// };
/// let view = |k: usize, x: f64| {
///     let turn = k as f64 * 0.52;
///     let eye = DVec3::new(4.0 * turn.cos(), 4.0 * turn.sin(), 3.0);
///     let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 80, 60, 0.9);
///     let depth = |i: usize| {
///         let ray = camera.ray(DVec2::new((i % 80) as f64 + 0.5, (i / 80) as f64 + 0.5));
///         z_at(eye, ray, x).map_or(0.0, |t| camera.project(eye + ray * t).1 as f32)
///     };
///     DepthView::new(camera, (0..80 * 60).map(depth).collect())
/// };
/// let mut states: Vec<Vec<_>> = [-0.8, -0.5, 0.1, 0.6, 0.8].map(|x| (0..12).map(|k| view(k, x)).collect()).to_vec();
///
/// let found = find(&mut states, &Config { cells: 48, ..Config::default() }, &Progress::default())?;
/// let slide = &found.tree.joints[0];
/// assert!(!slide.screw.kind.turns() && slide.screw.axis.x.abs() > 0.999);
/// assert!((slide.values[4].abs() - 1.6).abs() < 0.02, "{:?}", slide.values);
/// # Ok::<(), hingecast_articulate::ArticulateError>(())
/// ```
pub fn find(depths: &mut dyn Depths, config: &Config, progress: &Progress) -> Result<Articulation, ArticulateError> {
    let (n_states, seed) = (depths.n_states(), config.seed);
    let mut lattice = checked_lattice(depths, config)?;
    let not = match (config.film, config.held) {
        (true, _) => NOT_OF_A_FILM,
        (_, true) => NOT_WHERE_HELD,
        _ => &[],
    };
    let skip: Vec<String> = config.skip.iter().cloned().chain(not.iter().map(|s| s.to_string())).collect();
    let tether = |usual: f64| if config.held { HELD } else { usual };
    let mut cameras: Vec<Vec<Pose>> = Vec::new();
    let mut evidence = Evidence::gather::<ArticulateError>(
        n_states,
        lattice,
        &mut |state| {
            progress.report(state, n_states, "surface and space")?;
            let mut views = depths.views(state).map_err(ArticulateError::of_depths)?;
            check_views(&views, state)?;
            if config.align_cameras {
                cameras::align(&mut views, lattice.voxel, cameras::POINTS, tether(cameras::TETHER));
            }
            cameras.push(views.iter().map(|v| v.camera.camera_from_world).collect());
            Ok(views)
        },
        seed,
    )?;
    if let Some(finer) = evidence.finer_lattice(config.cells) {
        lattice = finer;
        let again = &mut |state| {
            progress.report(state, n_states, "surface and space, finer")?;
            corrected(depths, state, &cameras[state])
        };
        evidence = Evidence::gather::<ArticulateError>(n_states, lattice, again, seed)?;
    }
    let of_film = |evidence: Evidence| if config.film { evidence.of_film(seed) } else { evidence };
    evidence = of_film(evidence);
    let discovery = discover(&evidence, config.max_parts, seed, progress)?;
    let cost = discovery.cost;
    let (mut estimate, mut trace);
    (evidence, estimate, trace) = settle(evidence, discovery, seed, &skip, progress)?;
    correct(&estimate.world_from_state, &mut cameras);
    let mut labels = label_clouds(&evidence, &estimate.tree, &estimate.owners);
    let noisy = evidence.is_noisy();
    if config.align_cameras && noisy {
        let base = align_to_base::base(&evidence, &labels);
        let before = evidence;
        evidence = Evidence::gather::<ArticulateError>(
            n_states,
            lattice,
            &mut |state| {
                progress.report(state, n_states, "views of what stands still")?;
                let mut views = corrected(depths, state, &cameras[state])?;
                let tether = tether(align_to_base::TETHER);
                align_to_base::align(&mut views, &before, state, &labels[state], &base, tether);
                cameras[state] = views.iter().map(|v| v.camera.camera_from_world).collect();
                Ok(views)
            },
            seed,
        )?;
        drop(before);
        evidence = of_film(evidence);
        let again = Discovery::again(&evidence, estimate.tree, cost);
        let second;
        (evidence, estimate, second) = settle(evidence, again, seed, &skip, progress)?;
        trace.extend(second);
        correct(&estimate.world_from_state, &mut cameras);
        labels = label_clouds(&evidence, &estimate.tree, &estimate.owners);
    }
    let witnesses = if estimate.tree.joints.is_empty() {
        Vec::new()
    } else {
        let of_state = |state| -> Result<Vec<Witness>, ArticulateError> {
            progress.report(state, n_states, "does it move?")?;
            Ok(Witness::some(&hushed(depths, state, &cameras[state], &evidence)?, ACROSS))
        };
        (0..n_states).map(of_state).collect::<Result<_, _>>()?
    };
    let mut said = shown(&evidence, &estimate.tree, &labels, &witnesses);
    let ask = |estimate: &Estimate| {
        let labels = label_clouds(&evidence, &estimate.tree, &estimate.owners);
        let said = shown(&evidence, &estimate.tree, &labels, &witnesses);
        (labels, said)
    };
    if value_by_views::correct(&evidence, &mut estimate, &labels, &witnesses, &said, seed) {
        (labels, said) = ask(&estimate);
    }
    if value_by_views::leave_out(&evidence, &mut estimate, &said, seed) {
        (labels, said) = ask(&estimate);
    }
    let information = if noisy { of_parts(&evidence, &labels, &estimate) } else { Vec::new() };
    let resampled = match noisy && config.resample && !estimate.tree.joints.is_empty() {
        true => resample::deviations(depths, lattice, &cameras, &estimate, seed, progress)?,
        false => Vec::new(),
    };
    let (doubts, certainty) =
        weigh_doubts(&evidence, &estimate, &labels, &Believed { shown: &said, resampled: &resampled }, seed);
    let samples = if noisy || !config.borders {
        let of_state = |(state, own): (usize, &Vec<u8>)| -> Vec<Labelled> {
            let points = &evidence.clouds[state].points;
            points.iter().zip(own).map(|(point, part)| Labelled { state, point: *point, part: *part }).collect()
        };
        labels.iter().enumerate().flat_map(of_state).collect()
    } else {
        sharpen::<ArticulateError>(&evidence, &estimate.tree, &labels, &mut |state| {
            progress.report(state, n_states, "borders")?;
            hushed(depths, state, &cameras[state], &evidence)
        })?
    };
    Ok(Articulation {
        samples,
        voxel: lattice.voxel,
        tree: estimate.tree,
        cameras,
        report: estimate.report,
        information,
        certainty,
        shown: said,
        doubts,
        trace,
    })
}

/// Corrects the cameras of every state by what its frame was off.
fn correct(world_from_state: &[Pose], cameras: &mut [Vec<Pose>]) {
    for (views, world) in cameras.iter_mut().zip(world_from_state) {
        views.iter_mut().for_each(|c| *c = *c * world.inverse());
    }
}

/// The views of a state from where their cameras are.
fn corrected(depths: &mut dyn Depths, state: usize, cameras: &[Pose]) -> Result<Vec<DepthView>, ArticulateError> {
    let mut views = depths.views(state).map_err(ArticulateError::of_depths)?;
    views.iter_mut().zip(cameras).for_each(|(view, pose)| view.camera.camera_from_world = *pose);
    Ok(views)
}

/// The same, without the background that other views contradict.
fn hushed(
    depths: &mut dyn Depths,
    state: usize,
    cameras: &[Pose],
    evidence: &Evidence,
) -> Result<Vec<DepthView>, ArticulateError> {
    let mut views = corrected(depths, state, cameras)?;
    mask_votes::hush(&mut views, &evidence.silent[state]);
    Ok(views)
}

/// Passes that a picture of a film has too little for: it lies on the scan already, and shows too few
/// samples to split parts by.
const NOT_OF_A_FILM: &[&str] = &["align_states", "split_coupled"];

/// Passes that know less than a room does.
const NOT_WHERE_HELD: &[&str] = &["align_states"];

/// Where the room holds the cameras: pull towards their poses, share of the pull towards the object's
/// surface. The room has them to 0.1 deg. By itself, an object seen from the front let them go 0.35 deg
/// astray, and at a share of 0.2 single views still by up to 1.9.
const HELD: f64 = 2.0;

/// Pixels across a view when it is asked whether parts move.
const ACROSS: usize = 160;

/// Cells of the grid along the object's longest side.
const CELLS: std::ops::RangeInclusive<usize> = 8..=1000;

/// The grid, once everything that it is made of has been looked at.
fn checked_lattice(depths: &mut dyn Depths, config: &Config) -> Result<Lattice, ArticulateError> {
    let n = depths.n_states();
    if !(1..=MOST_STATES).contains(&n) {
        let hint = "leave out states between the others";
        let what = format!("{n} states, and between 1 and {MOST_STATES} can be compared");
        return Err(ArticulateError::input(what, "the number of states", hint));
    }
    if !CELLS.contains(&config.cells) {
        let hint = format!("cells = {} to {}", CELLS.start(), CELLS.end());
        return Err(ArticulateError::input("a setting is out of range", format!("cells = {}", config.cells), hint));
    }
    known(&config.skip)?;
    let (lo, hi) = depths.extent().map_err(ArticulateError::of_depths)?;
    let size = hi - lo;
    if !(lo.is_finite() && hi.is_finite() && size.min_element() >= 0.0 && size.max_element() > 0.0) {
        let hint = "is the depth in scene units, and does any pixel show the object?";
        return Err(ArticulateError::input("the object has no extent", format!("from {lo} to {hi}"), hint));
    }
    Ok(Lattice::new(lo, hi, config.cells))
}
