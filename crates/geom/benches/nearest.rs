//! Look-ups in a kd-tree, and building it. `cargo bench -p hingecast-geom`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::Vec3;
use hingecast_geom::PointTree;

/// Points: those of a coarse cloud, and gaussians of a usual fit.
const SIZES: [usize; 2] = [2_000, 20_000];
/// Questions in one run.
const ASKED: usize = 1000;

fn main() {
    divan::main();
}

/// Points on a sphere: surfaces, not volumes, are what trees are made of here.
fn cloud(n: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut number = || 2.0 * rng.f32() - 1.0;
    (0..n).map(|_| Vec3::new(number(), number(), number()).normalize_or(Vec3::X)).collect()
}

#[divan::bench(args = SIZES)]
fn build(bencher: Bencher, n: usize) {
    let points = cloud(n, 1);
    bencher.counter(ItemsCount::new(n)).bench(|| PointTree::new(black_box(&points)));
}

#[divan::bench(args = SIZES)]
fn nearest(bencher: Bencher, n: usize) {
    let (tree, asked) = (PointTree::new(&cloud(n, 1)), cloud(ASKED, 2));
    let sum = || asked.iter().filter_map(|x| tree.nearest(black_box(*x))).map(|found| found.1).sum::<f32>();
    bencher.counter(ItemsCount::new(ASKED)).bench(sum);
}

#[divan::bench(args = SIZES)]
fn eight_nearest(bencher: Bencher, n: usize) {
    let (tree, asked) = (PointTree::new(&cloud(n, 1)), cloud(ASKED, 2));
    let count = || asked.iter().map(|x| tree.k_nearest(black_box(*x), 8).len()).sum::<usize>();
    bencher.counter(ItemsCount::new(ASKED)).bench(count);
}
