//! A flat sheet of a fabric with a hole, as a scan has it: triangles with coordinates in an image.

use darn_budget::Budget;
use darn_geometry::mesh::{TriMesh, Vec3};

use super::draw::{Draw, Family};
use super::fabric::{Fabric, Swatch};
use crate::frame::{Frame, NONE, owners};
use crate::input::{Cloth, LayerKind, PatchChart, Source, SourceImage, Wrap};

/// How the sheet lies in its image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// As a whole, and the image shows the fabric in the hole too.
    OneMap,
    /// In islands at random places, turned at random, with narrow gutters.
    Atlas,
    /// Both sides of a line lie on each other; the hole is across the line. The image shows the fabric in the hole too.
    Mirrored,
}

/// All layouts.
pub const LAYOUTS: [Layout; 3] = [Layout::OneMap, Layout::Atlas, Layout::Mirrored];

impl Layout {
    /// A name for tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Layout::OneMap => "one map",
            Layout::Atlas => "atlas",
            Layout::Mirrored => "mirrored",
        }
    }
}

/// Diameters of the holes, in texels.
pub const HOLES: [usize; 3] = [64, 128, 256];
/// Side of the sheet against the hole's diameter: the region that darn lays flat.
const SHEET: f64 = 2.0;
/// Squares along the sheet's side.
const SQUARES: usize = 40;
/// Texels around islands that show the cloth next to them.
const GUTTER: f32 = 3.0;
/// What an atlas shows where nothing lies.
const UNUSED: [u8; 4] = [24, 20, 28, 255];

/// A sheet with a hole, its image, and the truth.
pub struct TestScan {
    /// The cloth.
    pub swatch: Swatch,
    /// How it lies in the image.
    pub layout: Layout,
    /// Diameter of the hole in texels.
    pub hole: usize,
    /// Triangles with separate vertices at the borders of islands; x and y are texels from the middle, y up.
    pub mesh: TriMesh,
    /// Per vertex.
    pub texcoords: Vec<[f32; 2]>,
    /// The triangles that are missing.
    pub patch: PatchChart,
    /// Rows and columns of the image.
    pub side: usize,
    /// The image.
    pub texels: Vec<[u8; 4]>,
    fold: Fold,
}

/// A line along which a mirrored sheet is folded.
#[derive(Clone, Copy)]
struct Fold {
    /// Whether the line is one of equal y instead of equal x.
    axis: usize,
    at: f64,
    /// The side that stays: −1 where the coordinate is less than the line's.
    side: f64,
}

impl Fold {
    fn new(draw: &Draw, square: f64) -> Fold {
        let squares = f64::from(draw.between(1, 2.0, [-5.5, 5.5]).round());
        Fold {
            axis: usize::from(draw.between(2, 0.0, [0.0, 1.0]) > 0.5),
            at: squares * square,
            side: if squares < 0.0 { 1.0 } else { -1.0 },
        }
    }

    /// The point of the side that stays that lies on a point.
    fn folded(&self, mut p: [f64; 2]) -> [f64; 2] {
        p[self.axis] = self.at + self.side * (p[self.axis] - self.at).abs();
        p
    }
}

/// The rim of a hole in polar coordinates: an ellipse with waves.
#[derive(Clone, Copy)]
struct Rim {
    radius: f64,
    waves: f64,
    height: f64,
    /// Length along x against that of a circle.
    stretch: f64,
}

impl Rim {
    fn new(draw: &Draw, radius: f64) -> Rim {
        let of = |salt, tuned, range| f64::from(draw.between(salt, tuned, range));
        Rim {
            radius,
            waves: of(3, 5.0, [3.0, 7.99]).floor(),
            height: of(4, 0.07, [0.03, 0.11]),
            stretch: of(5, 1.0, [0.85, 1.18]),
        }
    }

    fn holds(&self, [x, y]: [f64; 2]) -> bool {
        let (x, y) = (x / self.stretch, y * self.stretch);
        x.hypot(y) < self.radius * (1.0 + self.height * (self.waves * y.atan2(x)).sin())
    }
}

/// Where an island lies: turned by an angle around its middle, which lies at a place of the image.
#[derive(Clone, Copy)]
struct Island {
    middle: [f64; 2],
    place: [f64; 2],
    turn: f64,
    /// Texels of the image in a unit of the sheet.
    density: f64,
}

impl Island {
    fn texel(&self, p: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.turn.sin_cos();
        let d = [p[0] - self.middle[0], p[1] - self.middle[1]];
        [
            self.place[0] + self.density * (cos * d[0] - sin * d[1]),
            // Rows go down.
            self.place[1] - self.density * (sin * d[0] + cos * d[1]),
        ]
    }

    fn chart(&self, t: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.turn.sin_cos();
        let d = [t[0] - self.place[0], self.place[1] - t[1]].map(|x| x / self.density);
        [
            self.middle[0] + cos * d[0] + sin * d[1],
            self.middle[1] - sin * d[0] + cos * d[1],
        ]
    }
}

/// A number from 0 to 1 that follows from two others.
fn random(k: usize, salt: usize) -> f64 {
    let mut h = (k as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (salt as u64).wrapping_mul(0xD1B5_4A32_D192_ED03);
    h = (h ^ (h >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (h ^ (h >> 32)) as u32 as f64 / f64::from(u32::MAX)
}

impl TestScan {
    /// A sheet with a round hole with an uneven rim, of the set on which the completion's constants were chosen.
    pub fn new(fabric: Fabric, layout: Layout, hole: usize) -> TestScan {
        TestScan::of(Family::Tuned, fabric, layout, hole)
    }

    /// A sheet of a family. Siblings have rims, islands, folds and texel densities of their own, too.
    pub fn of(family: Family, fabric: Fabric, layout: Layout, hole: usize) -> TestScan {
        let draw = Draw::new(
            family,
            &format!("{} {} {hole}", fabric.name(), layout.name()),
        );
        let size = SHEET * hole as f64;
        let at = |k: usize| (k as f64 / SQUARES as f64 - 0.5) * size;
        let middle = |q: usize| {
            let half = 0.5 * size / SQUARES as f64;
            [at(q % SQUARES) + half, at(q / SQUARES) + half]
        };
        let rim = Rim::new(&draw, 0.5 * hole as f64);
        let islands = islands(layout, size, &draw);
        let nearest = |p: [f64; 2]| {
            let to = |i: &Island| (i.middle[0] - p[0]).hypot(i.middle[1] - p[1]);
            (0..islands.len())
                .min_by(|a, b| to(&islands[*a]).total_cmp(&to(&islands[*b])))
                .unwrap_or(0)
        };
        let across = SQUARES + 1;
        let mut index = std::collections::BTreeMap::new();
        let mut scan = TestScan {
            swatch: Swatch::new(fabric, family),
            layout,
            hole,
            mesh: TriMesh {
                positions: Vec::new(),
                faces: Vec::new(),
            },
            texcoords: Vec::new(),
            patch: PatchChart {
                flat: (0..across * across)
                    .map(|v| [at(v % across), at(v / across)])
                    .collect(),
                faces: Vec::new(),
            },
            side: 0,
            texels: Vec::new(),
            fold: Fold::new(&draw, size / SQUARES as f64),
        };
        let mut texels: Vec<[f64; 2]> = Vec::new();
        let mut of_face: Vec<usize> = Vec::new();
        for q in 0..SQUARES * SQUARES {
            let a = q / SQUARES * across + q % SQUARES;
            let (b, c, d) = (a + 1, a + across, a + across + 1);
            let faces = [[a, b, c], [b, d, c]];
            if rim.holds(middle(q)) {
                scan.patch.faces.extend(faces.map(|f| f.map(|v| v as u32)));
                continue;
            }
            let island = nearest(middle(q));
            for face in faces {
                of_face.push(island);
                scan.mesh.faces.push(face.map(|v| {
                    *index.entry((v, island)).or_insert_with(|| {
                        let p = scan.patch.flat[v];
                        scan.mesh.positions.push(Vec3::new(p[0], p[1], 0.0));
                        let folded = match layout {
                            Layout::Mirrored => scan.fold.folded(p),
                            _ => p,
                        };
                        texels.push(islands[island].texel(folded));
                        texels.len() as u32 - 1
                    })
                }));
            }
        }
        let gutter = draw.between(6, GUTTER, [2.0, 5.99]) as usize;
        scan.paint(&islands, &texels, &of_face, gutter);
        let side = scan.side as f64;
        scan.texcoords = texels
            .iter()
            .map(|t| t.map(|x| (x / side) as f32))
            .collect();
        scan
    }

    /// The colour of the cloth at a place of the sheet, the hole included.
    pub fn truth(&self, p: [f64; 2]) -> [f32; 3] {
        let p = match self.layout {
            Layout::Mirrored => self.fold.folded(p),
            _ => p,
        };
        self.swatch.colour(p.map(|x| x as f32))
    }

    /// The colours of the cloth at places of the sheet as texels.
    pub fn truth_texels(&self, places: &[[f64; 2]]) -> Vec<[u8; 4]> {
        let byte = |x: f32| (255.0 * x + 0.5) as u8;
        let texel = |p: &[f64; 2]| {
            let [r, g, b] = self.truth(*p).map(byte);
            [r, g, b, 255]
        };
        places.iter().map(texel).collect()
    }

    fn paint(&mut self, islands: &[Island], texels: &[[f64; 2]], of_face: &[usize], gutter: usize) {
        let size = SHEET * self.hole as f64;
        let cells = (islands.len() as f64).sqrt().ceil() as usize;
        let whole = islands.len() == 1;
        self.side = if whole {
            2 * islands[0].place[0].ceil() as usize
        } else {
            (cells as f64 * cell(size, cells)).ceil() as usize
        };
        let frame = Frame {
            origin: [0.0, 0.0],
            step: 1.0,
            width: self.side,
            height: self.side,
        };
        // The frame's rows go down from y = 0.
        let upright: Vec<[f64; 2]> = texels.iter().map(|t| [t[0], -t[1]]).collect();
        let owner =
            owners(&frame, &upright, &self.mesh.faces, Budget::unlimited()).unwrap_or_default();
        let byte = |x: f32| (255.0 * x + 0.5) as u8;
        let colour = |at: usize, island: &Island| {
            let t = [(at % self.side) as f64 + 0.5, (at / self.side) as f64 + 0.5];
            let p = island.chart(t).map(|x| x as f32);
            let [r, g, b] = self.swatch.colour(p).map(byte);
            [r, g, b, 255]
        };
        self.texels = (owner.iter().enumerate())
            .map(|(at, owner)| match owner {
                _ if whole => colour(at, &islands[0]),
                &NONE => UNUSED,
                face => colour(at, &islands[of_face[*face as usize]]),
            })
            .collect();
        if !whole {
            let mut covered: Vec<bool> = owner.iter().map(|o| *o != NONE).collect();
            (0..gutter).for_each(|_| dilate(&mut self.texels, &mut covered, self.side));
        }
    }

    /// The cloth around the hole as a completion reads it.
    pub fn cloth(&self) -> Cloth<'_> {
        let image = SourceImage {
            width: self.side as u32,
            height: self.side as u32,
            texels: &self.texels,
        };
        let source = Source {
            image: Some(image),
            texcoords: 0,
            wrap: [Wrap::Repeat; 2],
            factor: [1.0; 4],
        };
        Cloth {
            flat: self.mesh.positions.iter().map(|p| [p.x, p.y]).collect(),
            faces: self.mesh.faces.clone(),
            material_of: vec![0; self.mesh.faces.len()],
            texcoords: vec![
                self.mesh
                    .faces
                    .iter()
                    .map(|f| f.map(|v| self.texcoords[v as usize]))
                    .collect(),
            ],
            colours: Vec::new(),
            layers: vec![LayerKind::BaseColour],
            materials: vec![vec![source]],
        }
    }
}

/// Side of the square of an atlas that holds one island, of so many along a side.
fn cell(size: f64, across: usize) -> f64 {
    1.86 * size / across as f64
}

fn islands(layout: Layout, size: f64, draw: &Draw) -> Vec<Island> {
    let of = |salt, tuned, range| f64::from(draw.between(salt, tuned, range));
    if layout != Layout::Atlas {
        let turn = of(7, 0.0, [-3.1, 3.1]);
        let density = of(8, 1.0, [0.85, 1.2]);
        // Half of the turned sheet's side.
        let half = 0.5 * density * size * (turn.sin().abs() + turn.cos().abs());
        return vec![Island {
            middle: [0.0; 2],
            place: [half + 8.0; 2],
            turn,
            density,
        }];
    }
    let across = of(9, 3.0, [3.0, 4.99]) as usize;
    let count = across * across;
    // Another order for each sibling, and shaken otherwise.
    let (first, salt) = (
        of(10, 2.0, [0.0, 8.0]) as usize,
        of(11, 0.0, [1.0, 1e6]) as usize,
    );
    (0..count)
        .map(|k| {
            let shaken = |c: usize, own: usize| {
                let shake = 0.36 / across as f64 * (random(k, own + salt) - 0.5);
                ((c as f64 + 0.5) / across as f64 - 0.5 + shake) * size
            };
            // Places that are not in the order of the islands.
            let slot = (k * 5 + first) % count;
            let place = |c: usize| (c as f64 + 0.5) * cell(size, across);
            Island {
                middle: [shaken(k % across, 1), shaken(k / across, 2)],
                place: [place(slot % across), place(slot / across)],
                turn: std::f64::consts::TAU * random(k, 3 + salt),
                density: 1.0,
            }
        })
        .collect()
}

/// Texels beside covered ones take their colour.
fn dilate(texels: &mut [[u8; 4]], covered: &mut [bool], side: usize) {
    let before = covered.to_vec();
    for at in (0..before.len()).filter(|at| !before[*at]) {
        let (column, row) = (at % side, at / side);
        let around = [
            (column > 0).then(|| at - 1),
            (column + 1 < side).then(|| at + 1),
            (row > 0).then(|| at - side),
            (row + 1 < side).then(|| at + side),
        ];
        if let Some(other) = around.into_iter().flatten().find(|other| before[*other]) {
            texels[at] = texels[other];
            covered[at] = true;
        }
    }
}
