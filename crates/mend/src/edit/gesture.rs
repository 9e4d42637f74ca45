//! Turns gestures into points of the cloth with targets: grab moves one point, twist turns a disk, pinch makes a fold
//! between two points. Each gesture starts from the cloth as the gestures before it left it.

use std::cell::OnceCell;

use nalgebra::{Rotation3, Unit};

use super::cells::{CellMove, HoleCells};
use super::displacement::harmonic_displacement;
use super::point::{ClothSurface, PlacedPoint};
use super::search::farthest_first;
use darn_contract::Gesture;
use darn_geometry::grid::{CELLS, SIDE, cell_at, cell_centre, evaluate};
use darn_geometry::mesh::{Vec2, Vec3};
use darn_geometry::patch::Firmness;

/// Most cells of a disk that a twist places: enough that the disk keeps its shape, few enough that the network shapes
/// the folds around it.
const MAX_TWIST_CELLS: usize = 40;
/// Height of a fold as a share of the height of a roof with straight sides: cloth is rounder than a roof.
const ROUNDNESS: f64 = 0.8;
/// Cloth that bulges by less than this share of the pinched length counts as flat.
const MIN_BULGE: f64 = 0.02;

/// The points of a hole's cloth that anchors and gestures have placed so far.
pub struct PlacedPoints<'a> {
    hole: &'a HoleCells,
    surface: ClothSurface<'a>,
    points: Vec<PlacedPoint>,
    /// For each cell of the grid the index of the last point placed in it.
    by_cell: Vec<Option<usize>>,
    /// The displacement of every cell. Computed when a gesture first needs it, and dropped when a gesture has placed
    /// its points.
    displacements: OnceCell<Vec<Vec3>>,
}

/// Where a gesture moves a point of the cloth to.
struct Goal {
    uv: Vec2,
    position: Vec3,
}

impl<'a> PlacedPoints<'a> {
    /// The points of the anchors, on the cloth of a hole.
    pub fn new(
        hole: &'a HoleCells,
        surface: ClothSurface<'a>,
        anchors: Vec<PlacedPoint>,
    ) -> PlacedPoints<'a> {
        let mut placed = PlacedPoints {
            hole,
            surface,
            points: Vec::new(),
            by_cell: vec![None; CELLS],
            displacements: OnceCell::new(),
        };
        for anchor in anchors {
            placed.push(anchor);
        }
        placed
    }

    /// All placed points: the anchors' in their order, then those of gestures.
    pub fn points(&self) -> &[PlacedPoint] {
        &self.points
    }

    /// Applies a gesture. Returns the indices, among [`PlacedPoints::points`], of the points that it moved; later
    /// gestures may move them further.
    ///
    /// A gesture places at most one point in a cell, and does not move a point that shares its cell with a hard anchor.
    pub fn apply(&mut self, gesture: &Gesture) -> Vec<usize> {
        // All goals are computed before any point is placed.
        let goals = match *gesture {
            Gesture::Grab { uv, offset } => {
                let uv = Vec2::from(uv);
                let position = self.at(uv) + Vec3::from(offset);
                vec![Goal { uv, position }]
            }
            Gesture::Twist {
                uv,
                radius,
                axis,
                angle,
            } => self.twist(uv.into(), radius, axis.into(), angle),
            Gesture::Pinch { uvs, amount } => self.pinch(uvs.map(Vec2::from), amount),
        };
        let mut held: Vec<usize> = Vec::new();
        for goal in &goals {
            if let Some(index) = self.place(goal)
                && !held.contains(&index)
            {
                held.push(index);
            }
        }
        self.displacements = OnceCell::new();
        held
    }

    /// Where the cloth is after the gestures so far.
    fn at(&self, uv: Vec2) -> Vec3 {
        let by = match self.in_cell_of(uv) {
            Some(index) => self.points[index].displacement(),
            None => evaluate(self.displacements(), uv),
        };
        self.origin(uv) + by
    }

    /// Where the cloth is without constraints.
    fn origin(&self, uv: Vec2) -> Vec3 {
        match self.in_cell_of(uv) {
            Some(index) if self.points[index].uv == uv => self.points[index].origin,
            _ => self.surface.at(uv),
        }
    }

    /// The index of the last point placed in the cell of a uv.
    fn in_cell_of(&self, uv: Vec2) -> Option<usize> {
        self.by_cell[cell_at(uv)]
    }

    /// Adds a point and returns its index.
    fn push(&mut self, point: PlacedPoint) -> usize {
        let index = self.points.len();
        self.by_cell[cell_at(point.uv)] = Some(index);
        self.points.push(point);
        index
    }

    /// Moves the cloth at a goal's uv to its position: the point placed in that cell, or a new one. `None` where a hard
    /// anchor holds the cell.
    fn place(&mut self, goal: &Goal) -> Option<usize> {
        match self.in_cell_of(goal.uv) {
            Some(index) if self.points[index].firmness == Firmness::Hard => None,
            Some(index) => {
                // The point keeps its uv: what moves is the place in the cell that was placed first.
                let by = goal.position - self.origin(goal.uv);
                self.points[index].target = self.points[index].origin + by;
                Some(index)
            }
            None => {
                let point = (self.surface).point(goal.uv, goal.position, Firmness::Soft);
                Some(self.push(point))
            }
        }
    }

    /// The displacements of the placed points, spread over the hole.
    fn displacements(&self) -> &[Vec3] {
        self.displacements.get_or_init(|| {
            let fixed: Vec<CellMove> = (self.points.iter())
                .map(|p| CellMove {
                    cell: cell_at(p.uv),
                    by: p.displacement(),
                })
                .collect();
            harmonic_displacement(self.hole, &fixed)
        })
    }

    /// Turns the cells of a disk, thinned evenly, and every point placed in it, about the axis through its centre.
    fn twist(&self, centre: Vec2, radius: f64, axis: Vec3, angle: f64) -> Vec<Goal> {
        let middle = self.at(centre);
        // The contract refuses an axis of length zero.
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle);
        let within = |uv: &Vec2| (uv - centre).norm() <= radius;
        let cells: Vec<Vec2> = (self.hole.indices().iter())
            .map(|k| cell_centre(*k))
            .filter(within)
            .collect();
        let own = self.points.iter().map(|p| p.uv).filter(within);
        let thinned = farthest_first(&cells, &[], MAX_TWIST_CELLS);
        let mut uvs: Vec<Vec2> = std::iter::once(centre)
            .chain(own)
            .chain(thinned.into_iter().map(|k| cells[k]))
            .collect();
        let mut taken = vec![false; CELLS];
        uvs.retain(|uv| !std::mem::replace(&mut taken[cell_at(*uv)], true));
        let goal = |uv: Vec2| Goal {
            uv,
            position: middle + turn * (self.at(uv) - middle),
        };
        uvs.into_iter().map(goal).collect()
    }

    /// Moves the two ends together and raises the middle by as much as cloth of that length has to rise.
    ///
    /// Cloth of length l over a distance d is a roof of height ½ √(l² − d²). The fold goes to the side to which the
    /// cloth bulges already; flat cloth folds along its normal.
    fn pinch(&self, uvs: [Vec2; 2], amount: f64) -> Vec<Goal> {
        let [a, b] = uvs.map(|uv| self.at(uv));
        let between = b - a;
        let mut goals = vec![
            Goal {
                uv: uvs[0],
                position: a + between * (0.5 * amount),
            },
            Goal {
                uv: uvs[1],
                position: b - between * (0.5 * amount),
            },
        ];
        let centre = (uvs[0] + uvs[1]) * 0.5;
        if !self.hole.contains(cell_at(centre)) {
            return goals;
        }
        let length = (uvs[1] - uvs[0]).norm() * self.surface.square.side;
        let height = |distance: f64| 0.5 * (length * length - distance * distance).max(0.0).sqrt();
        let rise = height(between.norm() * (1.0 - amount)) - height(between.norm());
        let middle = self.at(centre);
        let along = between.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        let bulge = middle - (a + b) * 0.5;
        let bulge = bulge - along * bulge.dot(&along);
        let side = if bulge.norm() > MIN_BULGE * length {
            bulge.normalize()
        } else {
            self.normal(centre)
        };
        goals.push(Goal {
            uv: centre,
            position: middle + side * (ROUNDNESS * rise),
        });
        goals
    }

    /// The unit normal of the cloth without constraints, by differences over a cell; zero where the cloth has none.
    fn normal(&self, uv: Vec2) -> Vec3 {
        let step = 1.0 / SIDE as f64;
        let along = |d: Vec2| self.surface.at(uv + d) - self.surface.at(uv - d);
        let normal = along(Vec2::new(step, 0.0)).cross(&along(Vec2::new(0.0, step)));
        normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::cells::testing::disk;
    use darn_geometry::flatten::UvSquare;
    use proptest::prelude::*;

    const SQUARE: UvSquare = UvSquare {
        origin: Vec2::new(0.0, 0.0),
        axis: Vec2::new(1.0, 0.0),
        side: 2.0,
    };
    const FLAT: ClothSurface = ClothSurface {
        square: SQUARE,
        position: &|flat| Vec3::new(flat.x, flat.y, 0.0),
    };

    fn no_points(hole: &HoleCells) -> PlacedPoints<'_> {
        PlacedPoints::new(hole, FLAT, Vec::new())
    }

    proptest! {
        #[test]
        fn grabs_of_one_place_add_up(
            u in 0.45..0.55f64, v in 0.45..0.55f64, a in prop::array::uniform3(-1.0..1.0f64), b in prop::array::uniform3(-1.0..1.0f64)
        ) {
            let hole = disk(14.0);
            let mut placed = no_points(&hole);
            let first = placed.apply(&Gesture::Grab { uv: [u, v], offset: a });
            let second = placed.apply(&Gesture::Grab { uv: [u, v], offset: b });
            prop_assert_eq!(&first, &second);
            let sum = FLAT.at(Vec2::new(u, v)) + Vec3::from(a) + Vec3::from(b);
            prop_assert!((placed.points()[first[0]].target - sum).norm() < 1e-12);
        }

        #[test]
        fn a_twist_keeps_distances_within_its_disk(angle in -3.0..3.0f64, axis in prop::array::uniform3(0.1..1.0f64)) {
            let hole = disk(14.0);
            let mut placed = no_points(&hole);
            let held = placed.apply(&Gesture::Twist { uv: [0.5, 0.5], radius: 0.1, axis, angle });
            prop_assert!(held.len() > 10 && held.len() <= MAX_TWIST_CELLS + 1);
            for p in placed.points() {
                for q in placed.points() {
                    let (now, before) = ((p.target - q.target).norm(), (p.origin - q.origin).norm());
                    prop_assert!((now - before).abs() < 1e-9);
                }
            }
        }

        #[test]
        fn a_pinch_shortens_the_distance_by_its_amount(amount in 0.0..1.0f64) {
            let hole = disk(14.0);
            let mut placed = no_points(&hole);
            let held = placed.apply(&Gesture::Pinch { uvs: [[0.4, 0.5], [0.6, 0.5]], amount });
            prop_assert_eq!(held.len(), 3);
            let at = |k: usize| placed.points()[held[k]].target;
            prop_assert!(((at(1) - at(0)).norm() - 0.4 * (1.0 - amount)).abs() < 1e-9);
            // The fold is no longer than the cloth.
            prop_assert!((at(1) - at(2)).norm() + (at(2) - at(0)).norm() <= 0.4 + 1e-9);
        }
    }

    #[test]
    fn a_twist_turns_points_that_were_grabbed_before() {
        let hole = disk(14.0);
        let mut placed = no_points(&hole);
        let grabbed = placed.apply(&Gesture::Grab {
            uv: [0.55, 0.5],
            offset: [0.0, 0.0, 0.1],
        });
        placed.apply(&Gesture::Twist {
            uv: [0.5, 0.5],
            radius: 0.1,
            axis: [0.0, 0.0, 1.0],
            angle: std::f64::consts::PI,
        });
        let after = placed.points()[grabbed[0]].target;
        // Half a turn about the disk's centre leaves the height as the grab made it.
        assert!((after.z - 0.1).abs() < 1e-9, "{after}");
        assert!((after.x - 0.9).abs() < 1e-9, "{after}");
    }

    #[test]
    fn every_grab_starts_from_the_cloth_that_earlier_grabs_moved() {
        let hole = disk(14.0);
        let mut placed = no_points(&hole);
        let grabs = [(0.42, 0.5), (0.5, 0.61), (0.42, 0.503), (0.55, 0.44)];
        for (u, v) in grabs {
            let uv = Vec2::new(u, v);
            let moved_by = |p: &PlacedPoint| CellMove {
                cell: cell_at(p.uv),
                by: p.target - FLAT.at(p.uv),
            };
            let fixed: Vec<CellMove> = placed.points().iter().map(moved_by).collect();
            let moved = match fixed.iter().rfind(|fixed| fixed.cell == cell_at(uv)) {
                Some(fixed) => fixed.by,
                None => evaluate(&harmonic_displacement(&hole, &fixed), uv),
            };
            let held = placed.apply(&Gesture::Grab {
                uv: [u, v],
                offset: [0.1, u, 0.2],
            });
            let expected = moved + Vec3::new(0.1, u, 0.2);
            let point = placed.points()[held[0]];
            assert!((point.target - FLAT.at(point.uv) - expected).norm() < 1e-12);
        }
        assert_eq!(placed.points().len(), 3, "two of the grabs share a cell");
    }

    #[test]
    fn the_surface_is_not_evaluated_again_at_placed_points() {
        let looks = std::cell::Cell::new(0usize);
        let counted = |flat: Vec2| {
            looks.set(looks.get() + 1);
            Vec3::new(flat.x, flat.y, 0.0)
        };
        let surface = ClothSurface {
            square: SQUARE,
            position: &counted,
        };
        let hole = disk(14.0);
        let mut placed = PlacedPoints::new(&hole, surface, Vec::new());
        let grabbed: Vec<usize> = hole.indices().iter().copied().step_by(20).collect();
        for cell in &grabbed {
            placed.apply(&Gesture::Grab {
                uv: cell_centre(*cell).into(),
                offset: [0.0, 0.0, 0.1],
            });
        }
        assert_eq!(looks.get(), 2 * grabbed.len());
        let twist = Gesture::Twist {
            uv: cell_centre(grabbed[grabbed.len() / 2]).into(),
            radius: 0.1,
            axis: [0.0, 0.0, 1.0],
            angle: 0.3,
        };
        placed.apply(&twist);
        looks.set(0);
        placed.apply(&twist);
        assert_eq!(looks.get(), 0, "all points of the disk are placed already");
    }

    #[test]
    fn no_gesture_moves_a_hard_anchor() {
        let hole = disk(14.0);
        let anchor = FLAT.point(
            Vec2::new(0.5, 0.5),
            Vec3::new(1.0, 1.0, 0.2),
            Firmness::Hard,
        );
        let mut placed = PlacedPoints::new(&hole, FLAT, vec![anchor]);
        let held = placed.apply(&Gesture::Grab {
            uv: [0.5, 0.5],
            offset: [0.0, 0.0, 1.0],
        });
        assert!(held.is_empty());
        assert_eq!(placed.points(), [anchor]);
    }
}
