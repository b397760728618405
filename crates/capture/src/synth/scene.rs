//! Triangles of all parts in one pose, and the nearest one along a ray (8-wide BVH from `obvhs`).

use crate::object::PartGeometry;
use glam::Vec3A;
use hingecast_geom::Pose;
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;

/// One pose of everything that is seen.
pub(crate) struct Scene {
    bvh: Option<CwBvh>,
    /// In the order of the BVH's leaves.
    triangles: Vec<Corner>,
}

/// A triangle as the intersection wants it: one corner, two edges; and whose face it is.
#[derive(Clone, Copy)]
struct Corner {
    v0: Vec3A,
    e1: Vec3A,
    e2: Vec3A,
    part: u32,
    face: u32,
}

/// Where a ray meets a surface. `t` counts in lengths of the ray's direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub t: f32,
    pub part: usize,
    pub face: usize,
    /// Barycentric weights of the face's second and third corner.
    pub u: f32,
    pub v: f32,
    /// Geometric normal, not oriented, unit.
    pub normal: Vec3A,
}

/// Rays between two triangles must not slip through the seam: the edge test is this much wider.
const SEAM: f32 = 1e-5;

impl Scene {
    /// Parts with their `world_from_canonical` poses. `Hit::part` counts along this list.
    pub fn new<'a>(parts: impl IntoIterator<Item = (&'a PartGeometry, Pose)>) -> Self {
        let mut triangles = Vec::new();
        for (part, (geometry, pose)) in parts.into_iter().enumerate() {
            let moved: Vec<Vec3A> =
                geometry.vertices.iter().map(|v| Vec3A::from(pose.apply(v.as_dvec3()).as_vec3())).collect();
            for (face, f) in geometry.faces.iter().enumerate() {
                let [a, b, c] = f.map(|i| moved[i as usize]);
                triangles.push(Corner { v0: a, e1: b - a, e2: c - a, part: part as u32, face: face as u32 });
            }
        }
        if triangles.is_empty() {
            return Self { bvh: None, triangles };
        }
        let boxes: Vec<Triangle> =
            triangles.iter().map(|t| Triangle { v0: t.v0, v1: t.v0 + t.e1, v2: t.v0 + t.e2 }).collect();
        let bvh = build_cwbvh_from_tris(&boxes, BvhBuildParams::medium_build(), &mut Default::default());
        let triangles = bvh.primitive_indices.iter().map(|&i| triangles[i as usize]).collect();
        Self { bvh: Some(bvh), triangles }
    }

    /// The nearest surface with 0 <= t <= `t_max`.
    pub fn cast(&self, origin: Vec3A, direction: Vec3A, t_max: f32) -> Option<Hit> {
        let bvh = self.bvh.as_ref()?;
        let mut hit = RayHit::none();
        let ray = Ray::new(origin, direction, 0.0, t_max);
        bvh.ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray).map_or(f32::INFINITY, |x| x.0));
        let triangle = self.triangles.get(hit.primitive_id as usize)?;
        let (t, u, v) = triangle.intersect(&Ray { tmax: f32::INFINITY, ..ray })?;
        let normal = triangle.e1.cross(triangle.e2).normalize_or_zero();
        Some(Hit { t, part: triangle.part as usize, face: triangle.face as usize, u, v, normal })
    }
}

impl Corner {
    /// Moeller and Trumbore 1997: distance and barycentric weights.
    #[inline(always)]
    fn intersect(&self, ray: &Ray) -> Option<(f32, f32, f32)> {
        let p = ray.direction.cross(self.e2);
        let inverse = 1.0 / self.e1.dot(p);
        let s = ray.origin - self.v0;
        let u = s.dot(p) * inverse;
        let q = s.cross(self.e1);
        let v = ray.direction.dot(q) * inverse;
        let t = self.e2.dot(q) * inverse;
        // Positive phrasing: NaN from a triangle seen edge-on fails.
        (u >= -SEAM && v >= -SEAM && u + v <= 1.0 + SEAM && t >= ray.tmin && t <= ray.tmax).then_some((t, u, v))
    }
}
