//! The colours of a scan at every point of its surface: what `darn render --colours` draws.

use darn_budget::Budget;
use darn_gltf_scan::{DecodedImage, Scan, ScanLimits, TextureSource, TextureWrap};
use darn_render::from_srgb;
use std::collections::BTreeMap;

/// The scan's base colours and emission, as a viewer has them.
pub struct ScanPaint<'s> {
    scan: &'s Scan,
    /// Per part.
    colours: Vec<[TextureSource; 2]>,
    images: BTreeMap<usize, DecodedImage>,
}

impl<'s> ScanPaint<'s> {
    /// Without a variant, or in one. Images that cannot be decoded are left out; their factors stay.
    pub fn new(scan: &'s Scan, variant: Option<usize>, limits: &ScanLimits) -> Self {
        let parts = 0..scan.parts.len();
        let colours: Vec<_> = parts.map(|p| scan.part_colours(p, variant)).collect();
        let mut images = BTreeMap::new();
        for index in colours.iter().flatten().filter_map(|source| source.image) {
            if images.contains_key(&index) {
                continue;
            }
            if let Ok(image) = scan.image(index, limits, Budget::unlimited()) {
                images.insert(index, image);
            }
        }
        ScanPaint {
            scan,
            colours,
            images,
        }
    }

    /// Linear red, green and blue at a point between three vertices of a part.
    pub fn at(&self, part: usize, corners: [u32; 3], weights: [f64; 3]) -> [f32; 3] {
        let [base, glow] = &self.colours[part];
        let own = &self.scan.parts[part];
        let vertex = |v: u32| (v.checked_sub(own.vertices.start)).map_or(0, |v| v as usize);
        let mean = |value: &dyn Fn(usize) -> f32| -> f32 {
            let each = corners.iter().zip(weights);
            each.map(|(v, w)| value(vertex(*v)) * w as f32).sum()
        };
        let texel = |source: &TextureSource| -> [f32; 3] {
            let image = source.image.and_then(|index| self.images.get(&index));
            let set = own.texcoords.get(source.texcoords);
            let texel = match image.zip(set) {
                Some((image, set)) => {
                    let place =
                        [0, 1].map(|k: usize| mean(&|v| set.get(v).map_or(0.0, |uv| uv[k])));
                    read(image, source, source.place(place))
                }
                None => [1.0; 3],
            };
            [0, 1, 2].map(|k: usize| texel[k] * source.factor[k])
        };
        let (base, glow) = (texel(base), texel(glow));
        [0, 1, 2].map(|k: usize| {
            let colour = own.colors.first();
            let colour = colour.map_or(1.0, |set| mean(&|v| set.get(v).map_or(1.0, |c| c[k])));
            (base[k] * colour + glow[k]).clamp(0.0, 1.0)
        })
    }
}

/// The texel at a place of an image, linear.
fn read(image: &DecodedImage, source: &TextureSource, place: [f32; 2]) -> [f32; 3] {
    let at = |k: usize, side: u32| -> usize {
        let x = f64::from(place[k]);
        let unit = match source.wrap[k] {
            TextureWrap::Repeat => x.rem_euclid(1.0),
            TextureWrap::Mirror => 1.0 - (x.rem_euclid(2.0) - 1.0).abs(),
            TextureWrap::Clamp => x.clamp(0.0, 1.0),
        };
        // `as` makes 0 of what is no number.
        ((unit * f64::from(side)) as usize).min(side as usize - 1)
    };
    let (x, y) = (at(0, image.width), at(1, image.height));
    let [r, g, b, _] = image.texels()[y * image.width as usize + x];
    from_srgb([r, g, b])
}
