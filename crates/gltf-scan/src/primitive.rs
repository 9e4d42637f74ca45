//! The data of one primitive, wherever it is: in plain accessors, or in the primitive's Draco stream.

use gltf::json::mesh::TRIANGLES;

use super::accessor::Accessor;
use super::buffers::Document;
use super::compressed::draco::DracoMesh;
use super::error::ScanError;
use super::json::JsonPlace;

/// A primitive and its attributes.
pub(super) struct PrimitiveSource<'d, 'a> {
    document: &'d Document<'a>,
    /// The primitive's object.
    pub place: JsonPlace<'a>,
    /// Its `attributes`.
    pub attributes: JsonPlace<'a>,
    draco: Option<DracoSource<'d, 'a>>,
}

/// The Draco stream of a primitive.
struct DracoSource<'d, 'a> {
    /// The extension's object.
    place: JsonPlace<'a>,
    /// Index of the stream's buffer view.
    view: usize,
    mesh: &'d DracoMesh,
}

/// What identifies decoded elements: primitives that share them share the result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct ElementsKey {
    accessor: usize,
    /// The buffer view of the Draco stream that has the elements.
    stream: Option<usize>,
}

/// One attribute of a primitive.
pub(super) struct AttributeSource<'d, 'a> {
    document: &'d Document<'a>,
    pub key: ElementsKey,
    /// The accessor.
    pub place: JsonPlace<'a>,
    /// The stream, and the place of the attribute's id in it.
    draco: Option<(&'d DracoMesh, JsonPlace<'a>)>,
}

impl<'d, 'a> PrimitiveSource<'d, 'a> {
    /// Opens a primitive; decodes its Draco stream if it has one.
    pub fn open(document: &'d Document<'a>, place: &JsonPlace<'a>) -> Result<Self, ScanError> {
        let attributes = place.need("attributes")?;
        let draco = match attributes.get("POSITION")? {
            Some(position) => {
                let (_, position) = document.root.referred("accessors", &position)?;
                document.draco_of(place, &position)?
            }
            None => None,
        };
        let draco = match draco {
            Some(place) => {
                let (view, mesh) = document.draco(&place)?;
                Some(DracoSource { place, view, mesh })
            }
            None => None,
        };
        Ok(Self {
            document,
            place: place.clone(),
            attributes,
            draco,
        })
    }

    /// The attribute with this name, if the primitive has it.
    pub fn attribute(&self, name: &str) -> Result<Option<AttributeSource<'d, 'a>>, ScanError> {
        let Some(reference) = self.attributes.get(name)? else {
            return Ok(None);
        };
        let (accessor, place) = self.document.root.referred("accessors", &reference)?;
        let mut found = AttributeSource {
            document: self.document,
            key: ElementsKey {
                accessor,
                stream: None,
            },
            place,
            draco: None,
        };
        // Attributes that the stream has not are plain.
        if let Some(draco) = &self.draco
            && let Some(id) = draco.place.need("attributes")?.get(name)?
        {
            found.key.stream = Some(draco.view);
            found.draco = Some((draco.mesh, id));
        }
        Ok(Some(found))
    }

    /// Number of triangles in the primitive's Draco stream; `None` without one.
    pub fn stream_faces(&self) -> Option<usize> {
        self.draco.as_ref().map(|draco| draco.mesh.faces())
    }

    /// Whether an accessor of the primitive states another `count` than its Draco stream has. The stream counts: the counts of real files are
    /// often those from before the compression (Khronos's own samples, glTF-Sample-Models issue 234), and viewers take the stream.
    pub fn misstates_stream(&self) -> Result<bool, ScanError> {
        let Some(draco) = &self.draco else {
            return Ok(false);
        };
        let states = |reference: &JsonPlace<'a>| {
            let (_, accessor) = self.document.root.referred("accessors", reference)?;
            accessor.need("count")?.integer()
        };
        let mut differs = false;
        let compressed = draco.place.need("attributes")?;
        for name in compressed.value.as_object().into_iter().flatten() {
            if let Some(reference) = self.attributes.get(name.0)? {
                differs |= states(&reference)? != draco.mesh.points();
            }
        }
        let lists_triangles =
            self.place.integer_or("mode", TRIANGLES as usize)? == TRIANGLES as usize;
        if let Some(reference) = self.place.get("indices")? {
            let stated = states(&reference)?;
            differs |= lists_triangles && stated != 3 * draco.mesh.faces();
        }
        Ok(differs)
    }

    /// The triangles of the primitive's Draco stream, over `vertices` vertices.
    pub fn stream_triangles(&self, vertices: usize) -> Result<Vec<[u32; 3]>, ScanError> {
        let Some(draco) = &self.draco else {
            return Ok(Vec::new());
        };
        let inside = |face: [u32; 3]| {
            let inside = face.iter().all(|index| (*index as usize) < vertices);
            inside.then_some(face)
        };
        let triangles: Option<_> = draco.mesh.triangles().map(inside).collect();
        triangles.ok_or_else(|| {
            draco.place.invalid(format!(
                "a triangle of the Draco stream names a vertex past the {vertices} of the primitive"
            ))
        })
    }
}

impl<'d> AttributeSource<'d, '_> {
    /// Opens the accessor over the elements, wherever they are.
    pub fn open(&self) -> Result<Accessor<'d>, ScanError> {
        let attribute = match &self.draco {
            Some((mesh, id)) => {
                let attribute = mesh.attribute(id.integer()?);
                Some(
                    attribute
                        .ok_or_else(|| id.invalid("the Draco stream has no such attribute"))?,
                )
            }
            None => None,
        };
        Accessor::open_over(self.document, &self.place, attribute)
    }
}
