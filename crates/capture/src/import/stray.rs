//! Stray Scanner (iPhone, iPad): `rgb.mp4`, `depth/%06d.png` (16 bits, millimetres; `.npy` in old
//! versions), `confidence/%06d.png` (0, 1, 2), `odometry.csv`, `camera_matrix.csv`.
//!
//! Row i of odometry.csv belongs to picture i of the film, whatever its time says. Its columns:
//! timestamp, frame, x y z, qx qy qz qw (camera-to-world, OpenCV axes, y up, metres) and, in new
//! versions, fx fy cx cy of the film's pixels; two more may be empty. camera_matrix.csv is that of
//! the last frame. Pictures that somebody took out of the film already (`rgb/` or `images/`) are
//! taken instead of it.

use super::grid::Grid;
use super::numbers::{numbered, rigid, rows, wrong};
use super::{Shot, Source};
use crate::CaptureError;
use glam::DVec3;
use hingecast_geom::{Camera, Pose};
use std::path::{Path, PathBuf};

pub(super) fn read(src: &Path) -> Result<Source, CaptureError> {
    let file = src.join("odometry.csv");
    let table = Table::read(&file)?;
    let matrix = src.join("camera_matrix.csv");
    let last = if matrix.is_file() { Some(camera_matrix(&matrix)?) } else { None };
    let pictures = Pictures::find(src, table.rows.len())?;

    let mut source = Source { metric: true, up: DVec3::Y, ..Vec::new().into() };
    let (mut without_depth, mut without_picture) = (0, 0);
    for (i, row) in table.rows.iter().enumerate() {
        let place = format!("row {i}");
        let numbers = ["qx", "qy", "qz", "qw", "x", "y", "z"].map(|key| table.number(row, key).unwrap_or(f64::NAN));
        let world_from_camera: Pose = rigid(&numbers, &file, &place)?;
        let own = ["fx", "fy", "cx", "cy"].map(|key| table.number(row, key));
        let [fx, fy, cx, cy] = match (own, last) {
            ([Some(fx), Some(fy), Some(cx), Some(cy)], _) => [fx, fy, cx, cy],
            (_, Some(k)) => k,
            _ => return Err(wrong(&file, &format!("{place}: fx fy cx cy"), "numbers, here or in camera_matrix.csv")),
        };
        let Some((color, film_frame)) = pictures.of(i) else {
            without_picture += 1;
            continue;
        };
        let camera = Camera { width: 0, height: 0, fx, fy, cx, cy, camera_from_world: world_from_camera.inverse() };
        let frame = table.number(row, "frame").map_or(i, |n| n as usize);
        let map = |folder: &str| {
            let with = |ending: &str| src.join(folder).join(format!("{frame:06}.{ending}"));
            ["png", "npy"].map(with).into_iter().find(|p| p.is_file()).map(Grid::File)
        };
        let depth = map("depth");
        without_depth += usize::from(depth.is_none());
        source.shots.push(Shot {
            depth,
            confidence: map("confidence"),
            time: table.number(row, "timestamp"),
            film_frame,
            ..Shot::of(camera, color)
        });
    }
    if without_picture > 0 {
        source.notes.push(format!("{without_picture} rows of odometry.csv have no picture: left out"));
    }
    if without_depth > 0 {
        source.notes.push(format!("{without_depth} of {} pictures have no depth", source.shots.len()));
    }
    Ok(source)
}

/// A csv file with a header; blanks after commas do not count.
struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(file: &Path) -> Result<Self, CaptureError> {
        let text = std::fs::read_to_string(file).map_err(|e| CaptureError::read(file, e))?;
        let cells = |line: &str| line.split(',').map(|cell| cell.trim().to_string()).collect::<Vec<_>>();
        let mut lines = text.lines().filter(|line| !line.trim().is_empty());
        let columns = cells(lines.next().unwrap_or_default());
        if !["x", "y", "z", "qx", "qy", "qz", "qw"].iter().all(|key| columns.iter().any(|c| c == key)) {
            return Err(wrong(
                file,
                "the first line",
                "the names of columns: timestamp, frame, x, y, z, qx, qy, qz, qw",
            ));
        }
        Ok(Self { columns, rows: lines.map(cells).collect() })
    }

    /// A finite number of a row; `None` where the cell is empty or the column is not there.
    fn number(&self, row: &[String], column: &str) -> Option<f64> {
        let at = self.columns.iter().position(|c| c == column)?;
        row.get(at)?.parse().ok().filter(|x: &f64| x.is_finite())
    }
}

/// fx fy cx cy of a 3 x 3 matrix.
fn camera_matrix(file: &Path) -> Result<[f64; 4], CaptureError> {
    let text = std::fs::read_to_string(file).map_err(|e| CaptureError::read(file, e))?;
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    let flat: Vec<f64> = words.filter_map(|w| w.parse().ok()).collect();
    let k = rows::<3>(&flat).ok_or_else(|| wrong(file, "the matrix", "3x3 finite numbers"))?;
    Ok([k[0][0], k[1][1], k[0][2], k[1][2]])
}

/// Where the colour pictures are.
enum Pictures {
    Film(PathBuf),
    /// By row of odometry.csv.
    Files(Vec<(usize, PathBuf)>),
}

impl Pictures {
    fn find(src: &Path, rows: usize) -> Result<Self, CaptureError> {
        for folder in ["rgb", "images"].map(|name| src.join(name)) {
            let mut files = numbered(&folder, &["png", "jpg", "jpeg"]);
            let Some((first, _)) = files.first() else { continue };
            // ffmpeg counts from 1 unless told otherwise.
            match first {
                1 if files.len() == rows => files.iter_mut().for_each(|(n, _)| *n -= 1),
                1 => {
                    return Err(CaptureError::new(
                        format!(
                            "which row a picture belongs to is unclear: {} pictures from number 1, {rows} rows",
                            files.len()
                        ),
                        folder.display().to_string(),
                        format!(
                            "number them from 0, as rows are: {}",
                            super::film::command(&src.join("rgb.mp4"), &folder)
                        ),
                    ));
                }
                _ => {}
            }
            return Ok(Self::Files(files));
        }
        let film = src.join("rgb.mp4");
        if !film.is_file() {
            let hint = "copy the whole folder of the scan: rgb.mp4, or its pictures in rgb/";
            return Err(CaptureError::new("there is no film", film.display().to_string(), hint));
        }
        Ok(Self::Film(film))
    }

    /// The file of row `i`, and which picture it is of a film.
    fn of(&self, i: usize) -> Option<(PathBuf, Option<usize>)> {
        match self {
            Self::Film(film) => Some((film.clone(), Some(i))),
            Self::Files(files) => {
                let at = files.binary_search_by_key(&i, |(n, _)| *n).ok()?;
                Some((files[at].1.clone(), None))
            }
        }
    }
}
