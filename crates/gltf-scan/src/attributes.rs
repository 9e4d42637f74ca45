//! Vertex attributes other than positions: normals, texture coordinates, colours, joints and weights.

use std::collections::HashMap;
use std::sync::Arc;

use gltf::json::accessor::{ComponentType, Type};

use super::accessor::Accessor;
use super::buffers::Document;
use super::error::ScanError;
use super::json::JsonPlace;
use super::limits::{Limit, ScanLimits};
use super::skin::{Influence, Influences};

type TexcoordSet = Arc<[[f32; 2]]>;
type ColorSet = Arc<[[f32; 4]]>;

/// Decodes vertex attributes, each accessor once: primitives and instances share the result.
pub(super) struct AttributeReader<'d, 'a> {
    document: &'d Document<'a>,
    limits: &'d ScanLimits,
    /// Decoded sets by accessor.
    texcoords: HashMap<usize, TexcoordSet>,
    colors: HashMap<usize, (Type, ColorSet)>,
    /// Decoded sets by the accessors of joints and of weights.
    influences: HashMap<(usize, usize), Influences>,
    /// Numbers decoded so far.
    values: usize,
}

impl<'d, 'a> AttributeReader<'d, 'a> {
    pub fn new(document: &'d Document<'a>, limits: &'d ScanLimits) -> Self {
        Self {
            document,
            limits,
            texcoords: HashMap::new(),
            colors: HashMap::new(),
            influences: HashMap::new(),
            values: 0,
        }
    }

    /// The normals, if there are any; NaN and infinities read as 0.
    pub fn normals(
        &mut self,
        attributes: &JsonPlace<'a>,
        vertices: usize,
    ) -> Result<Option<Arc<[[f32; 3]]>>, ScanError> {
        let Some(reference) = attributes.get("NORMAL")? else {
            return Ok(None);
        };
        let (_, place) = self.document.root.referred("accessors", &reference)?;
        let accessor = self.attribute(&place, &[Type::Vec3])?;
        let normals: Arc<[_]> = (accessor.floats([0.0; 3])?.into_iter())
            .map(|normal| normal.map(finite_or_zero))
            .collect();
        same_count(&place, normals.len(), vertices)?;
        Ok(Some(normals))
    }

    /// The texture coordinate sets; NaN and infinities read as 0.
    pub fn texcoords(
        &mut self,
        attributes: &JsonPlace<'a>,
        vertices: usize,
    ) -> Result<Vec<TexcoordSet>, ScanError> {
        self.sets(attributes, |all, n| {
            let Some(reference) = attributes.get(&format!("TEXCOORD_{n}"))? else {
                return Ok(None);
            };
            let (key, place) = all.document.root.referred("accessors", &reference)?;
            let set = match all.texcoords.get(&key) {
                Some(set) => Arc::clone(set),
                None => {
                    let accessor = all.attribute(&place, &[Type::Vec2])?;
                    let set: Arc<[_]> = accessor
                        .floats([0.0; 2])?
                        .into_iter()
                        .map(|uv| uv.map(finite_or_zero))
                        .collect();
                    all.texcoords.insert(key, Arc::clone(&set));
                    set
                }
            };
            same_count(&place, set.len(), vertices)?;
            Ok(Some(set))
        })
    }

    /// The types of the colour sets in the file, and the sets; NaN and infinities read as 0.
    pub fn colors(
        &mut self,
        attributes: &JsonPlace<'a>,
        vertices: usize,
    ) -> Result<(Vec<Type>, Vec<ColorSet>), ScanError> {
        let sets = self.sets(attributes, |all, n| {
            let Some(reference) = attributes.get(&format!("COLOR_{n}"))? else {
                return Ok(None);
            };
            let (key, place) = all.document.root.referred("accessors", &reference)?;
            let (kind, set) = match all.colors.get(&key) {
                Some((kind, set)) => (*kind, Arc::clone(set)),
                None => {
                    let accessor = all.attribute(&place, &[Type::Vec3, Type::Vec4])?;
                    let set = accessor
                        .floats([0.0, 0.0, 0.0, 1.0])?
                        .into_iter()
                        .map(|rgba| rgba.map(finite_or_zero));
                    let set: Arc<[_]> = set.collect();
                    all.colors.insert(key, (accessor.kind, Arc::clone(&set)));
                    (accessor.kind, set)
                }
            };
            same_count(&place, set.len(), vertices)?;
            Ok(Some((kind, set)))
        })?;
        Ok(sets.into_iter().unzip())
    }

    /// The sets of joints and weights, up to the first set that lacks one of the two.
    pub fn influences(
        &mut self,
        attributes: &JsonPlace<'a>,
        vertices: usize,
    ) -> Result<Vec<Influences>, ScanError> {
        self.sets(attributes, |all, n| {
            let (Some(joints), Some(weights)) = (
                attributes.get(&format!("JOINTS_{n}"))?,
                attributes.get(&format!("WEIGHTS_{n}"))?,
            ) else {
                return Ok(None);
            };
            let (of_joints, joints) = all.document.root.referred("accessors", &joints)?;
            let (of_weights, weights) = all.document.root.referred("accessors", &weights)?;
            let key = (of_joints, of_weights);
            let set = match all.influences.get(&key) {
                Some(set) => Arc::clone(set),
                None => {
                    let set = all.weighted_joints(&joints, &weights, vertices)?;
                    all.influences.insert(key, Arc::clone(&set));
                    set
                }
            };
            same_count(&joints, set.len(), vertices)?;
            Ok(Some(set))
        })
    }

    /// Sets 0, 1, … of a primitive, up to the first that `read` does not find.
    fn sets<S>(
        &mut self,
        attributes: &JsonPlace<'a>,
        mut read: impl FnMut(&mut Self, usize) -> Result<Option<S>, ScanError>,
    ) -> Result<Vec<S>, ScanError> {
        let mut sets = Vec::new();
        while let Some(set) = read(self, sets.len())? {
            sets.push(set);
            let limit = Limit {
                name: "max_attribute_sets",
                allowed: self.limits.max_attribute_sets,
            };
            limit.check(sets.len(), &attributes.pointer)?;
        }
        Ok(sets)
    }

    /// Decodes a JOINTS accessor and its WEIGHTS; negative weights read as 0.
    fn weighted_joints(
        &mut self,
        joints: &JsonPlace<'a>,
        weights: &JsonPlace<'a>,
        vertices: usize,
    ) -> Result<Influences, ScanError> {
        let accessor = self.attribute(joints, &[Type::Vec4])?;
        if ![ComponentType::U8, ComponentType::U16].contains(&accessor.component) {
            return Err(joints.invalid("joints must be unsigned bytes or shorts"));
        }
        same_count(joints, accessor.count, vertices)?;
        let of_joints = accessor.quadruples()?;
        let accessor = self.attribute(weights, &[Type::Vec4])?;
        same_count(weights, accessor.count, vertices)?;
        let of_weights = accessor.floats([0.0; 4])?.into_iter();
        let of_weights = of_weights.map(|weights| weights.map(|w| finite_or_zero(w).max(0.0)));
        let influences = of_joints.into_iter().zip(of_weights);
        Ok(influences
            .map(|(joints, weights)| Influence { joints, weights })
            .collect())
    }

    /// Opens a vertex attribute and counts its values against the limit.
    fn attribute(
        &mut self,
        place: &JsonPlace<'a>,
        kinds: &[Type],
    ) -> Result<Accessor<'d>, ScanError> {
        let accessor = Accessor::open(self.document, place)?;
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

fn same_count(place: &JsonPlace<'_>, count: usize, vertices: usize) -> Result<(), ScanError> {
    if count == vertices {
        return Ok(());
    }
    Err(place.invalid(format!(
        "has {count} elements, but the primitive has {vertices} vertices"
    )))
}
