use hingecast::config::*;
use hingecast_articulate::screw::{cloud::*, discover::*, evidence::*, space::Lattice};
use hingecast_capture::*;
use rayon::prelude::*;
fn main() {
    let path = std::path::PathBuf::from(std::env::args().nth(1).unwrap());
    let rec = Recording::open(&path).unwrap();
    let cache = ViewCache::new(&rec, 2000 << 20);
    let _ = Config::default();
    let t0 = std::time::Instant::now();
    let views_of = |s: usize| -> Vec<DepthView> {
        let frames = rec.frames_of(s, Split::Train);
        frames.par_iter().map(|&f| {
            let v = cache.get(f).unwrap();
            let class = (0..v.mask.len()).map(|i| if v.usable[i]==0 {UNKNOWN} else if v.mask[i]==1 { if v.depth[i]>0.0 {OBJECT} else {UNKNOWN} } else if v.depth[i]>0.0 {UNKNOWN} else {BACKGROUND}).collect();
            DepthView{camera: v.camera, depth: v.depth.clone(), class}
        }).collect()
    };
    // extent
    let (mut lo, mut hi) = (glam::Vec3::splat(1e9), glam::Vec3::splat(-1e9));
    for s in 0..rec.n_states {
        for v in views_of(s) {
            for i in (0..v.depth.len()).step_by(37) { if v.class[i]==OBJECT {
                let x = v.camera.unproject(glam::DVec2::new((i % v.camera.width) as f64+0.5,(i/v.camera.width) as f64+0.5), v.depth[i] as f64).as_vec3();
                lo=lo.min(x); hi=hi.max(x);
            }}
        }
    }
    eprintln!("load {:.1}", t0.elapsed().as_secs_f64());
    let lattice = Lattice::new(lo, hi, 96);
    let mut ev = Evidence::gather::<()>(rec.n_states, lattice, &mut |s| { let mut v = views_of(s); let sp = hingecast_articulate::screw::cameras::align(&mut v, lattice.voxel); if s % 8 == 0 { eprintln!("spread {:?} voxel {}", sp, lattice.voxel); } if s == 0 { let truth = Truth::open(&Truth::folder_of(&path)).unwrap(); let fr = rec.frames_of(0, Split::Train); let (mut a, mut b) = (0.0, 0.0); for (k, &f) in fr.iter().enumerate() { let t = truth.cameras[f].camera_from_world; a += (rec.frames[f].camera.camera_from_world * t.inverse()).angle().to_degrees(); b += (v[k].camera.camera_from_world * t.inverse()).angle().to_degrees(); } eprintln!("camera deg before {:.3} after {:.3}", a / fr.len() as f64, b / fr.len() as f64); } Ok(v) }, 0).unwrap();
    eprintln!("evidence {:.1}  samples {} clouds {:?} voxel {}", t0.elapsed().as_secs_f64(), ev.samples.len(), ev.clouds.iter().map(|c| c.points.len()).take(3).collect::<Vec<_>>(), lattice.voxel);
    if std::env::var_os("TRUTHGAIN").is_some() {
        use hingecast_articulate::screw::jury::Jury;
        let truth = Truth::open(&Truth::folder_of(&path)).unwrap();
        let v = vec![ev.judge(&vec![hingecast_geom::Pose::IDENTITY; rec.n_states])];
        ev.mark_taken(&[vec![hingecast_geom::Pose::IDENTITY; rec.n_states]]);
        let open: Vec<usize> = (0..ev.samples.len()).filter(|&i| v[0][i].against != 0).collect();
        let jury = Jury::new(&ev, &open, &v, 0);
        for j in &truth.tree.joints {
            let own: Vec<_> = (0..rec.n_states).map(|s| j.screw.motion(j.values[s])).collect();
            eprintln!("TRUE {} {:?} axis {:.3} at {:.3}: loose {:.0} tight {:.0} open {}", j.name, j.screw.kind, j.screw.axis, j.screw.pivot, jury.gain(&ev, &own, false), jury.gain(&ev, &own, true), open.len());
            let w = ev.judge(&own); eprintln!("   explains {}", open.iter().filter(|&&i| w[i].against==0 && w[i].support!=0).count());
        }
    }
    let d = discover(&mut ev, 12, 0, &Default::default()).unwrap();
    eprintln!("discover {:.1}  unexplained {:.4}", t0.elapsed().as_secs_f64(), d.unexplained);
    let st = hingecast_articulate::screw::settle::settle(&mut ev, &d, 0);
    eprintln!("settle {:.1} noise {} rms {} sigmas {:?}", t0.elapsed().as_secs_f64(), ev.tolerance, st.report.rms, st.report.sigmas);
    for (s, r) in st.rig.iter().enumerate() { if s % 4 == 0 { eprintln!("rig {s} {:.4} deg {:.4}", r.angle().to_degrees(), r.trans.length()); } }
    let d = st;
    let truth = Truth::open(&Truth::folder_of(&path)).unwrap();
    let mut tt = truth.tree.joints.clone();
    println!("{}: {} of {} parts", truth.object, d.tree.joints.len(), tt.len());
    for j in &d.tree.joints {
        // best true joint by axis+pivot+values
        let cost = |t: &hingecast_geom::Joint| {
            let mut c = if t.screw.kind.turns() != j.screw.kind.turns() { 10.0 } else { 0.0 };
            c += t.screw.axis.cross(j.screw.axis).length();
            if t.screw.kind.turns() { c += t.screw.distance(j.screw.pivot); }
            let sgn = if t.screw.axis.dot(j.screw.axis) < 0.0 {-1.0} else {1.0};
            c += (0..rec.n_states).map(|s| (sgn*(t.values[s]-t.values[0])-j.values[s]).abs()).sum::<f64>()/rec.n_states as f64;
            c
        };
        if tt.is_empty() { println!("  extra {:?}", j.screw); continue; }
        let b = (0..tt.len()).min_by(|a,b| cost(&tt[*a]).total_cmp(&cost(&tt[*b]))).unwrap();
        let t = tt.remove(b);
        let sgn = if t.screw.axis.dot(j.screw.axis) < 0.0 {-1.0} else {1.0};
        let dq = (0..rec.n_states).map(|s| (sgn*(t.values[s]-t.values[0])-j.values[s]).abs()).sum::<f64>()/rec.n_states as f64;
        eprintln!("  ERR {:.4?}", (0..rec.n_states).map(|s| j.values[s]-sgn*(t.values[s]-t.values[0])).collect::<Vec<_>>());
        eprintln!("  VAL {:.3?}", (0..rec.n_states).map(|s| t.values[s]).collect::<Vec<_>>());
        let dist = { let n = t.screw.axis.cross(j.screw.axis); let v=j.screw.pivot-t.screw.pivot; if n.length()<1e-6 {v.cross(t.screw.axis).length()} else {(n.dot(v)).abs()/n.length()} };
        println!("  {:?} true {:?}: axis {:.3} deg  pos {:.5} pivotline {:.5}  dq {:.5} parent {}", j.screw.kind, t.screw.kind, t.screw.axis.cross(j.screw.axis).length().clamp(-1.0,1.0).asin().to_degrees(), dist, t.screw.distance(j.screw.pivot), dq, j.parent);
    }
    for t in tt { println!("  MISSED {:?}", t.screw); }
}
