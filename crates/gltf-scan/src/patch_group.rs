//! Patches that share a primitive: their vertices and triangles one after another.
//!
//! `extras.darn` of the primitive says that it is reconstructed, by which version and weights, and names each hole with
//! its own range of the indices and of the vertices (`holes`).

use darn_budget::Budget;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::TRIANGLES;
use serde_json::{Map, Value, json};

use super::append::{AccessorBounds, AccessorData, Appender};
use super::buffers::BufferTarget;
use super::checked_patch::CheckedPatch;
use super::container::float_bytes;
use super::cut::index_bytes;
use super::error::ScanError;
use super::hatch;
use super::patch_appearance::{MaterialStyle, OwnTexture, PatchAppearance, StyleKind};
use super::patch_images::{self, ImageSheet};
use super::scan::ScanPart;
use super::skin::Influence;

/// The attribute that says how far vertices may be off; glTF wants an underscore before names of one's own (glTF 2.0, 3.7.2.1).
pub(super) const CONFIDENCE: &str = "_CONFIDENCE";
/// What it means, for a person who finds it in a file.
const MEANING: &str = "standard deviation of the distance to the cloth that was there, in the scene's unit: nine of ten vertices lie within 1.645 of it; \
                       0 at the scan's own vertices";

/// The side of the cloth that a primitive of patches shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PatchSide {
    Front,
    Back,
}

/// How a primitive of patches looks.
pub(super) struct PrimitiveLook {
    /// Index of its material.
    pub material: usize,
    /// Its `extensions`: the materials of the variants.
    pub extensions: Option<Value>,
}

/// Patches of one [kind](CheckedPatch::kind).
pub(super) struct PatchGroup<'s> {
    first: CheckedPatch<'s>,
    others: Vec<CheckedPatch<'s>>,
    /// How many vertices they have; fits an index.
    vertices: usize,
    /// How many texels their images have.
    texels: usize,
}

impl<'s> PatchGroup<'s> {
    /// One patch alone.
    pub fn of(first: CheckedPatch<'s>) -> Self {
        Self {
            vertices: first.points.len(),
            texels: texels(&first),
            others: Vec::new(),
            first,
        }
    }

    /// Whether the indices reach over another patch, too, and the images have room for its own.
    pub fn takes(&self, patch: &CheckedPatch<'_>) -> bool {
        u32::try_from(self.vertices + patch.points.len()).is_ok()
            && self.texels + texels(patch) <= patch_images::MOST_TEXELS
    }

    /// Adds a patch of the same kind, which the group [takes](Self::takes).
    pub fn push(&mut self, patch: CheckedPatch<'s>) {
        self.vertices += patch.points.len();
        self.texels += texels(&patch);
        self.others.push(patch);
    }

    /// The part whose mesh and node take the patches.
    pub fn home(&self) -> &'s ScanPart {
        self.first.home
    }

    /// A part with the material and the attributes of the patches.
    pub fn look(&self) -> &'s ScanPart {
        self.first.look
    }

    /// The set of texture coordinates that is the hatch's: the patch's own, after those of the cloth; `None` if there is no
    /// room for it.
    pub fn hatch(&self) -> Option<usize> {
        let sets = self.first.patch.texcoords.len();
        let is_continued = matches!(self.first.patch.appearance, PatchAppearance::Continued);
        let own = self.look().hatch.filter(|set| is_continued && *set < sets);
        let set = own.unwrap_or(sets);
        (set < hatch::MOST_SETS).then_some(set)
    }

    /// The images of the patches, where they have their own.
    pub fn images(&self) -> Option<ImageSheet<'s>> {
        let all: Vec<&OwnTexture> = (self.patches())
            .filter_map(|it| it.patch.appearance.own())
            .collect();
        (!all.is_empty()).then(|| ImageSheet::of(&all))
    }

    /// What makes a copy of the cloth's material that of the patches, whose images are appended; `number` tells styles apart.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn style(
        &self,
        images: Option<&ImageSheet<'s>>,
        number: usize,
        out: &mut Appender<'_>,
        budget: &Budget<'_>,
    ) -> Result<MaterialStyle<'s>, ScanError> {
        let (number, kind) = match (&self.first.patch.appearance, images) {
            (PatchAppearance::Own(own), Some(images)) => {
                let textures = images.append(out, &self.name(), budget)?;
                (number, StyleKind::Own(&own.look, textures))
            }
            (PatchAppearance::Flat(look, means), _) => (number, StyleKind::Flat(look, means)),
            (PatchAppearance::Plain, _) => (number, StyleKind::Plain),
            _ => (0, StyleKind::Continued),
        };
        Ok(MaterialStyle { number, kind })
    }

    /// Appends the primitive, and one of the other side if the patches have one.
    pub fn append(
        &self,
        out: &mut Appender<'_>,
        look: &PrimitiveLook,
        images: Option<&ImageSheet<'s>>,
    ) {
        let front = self.front(out, look, images);
        let back = (self.first.patch.both_sides).then(|| self.back(out, &front));
        for primitive in [front].into_iter().chain(back) {
            out.primitive(self.home().mesh, primitive);
        }
    }

    fn patches(&self) -> impl Iterator<Item = &CheckedPatch<'s>> {
        [&self.first].into_iter().chain(&self.others)
    }

    /// Name of the new accessors and buffer views.
    fn name(&self) -> String {
        match self.others.len() {
            0 => self.first.patch.name.clone(),
            others => format!("darn reconstruction of {} holes", others + 1),
        }
    }

    /// Appends the accessors of the front; returns the primitive with them.
    fn front(
        &self,
        out: &mut Appender<'_>,
        look: &PrimitiveLook,
        images: Option<&ImageSheet<'s>>,
    ) -> Value {
        let mut attributes = Map::new();
        let points = self.rows(|patch| &patch.points);
        let bounds = Some(AccessorBounds::of(&points));
        attributes.insert("POSITION".into(), self.floats(out, &points, bounds));
        if self.look().normals.is_some() {
            let normals: Vec<[f32; 3]> = self.patches().flat_map(CheckedPatch::normals).collect();
            attributes.insert("NORMAL".into(), self.floats(out, &normals, None));
            let tangents = self.tangents();
            if !tangents.is_empty() {
                attributes.insert("TANGENT".into(), self.floats(out, &tangents, None));
            }
        }
        let hatch = look.extensions.as_ref().and_then(|_| self.hatch());
        let own = self.first.patch.texcoords.len();
        for n in 0..own + usize::from(hatch == Some(own)) {
            let set = match (hatch, images) {
                (Some(hatch), _) if hatch == n => self.hatch_coordinates(),
                (_, Some(images)) => self.image_coordinates(images),
                _ => self.rows(|it| it.patch.texcoords.get(n).map_or(&[], Vec::as_slice)),
            };
            attributes.insert(format!("TEXCOORD_{n}"), self.floats(out, &set, None));
        }
        let colors = self.first.patch.colors.len();
        for (n, kind) in self.look().color_kinds.iter().take(colors).enumerate() {
            let set = self.rows(|it| it.patch.colors.get(n).map_or(&[], Vec::as_slice));
            let set = match kind {
                Type::Vec3 => {
                    let rgb: Vec<[f32; 3]> = set.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
                    self.floats(out, &rgb, None)
                }
                _ => self.floats(out, &set, None),
            };
            attributes.insert(format!("COLOR_{n}"), set);
        }
        for n in 0..self.first.skinning.len() {
            let set = self.rows(|it| it.skinning.get(n).map_or(&[], Vec::as_slice));
            let weights: Vec<_> = set.iter().map(|influence| influence.weights).collect();
            let weights = self.floats(out, &weights, None);
            attributes.insert(format!("JOINTS_{n}"), self.joints(out, &set));
            attributes.insert(format!("WEIGHTS_{n}"), weights);
        }
        let deviations: Vec<[f32; 1]> = (self.patches())
            .flat_map(|it| it.patch.deviations.iter().map(|x| [*x]))
            .collect();
        if !deviations.is_empty() {
            attributes.insert(CONFIDENCE.into(), self.floats(out, &deviations, None));
        }
        let targets = if self.home().targets > 0 {
            // All primitives of a mesh must have the same number of targets; none moves the patch.
            let still = vec![[0.0; 3]; self.vertices];
            let still = self.floats(out, &still, Some(AccessorBounds::of(&still)));
            vec![json!({ "POSITION": still }); self.home().targets]
        } else {
            Vec::new()
        };
        let mut primitive = Map::new();
        primitive.insert("attributes".into(), Value::Object(attributes));
        primitive.insert("indices".into(), self.indices(out, PatchSide::Front));
        primitive.insert("material".into(), json!(look.material));
        primitive.insert("mode".into(), json!(TRIANGLES));
        if !targets.is_empty() {
            primitive.insert("targets".into(), Value::Array(targets));
        }
        if let Some(extensions) = &look.extensions {
            primitive.insert("extensions".into(), extensions.clone());
        }
        let mut record = self.record();
        if let Some(hatch) = hatch {
            record.insert("hatch".into(), json!(hatch));
        }
        primitive.insert("extras".into(), json!({ "darn": record }));
        Value::Object(primitive)
    }

    /// The places of all patches in their common images.
    fn image_coordinates(&self, images: &ImageSheet<'s>) -> Vec<[f32; 2]> {
        let each = self.patches().enumerate().map(|(k, patch)| {
            let own = patch.patch.texcoords.first();
            let own = own.into_iter().flatten();
            own.map(move |place| images.place(k, *place))
        });
        each.flatten().collect()
    }

    /// Tangents of all patches' vertices; none where the patches have none.
    fn tangents(&self) -> Vec<[f32; 4]> {
        let each = self.patches().map(|patch| patch.tangents(&patch.normals()));
        each.flatten().collect()
    }

    /// The hatch of all patches, each laid on its own.
    fn hatch_coordinates(&self) -> Vec<[f32; 2]> {
        let each = self
            .patches()
            .map(|patch| hatch::coordinates(&patch.points));
        each.flatten().collect()
    }

    /// The primitive of the back: it shares all accessors of the front except normals, tangents and indices.
    fn back(&self, out: &mut Appender<'_>, front: &Value) -> Value {
        let mut back = front.clone();
        back["indices"] = self.indices(out, PatchSide::Back);
        if self.look().normals.is_some() {
            let normals = self.patches().flat_map(CheckedPatch::normals);
            let inward: Vec<[f32; 3]> = normals.map(|n| n.map(|x| -x)).collect();
            back["attributes"]["NORMAL"] = self.floats(out, &inward, None);
            let tangents = self.tangents().into_iter();
            let tangents: Vec<[f32; 4]> = tangents.map(|[x, y, z, w]| [x, y, z, -w]).collect();
            if !tangents.is_empty() {
                back["attributes"]["TANGENT"] = self.floats(out, &tangents, None);
            }
        }
        back
    }

    /// `extras.darn` of the primitive.
    fn record(&self) -> Map<String, Value> {
        let mut record = Map::new();
        record.insert("reconstructed".into(), Value::Bool(true));
        record.insert("version".into(), env!("CARGO_PKG_VERSION").into());
        if !self.first.patch.deviations.is_empty() {
            let meaning = json!({ "attribute": CONFIDENCE, "meaning": MEANING });
            record.insert("confidence".into(), meaning);
        }
        let (mut holes, mut index, mut vertex) = (Vec::new(), 0, 0);
        for patch in self.patches() {
            let said = patch.patch.method.clone();
            said.into_iter().for_each(|(key, value)| {
                record.entry(key).or_insert(value);
            });
            let (indices, vertices) = (3 * patch.patch.faces.len(), patch.points.len());
            let mut hole = patch.patch.hole.clone();
            for (key, value) in [
                ("firstIndex", index),
                ("indexCount", indices),
                ("firstVertex", vertex),
                ("vertexCount", vertices),
            ] {
                hole.insert(key.into(), json!(value));
            }
            holes.push(Value::Object(hole));
            index += indices;
            vertex += vertices;
        }
        record.insert("holes".into(), Value::Array(holes));
        record
    }

    /// The values of all patches' vertices, one patch after another.
    fn rows<T: Copy>(&self, of: impl for<'p> Fn(&'p CheckedPatch<'s>) -> &'p [T]) -> Vec<T> {
        let mut rows = Vec::with_capacity(self.vertices);
        self.patches()
            .for_each(|patch| rows.extend_from_slice(of(patch)));
        rows
    }

    /// Appends an accessor of VEC`N`, or SCALAR, over the vertices; returns its index.
    fn floats<const N: usize>(
        &self,
        out: &mut Appender<'_>,
        rows: &[[f32; N]],
        bounds: Option<AccessorBounds>,
    ) -> Value {
        out.accessor(AccessorData {
            name: &self.name(),
            target: BufferTarget::Vertices,
            component: ComponentType::F32,
            kind: match N {
                1 => Type::Scalar,
                2 => Type::Vec2,
                3 => Type::Vec3,
                _ => Type::Vec4,
            },
            bytes: float_bytes(rows),
            bounds,
        })
    }

    /// Appends the joints of one set; returns the accessor's index.
    fn joints(&self, out: &mut Appender<'_>, set: &[Influence]) -> Value {
        let joints = set.iter().flat_map(|influence| influence.joints);
        out.accessor(AccessorData {
            name: &self.name(),
            target: BufferTarget::Vertices,
            component: ComponentType::U16,
            kind: Type::Vec4,
            bytes: joints.flat_map(u16::to_le_bytes).collect(),
            bounds: None,
        })
    }

    /// Appends the triangles of one side; returns the accessor's index. Their winding is reversed on the back, and
    /// reversed if the node's transform mirrors.
    fn indices(&self, out: &mut Appender<'_>, side: PatchSide) -> Value {
        let reversed = self.home().transform.mirrors() != (side == PatchSide::Back);
        let mut faces = Vec::new();
        let mut first = 0;
        for patch in self.patches() {
            let own = patch.patch.faces.iter().map(|face| {
                let [a, b, c] = face.map(|v| first + v);
                if reversed { [a, c, b] } else { [a, b, c] }
            });
            faces.extend(own);
            // The sum fits: the group takes no patch that would go past the largest index.
            first += patch.points.len() as u32;
        }
        let (component, bytes) = index_bytes(faces.into_iter(), self.vertices);
        out.accessor(AccessorData {
            name: &self.name(),
            target: BufferTarget::Indices,
            component,
            kind: Type::Scalar,
            bytes,
            bounds: None,
        })
    }
}

/// Texels of a patch's own image.
fn texels(patch: &CheckedPatch<'_>) -> usize {
    let own = patch.patch.appearance.own();
    own.map_or(0, |own| own.width as usize * own.height as usize)
}
