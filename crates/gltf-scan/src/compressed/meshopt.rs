//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: a buffer view whose bytes are a stream of the meshoptimizer
//! codecs, with a filter over the decoded elements.
//!
//! The two extensions differ in the codecs' versions and in the filter COLOR; both are read with either name.

use meshoptimizer_rs::codec::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat,
    decode_index_buffer, decode_index_sequence, decode_vertex_buffer,
};
use meshoptimizer_rs::{Error, Limits, Workspace};

use super::super::error::ScanError;
use super::super::json::JsonPlace;
use super::DecodeAllowance;

/// The names of the extension.
pub(in super::super) const NAMES: [&str; 2] =
    ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Nanoseconds of work a decoded byte: the slowest codec makes about 200 MB/s.
const BYTE_WORK: u64 = 5;

/// How a compressed buffer view says it is to be decoded.
struct StreamLayout<'a> {
    count: usize,
    stride: usize,
    mode: JsonPlace<'a>,
    filter: Option<JsonPlace<'a>>,
}

/// The bytes of a compressed buffer view, `count` elements of `byteStride` bytes.
///
/// `place` is the extension's object, `name` its name, `stream` the bytes that it refers to.
pub(in super::super) fn decode(
    place: &JsonPlace<'_>,
    name: &'static str,
    stream: &[u8],
    allowance: &DecodeAllowance<'_>,
) -> Result<Vec<u8>, ScanError> {
    let layout = StreamLayout {
        count: place.need("count")?.integer()?,
        stride: place.need("byteStride")?.integer()?,
        mode: place.need("mode")?,
        filter: place.get("filter")?,
    };
    let size = layout.count.saturating_mul(layout.stride);
    allowance.take(size, &place.pointer)?;
    allowance
        .budget
        .spend_at_once(BYTE_WORK.saturating_mul(size as u64))?;
    let mut workspace = Workspace::new(Limits {
        max_bytes: size.saturating_add(1 << 20),
        max_work: u64::MAX,
    });
    let fail = |error: Error| match error {
        Error::UnsupportedVersion => ScanError::Unsupported {
            pointer: place.pointer.clone(),
            extension: name,
        },
        error => place.invalid(format!(
            "the compressed stream of {} bytes does not decode to {} elements of {} bytes: {error}",
            stream.len(),
            layout.count,
            layout.stride
        )),
    };
    let (count, stride) = (layout.count, layout.stride);
    let mut bytes = match layout.mode.text()? {
        "ATTRIBUTES" => decode_vertex_buffer(count, stride, stream, &mut workspace),
        "TRIANGLES" => decode_index_buffer(count, stride, stream, &mut workspace),
        "INDICES" => decode_index_sequence(count, stride, stream, &mut workspace),
        _ => {
            return Err(layout
                .mode
                .invalid("must be ATTRIBUTES, TRIANGLES or INDICES"));
        }
    }
    .map_err(fail)?;
    let Some(filter) = &layout.filter else {
        return Ok(bytes);
    };
    match filter.text()? {
        "NONE" => Ok(()),
        "OCTAHEDRAL" => octahedral(&mut bytes, &layout, &mut workspace),
        "QUATERNION" => decode_filter_quat(&mut bytes, count, stride, &mut workspace),
        "EXPONENTIAL" => decode_filter_exp(&mut bytes, count, stride, &mut workspace),
        "COLOR" => decode_filter_color(&mut bytes, count, stride, &mut workspace),
        _ => return Err(filter.invalid("is no filter of meshopt compression")),
    }
    .map_err(fail)?;
    Ok(bytes)
}

/// The filter OCTAHEDRAL. A vector of length zero has no direction, and the decoder fails on it; it stays zero.
fn octahedral(
    bytes: &mut [u8],
    layout: &StreamLayout<'_>,
    workspace: &mut Workspace,
) -> Result<(), Error> {
    let (count, stride) = (layout.count, layout.stride);
    // Three components of a quarter of the element each; the fourth is not touched.
    let size = stride / 4;
    let mut zero = Vec::new();
    for (index, element) in bytes.chunks_exact_mut(stride.max(1)).enumerate() {
        let vector = element.get_mut(..3 * size).unwrap_or_default();
        if !vector.is_empty() && vector.iter().all(|byte| *byte == 0) {
            zero.push(index);
            // The third component is the length of the octahedron's axis: any positive one has a direction.
            if let Some(axis) = vector.get_mut(2 * size) {
                *axis = 1;
            }
        }
    }
    decode_filter_oct(bytes, count, stride, workspace)?;
    for index in zero {
        let vector = bytes.get_mut(index * stride..index * stride + 3 * size);
        vector.unwrap_or_default().fill(0);
    }
    Ok(())
}
