//! The bytes of buffer views: from the BIN chunk, data URIs and the files that came with the scan; no file or URL is opened.
//! Each is bounds-checked, and decoded at most once, compressed ones too.

use std::cell::OnceCell;
use std::collections::BTreeSet;

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use bytes::Bytes;

use super::compressed::draco::{self, DracoMesh};
use super::compressed::{DecodeAllowance, meshopt};
use super::error::ScanError;
use super::files::Companions;
use super::json::JsonPlace;

/// Padding is optional: some exporters leave it out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// `ARRAY_BUFFER` and `ELEMENT_ARRAY_BUFFER` (glTF 2.0, 5.11.5).
#[derive(Debug, Clone, Copy)]
pub(super) enum BufferTarget {
    Vertices = 34962,
    Indices = 34963,
}

/// The scan's JSON and its buffers.
pub(super) struct Document<'a> {
    pub root: JsonPlace<'a>,
    bin: Option<&'a [u8]>,
    companions: &'a Companions,
    /// Data URIs and files by buffer, and decoded streams by buffer view.
    decoded: Vec<OnceCell<Bytes>>,
    meshopt: Vec<OnceCell<Vec<u8>>>,
    draco: Vec<OnceCell<DracoMesh>>,
    allowance: DecodeAllowance<'a>,
    required: BTreeSet<&'a str>,
}

/// The bytes of a buffer view and the distance of its elements in bytes, if it is given.
pub(super) struct BufferView<'d> {
    pub bytes: &'d [u8],
    pub stride: Option<usize>,
    pub pointer: String,
}

impl<'a> Document<'a> {
    pub fn new(
        root: JsonPlace<'a>,
        bin: Option<&'a [u8]>,
        companions: &'a Companions,
        allowance: DecodeAllowance<'a>,
    ) -> Result<Self, ScanError> {
        let length = |list: &str| {
            root.get(list)?
                .map_or(Ok(0), |list| list.array().map(<[_]>::len))
        };
        let (buffers, views) = (length("buffers")?, length("bufferViews")?);
        let required = match root.get("extensionsRequired")? {
            Some(list) => list
                .array()?
                .iter()
                .filter_map(|name| name.as_str())
                .collect(),
            None => BTreeSet::new(),
        };
        Ok(Self {
            root,
            bin,
            companions,
            decoded: empty_cells(buffers),
            meshopt: empty_cells(views),
            draco: empty_cells(views),
            allowance,
            required,
        })
    }

    /// The buffer view that `from` refers to, decoded if it is compressed.
    pub fn view(&self, from: &JsonPlace<'a>) -> Result<BufferView<'_>, ScanError> {
        let (index, view) = self.root.referred("bufferViews", from)?;
        let bytes: &[u8] = match self.compression(&view)? {
            Some((name, extension)) => cached(&self.meshopt, index, || {
                let stream = self.range(&extension)?;
                meshopt::decode(&extension, name, stream, &self.allowance)
            })?,
            None => self.range(&view)?,
        };
        let stride = view
            .get("byteStride")?
            .map(|stride| stride.integer())
            .transpose()?;
        Ok(BufferView {
            bytes,
            stride,
            pointer: view.pointer,
        })
    }

    /// The Draco stream that the extension at `place` refers to, decoded, and the index of its buffer view.
    pub fn draco(&self, place: &JsonPlace<'a>) -> Result<(usize, &DracoMesh), ScanError> {
        let reference = place.need("bufferView")?;
        let (index, _) = self.root.referred("bufferViews", &reference)?;
        let mesh = cached(&self.draco, index, || {
            let stream = self.view(&reference)?.bytes;
            DracoMesh::decode(place, stream, &self.allowance)
        })?;
        Ok((index, mesh))
    }

    /// The use of Draco by a primitive, if its data is to be taken from there: the file may have plain accessors in
    /// case the reader does not know the extension, which it then does not require.
    pub fn draco_of(
        &self,
        primitive: &JsonPlace<'a>,
        position: &JsonPlace<'a>,
    ) -> Result<Option<JsonPlace<'a>>, ScanError> {
        let plain = position.get("bufferView")?.is_some() && !self.requires(draco::NAME);
        Ok(primitive.extension(draco::NAME)?.filter(|_| !plain))
    }

    /// Gives back the memory of what was decoded, just before it is dropped.
    pub fn release(&self) {
        self.allowance.release();
    }

    /// The extension that compresses a view, and its name; `None` if the plain bytes are there too and the file does not
    /// require the extension.
    fn compression(
        &self,
        view: &JsonPlace<'a>,
    ) -> Result<Option<(&'static str, JsonPlace<'a>)>, ScanError> {
        for name in meshopt::NAMES {
            let Some(extension) = view.extension(name)? else {
                continue;
            };
            let (index, buffer) = self.root.referred("buffers", &view.need("buffer")?)?;
            let bare = buffer.get("uri")?.is_none() && !(index == 0 && self.bin.is_some());
            if bare || buffer.extension(name)?.is_some() || self.requires(name) {
                return Ok(Some((name, extension)));
            }
        }
        Ok(None)
    }

    /// The bytes from `byteOffset` to `byteOffset` + `byteLength` of the buffer that `place` names.
    fn range(&self, place: &JsonPlace<'a>) -> Result<&[u8], ScanError> {
        let (index, buffer) = self.root.referred("buffers", &place.need("buffer")?)?;
        let bytes = self.buffer(index, &buffer)?;
        let offset = place.integer_or("byteOffset", 0)?;
        let length = place.need("byteLength")?.integer()?;
        let range = offset
            .checked_add(length)
            .and_then(|end| bytes.get(offset..end));
        range.ok_or_else(|| {
            place.invalid(format!(
                "byteOffset {offset} + byteLength {length} goes past the {} bytes of buffer {index}",
                bytes.len()
            ))
        })
    }

    /// Whether the file requires this extension.
    fn requires(&self, name: &str) -> bool {
        self.required.contains(name)
    }

    /// The bytes of a data URI, or of a file that came with the scan.
    fn uri_bytes(&self, uri: &JsonPlace<'a>) -> Result<Bytes, ScanError> {
        let text = uri.text()?;
        if text.starts_with("data:") {
            return decode_data_uri(uri).map(Bytes::from);
        }
        let file = self.companions.file(text, &self.allowance)?;
        file.ok_or_else(|| ScanError::external(uri))
    }

    fn buffer(&self, index: usize, place: &JsonPlace<'a>) -> Result<&[u8], ScanError> {
        let length = place.need("byteLength")?;
        let bytes: &[u8] = match (place.get("uri")?, self.bin) {
            (Some(uri), _) => cached(&self.decoded, index, || self.uri_bytes(&uri))?,
            (None, Some(bin)) if index == 0 => bin,
            _ => {
                return Err(
                    place.invalid("has neither a uri nor a BIN chunk to take its bytes from")
                );
            }
        };
        let wanted = length.integer()?;
        bytes.get(..wanted).ok_or_else(|| {
            length.invalid(format!(
                "is {wanted}, but only {} bytes are there",
                bytes.len()
            ))
        })
    }
}

fn empty_cells<T>(count: usize) -> Vec<OnceCell<T>> {
    std::iter::repeat_with(OnceCell::new).take(count).collect()
}

/// What is in cell `index`; `make` makes it the first time.
fn cached<T>(
    cells: &[OnceCell<T>],
    index: usize,
    make: impl FnOnce() -> Result<T, ScanError>,
) -> Result<&T, ScanError> {
    let cell = cells.get(index).ok_or_else(|| ScanError::Invalid {
        pointer: String::new(),
        detail: format!("element {index} is not there"),
    })?;
    if let Some(made) = cell.get() {
        return Ok(made);
    }
    let made = make()?;
    Ok(cell.get_or_init(|| made))
}

/// The bytes of a base64 data URI.
pub(super) fn decode_data_uri(uri: &JsonPlace<'_>) -> Result<Vec<u8>, ScanError> {
    let data = uri.text()?.strip_prefix("data:").unwrap_or_default();
    let (_, payload) = data
        .split_once(',')
        .filter(|(head, _)| head.ends_with(";base64"))
        .ok_or_else(|| uri.invalid("a data URI must be base64"))?;
    BASE64
        .decode(payload)
        .map_err(|error| uri.invalid(format!("the data URI is not base64: {error}")))
}
