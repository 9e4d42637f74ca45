//! The container of a scan: GLB chunks, or a JSON document.

use std::ops::Range;

use darn_mesh_files::MeshFormat;

use super::error::ScanError;

/// The container of a scan. Its first bytes decide, not a file name or media type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Container {
    /// Binary glTF: the magic `glTF`, a JSON chunk and usually a BIN chunk.
    Glb,
    /// A JSON document; its buffers are data URIs or other files.
    Gltf,
    /// A zip with one of these and the files that it refers to.
    Zip,
    /// Wavefront OBJ; its materials and images are other files, which stay as they are.
    Obj,
    /// The Polygon File Format.
    Ply,
}

impl Container {
    /// The media type of this container.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Glb => "model/gltf-binary",
            Self::Gltf => "model/gltf+json",
            Self::Zip => "application/zip",
            Self::Obj => MeshFormat::Obj.media_type(),
            Self::Ply => MeshFormat::Ply.media_type(),
        }
    }
}

/// The container of a scan and the byte ranges of its contents.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ContainerLayout {
    pub container: Container,
    pub json: Range<usize>,
    /// The payload of the BIN chunk, padding included.
    pub bin: Option<Range<usize>>,
    /// Chunks after JSON and BIN, headers included.
    pub rest: Range<usize>,
    /// Bytes after the declared end of a GLB.
    pub trailing: Range<usize>,
}

const MAGIC: &[u8] = b"glTF";
const JSON_CHUNK: u32 = 0x4E4F_534A;
const BIN_CHUNK: u32 = 0x004E_4942;
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

/// Finds the container and its contents; allocates nothing.
pub(super) fn layout(bytes: &[u8]) -> Result<ContainerLayout, ScanError> {
    let fail = |offset: usize, detail: &str| ScanError::Container {
        offset,
        detail: detail.into(),
    };
    if bytes.is_empty() {
        return Err(fail(0, "the scan is empty"));
    }
    if bytes.starts_with(MAGIC) {
        return glb_layout(bytes);
    }
    let start = if bytes.starts_with(b"\xEF\xBB\xBF") {
        3
    } else {
        0
    };
    match bytes.iter().skip(start).find(|b| !b.is_ascii_whitespace()) {
        Some(b'{') => Ok(ContainerLayout {
            container: Container::Gltf,
            json: start..bytes.len(),
            bin: None,
            rest: bytes.len()..bytes.len(),
            trailing: bytes.len()..bytes.len(),
        }),
        _ => Err(fail(
            0,
            "neither the magic glTF of a GLB, nor the { of a JSON document, nor the magic PK of a zip",
        )),
    }
}

fn glb_layout(bytes: &[u8]) -> Result<ContainerLayout, ScanError> {
    let fail = |offset: usize, detail: String| ScanError::Container { offset, detail };
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(fail(bytes.len(), "the GLB header is cut off".into()));
    };
    if version != 2 {
        return Err(fail(4, format!("GLB version {version}; only 2 is known")));
    }
    let whole = bytes;
    let bytes = whole.get(..length as usize).ok_or_else(|| {
        fail(
            8,
            format!("the header says {length} bytes, there are {}", whole.len()),
        )
    })?;
    let (kind, json) = chunk(bytes, HEADER)?;
    if kind != JSON_CHUNK {
        return Err(fail(HEADER + 4, "the first chunk is not JSON".into()));
    }
    let (mut bin, mut at, mut first) = (None, json.end, true);
    let mut rest = at;
    while at < bytes.len() {
        let (kind, body) = chunk(bytes, at)?;
        at = body.end;
        if first && kind == BIN_CHUNK {
            rest = at;
            bin = Some(body);
        }
        first = false;
    }
    // Some exporters pad JSON with zeros instead of spaces.
    let padding = bytes
        .get(json.clone())
        .unwrap_or_default()
        .iter()
        .rev()
        .take_while(|byte| **byte == 0)
        .count();
    let json = json.start..json.end - padding;
    Ok(ContainerLayout {
        container: Container::Glb,
        json,
        bin,
        rest: rest..bytes.len(),
        trailing: bytes.len()..whole.len(),
    })
}

/// Kind and payload of the chunk whose header is at byte `at`.
fn chunk(bytes: &[u8], at: usize) -> Result<(u32, Range<usize>), ScanError> {
    let (Some(length), Some(kind)) = (word(bytes, at), word(bytes, at + 4)) else {
        return Err(ScanError::Container {
            offset: at,
            detail: "a chunk header is cut off".into(),
        });
    };
    let start = at + CHUNK_HEADER;
    let left = bytes.len() - start;
    if length as usize > left {
        let detail = format!("the chunk says {length} bytes, {left} are left");
        return Err(ScanError::Container { offset: at, detail });
    }
    Ok((kind, start..start + length as usize))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes
        .get(at..)?
        .first_chunk()
        .map(|word| u32::from_le_bytes(*word))
}

/// The length of the JSON chunk of a GLB, padding included.
pub(super) fn json_chunk_length(bytes: &[u8]) -> Option<usize> {
    word(bytes, HEADER).map(|length| length as usize)
}

/// The error of a GLB that would be longer than the format can say.
pub(super) fn too_long(length: usize) -> ScanError {
    ScanError::Container {
        offset: length,
        detail: "the scan would exceed the 4 GiB of a GLB".into(),
    }
}

/// Packs a GLB: JSON padded with spaces, BIN padded with zeros, then `rest`, whole chunks. What comes after the GLB is not
/// part of it.
///
/// Returns `None` if the whole would not fit the format's 32-bit lengths.
pub(super) fn pack_glb(json: &[u8], bin: Option<&[u8]>, rest: &[u8]) -> Option<Vec<u8>> {
    pack_glb_of_pieces(json, bin.as_ref().map(std::slice::from_ref), rest)
}

/// [`pack_glb`] with a BIN chunk in pieces.
pub(super) fn pack_glb_of_pieces(
    json: &[u8],
    bin: Option<&[&[u8]]>,
    rest: &[u8],
) -> Option<Vec<u8>> {
    let chunk = |pieces, fill| Chunk {
        pieces,
        length: length_of(pieces).next_multiple_of(4),
        fill,
    };
    packed(chunk(&[json], b' '), bin.map(|bin| chunk(bin, 0)), rest)
}

/// A GLB of chunks that bring their own padding, if any.
///
/// Returns `None` as [`pack_glb`].
pub(super) fn glb_of_chunks(json: &[u8], bin: Option<&[u8]>, rest: &[u8]) -> Option<Vec<u8>> {
    let chunk = |pieces| Chunk {
        pieces,
        length: length_of(pieces),
        fill: 0,
    };
    let bin = bin.as_ref().map(std::slice::from_ref);
    packed(chunk(&[json]), bin.map(chunk), rest)
}

/// A chunk to write.
struct Chunk<'c> {
    /// Its body.
    pieces: &'c [&'c [u8]],
    /// Its length, padding included.
    length: usize,
    /// The byte to pad it with.
    fill: u8,
}

fn length_of(pieces: &[&[u8]]) -> usize {
    pieces.iter().map(|piece| piece.len()).sum()
}

fn packed(json: Chunk<'_>, bin: Option<Chunk<'_>>, rest: &[u8]) -> Option<Vec<u8>> {
    let bin_length = bin.as_ref().map_or(0, |bin| CHUNK_HEADER + bin.length);
    let total = HEADER + CHUNK_HEADER + json.length + bin_length + rest.len();
    let total = u32::try_from(total).ok()?;
    let mut out = Vec::with_capacity(total as usize);
    out.extend_from_slice(MAGIC);
    out.extend_from_slice(&2u32.to_le_bytes());
    out.extend_from_slice(&total.to_le_bytes());
    let mut push = |kind: u32, chunk: Chunk<'_>| {
        // The cast is lossless: the length is part of `total`, which is a u32.
        out.extend_from_slice(&(chunk.length as u32).to_le_bytes());
        out.extend_from_slice(&kind.to_le_bytes());
        let padding = chunk.length - length_of(chunk.pieces);
        chunk
            .pieces
            .iter()
            .for_each(|piece| out.extend_from_slice(piece));
        out.resize(out.len() + padding, chunk.fill);
    };
    push(JSON_CHUNK, json);
    if let Some(bin) = bin {
        push(BIN_CHUNK, bin);
    }
    out.extend_from_slice(rest);
    Some(out)
}

/// Rows of floats as a buffer stores them, little-endian.
pub(super) fn float_bytes<const N: usize>(rows: &[[f32; N]]) -> Vec<u8> {
    rows.iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packing_and_finding_agree() {
        let rest = [4, 0, 0, 0, b'X', b'Y', b'Z', 0, 9, 9, 9, 9];
        let bytes = pack_glb(b"{}", Some(&[1, 2, 3, 4, 5]), &rest).unwrap();
        let found = layout(&bytes).unwrap();
        assert_eq!(&bytes[found.json], b"{}  ");
        assert_eq!(&bytes[found.bin.unwrap()], &[1, 2, 3, 4, 5, 0, 0, 0]);
        assert_eq!(&bytes[found.rest], &rest);
    }

    #[test]
    fn bytes_after_the_declared_length_are_set_apart() {
        let mut bytes = pack_glb(b"{}", Some(&[1, 2, 3, 4]), &[]).unwrap();
        let end = bytes.len();
        bytes.extend_from_slice(b"signature");
        let found = layout(&bytes).unwrap();
        assert_eq!((found.rest, found.trailing), (end..end, end..end + 9));
    }

    #[test]
    fn every_truncation_is_an_error() {
        let bytes = pack_glb(b"{}", Some(&[1, 2, 3, 4]), &[]).unwrap();
        for n in 0..bytes.len() {
            assert!(
                matches!(layout(&bytes[..n]), Err(ScanError::Container { .. })),
                "{n}"
            );
        }
    }
}
