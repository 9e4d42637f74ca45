//! The images of patches that share a primitive: each patch's rectangle beside the others, one PNG a layer.

use std::io::Cursor;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Map, json};

use darn_budget::Budget;

use super::append::Appender;
use super::error::ScanError;
use super::patch_appearance::OwnTexture;
use super::texture_slots::TextureKind;

/// Most texels of the patches that share their images; a larger patch has images of its own.
pub(super) const MOST_TEXELS: usize = 2048 * 2048;

/// Nanoseconds of work a texel that is written.
const TEXEL_WORK: u64 = 60;
/// Bytes of memory a texel while it is written.
const TEXEL_BYTES: usize = 8;

/// Where the images of several patches lie in common ones.
pub(super) struct ImageSheet<'p> {
    width: usize,
    height: usize,
    placed: Vec<PlacedImage<'p>>,
}

struct PlacedImage<'p> {
    image: &'p OwnTexture,
    left: usize,
    top: usize,
}

impl<'p> ImageSheet<'p> {
    /// Places the images in rows, the highest first.
    pub fn of(images: &[&'p OwnTexture]) -> Self {
        let size = |image: &OwnTexture| [image.width as usize, image.height as usize];
        let area: usize = images
            .iter()
            .map(|image| size(image).iter().product::<usize>())
            .sum();
        let widest = images.iter().map(|image| size(image)[0]).max().unwrap_or(1);
        let width = widest.max((1.15 * area as f64).sqrt() as usize);
        let mut order: Vec<usize> = (0..images.len()).collect();
        order.sort_by_key(|k| (std::cmp::Reverse(images[*k].height), *k));
        let mut places = vec![[0; 2]; images.len()];
        let (mut left, mut top, mut row) = (0, 0, 0);
        for k in order {
            let [own_width, own_height] = size(images[k]);
            if left + own_width > width {
                (left, top, row) = (0, top + row, 0);
            }
            places[k] = [left, top];
            left += own_width;
            row = row.max(own_height);
        }
        let placed = images.iter().zip(places);
        ImageSheet {
            width: if images.len() == 1 { widest } else { width },
            height: top + row,
            placed: placed
                .map(|(image, [left, top])| PlacedImage { image, left, top })
                .collect(),
        }
    }

    /// Texture coordinates of the `k`-th patch's own image in the common one.
    pub fn place(&self, k: usize, [u, v]: [f32; 2]) -> [f32; 2] {
        let own = &self.placed[k];
        let at = |start: usize, x: f32, side: u32, whole: usize| {
            ((start as f64 + f64::from(x) * f64::from(side)) / whole as f64) as f32
        };
        [
            at(own.left, u, own.image.width, self.width),
            at(own.top, v, own.image.height, self.height),
        ]
    }

    /// Appends an image and a texture for every layer; returns the textures' indices.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn append(
        &self,
        out: &mut Appender<'_>,
        name: &str,
        budget: &Budget<'_>,
    ) -> Result<Vec<usize>, ScanError> {
        let Some(first) = self.placed.first() else {
            return Ok(Vec::new());
        };
        let texels = self.width * self.height;
        budget.hold(TEXEL_BYTES * texels)?;
        let mut textures = Vec::new();
        for (layer, known) in first.image.look.layers.iter().enumerate() {
            budget.spend(TEXEL_WORK * texels as u64)?;
            let bytes = self.png(layer, known.kind)?;
            let view = out.view(name, &bytes, None);
            let image = json!({ "name": name, "bufferView": view, "mimeType": "image/png" });
            let image = out.push("images", image);
            let mut texture = Map::new();
            texture.insert("name".into(), json!(name));
            if let Some(sampler) = known.sources.iter().find_map(|source| source.sampler) {
                texture.insert("sampler".into(), json!(sampler));
            }
            texture.insert("source".into(), json!(image));
            textures.push(out.push("textures", texture.into()));
        }
        budget.release(TEXEL_BYTES * texels);
        Ok(textures)
    }

    /// One layer as a PNG; without alpha where all of it is opaque.
    pub fn png(&self, layer: usize, kind: TextureKind) -> Result<Vec<u8>, ScanError> {
        let empty = match kind {
            TextureKind::Normal => [128, 128, 255, 255],
            _ => [128, 128, 128, 255],
        };
        let mut texels = vec![empty; self.width * self.height];
        for PlacedImage { image, left, top } in &self.placed {
            let width = image.width as usize;
            let rows = image.layers.get(layer).map_or(&[][..], Vec::as_slice);
            for (y, row) in rows.chunks_exact(width).enumerate() {
                let start = (top + y) * self.width + left;
                texels[start..start + width].copy_from_slice(row);
            }
        }
        let opaque = texels.iter().all(|texel| texel[3] == u8::MAX);
        let (bytes, colour): (Vec<u8>, _) = match opaque {
            true => (
                texels
                    .iter()
                    .flat_map(|[r, g, b, _]| [*r, *g, *b])
                    .collect(),
                ExtendedColorType::Rgb8,
            ),
            false => (texels.into_flattened(), ExtendedColorType::Rgba8),
        };
        let mut out = Cursor::new(Vec::new());
        let encoder =
            PngEncoder::new_with_quality(&mut out, CompressionType::Default, FilterType::Adaptive);
        let size = [self.width, self.height].map(|side| side as u32);
        let written = encoder.write_image(&bytes, size[0], size[1], colour);
        written.map_err(|error| ScanError::Container {
            offset: 0,
            detail: format!("the image of a patch cannot be written: {error}"),
        })?;
        Ok(out.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::cloth_look::{ClothLook, LookLayer};

    fn image(width: u32, height: u32, shade: u8) -> OwnTexture {
        let layer = LookLayer {
            kind: TextureKind::BaseColour,
            sources: Vec::new(),
        };
        let look = ClothLook {
            material_of: Default::default(),
            layers: vec![layer],
            choices: Vec::new(),
        };
        OwnTexture {
            look: Arc::new(look),
            width,
            height,
            layers: Arc::new(vec![vec![[shade, 0, 0, 255]; (width * height) as usize]]),
        }
    }

    #[test]
    fn every_patch_finds_its_own_texels_and_no_other_image_lies_there() {
        let sizes = [(30, 40), (7, 90), (64, 64), (1, 1), (50, 3), (64, 10)];
        let images: Vec<OwnTexture> = (1..).zip(sizes).map(|(k, (w, h))| image(w, h, k)).collect();
        let sheet = ImageSheet::of(&images.iter().collect::<Vec<_>>());
        let png = sheet.png(0, TextureKind::BaseColour).unwrap();
        let picture = image::load_from_memory(&png).unwrap().into_rgba8();
        for (k, own) in images.iter().enumerate() {
            for (u, v) in [(0.0, 0.0), (0.999, 0.0), (0.5, 0.5), (0.999, 0.999)] {
                let [x, y] = sheet.place(k, [u, v]);
                let at = |x: f32, side: u32| ((x * side as f32) as u32).min(side - 1);
                let texel = picture.get_pixel(at(x, picture.width()), at(y, picture.height()));
                assert_eq!(texel[0], own.layers[0][0][0], "{k} {u} {v}");
            }
        }
        let texels: u32 = sizes.iter().map(|(w, h)| w * h).sum();
        assert!(picture.width() * picture.height() < 2 * texels);
    }

    #[test]
    fn one_patch_alone_fills_its_image() {
        let own = image(30, 40, 9);
        let sheet = ImageSheet::of(&[&own]);
        assert_eq!((sheet.width, sheet.height), (30, 40));
        assert_eq!(sheet.place(0, [0.25, 0.75]), [0.25, 0.75]);
    }
}
