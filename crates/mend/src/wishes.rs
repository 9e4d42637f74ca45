//! A hole's anchors and gestures as points of the cloth with the nearest positions it can reach, and how they were kept.

use super::inpainter::Inpainter;
use super::prepared::{Prepared, Unedited};
use super::select::Chosen;
use super::{MendError, MendLimits, search};
use crate::edit::{Firmness, Hand, Point, Wanted};
use darn_contract::{Anchor, FieldError, Gesture, v1};
use darn_geometry::grid;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_geometry::patch::{Patch, Pull};

/// A hard anchor is met when the cloth is within this share of the hole's extent of it.
const MET: f64 = 1e-3;

/// What the cloth of a hole should do.
pub struct Wishes<'a> {
    prepared: &'a Prepared,
    /// The hole's anchors, each with its place in the request.
    anchors: &'a [(usize, Anchor)],
    /// Points of the cloth: first the anchors', in their order, then those of gestures. Positions within reach.
    points: Vec<Wanted>,
    /// How far each was to move, beyond what cloth can.
    beyond: Vec<f64>,
    /// Where each was to be.
    asked: Vec<Vec3>,
    /// How far each is to move from the unedited cloth.
    moves: Vec<Vec3>,
    /// The points each gesture took hold of.
    edits: Vec<Vec<usize>>,
}

impl<'a> Wishes<'a> {
    /// Matches anchors and gestures to the cloth. Anchors without uv are searched for.
    ///
    /// # Errors
    /// `Constraints` for every uv that is not in the hole, `OutOfReach` for hard anchors that cloth cannot reach.
    pub fn of(
        (prepared, unedited): (&'a Prepared, &Unedited),
        chosen: &'a Chosen,
        inpainter: &Inpainter,
        limits: &MendLimits,
    ) -> Result<Wishes<'a>, MendError> {
        check(prepared, chosen)?;
        let mut anchors = Vec::new();
        for (_, anchor) in &chosen.anchors {
            let position = Vec3::from(anchor.position);
            let uv = match anchor.uv {
                Some(uv) => uv.into(),
                None => search::place(prepared, unedited, inpainter, (position, limits))?,
            };
            anchors.push(Wanted {
                uv,
                position,
                firmness: if anchor.hard {
                    Firmness::Hard
                } else {
                    Firmness::Soft
                },
            });
        }
        let cloth = |uv: Vec2| unedited.patch.at(prepared.chart.frame.point(uv));
        let reachable = within_reach(prepared, &cloth, &anchors);
        let mut asked: Vec<Vec3> = anchors.iter().map(|a| a.position).collect();
        for (anchor, position) in anchors.iter_mut().zip(reachable) {
            anchor.position = position;
        }
        let mut hand = Hand::new(&prepared.cells, &cloth, prepared.chart.frame.side, anchors);
        let edits: Vec<Vec<usize>> = (chosen.edits.iter())
            .map(|(_, edit)| hand.act(&edit.gesture))
            .collect();
        let mut points = hand.placed().to_vec();
        asked.extend(points.iter().skip(asked.len()).map(|p| p.position));
        if !edits.is_empty() {
            let reachable = within_reach(prepared, &cloth, &points);
            for (point, position) in points.iter_mut().zip(reachable) {
                point.position = position;
            }
        }
        let beyond = points.iter().zip(&asked);
        let beyond = beyond.map(|(p, asked)| (p.position - asked).norm());
        let moves = points.iter().map(|p| p.position - cloth(p.uv));
        let wishes = Wishes {
            prepared,
            anchors: &chosen.anchors,
            beyond: beyond.collect(),
            moves: moves.collect(),
            points,
            asked,
            edits,
        };
        // Refused here when it is plain, before the network is asked.
        wishes.met(|k| wishes.beyond[k])?;
        Ok(wishes)
    }

    /// Each cell that is to move and how far; the mean where several points lie in one.
    pub fn moves(&self) -> Vec<(usize, Vec3)> {
        let mut sums: std::collections::BTreeMap<usize, (Vec3, f64)> = Default::default();
        for (point, by) in self.points.iter().zip(&self.moves) {
            let cell = grid::cell_at(point.uv);
            if self.prepared.cells.contains(cell) {
                let (sum, count) = sums.entry(cell).or_insert((Vec3::zeros(), 0.0));
                *sum += by;
                *count += 1.0;
            }
        }
        let mean = |(cell, (sum, count)): (usize, (Vec3, f64))| (cell, sum / count);
        sums.into_iter().map(mean).collect()
    }

    /// What pulls at the patch: the points at their exact uv, not only their cells.
    pub fn pulls(&self) -> Vec<Pull> {
        let pull = |p: &Wanted| Pull {
            at: self.prepared.chart.frame.point(p.uv),
            to: p.position,
            firmness: p.firmness,
        };
        self.points.iter().map(pull).collect()
    }

    /// How anchors and gestures were kept by a patch.
    ///
    /// # Errors
    /// `OutOfReach` for hard anchors that it does not meet.
    pub fn kept(
        &self,
        patch: &Patch,
    ) -> Result<(Vec<v1::AnchorReport>, Vec<v1::EditReport>), MendError> {
        let away = |k: usize| {
            let at = patch.at(self.prepared.chart.frame.point(self.points[k].uv));
            (at - self.asked[k]).norm()
        };
        self.met(away)?;
        let anchors = (0..self.anchors.len()).map(|k| v1::AnchorReport {
            distance: away(k),
            uv: self.points[k].uv.iter().copied().collect(),
            beyond_reach: self.beyond[k],
        });
        let edits = self.edits.iter().map(|held| v1::EditReport {
            anchors: held.len() as u32,
            distance: held.iter().map(|k| away(*k)).fold(0.0, f64::max),
        });
        Ok((anchors.collect(), edits.collect()))
    }

    /// What a person should know about anchors that were not kept.
    pub fn notes(&self, anchors: &[v1::AnchorReport]) -> Vec<String> {
        let (extent, cell) = (self.prepared.extent(), self.prepared.cell());
        let mut notes = Vec::new();
        for ((i, _), anchor) in self.anchors.iter().zip(anchors) {
            if anchor.distance > extent {
                notes.push(format!(
                    "anchor {i} is {:.3} away from the cloth, farther than the hole is wide ({extent:.3})",
                    anchor.distance
                ));
            } else if anchor.beyond_reach > 0.5 * cell {
                notes.push(format!(
                    "anchor {i} lies {:.4} beyond what the cloth around the hole can reach; it was drawn there as far as that allows",
                    anchor.beyond_reach
                ));
            }
        }
        notes
    }

    /// Whether all hard anchors are met, by how far each point stays away.
    fn met(&self, away: impl Fn(usize) -> f64) -> Result<(), MendError> {
        let limit = MET * self.prepared.extent();
        let mut wrong = Vec::new();
        for (k, (i, anchor)) in self.anchors.iter().enumerate() {
            let distance = away(k);
            // An anchor that is not a number is not met.
            if anchor.hard && (distance > limit || distance.is_nan()) {
                let detail = format!(
                    "the cloth stays {distance:.4} away from it, {limit:.4} is allowed; it lies {:.4} beyond what the cloth around the \
                     hole can reach without being stretched",
                    self.beyond[k]
                );
                wrong.push(FieldError::new(format!("/anchors/{i}"), detail));
            }
        }
        if wrong.is_empty() {
            Ok(())
        } else {
            Err(MendError::OutOfReach(wrong))
        }
    }
}

/// The nearest positions within reach.
fn within_reach(
    prepared: &Prepared,
    cloth: &impl Fn(Vec2) -> Vec3,
    points: &[Wanted],
) -> Vec<Vec3> {
    let point = |p: &Wanted| Point {
        flat: prepared.chart.frame.point(p.uv),
        now: cloth(p.uv),
        wanted: p.position,
        firmness: p.firmness,
    };
    let points: Vec<Point> = points.iter().map(point).collect();
    prepared.reach.nearest(&points)
}

/// Every uv lies in the hole.
fn check(prepared: &Prepared, chosen: &Chosen) -> Result<(), MendError> {
    let mut wrong = Vec::new();
    let mut look = |pointer: String, uv: [f64; 2]| {
        if !prepared.holds(uv.into()) {
            let detail = format!("[{}, {}] does not lie in the hole", uv[0], uv[1]);
            wrong.push(FieldError::new(pointer, detail));
        }
    };
    for (i, anchor) in &chosen.anchors {
        if let Some(uv) = anchor.uv {
            look(format!("/anchors/{i}/uv"), uv);
        }
    }
    for (i, edit) in &chosen.edits {
        match edit.gesture {
            Gesture::Grab { uv, .. } => look(format!("/edits/{i}/grab/uv"), uv),
            Gesture::Twist { uv, .. } => look(format!("/edits/{i}/twist/uv"), uv),
            Gesture::Pinch { uvs, .. } => {
                look(format!("/edits/{i}/pinch/uvs/0"), uvs[0]);
                look(format!("/edits/{i}/pinch/uvs/1"), uvs[1]);
            }
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(MendError::Constraints(wrong))
    }
}
