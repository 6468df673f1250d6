//! How far the cells of a field's grid are from contact: bounds that say of most points, without the spline, that they touch nothing.
//!
//! The cell of a grid node is the box of points nearest to it; there the spline is one quadratic in each coordinate, between the least and the
//! greatest of its Bezier coefficients. The grid's outermost nodes have no cell.

/// Cells looked at either way along each axis.
const WINDOW: usize = 9;
/// Square of the furthest that is known to be apart [grid spacings].
const MOST_SQUARE: u8 = ((WINDOW - 1) * (WINDOW - 1)) as u8;
/// Distances above which there is no contact, by when a law begins [mm]: as the surfaces lie, and with cartilage thicker by up to three standard
/// deviations of its thickness. Laws that begin earlier still have no bounds.
const HIGHEST: [f64; 2] = [0.1, 0.6];

/// Bounds of every cell.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells {
    spacing: f64,
    /// Squares of lower bounds of the distance to where the spline is below each of [`HIGHEST`] [grid spacings], of at most `WINDOW - 1`.
    apart: [Vec<u8>; 2],
    /// Lower bounds [mm] by their squares.
    bound: Vec<f64>,
    /// Planes below the spline, of the cells that are neither apart nor deep inside.
    under: Vec<Plane>,
}

/// A plane that the spline is nowhere below in a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Plane {
    /// At the cell's node [mm].
    height: f32,
    /// Rise to the next node along each axis [mm].
    rise: [f32; 3],
    /// Bound of the spline's gradient within a spacing of the cell [-].
    steepest: f32,
}

impl Cells {
    /// Bounds of the quadratic spline with these coefficients on a grid of `spacing` [mm].
    pub(super) fn new(coefficients: &[f32], size: [usize; 3], spacing: f64) -> Cells {
        let grid = Grid { coefficients, strides: [1, size[0], size[0] * size[1]], size };
        let apart = HIGHEST.map(|h| grid.apart((h * 1.001) as f32));
        let mut under = vec![Plane::default(); coefficients.len()];
        grid.each_cell(|at| {
            if apart[1][at] == 0 && !grid.is_deep(at) {
                under[at] = grid.plane(at, spacing as f32);
            }
        });
        let bound = (0..=MOST_SQUARE).map(|s| f64::from(f32::from(s).sqrt()) * spacing).collect();
        Cells { spacing, apart, bound, under }
    }

    /// Whether there are bounds for a law that begins at an overclosure `start` [mm].
    pub(super) fn bounds(start: f64) -> bool {
        level(start).is_some()
    }

    /// Whether a cell may be in contact by the earliest law that has bounds.
    pub(super) fn may_touch(&self, at: usize) -> bool {
        self.apart[1][at] == 0
    }

    /// Lower bound of the distance [mm] from any point of a cell to anything deeper than `start`.
    #[inline]
    pub(super) fn apart(&self, at: usize, start: f64) -> f64 {
        level(start).map_or(0.0, |k| self.bound[usize::from(self.apart[k][at])])
    }

    /// Lower bound of the motion [mm] without which a point at an offset from a cell's node cannot come deeper than `start`.
    #[inline]
    pub(super) fn clearance(&self, at: usize, offset: &[f64; 3], start: f64) -> f64 {
        let apart = self.apart(at, start);
        if apart > 0.0 {
            return apart;
        }
        let Plane { height, rise, steepest } = self.under[at];
        if steepest == 0.0 {
            return apart;
        }
        let above = f64::from(height)
            + f64::from(rise[0]) * offset[0]
            + f64::from(rise[1]) * offset[1]
            + f64::from(rise[2]) * offset[2];
        // the gradient is bounded within a spacing
        ((above + start).max(0.0) / f64::from(steepest)).min(self.spacing)
    }
}

/// Which of [`HIGHEST`] bounds a law that begins at an overclosure `start` [mm].
fn level(start: f64) -> Option<usize> {
    HIGHEST.iter().position(|h| -start <= *h)
}

/// The earliest beginning of a law [mm] whose bounds hold for one that begins at `start`.
pub(super) fn earliest(start: f64) -> f64 {
    level(start).map_or(start, |k| -HIGHEST[k])
}

/// Coefficients and how they lie.
struct Grid<'a> {
    coefficients: &'a [f32],
    strides: [usize; 3],
    size: [usize; 3],
}

impl Grid<'_> {
    fn each_cell(&self, mut visit: impl FnMut(usize)) {
        let [nx, ny, nz] = self.size;
        for k in 1..nz.saturating_sub(1) {
            for j in 1..ny.saturating_sub(1) {
                for i in 1..nx.saturating_sub(1) {
                    visit((k * ny + j) * nx + i);
                }
            }
        }
    }

    /// Of each cell the square of a lower bound of the distance [grid spacings] to any cell where the spline may be below `highest`. Points of cells `n` apart
    /// along an axis are at least `n - 1` spacings apart along it; the least sum of their squares is found axis by axis.
    fn apart(&self, highest: f32) -> Vec<u8> {
        let mut squares = vec![f32::INFINITY; self.coefficients.len()];
        self.each_cell(|at| {
            if self.coefficients[at] < highest || self.least(at, highest) < highest {
                squares[at] = 0.0;
            }
        });
        for stride in self.strides {
            let from = squares.clone();
            for n in 1..=WINDOW {
                let add = (n as f32 - 1.0).powi(2);
                // a row runs on into the next: what is found there too only lowers the bound
                let shift = (n * stride).min(from.len());
                squares.iter_mut().skip(shift).zip(&from).for_each(|(s, v)| *s = s.min(v + add));
                squares.iter_mut().zip(&from[shift..]).for_each(|(s, v)| *s = s.min(v + add));
            }
        }
        // sums of squares of whole numbers
        squares.iter().map(|s| s.min(f32::from(MOST_SQUARE)) as u8).collect()
    }

    /// Three coefficients along x, the `n`-th of the nine rows around a cell's node.
    fn row(&self, at: usize, n: usize) -> [f32; 3] {
        let [dx, dy, dz] = self.strides;
        let start = at - dx - dy - dz + n / 3 * dz + n % 3 * dy;
        [self.coefficients[start], self.coefficients[start + 1], self.coefficients[start + 2]]
    }

    /// Whether the spline is below 0 all over a cell.
    fn is_deep(&self, at: usize) -> bool {
        (0..9).all(|n| self.row(at, n).iter().all(|c| *c < 0.0))
    }

    /// The least Bezier coefficient of a cell; where no coefficient around is below `highest`, `highest`.
    fn least(&self, at: usize, highest: f32) -> f32 {
        let rows: [[f32; 3]; 9] = std::array::from_fn(|n| self.row(at, n));
        if rows.iter().flatten().all(|c| *c >= highest) {
            return highest;
        }
        bezier(&rows).iter().fold(f32::INFINITY, |m, c| m.min(*c))
    }

    /// The plane along the central differences, lowered below every Bezier coefficient.
    fn plane(&self, at: usize, spacing: f32) -> Plane {
        let rise = self.strides.map(|s| 0.5 * (self.coefficients[at + s] - self.coefficients[at - s]));
        let rows: [[f32; 3]; 9] = std::array::from_fn(|n| self.row(at, n));
        // a linear function's Bezier coefficients are its values at the corners, middles and centre of the cell
        let place = |n: usize| [n / 9, n / 3 % 3, n % 3].map(|k| 0.5 * (k as f32 - 1.0));
        let above = |(n, c): (usize, f32)| {
            let p = place(n);
            c - rise[0] * p[0] - rise[1] * p[1] - rise[2] * p[2]
        };
        let height = bezier(&rows).into_iter().enumerate().map(above).fold(f32::INFINITY, f32::min);
        Plane { height: height - 1e-5 * (1.0 + height.abs()), rise, steepest: self.steepest(at, spacing) }
    }

    /// Bound of the gradient within a spacing of a cell: the spline's is a mean of differences of neighbouring coefficients, of those that it spans.
    fn steepest(&self, at: usize, spacing: f32) -> f32 {
        let centre: [usize; 3] = std::array::from_fn(|a| at / self.strides[a] % self.size[a]);
        let from = centre.map(|c| c.saturating_sub(2));
        let to: [usize; 3] = std::array::from_fn(|a| (centre[a] + 3).min(self.size[a]));
        let mut most = [0f32; 3];
        for k in from[2]..to[2] {
            for j in from[1]..to[1] {
                for i in from[0]..to[0] {
                    let here = i + j * self.strides[1] + k * self.strides[2];
                    for (a, n) in [i, j, k].into_iter().enumerate() {
                        if n + 1 < to[a] {
                            let rise = self.coefficients[here + self.strides[a]] - self.coefficients[here];
                            most[a] = most[a].max(rise.abs());
                        }
                    }
                }
            }
        }
        most.iter().map(|m| m * m).sum::<f32>().sqrt() / spacing * 1.0001 + 1e-6
    }
}

/// Bezier coefficients of a cell, by x, y, z: halves with the neighbours along each axis in turn; the middle stays.
fn bezier(rows: &[[f32; 3]; 9]) -> [f32; 27] {
    let halved = |[a, b, c]: [f32; 3]| [0.5 * (a + b), b, 0.5 * (b + c)];
    let mut out = [0.0; 27];
    let rows = rows.map(halved);
    for x in 0..3 {
        let planes: [[f32; 3]; 3] =
            std::array::from_fn(|k| halved([rows[3 * k][x], rows[3 * k + 1][x], rows[3 * k + 2][x]]));
        for y in 0..3 {
            let along_z = halved([planes[0][y], planes[1][y], planes[2][y]]);
            out[9 * x + 3 * y..9 * x + 3 * y + 3].copy_from_slice(&along_z);
        }
    }
    out
}
