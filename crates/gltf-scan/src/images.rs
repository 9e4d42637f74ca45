//! The images of a scan, decoded.

use std::fmt;
use std::io::Cursor;

use darn_budget::{Budget, Exhausted};
use image::{ImageDecoder, ImageFormat, ImageReader, Limits};

use super::buffers::{Document, decode_data_uri};
use super::compressed::DecodeAllowance;
use super::error::ScanError;
use super::json::JsonPlace;
use super::limits::{Limit, ScanLimits};
use super::scan::Scan;

/// Nanoseconds of work a texel that is decoded.
const TEXEL_WORK: u64 = 15;
/// Bytes that a texel takes while it is decoded, beside the four of the result.
const WHILE_DECODED: usize = 8;

/// An image: four bytes a texel, row 0 at v = 0.
pub struct DecodedImage {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    bytes: Vec<u8>,
}

impl fmt::Debug for DecodedImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "DecodedImage({} × {})", self.width, self.height)
    }
}

impl DecodedImage {
    /// `width` × `height` texels, row by row: red, green, blue, alpha.
    pub fn texels(&self) -> &[[u8; 4]] {
        self.bytes.as_chunks().0
    }

    /// Bytes of memory.
    pub fn bytes_held(&self) -> usize {
        self.bytes.len()
    }
}

/// Why an image is not decoded.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The request has ended.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
    /// It is no PNG, JPEG or WebP image, or a broken one, or larger than the limits.
    #[error("{0}")]
    Unreadable(String),
}

impl From<ScanError> for ImageError {
    fn from(error: ScanError) -> Self {
        match error {
            ScanError::Exhausted(exhausted) => Self::Exhausted(exhausted),
            other => Self::Unreadable(other.to_string()),
        }
    }
}

impl Scan {
    /// Decodes an image. Its memory is held in the budget.
    ///
    /// # Errors
    /// It is not there, cannot be decoded, or is larger than the limits; `Exhausted`.
    pub fn image(
        &self,
        index: usize,
        limits: &ScanLimits,
        budget: &Budget<'_>,
    ) -> Result<DecodedImage, ImageError> {
        let pointer = format!("/images/{index}");
        let root = JsonPlace::root(&self.json);
        let bin = (self.layout.bin.clone()).and_then(|range| self.bytes.get(range));
        let allowance = DecodeAllowance::new(limits, budget);
        let document = Document::new(root.clone(), bin, &self.companions, allowance)?;
        let images = root.get("images")?;
        let place = match images {
            Some(images) => images.item(index)?,
            None => None,
        };
        let place =
            place.ok_or_else(|| ImageError::Unreadable(format!("{pointer}: is not there")))?;
        let result = match (place.get("bufferView")?, place.get("uri")?) {
            (Some(view), _) => decode(document.view(&view)?.bytes, &pointer, limits, budget),
            (None, Some(uri)) if uri.text()?.starts_with("data:") => {
                decode(&decode_data_uri(&uri)?, &pointer, limits, budget)
            }
            (None, Some(uri)) => {
                let allowance = DecodeAllowance::new(limits, budget);
                let file = self.companions.file(uri.text()?, &allowance)?;
                let file = file.ok_or_else(|| ScanError::external(&uri))?;
                let decoded = decode(&file, &pointer, limits, budget);
                allowance.release();
                decoded
            }
            (None, None) => Err(ImageError::Unreadable(format!(
                "{pointer}: has neither a bufferView nor a uri"
            ))),
        };
        document.release();
        result
    }
}

fn decode(
    bytes: &[u8],
    pointer: &str,
    limits: &ScanLimits,
    budget: &Budget<'_>,
) -> Result<DecodedImage, ImageError> {
    const READ: [ImageFormat; 3] = [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP];
    let unreadable = |detail: String| ImageError::Unreadable(format!("{pointer}: {detail}"));
    let format = image::guess_format(bytes)
        .ok()
        .filter(|it| READ.contains(it));
    let format = format.ok_or_else(|| unreadable("is no PNG, JPEG or WebP image".to_owned()))?;
    let broken = |error: image::ImageError| unreadable(format!("cannot be decoded: {error}"));
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut inner = Limits::no_limits();
    // Decoders that declare their size late allocate no more than this.
    inner.max_alloc = Some(16 * limits.max_image_texels as u64);
    reader.limits(inner);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let texels = (width as usize).saturating_mul(height as usize);
    let limit = Limit {
        name: "max_image_texels",
        allowed: limits.max_image_texels,
    };
    limit.check(texels, pointer)?;
    budget.spend(TEXEL_WORK * texels as u64)?;
    budget.hold((4 + WHILE_DECODED) * texels)?;
    let decoded = image::DynamicImage::from_decoder(decoder);
    budget.release(WHILE_DECODED * texels);
    match decoded {
        Ok(decoded) => Ok(DecodedImage {
            width,
            height,
            bytes: decoded.into_rgba8().into_raw(),
        }),
        Err(error) => {
            budget.release(4 * texels);
            Err(broken(error))
        }
    }
}

#[cfg(test)]
mod tests {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use image::{DynamicImage, Rgb, RgbImage};
    use serde_json::json;

    use super::*;
    use crate::testing::Builder;

    const COLOUR: [u8; 3] = [200, 60, 40];
    const SIDE: u32 = 8;
    /// A picture in one colour as Chromium writes WebP with loss, without its colour profile.
    const LOSSY_WEBP: &str = "UklGRjwAAABXRUJQVlA4IDAAAADwAQCdASoIAAgAAUAmJaACdLoB+AAEgwAA/u4KZ/5BcsLrka/9pZ+pZ+pZ/ioAAAA=";

    fn encoded(format: ImageFormat) -> Vec<u8> {
        let picture = DynamicImage::from(RgbImage::from_pixel(SIDE, SIDE, Rgb(COLOUR)));
        let mut out = Cursor::new(Vec::new());
        picture.write_to(&mut out, format).unwrap();
        out.into_inner()
    }

    #[test]
    fn png_jpeg_and_webp_with_and_without_loss_are_decoded() {
        let lossy = STANDARD.decode(LOSSY_WEBP).unwrap();
        let without_loss = encoded(ImageFormat::WebP);
        assert_eq!(
            (&lossy[12..16], &without_loss[12..16]),
            (&b"VP8 "[..], &b"VP8L"[..])
        );
        for (name, bytes, off) in [
            ("PNG", encoded(ImageFormat::Png), 0),
            ("JPEG", encoded(ImageFormat::Jpeg), 8),
            ("WebP", without_loss, 0),
            ("lossy WebP", lossy, 8),
        ] {
            let mut scan = Builder::square();
            let view = scan.view(&bytes);
            scan.json["images"] = json!([{ "bufferView": view }]);
            let limits = ScanLimits::default();
            let scan = Scan::read(scan.glb(), &limits).unwrap();
            let image = scan.image(0, &limits, Budget::unlimited()).unwrap();
            assert_eq!((image.width, image.height), (SIDE, SIDE), "{name}");
            let [red, green, blue] = COLOUR;
            for texel in image.texels() {
                for (found, given) in texel.iter().zip([red, green, blue, 255]) {
                    assert!(found.abs_diff(given) <= off, "{name}: {texel:?}");
                }
            }
        }
    }
}
