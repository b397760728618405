//! scratch
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let mut r = hingecast_capture::Recording::open(std::path::Path::new(&a[1])).unwrap();
    let p = hingecast_geom::Progress::default();
    let folder = hingecast_capture::recording::masked::new_folder(&r).unwrap();
    let rep = hingecast::prepare::find_masks(&mut r, &hingecast::prepare::Wanted::Moving, &folder, 0, &p).unwrap();
    for d in rep.doubts {
        println!("doubt: {d}");
    }
}
