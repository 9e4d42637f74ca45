//! What a primitive's vertices carry beside their positions: normals, texture coordinates, colours, joints and weights.

use std::collections::HashMap;
use std::sync::Arc;

use gltf::json::accessor::{ComponentType, Type};

use super::accessor::Accessor;
use super::buffers::Document;
use super::json::Place;
use super::read::within;
use super::skin::{Influence, Influences};
use super::{ScanError, ScanLimits};

type Uvs = Arc<[[f32; 2]]>;
type Rgba = Arc<[[f32; 4]]>;

/// Decodes vertex attributes, each accessor once: primitives and instances share them.
pub(super) struct Attributes<'d, 'a> {
    document: &'d Document<'a>,
    limits: &'d ScanLimits,
    /// By accessor.
    texcoords: HashMap<usize, Uvs>,
    colors: HashMap<usize, (Type, Rgba)>,
    /// By the accessors of joints and of weights.
    influences: HashMap<(usize, usize), Influences>,
    /// Numbers decoded so far.
    values: usize,
}

impl<'d, 'a> Attributes<'d, 'a> {
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
        attributes: &Place<'a>,
        vertices: usize,
    ) -> Result<Option<Arc<[[f32; 3]]>>, ScanError> {
        let Some(reference) = attributes.get("NORMAL")? else {
            return Ok(None);
        };
        let (_, place) = self.document.root.referred("accessors", &reference)?;
        let accessor = self.attribute(&place, &[Type::Vec3])?;
        let normals: Arc<[_]> = (accessor.floats([0.0; 3])?.into_iter())
            .map(|normal| normal.map(tame))
            .collect();
        same_count(&place, normals.len(), vertices)?;
        Ok(Some(normals))
    }

    pub fn texcoords(
        &mut self,
        attributes: &Place<'a>,
        vertices: usize,
    ) -> Result<Vec<Uvs>, ScanError> {
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
                        .map(|uv| uv.map(tame))
                        .collect();
                    all.texcoords.insert(key, Arc::clone(&set));
                    set
                }
            };
            same_count(&place, set.len(), vertices)?;
            Ok(Some(set))
        })
    }

    /// The colour sets and, beside them, their types in the file.
    pub fn colors(
        &mut self,
        attributes: &Place<'a>,
        vertices: usize,
    ) -> Result<(Vec<Type>, Vec<Rgba>), ScanError> {
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
                        .map(|rgba| rgba.map(tame));
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

    /// The sets of joints and weights, as far as both are there.
    pub fn influences(
        &mut self,
        attributes: &Place<'a>,
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

    /// Sets 0, 1, … of a primitive, up to the first that `next` does not find.
    fn sets<S>(
        &mut self,
        attributes: &Place<'a>,
        mut next: impl FnMut(&mut Self, usize) -> Result<Option<S>, ScanError>,
    ) -> Result<Vec<S>, ScanError> {
        let mut sets = Vec::new();
        while let Some(set) = next(self, sets.len())? {
            sets.push(set);
            within(
                self.limits.max_attribute_sets,
                "max_attribute_sets",
                sets.len(),
                &attributes.pointer,
            )?;
        }
        Ok(sets)
    }

    /// Decodes a JOINTS accessor and the WEIGHTS that go with it; negative weights read as 0.
    fn weighted_joints(
        &mut self,
        joints: &Place<'a>,
        weights: &Place<'a>,
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
        let of_weights = of_weights.map(|weights| weights.map(|w| tame(w).max(0.0)));
        let influences = of_joints.into_iter().zip(of_weights);
        Ok(influences
            .map(|(joints, weights)| Influence { joints, weights })
            .collect())
    }

    /// Opens a vertex attribute and counts its values against the limit.
    fn attribute(&mut self, place: &Place<'a>, kinds: &[Type]) -> Result<Accessor<'d>, ScanError> {
        let accessor = Accessor::open(self.document, place)?;
        if !kinds.contains(&accessor.kind) {
            return Err(place.invalid(format!("must be one of {kinds:?} here")));
        }
        let values = accessor.count.saturating_mul(accessor.kind.multiplicity());
        self.values = self.values.saturating_add(values);
        within(
            self.limits.max_attribute_values,
            "max_attribute_values",
            self.values,
            &place.pointer,
        )?;
        Ok(accessor)
    }
}

/// A file may carry NaN in attributes that nothing depends on; a patch must not spread it.
fn tame(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

fn same_count(place: &Place<'_>, count: usize, vertices: usize) -> Result<(), ScanError> {
    if count == vertices {
        return Ok(());
    }
    Err(place.invalid(format!(
        "has {count} elements, but the primitive has {vertices} vertices"
    )))
}
