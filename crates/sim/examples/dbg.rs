use hingecast_sim::*;
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let a: Vec<String> = std::env::args().collect();
    let path = object::model_file(a[1].as_ref())?;
    let made = trial::make_task(&path, TaskKind::Open, None, a.get(2).map(|s| s.parse().unwrap()))?;
    println!(
        "{} worked {}/{} place {:?}\n grasp {:?} approach {:?} closing {:?} width {} turn {}",
        made.task.joint,
        made.worked,
        made.of,
        made.task.place,
        made.task.grasp.trans,
        made.task.place.rot * made.task.grasp.rot * glam::DVec3::Z,
        made.task.place.rot * made.task.grasp.rot * glam::DVec3::Y,
        made.task.width,
        made.task.turn_wrist
    );
    let scene = Scene::new(&SceneConfig { object: path, spoil: vec![], visuals: false }, &made.task)?;
    let mut env = Env::new(&scene);
    for seed in 0..6 {
        env.reset(seed);
        let mut e = Expert::new(seed);
        for t in 0..400 {
            let act = e.act(&env);
            if t % 25 == 0 {
                println!(
                    "{seed} {t} {} grip {:.3?} z {:.2?} grasp {:.3?} d {:.3} moved {:.2} q {:.2?}",
                    e.phase_name(),
                    env.grip().trans.to_array(),
                    (env.grip().rot * glam::DVec3::Z).to_array(),
                    env.grasp().trans.to_array(),
                    env.grip().trans.distance(env.grasp().trans),
                    env.moved(),
                    &env.state()[1..8]
                );
            }
            env.step(&act)?;
            if env.success() {
                break;
            }
        }
        println!("{:?}", env.outcome());
    }
    Ok(())
}
