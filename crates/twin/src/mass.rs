//! Mass, centre of mass and inertia from a closed mesh and a density, kept physical.

use crate::Inertial;
use glam::{DMat3, DVec3};
use hingecast_geom::TriMesh;

/// Inertial of the solid that `mesh` encloses. When the mesh encloses too little (a hole, a sheet),
/// the hulls stand in, then the box; the second value says so.
pub fn inertial(mesh: &TriMesh, hulls: &[TriMesh], density: f64) -> (Inertial, Option<String>) {
    let (lo, hi) = mesh.bounds().unwrap_or_default();
    let size = (hi - lo).as_dvec3().max(DVec3::splat(1e-4));
    // A solid thinner than 0.1 % of its box in the mean is not one.
    let least = 1e-3 * size.x * size.y * size.z;
    let whole = mesh.mass_integrals();
    if whole.volume >= least {
        let i = Inertial {
            mass: density * whole.volume,
            com: whole.centroid,
            inertia: whole.inertia_per_density * density,
        };
        return (physical(i), None);
    }
    let pieces: Vec<_> = hulls.iter().map(TriMesh::mass_integrals).filter(|m| m.volume > 0.0).collect();
    let volume: f64 = pieces.iter().map(|m| m.volume).sum();
    if volume >= least {
        let com = pieces.iter().map(|m| m.centroid * m.volume).sum::<DVec3>() / volume;
        let mut inertia = DMat3::ZERO;
        for m in &pieces {
            let r = m.centroid - com;
            inertia += m.inertia_per_density + parallel_axis(r) * m.volume;
        }
        let i = Inertial { mass: density * volume, com, inertia: inertia * density };
        return (physical(i), Some("mass from its collision hulls: the fused surface encloses no volume".into()));
    }
    let mass = density * least.max(1e-9);
    let d = size * size;
    let inertia = DMat3::from_diagonal(DVec3::new(d.y + d.z, d.x + d.z, d.x + d.y) * (mass / 12.0));
    let com = (lo + hi).as_dvec3() * 0.5;
    (
        physical(Inertial { mass, com, inertia }),
        Some("mass guessed from its box: the fused surface encloses no volume".into()),
    )
}

/// |r|^2 1 - r r'
fn parallel_axis(r: DVec3) -> DMat3 {
    DMat3::from_diagonal(DVec3::splat(r.length_squared())) - DMat3::from_cols(r * r.x, r * r.y, r * r.z)
}

/// Rounds principal moments up so that they are positive and obey the triangle inequality, which
/// simulators demand.
fn physical(mut i: Inertial) -> Inertial {
    let m = nalgebra::Matrix3::from_fn(|r, c| 0.5 * (i.inertia.col(c)[r] + i.inertia.col(r)[c]));
    let eigen = m.symmetric_eigen();
    let mut e = [eigen.eigenvalues[0], eigen.eigenvalues[1], eigen.eigenvalues[2]];
    // A point-like part still turns: radius of gyration at least 1 mm.
    let floor = i.mass * 1e-6;
    for x in &mut e {
        *x = if *x > floor { *x } else { floor };
    }
    for a in 0..3 {
        let others = e[(a + 1) % 3] + e[(a + 2) % 3];
        if e[a] > 0.999 * others {
            let lack = (e[a] / 0.999 - others) / 2.0;
            e[(a + 1) % 3] += lack;
            e[(a + 2) % 3] += lack;
        }
    }
    let v = eigen.eigenvectors;
    let fixed = v * nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::from(e)) * v.transpose();
    i.inertia = DMat3::from_cols_array(&std::array::from_fn(|k| fixed[(k % 3, k / 3)]));
    i
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_sheet_without_volume_still_has_a_physical_inertia_and_says_so() {
        let mut sheet = TriMesh::cuboid(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0));
        sheet.faces.truncate(2);
        let (i, doubt) = inertial(&sheet, &[], 500.0);
        assert!(i.mass > 0.0 && doubt.is_some());
        let d = [i.inertia.x_axis.x, i.inertia.y_axis.y, i.inertia.z_axis.z];
        assert!(d.iter().all(|x| *x > 0.0) && d[2] <= d[0] + d[1]);
    }

    #[test]
    fn a_box_weighs_what_it_should() {
        let (i, doubt) = inertial(&TriMesh::cuboid(Vec3::ZERO, Vec3::new(0.1, 0.2, 0.3)), &[], 500.0);
        assert!(doubt.is_none() && (i.mass - 3.0).abs() < 1e-5);
    }
}
