//! A boundary loop as it lies when the cloth along it is laid flat.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use darn_geometry::mesh::curvature::inner_angle;
use darn_geometry::mesh::loops::BoundaryLoop;
use darn_geometry::mesh::topology::Topology;
use darn_geometry::mesh::{TriMesh, Vec2};

/// Points that a loop is looked at in, at most: a bite is wider than two of their distances.
const SAMPLES: usize = 512;
/// Largest ratio of length to chord of a hem that is smooth.
const LARGEST_WAVE: f64 = 1.1;

/// A loop laid flat, three times around, so that a stretch that starts in the middle round may run over its first vertex, and the hem before it, too.
/// Rounds differ by the loop's turning.
pub struct FlatLine {
    /// The loop's length.
    pub length: f64,
    /// Its mean edge.
    pub edge: f64,
    /// How many vertices it has.
    pub vertices: usize,
    /// Per vertex, three times around and once more: its place, and the length up to it.
    pub places: Vec<(Vec2, f64)>,
    /// Per vertex, three times around and once more: the turning of all vertices before it, radians.
    pub turned: Vec<f64>,
    /// All vertices, or as many at about equal distances, once around.
    pub samples: Vec<usize>,
}

impl FlatLine {
    /// Lays a loop flat. O(n).
    pub fn of(mesh: &TriMesh, topology: &Topology, rim: &BoundaryLoop) -> FlatLine {
        let n = rim.vertices.len();
        let at = |k: usize| mesh.positions[rim.vertices[k % n].index()];
        let turns: Vec<f64> = (rim.vertices.iter())
            .map(|v| PI - inner_angle(mesh, topology, *v))
            .collect();
        let (mut place, mut passed, mut heading) = (Vec2::zeros(), 0.0, 0.0_f64);
        let mut places = Vec::with_capacity(3 * n + 1);
        let (mut turned, mut turning) = (Vec::with_capacity(3 * n + 1), 0.0);
        for k in 0..=3 * n {
            places.push((place, passed));
            turned.push(turning);
            turning += turns[k % n];
            heading = (heading + turns[k % n]) % TAU;
            let edge = (at(k + 1) - at(k)).norm();
            place += Vec2::new(heading.cos(), heading.sin()) * edge;
            passed += edge;
        }
        let length = places[n].1;
        let sample = |s: usize| {
            let wanted = length * s as f64 / SAMPLES as f64;
            let at = places.partition_point(|(_, passed)| *passed < wanted);
            at.min(n - 1)
        };
        let mut samples: Vec<usize> = match n <= SAMPLES {
            true => (0..n).collect(),
            false => (0..SAMPLES).map(sample).collect(),
        };
        samples.dedup();
        FlatLine {
            length,
            edge: length / n as f64,
            vertices: n,
            places,
            turned,
            samples,
        }
    }

    /// The vertex of a sample, from the middle round on.
    pub fn sample(&self, s: usize) -> usize {
        let count = self.samples.len();
        self.samples[s % count] + (1 + s / count) * self.vertices
    }

    /// The length from one sample to another.
    pub fn length_of(&self, stretch: &Range<usize>) -> f64 {
        self.places[self.sample(stretch.end)].1 - self.places[self.sample(stretch.start)].1
    }

    /// How the hems beside a stretch turn over this length on each side, radians a scene unit; infinite where they are not smooth.
    pub fn turning_beside(&self, from: usize, to: usize, reach: f64) -> f64 {
        if self.hem(from, -reach).is_none() || self.hem(to, reach).is_none() {
            return f64::INFINITY;
        }
        let (first, last) = (
            self.vertex_after(from, -reach),
            self.vertex_after(to, reach),
        );
        // The corners of the stretch do not count.
        let turned = |from: usize, to: usize| self.turned[to.max(from + 1)] - self.turned[from + 1];
        (turned(first, from) + turned(to, last)) / (2.0 * reach)
    }

    /// The vertex at this length after another one; before it where the length is negative.
    pub fn vertex_after(&self, vertex: usize, reach: f64) -> usize {
        let passed = self.places[vertex].1 + reach;
        let end = self.places.partition_point(|(_, p)| *p < passed);
        end.min(self.places.len() - 1)
    }

    /// The direction of the hem over this length after a vertex, before it where the length is negative; `None` where
    /// the hem is not smooth.
    pub fn hem(&self, vertex: usize, reach: f64) -> Option<Vec2> {
        self.hem_within(vertex, reach, LARGEST_WAVE)
    }

    /// As `hem`; `None` where it is more than `wave` times as long as its chord.
    pub fn hem_within(&self, vertex: usize, reach: f64, wave: f64) -> Option<Vec2> {
        let (place, passed) = self.places[vertex];
        let (other, at) = self.places[self.vertex_after(vertex, reach)];
        let line = (other - place) * reach.signum();
        let (chord, length) = (line.norm(), (at - passed).abs());
        (chord > 0.0 && length < wave * chord).then(|| line / chord)
    }
}
