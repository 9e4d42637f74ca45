//! Finds loops by a place near them: thousands of places among hundreds of thousands of loops.

use crate::point_limit::PointLimit;
use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted, Steps};
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::nearest::distance_to_loop;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Finds the loop that is nearest to a point; an outer boundary only in a scan that has no other loops.
pub struct NearestLoop<'a> {
    welded: &'a WeldedScan,
    /// The loops with the balls around them; made when the first point is looked for.
    balls: Option<Vec<RimBall<'a>>>,
    limit: PointLimit<'a>,
    steps: Steps<'a>,
}

/// A rim and a ball that it lies in.
struct RimBall<'a> {
    rim: &'a BoundaryLoop,
    centre: Vec3,
    radius: f64,
}

/// Nanoseconds of work a ball for a point.
const BALL_WORK: u64 = 10;
/// Nanoseconds of work an edge of a rim for a point.
const EDGE_WORK: u64 = 20;

impl<'a> NearestLoop<'a> {
    /// Looks in a scan.
    pub fn of(welded: &'a WeldedScan, budget: &'a Budget<'a>) -> NearestLoop<'a> {
        NearestLoop {
            welded,
            balls: None,
            limit: PointLimit::of(&welded.surface.mesh),
            steps: Steps::of(budget),
        }
    }

    /// The loop nearest to a point, the first of several; or why there is none: without loops, or farther than the scan's diagonal away.
    ///
    /// # Errors
    /// `Exhausted`: a request may have thousands of points, a scan hundreds of thousands of loops.
    pub fn to(&mut self, point: &Vec3) -> Result<Result<&'a BoundaryLoop, String>, Exhausted> {
        let mesh = &self.welded.surface.mesh;
        let balls = self.balls.get_or_insert_with(|| {
            let loops = || self.welded.loops.iter().filter(|l| !l.vertices.is_empty());
            let only_outer = loops().all(|l| l.kind == LoopKind::Outer);
            let looked_at = |l: &&BoundaryLoop| only_outer || l.kind != LoopKind::Outer;
            let rims = loops().filter(looked_at);
            rims.map(|rim| RimBall::of(rim, mesh)).collect()
        });
        self.steps.take(BALL_WORK * balls.len() as u64)?;
        let mut best: Option<(f64, &BoundaryLoop)> = None;
        for ball in balls.iter() {
            let least = (ball.centre - point).norm() - ball.radius;
            if best.is_some_and(|(distance, _)| least > distance) {
                continue;
            }
            self.steps
                .take(EDGE_WORK * ball.rim.vertices.len() as u64)?;
            let distance = distance_to_loop(mesh, ball.rim, point);
            if best.is_none_or(|(least, _)| distance.total_cmp(&least).is_lt()) {
                best = Some((distance, ball.rim));
            }
        }
        let Some((distance, rim)) = best else {
            return Ok(Err("the scan has no boundary loop".to_owned()));
        };
        let checked = self.limit.check("near", distance, "loop");
        Ok(checked.map(|()| rim))
    }
}

impl<'a> RimBall<'a> {
    fn of(rim: &'a BoundaryLoop, mesh: &TriMesh) -> RimBall<'a> {
        let places = || rim.vertices.iter().map(|v| mesh.positions[v.index()]);
        let low = places().fold(Vec3::repeat(f64::MAX), |m, p| m.inf(&p));
        let high = places().fold(Vec3::repeat(f64::MIN), |m, p| m.sup(&p));
        let centre = (low + high) * 0.5;
        let radius = places().map(|p| (p - centre).norm()).fold(0.0, f64::max);
        RimBall {
            rim,
            centre,
            // A rounding error must not hide the nearest.
            radius: radius * (1.0 + 1e-9),
        }
    }
}
