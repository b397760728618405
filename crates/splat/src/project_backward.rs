//! From the ten sums per (gaussian, tile) pair to gradients of every parameter, and Adam in the
//! same pass.
//!
//! The pixel kernel leaves, per pair, sum w g_rgb (3), sum w g_depth, and the moments S0 Sx Sy Sxx
//! Sxy Syy of D = dL/d ln(alpha) about the centre. With ln(alpha) = ln(o) - 1/2 d' K d, d = pixel -
//! mean, K = S2^-1: dL/d logit = (1 - o) S0, dL/d mean2d = K (Sx, Sy), dL/dK = -1/2 (Sxx Sxy; Sxy
//! Syy), dL/dS2 = -K dL/dK K.

use crate::adam::{Adam, adam_vector};
use crate::params::plane;
use crate::pool::Shards;
use crate::project::{
    CHUNK, FrameLanes, NO_RECT, PlaneTable, SH_C0, SH_C1, colour, frame_lanes, project_vector, sigmoid, view_direction,
};
use crate::simd::Lanes;
use crate::view::{FrameGradient, View};

const MOST: usize = plane::COUNT_DEGREE_1;

pub(crate) struct Args<'a> {
    pub params: PlaneTable,
    pub len: usize,
    pub sh1: bool,
    pub groups: &'a [u16],
    pub view: &'a View,
    pub rects: &'a [u32],
    pub slot_base: &'a [u32],
    pub rows: &'a [[f32; 16]],
    pub written: &'a [u8],
    pub output: Output<'a>,
}

// One value per pass: the size of the variants does not matter.
#[allow(clippy::large_enum_variant)]
pub(crate) enum Output<'a> {
    /// Gradients in parameter layout, per chunk and group the frame sums, and extra values (len,
    /// channels).
    Gradients {
        planes: PlaneTable,
        /// (chunks, groups); empty when nobody asked for pose gradients.
        frames: Shards<'a, FrameGradient>,
        extra_rows: &'a [f32],
        extra: Shards<'a, f32>,
        channels: usize,
    },
    /// Straight into Adam.
    Update(Adam),
}

/// # Safety
/// The CPU has the features of `T`; each chunk runs once.
#[inline(always)]
pub(crate) unsafe fn backward<T: Lanes>(args: &Args, chunk: usize) {
    let (lo, hi) = (chunk * CHUNK, ((chunk + 1) * CHUNK).min(args.len));
    let count = if args.sh1 { plane::COUNT_DEGREE_1 } else { plane::COUNT_DEGREE_0 };
    let zero = T::splat(0.0);
    let mut i = lo;
    while i < hi {
        let mut sums = [[0f32; 16]; 16];
        let touched = gather::<T>(args, i, &mut sums);
        let mut d = [zero; MOST];
        match &args.output {
            Output::Update(adam) => {
                if touched {
                    unsafe {
                        let f = frame_lanes::<T>(args.view, args.groups, i);
                        chain::<T>(args, i, &f, &sums, &mut d, None);
                        adam_vector::<T>(adam, i, count, &d);
                    }
                }
            }
            Output::Gradients { planes, frames, extra_rows, extra, channels } => unsafe {
                if touched {
                    let f = frame_lanes::<T>(args.view, args.groups, i);
                    let groups = args.view.frames.len();
                    let frames = if frames.is_empty() { None } else { Some(frames.slice(chunk * groups, groups)) };
                    chain::<T>(args, i, &f, &sums, &mut d, frames);
                }
                for (k, value) in d.iter().enumerate().take(count) {
                    planes.store(k, i, *value);
                }
                if *channels > 0 {
                    for lane in 0..T::N {
                        gather_extra(args, i + lane, extra_rows, extra.slice((i + lane) * channels, *channels));
                    }
                }
            },
        }
        i += T::N;
    }
}

/// Sums the pair rows of N gaussians in tile order, transposed to `sums[k][lane]`; false when no
/// pair was written.
#[inline(always)]
fn gather<T: Lanes>(args: &Args, i: usize, sums: &mut [[f32; 16]; 16]) -> bool {
    let mut rows = [[0f32; 16]; 16];
    let mut touched = false;
    for lane in 0..T::N {
        if args.rects[i + lane] == NO_RECT {
            continue;
        }
        let (start, end) = (args.slot_base[i + lane] as usize, args.slot_base[i + lane + 1] as usize);
        // One vector of 16 or two of 8.
        let mut total = [T::splat(0.0); 2];
        for slot in start..end {
            if args.written[slot] != 0 {
                touched = true;
                total[0] = total[0] + T::load(&args.rows[slot]);
                if T::N == 8 {
                    total[1] = total[1] + T::load(&args.rows[slot][8..]);
                }
            }
        }
        total[0].store(&mut rows[lane]);
        if T::N == 8 {
            total[1].store(&mut rows[lane][8..]);
        }
    }
    if touched {
        if T::N == 16 {
            T::transpose(&rows, sums);
        } else {
            for lane in 0..T::N {
                for k in 0..16 {
                    sums[k][lane] = rows[lane][k];
                }
            }
        }
    }
    touched
}

#[inline(always)]
fn gather_extra(args: &Args, i: usize, rows: &[f32], out: &mut [f32]) {
    out.fill(0.0);
    let channels = out.len();
    for slot in args.slot_base[i] as usize..args.slot_base[i + 1] as usize {
        if args.written[slot] != 0 {
            for c in 0..channels {
                out[c] += rows[slot * channels + c];
            }
        }
    }
}

/// The chain rule through the projection, into `d` (one vector per parameter plane).
#[inline(always)]
unsafe fn chain<T: Lanes>(
    args: &Args,
    i: usize,
    f: &FrameLanes<T>,
    sums: &[[f32; 16]; 16],
    d: &mut [T; MOST],
    frames: Option<&mut [FrameGradient]>,
) {
    let view = args.view;
    let (zero, one, two) = (T::splat(0.0), T::splat(1.0), T::splat(2.0));
    macro_rules! sum {
        ($k:expr) => {
            T::load(&sums[T::SUM_AT[$k]])
        };
    }
    let g = unsafe { project_vector::<T>(&args.params, i, view, f) };

    // Colour, and through the viewing direction the mean.
    let (dir, recip_distance) = view_direction(&g.mean, f);
    let rgb = unsafe { colour::<T>(&args.params, i, args.sh1, &dir) };
    let mut d_mean = [zero; 3];
    let mut d_dir = [zero; 3];
    for k in 0..3 {
        let d_colour = sum!(k).keep(rgb[k].ge(zero));
        d[plane::SH0 + k] = d_colour * T::splat(SH_C0);
        if args.sh1 {
            let c1 = d_colour * T::splat(SH_C1);
            d[plane::SH1 + k] = zero - c1 * dir[1];
            d[plane::SH1 + 3 + k] = c1 * dir[2];
            d[plane::SH1 + 6 + k] = zero - c1 * dir[0];
            unsafe {
                d_dir[1] = c1.fnma(args.params.load(plane::SH1 + k, i), d_dir[1]);
                d_dir[2] = c1.fma(args.params.load(plane::SH1 + 3 + k, i), d_dir[2]);
                d_dir[0] = c1.fnma(args.params.load(plane::SH1 + 6 + k, i), d_dir[0]);
            }
        }
    }
    if args.sh1 {
        let along = dir[0].fma(d_dir[0], dir[1].fma(d_dir[1], dir[2] * d_dir[2]));
        for k in 0..3 {
            d_mean[k] = dir[k].fnma(along, d_dir[k]) * recip_distance;
        }
    }
    let d_centre = [zero - d_mean[0], zero - d_mean[1], zero - d_mean[2]];

    // Opacity: d ln(alpha) / d logit = 1 - o.
    let opacity = sigmoid(unsafe { args.params.load::<T>(plane::OPACITY, i) });
    d[plane::OPACITY] = sum!(4) * (one - opacity);

    // Screen mean and screen covariance.
    let recip_det = one / (g.a * g.c - g.b * g.b);
    let (ka, kb, kc) = (g.c * recip_det, zero - g.b * recip_det, g.a * recip_det);
    let (sx, sy) = (sum!(5), sum!(6));
    let (d_mx, d_my) = (ka.fma(sx, kb * sy), kb.fma(sx, kc * sy));
    let minus_half = T::splat(-0.5);
    let (ga, gb, gc) = (sum!(7) * minus_half, sum!(8) * minus_half, sum!(9) * minus_half);
    let (m00, m01) = (ka.fma(ga, kb * gb), ka.fma(gb, kb * gc));
    let (m10, m11) = (kb.fma(ga, kc * gb), kb.fma(gb, kc * gc));
    let d_a = zero - m00.fma(ka, m01 * kb);
    let d_b = zero - m00.fma(kb, m01 * kc);
    let d_c = zero - m10.fma(kb, m11 * kc);

    // S2 = T T', T = V S, V = U Q.
    let mut d_v = [[zero; 3]; 2];
    for k in 0..3 {
        let d_t0 = two * d_a.fma(g.t[0][k], d_b * g.t[1][k]);
        let d_t1 = two * d_b.fma(g.t[0][k], d_c * g.t[1][k]);
        d[plane::SCALES + k] = d_t0.fma(g.v[0][k], d_t1 * g.v[1][k]) * g.s[k];
        d_v[0][k] = d_t0 * g.s[k];
        d_v[1][k] = d_t1 * g.s[k];
    }
    let mut d_rot = [[zero; 3]; 3];
    let mut d_u = [[zero; 3]; 2];
    for a in 0..3 {
        for b in 0..3 {
            d_rot[a][b] = g.u[0][a].fma(d_v[0][b], g.u[1][a] * d_v[1][b]);
        }
        for e in 0..2 {
            d_u[e][a] = d_v[e][0].fma(g.rot[a][0], d_v[e][1].fma(g.rot[a][1], d_v[e][2] * g.rot[a][2]));
        }
    }
    let d_q = quat_gradient(&g.q, &d_rot);
    let along = g.q[0].fma(d_q[0], g.q[1].fma(d_q[1], g.q[2].fma(d_q[2], g.q[3] * d_q[3])));
    for k in 0..4 {
        d[plane::QUATS + k] = g.q[k].fnma(along, d_q[k]) * g.recip_norm;
    }

    // U = J R: through J to the position in the camera frame.
    let (fx, fy) = (T::splat(view.fx), T::splat(view.fy));
    macro_rules! dot_row {
        ($u:expr, $r:expr) => {
            $u[0].fma($r[0], $u[1].fma($r[1], $u[2] * $r[2]))
        };
    }
    let (d_j00, d_j02) = (dot_row!(d_u[0], f.r[0]), dot_row!(d_u[0], f.r[2]));
    let (d_j11, d_j12) = (dot_row!(d_u[1], f.r[1]), dot_row!(d_u[1], f.r[2]));
    let (fx_z, fy_z) = (fx * g.rz, fy * g.rz);
    let (fx_zz, fy_zz) = (fx_z * g.rz, fy_z * g.rz);
    let (x_z, y_z) = (g.x * g.rz, g.y * g.rz);
    let d_x = d_mx * fx_z - d_j02 * fx_zz;
    let d_y = d_my * fy_z - d_j12 * fy_zz;
    let by_mean = (d_mx * fx_zz) * g.x + (d_my * fy_zz) * g.y;
    let by_diagonal = d_j00.fma(fx_zz, d_j11 * fy_zz);
    let by_last_column = two * (d_j02 * fx_zz).fma(x_z, d_j12 * fy_zz * y_z);
    let d_z = sum!(3) - by_mean - by_diagonal + by_last_column;
    for k in 0..3 {
        d_mean[k] = d_x.fma(f.r[0][k], d_y.fma(f.r[1][k], d_z.fma(f.r[2][k], d_mean[k])));
        d[plane::MEANS + k] = d_mean[k];
    }

    // Frame sums: x = R m + t and U = J R.
    if let Some(frames) = frames {
        let d_x_camera = [d_x, d_y, d_z];
        let (j02, j12) = (zero - fx_z * x_z, zero - fy_z * y_z);
        let mut sums = [zero; 15];
        for k in 0..3 {
            sums[k] = d_x.fma(g.mean[k], fx_z * d_u[0][k]);
            sums[3 + k] = d_y.fma(g.mean[k], fy_z * d_u[1][k]);
            sums[6 + k] = d_z.fma(g.mean[k], j02.fma(d_u[0][k], j12 * d_u[1][k]));
            sums[9 + k] = d_x_camera[k];
            sums[12 + k] = d_centre[k];
        }
        add_frame_sums(&sums, i, f.group, args.groups, frames);
    }
}

#[inline(always)]
fn add_frame_sums<T: Lanes>(
    sums: &[T; 15],
    i: usize,
    group: Option<usize>,
    groups: &[u16],
    frames: &mut [FrameGradient],
) {
    for (k, sum) in sums.iter().enumerate() {
        if let Some(group) = group {
            frames[group][k] += f64::from(sum.sum());
        } else {
            let mut lanes = [0f32; 16];
            sum.store(&mut lanes);
            for lane in 0..T::N {
                frames[groups[i + lane] as usize][k] += f64::from(lanes[lane]);
            }
        }
    }
}

/// dL/dq (unit q, before the normalisation) from dL/dQ.
#[inline(always)]
fn quat_gradient<T: Lanes>(q: &[T; 4], d: &[[T; 3]; 3]) -> [T; 4] {
    let two = T::splat(2.0);
    let [w, x, y, z] = *q;
    // Antisymmetric and symmetric parts of dL/dQ.
    let (rx, ry, rz) = (d[2][1] - d[1][2], d[0][2] - d[2][0], d[1][0] - d[0][1]);
    let (xy, xz, yz) = (d[0][1] + d[1][0], d[0][2] + d[2][0], d[1][2] + d[2][1]);
    [
        two * x.fma(rx, y.fma(ry, z * rz)),
        two * (y.fma(xy, z.fma(xz, w * rx)) - two * x * (d[1][1] + d[2][2])),
        two * (x.fma(xy, z.fma(yz, w * ry)) - two * y * (d[0][0] + d[2][2])),
        two * (x.fma(xz, y.fma(yz, w * rz)) - two * z * (d[0][0] + d[1][1])),
    ]
}
