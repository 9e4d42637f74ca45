//! What a hand does to cloth, as anchors: grab pulls a point, twist turns a disk, pinch gathers a fold between two points.
//! Each gesture takes hold of the cloth as the ones before it left it.

use std::cell::OnceCell;

use nalgebra::{Rotation3, Unit};

use super::drape::drape;
use super::{Firmness, HoleCells, Wanted};
use darn_contract::Gesture;
use darn_geometry::grid::{CELLS, cell_at, cell_centre, evaluate};
use darn_geometry::mesh::{Vec2, Vec3};

/// Most anchors a twist is turned into: enough for a disk to keep its shape, few enough to leave the folds around it to the network.
const MOST_OF_A_DISK: usize = 40;
/// Share of the height of a tent that a fold reaches: cloth is rounder than a roof.
const ROUNDNESS: f64 = 0.8;
/// A bulge of less than this share of the pinched length has no side of its own.
const NO_SIDE: f64 = 0.02;

/// The cloth in hand: its unedited shape, and the points that anchors and gestures have placed so far.
pub struct Hand<'a> {
    hole: &'a HoleCells,
    unedited: &'a dyn Fn(Vec2) -> Vec3,
    side: f64,
    placed: Vec<Wanted>,
    /// Where each placed point lies on the unedited cloth: to ask that again costs a walk over the cloth's faces.
    origins: Vec<Vec3>,
    /// Per cell the last point placed in it.
    held: Vec<Option<usize>>,
    /// How far each cell has moved; there once a gesture has asked for it, until points are placed again.
    moved: OnceCell<Vec<Vec3>>,
}

impl<'a> Hand<'a> {
    /// Takes the cloth with its anchors; `side` is the length of the chart's unit square in scene units.
    pub fn new(
        hole: &'a HoleCells,
        unedited: &'a dyn Fn(Vec2) -> Vec3,
        side: f64,
        anchors: Vec<Wanted>,
    ) -> Hand<'a> {
        let mut hand = Hand {
            hole,
            unedited,
            side,
            placed: Vec::new(),
            origins: Vec::new(),
            held: vec![None; CELLS],
            moved: OnceCell::new(),
        };
        for anchor in anchors {
            hand.hold(anchor);
        }
        hand
    }

    /// All placed points: the anchors in their order, then those of gestures.
    pub fn placed(&self) -> &[Wanted] {
        &self.placed
    }

    /// Does a gesture. The indices, among [`Hand::placed`], of the points it took hold of; later gestures may move them on.
    ///
    /// Points in a cell that is held by a hard anchor are left alone. At most one point a cell is placed.
    pub fn act(&mut self, gesture: &Gesture) -> Vec<usize> {
        // All that a gesture reads, it reads before it places anything.
        let goals = match *gesture {
            Gesture::Grab { uv, offset } => {
                vec![(uv.into(), self.at(uv.into()) + Vec3::from(offset))]
            }
            Gesture::Twist {
                uv,
                radius,
                axis,
                angle,
            } => self.twist((uv.into(), radius), axis.into(), angle),
            Gesture::Pinch { uvs, amount } => self.pinch(uvs.map(Vec2::from), amount),
        };
        let mut held: Vec<usize> = Vec::new();
        for (uv, position) in goals {
            if let Some(place) = self.place(uv, position)
                && !held.contains(&place)
            {
                held.push(place);
            }
        }
        self.moved = OnceCell::new();
        held
    }

    /// Where the cloth is now.
    fn at(&self, uv: Vec2) -> Vec3 {
        let by = match self.holding(uv) {
            Some(held) => self.displacement(held),
            None => evaluate(self.moved(), uv),
        };
        self.origin(uv) + by
    }

    /// Where the unedited cloth is.
    fn origin(&self, uv: Vec2) -> Vec3 {
        match self.holding(uv) {
            Some(held) if self.placed[held].uv == uv => self.origins[held],
            _ => (self.unedited)(uv),
        }
    }

    /// The last point placed in the cell of a uv.
    fn holding(&self, uv: Vec2) -> Option<usize> {
        self.held[cell_at(uv)]
    }

    fn displacement(&self, placed: usize) -> Vec3 {
        self.placed[placed].position - self.origins[placed]
    }

    /// Adds a point to the placed ones; its index.
    fn hold(&mut self, point: Wanted) -> usize {
        let index = self.placed.len();
        self.held[cell_at(point.uv)] = Some(index);
        self.origins.push((self.unedited)(point.uv));
        self.placed.push(point);
        index
    }

    fn place(&mut self, uv: Vec2, position: Vec3) -> Option<usize> {
        match self.holding(uv) {
            Some(held) if self.placed[held].firmness == Firmness::Hard => None,
            Some(held) => {
                // The point keeps its own uv: what is moved is the place in the cell that was held already.
                let by = position - self.origin(uv);
                self.placed[held].position = self.origins[held] + by;
                Some(held)
            }
            None => Some(self.hold(Wanted {
                uv,
                position,
                firmness: Firmness::Soft,
            })),
        }
    }

    /// The placed points' displacements carried over the hole.
    fn moved(&self) -> &[Vec3] {
        self.moved.get_or_init(|| {
            let fixed: Vec<(usize, Vec3)> = (self.placed.iter().enumerate())
                .map(|(k, p)| (cell_at(p.uv), self.displacement(k)))
                .collect();
            drape(self.hole, &fixed)
        })
    }

    /// Turns the disk's cells, thinned evenly, and every point placed in it about the axis through its centre.
    fn twist(&self, disk: (Vec2, f64), axis: Vec3, angle: f64) -> Vec<(Vec2, Vec3)> {
        let (centre, radius) = disk;
        let middle = self.at(centre);
        // The contract lets no axis of length zero pass.
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle);
        let within = |uv: &Vec2| (uv - centre).norm() <= radius;
        let cells: Vec<Vec2> = (self.hole.indices().iter())
            .map(|k| cell_centre(*k))
            .filter(within)
            .collect();
        let own = self.placed.iter().map(|p| p.uv).filter(within);
        let mut uvs: Vec<Vec2> = std::iter::once(centre)
            .chain(own)
            .chain(spread(&cells, MOST_OF_A_DISK))
            .collect();
        let mut taken = vec![false; CELLS];
        uvs.retain(|uv| !std::mem::replace(&mut taken[cell_at(*uv)], true));
        (uvs.into_iter())
            .map(|uv| (uv, middle + turn * (self.at(uv) - middle)))
            .collect()
    }

    /// Draws the ends together and raises the middle by what cloth of that length has to rise.
    ///
    /// A roof over distance d made of cloth of length l is ½ √(l² − d²) high. The fold goes to the side the cloth bulges to already, or,
    /// where it is flat, along its normal.
    fn pinch(&self, uvs: [Vec2; 2], amount: f64) -> Vec<(Vec2, Vec3)> {
        let [a, b] = uvs.map(|uv| self.at(uv));
        let between = b - a;
        let ends = [
            (uvs[0], a + between * (0.5 * amount)),
            (uvs[1], b - between * (0.5 * amount)),
        ];
        let centre = (uvs[0] + uvs[1]) * 0.5;
        if !self.hole.contains(cell_at(centre)) {
            return ends.to_vec();
        }
        let length = (uvs[1] - uvs[0]).norm() * self.side;
        let height = |distance: f64| 0.5 * (length * length - distance * distance).max(0.0).sqrt();
        let rise = height(between.norm() * (1.0 - amount)) - height(between.norm());
        let middle = self.at(centre);
        let along = between.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        let bulge = middle - (a + b) * 0.5;
        let bulge = bulge - along * bulge.dot(&along);
        let side = if bulge.norm() > NO_SIDE * length {
            bulge.normalize()
        } else {
            self.normal(centre)
        };
        let mut goals = ends.to_vec();
        goals.push((centre, middle + side * (ROUNDNESS * rise)));
        goals
    }

    /// The cloth's unit normal by differences over a cell; zero where the cloth has none.
    fn normal(&self, uv: Vec2) -> Vec3 {
        let step = 1.0 / darn_geometry::grid::SIDE as f64;
        let along = |d: Vec2| (self.unedited)(uv + d) - (self.unedited)(uv - d);
        let normal = along(Vec2::new(step, 0.0)).cross(&along(Vec2::new(0.0, step)));
        normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
    }
}

/// At most `most` of the points, as far from each other as they come (greedy farthest-point sampling from the first).
fn spread(points: &[Vec2], most: usize) -> Vec<Vec2> {
    super::search::farthest_first(points, &[], most)
        .into_iter()
        .map(|k| points[k])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::testing::disk;
    use proptest::prelude::*;

    fn flat(uv: Vec2) -> Vec3 {
        Vec3::new(2.0 * uv.x, 2.0 * uv.y, 0.0)
    }

    fn hand(hole: &HoleCells) -> Hand<'_> {
        Hand::new(hole, &flat, 2.0, Vec::new())
    }

    proptest! {
        #[test]
        fn grabs_of_one_place_add_up(
            u in 0.45..0.55f64, v in 0.45..0.55f64, a in prop::array::uniform3(-1.0..1.0f64), b in prop::array::uniform3(-1.0..1.0f64)
        ) {
            let hole = disk(14.0);
            let mut hand = hand(&hole);
            let first = hand.act(&Gesture::Grab { uv: [u, v], offset: a });
            let second = hand.act(&Gesture::Grab { uv: [u, v], offset: b });
            prop_assert_eq!(&first, &second);
            let sum = flat(Vec2::new(u, v)) + Vec3::from(a) + Vec3::from(b);
            prop_assert!((hand.placed()[first[0]].position - sum).norm() < 1e-12);
        }

        #[test]
        fn a_twist_keeps_distances_within_its_disk(angle in -3.0..3.0f64, axis in prop::array::uniform3(0.1..1.0f64)) {
            let hole = disk(14.0);
            let mut hand = hand(&hole);
            let held = hand.act(&Gesture::Twist { uv: [0.5, 0.5], radius: 0.1, axis, angle });
            prop_assert!(held.len() > 10 && held.len() <= MOST_OF_A_DISK + 1);
            for p in hand.placed() {
                for q in hand.placed() {
                    let (now, before) = ((p.position - q.position).norm(), (flat(p.uv) - flat(q.uv)).norm());
                    prop_assert!((now - before).abs() < 1e-9);
                }
            }
        }

        #[test]
        fn a_pinch_takes_away_its_share(amount in 0.0..1.0f64) {
            let hole = disk(14.0);
            let mut hand = hand(&hole);
            let held = hand.act(&Gesture::Pinch { uvs: [[0.4, 0.5], [0.6, 0.5]], amount });
            prop_assert_eq!(held.len(), 3);
            let at = |k: usize| hand.placed()[held[k]].position;
            prop_assert!(((at(1) - at(0)).norm() - 0.4 * (1.0 - amount)).abs() < 1e-9);
            // The fold is no longer than the cloth.
            prop_assert!((at(1) - at(2)).norm() + (at(2) - at(0)).norm() <= 0.4 + 1e-9);
        }
    }

    #[test]
    fn a_twist_carries_on_what_was_grabbed_before() {
        let hole = disk(14.0);
        let mut hand = hand(&hole);
        let grabbed = hand.act(&Gesture::Grab {
            uv: [0.55, 0.5],
            offset: [0.0, 0.0, 0.1],
        });
        hand.act(&Gesture::Twist {
            uv: [0.5, 0.5],
            radius: 0.1,
            axis: [0.0, 0.0, 1.0],
            angle: std::f64::consts::PI,
        });
        let after = hand.placed()[grabbed[0]].position;
        // Turned by half a turn about the disk's centre, and still as high as it was pulled.
        assert!((after.z - 0.1).abs() < 1e-9, "{after}");
        assert!((after.x - 0.9).abs() < 1e-9, "{after}");
    }

    #[test]
    fn every_grab_finds_the_cloth_as_those_before_it_left_it() {
        let hole = disk(14.0);
        let mut hand = hand(&hole);
        let grabs = [(0.42, 0.5), (0.5, 0.61), (0.42, 0.503), (0.55, 0.44)];
        for (u, v) in grabs {
            let uv = Vec2::new(u, v);
            let carried = |p: &Wanted| (cell_at(p.uv), p.position - flat(p.uv));
            let fixed: Vec<(usize, Vec3)> = hand.placed().iter().map(carried).collect();
            let moved = match fixed.iter().rfind(|(cell, _)| *cell == cell_at(uv)) {
                Some((_, by)) => *by,
                None => evaluate(&drape(&hole, &fixed), uv),
            };
            let held = hand.act(&Gesture::Grab {
                uv: [u, v],
                offset: [0.1, u, 0.2],
            });
            let expected = moved + Vec3::new(0.1, u, 0.2);
            let point = hand.placed()[held[0]];
            assert!((point.position - flat(point.uv) - expected).norm() < 1e-12);
        }
        assert_eq!(hand.placed().len(), 3, "two of the grabs share a cell");
    }

    #[test]
    fn placed_points_are_not_looked_up_again() {
        let looks = std::cell::Cell::new(0usize);
        let cloth = |uv: Vec2| {
            looks.set(looks.get() + 1);
            flat(uv)
        };
        let hole = disk(14.0);
        let mut hand = Hand::new(&hole, &cloth, 2.0, Vec::new());
        let grabbed: Vec<usize> = hole.indices().iter().copied().step_by(20).collect();
        for cell in &grabbed {
            hand.act(&Gesture::Grab {
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
        hand.act(&twist);
        looks.set(0);
        hand.act(&twist);
        assert_eq!(looks.get(), 0, "all of the disk is placed already");
    }

    #[test]
    fn no_gesture_moves_a_hard_anchor() {
        let hole = disk(14.0);
        let anchor = Wanted {
            uv: Vec2::new(0.5, 0.5),
            position: Vec3::new(1.0, 1.0, 0.2),
            firmness: Firmness::Hard,
        };
        let mut hand = Hand::new(&hole, &flat, 2.0, vec![anchor]);
        let held = hand.act(&Gesture::Grab {
            uv: [0.5, 0.5],
            offset: [0.0, 0.0, 1.0],
        });
        assert!(held.is_empty());
        assert_eq!(hand.placed(), [anchor]);
    }
}
