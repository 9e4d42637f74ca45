//! A scan in memory: its geometry, and the file it was read from.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use bytes::Bytes;
use darn_geometry::mesh::TriMesh;
use gltf::json::accessor::Type;
use serde_json::Value;

use super::container::{Container, ContainerLayout};
use super::digests::FileDigests;
use super::files::{Companions, Siblings};
use super::mesh_file::MeshOrigin;
use super::scene::NodeTransform;
use super::skin::{Influence, Influences};

/// A scan: the original bytes and the geometry decoded from them.
#[derive(Debug, Clone)]
pub struct Scan {
    /// All triangles that the default scene draws, in scene space, not welded. Triangles that name a vertex twice are
    /// left out.
    pub surface: TriMesh,
    /// The drawn primitives in the order of their faces in `surface`.
    pub parts: Vec<ScanPart>,
    /// How many vertices of `surface` have a position that is not finite in the file. No triangle uses them; here they
    /// lie at the origin.
    pub not_finite: usize,
    /// How many primitives have accessors that state another count than their Draco stream has. The stream counts.
    pub misstated_streams: usize,
    /// The vertices of `surface` by the accessor they come from, in order.
    pub(crate) blocks: Vec<VertexBlock>,
    pub(crate) bytes: Bytes,
    pub(crate) layout: ContainerLayout,
    pub(crate) companions: Companions,
    pub(crate) json: Value,
    /// The primitives, by mesh and index, of which triangles were cut out; see [`Scan::without_faces`].
    pub(crate) cut: BTreeSet<(usize, usize)>,
    /// Bytes of memory that the parsed JSON takes.
    pub(crate) json_held: usize,
    /// The mesh file that it was read from: then `bytes` are a glTF of the same triangles.
    pub(crate) origin: Option<Arc<MeshOrigin>>,
    /// The digests of the file, made when they are first asked for.
    pub(crate) digests: Arc<OnceLock<FileDigests>>,
}

/// A triangle primitive as one node draws it.
#[derive(Debug, Clone)]
pub struct ScanPart {
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
    /// TEXCOORD_0, TEXCOORD_1, …, each `[vertices.len()]`, indexed by vertex − `vertices.start`; NaN and infinities
    /// read as 0.
    pub texcoords: Vec<Arc<[[f32; 2]]>>,
    /// COLOR_0, COLOR_1, … in the same way, linear RGBA; a set without alpha has alpha 1.
    pub colors: Vec<Arc<[[f32; 4]]>>,
    /// NORMAL as stored (quantized ones with length 1), in the node's space, `[vertices.len()]`; without normals the primitive is drawn flat.
    pub normals: Option<Arc<[[f32; 3]]>>,
    /// `_CONFIDENCE` of a part that darn made, `[vertices.len()]`: how far each vertex may be off, a standard deviation in scene units.
    pub deviations: Option<Arc<[f32]>>,
    /// Whether darn made it: its `extras.darn.reconstructed` says so.
    pub reconstructed: bool,
    /// The set of texture coordinates that the hatch of darn's marks has here, if darn made it.
    pub(crate) hatch: Option<usize>,
    /// Whether several drawn nodes share this mesh: a patch written once then shows at each of them.
    pub shared: bool,
    /// Whether this is the first drawn node of its mesh, the one to patch.
    pub first_instance: bool,
    /// Number of morph targets.
    pub(crate) targets: usize,
    /// The types of the colour sets in the file: VEC3 or VEC4.
    pub(crate) color_kinds: Vec<Type>,
    pub(crate) transform: NodeTransform,
    /// JOINTS_0 and WEIGHTS_0, JOINTS_1 and WEIGHTS_1, …, as `texcoords`; `None` if no node draws the mesh with a skin.
    pub(crate) skinning: Option<Vec<Influences>>,
}

/// Consecutive vertices that come from one accessor of one node, and their stored positions.
#[derive(Debug, Clone)]
pub(crate) struct VertexBlock {
    pub node: usize,
    /// First vertex in `Scan::surface`.
    pub start: u32,
    /// Largest coordinate of the node's origin in the scene.
    pub origin: f64,
    /// How many vertices.
    pub count: u32,
    /// As stored, in the node's space; `None` where that is the scene's space, whose positions in f32 are the same numbers.
    pub local: Option<Vec<[f32; 3]>>,
}

impl Scan {
    /// The container it was read from; [`Scan::write`] writes the same.
    pub fn container(&self) -> Container {
        match (&self.origin, &self.companions) {
            (_, Companions::Zip(_)) => Container::Zip,
            (Some(origin), _) => origin.container(),
            _ => self.layout.container,
        }
    }

    /// The bytes that it was read from: of a glTF, of a mesh file, or of a zip.
    pub fn received(&self) -> &Bytes {
        match (&self.origin, &self.companions) {
            (_, Companions::Zip(zip)) => &zip.bytes,
            (Some(origin), _) => origin.bytes(),
            _ => &self.bytes,
        }
    }

    /// Name of the scan in the zip that it was read from.
    pub fn path_in_zip(&self) -> Option<&str> {
        match &self.companions {
            Companions::Zip(zip) => Some(&zip.main),
            Companions::Siblings(_) => None,
        }
    }

    /// The files that were read with the scan, by their paths relative to it. None of a zip.
    pub fn siblings(&self) -> impl Iterator<Item = (&str, &[u8])> {
        let files = match &self.companions {
            Companions::Siblings(Siblings(files)) => Some(files),
            _ => None,
        };
        let files = files.into_iter().flatten();
        files.map(|(path, bytes)| (path.as_str(), bytes.as_ref()))
    }

    /// Bytes of the glTF of a zip, which are held beside the zip.
    pub(crate) fn unpacked_bytes(&self) -> usize {
        match self.companions {
            Companions::Zip(_) => self.bytes.len(),
            _ => 0,
        }
    }

    /// Bytes after the declared end of the GLB; [`Scan::write`] keeps them there.
    pub fn trailing_bytes(&self) -> usize {
        self.layout.trailing.len()
    }

    /// Memory it holds, in bytes, estimated.
    pub fn bytes_held(&self) -> usize {
        let origin = self.origin.as_ref().map_or(0, |origin| origin.bytes_held());
        self.bytes.len()
            + self.companions.bytes_held()
            + self.json_held
            + self.decoded_bytes()
            + origin
    }

    /// Memory of the decoded geometry and attributes.
    pub(crate) fn decoded_bytes(&self) -> usize {
        let attributes = |part: &ScanPart| {
            let texcoords: usize = part.texcoords.iter().map(|set| 8 * set.len()).sum();
            let colors: usize = part.colors.iter().map(|set| 16 * set.len()).sum();
            let skinning = part.skinning.iter().flatten();
            let skinning: usize = skinning.map(|set| size_of::<Influence>() * set.len()).sum();
            let normals = part.normals.as_ref().map_or(0, |set| 12 * set.len());
            texcoords + colors + normals + skinning
        };
        let parts: usize = self.parts.iter().map(attributes).sum();
        let surface = 24 * self.surface.positions.len() + 12 * self.surface.faces.len();
        let local: usize = self
            .blocks
            .iter()
            .flat_map(|b| &b.local)
            .map(|local| 12 * local.len())
            .sum();
        surface + local + parts
    }

    /// The part that a face of `surface` belongs to, as an index into `parts`.
    pub fn part_of_face(&self, face: u32) -> Option<usize> {
        let at = self.parts.partition_point(|part| part.faces.end <= face);
        self.parts
            .get(at)
            .filter(|part| part.faces.contains(&face))
            .map(|_| at)
    }

    /// The name of a part's mesh, or of its node if the mesh has none.
    pub fn mesh_name(&self, part: usize) -> Option<&str> {
        let part = self.parts.get(part)?;
        let name =
            |list: &str, index: usize| self.json.get(list)?.get(index)?.get("name")?.as_str();
        name("meshes", part.mesh).or_else(|| name("nodes", part.node))
    }

    /// Whether the file turns on morph targets of a drawn mesh. Viewers then show another shape than `surface`, and a
    /// patch fits its rim only where the targets do not move the rim.
    pub fn posed_by_morph_targets(&self) -> bool {
        let weights = |list: &str, index: usize| {
            let weights = self.json.get(list)?.get(index)?.get("weights")?;
            weights.as_array()
        };
        let on = |weight: &Value| weight.as_f64().is_some_and(|weight| weight != 0.0);
        // Once for each node and number of targets: a mesh may have thousands of primitives and of weights.
        let drawn: BTreeSet<(usize, usize, usize)> =
            (self.parts.iter().map(|p| (p.node, p.mesh, p.targets))).collect();
        drawn.into_iter().any(|(node, mesh, targets)| {
            // A node's weights replace its mesh's (glTF 2.0, 3.7.2.2).
            weights("nodes", node)
                .or_else(|| weights("meshes", mesh))
                .is_some_and(|weights| weights.iter().take(targets).any(on))
        })
    }

    /// Precision of a vertex's coordinates, scene units: what f32 rounds off where it lies and where its node has its
    /// origin. 0 for a vertex that does not exist.
    pub fn precision(&self, vertex: u32) -> f64 {
        let at = self.surface.positions.get(vertex as usize);
        let size = at.map_or(0.0, |p| p.amax());
        let after = self.blocks.partition_point(|block| block.start <= vertex);
        let block = after.checked_sub(1).and_then(|at| self.blocks.get(at));
        f64::from(f32::EPSILON) * (size + block.map_or(0.0, |block| block.origin))
    }

    /// The node that a vertex of `surface` belongs to, and its position as stored there.
    pub(crate) fn stored_position(&self, vertex: u32) -> Option<(usize, [f32; 3])> {
        let at = self
            .blocks
            .partition_point(|block| block.start <= vertex)
            .checked_sub(1)?;
        let block = self.blocks.get(at)?;
        let index = (vertex - block.start) as usize;
        let local = match &block.local {
            Some(local) => *local.get(index)?,
            None if index < block.count as usize => {
                let point = self.surface.positions.get(vertex as usize)?;
                point.cast::<f32>().into()
            }
            None => return None,
        };
        Some((block.node, local))
    }
}
