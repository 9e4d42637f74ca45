//! Smooth fills of the grid, each the exact minimum of an energy: the network's input in unknown cells, and its
//! baselines.
//!
//! Fills are linear in the known positions, equivariant under the grid's symmetries and under rigid motions of the
//! cloth.

use darn_budget::Budget;
use serde::Serialize;

use crate::cholesky::Symmetric;
use crate::grid::{CELLS, SIDE, catmull_rom};
use crate::mesh::Vec3;

/// Weight of the membrane energy in [`Smooth::TautPlate`]. It dominates the plate at lengths above 1 / √weight = 15
/// cells.
const TENSION: f64 = 1.0 / (15.0 * 15.0);

/// Weight of the thin plate in [`Smooth::MinimumVariation`]. It dominates at lengths above 1 / √weight = 8 cells.
const STIFFNESS: f64 = 1.0 / (8.0 * 8.0);

/// An energy of the grid, the same for each coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Smooth {
    /// Σ (first differences)²: the discrete harmonic fill.
    Membrane,
    /// Σ x_uu² + 2 x_uv² + x_vv² of second differences: the discrete biharmonic fill, with continuous slopes across
    /// the rim.
    ThinPlate,
    /// A thin plate under a little tension: continuous slopes across the rim, and no overshoot where it extrapolates
    /// beyond all known cells.
    TautPlate,
    /// Σ x_uuu² + 3 x_uuv² + 3 x_uvv² + x_vvv² of third differences, and a little of the thin plate: continuous curvature across the rim, as in surfaces
    /// of minimum variation of curvature (Moreton, Séquin 1992). Noise at the rim grows in the hole.
    MinimumVariation,
}

/// A weighted difference of cells: Σ coefficient · position.
struct Difference {
    weight: f64,
    /// Pairs (cell, coefficient); the first `count` are used.
    terms: [(usize, f64); 6],
    count: usize,
}

impl Difference {
    fn new<const N: usize>(weight: f64, terms: [(usize, f64); N]) -> Difference {
        let term = |k: usize| terms.get(k).copied().unwrap_or_default();
        Difference {
            weight,
            terms: [0, 1, 2, 3, 4, 5].map(term),
            count: N,
        }
    }

    fn weighted(self, by: f64) -> Difference {
        Difference {
            weight: self.weight * by,
            ..self
        }
    }

    fn terms(&self) -> &[(usize, f64)] {
        &self.terms[..self.count]
    }
}

/// The positions with the cells of the hole filled so that the energy is least; all other cells keep their positions.
///
/// All three slices have one item per cell. Differences with a cell that is neither known nor in the hole are left
/// out. With a `step` of 1 the fill is exact; with a larger one (a power of two, at most 8), it is solved on every
/// `step`-th cell and interpolated: for holes that will be meshed with edges of so many cells. One sparse Cholesky factor,
/// three right-hand sides. `None` when the known cells do not determine the fill.
pub fn smooth(
    positions: &[Vec3],
    known: &[bool],
    hole: &[bool],
    energy: Smooth,
    step: usize,
) -> Option<Vec<Vec3>> {
    smooth_all(&[positions], known, hole, energy, step)?.pop()
}

/// [`smooth`] for several sheets with the same known cells. They share the factor, which is most of the work.
pub fn smooth_all(
    sheets: &[&[Vec3]],
    known: &[bool],
    hole: &[bool],
    energy: Smooth,
    step: usize,
) -> Option<Vec<Vec<Vec3>>> {
    let lattice = Lattice {
        side: SIDE / step,
        step,
    };
    let flags = |of: &[bool]| -> Vec<bool> { lattice.cells().map(|k| of[k]).collect() };
    let (lattice_known, lattice_hole) = (flags(known), flags(hole));
    let mut solved = Vec::with_capacity(sheets.len());
    for positions in sheets {
        solved.push(lattice.cells().map(|k| positions[k]).collect::<Vec<Vec3>>());
    }
    lattice.solve(&mut solved, &lattice_known, &lattice_hole, energy)?;
    if step == 1 {
        return Some(solved);
    }
    let present: Vec<bool> = (lattice_known.iter().zip(&lattice_hole))
        .map(|(known, hole)| *known || *hole)
        .collect();
    let mut filled: Vec<Vec<Vec3>> = sheets.iter().map(|sheet| sheet.to_vec()).collect();
    for cell in (0..CELLS).filter(|k| hole[*k]) {
        let weights = lattice.weights(cell, &present)?;
        for (filled, solved) in filled.iter_mut().zip(&solved) {
            filled[cell] = weights.iter().map(|(k, weight)| solved[*k] * *weight).sum();
        }
    }
    Some(filled)
}

/// Every `step`-th cell along both axes, the middle ones of blocks.
#[derive(Debug, Clone, Copy)]
struct Lattice {
    /// Nodes along an axis.
    side: usize,
    /// Cells from a node to the next.
    step: usize,
}

impl Lattice {
    /// The grid's cells at the nodes, row after row.
    fn cells(self) -> impl Iterator<Item = usize> {
        let along = move |node: usize| node * self.step + self.step / 2;
        (0..self.side * self.side).map(move |k| along(k / self.side) * SIDE + along(k % self.side))
    }

    /// Moves the nodes of the hole, in all sheets, to where the energy is least. `None` when the known nodes do not determine
    /// that.
    fn solve(
        self,
        sheets: &mut [Vec<Vec3>],
        known: &[bool],
        hole: &[bool],
        energy: Smooth,
    ) -> Option<()> {
        let nodes = self.side * self.side;
        let mut unknown = vec![usize::MAX; nodes];
        let open: Vec<usize> = (0..nodes).filter(|&k| hole[k]).collect();
        for (place, &node) in open.iter().enumerate() {
            unknown[node] = place;
        }
        let mut system = Symmetric::zero(open.len());
        let mut rhs = vec![vec![[0.0; 3]; open.len()]; sheets.len()];
        let present = |k: usize| hole[k] || known[k];
        let mut free = Vec::with_capacity(6);
        let mut add = |difference: Difference| {
            let terms = difference.terms();
            let counts =
                terms.iter().all(|&(k, _)| present(k)) && terms.iter().any(|&(k, _)| hole[k]);
            if !counts {
                return;
            }
            free.clear();
            let fixed = || terms.iter().filter(|(k, _)| !hole[*k]);
            free.extend((terms.iter().filter(|(k, _)| hole[*k])).map(|&(k, c)| (unknown[k], c)));
            system.add_square(&free, difference.weight);
            for (positions, rhs) in sheets.iter().zip(&mut rhs) {
                let constant: Vec3 = fixed().map(|&(k, c)| positions[k] * c).sum();
                for &(place, c) in &free {
                    for axis in 0..3 {
                        rhs[place][axis] -= difference.weight * c * constant[axis];
                    }
                }
            }
        };
        // The weights are those of cells. Between nodes, each further derivative is larger by a step.
        let square = (self.step * self.step) as f64;
        let (stiffness, tension) = match energy {
            Smooth::Membrane => (0.0, 1.0),
            Smooth::ThinPlate => (1.0, 0.0),
            Smooth::TautPlate => (1.0, TENSION * square),
            Smooth::MinimumVariation => (STIFFNESS * square, 0.0),
        };
        if energy == Smooth::MinimumVariation {
            (0..nodes)
                .flat_map(|k| self.variations(k))
                .for_each(&mut add);
        }
        if stiffness > 0.0 {
            (0..nodes)
                .flat_map(|k| self.bendings(k))
                .map(|bending| bending.weighted(stiffness))
                .for_each(&mut add);
        }
        if tension > 0.0 {
            self.neighbour_pairs()
                .map(|(a, b)| Difference::new(tension, [(a, -1.0), (b, 1.0)]))
                .for_each(add);
        }
        if !open.is_empty() {
            // The grid bounds the work.
            let factor = system.factor(Budget::unlimited()).ok()?;
            for rhs in &mut rhs {
                factor.solve(rhs).ok()?;
            }
        }
        for (positions, rhs) in sheets.iter_mut().zip(rhs) {
            for (&node, p) in open.iter().zip(&rhs) {
                positions[node] = Vec3::from(*p);
            }
        }
        Some(())
    }

    /// The index pairs of all 4-neighbours: first the pairs along u, then those along v.
    fn neighbour_pairs(self) -> impl Iterator<Item = (usize, usize)> {
        let (side, nodes) = (self.side, self.side * self.side);
        let right = (0..nodes)
            .filter(move |k| k % side + 1 < side)
            .map(|k| (k, k + 1));
        let upper = (0..nodes - side).map(move |k| (k, k + side));
        right.chain(upper)
    }

    /// The nodes between which a cell lies, with their weights: bicubic where all of them are present, else bilinear between
    /// those that are; `None` where none is.
    fn weights(self, cell: usize, present: &[bool]) -> Option<Vec<(usize, f64)>> {
        let place = |cell: usize| (cell as f64 - (self.step / 2) as f64) / self.step as f64;
        let (u, v) = (place(cell % SIDE), place(cell / SIDE));
        let ((wu, iu), (wv, iv)) = (catmull_rom(u, self.side), catmull_rom(v, self.side));
        let product = |wu: &[f64], iu: &[usize], wv: &[f64], iv: &[usize]| -> Vec<(usize, f64)> {
            let rows = iv.iter().zip(wv);
            let all = rows.flat_map(|(j, wv)| {
                (iu.iter().zip(wu)).map(move |(i, wu)| (j * self.side + i, wu * wv))
            });
            all.filter(|(_, weight)| *weight != 0.0).collect()
        };
        let bicubic = product(&wu, &iu, &wv, &iv);
        if bicubic.iter().all(|(k, _)| present[*k]) {
            return Some(bicubic);
        }
        let linear = |x: f64, from: usize| {
            let t = (x - from as f64).clamp(0.0, 1.0);
            [1.0 - t, t]
        };
        let near = product(&linear(u, iu[1]), &iu[1..3], &linear(v, iv[1]), &iv[1..3]);
        let mut near: Vec<(usize, f64)> = near.into_iter().filter(|(k, _)| present[*k]).collect();
        let sum: f64 = near.iter().map(|(_, weight)| weight).sum();
        near.iter_mut().for_each(|(_, weight)| *weight /= sum);
        (sum > 0.0).then_some(near)
    }

    /// The second differences whose node of lowest index is `k`: along u, along v, and mixed.
    fn bendings(self, k: usize) -> impl Iterator<Item = Difference> {
        let side = self.side;
        let (i, j) = (k % side, k / side);
        let straight =
            |step: usize| Difference::new(1.0, [(k, 1.0), (k + step, -2.0), (k + 2 * step, 1.0)]);
        let along_u = (i + 2 < side).then(|| straight(1));
        let along_v = (j + 2 < side).then(|| straight(side));
        let mixed = (i + 1 < side && j + 1 < side).then(|| {
            let corners = [
                (k, 1.0),
                (k + 1, -1.0),
                (k + side, -1.0),
                (k + side + 1, 1.0),
            ];
            Difference::new(2.0, corners)
        });
        [along_u, along_v, mixed].into_iter().flatten()
    }

    /// The third differences whose node of lowest index is `k`: along u, along v, and mixed.
    fn variations(self, k: usize) -> impl Iterator<Item = Difference> {
        let side = self.side;
        let (i, j) = (k % side, k / side);
        let straight = |step: usize| {
            let terms = [
                (k, 1.0),
                (k + step, -3.0),
                (k + 2 * step, 3.0),
                (k + 3 * step, -1.0),
            ];
            Difference::new(1.0, terms)
        };
        // Two steps along `twice`, one along `once`.
        let mixed = |twice: usize, once: usize| {
            let row = |from: usize, sign: f64| {
                [
                    (from, sign),
                    (from + twice, -2.0 * sign),
                    (from + 2 * twice, sign),
                ]
            };
            let ([a, b, c], [d, e, f]) = (row(k, 1.0), row(k + once, -1.0));
            Difference::new(3.0, [a, b, c, d, e, f])
        };
        let along_u = (i + 3 < side).then(|| straight(1));
        let along_v = (j + 3 < side).then(|| straight(side));
        let along_u_twice = (i + 2 < side && j + 1 < side).then(|| mixed(1, side));
        let along_v_twice = (i + 1 < side && j + 2 < side).then(|| mixed(side, 1));
        let all = [along_u, along_v, along_u_twice, along_v_twice];
        all.into_iter().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::cell_centre;

    /// A surface with a round hole in its middle and nothing known in the grid's corner.
    fn holed(surface: impl Fn(f64, f64) -> Vec3) -> (Vec<Vec3>, Vec<bool>) {
        let uv = || (0..CELLS).map(cell_centre);
        let known =
            uv().map(|p| (p - crate::mesh::Vec2::repeat(0.5)).norm() > 0.2 && p.sum() > 0.2);
        (uv().map(|p| surface(p.x, p.y)).collect(), known.collect())
    }

    fn worst(surface: impl Fn(f64, f64) -> Vec3, energy: Smooth) -> f64 {
        let (truth, known) = holed(surface);
        let open: Vec<bool> = known.iter().map(|k| !k).collect();
        let filled = smooth(&truth, &known, &open, energy, 1).unwrap();
        let away = truth.iter().zip(&filled).map(|(a, b)| (a - b).norm());
        away.fold(0.0, f64::max)
    }

    #[test]
    fn a_taut_plate_is_closer_to_a_bent_surface_than_a_membrane() {
        let bent = |u: f64, v: f64| Vec3::new(u, v, (u - 0.5).powi(2) - 0.5 * v * v);
        let [membrane, taut] =
            [Smooth::Membrane, Smooth::TautPlate].map(|energy| worst(bent, energy));
        assert!(taut < 0.3 * membrane, "{taut} {membrane}");
        let wave = |u: f64, v: f64| Vec3::new(u, v, 0.1 * (6.0 * u).sin() * (5.0 * v).cos());
        assert!(worst(wave, Smooth::TautPlate) < 0.5 * worst(wave, Smooth::Membrane));
    }

    #[test]
    fn a_surface_of_minimum_variation_continues_curvature() {
        // On a quadratic surface no third difference costs anything; the thin plate's share costs a little.
        let bent = |u: f64, v: f64| Vec3::new(u, v, (u - 0.5).powi(2) - 0.5 * v * v);
        let dome =
            |u: f64, v: f64| Vec3::new(u, v, (1.0 - (u - 0.5).powi(2) - (v - 0.5).powi(2)).sqrt());
        for surface in [&bent as &dyn Fn(f64, f64) -> Vec3, &dome] {
            let [thin, least] =
                [Smooth::ThinPlate, Smooth::MinimumVariation].map(|energy| worst(surface, energy));
            assert!(least < 0.3 * thin, "{least} {thin}");
        }
    }

    #[test]
    fn a_fill_in_steps_is_near_the_exact_one() {
        let bent = |u: f64, v: f64| Vec3::new(u, v, (u - 0.5).powi(2) - 0.5 * v * v);
        let (truth, known) = holed(bent);
        let open: Vec<bool> = known.iter().map(|k| !k).collect();
        for energy in [
            Smooth::ThinPlate,
            Smooth::TautPlate,
            Smooth::MinimumVariation,
        ] {
            let of = |step| smooth(&truth, &known, &open, energy, step).unwrap();
            let exact = of(1);
            for step in [2, 4] {
                let most = 0.08 * step as f64;
                let filled = of(step);
                let away = (0..CELLS).map(|k| (filled[k] - exact[k]).norm());
                let away = away.fold(0.0, f64::max) * SIDE as f64;
                assert!(away < most, "{energy:?}, step {step}: {away} cells");
                assert!((0..CELLS).all(|k| open[k] || filled[k] == truth[k]));
            }
        }
    }

    #[test]
    fn a_plane_is_filled_in_steps_as_it_is() {
        let plane = |u: f64, v: f64| Vec3::new(u, v, 0.3 * u - 0.2 * v);
        let (truth, known) = holed(plane);
        // Some cells are neither known nor open.
        let open: Vec<bool> = (0..CELLS)
            .map(|k| !known[k] && cell_centre(k).sum() > 0.2)
            .collect();
        for step in [2, 4, 8] {
            for energy in [Smooth::ThinPlate, Smooth::MinimumVariation] {
                let filled = smooth(&truth, &known, &open, energy, step).unwrap();
                let away = (0..CELLS).map(|k| (filled[k] - truth[k]).norm());
                assert!(away.fold(0.0, f64::max) < 1e-9, "{energy:?}, step {step}");
            }
        }
    }

    #[test]
    fn sheets_filled_together_equal_sheets_filled_alone() {
        let (wave, known) = holed(|u, v| Vec3::new(u, v, 0.1 * (6.0 * u).sin() * (5.0 * v).cos()));
        let (bent, _) = holed(|u, v| Vec3::new(v, u, (u - 0.5).powi(2)));
        let hole: Vec<bool> = known.iter().map(|k| !k).collect();
        let both = smooth_all(&[&wave, &bent], &known, &hole, Smooth::TautPlate, 1).unwrap();
        for (together, sheet) in both.iter().zip([&wave, &bent]) {
            let alone = smooth(sheet, &known, &hole, Smooth::TautPlate, 1).unwrap();
            assert_eq!(*together, alone);
        }
    }
}
