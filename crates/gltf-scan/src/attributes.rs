//! Vertex attributes other than positions: normals, texture coordinates, colours, joints and weights.

use std::collections::HashMap;
use std::sync::Arc;

use gltf::json::accessor::{ComponentType, Type};

use super::accessor::Accessor;
use super::error::ScanError;
use super::json::JsonPlace;
use super::limits::{Limit, ScanLimits};
use super::patch_group::CONFIDENCE;
use super::primitive::{AttributeSource, ElementsKey, PrimitiveSource};
use super::skin::{Influence, Influences};

type TexcoordSet = Arc<[[f32; 2]]>;
type ColorSet = Arc<[[f32; 4]]>;

/// Decodes vertex attributes, each accessor once: primitives and instances share the result.
pub(super) struct AttributeReader<'d> {
    limits: &'d ScanLimits,
    /// Decoded sets by accessor.
    texcoords: HashMap<ElementsKey, TexcoordSet>,
    colors: HashMap<ElementsKey, (Type, ColorSet)>,
    /// Decoded sets by the accessors of joints and of weights.
    influences: HashMap<(ElementsKey, ElementsKey), Influences>,
    /// Numbers decoded so far.
    values: usize,
}

impl<'d> AttributeReader<'d> {
    pub fn new(limits: &'d ScanLimits) -> Self {
        Self {
            limits,
            texcoords: HashMap::new(),
            colors: HashMap::new(),
            influences: HashMap::new(),
            values: 0,
        }
    }

    /// The normals, if there are any; NaN and infinities read as 0. Integers get the length 1 that rounding took from
    /// them; zeros stay.
    pub fn normals(
        &mut self,
        source: &PrimitiveSource<'_, '_>,
        vertices: usize,
    ) -> Result<Option<Arc<[[f32; 3]]>>, ScanError> {
        let Some(normal) = source.attribute("NORMAL")? else {
            return Ok(None);
        };
        let accessor = self.attribute(&normal, &[Type::Vec3])?;
        let quantized = accessor.component != ComponentType::F32;
        let normals: Arc<[_]> = (accessor.floats([0.0; 3])?.into_iter())
            .map(|normal| normal.map(finite_or_zero))
            .map(|normal| if quantized { unit(normal) } else { normal })
            .collect();
        same_count(&normal.place, normals.len(), vertices)?;
        Ok(Some(normals))
    }

    /// The texture coordinate sets; NaN and infinities read as 0.
    pub fn texcoords(
        &mut self,
        source: &PrimitiveSource<'_, '_>,
        vertices: usize,
    ) -> Result<Vec<TexcoordSet>, ScanError> {
        self.sets(source, |all, n| {
            let Some(found) = source.attribute(&format!("TEXCOORD_{n}"))? else {
                return Ok(None);
            };
            let key = found.key;
            let set = match all.texcoords.get(&key) {
                Some(set) => Arc::clone(set),
                None => {
                    let accessor = all.attribute(&found, &[Type::Vec2])?;
                    let set: Arc<[_]> = accessor
                        .floats([0.0; 2])?
                        .into_iter()
                        .map(|uv| uv.map(finite_or_zero))
                        .collect();
                    all.texcoords.insert(key, Arc::clone(&set));
                    set
                }
            };
            same_count(&found.place, set.len(), vertices)?;
            Ok(Some(set))
        })
    }

    /// The types of the colour sets in the file, and the sets; NaN and infinities read as 0.
    pub fn colors(
        &mut self,
        source: &PrimitiveSource<'_, '_>,
        vertices: usize,
    ) -> Result<(Vec<Type>, Vec<ColorSet>), ScanError> {
        let sets = self.sets(source, |all, n| {
            let Some(found) = source.attribute(&format!("COLOR_{n}"))? else {
                return Ok(None);
            };
            let key = found.key;
            let (kind, set) = match all.colors.get(&key) {
                Some((kind, set)) => (*kind, Arc::clone(set)),
                None => {
                    let accessor = all.attribute(&found, &[Type::Vec3, Type::Vec4])?;
                    let set = accessor
                        .floats([0.0, 0.0, 0.0, 1.0])?
                        .into_iter()
                        .map(|rgba| rgba.map(finite_or_zero));
                    let set: Arc<[_]> = set.collect();
                    all.colors.insert(key, (accessor.kind, Arc::clone(&set)));
                    (accessor.kind, set)
                }
            };
            same_count(&found.place, set.len(), vertices)?;
            Ok(Some((kind, set)))
        })?;
        Ok(sets.into_iter().unzip())
    }

    /// How far the vertices of one of darn's own primitives may be off. `None` without `_CONFIDENCE`, and where another program made something else of
    /// it: nothing depends on it but pictures.
    pub fn deviations(
        &mut self,
        source: &PrimitiveSource<'_, '_>,
        vertices: usize,
    ) -> Option<Arc<[f32]>> {
        let found = source.attribute(CONFIDENCE).ok()??;
        let accessor = self.attribute(&found, &[Type::Scalar]).ok()?;
        let values = accessor.floats([0.0]).ok()?.into_iter();
        let values: Arc<[f32]> = values.map(|[x]| finite_or_zero(x).max(0.0)).collect();
        (values.len() == vertices).then_some(values)
    }

    /// The sets of joints and weights, up to the first set that lacks one of the two.
    pub fn influences(
        &mut self,
        source: &PrimitiveSource<'_, '_>,
        vertices: usize,
    ) -> Result<Vec<Influences>, ScanError> {
        self.sets(source, |all, n| {
            let (Some(joints), Some(weights)) = (
                source.attribute(&format!("JOINTS_{n}"))?,
                source.attribute(&format!("WEIGHTS_{n}"))?,
            ) else {
                return Ok(None);
            };
            let key = (joints.key, weights.key);
            let set = match all.influences.get(&key) {
                Some(set) => Arc::clone(set),
                None => {
                    let set = all.weighted_joints(&joints, &weights, vertices)?;
                    all.influences.insert(key, Arc::clone(&set));
                    set
                }
            };
            same_count(&joints.place, set.len(), vertices)?;
            Ok(Some(set))
        })
    }

    /// Sets 0, 1, … of a primitive, up to the first that `read` does not find.
    fn sets<S>(
        &mut self,
        source: &PrimitiveSource<'_, '_>,
        mut read: impl FnMut(&mut Self, usize) -> Result<Option<S>, ScanError>,
    ) -> Result<Vec<S>, ScanError> {
        let mut sets = Vec::new();
        while let Some(set) = read(self, sets.len())? {
            sets.push(set);
            let limit = Limit {
                name: "max_attribute_sets",
                allowed: self.limits.max_attribute_sets,
            };
            limit.check(sets.len(), &source.attributes.pointer)?;
        }
        Ok(sets)
    }

    /// Decodes a JOINTS accessor and its WEIGHTS; negative weights read as 0.
    fn weighted_joints(
        &mut self,
        joints: &AttributeSource<'_, '_>,
        weights: &AttributeSource<'_, '_>,
        vertices: usize,
    ) -> Result<Influences, ScanError> {
        let accessor = self.attribute(joints, &[Type::Vec4])?;
        if ![ComponentType::U8, ComponentType::U16].contains(&accessor.component) {
            return Err(joints
                .place
                .invalid("joints must be unsigned bytes or shorts"));
        }
        same_count(&joints.place, accessor.count, vertices)?;
        let of_joints = accessor.quadruples()?;
        let accessor = self.attribute(weights, &[Type::Vec4])?;
        same_count(&weights.place, accessor.count, vertices)?;
        let of_weights = accessor.floats([0.0; 4])?.into_iter();
        let of_weights = of_weights.map(|weights| weights.map(|w| finite_or_zero(w).max(0.0)));
        let influences = of_joints.into_iter().zip(of_weights);
        Ok(influences
            .map(|(joints, weights)| Influence { joints, weights })
            .collect())
    }

    /// Opens a vertex attribute and counts its values against the limit.
    fn attribute<'s>(
        &mut self,
        source: &AttributeSource<'s, '_>,
        kinds: &[Type],
    ) -> Result<Accessor<'s>, ScanError> {
        let place = &source.place;
        let accessor = source.open()?;
        if !kinds.contains(&accessor.kind) {
            return Err(place.invalid(format!("must be one of {kinds:?} here")));
        }
        let values = accessor.count.saturating_mul(accessor.kind.multiplicity());
        self.values = self.values.saturating_add(values);
        let limit = Limit {
            name: "max_attribute_values",
            allowed: self.limits.max_attribute_values,
        };
        limit.check(self.values, &place.pointer)?;
        Ok(accessor)
    }
}

/// A number, or 0 for NaN and infinities: a file may have those where its viewers ignore them, and a patch must not
/// copy them.
fn finite_or_zero(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

/// A vector with length 1 and the same direction; zero stays zero.
fn unit(vector: [f32; 3]) -> [f32; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f32>().sqrt();
    if length > 0.0 {
        vector.map(|x| x / length)
    } else {
        vector
    }
}

fn same_count(place: &JsonPlace<'_>, count: usize, vertices: usize) -> Result<(), ScanError> {
    if count == vertices {
        return Ok(());
    }
    Err(place.invalid(format!(
        "has {count} elements, but the primitive has {vertices} vertices"
    )))
}
