//! Cameras that stand where none can: one number of a pose that is off by powers of ten would make
//! the object's surroundings as large.

use glam::DVec3;

/// A person walks around a thing: the farthest camera is a few times as far as the usual one. So many
/// times is no walk.
const TIMES: f64 = 200.0;
/// Beyond this the numbers of a pose have no millimetres left in single precision, scene units.
const FARTHEST: f64 = 1e7;

/// Indices of the cameras that stand absurdly far from the others, ascending, and what to say.
pub(super) fn cameras(centres: &[DVec3]) -> Vec<(usize, String)> {
    let middle = middle(centres);
    let usual = median(centres.iter().map(|c| c.distance(middle)).collect());
    let stray = |(i, c): (usize, &DVec3)| {
        let far = c.distance(middle);
        let lonely = centres.len() > 2 && usual > 0.0 && far > TIMES * usual;
        if !(c.abs().max_element() <= FARTHEST) {
            let at = c.to_array().map(|x| format!("{x:.3e}")).join(" ");
            Some((i, format!("a camera stands at {at}: farther than {FARTHEST:.0e} from the origin")))
        } else if lonely {
            Some((i, format!("a camera stands {far:.3e} from the others, which stand within {usual:.3}")))
        } else {
            None
        }
    };
    centres.iter().enumerate().filter_map(stray).collect()
}

/// The upper median; 0 of nothing.
pub(crate) fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}

/// Medians of the three coordinates.
pub(crate) fn middle(points: &[DVec3]) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| median(points.iter().map(|p| p[k]).collect())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_camera_of_another_world_is_found_and_a_long_walk_is_not() {
        let ring = |k: i32| DVec3::new((0.7 * f64::from(k)).cos(), (0.7 * f64::from(k)).sin(), 0.4);
        let mut all: Vec<DVec3> = (0..9).map(ring).collect();
        all.push(DVec3::new(9.0, 0.0, 1.0));
        assert_eq!(cameras(&all), vec![]);
        for far in [1e3, 1e9, 1e300, f64::INFINITY] {
            all[4].x = far;
            let found = cameras(&all);
            assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), [4], "{far}");
        }
        // All at one place is another mistake, and has another finding.
        assert_eq!(cameras(&[DVec3::ONE; 5]), vec![]);
    }
}
