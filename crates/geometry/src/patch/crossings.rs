//! Which triangles of a patch cut each other or the cloth around: sweeps along one axis, floating-point rejection with margins, and the
//! exact predicates of `mesh::intersect` on the few pairs that are left.

use crate::mesh::intersect::intersections_with;
use crate::mesh::{TriMesh, Vec3};

/// All pairs of faces `(f, g)`, `f < g`, that cut each other, `g` at least `first`; ascending. The same as `intersections_with` gives.
pub(super) fn crossings(mesh: &TriMesh, first: usize) -> Vec<(u32, u32)> {
    let doubtful = doubtful(mesh, first);
    if doubtful.is_empty() {
        return Vec::new();
    }
    // The exact test, on a mesh of the doubtful faces alone.
    let mut faces: Vec<u32> = doubtful.iter().flat_map(|(f, g)| [*f, *g]).collect();
    faces.sort_unstable();
    faces.dedup();
    let few = mesh.part(faces.iter().map(|f| mesh.faces[*f as usize]));
    let asked: Vec<u32> = (0u32..)
        .zip(&faces)
        .filter(|(_, f)| **f as usize >= first)
        .map(|(k, _)| k)
        .collect();
    // `faces` ascend, so the pairs do, too.
    let found = intersections_with(&few, &asked).into_iter();
    found
        .map(|(f, g)| (faces[f as usize], faces[g as usize]))
        .collect()
}

/// Pairs that may cut: boxes overlap and no plane test keeps them surely apart. Two faces below `first` are never compared.
fn doubtful(mesh: &TriMesh, first: usize) -> Vec<(u32, u32)> {
    let boxed = |face: usize| Boxed::of(mesh, face);
    let mut own: Vec<Boxed> = (first..mesh.faces.len()).filter_map(boxed).collect();
    if own.is_empty() {
        return Vec::new();
    }
    let low = own.iter().fold(own[0].low, |m, b| m.inf(&b.low));
    let high = own.iter().fold(own[0].high, |m, b| m.sup(&b.high));
    let near = |b: &Boxed| (0..3).all(|d| b.low[d] <= high[d] && b.high[d] >= low[d]);
    let mut held: Vec<Boxed> = (0..first).filter_map(boxed).filter(near).collect();
    let strips = Strips::of(&own, &held, (low, high));
    let (own, held) = (strips.cut(&mut own), strips.cut(&mut held));
    let mut pairs = Vec::new();
    for (strip, (own, held)) in own.iter().zip(&held).enumerate() {
        strips.sweep(own, held, |a, b| {
            if strips.first_of_both(a, b) == strip && !surely_apart(mesh, a.face, b.face) {
                pairs.push((a.face.min(b.face), a.face.max(b.face)));
            }
        });
    }
    pairs
}

/// A face with its box.
struct Boxed {
    low: Vec3,
    high: Vec3,
    face: u32,
}

impl Boxed {
    /// `None` when a corner is not finite: such a face counts as cutting nothing.
    fn of(mesh: &TriMesh, face: usize) -> Option<Boxed> {
        let [a, b, c] = mesh.triangle(face);
        let finite = [a, b, c].iter().all(|p| p.iter().all(|x| x.is_finite()));
        finite.then(|| Boxed {
            low: a.inf(&b).inf(&c),
            high: a.sup(&b).sup(&c),
            face: face as u32,
        })
    }

    fn meets(&self, other: &Boxed) -> bool {
        (0..3).all(|d| self.low[d] <= other.high[d] && other.low[d] <= self.high[d])
    }
}

/// Strips side by side over the patch, each swept by itself: a sweep over all of a sheet compares every face with a whole row of others.
struct Strips {
    /// The axis that is swept along, and the one that strips follow each other on.
    along: usize,
    across: usize,
    bottom: f64,
    width: f64,
    last: usize,
}

/// How many strips of a width there are below a height. The cast takes what is negative to 0, and so it does 0 ÷ 0, of a patch that is
/// a line.
fn strips_below(height: f64, width: f64) -> usize {
    (height / width) as usize
}

impl Strips {
    /// As wide as a box in the mean, at least: so that all boxes together lie in no more than about three strips each.
    fn of(own: &[Boxed], held: &[Boxed], (low, high): (Vec3, Vec3)) -> Strips {
        let size = high - low;
        let along = size.imax();
        let (second, third) = ((along + 1) % 3, (along + 2) % 3);
        let across = if size[third] > size[second] {
            third
        } else {
            second
        };
        let within = |b: &Boxed| b.high[across].min(high[across]) - b.low[across].max(low[across]);
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

    /// The strip of a place; what lies beside the patch counts to the outermost.
    fn at(&self, place: f64) -> usize {
        strips_below(place - self.bottom, self.width).min(self.last)
    }

    /// The boxes that reach into each strip, ascending along the sweep.
    fn cut<'b>(&self, boxes: &'b mut [Boxed]) -> Vec<Vec<&'b Boxed>> {
        let low = |b: &Boxed| b.low[self.along];
        boxes.sort_unstable_by(|a, b| low(a).total_cmp(&low(b)).then(a.face.cmp(&b.face)));
        let mut strips = vec![Vec::new(); self.last + 1];
        for b in &*boxes {
            for strip in &mut strips[self.at(b.low[self.across])..=self.at(b.high[self.across])] {
                strip.push(b);
            }
        }
        strips
    }

    /// The first strip that two boxes which meet reach into both: the one in which their pair counts.
    fn first_of_both(&self, a: &Boxed, b: &Boxed) -> usize {
        self.at(a.low[self.across].max(b.low[self.across]))
    }

    /// Calls `found` with every pair of boxes of a strip that meet, one of them at least the patch's own; each pair once.
    fn sweep(&self, own: &[&Boxed], held: &[&Boxed], mut found: impl FnMut(&Boxed, &Boxed)) {
        let low = |b: &Boxed| b.low[self.along];
        let mut start_from = |a: &Boxed, others: &[&Boxed]| {
            (others.iter())
                .take_while(|b| low(b) <= a.high[self.along])
                .filter(|b| a.meets(b))
                .for_each(|b| found(a, b));
        };
        for (k, a) in own.iter().enumerate() {
            start_from(a, &own[k + 1..]);
            start_from(a, &held[held.partition_point(|b| low(b) < low(a))..]);
        }
        for a in held {
            start_from(a, &own[own.partition_point(|b| low(b) <= low(a))..]);
        }
    }
}

/// Whether floating point alone shows that two faces do not cut each other, or they share an edge.
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
    // With a shared corner, which comes first now, only the edges opposite it can pass through the other face.
    let edges = if shared == 1 { 1..2 } else { 0..3 };
    misses(&a, &b, edges.clone()) && misses(&b, &a, edges)
}

/// Whether none of the edges of `a` passes through `b`, for sure.
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
        // The line from p to q passes beside the face when it turns one way round one side and the other way round another.
        let along = q - p;
        let corners = b.map(|c| c - p);
        let turn = |k: usize| along.dot(&corners[k].cross(&corners[(k + 1) % 3]));
        let turns = [turn(0), turn(1), turn(2)];
        turns.iter().any(|t| *t > doubt) && turns.iter().any(|t| *t < -doubt)
    })
}

/// Rounding of a volume, in cubed lengths: far above what f64 loses.
const MARGIN: f64 = 1e-13;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{concat, sheet};
    use proptest::prelude::*;

    /// Where a triangle lies, the logarithm of its size, its corners at size 1.
    type Placed = ([f64; 3], f64, [[f64; 3]; 3]);

    /// Triangles that share no corners; these in whole units of `grain`.
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

    /// [`doubtful`] by looking at all pairs, ascending.
    fn doubtful_of_all(mesh: &TriMesh, first: usize) -> Vec<(u32, u32)> {
        let boxes: Vec<Boxed> = (0..mesh.faces.len())
            .filter_map(|f| Boxed::of(mesh, f))
            .collect();
        let pairs = boxes.iter().enumerate().flat_map(|(k, a)| {
            let later = boxes[k + 1..].iter();
            later.map(move |b| (a, b))
        });
        pairs
            .filter(|(a, b)| b.face as usize >= first && a.meets(b))
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
            let mut found = doubtful(&mesh, first);
            found.sort_unstable();
            prop_assert_eq!(found, doubtful_of_all(&mesh, first), "each pair once");
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
            prop_assert_eq!(crossings(&mesh, first), intersections_with(&mesh, &own));
        }
    }

    #[test]
    fn layers_cut_where_the_tree_finds_it_though_a_corner_is_no_number() {
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
            let found = crossings(&both, first);
            assert!(found.len() >= 2 * n - 2, "{}", found.len());
            assert_eq!(found, intersections_with(&both, &own));
        }
    }
}
