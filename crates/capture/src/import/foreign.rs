//! Files that are not read: whose they are, and what turns them into something that is.

use crate::CaptureError;
use std::path::Path;

const MODEL: &str = "a finished model, without pictures and depth";
const RAW: &str = "export the recording instead: Record3D (.r3d), Polycam (raw data), 3D Scanner App (All Data)";
const ROS: &str = "a recording of ROS or RealSense: pictures without poses";
const FILM: &str = "a film without depth and poses";
const APPS: &str =
    "record with an app that keeps depth, such as Record3D or Stray Scanner, and give all that it exports";
const ZED: &str = "a film of a ZED camera";
const ZED_TOOL: &str = "ZED_SVO_Export FILE DIR/ 4 gives pictures and 16-bit depth, the ZED SDK's tracking the poses; \
                        write both as docs/recordings.md says";
const RTABMAP: &str = "rtabmap-export --images --poses_camera --poses_format 1 --output_dir DIR DB \
                       gives pictures, depth (mm) and poses; write them as docs/recordings.md says";

/// Ending, what it is, what to do.
const FOREIGN: [(&str, &str, &str); 13] = [
    (
        "mkv",
        "a film of Azure Kinect or Femto: depth is not aligned to colour, and there are no poses",
        "k4a_mkv2image -i=FILE -t=true takes it apart and aligns depth; let COLMAP find the poses of the pictures, put \
         depth/ beside images/, and import that folder",
    ),
    (
        "bag",
        ROS,
        "rs-convert -i FILE -p DIR/rgb takes a RealSense bag apart; with poses: play it into RTAB-Map, then RTABMAP",
    ),
    ("mcap", ROS, "play it into RTAB-Map (ros2 bag play FILE), then RTABMAP"),
    ("db3", ROS, "play it into RTAB-Map (ros2 bag play FILE), then RTABMAP"),
    ("db", "a database of RTAB-Map or COLMAP", "COLMAP: give the folder that holds its model. RTAB-Map: RTABMAP"),
    ("svo", ZED, ZED_TOOL),
    ("svo2", ZED, ZED_TOOL),
    ("usdz", MODEL, RAW),
    ("glb", MODEL, RAW),
    ("obj", MODEL, RAW),
    ("ply", MODEL, RAW),
    ("mp4", FILM, APPS),
    ("mov", FILM, APPS),
];

/// Why this file is not read, if it is one of those that people try.
pub(super) fn refuse(file: &Path) -> Option<CaptureError> {
    let ending = file.extension()?.to_str()?.to_ascii_lowercase();
    let (_, what, hint) = FOREIGN.iter().find(|(e, ..)| *e == ending)?;
    let name = file.display().to_string();
    Some(CaptureError::new(
        format!(".{ending} is not read: it is {what}"),
        name.clone(),
        hint.replace("RTABMAP", RTABMAP).replace("FILE", &name),
    ))
}

/// A zip without a recording in it.
pub(super) fn zip_of_something_else(file: &Path) -> CaptureError {
    CaptureError::new(
        "the zip file holds no recording that is known",
        file.display().to_string(),
        "export raw data: Record3D (.r3d or EXR + RGBD), Polycam (raw data, developer mode), 3D Scanner App \
         (All Data), Stray Scanner",
    )
}

/// The first file of a folder that is not read, for a folder in which nothing else is known.
pub(super) fn inside(folder: &Path) -> Option<CaptureError> {
    let mut files: Vec<_> = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
    files.sort();
    files.iter().filter(|f| f.is_file()).find_map(|f| refuse(f))
}
