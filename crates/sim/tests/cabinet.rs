//! A hand-written cabinet: a good one passes, a jammed one is found out.

use hingecast_sim::{CheckConfig, check_file};

fn cabinet(extra: &str) -> String {
    format!(
        r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="base"><geom type="box" size=".2 .2 .2"/>
    <body name="door" pos="-.2 .22 0"><joint name="hinge" type="hinge" axis="0 0 1" range="0 1.5" damping=".05"/>
      <geom type="box" size=".2 .01 .2" pos=".2 0 0"/></body></body>
  {extra}
</worldbody></mujoco>"#
    )
}

#[test]
fn a_free_door_sweeps_its_range() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("robot.xml");
    std::fs::write(&path, cabinet("")).unwrap();
    let check = check_file(&path, &CheckConfig::default()).unwrap();
    assert_eq!(check.doubts(0.7), Vec::<String>::new());
    assert!(check.sweeps[0].reached > 0.99 && check.sweeps[0].worst_lag < 0.01, "{:?}", check.sweeps);
}

#[test]
fn a_door_against_a_wall_is_a_doubt() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("robot.xml");
    std::fs::write(&path, cabinet(r#"<geom name="wall" type="box" size=".5 .01 .5" pos="0 .35 0"/>"#)).unwrap();
    let check = check_file(&path, &CheckConfig::default()).unwrap();
    assert!(check.sweeps[0].reached < 0.8, "{:?}", check.sweeps);
    assert!(check.doubts(0.7).iter().any(|d| d.contains("hinge")));
}

#[test]
fn a_file_that_is_no_model_is_an_error_of_three_lines() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("robot.xml");
    std::fs::write(&path, "<mujoco><worldbody><body><geom type=\"box\"/></body></worldbody></mujoco>").unwrap();
    let message = check_file(&path, &CheckConfig::default()).unwrap_err().to_string();
    assert_eq!(message.lines().count(), 3, "{message}");
}
