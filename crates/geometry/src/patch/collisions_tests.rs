//! Patches that cut what lies beside them come apart.

use darn_budget::Limits;

use super::*;
use crate::mesh::Vec2;
use crate::mesh::shapes::jitter;

/// A lattice of n × n vertices, unit spacing, at height `z` of their place; its faces count vertices from `first`
/// on.
fn lattice(n: u32, first: u32, z: impl Fn(Vec2) -> f64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let middle = Vec2::repeat(f64::from(n - 1) / 2.0);
    let at = |k: u32| Vec2::new(f64::from(k % n), f64::from(k / n)) - middle;
    let points = (0..n * n)
        .map(at)
        .map(|p| Vec3::new(p.x, p.y, z(p)))
        .collect();
    let faces = (0..n - 1)
        .flat_map(|j| (0..n - 1).map(move |i| first + j * n + i))
        .flat_map(|a| [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]])
        .collect();
    (points, faces)
}

#[test]
fn a_dent_through_another_layer_is_removed() {
    let (positions, mut faces) = lattice(14, 0, |p| 0.01 * p.x);
    let (first_face, base) = (faces.len(), positions.len() as u32);
    let (tile, tile_faces) = lattice(9, base, |p| 0.5 - 0.9 * (-0.5 * p.norm_squared()).exp());
    faces.extend(&tile_faces);
    let at = |v: u32| tile[(v - base) as usize];
    let edges: Vec<RestEdge> = (tile_faces.iter())
        .flat_map(|f| [(f[0], f[1]), (f[1], f[2])])
        .map(|(from, to)| RestEdge {
            from,
            to,
            length: (at(from) - at(to)).norm(),
        })
        .collect();
    let around = CollisionMesh {
        positions,
        faces,
        first_face,
        edges,
        mean_edge: 1.0,
        sides: Sides::default(),
    };
    let mut patch = Patch {
        rim: Vec::new(),
        flat: Vec::new(),
        positions: tile.clone(),
        faces: tile_faces,
        strain_rounds: 0,
        collisions: 0,
        crossings: 0,
    };
    let joined = |tile: &[Vec3]| TriMesh {
        positions: around.positions.iter().chain(tile).copied().collect(),
        faces: around.faces.clone(),
    };
    let before = intersections_from(&joined(&tile), first_face, Budget::unlimited())
        .unwrap()
        .len();
    assert!(before > 0);
    around
        .separate(&mut patch, Untangling::Always, Budget::unlimited())
        .unwrap();
    assert_eq!((patch.collisions, patch.crossings), (before, 0));
    assert_eq!(
        intersections_from(&joined(&patch.positions), first_face, Budget::unlimited()).unwrap(),
        []
    );
    let again = patch.positions.clone();
    around
        .separate(&mut patch, Untangling::Always, Budget::unlimited())
        .unwrap();
    assert_eq!(patch.collisions, before, "counted once");
    assert_eq!(
        patch.positions, again,
        "a patch that cuts nothing stays as it is"
    );

    // The result is the same when all of the mesh below is another layer.
    let layer = TriMesh {
        positions: around.positions.clone(),
        faces: around.faces[..first_face].to_vec(),
    };
    let own = |v: u32| v - base;
    let alone = CollisionMesh {
        positions: Vec::new(),
        faces: around.faces[first_face..]
            .iter()
            .map(|f| f.map(own))
            .collect(),
        first_face: 0,
        edges: around
            .edges
            .iter()
            .map(|e| RestEdge {
                from: own(e.from),
                to: own(e.to),
                length: e.length,
            })
            .collect(),
        mean_edge: 1.0,
        sides: Sides::default(),
    };
    (patch.positions, patch.collisions) = (tile, 0);
    alone
        .clone()
        .separate(&mut patch, Untangling::Always, Budget::unlimited())
        .unwrap();
    assert_eq!(patch.collisions, 0, "it does not cut itself");
    alone
        .with_layers(&layer)
        .separate(&mut patch, Untangling::Always, Budget::unlimited())
        .unwrap();
    assert_eq!((patch.collisions, patch.crossings), (before, 0));
    assert_eq!(patch.positions, again);
}

/// A patch of these triangles without a rim, and what is tested for collisions.
fn free(positions: Vec<Vec3>, faces: Vec<[u32; 3]>) -> (CollisionMesh, Patch) {
    let edge = |from, to| RestEdge {
        from,
        to,
        length: 1.0,
    };
    let edges = faces
        .iter()
        .flat_map(|f| [edge(f[0], f[1]), edge(f[1], f[2])]);
    let mesh = CollisionMesh {
        positions: Vec::new(),
        faces: faces.clone(),
        first_face: 0,
        edges: edges.collect(),
        mean_edge: 1.0,
        sides: Sides::default(),
    };
    let patch = Patch {
        rim: Vec::new(),
        flat: Vec::new(),
        positions,
        faces,
        strain_rounds: 0,
        collisions: 0,
        crossings: 0,
    };
    (mesh, patch)
}

#[test]
fn a_tangle_is_pushed_apart_only_where_that_is_of_use() {
    let (positions, faces) = lattice(9, 0, |_| 0.0);
    let sheet = TriMesh { positions, faces };
    let tangle = jitter(&sheet, 20.0, 1);
    let (mesh, patch) = free(tangle.positions.clone(), tangle.faces.clone());
    let all = intersections_from(&tangle, 0, Budget::unlimited()).unwrap();
    assert!(all.len() > TANGLE * tangle.faces.len(), "{}", all.len());
    let separated = |untangling| {
        let mut patch = patch.clone();
        let outcome = mesh.separate(&mut patch, untangling, Budget::unlimited());
        outcome.unwrap();
        patch
    };
    let left = separated(Untangling::UnlessTangled);
    assert_eq!((left.crossings, left.collisions), (all.len(), 0));
    assert_eq!(left.positions, tangle.positions);
    assert!(separated(Untangling::Always).crossings < all.len());
    // What may come apart does, either way.
    let fold = |p: Vec2| if p.norm() < 2.0 { -0.3 } else { 0.3 };
    let (mut positions, mut faces) = lattice(9, 0, |_| 0.0);
    let (tile, tile_faces) = lattice(9, positions.len() as u32, fold);
    positions.extend(tile);
    faces.extend(tile_faces);
    let (mesh, folded) = free(positions, faces);
    let [always, unless] = [Untangling::Always, Untangling::UnlessTangled].map(|untangling| {
        let mut patch = folded.clone();
        let outcome = mesh.separate(&mut patch, untangling, Budget::unlimited());
        outcome.unwrap();
        patch
    });
    assert!(always.collisions > 0);
    assert_eq!(always.positions, unless.positions);
}

#[test]
fn cuts_that_nothing_can_move_are_looked_at_a_few_times_only() {
    // Two sheets through each other, all of whose vertices are held.
    let (mut positions, mut faces) = lattice(9, 0, |_| 0.0);
    let base = positions.len() as u32;
    let (wall, wall_faces) = lattice(9, base, |p| p.x + 0.1);
    positions.extend(wall);
    faces.extend(wall_faces);
    let (mut mesh, mut patch) = free(Vec::new(), faces);
    mesh.positions = positions;
    mesh.edges.clear();
    let counted = || {
        let limits = Limits {
            work: u64::MAX - 1,
            ..Limits::default()
        };
        Budget::new(limits, &|| false)
    };
    let (once, all) = (counted(), counted());
    let joined = TriMesh {
        positions: mesh.positions.clone(),
        faces: mesh.faces.clone(),
    };
    let cuts = intersections_from(&joined, 0, &once).unwrap().len();
    assert!(cuts > 0);
    mesh.separate(&mut patch, Untangling::Always, &all).unwrap();
    assert_eq!((patch.crossings, patch.collisions), (cuts, 0));
    let push = PUSH_WORK * cuts as u64;
    assert!(
        all.spent() <= 4 * (once.spent() + push),
        "{} after {}",
        all.spent(),
        once.spent()
    );
}
