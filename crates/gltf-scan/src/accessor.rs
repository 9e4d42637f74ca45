//! Reads accessors: all component types, normalized, strided, sparse, from plain buffer views, compressed ones and Draco
//! streams. Every count is checked against the bytes before memory is allocated.

use gltf::json::accessor::{BYTE, FLOAT, SHORT, UNSIGNED_BYTE, UNSIGNED_INT, UNSIGNED_SHORT};
use gltf::json::accessor::{ComponentType, Type};
use rayon::prelude::*;

use super::buffers::{BufferView, Document};
use super::compressed::draco::DracoAttribute;
use super::error::ScanError;
use super::json::JsonPlace;

/// An accessor whose elements are known to lie inside its buffers.
pub(super) struct Accessor<'d> {
    pub pointer: String,
    pub component: ComponentType,
    pub kind: Type,
    pub count: usize,
    normalized: bool,
    base: ElementSource<'d>,
    sparse: Option<SparseAccessor<'d>>,
}

/// Where the elements of an accessor come from.
enum ElementSource<'d> {
    /// Nowhere: all are zero, except those that sparse values replace.
    Zero,
    View(Elements<'d>),
    Draco(DracoAttribute<'d>),
}

/// Elements of `size` bytes, `stride` bytes apart.
struct Elements<'d> {
    bytes: &'d [u8],
    stride: usize,
    size: usize,
}

/// The elements that a sparse accessor replaces, and their values.
struct SparseAccessor<'d> {
    indices: Elements<'d>,
    component: ComponentType,
    values: Elements<'d>,
    pointer: String,
}

impl<'d> Accessor<'d> {
    /// Opens the accessor at `place`. Decodes no element and allocates nothing of its size.
    pub fn open<'a>(document: &'d Document<'a>, place: &JsonPlace<'a>) -> Result<Self, ScanError> {
        Self::open_over(document, place, None)
    }

    /// [`Accessor::open`], with the elements of a Draco attribute in place of those of its buffer view.
    pub fn open_over<'a>(
        document: &'d Document<'a>,
        place: &JsonPlace<'a>,
        draco: Option<DracoAttribute<'d>>,
    ) -> Result<Self, ScanError> {
        let component = component(&place.need("componentType")?)?;
        let kind = kind(&place.need("type")?)?;
        let count = match &draco {
            // The stream knows better than the JSON: viewers take its count too.
            Some(attribute) => attribute.count(),
            None => place.need("count")?.integer()?,
        };
        let size = component.size() * kind.multiplicity();
        let base = match (draco, place.get("bufferView")?) {
            (Some(attribute), _) if attribute.components() != kind.multiplicity() => {
                return Err(place.invalid(format!(
                    "has {} numbers an element, its Draco attribute has {}",
                    kind.multiplicity(),
                    attribute.components()
                )));
            }
            (Some(attribute), _) => ElementSource::Draco(attribute),
            (None, Some(view)) => {
                ElementSource::View(elements(document.view(&view)?, place, count, size)?)
            }
            (None, None) => ElementSource::Zero,
        };
        let sparse = match place.get("sparse")? {
            Some(sparse) => Some(open_sparse(document, &sparse, count, size)?),
            None => None,
        };
        let normalized = place.flag("normalized")?;
        let pointer = place.pointer.clone();
        Ok(Self {
            pointer,
            component,
            kind,
            count,
            normalized,
            base,
            sparse,
        })
    }

    /// All elements as floats, `[count, N]`: normalized integers become [0, 1] or [−1, 1], other integers keep their
    /// value, f32 keep their bits.
    ///
    /// Components that the accessor lacks take `fill`'s value; those beyond `N` are dropped. The caller has checked
    /// `count` against a limit.
    pub fn floats<const N: usize>(&self, fill: [f32; N]) -> Result<Vec<[f32; N]>, ScanError> {
        let step = self.component.size();
        let components = self.kind.multiplicity().min(N);
        let read = |bytes: &[u8]| {
            let mut out = fill;
            for (slot, bytes) in out
                .iter_mut()
                .zip(bytes.chunks_exact(step).take(components))
            {
                *slot = float(bytes, self.component, self.normalized);
            }
            out
        };
        let mut zero = fill;
        zero.iter_mut()
            .take(components)
            .for_each(|slot| *slot = 0.0);
        self.collect(zero, read)
    }

    /// All elements as unsigned integers, to as many zeros. The caller has checked that the type is SCALAR and the
    /// component unsigned.
    pub fn integers(&self, out: &mut [u32]) -> Result<(), ScanError> {
        self.read_into(out, |bytes| unsigned(bytes, self.component))
    }

    /// All elements of VEC4 as stored. The caller has checked that the type is VEC4 and the component u8 or u16.
    pub fn quadruples(&self) -> Result<Vec<[u16; 4]>, ScanError> {
        let step = self.component.size();
        self.collect([0; 4], |bytes| {
            let mut out = [0; 4];
            for (slot, bytes) in out.iter_mut().zip(bytes.chunks_exact(step)) {
                *slot = unsigned(bytes, self.component) as u16;
            }
            out
        })
    }

    fn collect<T: Copy + Send>(
        &self,
        zero: T,
        read: impl Fn(&[u8]) -> T + Sync,
    ) -> Result<Vec<T>, ScanError> {
        let mut out = vec![zero; self.count];
        self.read_into(&mut out, read)?;
        Ok(out)
    }

    /// Reads the elements that there are; the others stay.
    fn read_into<T: Send>(
        &self,
        out: &mut [T],
        read: impl Fn(&[u8]) -> T + Sync,
    ) -> Result<(), ScanError> {
        match &self.base {
            ElementSource::View(base) => {
                let parts = out.par_chunks_mut(PART).zip(base.parts());
                parts.for_each(|(out, part)| {
                    for (slot, bytes) in out.iter_mut().zip(part.iter()) {
                        *slot = read(bytes);
                    }
                });
            }
            ElementSource::Draco(attribute) => self.read_draco(attribute, out, &read)?,
            ElementSource::Zero => {}
        }
        if let Some(sparse) = &self.sparse {
            for (k, (index, value)) in sparse.indices.iter().zip(sparse.values.iter()).enumerate() {
                let index = unsigned(index, sparse.component);
                let slot = out
                    .get_mut(index as usize)
                    .ok_or_else(|| ScanError::Invalid {
                        pointer: sparse.pointer.clone(),
                        detail: format!(
                            "element {k} is index {index}, but the accessor has {} elements",
                            self.count
                        ),
                    })?;
                *slot = read(value);
            }
        }
        Ok(())
    }

    fn read_draco<T>(
        &self,
        attribute: &DracoAttribute<'_>,
        out: &mut [T],
        read: impl Fn(&[u8]) -> T,
    ) -> Result<(), ScanError> {
        let mut element = [0; 16 * size_of::<f32>()];
        let size = self.component.size() * self.kind.multiplicity();
        let element = element.get_mut(..size).unwrap_or_default();
        for (point, slot) in out.iter_mut().enumerate() {
            if !attribute.write(point, self.component, element) {
                return Err(ScanError::Invalid {
                    pointer: self.pointer.clone(),
                    detail: format!("its Draco attribute has no value for point {point}"),
                });
            }
            *slot = read(element);
        }
        Ok(())
    }
}

/// Elements that one thread reads at once.
const PART: usize = 1 << 14;

impl<'d> Elements<'d> {
    /// The elements in parts of [`PART`].
    fn parts(&self) -> impl IndexedParallelIterator<Item = Elements<'d>> {
        let &Elements { stride, size, .. } = self;
        let part = move |bytes| Elements {
            bytes,
            stride,
            size,
        };
        self.bytes.par_chunks(stride * PART).map(part)
    }

    /// The elements in order; their extent was checked on opening.
    fn iter(&self) -> impl Iterator<Item = &'d [u8]> {
        let size = self.size;
        self.bytes
            .chunks(self.stride)
            .filter_map(move |chunk| chunk.get(..size))
    }
}

/// `count` elements of `size` bytes in `view`, starting at the `byteOffset` of `place`.
fn elements<'d>(
    view: BufferView<'d>,
    place: &JsonPlace<'_>,
    count: usize,
    size: usize,
) -> Result<Elements<'d>, ScanError> {
    let offset = place.integer_or("byteOffset", 0)?;
    let stride = view.stride.unwrap_or(size);
    if stride < size {
        let detail = format!(
            "is {stride}, less than the {size} bytes of an element of {}",
            place.pointer
        );
        return Err(ScanError::Invalid {
            pointer: format!("{}/byteStride", view.pointer),
            detail,
        });
    }
    let extent = match count {
        0 => Some(0),
        n => stride
            .checked_mul(n - 1)
            .and_then(|bytes| bytes.checked_add(size)),
    };
    extent
        .and_then(|extent| offset.checked_add(extent))
        .and_then(|end| view.bytes.get(offset..end))
        .map(|bytes| Elements { bytes, stride, size })
        .ok_or_else(|| {
            place.invalid(format!(
                "{count} elements of {size} bytes, {stride} apart, from byteOffset {offset} go past the {} bytes of {}",
                view.bytes.len(),
                view.pointer
            ))
        })
}

fn open_sparse<'d, 'a>(
    document: &'d Document<'a>,
    place: &JsonPlace<'a>,
    elements_of_base: usize,
    size: usize,
) -> Result<SparseAccessor<'d>, ScanError> {
    let count = place.need("count")?;
    let n = count.integer()?;
    if n > elements_of_base {
        return Err(count.invalid(format!(
            "is {n}, more than the {elements_of_base} elements of the accessor"
        )));
    }
    let indices_place = place.need("indices")?;
    let component = component(&indices_place.need("componentType")?)?;
    if !is_unsigned(component) {
        return Err(indices_place.invalid("sparse indices must be unsigned integers"));
    }
    let values_place = place.need("values")?;
    let indices = document.view(&indices_place.need("bufferView")?)?;
    let values = document.view(&values_place.need("bufferView")?)?;
    Ok(SparseAccessor {
        indices: elements(indices, &indices_place, n, component.size())?,
        component,
        values: elements(values, &values_place, n, size)?,
        pointer: indices_place.pointer,
    })
}

/// Whether glTF allows indices of this component type.
pub(super) fn is_unsigned(component: ComponentType) -> bool {
    matches!(
        component,
        ComponentType::U8 | ComponentType::U16 | ComponentType::U32
    )
}

fn component(place: &JsonPlace<'_>) -> Result<ComponentType, ScanError> {
    match u32::try_from(place.integer()?).unwrap_or(0) {
        BYTE => Ok(ComponentType::I8),
        UNSIGNED_BYTE => Ok(ComponentType::U8),
        SHORT => Ok(ComponentType::I16),
        UNSIGNED_SHORT => Ok(ComponentType::U16),
        UNSIGNED_INT => Ok(ComponentType::U32),
        FLOAT => Ok(ComponentType::F32),
        _ => Err(place.invalid("is no component type of glTF")),
    }
}

fn kind(place: &JsonPlace<'_>) -> Result<Type, ScanError> {
    match place.text()? {
        "SCALAR" => Ok(Type::Scalar),
        "VEC2" => Ok(Type::Vec2),
        "VEC3" => Ok(Type::Vec3),
        "VEC4" => Ok(Type::Vec4),
        _ => Err(place.invalid("must be SCALAR, VEC2, VEC3 or VEC4 here")),
    }
}

fn unsigned(bytes: &[u8], component: ComponentType) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, &[a, ..]) => a.into(),
        (ComponentType::U16, &[a, b, ..]) => u16::from_le_bytes([a, b]).into(),
        (ComponentType::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]),
        // Callers pass unsigned components only.
        _ => 0,
    }
}

fn float(bytes: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let (value, full) = match (component, bytes) {
        (ComponentType::F32, &[a, b, c, d]) => return f32::from_le_bytes([a, b, c, d]),
        (ComponentType::I8, &[a]) => (f64::from(a as i8), f64::from(i8::MAX)),
        (ComponentType::I16, &[a, b]) => {
            (f64::from(i16::from_le_bytes([a, b])), f64::from(i16::MAX))
        }
        (ComponentType::U8, &[a]) => (f64::from(a), f64::from(u8::MAX)),
        (ComponentType::U16, &[a, b]) => {
            (f64::from(u16::from_le_bytes([a, b])), f64::from(u16::MAX))
        }
        (ComponentType::U32, &[a, b, c, d]) => (
            f64::from(u32::from_le_bytes([a, b, c, d])),
            f64::from(u32::MAX),
        ),
        // Not reached: `bytes` is always one component long.
        _ => (0.0, 1.0),
    };
    // The most negative integer is one step below −1 and is clamped (glTF 2.0, 3.6.2.2).
    if normalized {
        (value / full).max(-1.0) as f32
    } else {
        value as f32
    }
}
