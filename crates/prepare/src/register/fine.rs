//! Scans aligned to scans: point to plane, weights that let go of what moved, and all states
//! together at the end.

use super::balanced;
use crate::scan::Scan;
use glam::{DVec3, Vec3};
use hingecast_articulate::observe::cloud::Cloud;
use hingecast_geom::Pose;
use hingecast_geom::icp::Surface;
use hingecast_geom::pose::quat_from_rotation_vector;
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Rounds of all states together.
const ROUNDS: usize = 3;
/// Samples of a scan that are aligned.
const SAMPLES: usize = 12_000;

/// What samples near a surface say about where their scan stands.
struct Round {
    /// Normal equations of the turn about `centre` and the shift, weighted.
    a: Matrix6<f64>,
    b: Vector6<f64>,
    /// Sum of the weights.
    weight: f64,
    /// Absolute residuals of the samples that count, scene units, in no order.
    residuals: Vec<f64>,
    centre: DVec3,
}

/// `gate`: farthest neighbour, scene units; `scale`: residual at which a sample's weight has fallen to
/// a quarter (Geman and McClure).
fn round(cloud: (&[Vec3], &[Vec3]), target: &Surface, pose: Pose, gate: f32, scale: f64) -> Round {
    let (points, normals) = cloud;
    let (rot, trans) = (pose.mat3().as_mat3(), pose.trans.as_vec3());
    let centre = pose.apply(points.iter().sum::<Vec3>().as_dvec3() / points.len().max(1) as f64);
    let none = || Round { a: Matrix6::zeros(), b: Vector6::zeros(), weight: 0.0, residuals: Vec::new(), centre };
    let order: Vec<usize> = (0..points.len()).collect();
    let chunks: Vec<Round> = order
        .par_chunks(1024)
        .map(|chunk| {
            let mut sum = none();
            for &i in chunk {
                let (x, m) = (rot * points[i] + trans, rot * normals[i]);
                let Some((j, squared)) = target.nearest(x) else { continue };
                let n = target.normals[j];
                if squared > gate * gate || m.dot(n) < 0.7 {
                    continue;
                }
                let r = f64::from(n.dot(x - target.points[j]));
                sum.residuals.push(r.abs());
                let w = (1.0 + (r / scale).powi(2)).powi(-2);
                let (arm, n) = (x.as_dvec3() - centre, n.as_dvec3());
                let c = arm.cross(n);
                let row = Vector6::new(c.x, c.y, c.z, n.x, n.y, n.z);
                sum.a += w * row * row.transpose();
                sum.b -= w * row * r;
                sum.weight += w;
            }
            sum
        })
        .collect();
    chunks.into_iter().fold(none(), |mut sum, chunk| {
        sum.a += chunk.a;
        sum.b += chunk.b;
        sum.weight += chunk.weight;
        sum.residuals.extend(chunk.residuals);
        sum
    })
}

/// Fewer samples near a surface say nothing.
const FEWEST: usize = 30;

/// One round of Gauss and Newton (see [`fn@round`]). Returns the pose, and the lower quartile and the
/// median of the absolute residuals within the gate.
pub(crate) fn step(
    points: &[Vec3],
    normals: &[Vec3],
    target: &Surface,
    pose: Pose,
    gate: f32,
    scale: f64,
) -> (Pose, [f64; 2]) {
    let Round { a, b, mut residuals, centre, .. } = round((points, normals), target, pose, gate, scale);
    if residuals.len() < FEWEST {
        return (pose, [f64::INFINITY; 2]);
    }
    let last = residuals.len() - 1;
    let off = [last / 4, last / 2].map(|k| *residuals.select_nth_unstable_by(k, f64::total_cmp).1);
    let damping = 1e-6 * a.trace() / 6.0;
    let Some(x) = (a + Matrix6::identity() * damping).cholesky().map(|c| c.solve(&b)) else { return (pose, off) };
    let turn = quat_from_rotation_vector(DVec3::new(x[0], x[1], x[2]));
    let shift = DVec3::new(x[3], x[4], x[5]);
    let about_centre = Pose::new(turn, centre + shift - turn * centre);
    (about_centre * pose, off)
}

/// The poses of all states (frame of state 0 from each), refined together from `start`. `order`: the
/// states as the pairs reach them, state 0 first. `pair`: where a pair by itself says that a state
/// stands in the frame of another.
pub(super) fn together(
    scans: &[Scan],
    start: Vec<Pose>,
    order: &[usize],
    pair: &dyn Fn(usize, usize) -> Option<Pose>,
    seed: u64,
) -> Vec<Pose> {
    let n = scans.len();
    let own: Vec<Cloud> = scans.iter().map(|scan| balanced::pick(&scan.fine, SAMPLES, seed)).collect();
    let voxel = scans.iter().map(|s| s.fine_voxel).fold(0.0, f32::max);
    let gathered = |others: &[usize], poses: &[Pose]| surface(others.iter().map(|&r| (&scans[r], poses[r])));
    let aligned = |s: usize, others: &[usize], poses: &[Pose], rounds: usize| {
        let surface = gathered(others, poses);
        let (mut pose, mut scale) = (poses[s], f64::from(voxel));
        for _ in 0..rounds {
            let (better, [_, median]) = step(&own[s].points, &own[s].normals, &surface, pose, 2.0 * voxel, scale);
            pose = better;
            scale = narrowed(voxel, median);
        }
        pose
    };
    let mut poses = start;
    // Each onto those before it: two states that lie well on each other would hold each other where
    // both are off.
    for k in 1..order.len() {
        let (s, before) = (order[k], &order[k.saturating_sub(ALL)..k]);
        let by_pairs = before.iter().filter_map(|&r| Some(poses[r] * pair(r, s)?));
        let starts: Vec<Pose> = std::iter::once(poses[s]).chain(by_pairs).collect();
        poses[s] = most_exact(&scans[s], &own[s], &gathered(before, &poses), &starts, voxel);
        poses[s] = aligned(s, before, &poses, 12);
    }
    for _ in 0..ROUNDS {
        let next: Vec<Pose> = (0..n)
            .into_par_iter()
            .map(|s| {
                // With many states a few of the others hold a scan as well as all do.
                let others: Vec<usize> = (0..n).filter(|&r| r != s).take(ALL).collect();
                if n == 2 && s == 0 { poses[0] } else { aligned(s, &others, &poses, 4) }
            })
            .collect();
        // State 0 keeps its frame.
        let back = next[0].inverse();
        poses = next.into_iter().map(|p| back * p).collect();
        poses[0] = Pose::IDENTITY;
    }
    poses
}

/// The scale of a round after one whose median residual is known.
fn narrowed(voxel: f32, median: f64) -> f64 {
    (3.0 * median).clamp(0.05 * f64::from(voxel), f64::from(voxel))
}

/// Of the places that `starts` lead to, the one at which most of a scan lies exactly on `surface`. Where
/// the object was pushed by no more than a cell or two, what is coarsely best lies between room and
/// object, and on neither. `facing`: samples of the scan, facings balanced.
fn most_exact(scan: &Scan, facing: &Cloud, surface: &Surface, starts: &[Pose], voxel: f32) -> Pose {
    let even = balanced::evenly(&scan.fine, facing.points.len());
    // The object has many facings, the room most of the surface.
    let tries: Vec<(&Cloud, Pose)> = starts.iter().flat_map(|start| [(facing, *start), (&even, *start)]).collect();
    let settled: Vec<(Pose, f64)> = tries
        .into_par_iter()
        .map(|(cloud, start)| {
            let (mut pose, mut scale, mut noise) = (start, WIDE * f64::from(voxel), f64::INFINITY);
            while scale > NARROW * f64::from(voxel) {
                let gate = (2.0 * scale as f32).max(2.0 * voxel);
                let (better, [quartile, _]) = step(&cloud.points, &cloud.normals, surface, pose, gate, scale);
                (pose, scale, noise) = (better, SLOWLY * scale, 2.0 * quartile);
                if scale < 3.0 * quartile {
                    break;
                }
            }
            (pose, noise)
        })
        .collect();
    let noise = settled.iter().map(|s| s.1).fold(f64::INFINITY, f64::min);
    let within = on(voxel, noise);
    let lying = |pose: &Pose| {
        let (points, normals) = carried(&even, pose);
        points.iter().zip(&normals).filter(|(x, m)| lies_on(surface, **x, **m, voxel, within)).count()
    };
    let counted: Vec<usize> = settled.par_iter().map(|s| lying(&s.0)).collect();
    let best = (0..settled.len()).max_by_key(|&k| (counted[k], std::cmp::Reverse(k)));
    best.map_or(starts[0], |k| settled[k].0)
}

/// Whether a sample lies `within` a plane of a surface whose samples are a fine voxel apart, and faces
/// as it does.
pub(super) fn lies_on(surface: &Surface, x: Vec3, m: Vec3, voxel: f32, within: f32) -> bool {
    surface.nearest(x).is_some_and(|(j, squared)| {
        let n = surface.normals[j];
        squared < (2.0 * voxel).powi(2) && m.dot(n) > 0.9 && n.dot(x - surface.points[j]).abs() < within
    })
}

/// How near a sample must be to a plane to lie on it, where what a scan says is off by `noise`.
pub(super) fn on(voxel: f32, noise: f64) -> f32 {
    (ON * voxel).max(if noise.is_finite() { 3.0 * noise as f32 } else { 0.0 })
}

/// Scales, fine voxels, between which the fit narrows, and by how much a step.
const WIDE: f64 = 6.0;
const NARROW: f64 = 0.1;
const SLOWLY: f64 = 0.75;
/// Within so many fine voxels of a plane, or three times the noise, a sample lies on it.
const ON: f32 = 0.25;

/// Other states that a scan is aligned to.
const ALL: usize = 8;

/// What scans saw, each brought to where it stands, as one surface.
pub(super) fn surface<'a>(placed: impl Iterator<Item = (&'a Scan, Pose)>) -> Surface {
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for (scan, pose) in placed {
        let (p, m) = carried(&scan.fine, &pose);
        points.extend(p);
        normals.extend(m);
    }
    Surface::new(points, normals)
}

/// A cloud in another frame.
pub(super) fn carried(cloud: &Cloud, pose: &Pose) -> (Vec<Vec3>, Vec<Vec3>) {
    let (rot, trans) = (pose.mat3().as_mat3(), pose.trans.as_vec3());
    let points = cloud.points.iter().map(|x| rot * *x + trans).collect();
    (points, cloud.normals.iter().map(|n| rot * *n).collect())
}

/// How far each state's scan could turn, or slide at its own radius, before its samples were farther
/// from the others' surfaces than they are in the median, in the direction that holds it least. A flat
/// door turns in its plane, and only its handle objects. Residuals are taken to err alike
/// everywhere, as depth cameras do; rooms with time-of-flight noise were off by half of it. 0 for
/// state 0, whose frame is everybody's; a half turn where nothing holds it. `[state]`, radians
pub(super) fn slack(scans: &[Scan], poses: &[Pose], seed: u64) -> Vec<f64> {
    let voxel = scans.iter().map(|s| s.fine_voxel).fold(0.0, f32::max);
    let of_state = |s: usize| {
        let cloud = balanced::pick(&scans[s].fine, SAMPLES, seed);
        let others = (0..scans.len()).filter(|&r| r != s).take(ALL).map(|r| (&scans[r], poses[r]));
        let surface = surface(others);
        let at = |scale: f64| {
            let mut now = round((&cloud.points, &cloud.normals), &surface, poses[s], 2.0 * voxel, scale);
            let middle = now.residuals.len() / 2;
            let enough = now.residuals.len() >= FEWEST;
            let median = enough.then(|| *now.residuals.select_nth_unstable_by(middle, f64::total_cmp).1)?;
            Some((now, median))
        };
        // The scale twice narrowed, as the poses were found with.
        let narrow = |scale: f64| at(scale).map(|(_, median)| narrowed(voxel, median));
        let last = narrow(f64::from(voxel)).and_then(narrow).and_then(at);
        // Held by nothing: files know no infinity.
        let Some((now, median)) = last else { return PI };
        let squared = |x: &Vec3| (poses[s].apply(x.as_dvec3()) - now.centre).length_squared();
        let radius = (cloud.points.iter().map(squared).sum::<f64>() / cloud.points.len() as f64).sqrt();
        (median / felt(&now, radius) / radius).min(PI)
    };
    (0..scans.len()).into_par_iter().map(|s| if s == 0 { 0.0 } else { of_state(s) }).collect()
}

/// How far samples come off their planes, root mean square, when the scan moves by 1 the way they feel least:
/// shifts, and turns by the way of a sample at the radius.
fn felt(round: &Round, radius: f64) -> f64 {
    let unit = |k: usize| if k < 3 { 1.0 / radius } else { 1.0 };
    let scaled = Matrix6::from_fn(|i, j| round.a[(i, j)] * unit(i) * unit(j) / round.weight);
    scaled.symmetric_eigenvalues().min().max(1e-12).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc, one sample in `one_in` of which faces along the disc: half of these outwards, which hold
    /// shifts, half aside, which hold the turn.
    fn disc(one_in: usize) -> Round {
        let mut cloud = (Vec::new(), Vec::new());
        for k in 0..6000 {
            let (sin, cos) = (2.4 * k as f32).sin_cos();
            let out = Vec3::new(cos, sin, 0.0);
            cloud.0.push((k as f32 / 6000.0).sqrt() * out);
            cloud.1.push(match k % (2 * one_in) {
                0 => out,
                n if n == one_in => Vec3::new(-sin, cos, 0.0),
                _ => Vec3::Z,
            });
        }
        let surface = Surface::new(cloud.0.clone(), cloud.1.clone());
        round((&cloud.0, &cloud.1), &surface, Pose::IDENTITY, 0.01, 0.1)
    }

    #[test]
    fn a_flat_thing_feels_its_turn_by_the_few_samples_that_face_along_it() {
        // Of a squared turn the samples that face aside feel all, as far as they are out; they are one in
        // two times `one_in`.
        for one_in in [2, 10, 50] {
            let felt = felt(&disc(one_in), 0.5f64.sqrt());
            let expected = (0.5 / one_in as f64).sqrt();
            assert!((felt / expected - 1.0).abs() < 0.1, "one in {one_in}: {felt}, expected {expected}");
        }
    }
}
