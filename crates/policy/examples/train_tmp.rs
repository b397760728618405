use hingecast_policy::train::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let demos = hingecast_policy::demos::read(a[1].as_ref()).unwrap();
    let mut c = TrainConfig::preset(Preset::BcRnnFast);
    c.seed = a[3].parse().unwrap();
    let folder = std::path::Path::new(&a[2]);
    let t = std::time::Instant::now();
    let r = train(&demos, &c, folder, &Default::default()).unwrap();
    std::fs::write(folder.join("env_args.json"), serde_json::to_string_pretty(&demos.env_args).unwrap()).unwrap();
    println!("{:?} {:?} {:.0} s", r.last(), r.parameters, t.elapsed().as_secs_f64());
}
