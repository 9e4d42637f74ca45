//! A flat sheet of a fabric with a hole, as a scan has it: triangles with coordinates in an image.

use darn_budget::Budget;
use darn_geometry::mesh::{TriMesh, Vec3};

use super::fabric::Fabric;
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
/// The fold of a mirrored sheet is this many squares right of the middle.
const FOLD: usize = 2;
/// Texels around islands that show the cloth next to them.
const GUTTER: usize = 3;
/// What an atlas shows where nothing lies.
const UNUSED: [u8; 4] = [24, 20, 28, 255];

/// A sheet with a hole, its image, and the truth.
pub struct TestScan {
    /// The fabric.
    pub fabric: Fabric,
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
}

/// Where an island lies: turned by an angle around its middle, which lies at a place of the image.
#[derive(Clone, Copy)]
struct Island {
    middle: [f64; 2],
    place: [f64; 2],
    turn: f64,
}

impl Island {
    fn texel(&self, p: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.turn.sin_cos();
        let d = [p[0] - self.middle[0], p[1] - self.middle[1]];
        [
            self.place[0] + cos * d[0] - sin * d[1],
            // Rows go down.
            self.place[1] - (sin * d[0] + cos * d[1]),
        ]
    }

    fn chart(&self, t: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.turn.sin_cos();
        let d = [t[0] - self.place[0], self.place[1] - t[1]];
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
    /// A sheet with a round hole with an uneven rim.
    pub fn new(fabric: Fabric, layout: Layout, hole: usize) -> TestScan {
        let size = SHEET * hole as f64;
        let at = |k: usize| (k as f64 / SQUARES as f64 - 0.5) * size;
        let middle = |q: usize| {
            let half = 0.5 * size / SQUARES as f64;
            [at(q % SQUARES) + half, at(q / SQUARES) + half]
        };
        let radius = 0.5 * hole as f64;
        let missing = |q: usize| {
            let [x, y] = middle(q);
            x.hypot(y) < radius * (1.0 + 0.07 * (5.0 * y.atan2(x)).sin())
        };
        let islands = islands(layout, size);
        let nearest = |p: [f64; 2]| {
            let to = |i: &Island| (i.middle[0] - p[0]).hypot(i.middle[1] - p[1]);
            (0..islands.len())
                .min_by(|a, b| to(&islands[*a]).total_cmp(&to(&islands[*b])))
                .unwrap_or(0)
        };
        let across = SQUARES + 1;
        let mut index = std::collections::BTreeMap::new();
        let mut scan = TestScan {
            fabric,
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
        };
        let mut texels: Vec<[f64; 2]> = Vec::new();
        let mut of_face: Vec<usize> = Vec::new();
        let fold = at(SQUARES / 2 + FOLD);
        for q in 0..SQUARES * SQUARES {
            let a = q / SQUARES * across + q % SQUARES;
            let (b, c, d) = (a + 1, a + across, a + across + 1);
            let faces = [[a, b, c], [b, d, c]];
            if missing(q) {
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
                            Layout::Mirrored => [fold - (p[0] - fold).abs(), p[1]],
                            _ => p,
                        };
                        texels.push(islands[island].texel(folded));
                        texels.len() as u32 - 1
                    })
                }));
            }
        }
        scan.paint(&islands, &texels, &of_face);
        let side = scan.side as f64;
        scan.texcoords = texels
            .iter()
            .map(|t| t.map(|x| (x / side) as f32))
            .collect();
        scan
    }

    /// The colour of the cloth at a place of the sheet, the hole included.
    pub fn truth(&self, [x, y]: [f64; 2]) -> [f32; 3] {
        let fold = SHEET * self.hole as f64 * FOLD as f64 / SQUARES as f64;
        let x = match self.layout {
            Layout::Mirrored => fold - (x - fold).abs(),
            _ => x,
        };
        self.fabric.colour(x as f32, y as f32)
    }

    fn paint(&mut self, islands: &[Island], texels: &[[f64; 2]], of_face: &[usize]) {
        let size = SHEET * self.hole as f64;
        let cells = (islands.len() as f64).sqrt().ceil() as usize;
        let whole = islands.len() == 1;
        self.side = if whole {
            size.ceil() as usize + 16
        } else {
            (cells as f64 * cell(size)).ceil() as usize
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
            let [x, y] = island.chart(t);
            let [r, g, b] = self.fabric.colour(x as f32, y as f32).map(byte);
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
            (0..GUTTER).for_each(|_| dilate(&mut self.texels, &mut covered, self.side));
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

/// Side of the square of an atlas that holds one island.
fn cell(size: f64) -> f64 {
    0.62 * size
}

fn islands(layout: Layout, size: f64) -> Vec<Island> {
    if layout != Layout::Atlas {
        let middle = 0.5 * size + 8.0;
        return vec![Island {
            middle: [0.0; 2],
            place: [middle, middle],
            turn: 0.0,
        }];
    }
    (0..9)
        .map(|k| {
            let shaken = |c: usize, salt: usize| {
                ((c as f64 + 0.5) / 3.0 - 0.5 + 0.12 * (random(k, salt) - 0.5)) * size
            };
            // Places that are not in the order of the islands.
            let slot = (k * 5 + 2) % 9;
            let place = |c: usize| (c as f64 + 0.5) * cell(size);
            Island {
                middle: [shaken(k % 3, 1), shaken(k / 3, 2)],
                place: [place(slot % 3), place(slot / 3)],
                turn: std::f64::consts::TAU * random(k, 3),
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
