//! glTF in, glTF out: GLB and glTF with data URIs read into one triangle soup, patches appended, nothing else changed.
//! The only room that knows glTF. It opens no path and no URL, and trusts no count before it has seen the bytes behind it.
//! No welding, no holes, no opinion about cloth: those are `mesh` and the rooms after it.
//!
//! Skinned meshes are read in their bind pose: where their positions say, whatever their node's transform. A patch on one is moved by
//! the joints that move the rim beside it. Morph targets are read at weight 0, even those that the file turns on
//! ([`Scan::posed_by_morph_targets`] tells); a patch gets as many targets as its mesh has, without displacement.

mod accessor;
mod append;
mod attributes;
mod buffers;
mod container;
mod error;
pub mod export;
mod json;
mod read;
#[cfg(test)]
mod read_tests;
mod scene;
mod skin;
mod splice;
#[cfg(test)]
pub(crate) mod testing;
mod triangles;
mod write;
#[cfg(test)]
mod write_tests;

use std::ops::Range;
use std::sync::Arc;

use gltf::json::accessor::Type;
use serde_json::Value;

pub use container::Container;
pub use error::ScanError;
pub use write::{Addition, PatchPoint};

use container::Layout;
use darn_geometry::mesh::TriMesh;
use scene::Placement;
use skin::{Influence, Influences};

/// What a scan may cost. Every refusal names the field and its value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanLimits {
    /// Vertices of all drawn primitives together, instances counted.
    pub max_vertices: usize,
    /// Triangles of all drawn primitives together, instances counted, degenerate ones too.
    pub max_faces: usize,
    /// Nodes of the default scene.
    pub max_nodes: usize,
    /// Primitives of all drawn meshes together, instances counted, points and lines too.
    pub max_primitives: usize,
    /// Numbers in all vertex attributes but positions together.
    pub max_attribute_values: usize,
    /// Texture coordinate sets, and colour sets, and sets of joints and weights, of one primitive.
    pub max_attribute_sets: usize,
    /// Values in the JSON, keys counted (an upper estimate, made before they are built).
    pub max_json_values: usize,
}

impl Default for ScanLimits {
    fn default() -> Self {
        Self {
            max_vertices: 2_000_000,
            max_faces: 4_000_000,
            max_nodes: 100_000,
            max_primitives: 10_000,
            max_attribute_values: 32_000_000,
            max_attribute_sets: 16,
            max_json_values: 1_000_000,
        }
    }
}

/// A scan: the original bytes and the geometry decoded from them.
#[derive(Debug, Clone)]
pub struct Scan {
    /// All triangles that the default scene draws, in scene space, unwelded. Triangles that name a vertex twice are left out.
    pub surface: TriMesh,
    /// The drawn primitives in the order of their faces in `surface`.
    pub parts: Vec<Part>,
    /// Runs of vertices that one node's accessor gave, in order.
    blocks: Vec<Block>,
    bytes: Vec<u8>,
    layout: Layout,
    json: Value,
}

/// A triangle primitive as one node draws it.
#[derive(Debug, Clone)]
pub struct Part {
    /// Index of the node.
    pub node: usize,
    /// Index of the mesh.
    pub mesh: usize,
    /// Index of the primitive in its mesh.
    pub primitive: usize,
    /// Index of the material, if it has one.
    pub material: Option<usize>,
    /// Its vertices in `Scan::surface`. Primitives of a node that share their POSITION accessor share this range.
    pub vertices: Range<u32>,
    /// Its faces in `Scan::surface`; the parts' ranges follow one another.
    pub faces: Range<u32>,
    /// TEXCOORD_0, TEXCOORD_1, …, each `[vertices.len()]`, indexed by vertex − `vertices.start`; NaN and infinities read as 0.
    pub texcoords: Vec<Arc<[[f32; 2]]>>,
    /// COLOR_0, COLOR_1, … in the same way, linear RGBA; a set without alpha has alpha 1.
    pub colors: Vec<Arc<[[f32; 4]]>>,
    /// NORMAL as stored, in the node's space, `[vertices.len()]`; without, the primitive is drawn flat.
    pub normals: Option<Arc<[[f32; 3]]>>,
    /// Whether darn made it: its `extras.darn.reconstructed` says so.
    pub reconstructed: bool,
    /// Whether several drawn nodes share this mesh: a patch written once then shows at each of them.
    pub shared: bool,
    /// Whether this is the first drawn node of its mesh, the one to patch.
    pub first_instance: bool,
    /// Number of morph targets.
    targets: usize,
    color_kinds: Vec<Type>,
    placement: Placement,
    /// JOINTS_0 and WEIGHTS_0, JOINTS_1 and WEIGHTS_1, …, as `texcoords`; `None` if no node draws the mesh with a skin.
    skinning: Option<Vec<Influences>>,
}

/// A run of vertices and their stored positions.
#[derive(Debug, Clone)]
struct Block {
    node: usize,
    /// First vertex in `Scan::surface`.
    start: u32,
    /// As stored, in the node's space.
    local: Vec<[f32; 3]>,
}

impl Scan {
    /// Reads a scan. GLB or JSON is told by the first bytes; only data URIs and the BIN chunk are ever read.
    ///
    /// Memory: about 100 bytes a JSON value, 36 a vertex, 12 a face, 4 an attribute value, and one copy of `bytes`; all bounded
    /// by `limits` before it is asked for.
    ///
    /// # Errors
    /// See [`ScanError`]; a scan that draws no triangle is [`ScanError::NoTriangles`].
    pub fn read(bytes: &[u8], limits: &ScanLimits) -> Result<Self, ScanError> {
        read::read(bytes, limits)
    }

    /// The scan with patches appended, in the container it came in. Without additions, the very bytes that were read.
    ///
    /// Everything that was there keeps its value, spelling and index; the BIN chunk keeps its bytes as a prefix.
    ///
    /// # Errors
    /// [`ScanError::Addition`] for a patch that contradicts itself or the scan, [`ScanError::Singular`] for one on a node whose
    /// transform flattens space.
    pub fn write(&self, additions: &[Addition]) -> Result<Vec<u8>, ScanError> {
        write::write(self, additions)
    }

    /// How the scan is packed, and how [`Scan::write`] packs it again.
    pub fn container(&self) -> Container {
        self.layout.container
    }

    /// Bytes of memory it holds, about.
    pub fn bytes_held(&self) -> usize {
        let attributes = |part: &Part| {
            let texcoords: usize = part.texcoords.iter().map(|set| 8 * set.len()).sum();
            let colors: usize = part.colors.iter().map(|set| 16 * set.len()).sum();
            let skinning = part.skinning.iter().flatten();
            let skinning: usize = skinning.map(|set| size_of::<Influence>() * set.len()).sum();
            let normals = part.normals.as_ref().map_or(0, |set| 12 * set.len());
            texcoords + colors + normals + skinning
        };
        let parts: usize = self.parts.iter().map(attributes).sum();
        let surface = 24 * self.surface.positions.len() + 12 * self.surface.faces.len();
        let local: usize = self.blocks.iter().map(|b| 12 * b.local.len()).sum();
        // Between a data URI, which is as long as its text, and lists of small numbers, which take ten times theirs.
        let json = 4 * self.layout.json.len();
        self.bytes.len() + json + surface + local + parts
    }

    /// The part that a face of `surface` belongs to.
    pub fn part_of_face(&self, face: u32) -> Option<usize> {
        let at = self.parts.partition_point(|part| part.faces.end <= face);
        self.parts
            .get(at)
            .filter(|part| part.faces.contains(&face))
            .map(|_| at)
    }

    /// The name of a part's mesh, or of its node where the mesh has none.
    pub fn mesh_name(&self, part: usize) -> Option<&str> {
        let part = self.parts.get(part)?;
        let name =
            |list: &str, index: usize| self.json.get(list)?.get(index)?.get("name")?.as_str();
        name("meshes", part.mesh).or_else(|| name("nodes", part.node))
    }

    /// Whether the file turns morph targets of a drawn mesh on by default: `surface` is then not what viewers show, and a patch on it
    /// fits its rim only where the targets do not move that.
    pub fn posed_by_morph_targets(&self) -> bool {
        let weights = |list: &str, index: usize| {
            let weights = self.json.get(list)?.get(index)?.get("weights")?;
            weights.as_array()
        };
        let on = |weight: &Value| weight.as_f64().is_some_and(|weight| weight != 0.0);
        self.parts.iter().any(|part| {
            // A node's weights stand in for its mesh's (glTF 2.0, 3.7.2.2).
            weights("nodes", part.node)
                .or_else(|| weights("meshes", part.mesh))
                .is_some_and(|weights| weights.iter().take(part.targets).any(on))
        })
    }

    /// The node that a vertex of `surface` belongs to and its position as stored there.
    fn stored(&self, vertex: u32) -> Option<(usize, [f32; 3])> {
        let at = self
            .blocks
            .partition_point(|block| block.start <= vertex)
            .checked_sub(1)?;
        let block = self.blocks.get(at)?;
        Some((
            block.node,
            *block.local.get((vertex - block.start) as usize)?,
        ))
    }
}
