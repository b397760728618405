//! Lets the binary and its tests find libmujoco in the repository's ignored folder at run time.
fn main() {
    println!("cargo:rerun-if-env-changed=MUJOCO_DYNAMIC_LINK_DIR");
    if let (Ok(dir), Ok(_)) = (std::env::var("MUJOCO_DYNAMIC_LINK_DIR"), std::env::var("CARGO_FEATURE_MUJOCO")) {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{dir}");
    }
}
