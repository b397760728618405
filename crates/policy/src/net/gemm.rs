//! Matrix products, on row-major matrices and their transposes.

use rayon::prelude::*;

/// A row-major matrix, read as it is or transposed.
#[derive(Clone, Copy)]
pub struct Matrix<'a> {
    data: &'a [f32],
    rows: usize,
    columns: usize,
    /// Distance between rows and between columns.
    strides: [isize; 2],
}

impl<'a> Matrix<'a> {
    /// `data` as a (rows, columns) matrix.
    ///
    /// # Panics
    /// When `data` does not have rows x columns numbers.
    pub fn new(data: &'a [f32], rows: usize, columns: usize) -> Self {
        assert_eq!(data.len(), rows * columns);
        Self { data, rows, columns, strides: [columns as isize, 1] }
    }

    /// The same numbers as a (columns, rows) matrix; nothing is copied.
    pub fn transposed(self) -> Self {
        Self { rows: self.columns, columns: self.rows, strides: [self.strides[1], self.strides[0]], ..self }
    }
}

/// c = keep c + a b, on the calling thread. The order of each sum depends on the shapes alone. With
/// `keep` 0 what was in `c` does not matter.
pub fn gemm(a: Matrix, b: Matrix, keep: f32, c: &mut [f32]) {
    let (m, k, n) = (a.rows, a.columns, b.columns);
    assert!(k == b.rows && c.len() == m * n);
    // Sound: the asserts above and in `Matrix::new` keep all three inside their slices; `c` is
    // borrowed alone.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            c.as_mut_ptr(),
            1,
            n as isize,
            keep != 0.0,
            a.data.as_ptr(),
            a.strides[1],
            a.strides[0],
            b.data.as_ptr(),
            b.strides[1],
            b.strides[0],
            keep,
            1.0,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

/// `to` (columns, rows) = `from` (rows, columns) transposed, in tiles that stay in the nearest
/// cache. A product copies its operands into its own order anyway, but from a transposed view that
/// takes three times as long, and recurrent weights go into one product per time step.
pub fn transpose(from: &[f32], columns: usize, to: &mut Vec<f32>) {
    const TILE: usize = 16;
    let rows = from.len() / columns;
    to.resize(from.len(), 0.0);
    to.par_chunks_mut(TILE * rows).enumerate().for_each(|(band, to)| {
        let first = band * TILE;
        for r0 in (0..rows).step_by(TILE) {
            for (c, to) in to.chunks_exact_mut(rows).enumerate() {
                for r in r0..(r0 + TILE).min(rows) {
                    to[r] = from[r * columns + first + c];
                }
            }
        }
    });
}

/// `sums` = the sum of the rows.
pub fn sum_rows(rows: &[f32], sums: &mut [f32]) {
    sums.fill(0.0);
    for row in rows.chunks_exact(sums.len()) {
        sums.iter_mut().zip(row).for_each(|(s, v)| *s += v);
    }
}

/// Fills every row of `rows` with `row`.
pub fn fill_rows(rows: &mut [f32], row: &[f32]) {
    rows.chunks_exact_mut(row.len()).for_each(|r| r.copy_from_slice(row));
}
