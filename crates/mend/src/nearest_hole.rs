//! Finds holes by a place near them: thousands of places among hundreds of thousands of loops.

use crate::welded_scan::WeldedScan;
use darn_budget::{Budget, Exhausted, Steps};
use darn_geometry::mesh::loops::{BoundaryLoop, LoopKind};
use darn_geometry::mesh::nearest::distance_to_loop;
use darn_geometry::mesh::{TriMesh, Vec3};

/// Finds the hole whose rim is nearest to a point.
pub struct NearestHole<'a> {
    welded: &'a WeldedScan,
    /// The holes with the balls around their rims; made when the first point is looked for.
    holes: Option<Vec<RimBall<'a>>>,
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

impl<'a> NearestHole<'a> {
    /// Looks in a scan.
    pub fn of(welded: &'a WeldedScan, budget: &'a Budget<'a>) -> NearestHole<'a> {
        NearestHole {
            welded,
            holes: None,
            steps: Steps::of(budget),
        }
    }

    /// The hole nearest to a point, the first of several, or why there is none.
    ///
    /// # Errors
    /// `Exhausted`: a request may have thousands of points, a scan hundreds of thousands of loops.
    pub fn to(&mut self, point: &Vec3) -> Result<Result<&'a BoundaryLoop, String>, Exhausted> {
        let mesh = &self.welded.surface.mesh;
        let holes = self.holes.get_or_insert_with(|| {
            let holes = self
                .welded
                .loops
                .iter()
                .filter(|l| l.kind == LoopKind::Hole);
            holes.map(|rim| RimBall::of(rim, mesh)).collect()
        });
        self.steps.take(BALL_WORK * holes.len() as u64)?;
        let mut best: Option<(f64, &BoundaryLoop)> = None;
        for hole in holes.iter() {
            let least = (hole.centre - point).norm() - hole.radius;
            if best.is_some_and(|(distance, _)| least > distance) {
                continue;
            }
            self.steps
                .take(EDGE_WORK * hole.rim.vertices.len() as u64)?;
            let distance = distance_to_loop(mesh, hole.rim, point);
            if best.is_none_or(|(least, _)| distance.total_cmp(&least).is_lt()) {
                best = Some((distance, hole.rim));
            }
        }
        Ok(best
            .map(|(_, rim)| rim)
            .ok_or_else(|| "the scan has no hole".to_owned()))
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
