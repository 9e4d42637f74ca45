//! Skins: which joints move the vertices of a mesh, and which are to move a patch.
//! Viewers take every primitive of a mesh that some node draws with a skin for a skinned one, so a patch must say what moves it:
//! what moves the rim beside it.

use std::collections::BTreeSet;
use std::iter::once;
use std::sync::Arc;

use serde_json::Value;

use super::json::integral;
use super::{Part, PatchPoint, Scan};
use darn_geometry::mesh::nearest::closest_vertex;
use darn_geometry::mesh::{TriMesh, Vec3};

/// How much up to four joints move a vertex: its element of JOINTS_n and WEIGHTS_n.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Influence {
    pub joints: [u16; 4],
    pub weights: [f32; 4],
}

/// One set of them, of all vertices of a primitive.
pub(super) type Influences = Arc<[Influence]>;

impl Influence {
    /// The skin's first joint alone moves it.
    const FIRST: Self = Self {
        joints: [0; 4],
        weights: ALONE,
    };
}

const ALONE: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

/// How far the sum of a vertex's weights may be from 1, for each that is not 0; what the validator allows.
const ROUNDING: f64 = 2e-7;

/// The meshes that some node draws with a skin, whether the default scene draws that node or not: three.js skins such a mesh wherever it
/// is drawn.
pub(super) fn skinned_meshes(json: &Value) -> BTreeSet<usize> {
    let nodes = json.get("nodes").and_then(Value::as_array);
    let mesh = |node: &Value| {
        node.get("skin")?;
        usize::try_from(integral(node.get("mesh")?.as_number()?)?).ok()
    };
    nodes.into_iter().flatten().filter_map(mesh).collect()
}

/// The sets that a patch on `home` has, `[sets][points]`, at least one; `places` are its points in the node's space.
///
/// At vertices of the home's node they are the scan's, elsewhere those of the nearest of these, the first of several: what one vertex
/// has fits together, while a blend of several may name more joints than its sets have room for.
pub(super) fn carried(
    scan: &Scan,
    home: &Part,
    points: &[PatchPoint],
    places: &[[f32; 3]],
) -> Vec<Vec<Influence>> {
    let skinned = skinned_parts(scan, home);
    let own: Vec<Option<Vec<Influence>>> =
        points.iter().map(|point| stored(&skinned, point)).collect();
    let place = |place: &[f32; 3]| Vec3::from(place.map(f64::from));
    let known = own.iter().zip(places);
    let (known, positions): (Vec<&[Influence]>, Vec<Vec3>) = known
        .filter_map(|(own, at)| Some((own.as_deref()?, place(at))))
        .unzip();
    let rim = TriMesh {
        positions,
        faces: Vec::new(),
    };
    let nearest = |at: &[f32; 3]| {
        let vertex = closest_vertex(&rim, &place(at))?;
        known.get(vertex as usize).copied()
    };
    let of_points = own.iter().zip(places).map(|(own, at)| {
        own.as_deref()
            .or_else(|| nearest(at))
            .unwrap_or(&[Influence::FIRST])
    });
    let of_points: Vec<&[Influence]> = of_points.collect();
    let sets = of_points.iter().map(|sets| sets.len()).max().unwrap_or(1);
    let set = |n: usize| -> Vec<Influence> {
        let each = of_points.iter().map(|sets| sets.get(n).copied());
        each.map(Option::unwrap_or_default).collect()
    };
    (0..sets).map(set).collect()
}

/// The parts of the home's node that say what moves them, the home itself first: others' joints are another skin's.
fn skinned_parts<'s>(scan: &'s Scan, home: &'s Part) -> Vec<&'s Part> {
    let says = |part: &&Part| part.skinning.as_ref().is_some_and(|sets| !sets.is_empty());
    let parts = once(home).chain(&scan.parts);
    parts
        .filter(|part| part.node == home.node)
        .filter(says)
        .collect()
}

/// All sets of a patch point that is a vertex of one of the parts.
fn stored(parts: &[&Part], point: &PatchPoint) -> Option<Vec<Influence>> {
    let PatchPoint::Scan(vertex) = *point else {
        return None;
    };
    let part = parts.iter().find(|part| part.vertices.contains(&vertex))?;
    let at = (vertex - part.vertices.start) as usize;
    let sets = part.skinning.iter().flatten();
    let sets = sets.filter_map(|set| set.get(at)).copied().collect();
    Some(normalized(sets))
}

/// A vertex's sets with weights that sum to 1 over all of them, bit for bit as they were if they did. Without any weight the first joint
/// has it all, as three.js has it.
fn normalized(mut sets: Vec<Influence>) -> Vec<Influence> {
    let weights = sets.iter().flat_map(|set| set.weights);
    let (mut sum, mut used) = (0.0_f64, 0.0_f64);
    for weight in weights.filter(|weight| *weight > 0.0) {
        sum += f64::from(weight);
        used += 1.0;
    }
    if sum == 0.0 {
        sets.iter_mut().take(1).for_each(|set| set.weights = ALONE);
    } else if (sum - 1.0).abs() > ROUNDING * used {
        for weight in sets.iter_mut().flat_map(|set| &mut set.weights) {
            *weight = (f64::from(*weight) / sum) as f32;
        }
    }
    sets
}
