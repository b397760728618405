//! Primitive shapes as triangles with smooth normals, centred at the origin, long axis z.

use super::PartGeometry;
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::{PI, TAU};

/// Segments around a circle: the silhouette of a 10 cm cylinder is then off by 0.1 mm.
const AROUND: usize = 64;

/// A box with half extents `half`.
pub fn cuboid(half: DVec3, material: u32) -> PartGeometry {
    let mut out = PartGeometry::default();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |a: f64, b: f64| {
                let mut x = DVec3::ZERO;
                (x[axis], x[u], x[v]) = (sign * half[axis], a * half[u], b * half[v]);
                x
            };
            let mut normal = Vec3::ZERO;
            normal[axis] = sign as f32;
            let base = out.vertices.len() as u32;
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                push(&mut out, corner(a, b), normal, Vec2::new(0.5 + 0.5 * a as f32, 0.5 + 0.5 * b as f32));
            }
            let quad = if sign > 0.0 { [0, 1, 2, 3] } else { [0, 3, 2, 1] };
            out.faces.push([base + quad[0], base + quad[1], base + quad[2]]);
            out.faces.push([base + quad[0], base + quad[2], base + quad[3]]);
        }
    }
    out.materials = vec![material; out.faces.len()];
    out
}

/// An ellipsoid with semi-axes `radii`.
pub fn ellipsoid(radii: DVec3, material: u32) -> PartGeometry {
    let profile: Vec<[f64; 4]> = arc(-0.5 * PI, 0.5 * PI, AROUND / 2).map(|(c, s)| [c, s, c, s]).collect();
    let mut out = revolve(&profile, material);
    for (v, n) in out.vertices.iter_mut().zip(&mut out.normals) {
        *v = (v.as_dvec3() * radii).as_vec3();
        *n = (n.as_dvec3() / radii).as_vec3().normalize_or_zero();
    }
    out
}

/// A closed cylinder along z.
pub fn cylinder(radius: f64, half_length: f64, material: u32) -> PartGeometry {
    let (r, h) = (radius, half_length);
    let mut out = revolve(&[[0.0, -h, 0.0, -1.0], [r, -h, 0.0, -1.0]], material);
    for profile in [[[r, -h, 1.0, 0.0], [r, h, 1.0, 0.0]], [[r, h, 0.0, 1.0], [0.0, h, 0.0, 1.0]]] {
        out.append(&revolve(&profile, material), &hingecast_geom::Pose::IDENTITY, DVec3::ONE);
    }
    out
}

/// A cylinder along z of half length `half_length` with half spheres on its ends.
pub fn capsule(radius: f64, half_length: f64, material: u32) -> PartGeometry {
    let cap = |from: f64, to: f64, z: f64| {
        arc(from, to, AROUND / 4).map(move |(c, s)| [radius * c, z + radius * s, c, s]).collect::<Vec<_>>()
    };
    let mut profile = cap(-0.5 * PI, 0.0, -half_length);
    profile.extend(cap(0.0, 0.5 * PI, half_length));
    revolve(&profile, material)
}

fn arc(from: f64, to: f64, steps: usize) -> impl Iterator<Item = (f64, f64)> {
    (0..=steps).map(move |i| from + (to - from) * i as f64 / steps as f64).map(|a| (a.cos(), a.sin()))
}

/// Surface of revolution about z. `profile` from bottom to top: radius, z, normal's radial and z
/// parts.
fn revolve(profile: &[[f64; 4]], material: u32) -> PartGeometry {
    let mut out = PartGeometry::default();
    for (row, &[r, z, nr, nz]) in profile.iter().enumerate() {
        for i in 0..=AROUND {
            let t = i as f64 / AROUND as f64;
            let (s, c) = (TAU * t).sin_cos();
            let uv = Vec2::new(t as f32, row as f32 / (profile.len() - 1).max(1) as f32);
            push(&mut out, DVec3::new(r * c, r * s, z), Vec3::new((nr * c) as f32, (nr * s) as f32, nz as f32), uv);
        }
    }
    let stride = AROUND as u32 + 1;
    for row in 0..profile.len() as u32 - 1 {
        for i in 0..AROUND as u32 {
            let a = row * stride + i;
            // At the poles one of the two triangles has no area.
            if profile[row as usize][0] > 1e-12 {
                out.faces.push([a, a + 1, a + stride + 1]);
            }
            if profile[row as usize + 1][0] > 1e-12 {
                out.faces.push([a, a + stride + 1, a + stride]);
            }
        }
    }
    out.materials = vec![material; out.faces.len()];
    out
}

fn push(out: &mut PartGeometry, x: DVec3, normal: Vec3, uv: Vec2) {
    out.vertices.push(x.as_vec3());
    out.normals.push(normal);
    out.uvs.push(uv);
}
