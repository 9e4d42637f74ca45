//! The cloth around a hole: a piece of the mesh that is a disk once its holes are closed.

use darn_budget::{Budget, Exhausted};

use super::TriMesh;
use super::growth::Growth;
use super::index::{FaceId, LoopId, VertexId};
use super::loops::BoundaryLoop;
use super::piece::Piece;
use super::topology::Topology;
use super::tube_cut::{CutEdges, add_cut};

/// A piece of the mesh around one hole, as a mesh of its own.
///
/// Plain numbers index the region's own mesh; [`VertexId`] and [`FaceId`] index the whole mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The piece as scanned; every boundary vertex lies on exactly one of its loops.
    pub mesh: TriMesh,
    /// Per vertex of the piece its vertex of the whole mesh. A vertex where the piece touches itself only in a point, or
    /// along which it is cut open, appears twice.
    pub vertices: Vec<VertexId>,
    /// Per face of the piece its face of the whole mesh: ascending, then those of islands.
    pub faces: Vec<FaceId>,
    /// Vertices of the piece along the hole asked for, in its loop's order.
    pub rim: Vec<u32>,
    /// The other holes that lie wholly inside, each along its half-edges.
    pub holes: Vec<Vec<u32>>,
    /// The borders of islands: pieces of cloth that lie loose in the hole and belong to it, each along its half-edges.
    /// [`grow`] finds none; [`Region::with_island`] adds one.
    pub islands: Vec<Vec<u32>>,
    /// The one outer loop, along its half-edges; may follow loops of the whole mesh where the piece is cut by them.
    pub outer: Vec<u32>,
    /// The reach that was used, scene units: the one asked for unless that was below three edges, beyond the mesh, or
    /// gave no disk.
    pub reach: f64,
    /// Whether the cloth within the reach asked for was no disk: it wraps around a tube, or meets itself.
    pub wraps: bool,
}

/// Why there is no region around a rim.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RegionError {
    /// The rim asked for is not among the loops.
    #[error("loop {rim} does not exist; the mesh has {loops} boundary loop(s)")]
    NoSuchLoop {
        /// The loop asked for.
        rim: LoopId,
        /// How many loops there are.
        loops: usize,
    },
    /// Products of coordinates this large overflow.
    #[error(
        "a coordinate of the cloth round loop {rim} is {coordinate:e}; at most {limit:e} can be measured"
    )]
    TooLarge {
        /// The rim.
        rim: LoopId,
        /// The largest coordinate.
        coordinate: f64,
        /// The largest allowed.
        limit: f64,
    },
    /// Even three edges wide the cloth around the rim is no disk.
    #[error(
        "the cloth within {reach:.4} of loop {rim} has {handles} handle(s) and {outer} outer loop(s); \
         it must be a disk with one outer loop once its holes are closed"
    )]
    NotADisk {
        /// The rim.
        rim: LoopId,
        /// Handles (genus) of the piece.
        handles: usize,
        /// Loops that are not holes; should be 1.
        outer: usize,
        /// The smallest reach tried, scene units.
        reach: f64,
    },
    /// The request's budget is exhausted.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
}

/// A mesh with what is known of its borders.
#[derive(Debug, Clone, Copy)]
pub struct BoundedMesh<'a> {
    /// The mesh.
    pub mesh: &'a TriMesh,
    /// Its topology.
    pub topology: &'a Topology,
    /// Its boundary loops.
    pub loops: &'a [BoundaryLoop],
}

/// What the reach is multiplied by when the piece is no disk.
const SHRINK: f64 = 0.8;
/// Largest coordinate that a region may have, scene units: its cube does not overflow.
const LARGEST: f64 = 1e100;

/// The cloth within geodesic distance `reach` (scene units; infinite for all there is) of loop `rim`, made a disk.
///
/// Shallow pieces that the region encloses are filled in, islands are dropped. When the rest is not a disk once its
/// holes are closed (it wraps around a sleeve, or meets itself behind a fold), the reach shrinks in steps down to
/// about three edges, which is also the least it starts from. Other hole loops wholly inside become `holes`; those
/// that the border cuts become part of `outer`.
///
/// # Errors
/// When the rim does not exist, a coordinate exceeds 10¹⁰⁰, or no reach gives a disk; `Exhausted`.
pub fn grow(
    whole: &BoundedMesh,
    rim: LoopId,
    reach: f64,
    budget: &Budget,
) -> Result<Region, RegionError> {
    let mesh = whole.mesh;
    let growth = growth_from(whole, rim, reach, budget)?;
    let asked = growth.rim;
    let narrowest = growth.narrowest;
    let distances = growth.distance.written().map(|v| growth.distance[v]);
    let farthest = distances.filter(|d| d.is_finite()).fold(0.0, f64::max);
    let mut reach = reach.min(farthest);
    let mut wraps = false;
    loop {
        reach = reach.max(narrowest);
        let inside = growth.inside(reach, budget)?;
        let shape = match Piece::new(&growth, &inside, &CutEdges::new(), reach).disk() {
            Ok(region) => {
                small_enough(mesh, asked, &region.vertices)?;
                return Ok(Region { wraps, ..region });
            }
            Err(shape) => shape,
        };
        wraps = true;
        if reach <= narrowest {
            return Err(RegionError::NotADisk {
                rim: asked.id,
                handles: shape.handles,
                outer: shape.outer,
                reach,
            });
        }
        reach *= SHRINK;
    }
}

/// Most cuts that open a region: one for a tube, two where a tube forks.
const CUTS: usize = 2;

/// The cloth within geodesic distance `reach` (scene units) of loop `rim` where it wraps around a tube: cut open along
/// the far side of the tube, so that it is a disk once its holes are closed. `None` where no cut makes it one.
///
/// # Errors
/// As [`grow`].
pub fn grow_cut_open(
    whole: &BoundedMesh,
    rim: LoopId,
    reach: f64,
    budget: &Budget,
) -> Result<Option<Region>, RegionError> {
    let growth = growth_from(whole, rim, reach, budget)?;
    let asked = growth.rim;
    let reach = reach.max(growth.narrowest);
    let inside = growth.inside(reach, budget)?;
    let mut cut = CutEdges::new();
    let mut piece = Piece::new(&growth, &inside, &cut, reach);
    for _ in 0..CUTS {
        if piece.handles > 0 || piece.rest.len() < 2 || !add_cut(&piece, &growth, &mut cut, budget)?
        {
            break;
        }
        piece = Piece::new(&growth, &inside, &cut, reach);
    }
    let Ok(region) = piece.disk() else {
        return Ok(None);
    };
    small_enough(whole.mesh, asked, &region.vertices)?;
    Ok(Some(Region {
        wraps: true,
        ..region
    }))
}

/// The cloth within geodesic distance `reach` (scene units, at least about three edges) of loop `rim`, whatever its
/// shape: it may wrap around a tube, have handles and several outer loops, or none. Its `outer` is empty, and so is
/// `holes`.
///
/// # Errors
/// When the rim does not exist or a coordinate exceeds 10¹⁰⁰; `Exhausted`.
pub fn collar(
    whole: &BoundedMesh,
    rim: LoopId,
    reach: f64,
    budget: &Budget,
) -> Result<Region, RegionError> {
    let growth = growth_from(whole, rim, reach, budget)?;
    let asked = growth.rim;
    let reach = reach.max(growth.narrowest);
    let inside = growth.inside(reach, budget)?;
    let piece = Piece::new(&growth, &inside, &CutEdges::new(), reach);
    let region = Region {
        holes: Vec::new(),
        ..piece.region
    };
    small_enough(whole.mesh, asked, &region.vertices)?;
    Ok(region)
}

/// The cloth by its distance from loop `rim`, up to `reach`, scene units.
///
/// # Errors
/// When the rim does not exist or one of its coordinates exceeds 10¹⁰⁰; `Exhausted`.
fn growth_from<'a>(
    whole: &BoundedMesh<'a>,
    rim: LoopId,
    reach: f64,
    budget: &Budget,
) -> Result<Growth<'a>, RegionError> {
    let Some(asked) = whole.loops.get(rim.index()) else {
        return Err(RegionError::NoSuchLoop {
            rim,
            loops: whole.loops.len(),
        });
    };
    small_enough(whole.mesh, asked, &asked.vertices)?;
    Ok(Growth::new(*whole, asked, reach, budget)?)
}

fn small_enough(
    mesh: &TriMesh,
    rim: &BoundaryLoop,
    vertices: &[VertexId],
) -> Result<(), RegionError> {
    let sizes = vertices.iter().map(|v| mesh.positions[v.index()].amax());
    let coordinate = sizes.fold(0.0, f64::max);
    if coordinate <= LARGEST {
        return Ok(());
    }
    Err(RegionError::TooLarge {
        rim: rim.id,
        coordinate,
        limit: LARGEST,
    })
}

/// The region of this reach around the first hole of a welded mesh, for tests.
#[cfg(test)]
pub(crate) fn region_around_hole(mesh: &TriMesh, reach: f64) -> Region {
    let topology = Topology::new(mesh);
    let loops = super::loops::boundary_loops(mesh, &topology);
    let hole = loops.iter().find(|l| l.is_surrounded());
    let whole = BoundedMesh {
        mesh,
        topology: &topology,
        loops: &loops,
    };
    let rim = hole.expect("the mesh has a hole").id;
    grow(&whole, rim, reach, Budget::unlimited()).expect("a region")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Vec3;
    use crate::mesh::loops::{LoopKind, boundary_loops};
    use crate::mesh::pairing::Paired;
    use crate::mesh::shapes::{holed_sheet, jitter, sheet, tube};
    use crate::mesh::weld::weld;

    struct Whole {
        mesh: Arc<TriMesh>,
        topology: Topology,
        loops: Vec<BoundaryLoop>,
    }

    impl Whole {
        fn new(soup: &TriMesh) -> Self {
            let mesh = weld(soup).mesh;
            let topology = Topology::new(&mesh);
            let loops = boundary_loops(&mesh, &topology);
            Self {
                mesh,
                topology,
                loops,
            }
        }

        fn hole(&self) -> &BoundaryLoop {
            let mut loops = self.loops.iter();
            let hole = loops.find(|l| l.kind == LoopKind::Hole);
            hole.expect("the shape has a hole")
        }

        fn grow(&self, reach: f64) -> Result<Region, RegionError> {
            self.grow_around(self.hole().id, reach)
        }

        fn grow_around(&self, rim: LoopId, reach: f64) -> Result<Region, RegionError> {
            let whole = BoundedMesh {
                mesh: &self.mesh,
                topology: &self.topology,
                loops: &self.loops,
            };
            grow(&whole, rim, reach, Budget::unlimited())
        }
    }

    /// What holds for every region: it is a manifold disk with holes whose rim and faces are those of the whole mesh.
    fn check(whole: &Whole, region: &Region) -> Result<(), TestCaseError> {
        let rim: Vec<VertexId> = region
            .rim
            .iter()
            .map(|&v| region.vertices[v as usize])
            .collect();
        prop_assert_eq!(&rim, &whole.hole().vertices);
        for (l, f) in region.faces.iter().enumerate() {
            prop_assert_eq!(
                region.mesh.faces[l].map(|v| region.vertices[v as usize].0),
                whole.mesh.faces[f.index()]
            );
        }
        let topology = Topology::new(&region.mesh);
        prop_assert_eq!(topology.components, 1);
        let mut found: Vec<u32> = boundary_loops(&region.mesh, &topology)
            .into_iter()
            .flat_map(|l| l.vertices)
            .map(|v| v.0)
            .collect();
        let loops = 2 + region.holes.len();
        let mut told: Vec<u32> = region
            .holes
            .iter()
            .flatten()
            .chain(&region.rim)
            .chain(&region.outer)
            .copied()
            .collect();
        found.sort_unstable();
        told.sort_unstable();
        prop_assert_eq!(&found, &told);
        told.dedup();
        prop_assert_eq!(told.len(), found.len());
        let edges = (3 * region.faces.len() + topology.boundary().count()) / 2;
        let euler = region.mesh.positions.len() as i64 - edges as i64 + region.faces.len() as i64;
        prop_assert_eq!(euler, 2 - loops as i64);
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn regions_of_rough_cloth_are_disks_with_holes(
            n in 12usize..28, reach in 0.0..1.0f64, noise in 0.0..0.4f64, seed: u64,
            small_holes in prop::collection::vec((0.05..0.95f64, 0.05..0.95f64, 0.02..0.08f64), 0..6),
        ) {
            let keep = |u: f64, v: f64| {
                (u - 0.5).hypot(v - 0.5) > 0.2 && small_holes.iter().all(|m| (u - m.0).hypot(v - m.1) > m.2)
            };
            let bumps = |u: f64, v: f64| Vec3::new(u, v, 0.15 * (9.0 * u).sin() * (7.0 * v).cos());
            let whole = Whole::new(&jitter(&sheet(n, keep, bumps), noise / n as f64, seed));
            // The small holes may connect the hole with the border.
            prop_assume!(whole.loops.iter().any(|l| l.kind == LoopKind::Hole));
            let region = whole.grow(reach);
            prop_assert!(region.is_ok(), "{:?}", region.map(|_| ()));
            check(&whole, &region.expect("a region"))?;
        }

        #[test]
        fn a_region_of_a_flat_ring_is_the_band(n in 20usize..40, hole in 0.1..0.2f64, reach in 0.2..0.3f64) {
            let whole = Whole::new(&holed_sheet(n, hole));
            let region = whole.grow(reach).expect("a flat ring");
            check(&whole, &region)?;
            prop_assert_eq!(region.reach, reach);
            prop_assert!(region.holes.is_empty());
            let rim = whole.hole();
            let outside = |p: &Vec3| crate::mesh::nearest::distance_to_loop(&whole.mesh, rim, p);
            let edge = 1.5 / n as f64;
            for p in &region.mesh.positions {
                prop_assert!(outside(p) < reach + 1e-9, "{} {reach}", outside(p));
            }
            for &v in &region.outer {
                let p = &region.mesh.positions[v as usize];
                let at_the_border = [p.x, p.y].iter().any(|c| *c == 0.0 || *c == 1.0);
                prop_assert!(at_the_border || outside(p) > 0.9 * reach - 2.0 * edge);
            }
        }
    }

    #[test]
    fn cloth_around_a_tube_is_cut_open_on_the_far_side() {
        // A hole of 60 % of the circumference; the cut lies opposite, at u = 0.
        let keep = |u: f64, v: f64| (u - 0.5).abs() > 0.3 || (v - 0.5).abs() > 0.1;
        let whole = Whole::new(&tube(40, keep));
        let reach = 1.4;
        let shrunk = whole.grow(reach).expect("a narrow region");
        assert!(shrunk.wraps && shrunk.reach < reach);
        let bounded = BoundedMesh {
            mesh: &whole.mesh,
            topology: &whole.topology,
            loops: &whole.loops,
        };
        let open = grow_cut_open(&bounded, whole.hole().id, reach, Budget::unlimited());
        let open = open.expect("a tube").expect("a cut");
        assert!(open.reach == reach && open.faces.len() > shrunk.faces.len());
        let twice: Vec<Vec3> = (open.vertices.iter().zip(&open.mesh.positions))
            .filter(|(v, _)| open.vertices.iter().filter(|w| w == v).count() > 1)
            .map(|(_, p)| *p)
            .collect();
        assert!(!twice.is_empty());
        assert!(twice.iter().all(|p| p.x > 0.9), "{twice:?}");
    }

    #[test]
    fn all_of_a_sheet_is_within_infinite_reach() {
        let whole = Whole::new(&holed_sheet(12, 0.2));
        let region = whole.grow(f64::INFINITY).expect("a flat ring");
        assert_eq!(region.faces.len(), whole.mesh.faces.len());
        let outer: Vec<VertexId> = region
            .outer
            .iter()
            .map(|&v| region.vertices[v as usize])
            .collect();
        assert_eq!(
            outer,
            whole
                .loops
                .iter()
                .find(|l| l.kind == LoopKind::Outer)
                .expect("a border")
                .vertices
        );
    }

    #[test]
    fn a_band_around_a_tube_shrinks_to_a_disk() {
        let whole = Whole::new(&tube(40, |u, v| {
            (u - 0.5).abs() > 0.1 || (v - 0.5).abs() > 0.06
        }));
        let region = whole.grow(3.5).expect("cloth around a small hole");
        assert!(region.reach < 3.1, "{}", region.reach);
        assert!(check(&whole, &region).is_ok());
    }

    #[test]
    fn a_hole_nearly_all_around_a_tube_is_refused_with_numbers() {
        let whole = Whole::new(&tube(12, |u, v| {
            !(0.05..0.95).contains(&u) || (v - 0.5).abs() > 0.06
        }));
        let refused = whole.grow(1.0);
        assert!(
            matches!(
                refused,
                Err(RegionError::NotADisk {
                    handles: 0,
                    outer: 2,
                    ..
                })
            ),
            "{refused:?}"
        );
    }

    #[test]
    fn coordinates_too_large_to_measure_are_refused_with_numbers() {
        let mut huge = holed_sheet(12, 0.2);
        huge.positions.iter_mut().for_each(|p| *p *= 1e200);
        let refused = Whole::new(&huge).grow(1e199);
        assert!(
            matches!(refused, Err(RegionError::TooLarge { coordinate, .. }) if coordinate > 1e199),
            "{refused:?}"
        );
    }

    #[test]
    fn a_loop_that_does_not_exist_is_named() {
        let whole = Whole::new(&holed_sheet(8, 0.2));
        let missing = whole.grow_around(LoopId(7), 1.0);
        assert_eq!(
            missing,
            Err(RegionError::NoSuchLoop {
                rim: LoopId(7),
                loops: 2
            })
        );
    }
}
