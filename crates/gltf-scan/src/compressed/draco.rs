//! `KHR_draco_mesh_compression`: a primitive whose triangles and vertices are one Draco stream.

use draco_core::draco_types::DataType;
use draco_core::geometry_attribute::PointAttribute;
use draco_core::geometry_indices::PointIndex;
use draco_core::metadata::GeometryMetadata;
use draco_core::{DecodeLimits, DecoderBuffer, DracoError, ErrorKind, Mesh, MeshDecoder};
use gltf::json::accessor::ComponentType;

use super::super::error::ScanError;
use super::super::json::JsonPlace;
use super::super::limits::Limit;
use super::DecodeAllowance;

/// The extension's name.
pub(in super::super) const NAME: &str = "KHR_draco_mesh_compression";

/// Bytes of memory a face and a point while a stream is decoded: corner tables, symbols, prediction.
const FACE_SCRATCH: usize = 100;
const POINT_SCRATCH: usize = 40;
/// Most bytes of attributes a point: positions, normals, tangents, four sets of texture coordinates, colours, joints and
/// weights take 112.
const POINT_ATTRIBUTES: usize = 128;
/// Nanoseconds of work a face or a point.
const ELEMENT_WORK: u64 = 150;

/// A decoded stream.
pub(in super::super) struct DracoMesh {
    mesh: Mesh,
}

/// An attribute of a decoded stream, one element a point.
pub(in super::super) struct DracoAttribute<'d> {
    attribute: &'d PointAttribute,
    points: usize,
}

/// What the head of a stream declares.
struct StreamHead {
    triangles: bool,
    faces: usize,
    /// Vertices of the connectivity. Attributes with seams split them: the stream may decode to more points.
    points: usize,
}

impl DracoMesh {
    /// Decodes a stream. `place` is the extension's object.
    pub fn decode(
        place: &JsonPlace<'_>,
        stream: &[u8],
        allowance: &DecodeAllowance<'_>,
    ) -> Result<Self, ScanError> {
        let fail = |error: DracoError| decode_error(place, &error);
        let head = StreamHead::read(stream).map_err(fail)?;
        if !head.triangles {
            return Err(ScanError::PointCloud {
                pointer: place.pointer.clone(),
            });
        }
        let limits = allowance.limits;
        let check = |faces: usize, points: usize| {
            let faces_limit = Limit {
                name: "max_faces",
                allowed: limits.max_faces,
            };
            let points_limit = Limit {
                name: "max_vertices",
                allowed: limits.max_vertices,
            };
            faces_limit.check(faces, &place.pointer)?;
            points_limit.check(points, &place.pointer)
        };
        check(head.faces, head.points)?;
        // Seams split points, at most at every corner.
        let most = (3 * head.faces).max(head.points).min(limits.max_vertices);
        let attributes = allowance.left().min(POINT_ATTRIBUTES * most);
        let scratch = FACE_SCRATCH * head.faces + POINT_SCRATCH * head.points + attributes;
        let budget = allowance.budget;
        budget.spend_at_once(ELEMENT_WORK * (head.faces + head.points) as u64)?;
        budget.hold(scratch)?;
        let ceiling = DecodeLimits::default()
            .with_max_faces(limits.max_faces as u64)
            .with_max_points(limits.max_vertices as u64)
            .with_max_decoded_bytes(attributes as u64);
        let mut mesh = Mesh::new();
        let decoded = MeshDecoder::new().decode(
            &mut DecoderBuffer::new(stream).with_limits(ceiling),
            &mut mesh,
        );
        budget.release(scratch);
        decoded.map_err(|error| match error.kind() {
            ErrorKind::LimitExceeded => ScanError::Limit {
                pointer: place.pointer.clone(),
                limit: "max_decoded_bytes",
                allowed: attributes,
                found: attributes.saturating_add(1),
            },
            _ => decode_error(place, &error),
        })?;
        check(mesh.num_faces(), mesh.num_points())?;
        let decoded = Self { mesh };
        allowance.take(decoded.bytes(), &place.pointer)?;
        Ok(decoded)
    }

    /// Number of points, the vertices of the primitive.
    pub fn points(&self) -> usize {
        self.mesh.num_points()
    }

    /// The triangles; their indices are the stream's and not checked.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        let faces = self.mesh.faces().iter();
        faces.map(|face| face.map(|point| point.0))
    }

    /// Number of triangles.
    pub fn faces(&self) -> usize {
        self.mesh.num_faces()
    }

    /// The attribute with the unique id `id`.
    pub fn attribute(&self, id: usize) -> Option<DracoAttribute<'_>> {
        let attribute = self.mesh.attribute_by_unique_id(u32::try_from(id).ok()?)?;
        Some(DracoAttribute {
            attribute,
            points: self.points(),
        })
    }

    /// Bytes of memory of the decoded stream.
    fn bytes(&self) -> usize {
        let attributes = (0..self.mesh.num_attributes()).filter_map(|index| {
            let attribute = self.mesh.try_attribute(index).ok()?;
            let map = attribute.explicit_mapping().map_or(0, |map| 4 * map.len());
            Some(attribute.buffer().data_size() + map)
        });
        attributes.sum::<usize>() + 12 * self.faces()
    }
}

impl DracoAttribute<'_> {
    /// Number of elements.
    pub fn count(&self) -> usize {
        self.points
    }

    /// Numbers in an element.
    pub fn components(&self) -> usize {
        self.attribute.num_components().into()
    }

    /// Writes the element of a point as glTF stores elements of `component`; `false` if the stream has none for it.
    ///
    /// `out` has room for [`DracoAttribute::components`] numbers. Integers that `component` cannot hold are clamped.
    pub fn write(&self, point: usize, component: ComponentType, out: &mut [u8]) -> bool {
        let kind = self.attribute.data_type();
        let (width, stride) = (kind.byte_length(), self.attribute.byte_stride());
        let index = self.attribute.mapped_index(PointIndex(point as u32)).0 as usize;
        let from = usize::try_from(stride)
            .ok()
            .and_then(|stride| index.checked_mul(stride));
        let Some(element) = from.and_then(|from| {
            let to = from.checked_add(width * self.components())?;
            self.attribute.buffer().data().get(from..to)
        }) else {
            return false;
        };
        if kind == DataType::Float32 && component == ComponentType::F32 {
            out.copy_from_slice(element);
            return true;
        }
        let numbers = element.chunks_exact(width.max(1));
        for (number, slot) in numbers.zip(out.chunks_exact_mut(component.size())) {
            match scalar(number, kind) {
                Some(x) => store(x, component, slot),
                None => return false,
            }
        }
        true
    }
}

impl StreamHead {
    /// Reads the head, and nothing of the data behind it (Draco bitstream specification, sections 3 to 5).
    fn read(stream: &[u8]) -> Result<Self, DracoError> {
        const METADATA: u16 = 0x8000;
        let mut buffer = DecoderBuffer::new(stream);
        if buffer.decode_slice(5)? != b"DRACO" {
            return Err(DracoError::general("it does not begin with DRACO"));
        }
        let version = (buffer.decode_u8()?, buffer.decode_u8()?);
        buffer.set_version(version.0, version.1);
        let triangles = buffer.decode_u8()? != 0;
        let edgebreaker = buffer.decode_u8()? == 1;
        let flags = buffer.decode_u16()?;
        if !triangles {
            return Ok(Self {
                triangles,
                faces: 0,
                points: 0,
            });
        }
        if version >= (1, 3) && flags & METADATA != 0 {
            GeometryMetadata::decode(&mut buffer)?;
        }
        if edgebreaker {
            let _traversal = buffer.decode_u8()?;
        }
        // Counts have four bytes in old streams: before 2.0, or before 2.2 if the connectivity is sequential.
        let fixed = version < if edgebreaker { (2, 0) } else { (2, 2) };
        let mut count = || {
            let count = if fixed {
                buffer.decode_u32()?.into()
            } else {
                buffer.decode_varint()?
            };
            Ok::<_, DracoError>(usize::try_from(count).unwrap_or(usize::MAX))
        };
        let (faces, points) = if edgebreaker {
            if version < (2, 2) {
                let _new_vertices = count()?;
            }
            let points = count()?;
            (count()?, points)
        } else {
            (count()?, count()?)
        };
        Ok(Self {
            triangles,
            faces,
            points,
        })
    }
}

fn decode_error(place: &JsonPlace<'_>, error: &DracoError) -> ScanError {
    match error.kind() {
        ErrorKind::UnsupportedVersion
        | ErrorKind::UnsupportedFeature
        | ErrorKind::UnknownVersion
        | ErrorKind::BitstreamVersionUnsupported => ScanError::Unsupported {
            pointer: place.pointer.clone(),
            extension: NAME,
        },
        _ => place.invalid(format!(
            "the Draco stream does not decode: {}",
            error.message()
        )),
    }
}

/// A number of a Draco attribute; `None` for types that glTF has not.
fn scalar(bytes: &[u8], kind: DataType) -> Option<f64> {
    Some(match (kind, bytes) {
        (DataType::Int8, &[a]) => (a as i8).into(),
        (DataType::Uint8 | DataType::Bool, &[a]) => a.into(),
        (DataType::Int16, &[a, b]) => i16::from_le_bytes([a, b]).into(),
        (DataType::Uint16, &[a, b]) => u16::from_le_bytes([a, b]).into(),
        (DataType::Int32, &[a, b, c, d]) => i32::from_le_bytes([a, b, c, d]).into(),
        (DataType::Uint32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]).into(),
        (DataType::Float32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
        _ => return None,
    })
}

/// Stores a number as a component; casts of floats to integers clamp.
fn store(x: f64, component: ComponentType, slot: &mut [u8]) {
    match component {
        ComponentType::I8 => slot.copy_from_slice(&(x as i8).to_le_bytes()),
        ComponentType::U8 => slot.copy_from_slice(&(x as u8).to_le_bytes()),
        ComponentType::I16 => slot.copy_from_slice(&(x as i16).to_le_bytes()),
        ComponentType::U16 => slot.copy_from_slice(&(x as u16).to_le_bytes()),
        ComponentType::U32 => slot.copy_from_slice(&(x as u32).to_le_bytes()),
        ComponentType::F32 => slot.copy_from_slice(&(x as f32).to_le_bytes()),
    }
}
