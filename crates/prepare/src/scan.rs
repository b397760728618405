//! One state's views as the registration wants them: oriented samples, and the space between the
//! cameras and these.

use glam::Vec3;
use hingecast_articulate::observe::cloud::{Cloud, gather};
use hingecast_articulate::observe::lattice::Lattice;
use hingecast_articulate::observe::occupancy::{Answer, Occupancy};
use hingecast_articulate::{DepthView, OBJECT, OTHER, UNKNOWN};

/// Cells along the longest side of a scan, coarse and fine.
const COARSE: usize = 96;
const FINE: usize = 320;
/// Share of the pixels, at each end of every axis, that may lie outside the box of a scan: strays.
const STRAY: f64 = 0.002;
/// Pixels of a view that are looked at, about.
const PIXELS: usize = 20_000;

/// What one state saw, in the frame of its own cameras.
pub struct Scan {
    /// Surface, one sample a coarse cell and facing.
    pub coarse: Cloud,
    /// The same, finely: a few samples where `coarse` has one.
    pub fine: Cloud,
    /// Where surface is, where cameras looked through.
    pub space: Occupancy,
    /// Edge of a fine cell, scene units.
    pub fine_voxel: f32,
}

impl Scan {
    /// What `views`, all of one state, saw. Pixels of class `OBJECT` count: without masks, all that
    /// have depth. `None` when hardly any has. `around`: space around it that is looked at, shares
    /// of the longest side.
    pub fn new(views: &[DepthView], around: f32) -> Option<Self> {
        let (lo, hi) = extent(views, around)?;
        let lattice = Lattice::new(lo, hi, COARSE);
        let fine_voxel = (hi - lo).max_element() / FINE as f32;
        let stride = views.first()?.stride_for(PIXELS);
        let inside = |cloud: Cloud| {
            let within = |x: Vec3| x.cmpge(lo).all() && x.cmple(hi).all();
            let keep: Vec<usize> = (0..cloud.points.len()).filter(|&i| within(cloud.points[i])).collect();
            chosen(&cloud, &keep)
        };
        let fine = inside(gather(views, fine_voxel, stride, 1));
        let coarse = inside(gather(views, lattice.voxel, stride, 2));
        let space = Occupancy::new(lattice, &coarse, views, 1.5, 1);
        Some(Self { coarse, fine, space, fine_voxel })
    }

    /// Edge of a coarse cell, scene units.
    pub fn voxel(&self) -> f32 {
        self.space.lattice.voxel
    }

    /// What the scan says about a place where a surface with normal `n` would be. Outside its box
    /// it says nothing.
    pub fn ask(&self, x: Vec3, n: Vec3) -> Answer {
        match self.space.lattice.index(x) {
            Some(_) => self.space.ask(x, n),
            None => Answer::Silent,
        }
    }
}

/// The same views with all that has depth as `OBJECT`, whatever a mask says.
pub(crate) fn everything(views: &[DepthView]) -> Vec<DepthView> {
    let seen = |class: &u8| if matches!(*class, OBJECT | OTHER) { OBJECT } else { UNKNOWN };
    views.iter().map(|v| DepthView { class: v.class.iter().map(seen).collect(), ..v.clone() }).collect()
}

/// The samples of a cloud at these places.
pub(crate) fn chosen(cloud: &Cloud, which: &[usize]) -> Cloud {
    let pick = |from: &[Vec3]| which.iter().map(|&i| from[i]).collect();
    Cloud { points: pick(&cloud.points), normals: pick(&cloud.normals) }
}

/// Box of what the views saw, without strays.
pub(crate) fn extent(views: &[DepthView], around: f32) -> Option<(Vec3, Vec3)> {
    let mut axes: [Vec<f32>; 3] = Default::default();
    for view in views {
        let (w, stride) = (view.camera.width, 7);
        for i in (0..view.class.len()).step_by(stride).filter(|&i| view.class[i] == OBJECT) {
            let uv = glam::DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
            let x = view.camera.unproject(uv, view.depth[i] as f64).as_vec3();
            if x.is_finite() {
                (0..3).for_each(|a| axes[a].push(x[a]));
            }
        }
    }
    if axes[0].len() < 100 {
        return None;
    }
    let at = |values: &mut Vec<f32>, share: f64| {
        let k = ((values.len() - 1) as f64 * share) as usize;
        *values.select_nth_unstable_by(k, f32::total_cmp).1
    };
    let lo = Vec3::from_array(std::array::from_fn(|a| at(&mut axes[a], STRAY)));
    let hi = Vec3::from_array(std::array::from_fn(|a| at(&mut axes[a], 1.0 - STRAY)));
    let side = (hi - lo).max_element();
    let room = Vec3::splat(around * side);
    (side > 0.0).then_some((lo - room, hi + room))
}
