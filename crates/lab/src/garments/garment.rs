//! One garment: its mesh at rest, its openings, and where its faces lie in the panels.

use super::drape::drape;
use super::error::GarmentError;
use super::patterns;
use super::sewing::{Sewn, sew};
use darn_geometry::mesh::intersect::self_intersections;
use darn_geometry::mesh::{TriMesh, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Drapes simulated before a seed is given up.
const ATTEMPTS: u32 = 8;
/// Most pairs of triangles that may cut each other, ÷ faces.
const MOST_CROSSINGS: f64 = 0.006;
/// Most strain of woven cloth.
const MOST_STRAIN: f64 = 0.07;

/// The kinds of garments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GarmentKind {
    /// A tube on a bent arm.
    Sleeve,
    /// Gathered at the waist.
    Skirt,
    /// Loose, with sleeves set in.
    Shirt,
    /// Knitted and tight, without sleeves: cloth that the body shapes.
    Vest,
    /// Two legs, one knee raised.
    Trousers,
    /// Closed, or without the fingers' ends.
    Glove,
    /// Over a head, closed under the chin.
    Hood,
}

impl GarmentKind {
    /// All kinds.
    pub const ALL: [GarmentKind; 7] = [
        GarmentKind::Sleeve,
        GarmentKind::Skirt,
        GarmentKind::Shirt,
        GarmentKind::Vest,
        GarmentKind::Trousers,
        GarmentKind::Glove,
        GarmentKind::Hood,
    ];

    /// Its name in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sleeve => "sleeve",
            Self::Skirt => "skirt",
            Self::Shirt => "shirt",
            Self::Vest => "vest",
            Self::Trousers => "trousers",
            Self::Glove => "glove",
            Self::Hood => "hood",
        }
    }
}

/// A boundary loop that belongs to the garment and is never a hole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Opening {
    /// What a tailor calls it: `neck`, `cuff_left`.
    pub name: String,
    /// Vertices along it.
    pub vertices: usize,
    /// Its length, metres.
    pub length: f64,
    /// Mean of its vertices.
    pub centroid: [f64; 3],
}

/// A garment at rest.
#[derive(Debug, Clone)]
pub struct Garment {
    /// Its kind.
    pub kind: GarmentKind,
    /// The seed it was made with.
    pub seed: u64,
    /// Welded; metres, +y up, every coordinate an f32.
    pub mesh: TriMesh,
    /// Its openings.
    pub openings: Vec<Opening>,
    /// The flat pieces.
    pub(super) sewn: Sewn,
    /// Root mean square of (length ÷ rest length − 1) over the edges.
    pub strain: f64,
    /// Pairs of triangles that cut each other.
    pub crossings: usize,
}

/// Makes the garment of a kind and a seed.
///
/// # Errors
/// A seed whose drapes all end stretched or cut through themselves.
pub fn make(kind: GarmentKind, seed: u64) -> Result<Garment, GarmentError> {
    let mut reason = String::new();
    for attempt in 0..ATTEMPTS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(u64::from(attempt) << 8 | kind as u64);
        let pattern = patterns::draw(kind, &mut rng);
        let sewn = sew(&pattern, &mut rng)?;
        let draped = drape(&pattern, &sewn);
        let upright = |p: &crate::scarffolds::lattice::Vec3f| {
            // Without negative zeros, which welding does not keep.
            Vec3::new(p.x.into(), p.z.into(), (-p.y).into()).add_scalar(0.0)
        };
        let mesh = TriMesh {
            positions: draped.positions.iter().map(upright).collect(),
            faces: sewn.faces.clone(),
        };
        let crossings = self_intersections(&mesh).len();
        if crossings as f64 > MOST_CROSSINGS * mesh.faces.len() as f64 {
            reason = format!("{crossings} pairs of triangles cut each other");
            continue;
        }
        if pattern.fabric.knit.is_none() && draped.strain > MOST_STRAIN {
            reason = format!("strain {:.3}", draped.strain);
            continue;
        }
        let names = pattern.openings.iter().zip(&sewn.openings);
        return Ok(Garment {
            kind,
            seed,
            openings: names.map(|(name, own)| opening(&mesh, name, own)).collect(),
            mesh,
            sewn,
            strain: draped.strain,
            crossings,
        });
    }
    Err(GarmentError::NoGarment {
        kind,
        seed,
        attempts: ATTEMPTS,
        reason,
    })
}

fn opening(mesh: &TriMesh, name: &str, own: &[u32]) -> Opening {
    let mut length = 0.0;
    let edges = mesh
        .faces
        .iter()
        .flat_map(|f| (0..3).map(|k| (f[k], f[(k + 1) % 3])));
    let among: std::collections::HashSet<u32> = own.iter().copied().collect();
    // Both faces of an inner edge between two vertices of the opening give its length; they cancel.
    let mut sides: std::collections::BTreeMap<(u32, u32), u32> = Default::default();
    for (a, b) in edges.filter(|(a, b)| among.contains(a) && among.contains(b)) {
        *sides.entry((a.min(b), a.max(b))).or_default() += 1;
    }
    for ((a, b), _) in sides.iter().filter(|(_, n)| **n == 1) {
        length += (mesh.positions[*a as usize] - mesh.positions[*b as usize]).norm();
    }
    let sum: Vec3 = own.iter().map(|v| mesh.positions[*v as usize]).sum();
    Opening {
        name: name.to_owned(),
        vertices: own.len(),
        length,
        centroid: (sum / own.len().max(1) as f64).into(),
    }
}
