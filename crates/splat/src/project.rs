//! Projection of 16 (or 8) gaussians a vector: canonical parameters -> one 64-byte screen record
//! each.
//!
//! EWA splatting (Zwicker et al. 2001) as in 3D Gaussian Splatting (Kerbl et al. 2023): with M =
//! camera_from_group, x = M m, covariance S2 = J R Q S S Q' R' J' + 0.3 px, J the Jacobian of the
//! pinhole projection at x. The product J R Q S is kept as 2 x 3 factors: T = U Q S with U = J R,
//! so that S2 = T T' + 0.3.

use crate::params::{Planes, plane};
use crate::pool::Shards;
use crate::simd::Lanes;
use crate::view::View;

/// Gaussians per work item; a multiple of 16. Fixed, because partial sums per chunk must not depend
/// on the thread count.
pub(crate) const CHUNK: usize = 1024;
/// Nearer than this (scene units) is not drawn.
pub(crate) const NEAR: f32 = 0.01;
/// Added to both variances on screen, px^2: a gaussian is never thinner than the pixel grid can
/// show.
pub(crate) const DILATION: f32 = 0.3;
/// log2(1/255): fainter than this does not count.
pub(crate) const MIN_LOG2_ALPHA: f32 = -7.994_353_4;
const LOG2E: f32 = std::f32::consts::LOG2_E;
pub(crate) const SH_C0: f32 = 0.282_094_79;
pub(crate) const SH_C1: f32 = 0.488_602_51;
/// Tile rectangle of a gaussian that is not visible.
pub(crate) const NO_RECT: u32 = 0x0000_00ff;

/// One projected gaussian, one cache line. log2(alpha) = l2o + a dx^2 + b dx dy + c dy^2.
#[derive(Clone, Copy, Default)]
#[repr(C, align(64))]
pub(crate) struct Splat {
    pub mx: f32,
    pub my: f32,
    pub a: f32,
    pub b: f32,
    pub c: f32,
    pub l2o: f32,
    pub rgb: [f32; 3],
    pub z: f32,
    /// For fixed y the best x is y * best_x, and the other way round; for the block test.
    pub best_x: f32,
    pub best_y: f32,
    _pad: [f32; 4],
}

/// Raw pointers to the padded planes, so that threads can update disjoint gaussians.
#[derive(Clone, Copy)]
pub(crate) struct PlaneTable([*mut f32; plane::COUNT_DEGREE_1]);
unsafe impl Sync for PlaneTable {}
unsafe impl Send for PlaneTable {}

impl PlaneTable {
    pub fn new(planes: &mut Planes) -> Self {
        let mut table = [std::ptr::null_mut(); plane::COUNT_DEGREE_1];
        for (slot, p) in table.iter_mut().zip(planes.padded_mut()) {
            *slot = p.as_mut_ptr();
        }
        Self(table)
    }

    /// For kernels that only read.
    pub fn read_only(planes: &Planes) -> Self {
        let mut table = [std::ptr::null_mut(); plane::COUNT_DEGREE_1];
        for (k, slot) in table.iter_mut().enumerate().take(planes.count()) {
            *slot = planes.padded(k).as_ptr().cast_mut();
        }
        Self(table)
    }

    #[inline(always)]
    pub unsafe fn load<T: Lanes>(&self, k: usize, i: usize) -> T {
        unsafe { T::load_ptr(self.0[k].add(i)) }
    }

    #[inline(always)]
    pub unsafe fn store<T: Lanes>(&self, k: usize, i: usize, value: T) {
        unsafe { value.store_ptr(self.0[k].add(i)) }
    }
}

pub(crate) struct Args<'a> {
    pub params: PlaneTable,
    /// Padded number of gaussians.
    pub len: usize,
    pub sh1: bool,
    /// Group of each gaussian, padded; empty when there is one group.
    pub groups: &'a [u16],
    pub view: &'a View,
    pub splats: Shards<'a, Splat>,
    /// Tiles x0, x1, y0, y1 (inclusive) in one byte each.
    pub rects: Shards<'a, u32>,
}

/// The [`crate::view::Frame`] of every lane.
pub(crate) struct FrameLanes<T> {
    pub r: [[T; 3]; 3],
    pub t: [T; 3],
    pub centre: [T; 3],
    /// The group, when all lanes share it.
    pub group: Option<usize>,
}

#[inline(always)]
pub(crate) fn frame_lanes<T: Lanes>(view: &View, groups: &[u16], i: usize) -> FrameLanes<T> {
    let first = if groups.is_empty() { 0 } else { groups[i] };
    let mut uniform = true;
    if !groups.is_empty() {
        for lane in 1..T::N {
            uniform &= groups[i + lane] == first;
        }
    }
    let zero = T::splat(0.0);
    let mut out = FrameLanes { r: [[zero; 3]; 3], t: [zero; 3], centre: [zero; 3], group: None };
    if uniform {
        let f = &view.frames[first as usize];
        for a in 0..3 {
            for b in 0..3 {
                out.r[a][b] = T::splat(f.r[a][b]);
            }
            out.t[a] = T::splat(f.t[a]);
            out.centre[a] = T::splat(f.centre[a]);
        }
        out.group = Some(first as usize);
        return out;
    }
    let mut buffer = [[0f32; 16]; 15];
    for lane in 0..T::N {
        let f = &view.frames[groups[i + lane] as usize];
        for a in 0..3 {
            for b in 0..3 {
                buffer[3 * a + b][lane] = f.r[a][b];
            }
            buffer[9 + a][lane] = f.t[a];
            buffer[12 + a][lane] = f.centre[a];
        }
    }
    for a in 0..3 {
        for b in 0..3 {
            out.r[a][b] = T::load(&buffer[3 * a + b]);
        }
        out.t[a] = T::load(&buffer[9 + a]);
        out.centre[a] = T::load(&buffer[12 + a]);
    }
    out
}

/// Everything that the backward pass needs again.
pub(crate) struct Projected<T> {
    pub mean: [T; 3],
    /// Position in the camera frame and 1/z.
    pub x: T,
    pub y: T,
    pub z: T,
    pub rz: T,
    /// U = J R, 2 x 3, and V = U Q, T = V S.
    pub u: [[T; 3]; 2],
    pub v: [[T; 3]; 2],
    pub t: [[T; 3]; 2],
    /// Unit quaternion w x y z and the reciprocal of its norm before.
    pub q: [T; 4],
    pub recip_norm: T,
    /// Rotation matrix of q.
    pub rot: [[T; 3]; 3],
    /// Standard deviations.
    pub s: [T; 3],
    /// Covariance on screen [[a, b], [b, c]].
    pub a: T,
    pub b: T,
    pub c: T,
}

/// # Safety
/// `i + N` gaussians are readable in `params`.
#[inline(always)]
pub(crate) unsafe fn project_vector<T: Lanes>(
    params: &PlaneTable,
    i: usize,
    view: &View,
    f: &FrameLanes<T>,
) -> Projected<T> {
    macro_rules! load {
        ($k:expr) => {
            unsafe { params.load::<T>($k, i) }
        };
    }
    let one = T::splat(1.0);
    let mean = [load!(plane::MEANS), load!(plane::MEANS + 1), load!(plane::MEANS + 2)];
    macro_rules! row {
        ($k:expr) => {
            f.r[$k][0].fma(mean[0], f.r[$k][1].fma(mean[1], f.r[$k][2].fma(mean[2], f.t[$k])))
        };
    }
    let (x, y, z) = (row!(0), row!(1), row!(2).max(T::splat(NEAR)));
    let rz = one / z;

    // U = J R with J = [[fx/z, 0, -fx x/z^2], [0, fy/z, -fy y/z^2]].
    let (j00, j11) = (T::splat(view.fx) * rz, T::splat(view.fy) * rz);
    let (x_over_z, y_over_z) = (x * rz, y * rz);
    let mut u = [[one; 3]; 2];
    for k in 0..3 {
        u[0][k] = j00 * x_over_z.fnma(f.r[2][k], f.r[0][k]);
        u[1][k] = j11 * y_over_z.fnma(f.r[2][k], f.r[1][k]);
    }

    let raw = [load!(plane::QUATS), load!(plane::QUATS + 1), load!(plane::QUATS + 2), load!(plane::QUATS + 3)];
    let norm2 = raw[0].fma(raw[0], raw[1].fma(raw[1], raw[2].fma(raw[2], raw[3] * raw[3])));
    let recip_norm = one / norm2.max(T::splat(1e-12)).sqrt();
    let q = [raw[0] * recip_norm, raw[1] * recip_norm, raw[2] * recip_norm, raw[3] * recip_norm];
    let rot = rotation(&q);
    let s = [load!(plane::SCALES).exp(), load!(plane::SCALES + 1).exp(), load!(plane::SCALES + 2).exp()];

    let mut v = [[one; 3]; 2];
    let mut t = v;
    for e in 0..2 {
        for k in 0..3 {
            v[e][k] = u[e][0].fma(rot[0][k], u[e][1].fma(rot[1][k], u[e][2] * rot[2][k]));
            t[e][k] = v[e][k] * s[k];
        }
    }
    let dilation = T::splat(DILATION);
    let a = t[0][0].fma(t[0][0], t[0][1].fma(t[0][1], t[0][2].fma(t[0][2], dilation)));
    let b = t[0][0].fma(t[1][0], t[0][1].fma(t[1][1], t[0][2] * t[1][2]));
    let c = t[1][0].fma(t[1][0], t[1][1].fma(t[1][1], t[1][2].fma(t[1][2], dilation)));
    Projected { mean, x, y, z, rz, u, v, t, q, recip_norm, rot, s, a, b, c }
}

#[inline(always)]
fn rotation<T: Lanes>(q: &[T; 4]) -> [[T; 3]; 3] {
    let (one, two) = (T::splat(1.0), T::splat(2.0));
    let [w, x, y, z] = *q;
    [
        [one - two * y.fma(y, z * z), two * (x * y - w * z), two * x.fma(z, w * y)],
        [two * x.fma(y, w * z), one - two * x.fma(x, z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * y.fma(z, w * x), one - two * x.fma(x, y * y)],
    ]
}

#[inline(always)]
pub(crate) fn sigmoid<T: Lanes>(x: T) -> T {
    let one = T::splat(1.0);
    one / (one + (T::splat(0.0) - x).exp())
}

/// Unit direction from the camera to the mean in the group's frame, and 1 / distance.
#[inline(always)]
pub(crate) fn view_direction<T: Lanes>(mean: &[T; 3], f: &FrameLanes<T>) -> ([T; 3], T) {
    let d = [mean[0] - f.centre[0], mean[1] - f.centre[1], mean[2] - f.centre[2]];
    let norm2 = d[0].fma(d[0], d[1].fma(d[1], d[2] * d[2]));
    let recip = T::splat(1.0) / norm2.max(T::splat(1e-12)).sqrt();
    ([d[0] * recip, d[1] * recip, d[2] * recip], recip)
}

/// Colour before the clamp at 0: 0.5 + C0 f0 + C1 (-y f1 + z f2 - x f3), the basis and signs of the
/// INRIA code.
///
/// # Safety
/// As [`project_vector`].
#[inline(always)]
pub(crate) unsafe fn colour<T: Lanes>(params: &PlaneTable, i: usize, sh1: bool, dir: &[T; 3]) -> [T; 3] {
    let half = T::splat(0.5);
    let mut out = [half; 3];
    for k in 0..3 {
        unsafe {
            out[k] = params.load::<T>(plane::SH0 + k, i).fma(T::splat(SH_C0), half);
            if sh1 {
                let c1 = T::splat(SH_C1);
                out[k] = (c1 * dir[1]).fnma(params.load(plane::SH1 + k, i), out[k]);
                out[k] = (c1 * dir[2]).fma(params.load(plane::SH1 + 3 + k, i), out[k]);
                out[k] = (c1 * dir[0]).fnma(params.load(plane::SH1 + 6 + k, i), out[k]);
            }
        }
    }
    out
}

/// Projects gaussians `chunk * CHUNK ..` and writes their records and tile rectangles.
///
/// # Safety
/// The CPU has the features of `T`; each chunk runs once.
#[inline(always)]
pub(crate) unsafe fn project<T: Lanes>(args: &Args, chunk: usize) {
    let view = args.view;
    let (lo, hi) = (chunk * CHUNK, ((chunk + 1) * CHUNK).min(args.len));
    let splats = unsafe { args.splats.slice(lo, hi - lo) };
    let rects = unsafe { args.rects.slice(lo, hi - lo) };
    let (zero, half) = (T::splat(0.0), T::splat(0.5));
    let (w, h) = (view.width as f32, view.height as f32);
    let mut i = lo;
    while i < hi {
        let f = frame_lanes::<T>(view, args.groups, i);
        let g = unsafe { project_vector::<T>(&args.params, i, view, &f) };
        let (dir, _) = view_direction(&g.mean, &f);
        let rgb = unsafe { colour::<T>(&args.params, i, args.sh1, &dir) };

        // ln(alpha) = ln(o) - 1/2 d' S2^-1 d, in base 2.
        let scale = T::splat(-LOG2E) / (g.a * g.c - g.b * g.b);
        let (a, b, c) = (g.c * scale * half, zero - g.b * scale, g.a * scale * half);
        let l2o = sigmoid(unsafe { args.params.load::<T>(plane::OPACITY, i) }).log2();

        // The ellipse alpha = 1/255 reaches sqrt(2 ln(255 o) S2_xx) to each side.
        let reach = (l2o - T::splat(MIN_LOG2_ALPHA)).max(zero) * T::splat(2.0 / LOG2E);
        let (hx, hy) = ((reach * g.a).sqrt(), (reach * g.c).sqrt());
        let mx = T::splat(view.fx).fma(g.x * g.rz, T::splat(view.cx));
        let my = T::splat(view.fy).fma(g.y * g.rz, T::splat(view.cy));
        let minus_half_b = zero - b * half;

        let mut rows = [[0f32; 16]; 16];
        let fields = [
            mx,
            my,
            a,
            b,
            c,
            l2o,
            rgb[0].max(zero),
            rgb[1].max(zero),
            rgb[2].max(zero),
            g.z,
            minus_half_b / a,
            minus_half_b / c,
            hx,
            hy,
        ];
        for k in 0..14 {
            fields[k].store(&mut rows[k]);
        }
        for lane in 0..T::N {
            let (mx, my, z, hx, hy) = (rows[0][lane], rows[1][lane], rows[9][lane], rows[12][lane], rows[13][lane]);
            // Positive-phrased, so that NaN reliably fails. Centres more than half a frame outside
            // are not drawn: the linearised projection is meaningless there.
            let near_frame = mx > -0.5 * w && mx < 1.5 * w && my > -0.5 * h && my < 1.5 * h;
            let touches = mx + hx > 0.0 && mx - hx < w && my + hy > 0.0 && my - hy < h;
            let visible = z > NEAR && hx > 0.0 && hy > 0.0 && near_frame && touches;
            let tile = |v: f32, last: usize| ((v * (1.0 / 16.0)) as i32).clamp(0, last as i32 - 1) as u32;
            rects[i - lo + lane] = if visible {
                tile(mx - hx, view.tiles_x)
                    | tile(mx + hx, view.tiles_x) << 8
                    | tile(my - hy, view.tiles_y) << 16
                    | tile(my + hy, view.tiles_y) << 24
            } else {
                NO_RECT
            };
        }
        // A Splat is sixteen f32 in the order of `fields`.
        let out = unsafe { std::slice::from_raw_parts_mut(splats[i - lo..].as_mut_ptr().cast::<[f32; 16]>(), T::N) };
        T::transpose(&rows, out);
        i += T::N;
    }
}
