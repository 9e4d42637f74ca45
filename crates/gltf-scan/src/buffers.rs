//! The bytes of buffer views: from the BIN chunk and data URIs, never from a file or URL. Each is bounds-checked, and
//! decoded at most once.

use std::cell::OnceCell;
use std::collections::BTreeSet;

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::error::ScanError;
use super::json::JsonPlace;

/// Padding is optional: some exporters leave it out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Extensions that compress the bytes of a buffer view.
const COMPRESSED_VIEWS: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

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
    decoded: Vec<OnceCell<Vec<u8>>>,
    required: BTreeSet<&'a str>,
}

/// The bytes of a buffer view and the distance of its elements in bytes, if it is given.
pub(super) struct BufferView<'d> {
    pub bytes: &'d [u8],
    pub stride: Option<usize>,
    pub pointer: String,
}

impl<'a> Document<'a> {
    pub fn new(root: JsonPlace<'a>, bin: Option<&'a [u8]>) -> Result<Self, ScanError> {
        let buffers = root
            .get("buffers")?
            .map_or(Ok(0), |buffers| buffers.array().map(<[_]>::len))?;
        let required = match root.get("extensionsRequired")? {
            Some(list) => list
                .array()?
                .iter()
                .filter_map(|name| name.as_str())
                .collect(),
            None => BTreeSet::new(),
        };
        let decoded = std::iter::repeat_with(OnceCell::new)
            .take(buffers)
            .collect();
        Ok(Self {
            root,
            bin,
            decoded,
            required,
        })
    }

    /// The buffer view that `from` refers to.
    pub fn view(&self, from: &JsonPlace<'a>) -> Result<BufferView<'_>, ScanError> {
        let (_, view) = self.root.referred("bufferViews", from)?;
        let (index, buffer) = self.root.referred("buffers", &view.need("buffer")?)?;
        for name in COMPRESSED_VIEWS {
            // If the file does not require the extension, the plain bytes may be there as a fallback.
            let Some(extension) = view.extension(name)? else {
                continue;
            };
            let bare = buffer.get("uri")?.is_none() && !(index == 0 && self.bin.is_some());
            if bare || buffer.extension(name)?.is_some() || self.requires(name) {
                return Err(ScanError::Unsupported {
                    pointer: extension.pointer,
                    extension: name,
                });
            }
        }
        let bytes = self.buffer(index, &buffer)?;
        let offset = view.integer_or("byteOffset", 0)?;
        let length = view.need("byteLength")?.integer()?;
        let bytes = offset.checked_add(length).and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
            view.invalid(format!(
                "byteOffset {offset} + byteLength {length} goes past the {} bytes of buffer {index}",
                bytes.len()
            ))
        })?;
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

    /// Whether the file requires this extension.
    pub fn requires(&self, name: &str) -> bool {
        self.required.contains(name)
    }

    fn buffer(&self, index: usize, place: &JsonPlace<'a>) -> Result<&[u8], ScanError> {
        let length = place.need("byteLength")?;
        let bytes = match (place.get("uri")?, self.bin, self.decoded.get(index)) {
            (Some(uri), _, Some(cell)) => match cell.get() {
                Some(bytes) => bytes,
                None => {
                    let bytes = decode(&uri)?;
                    cell.get_or_init(|| bytes)
                }
            },
            (None, Some(bin), _) if index == 0 => bin,
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

/// The bytes of a base64 data URI; any other URI is refused and not opened.
fn decode(uri: &JsonPlace<'_>) -> Result<Vec<u8>, ScanError> {
    const SHOWN: usize = 80;
    let text = uri.text()?;
    let Some(data) = text.strip_prefix("data:") else {
        let shown = text.chars().take(SHOWN).collect();
        return Err(ScanError::External {
            pointer: uri.pointer.clone(),
            uri: shown,
        });
    };
    let (_, payload) = data
        .split_once(',')
        .filter(|(head, _)| head.ends_with(";base64"))
        .ok_or_else(|| uri.invalid("a data URI must be base64"))?;
    BASE64
        .decode(payload)
        .map_err(|error| uri.invalid(format!("the data URI is not base64: {error}")))
}
