//! Few convex pieces for collision.
//!
//! A surface is turned to the axes along which it is made, and cut along them, where its section
//! changes, until every piece's convex hull keeps to the surface (in the manner of Lien and Amato,
//! Approximate convex decomposition of polyhedra, 2007). Then neighbours whose common hull keeps to
//! it too become one again: a board is one piece, however often it was cut. What is nearly a box
//! becomes one, which simulators like best.

mod cell;
mod convex;
mod cuts;
mod frame;
mod join;
mod room;

use cell::Cell;
use convex::Convex;
use hingecast_geom::TriMesh;
use room::Room;

/// How closely pieces follow the surface.
#[derive(Clone, Copy, Debug)]
pub struct Config {
    /// How far pieces may stand out of the surface, unit of the mesh. What they hold farther out
    /// should be less than 1 % of them.
    pub reach: f32,
    /// Most pieces; to keep to that, they stand out as far as it takes.
    pub most: usize,
}

/// Cells that a surface is cut into at most, before they are joined; fewer where few pieces are asked.
const CELLS: usize = 160;
const CELLS_OF_A_PIECE: usize = 7;
/// Share of a piece that may lie farther outside than it may reach.
const OUTSIDE: f64 = 0.01;
/// Share of the whole that is too small to cut for.
const CRUMB: f64 = 3e-4;
/// Share of the whole that one piece less is worth.
const WORTH: f64 = 5e-3;
/// Hulls are smoothed by this share of the reach.
const SMOOTHED: f32 = 0.5;

/// What a run of the decomposition is measured against.
struct Bounds {
    room: Room,
    most: usize,
    /// Volume of the whole.
    whole: f64,
}

impl Bounds {
    /// Volume of a place of the room.
    fn place(&self) -> f64 {
        f64::from(self.room.cell).powi(3)
    }

    /// What a piece holds of the outside, beyond its reach: a volume.
    fn outside(&self, piece: &Convex) -> f64 {
        self.place() * piece.holds(&self.room.outside, usize::MAX) as f64
    }

    fn may_hold(&self, piece: &Convex) -> f64 {
        (OUTSIDE * piece.volume).max(CRUMB * self.whole)
    }

    fn fits(&self, piece: &Convex) -> bool {
        let most = (self.may_hold(piece) / self.place()) as usize;
        piece.holds(&self.room.outside, most + 1) <= most
    }
}

/// Convex pieces that together cover what `mesh` encloses; of what is a sheet, thin plates.
pub fn decompose(mesh: &TriMesh, config: &Config) -> Vec<TriMesh> {
    let axes = frame::axes(mesh);
    let mut along = mesh.clone();
    along.vertices.iter_mut().for_each(|v| *v = axes.transpose() * *v);
    let mut pieces = pieces(&along, config).unwrap_or_default();
    // The largest first, so that lists read well.
    pieces.sort_by(|a, b| b.volume.total_cmp(&a.volume));
    let back = |piece: Convex| {
        let mut mesh = piece.mesh;
        mesh.vertices.iter_mut().for_each(|v| *v = axes * *v);
        mesh
    };
    pieces.into_iter().map(back).collect()
}

fn pieces(mesh: &TriMesh, config: &Config) -> Option<Vec<Convex>> {
    let room = Room::around(mesh, config.reach)?;
    let first = Cell::whole(mesh, &room)?;
    let whole = mesh.mass_integrals().volume.max(room.volume);
    let bounds = Bounds { room, most: config.most.max(1), whole };
    let mut open = vec![(bounds.outside(&first.hull), first)];
    let mut done: Vec<Convex> = Vec::new();
    let cells = CELLS.min(CELLS_OF_A_PIECE * bounds.most);
    let mut cut = 0;
    // The worst first.
    while let Some(k) = (0..open.len()).max_by(|&a, &b| open[a].0.total_cmp(&open[b].0)) {
        let (outside, cell) = open.swap_remove(k);
        cut += 1;
        let enough = outside <= bounds.may_hold(&cell.hull) || done.len() + open.len() + 1 >= cells || cut > 3 * cells;
        match if enough { None } else { cuts::best(&cell, &bounds.room) } {
            Some(sides) => {
                open.extend(sides.into_iter().flatten().map(|side| (bounds.outside(&side.hull), side)));
            }
            None => done.push(cell.hull),
        }
    }
    let joined = join::join(done, &bounds);
    let smooth = |piece: Convex| piece.as_box(&bounds).unwrap_or_else(|| piece.smoothed(SMOOTHED * config.reach));
    Some(joined.into_iter().map(smooth).collect())
}

#[cfg(test)]
mod tests;
