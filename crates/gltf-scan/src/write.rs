//! Writing: checks patches and appends them to the meshes they mend, one primitive for each mesh and material.

use std::collections::BTreeMap;
use std::sync::Arc;

use darn_budget::Budget;

use super::append::Appender;
use super::checked_patch::CheckedPatch;
use super::cloth_look::ClothLook;
use super::cut::cut_primitives;
use super::digests::FileDigests;
use super::error::ScanError;
use super::files::Companions;
use super::patch_appearance::PatchAppearance;
use super::patch_buffer::{NewFile, PatchBuffer};
use super::patch_group::{PatchGroup, PrimitiveLook};
use super::patch_materials::{MaterialRequest, PatchMaterialsMaker};
use super::patch_primitive::PatchPrimitive;
use super::scan::Scan;
use super::variants::{MaterialChoices, Variants};
use super::xmp;

/// A scan with patches.
#[derive(Debug, Clone)]
pub struct WrittenScan {
    /// In the container it was read from.
    pub bytes: Vec<u8>,
    /// Of the glTF: the file, or the glTF in a zip.
    pub digests: FileDigests,
    /// A file that the glTF refers to anew, and that is to lie beside it. In a zip it is an entry and not here.
    pub file: Option<NewFile>,
}

impl Scan {
    /// The scan with patches appended, in the container it was read from. Without patches and cuts: the bytes that were
    /// read.
    ///
    /// Everything that was there keeps its value, spelling and index; the BIN chunk keeps its bytes as a prefix. Only
    /// primitives of which triangles were cut out get new indices. Patches that look alike share a primitive.
    ///
    /// # Errors
    /// [`ScanError::InvalidPatch`] for a patch that contradicts itself or the scan, [`ScanError::Singular`] for one on
    /// a node whose transform is singular.
    pub fn write(&self, patches: &[PatchPrimitive]) -> Result<Vec<u8>, ScanError> {
        let buffer = PatchBuffer::default();
        let written = self.write_within(patches, buffer, Budget::unlimited())?;
        Ok(written.bytes)
    }

    /// [`Scan::write`] within a request's budget, with the new bytes of a glTF in a data URI or a file.
    ///
    /// # Errors
    /// As [`Scan::write`]; `Exhausted`.
    pub fn write_within(
        &self,
        patches: &[PatchPrimitive],
        buffer: PatchBuffer,
        budget: &Budget,
    ) -> Result<WrittenScan, ScanError> {
        budget.spend(DIGEST_WORK * self.bytes.len() as u64)?;
        if patches.is_empty() && self.cut.is_empty() {
            return Ok(WrittenScan {
                bytes: self.received().to_vec(),
                digests: self.digests().clone(),
                file: None,
            });
        }
        if let Some(origin) = &self.origin {
            let bytes = origin.with_patches(self, patches);
            budget.check_output(bytes.len())?;
            budget.spend(DIGEST_WORK * bytes.len() as u64)?;
            let digests = FileDigests::of(&bytes);
            let bytes = match &self.companions {
                Companions::Zip(zip) => zip.with_main(&bytes, None)?,
                Companions::Siblings(_) => bytes,
            };
            return Ok(WrittenScan {
                bytes,
                digests,
                file: None,
            });
        }
        let mut out = Appender::new(self, buffer);
        cut_primitives(self, &mut out)?;
        let variants = Variants::of(self);
        let packet = match patches.len() {
            0 => None,
            holes => xmp::append_packet(self, &mut out, holes),
        };
        let mut materials = PatchMaterialsMaker::new(self, packet);
        for (number, group) in (1..).zip(self.groups(patches, variants.as_ref())?) {
            budget.hold(TARGET * group.home().targets)?;
            budget.spend(TARGET_WORK * group.home().targets as u64)?;
            let images = group.images();
            let style = group.style(images.as_ref(), number, &mut out, budget)?;
            let look = match &variants {
                Some(variants) => {
                    let request = MaterialRequest {
                        choices: &variants.choices(self, group.look()),
                        style: &style,
                        hatch: group.hatch(),
                    };
                    let made = materials.make(&mut out, &request)?;
                    PrimitiveLook {
                        material: made.default,
                        extensions: Some(variants.mappings(&made, budget)?),
                    }
                }
                None => PrimitiveLook {
                    material: materials.blended(&mut out, group.look().material, &style, None)?,
                    extensions: None,
                },
            };
            group.append(&mut out, &look, images.as_ref());
        }
        if let (Some(variants), false) = (&variants, patches.is_empty()) {
            variants.append(&mut out);
            variants.map_on_cloth(self, &mut out, budget)?;
        }
        budget.check_output(self.bytes.len() + out.appended_bytes())?;
        let (mended, file) = out.finish()?;
        budget.spend(DIGEST_WORK * mended.len() as u64)?;
        let digests = FileDigests::of(&mended);
        let (bytes, file) = match &self.companions {
            Companions::Zip(zip) => (zip.with_main(&mended, file.as_ref())?, None),
            Companions::Siblings(_) => (mended, file),
        };
        Ok(WrittenScan {
            bytes,
            digests,
            file,
        })
    }

    /// The digests of the scan as it was read: the file, or the glTF in a zip.
    pub fn digests(&self) -> &FileDigests {
        let bytes = self
            .origin
            .as_ref()
            .map_or(&self.bytes, |origin| origin.bytes());
        self.digests.get_or_init(|| FileDigests::of(bytes))
    }

    /// The patches by the primitive that they share, in the order of each primitive's first patch.
    fn groups<'s>(
        &'s self,
        patches: &'s [PatchPrimitive],
        variants: Option<&Variants>,
    ) -> Result<Vec<PatchGroup<'s>>, ScanError> {
        let mut groups: Vec<PatchGroup<'_>> = Vec::new();
        let mut group_of = BTreeMap::new();
        // Numbers of materials, of which a primitive may have many: by themselves, and by the primitives that have them.
        let mut same: BTreeMap<MaterialChoices, usize> = BTreeMap::new();
        let mut of_primitive: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let mut looks: Vec<&Arc<ClothLook>> = Vec::new();
        for (index, patch) in patches.iter().enumerate() {
            let checked = CheckedPatch::new(self, patch, index)?;
            let look = checked.look;
            let materials = of_primitive
                .entry((look.mesh, look.primitive))
                .or_insert_with(|| {
                    let choices = match variants {
                        Some(variants) => variants.choices(self, look),
                        None => MaterialChoices::of(look),
                    };
                    let next = same.len();
                    *same.entry(choices).or_insert(next)
                });
            // Flat patches have colours of their own each.
            let appearance = match &patch.appearance {
                PatchAppearance::Continued => 0,
                PatchAppearance::Plain => 1,
                PatchAppearance::Own(own) => 2 + 2 * number_of(&mut looks, &own.look),
                PatchAppearance::Flat(..) => 3 + 2 * index,
            };
            let kind = checked.kind(*materials, appearance);
            let known = *group_of.entry(kind.clone()).or_insert(groups.len());
            match groups.get_mut(known) {
                Some(group) if group.takes(&checked) => group.push(checked),
                _ => {
                    group_of.insert(kind, groups.len());
                    groups.push(PatchGroup::of(checked));
                }
            }
        }
        Ok(groups)
    }
}

/// The place of a look in a list, to which it is added if it is new.
fn number_of<'s>(looks: &mut Vec<&'s Arc<ClothLook>>, look: &'s Arc<ClothLook>) -> usize {
    let is_same = |known: &&Arc<ClothLook>| Arc::ptr_eq(known, look) || **known == *look;
    looks.iter().position(is_same).unwrap_or_else(|| {
        looks.push(look);
        looks.len() - 1
    })
}

/// Bytes of memory of a morph target of a patch, as JSON and as text.
const TARGET: usize = 300;
/// Nanoseconds of work a byte whose digests are made.
const DIGEST_WORK: u64 = 8;
/// Nanoseconds of work a morph target of a patch.
const TARGET_WORK: u64 = 300;
