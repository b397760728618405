//! A view whose surface lies nowhere near the others' of its state: one camera pose is wrong. The
//! cameras alone do not tell, a person may walk far; what they saw does.

use super::pixels::Look;
use super::{Finding, Fix, address, error};
use crate::recording::stray::{median, middle};
use crate::recording::transforms::Document;
use crate::{CaptureError, Recording, Split};
use glam::DVec3;

/// What a view saw may lie as many times as far from what the others saw as these are spread and
/// deep: a room is a few times as large as the part of it in one picture.
const TIMES: f64 = 6.0;
/// Points of a view, views of a state, that must be there.
const FEWEST: [usize; 2] = [20, 4];

/// One finding a view.
pub(super) fn views(documents: &[Document], recording: &Recording, looks: &[Option<Look>], out: &mut Vec<Finding>) {
    for state in 0..recording.n_states {
        let mut seen: Vec<(usize, DVec3, f64)> = Vec::new();
        for i in recording.frames_of(state, Split::Train) {
            let camera = &recording.frames[i].camera;
            let points = looks[i].as_ref().map_or(Vec::new(), |l| l.points(camera, 1.0));
            if points.len() >= FEWEST[0] {
                let middle = middle(&points);
                seen.push((i, middle, middle.distance(camera.centre())));
            }
        }
        if seen.len() < FEWEST[1] {
            continue;
        }
        let all = middle(&seen.iter().map(|s| s.1).collect::<Vec<_>>());
        let usual = median(seen.iter().map(|(_, at, deep)| at.distance(all) + deep).collect());
        for (i, at, _) in seen {
            let far = at.distance(all);
            if far > TIMES * usual {
                let (file, index, place) = address(documents, recording, i);
                let what = format!(
                    "what an image saw lies {far:.2} from what the others of its state saw, which is within {usual:.2}"
                );
                let hint = "leave the frame out, or correct its transform_matrix";
                let fix = Some(Fix::DropFrame { file, index });
                out.push(Finding { fix, ..error("view-apart", CaptureError::new(what, place, hint)) });
            }
        }
    }
}
