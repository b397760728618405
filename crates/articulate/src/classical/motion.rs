//! Rigid motions from corresponding points: Kabsch (1976) by SVD, made robust by reweighting.

use glam::{DMat3, DQuat, DVec3};
use hingecast_geom::Pose;
use nalgebra::{Matrix3, Vector3};

/// The pose `b_from_a` that minimises sum w |b - (R a + t)|^2. `None` with fewer than three points
/// or no weight.
pub fn kabsch(a: &[DVec3], b: &[DVec3], weights: &[f64]) -> Option<Pose> {
    let total: f64 = weights.iter().sum();
    if a.len() < 3 || !(total > 0.0) {
        return None;
    }
    let mean = |x: &[DVec3]| x.iter().zip(weights).map(|(x, w)| *x * *w).sum::<DVec3>() / total;
    let (ca, cb) = (mean(a), mean(b));
    let mut h = Matrix3::<f64>::zeros();
    for i in 0..a.len() {
        let (p, q) = (a[i] - ca, b[i] - cb);
        h += Vector3::new(p.x, p.y, p.z) * Vector3::new(q.x, q.y, q.z).transpose() * weights[i];
    }
    let svd = h.svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?.transpose());
    // Without this sign the best "rotation" of flat parts would be a reflection.
    let d = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (v * u.transpose()).determinant().signum()));
    let r = v * d * u.transpose();
    let rot = DQuat::from_mat3(&DMat3::from_cols_array(&std::array::from_fn(|k| r[(k % 3, k / 3)]))).normalize();
    rot.is_finite().then(|| Pose::new(rot, cb - rot * ca))
}

/// Kabsch with Geman-McClure weights whose scale shrinks to the residuals' median: gaussians that
/// slid off their part lose their say. Answers the pose and the median residual.
pub fn robust_kabsch(a: &[DVec3], b: &[DVec3]) -> Option<(Pose, f64)> {
    let mut weights = vec![1.0; a.len()];
    let mut pose = kabsch(a, b, &weights)?;
    let mut median = 0.0;
    for _ in 0..8 {
        let squared: Vec<f64> = a.iter().zip(b).map(|(a, b)| (pose.apply(*a) - *b).length_squared()).collect();
        let mut sorted = squared.clone();
        let middle = sorted.len() / 2;
        median = sorted.select_nth_unstable_by(middle, f64::total_cmp).1.sqrt();
        let scale = (2.0 * median).powi(2).max(1e-16);
        for (w, e) in weights.iter_mut().zip(&squared) {
            *w = (scale / (scale + e)).powi(2);
        }
        pose = kabsch(a, b, &weights)?;
    }
    Some((pose, median))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast_geom::pose::quat_from_rotation_vector;

    #[test]
    fn a_third_of_outliers_does_not_matter() {
        let mut rng = fastrand::Rng::with_seed(3);
        let truth = Pose::new(quat_from_rotation_vector(DVec3::new(0.2, 0.9, -0.4)), DVec3::new(0.1, 0.2, 0.3));
        // A flat part: the case in which a reflection would fit as well.
        let a: Vec<DVec3> = (0..300).map(|_| DVec3::new(rng.f64(), rng.f64(), 0.0)).collect();
        let b: Vec<DVec3> = a
            .iter()
            .enumerate()
            .map(|(i, x)| if i % 3 == 0 { DVec3::new(rng.f64(), rng.f64(), rng.f64()) } else { truth.apply(*x) })
            .collect();
        let (pose, _) = robust_kabsch(&a, &b).unwrap();
        assert!((pose.inverse() * truth).angle() < 1e-3);
        assert!((pose.trans - truth.trans).length() < 1e-3);
    }
}
