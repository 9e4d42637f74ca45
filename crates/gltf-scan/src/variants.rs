//! `KHR_materials_variants`: looks of a scan that a viewer's user chooses among.
//!
//! darn adds two: in one the patches look like the cloth, in the other they are hatched. Both are mapped on every patch, as
//! are all variants that the scan has, and darn's on primitives of the cloth that map others: some viewers (Voyager, model-viewer) leave a primitive as it
//! is when a variant maps nothing on it.

use std::collections::BTreeMap;

use darn_budget::Budget;
use serde_json::{Value, json};

use super::append::{Appender, extension_list};
use super::error::ScanError;
use super::patch_primitive::is_reconstructed;
use super::scan::{Scan, ScanPart};

/// Name of the extension.
pub(super) const EXTENSION: &str = "KHR_materials_variants";
/// Name of its list.
pub(super) const VARIANTS: &str = "variants";
/// Name of the variant in which patches look like the cloth. Viewers look for a part of a name, so neither of the two is part
/// of the other.
pub(super) const BLENDED: &str = "Reconstruction blended";
/// Name of the variant in which patches are hatched.
pub(super) const MARKED: &str = "Reconstruction marked";

/// Bytes of memory of a variant that is mapped on a patch, as JSON and as text.
const VARIANT: usize = 50;
/// Nanoseconds of work a variant that is mapped on a patch.
const VARIANT_WORK: u64 = 50;

/// The materials of a primitive: its own, and those of the variants that map one on it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct MaterialChoices {
    /// Without a variant.
    pub default: Option<usize>,
    /// By the variant's index, without darn's own variants.
    pub mapped: BTreeMap<usize, usize>,
    /// The material that marks the primitive, if it is a patch.
    pub marked: Option<usize>,
}

impl MaterialChoices {
    /// The material of a part, where variants are not looked at.
    pub fn of(part: &ScanPart) -> Self {
        Self {
            default: part.material,
            mapped: BTreeMap::new(),
            marked: None,
        }
    }
}

/// The materials of a patch, all of them darn's own.
#[derive(Debug)]
pub(super) struct PatchMaterials {
    /// Without a variant.
    pub default: usize,
    /// By the variant's index, as in [`MaterialChoices`].
    pub mapped: BTreeMap<usize, usize>,
    /// In the variant [`MARKED`].
    pub marked: usize,
}

/// The variants of a scan and darn's two.
#[derive(Debug, Clone, Copy)]
pub(super) struct Variants {
    /// How many the scan has.
    count: usize,
    /// Indices of darn's own; past the scan's until they are appended.
    blended: usize,
    marked: usize,
}

impl Variants {
    /// The scan's variants, and places for darn's own; `None` if the scan uses the extension in a way that cannot be added to.
    pub fn of(scan: &Scan) -> Option<Self> {
        let names = extension_list(&scan.json, EXTENSION, VARIANTS)?;
        let place = |own: &str, new: usize| {
            let known = names
                .iter()
                .position(|it| it.get("name").and_then(Value::as_str) == Some(own));
            known.unwrap_or(new)
        };
        let count = names.len();
        let blended = place(BLENDED, count);
        let marked = place(MARKED, count.max(blended + usize::from(blended == count)));
        Some(Self {
            count,
            blended,
            marked,
        })
    }

    /// Appends darn's own variants, as far as the scan does not have them.
    pub fn append(&self, out: &mut Appender<'_>) {
        out.uses(EXTENSION);
        for (index, name) in [(self.blended, BLENDED), (self.marked, MARKED)] {
            if index >= self.count {
                out.push_to_extension(EXTENSION, VARIANTS, json!({ "name": name }));
            }
        }
    }

    /// Maps darn's variants on the cloth's own primitives that map others, each with the material that it has without a variant. glTF says as much, but
    /// model-viewer and Voyager leave a primitive in the variant before where a new one maps nothing on it.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn map_on_cloth(
        &self,
        scan: &Scan,
        out: &mut Appender<'_>,
        budget: &Budget<'_>,
    ) -> Result<(), ScanError> {
        for (mesh, object) in list(&scan.json, "meshes").iter().enumerate() {
            for (index, primitive) in list(object, "primitives").iter().enumerate() {
                let material = primitive.get("material").and_then(Value::as_u64);
                let mappings = primitive.pointer(&format!("/extensions/{EXTENSION}/mappings"));
                let (Some(material), Some(mappings)) =
                    (material, mappings.and_then(Value::as_array))
                else {
                    continue;
                };
                let mapped = mappings.iter().flat_map(|it| list(it, "variants"));
                let mapped: Vec<&Value> = mapped.collect();
                let own = [self.blended, self.marked].map(Value::from);
                let new: Vec<&Value> = own.iter().filter(|it| !mapped.contains(it)).collect();
                if mapped.is_empty() || new.is_empty() || is_reconstructed(primitive.get("extras"))
                {
                    continue;
                }
                budget.hold(VARIANT)?;
                budget.spend(VARIANT_WORK)?;
                let path = [
                    "meshes",
                    &format!("{mesh}"),
                    "primitives",
                    &format!("{index}"),
                ];
                let path = path.iter().chain(&["extensions", EXTENSION, "mappings"]);
                let mapping = json!({ "material": material, "variants": new });
                out.append_at(path.map(|key| (*key).to_owned()).collect(), mapping);
            }
        }
        Ok(())
    }

    /// The materials of a part of the scan.
    pub fn choices(&self, scan: &Scan, part: &ScanPart) -> MaterialChoices {
        let mut mapped = mapped_materials(scan, part);
        mapped.retain(|variant, _| *variant < self.count);
        mapped.remove(&self.blended);
        MaterialChoices {
            marked: mapped.remove(&self.marked).filter(|_| part.reconstructed),
            mapped,
            ..MaterialChoices::of(part)
        }
    }

    /// `extensions` of a patch's primitive.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn mappings(&self, of: &PatchMaterials, budget: &Budget<'_>) -> Result<Value, ScanError> {
        budget.hold(VARIANT * self.count)?;
        budget.spend(VARIANT_WORK * self.count as u64)?;
        let mut by_material: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        let own = [self.blended, self.marked];
        for variant in (0..self.count).filter(|variant| !own.contains(variant)) {
            let material = of.mapped.get(&variant).copied().unwrap_or(of.default);
            by_material.entry(material).or_default().push(variant);
        }
        by_material
            .entry(of.default)
            .or_default()
            .push(self.blended);
        by_material.entry(of.marked).or_default().push(self.marked);
        let mappings = by_material.into_iter();
        let mappings = mappings.map(|(material, mut variants)| {
            variants.sort_unstable();
            json!({ "material": material, "variants": variants })
        });
        Ok(json!({ EXTENSION: { "mappings": mappings.collect::<Vec<_>>() } }))
    }
}

/// An array of an object; empty where there is none.
fn list<'j>(of: &'j Value, key: &str) -> &'j [Value] {
    let list = of.get(key).and_then(Value::as_array);
    list.map_or(&[], Vec::as_slice)
}

/// The material that each variant maps on a part, by the variant's index; where several mappings name one variant, the first.
pub(super) fn mapped_materials(scan: &Scan, part: &ScanPart) -> BTreeMap<usize, usize> {
    let pointer = format!(
        "/meshes/{}/primitives/{}/extensions/{EXTENSION}/mappings",
        part.mesh, part.primitive
    );
    let mappings = scan.json.pointer(&pointer).and_then(Value::as_array);
    let number = |value: &Value| usize::try_from(value.as_u64()?).ok();
    let mut mapped = BTreeMap::new();
    for mapping in mappings.into_iter().flatten() {
        let Some(material) = mapping.get("material").and_then(number) else {
            continue;
        };
        let variants = mapping.get("variants").and_then(Value::as_array);
        for variant in variants.into_iter().flatten().filter_map(number) {
            mapped.entry(variant).or_insert(material);
        }
    }
    mapped
}
