//! The cloth's images in the raster: every texel of the cloth reads its own image.

use darn_budget::{Budget, Exhausted};
use rayon::prelude::*;

use crate::frame::{Frame, NONE};
use crate::input::{Cloth, CornerTexcoords, LayerKind};
use crate::sample::{Footprint, Sampler};

/// Nanoseconds of work for a texel of a layer.
const TEXEL_WORK: u64 = 60;
/// Rows that one task reads.
const BAND: usize = 16;

/// Triangles in the raster with places in images.
pub(crate) struct Placed<'a> {
    pub flat: &'a [[f64; 2]],
    pub faces: &'a [[u32; 3]],
    pub material_of: &'a [u32],
    pub texcoords: &'a [CornerTexcoords],
    pub colours: &'a [[[f32; 4]; 3]],
}

impl<'a> Placed<'a> {
    pub(crate) fn of(cloth: &'a Cloth) -> Placed<'a> {
        Placed {
            flat: &cloth.flat,
            faces: &cloth.faces,
            material_of: &cloth.material_of,
            texcoords: &cloth.texcoords,
            colours: &cloth.colours,
        }
    }
}

/// A raster and the face that owns each of its texels.
pub(crate) struct OwnedRaster<'a> {
    pub frame: &'a Frame,
    pub owners: &'a [u32],
}

/// One layer at every texel that a face owns, encoded as the layer's images are; zero elsewhere.
pub(crate) fn resample(
    cloth: &Cloth,
    layer: usize,
    placed: &Placed,
    owned: &OwnedRaster,
    budget: &Budget,
) -> Result<Vec<[u8; 4]>, Exhausted> {
    let OwnedRaster { frame, owners } = *owned;
    let kind = cloth.layers[layer];
    let samplers: Vec<Option<Sampler>> = (cloth.materials.iter())
        .map(|sources| {
            let image = sources[layer].image?;
            Some(Sampler::new(image, sources[layer].wrap, kind.is_srgb()))
        })
        .collect();
    let mut texels = vec![[0u8; 4]; frame.len()];
    let bands = texels.par_chunks_mut(frame.width * BAND).enumerate();
    bands.try_for_each(|(band, texels)| {
        let first = band * BAND * frame.width;
        let owners = &owners[first..first + texels.len()];
        let owned = owners.iter().filter(|o| **o != NONE).count();
        budget.spend(TEXEL_WORK * owned as u64)?;
        let mut last: Option<(u32, FaceReader)> = None;
        for (at, (texel, owner)) in texels.iter_mut().zip(owners).enumerate() {
            if *owner == NONE {
                continue;
            }
            if last.as_ref().is_none_or(|(face, _)| face != owner) {
                last = Some((
                    *owner,
                    FaceReader::new(cloth, layer, placed, frame, *owner as usize),
                ));
            }
            let Some((face, reader)) = &last else {
                continue;
            };
            let at = first + at;
            let p = frame.centre(at % frame.width, at / frame.width);
            let sampler = &samplers[placed.material_of[*face as usize] as usize];
            *texel = reader.read(kind, sampler.as_ref(), p);
        }
        Ok(())
    })?;
    Ok(texels)
}

/// An affine function of the chart, as value at the first corner and two slopes.
struct Affine<const N: usize> {
    corner: [f64; 2],
    value: [f64; N],
    slopes: [[f64; N]; 2],
}

impl<const N: usize> Affine<N> {
    fn through(flat: [[f64; 2]; 3], values: [[f64; N]; 3]) -> Affine<N> {
        let [a, b, c] = flat;
        let (ux, uy, vx, vy) = (b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]);
        let area = ux * vy - uy * vx;
        let slope = |k: usize| {
            let (u, v) = (values[1][k] - values[0][k], values[2][k] - values[0][k]);
            [(u * vy - v * uy) / area, (v * ux - u * vx) / area]
        };
        Affine {
            corner: a,
            value: values[0],
            slopes: [0, 1].map(|d: usize| std::array::from_fn(|k| slope(k)[d])),
        }
    }

    fn at(&self, p: [f64; 2]) -> [f64; N] {
        let d = [p[0] - self.corner[0], p[1] - self.corner[1]];
        std::array::from_fn(|k| self.value[k] + d[0] * self.slopes[0][k] + d[1] * self.slopes[1][k])
    }
}

/// Reads one layer in one face.
struct FaceReader {
    factor: [f32; 4],
    place: Option<(Affine<2>, Footprint)>,
    colour: Option<Affine<4>>,
    /// The directions of a tangent-space vector's x and y in the chart.
    tangents: [[f32; 2]; 2],
}

impl FaceReader {
    fn new(cloth: &Cloth, layer: usize, placed: &Placed, frame: &Frame, face: usize) -> FaceReader {
        let source = &cloth.materials[placed.material_of[face] as usize][layer];
        let flat = placed.faces[face].map(|v| placed.flat[v as usize]);
        let place = source.image.map(|image| {
            let corners = placed.texcoords[source.texcoords][face];
            let place = Affine::through(flat, corners.map(|t| t.map(f64::from)));
            let size = [f64::from(image.width), f64::from(image.height)];
            let side = |d: usize| [0, 1].map(|k: usize| place.slopes[d][k] * frame.step * size[k]);
            let footprint = Footprint::new([side(0), side(1)]);
            (place, footprint)
        });
        let coloured = cloth.layers[layer] == LayerKind::BaseColour && !placed.colours.is_empty();
        let colour =
            coloured.then(|| Affine::through(flat, placed.colours[face].map(|c| c.map(f64::from))));
        FaceReader {
            factor: source.factor,
            tangents: place
                .as_ref()
                .map_or([[1.0, 0.0], [0.0, 1.0]], |(place, _)| tangents(place)),
            place,
            colour,
        }
    }

    fn read(&self, kind: LayerKind, sampler: Option<&Sampler>, p: [f64; 2]) -> [u8; 4] {
        let mut value = match (sampler, &self.place) {
            (Some(sampler), Some((place, footprint))) => {
                let [u, v] = place.at(p);
                let [width, height] = sampler.size();
                sampler.read([u * width, v * height], footprint)
            }
            _ if kind == LayerKind::Normal => [0.5, 0.5, 1.0, 1.0],
            _ if kind == LayerKind::Direction => [1.0, 0.5, 1.0, 1.0],
            _ => [1.0; 4],
        };
        if kind.is_vector() {
            return encode_vector(kind, self.turned(value));
        }
        (0..4).for_each(|k| value[k] *= self.factor[k]);
        if let Some(colour) = &self.colour {
            let colour = colour.at(p);
            (0..4).for_each(|k| value[k] *= colour[k] as f32);
        }
        let byte = |x: f32| (255.0 * x.clamp(0.0, 1.0) + 0.5) as u8;
        let [r, g, b, a] = value;
        if kind.is_srgb() {
            let encode = crate::srgb::encode;
            [encode(r), encode(g), encode(b), byte(a)]
        } else {
            [r, g, b, a].map(byte)
        }
    }

    /// A vector of the image in the chart's frame: x along +x, y along +y.
    fn turned(&self, value: [f32; 4]) -> [f32; 4] {
        let [x, y] = [0, 1].map(|k: usize| coordinate(value[k]) * self.factor[0]);
        let [t, b] = self.tangents;
        let number = |x: f32| (128.0 + 127.0 * x) / 255.0;
        [
            number(x * t[0] + y * b[0]),
            number(x * t[1] + y * b[1]),
            value[2],
            value[3],
        ]
    }
}

/// A coordinate of a vector from a texel's channel. 128 stands for zero, as most normal maps are made: 255 · 0.5 is between two bytes.
fn coordinate(channel: f32) -> f32 {
    (channel * 255.0 - 128.0) / 127.0
}

/// A vector's direction as a texel. The blue of a [`LayerKind::Direction`] is a number of its own.
pub(crate) fn encode_vector(kind: LayerKind, value: [f32; 4]) -> [u8; 4] {
    let [x, y] = [0, 1].map(|k: usize| coordinate(value[k]));
    let z = match kind {
        LayerKind::Direction => 0.0,
        _ => coordinate(value[2]).max(1e-3),
    };
    let length = (x * x + y * y + z * z).sqrt().max(1e-12);
    let byte = |x: f32| (128.0 + 127.0 * x / length).round().clamp(0.0, 255.0) as u8;
    let blue = match kind {
        LayerKind::Direction => (255.0 * value[2].clamp(0.0, 1.0) + 0.5) as u8,
        _ => byte(z),
    };
    [byte(x), byte(y), blue, 255]
}

/// The unit directions in the chart of x and y of tangent-space vectors. In glTF x goes along +u and y along −v (up in the image); the
/// bitangent is at right angles to the tangent.
fn tangents(place: &Affine<2>) -> [[f32; 2]; 2] {
    // The columns of the inverse of d(u, v)/d(x, y), up to the determinant's size.
    let [[ux, vx], [uy, vy]] = place.slopes;
    let det = ux * vy - uy * vx;
    let tangent = [vy * det.signum(), -vx * det.signum()];
    let length = tangent[0].hypot(tangent[1]);
    if !(length > 0.0 && length.is_finite()) || det == 0.0 {
        return [[1.0, 0.0], [0.0, 1.0]];
    }
    let [tx, ty] = tangent.map(|x| (x / length) as f32);
    // v goes down in the image: charts that are not mirrored have a negative determinant.
    let side = -det.signum() as f32;
    [[tx, ty], [-ty * side, tx * side]]
}
