//! Which triangles of a patch cut each other or the scan around it: a sweep along one axis finds pairs with overlapping
//! boxes, plane tests with an error margin reject most of them, the exact predicates of `mesh::intersect` judge the
//! rest.

use darn_budget::{Budget, Exhausted, Steps};
use rayon::prelude::*;

use crate::mesh::bounds::Bounds;
use crate::mesh::intersect::cut;
use crate::mesh::{TriMesh, Vec3};

/// All pairs of faces `(f, g)`, `f < g`, that cut each other, with `g` not below `first`; ascending.
///
/// The same result as [`intersections_within`](crate::mesh::intersect::intersections_within) for the faces from `first` on, in less time.
///
/// # Errors
/// `Exhausted`.
pub(super) fn intersections_from(
    mesh: &TriMesh,
    first: usize,
    budget: &Budget,
) -> Result<Vec<(u32, u32)>, Exhausted> {
    let mut pairs = intersections_of(mesh, |face| face >= first, budget)?;
    pairs.sort_unstable();
    Ok(pairs)
}

/// [`intersections_from`] after faces of the patch have moved, from the pairs `before` that. `has_moved` says of every face of the mesh whether it
/// did: a pair of two that did not stays.
///
/// # Errors
/// `Exhausted`.
pub(super) fn intersections_after(
    mesh: &TriMesh,
    has_moved: &[bool],
    before: &[(u32, u32)],
    budget: &Budget,
) -> Result<Vec<(u32, u32)>, Exhausted> {
    let mut pairs = intersections_of(mesh, |face| has_moved[face], budget)?;
    let stayed = |(f, g): &&(u32, u32)| !has_moved[*f as usize] && !has_moved[*g as usize];
    pairs.extend(before.iter().filter(stayed));
    pairs.sort_unstable();
    Ok(pairs)
}

/// All pairs of faces that cut each other, at least one of them the patch's own.
fn intersections_of(
    mesh: &TriMesh,
    is_own: impl Fn(usize) -> bool,
    budget: &Budget,
) -> Result<Vec<(u32, u32)>, Exhausted> {
    let mut steps = Steps::of(budget);
    let mut pairs = Vec::new();
    for (f, g) in candidates(mesh, is_own, budget)? {
        steps.take(EXACT_WORK)?;
        if cut(mesh, f, g) {
            pairs.push((f, g));
        }
    }
    Ok(pairs)
}

/// Pairs that may cut: their boxes overlap and no plane test separates them. Two faces that are not the patch's own are never
/// compared.
///
/// # Errors
/// `Exhausted`.
fn candidates(
    mesh: &TriMesh,
    is_own: impl Fn(usize) -> bool,
    budget: &Budget,
) -> Result<Vec<(u32, u32)>, Exhausted> {
    budget.spend(BOX_WORK * mesh.faces.len() as u64)?;
    let boxed = |face: usize| FaceBox::new(mesh, face);
    let (own, held): (Vec<usize>, Vec<usize>) = (0..mesh.faces.len()).partition(|f| is_own(*f));
    let mut own: Vec<FaceBox> = own.into_iter().filter_map(boxed).collect();
    let Some(all) = own.iter().map(|b| b.bounds).reduce(Bounds::merged) else {
        return Ok(Vec::new());
    };
    let near = |b: &FaceBox| b.bounds.meets(&all);
    let held = held.into_iter().filter_map(boxed);
    let mut held: Vec<FaceBox> = held.filter(near).collect();
    let strips = Strips::new(&own, &held, &all);
    let (own, held) = (strips.cut(&mut own), strips.cut(&mut held));
    // Their number depends on no thread, nor does the work that is counted.
    let share = own.len().div_ceil(SHARES).max(1);
    let shares = own.par_chunks(share).zip(held.par_chunks(share));
    let pairs = shares.enumerate().map(|(place, (own, held))| {
        let mut pairs = Vec::new();
        let mut steps = Steps::of(budget);
        for (strip, (own, held)) in (place * share..).zip(own.iter().zip(held)) {
            strips.sweep(own, held, &mut steps, |a, b| {
                if strips.first_of_both(a, b) == strip && !surely_apart(mesh, a.face, b.face) {
                    pairs.push((a.face.min(b.face), a.face.max(b.face)));
                }
            })?;
        }
        Ok(pairs)
    });
    let pairs: Vec<Vec<(u32, u32)>> = pairs.collect::<Result<_, _>>()?;
    Ok(pairs.concat())
}

/// Into how many pieces of work strips are divided, at most.
const SHARES: usize = 8;

/// Nanoseconds of work a face when its box is made and sorted.
const BOX_WORK: u64 = 50;
/// Nanoseconds of work a pair of boxes in a sweep.
const SWEEP_WORK: u64 = 3;
/// Nanoseconds of work a pair of faces whose boxes meet.
const PAIR_WORK: u64 = 40;
/// Nanoseconds of work a pair of faces in the exact test.
const EXACT_WORK: u64 = 200;

/// A face with its box.
struct FaceBox {
    bounds: Bounds,
    face: u32,
}

impl FaceBox {
    /// The box of a face; `None` when a corner is not finite, because such a face cuts nothing.
    fn new(mesh: &TriMesh, face: usize) -> Option<FaceBox> {
        let face = face as u32;
        Bounds::of_face(mesh, face as usize).map(|bounds| FaceBox { bounds, face })
    }
}

/// Strips side by side over the patch, each swept by itself: one sweep over a whole sheet would compare every face with
/// a row of others.
struct Strips {
    /// The axis of the sweep.
    along: usize,
    /// The axis on which strips follow each other.
    across: usize,
    /// Where the first strip starts on it, scene units.
    bottom: f64,
    /// Width of a strip, scene units.
    width: f64,
    /// Index of the last strip.
    last: usize,
}

/// How many strips of this width lie below a height. The cast takes negative heights to 0, and also 0 ÷ 0, where the
/// patch is a line.
fn strips_below(height: f64, width: f64) -> usize {
    (height / width) as usize
}

impl Strips {
    /// Strips over the box `all` of the patch, at least as wide as the mean box, so that a box lies in about three
    /// strips at most.
    fn new(own: &[FaceBox], held: &[FaceBox], all: &Bounds) -> Strips {
        let Bounds { low, high } = all;
        let size = high - low;
        let along = size.imax();
        let (second, third) = ((along + 1) % 3, (along + 2) % 3);
        let across = if size[third] > size[second] {
            third
        } else {
            second
        };
        let within = |b: &FaceBox| {
            b.bounds.high[across].min(high[across]) - b.bounds.low[across].max(low[across])
        };
        let count = own.len() + held.len();
        let mean = own.iter().chain(held).map(within).sum::<f64>() / count as f64;
        let width = mean.max(size[across] / count as f64);
        Strips {
            along,
            across,
            bottom: low[across],
            width,
            last: strips_below(size[across], width).min(count),
        }
    }

    /// The strip at a coordinate; coordinates beyond the patch belong to the outermost strips.
    fn at(&self, coordinate: f64) -> usize {
        strips_below(coordinate - self.bottom, self.width).min(self.last)
    }

    /// The boxes that reach into each strip, ascending along the sweep.
    fn cut<'b>(&self, boxes: &'b mut [FaceBox]) -> Vec<Vec<&'b FaceBox>> {
        let low = |b: &FaceBox| b.bounds.low[self.along];
        boxes.sort_unstable_by(|a, b| low(a).total_cmp(&low(b)).then(a.face.cmp(&b.face)));
        let mut strips = vec![Vec::new(); self.last + 1];
        for b in &*boxes {
            let (from, to) = (b.bounds.low[self.across], b.bounds.high[self.across]);
            for strip in &mut strips[self.at(from)..=self.at(to)] {
                strip.push(b);
            }
        }
        strips
    }

    /// The first strip that two boxes have in common; their pair is counted there.
    fn first_of_both(&self, a: &FaceBox, b: &FaceBox) -> usize {
        self.at(a.bounds.low[self.across].max(b.bounds.low[self.across]))
    }

    /// Calls `found` once with every pair of boxes in a strip that meet, at least one of them the patch's own.
    ///
    /// # Errors
    /// `Exhausted`.
    fn sweep(
        &self,
        own: &[&FaceBox],
        held: &[&FaceBox],
        steps: &mut Steps,
        mut found: impl FnMut(&FaceBox, &FaceBox),
    ) -> Result<(), Exhausted> {
        let low = |b: &FaceBox| b.bounds.low[self.along];
        let mut start_from = |a: &FaceBox, others: &[&FaceBox]| {
            let (mut swept, mut met) = (0, 0);
            (others.iter())
                .take_while(|b| low(b) <= a.bounds.high[self.along])
                .inspect(|_| swept += 1)
                .filter(|b| a.bounds.meets(&b.bounds))
                .for_each(|b| {
                    met += 1;
                    found(a, b);
                });
            steps.take(SWEEP_WORK * swept + PAIR_WORK * met)
        };
        for (k, a) in own.iter().enumerate() {
            start_from(a, &own[k + 1..])?;
            start_from(a, &held[held.partition_point(|b| low(b) < low(a))..])?;
        }
        for a in held {
            start_from(a, &own[own.partition_point(|b| low(b) <= low(a))..])?;
        }
        Ok(())
    }
}

/// Whether plane tests in floating point show that two faces do not cut each other; also true when they share an edge.
fn surely_apart(mesh: &TriMesh, f: u32, g: u32) -> bool {
    let (f, g) = (mesh.faces[f as usize], mesh.faces[g as usize]);
    let (mut turned_f, mut turned_g, mut shared) = (f, g, 0);
    for (i, v) in f.iter().enumerate() {
        if let Some(j) = g.iter().position(|w| w == v) {
            shared += 1;
            turned_f.rotate_left(i);
            turned_g.rotate_left(j);
        }
    }
    if shared > 1 {
        return true;
    }
    let place = |v: u32| mesh.positions[v as usize];
    let (a, b) = (turned_f.map(place), turned_g.map(place));
    // A shared corner comes first now; then only the edge opposite it can pass through the other face.
    let edges = if shared == 1 { 1..2 } else { 0..3 };
    misses(&a, &b, edges.clone()) && misses(&b, &a, edges)
}

/// Whether certainly none of these edges of `a` (k: from corner k to k + 1) passes through `b`.
fn misses(a: &[Vec3; 3], b: &[Vec3; 3], mut edges: std::ops::Range<usize>) -> bool {
    let (u, v) = (b[1] - b[0], b[2] - b[0]);
    let normal = u.cross(&v);
    let size =
        (u.amax() + v.amax()) + (a[0] - b[0]).amax() + (a[1] - b[0]).amax() + (a[2] - b[0]).amax();
    let doubt = MARGIN * size * size * size;
    let side = |p: &Vec3| normal.dot(&(p - b[0]));
    edges.all(|k| {
        let (p, q) = (a[k], a[(k + 1) % 3]);
        let (below, above) = (side(&p), side(&q));
        if (below > doubt && above > doubt) || (below < -doubt && above < -doubt) {
            return true;
        }
        // The line from p to q misses the face when it passes its sides with different turns.
        let along = q - p;
        let corners = b.map(|c| c - p);
        let turn = |k: usize| along.dot(&corners[k].cross(&corners[(k + 1) % 3]));
        let turns = [turn(0), turn(1), turn(2)];
        turns.iter().any(|t| *t > doubt) && turns.iter().any(|t| *t < -doubt)
    })
}

/// Bound of the rounding error of a volume ÷ cubed length; far above that of f64.
const MARGIN: f64 = 1e-13;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::intersect::intersections_within;
    use crate::mesh::shapes::{concat, sheet};
    use proptest::prelude::*;

    /// Position of a triangle, decimal logarithm of its size, its corners at size 1.
    type Placed = ([f64; 3], f64, [[f64; 3]; 3]);

    /// Triangles that share no vertices; coordinates are multiples of `grain`.
    fn scattered(places: &[Placed], grain: f64) -> TriMesh {
        let rounded = |p: Vec3| p.map(|x| (x / grain).round() * grain);
        let corners = |(place, log, corners): &Placed| {
            let (place, size) = (Vec3::from(*place), 10f64.powf(*log));
            corners.map(|c| rounded(place + Vec3::from(c) * size))
        };
        TriMesh {
            positions: places.iter().flat_map(corners).collect(),
            faces: (0..places.len() as u32)
                .map(|f| [3 * f, 3 * f + 1, 3 * f + 2])
                .collect(),
        }
    }

    /// [`candidates`] by a look at all pairs, ascending.
    fn candidates_of_all(mesh: &TriMesh, first: usize) -> Vec<(u32, u32)> {
        let boxes: Vec<FaceBox> = (0..mesh.faces.len())
            .filter_map(|f| FaceBox::new(mesh, f))
            .collect();
        let pairs = boxes.iter().enumerate().flat_map(|(k, a)| {
            let later = boxes[k + 1..].iter();
            later.map(move |b| (a, b))
        });
        pairs
            .filter(|(a, b)| b.face as usize >= first && a.bounds.meets(&b.bounds))
            .map(|(a, b)| (a.face, b.face))
            .filter(|(f, g)| !surely_apart(mesh, *f, *g))
            .collect()
    }

    proptest! {
        #[test]
        fn the_strips_find_what_all_pairs_find(
            places in prop::collection::vec(
                (prop::array::uniform3(-1.0..1.0f64), -2.0..0.5f64, prop::array::uniform3(prop::array::uniform3(-1.0..1.0f64))), 1..120,
            ),
            share in 0.0..1.0f64, grain in prop::sample::select(vec![1e-9, 0.125]), flat in prop::sample::select(vec![1.0, 0.0]),
        ) {
            let mut mesh = scattered(&places, grain);
            mesh.positions.iter_mut().for_each(|p| p.y *= flat);
            let first = (share * mesh.faces.len() as f64) as usize;
            let mut found = candidates(&mesh, |face| face >= first, Budget::unlimited()).unwrap();
            found.sort_unstable();
            prop_assert_eq!(found, candidates_of_all(&mesh, first), "each pair once");
        }

        #[test]
        fn the_sweep_finds_what_the_tree_finds(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 30..60),
            faces in prop::collection::vec(prop::array::uniform3(0u32..30), 20..60),
            share in 0.0..1.0f64, grain in prop::sample::select(vec![1e-9, 0.25]),
        ) {
            // A coarse grain makes corners coincide and triangles coplanar.
            let rounded = |p: [f64; 3]| Vec3::from(p.map(|x| (x / grain).round() * grain));
            let mesh = TriMesh {
                positions: points.into_iter().map(rounded).collect(),
                faces: faces.into_iter().filter(|f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0]).collect(),
            };
            let first = (share * mesh.faces.len() as f64) as usize;
            let own: Vec<u32> = (first as u32..mesh.faces.len() as u32).collect();
            prop_assert_eq!(intersections_from(&mesh, first, Budget::unlimited()), intersections_within(&mesh, &own, Budget::unlimited()));
        }
    }

    proptest! {
        #[test]
        fn after_a_move_the_pairs_are_those_of_a_new_search(
            places in prop::collection::vec(
                (prop::array::uniform3(-1.0..1.0f64), -1.0..0.5f64, prop::array::uniform3(prop::array::uniform3(-1.0..1.0f64))), 2..80,
            ),
            share in 0.0..1.0f64, moves in prop::collection::vec(any::<bool>(), 80),
        ) {
            let mut mesh = scattered(&places, 1e-9);
            let never = Budget::unlimited();
            let first = (share * mesh.faces.len() as f64) as usize;
            let before = intersections_from(&mesh, first, never).unwrap();
            let moved: Vec<bool> = (0..mesh.faces.len()).map(|f| f >= first && moves[f]).collect();
            for (f, _) in moved.iter().enumerate().filter(|(_, moved)| **moved) {
                (3 * f..3 * f + 3).for_each(|v| mesh.positions[v].x += 0.3);
            }
            let after = intersections_after(&mesh, &moved, &before, never);
            prop_assert_eq!(after, intersections_from(&mesh, first, never));
        }
    }

    #[test]
    fn layers_with_corners_that_are_not_finite_cut_where_the_tree_finds_it() {
        let n = 40;
        let wall = sheet(
            n,
            |_, _| true,
            |u, v| Vec3::new(0.47, 0.9 * u + 0.03, 1.01 * v - 0.52),
        );
        let mut floor = sheet(n, |_, _| true, |u, v| Vec3::new(u, v, 0.01 * u));
        floor.positions[0].x = f64::NAN;
        floor.positions[n].z = f64::INFINITY;
        for (held, patch) in [(&wall, &floor), (&floor, &wall)] {
            let (both, first) = (concat(held, patch), held.faces.len());
            let own: Vec<u32> = (first as u32..both.faces.len() as u32).collect();
            let found = intersections_from(&both, first, Budget::unlimited()).unwrap();
            assert!(found.len() >= 2 * n - 2, "{}", found.len());
            assert_eq!(
                Ok(found),
                intersections_within(&both, &own, Budget::unlimited())
            );
        }
    }
}
