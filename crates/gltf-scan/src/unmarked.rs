//! Takes darn's patches and cuts out of a glTF's JSON, where the bytes from before cannot be had any more.
//!
//! Primitives that are marked as reconstructed go, triangle lists of which triangles were cut out are put back, and so
//! are material variants and packets of metadata that darn added. Accessors, buffer views and bytes of the patches stay,
//! unused: taking them out would move every other index of the file, also those in extensions unknown to darn.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::patch_primitive::is_reconstructed;
use super::variants;
use super::xmp;

/// What a scan has of darn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Marks {
    /// Holes that patches close.
    pub patches: usize,
    /// Primitives of which triangles were cut out.
    pub cuts: usize,
}

impl Marks {
    /// What a glTF's JSON has of darn.
    pub fn of(json: &Value) -> Self {
        let mut marks = Self::default();
        let mut seen = BTreeSet::new();
        for (mesh, primitive) in primitives(json) {
            marks.cuts += usize::from(last_cut(json, primitive).is_some());
            if !is_patch(primitive) {
                continue;
            }
            let position = primitive.pointer("/attributes/POSITION");
            // The other side of patches shares their positions.
            let key = (mesh, position.map(Value::to_string));
            if key.1.is_none() || seen.insert(key) {
                let holes = primitive.pointer("/extras/darn/holes");
                marks.patches += holes.and_then(Value::as_array).map_or(1, Vec::len);
            }
        }
        marks
    }
}

/// All primitives, each with the index of its mesh.
fn primitives(json: &Value) -> impl Iterator<Item = (usize, &Value)> {
    let meshes = json.get("meshes").and_then(Value::as_array);
    let meshes = meshes.into_iter().flatten().enumerate();
    meshes.flat_map(|(index, mesh)| {
        let primitives = mesh.get("primitives").and_then(Value::as_array);
        (primitives.into_iter().flatten()).map(move |primitive| (index, primitive))
    })
}

fn is_patch(primitive: &Value) -> bool {
    is_reconstructed(primitive.get("extras"))
}

/// Takes out what darn added; `None` if there is nothing. Returns what a person should know.
pub(super) fn without_marks(json: &mut Value) -> Option<Vec<String>> {
    let mut notes = Vec::new();
    let mut found = false;
    // Before the patches go: what was cut may be a patch itself.
    found |= restore_cuts(json, &mut notes);
    found |= remove_patches(json);
    found |= remove_records(json);
    if !found {
        return None;
    }
    remove_variants(json);
    remove_materials(json);
    remove_packets(json);
    Some(notes)
}

/// Removes the patches of all meshes. A mesh of nothing else is no longer drawn.
fn remove_patches(json: &mut Value) -> bool {
    let mut emptied = BTreeSet::new();
    let mut found = false;
    for (index, mesh) in list(json, "meshes").iter_mut().enumerate() {
        let Some(primitives) = mesh.get_mut("primitives").and_then(Value::as_array_mut) else {
            continue;
        };
        let patches = primitives.iter().filter(|it| is_patch(it)).count();
        found |= patches > 0;
        if patches == primitives.len() && patches > 0 {
            // A mesh has at least one primitive.
            emptied.insert(index as u64);
        } else {
            primitives.retain(|primitive| !is_patch(primitive));
        }
    }
    for node in list(json, "nodes") {
        let mesh = node.get("mesh").and_then(Value::as_u64);
        if let (true, Some(node)) = (
            mesh.is_some_and(|mesh| emptied.contains(&mesh)),
            node.as_object_mut(),
        ) {
            for key in ["mesh", "skin", "weights"] {
                node.shift_remove(key);
            }
        }
    }
    found
}

/// The record of the last cut of a primitive, and of those before it: its own, or its index accessor's.
fn last_cut(json: &Value, primitive: &Value) -> Option<Value> {
    let own = primitive.pointer("/extras/darn/cuts");
    let cuts = own.or_else(|| {
        let accessor = accessor(json, primitive.get("indices")?)?;
        accessor.pointer("/extras/darn/cuts")
    });
    let first = cuts?.as_array()?.first()?;
    first.is_object().then(|| first.clone())
}

fn accessor<'j>(json: &'j Value, index: &Value) -> Option<&'j Value> {
    let index = usize::try_from(index.as_u64()?).ok()?;
    json.get("accessors")?.get(index)
}

/// Puts back the triangle lists from before the cuts.
fn restore_cuts(json: &mut Value, notes: &mut Vec<String>) -> bool {
    let mut found = false;
    let places: Vec<(usize, usize)> = (list(json, "meshes").iter().enumerate())
        .flat_map(|(mesh, value)| {
            let primitives = value.get("primitives").and_then(Value::as_array);
            (0..primitives.map_or(0, Vec::len)).map(move |primitive| (mesh, primitive))
        })
        .collect();
    for (mesh, index) in places {
        let pointer = format!("/meshes/{mesh}/primitives/{index}");
        let Some(mut primitive) = json.pointer(&pointer).cloned() else {
            continue;
        };
        // A record that an accessor has tells of the list before it, which may have another.
        let mut visited = BTreeSet::new();
        while let Some(cut) = last_cut(json, &primitive) {
            found = true;
            let known = !visited.insert(cut.to_string());
            if known || !fits(json, &primitive, &cut) {
                notes.push(format!(
                    "{pointer}: the triangles that were cut out could not be put back, as the file was rearranged"
                ));
                break;
            }
            let Some(object) = primitive.as_object_mut() else {
                break;
            };
            for key in ["indices", "mode"] {
                match cut.get(key) {
                    None | Some(Value::Null) => drop(object.shift_remove(key)),
                    Some(old) => drop(object.insert(key.to_owned(), old.clone())),
                }
            }
            remove_member(object, "cuts");
        }
        if let Some(place) = json.pointer_mut(&pointer) {
            *place = primitive;
        }
    }
    found
}

/// Whether the triangle list that a cut tells of is still there, as far as can be seen.
fn fits(json: &Value, primitive: &Value, cut: &Value) -> bool {
    const UNSIGNED: [u64; 3] = [5121, 5123, 5125];
    let compressed = primitive.pointer("/extensions/KHR_draco_mesh_compression");
    if compressed.is_some() {
        return false;
    }
    let old = match cut.get("indices") {
        None | Some(Value::Null) => return true,
        Some(index) => accessor(json, index),
    };
    let member = |key: &str| old.and_then(|accessor| accessor.get(key));
    let unsigned = member("componentType").and_then(Value::as_u64);
    member("type").and_then(Value::as_str) == Some("SCALAR")
        && unsigned.is_some_and(|kind| UNSIGNED.contains(&kind))
        && cut
            .get("count")
            .is_none_or(|count| member("count") == Some(count))
}

/// Removes a member of `extras.darn`, and the objects that this leaves empty.
fn remove_member(object: &mut Map<String, Value>, key: &str) {
    let Some(extras) = object.get_mut("extras").and_then(Value::as_object_mut) else {
        return;
    };
    if let Some(darn) = extras.get_mut("darn").and_then(Value::as_object_mut) {
        darn.shift_remove(key);
        if darn.is_empty() {
            extras.shift_remove("darn");
        }
    }
    if extras.is_empty() {
        object.shift_remove("extras");
    }
}

/// Removes the records of mends that do not fit any more, and the mark of a packed glTF.
fn remove_records(json: &mut Value) -> bool {
    let mut found = false;
    for view in list(json, "bufferViews") {
        for key in ["undo", "packed"] {
            if view.pointer(&format!("/extras/darn/{key}")).is_some()
                && let Some(view) = view.as_object_mut()
            {
                found = true;
                remove_member(view, key);
            }
        }
    }
    found
}

/// Removes darn's variants from the end of the list, as far as no primitive maps them otherwise than darn does.
fn remove_variants(json: &mut Value) {
    remove_mappings(json);
    let mut mapped = BTreeSet::new();
    let mut is_used = false;
    for (_, primitive) in primitives(json) {
        let extension = primitive
            .get("extensions")
            .and_then(|all| all.get(variants::EXTENSION));
        is_used |= extension.is_some();
        let mappings = extension.and_then(|it| it.get("mappings")?.as_array());
        for mapping in mappings.into_iter().flatten() {
            let variants = mapping.get("variants").and_then(Value::as_array);
            mapped.extend(variants.into_iter().flatten().filter_map(Value::as_u64));
        }
    }
    let own = [variants::BLENDED, variants::MARKED];
    let is_own = |variant: &Value| {
        let name = variant.get("name").and_then(Value::as_str);
        name.is_some_and(|name| own.contains(&name))
    };
    let left = remove_last(
        json,
        variants::EXTENSION,
        variants::VARIANTS,
        |index, variant| is_own(variant) && !mapped.contains(&index),
    );
    if left == Some(0) && !is_used {
        remove_extension(json, variants::EXTENSION);
    }
}

/// Removes the mappings of darn's variants alone that give primitives the material that they have without.
fn remove_mappings(json: &mut Value) {
    let names = json.pointer(&format!(
        "/extensions/{}/{}",
        variants::EXTENSION,
        variants::VARIANTS
    ));
    let names = names.and_then(Value::as_array);
    let own: BTreeSet<u64> = (0..)
        .zip(names.into_iter().flatten())
        .filter(|(_, variant)| {
            let name = variant.get("name").and_then(Value::as_str);
            name.is_some_and(|name| [variants::BLENDED, variants::MARKED].contains(&name))
        })
        .map(|(index, _)| index)
        .collect();
    let pointer = format!("/extensions/{}/mappings", variants::EXTENSION);
    let meshes = list(json, "meshes").iter_mut();
    let primitives = meshes.filter_map(|mesh| mesh.get_mut("primitives")?.as_array_mut());
    for primitive in primitives.flatten() {
        let material = primitive.get("material").cloned();
        let mappings = primitive
            .pointer_mut(&pointer)
            .and_then(Value::as_array_mut);
        let Some(mappings) = mappings else {
            continue;
        };
        mappings.retain(|mapping| {
            let variants = mapping.get("variants").and_then(Value::as_array);
            let is_own = variants.is_some_and(|all| {
                !all.is_empty()
                    && all
                        .iter()
                        .all(|it| it.as_u64().is_some_and(|it| own.contains(&it)))
            });
            !is_own || mapping.get("material") != material.as_ref()
        });
    }
}

/// Removes darn's packets of metadata from the end of the list, as far as nothing else refers to them.
fn remove_packets(json: &mut Value) {
    let packets = json.pointer(&format!("/extensions/{}/{}", xmp::EXTENSION, xmp::PACKETS));
    let packets = packets
        .and_then(Value::as_array)
        .map_or(&[][..], Vec::as_slice);
    let own: BTreeSet<u64> = (0..)
        .zip(packets)
        .filter(|(_, it)| xmp::is_own(it))
        .map(|(k, _)| k)
        .collect();
    let packet = |of: &Value| {
        of.get("extensions")?
            .get(xmp::EXTENSION)?
            .get("packet")?
            .as_u64()
    };
    if let Some(asset) = json.get_mut("asset")
        && packet(asset).is_some_and(|packet| own.contains(&packet))
        && let Some(asset) = asset.as_object_mut()
    {
        remove_own_extension(asset, xmp::EXTENSION);
    }
    const MAY_REFER: [&str; 6] = [
        "scenes",
        "nodes",
        "meshes",
        "materials",
        "images",
        "animations",
    ];
    let lists = MAY_REFER
        .iter()
        .filter_map(|key| json.get(*key)?.as_array());
    let mut used: BTreeSet<u64> = lists.flatten().filter_map(packet).collect();
    used.extend(json.get("asset").and_then(packet));
    let left = remove_last(json, xmp::EXTENSION, xmp::PACKETS, |index, packet| {
        xmp::is_own(packet) && !used.contains(&index)
    });
    if left == Some(0) && used.is_empty() {
        remove_extension(json, xmp::EXTENSION);
    }
}

/// Removes elements from the end of a list of an extension while `goes` says so; returns how many are left.
fn remove_last(
    json: &mut Value,
    extension: &str,
    list: &str,
    goes: impl Fn(u64, &Value) -> bool,
) -> Option<usize> {
    let list = json.pointer_mut(&format!("/extensions/{extension}/{list}"))?;
    let list = list.as_array_mut()?;
    while let Some(last) = list.last() {
        if !goes(list.len() as u64 - 1, last) {
            break;
        }
        list.pop();
    }
    Some(list.len())
}

/// Removes an extension that nothing uses any more from the top of the JSON.
fn remove_extension(json: &mut Value, name: &str) {
    let Some(root) = json.as_object_mut() else {
        return;
    };
    remove_own_extension(root, name);
    if let Some(used) = root.get_mut("extensionsUsed").and_then(Value::as_array_mut) {
        used.retain(|used| used != name);
        if used.is_empty() {
            root.shift_remove("extensionsUsed");
        }
    }
}

/// Removes an extension of an object, and the object's `extensions` if that leaves none.
fn remove_own_extension(object: &mut Map<String, Value>, name: &str) {
    let Some(extensions) = object.get_mut("extensions").and_then(Value::as_object_mut) else {
        return;
    };
    extensions.shift_remove(name);
    if extensions.is_empty() {
        object.shift_remove("extensions");
    }
}

/// Removes darn's copies of materials from the end of the list, as far as no primitive uses them.
fn remove_materials(json: &mut Value) {
    let mut used = BTreeSet::new();
    for (_, primitive) in primitives(json) {
        used.extend(primitive.get("material").and_then(Value::as_u64));
        let mappings = primitive.pointer("/extensions/KHR_materials_variants/mappings");
        let mappings = mappings.and_then(Value::as_array).into_iter().flatten();
        used.extend(mappings.filter_map(|mapping| mapping.get("material")?.as_u64()));
    }
    let Some(materials) = json.get_mut("materials").and_then(Value::as_array_mut) else {
        return;
    };
    while let Some(last) = materials.last() {
        let index = materials.len() as u64 - 1;
        if used.contains(&index) || !is_patch(last) {
            break;
        }
        materials.pop();
    }
    if materials.is_empty()
        && let Some(root) = json.as_object_mut()
    {
        root.shift_remove("materials");
    }
}

fn list<'j>(json: &'j mut Value, key: &str) -> &'j mut [Value] {
    let list = json.get_mut(key).and_then(Value::as_array_mut);
    list.map_or(&mut [], Vec::as_mut_slice)
}
