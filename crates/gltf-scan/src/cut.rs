//! Cutting: takes triangles out of a scan, and writes the index lists of what is left.
//!
//! A primitive of which triangles are cut out gets a new list of triangles; its vertices, attributes, morph targets and
//! the bytes of its old indices stay. Each cut is recorded in its `extras.darn.cuts`, oldest first: what `indices` and
//! `mode` were before (null: left out), the `count` of the old list, and how many triangles are left. With the members of an entry put back, that cut and
//! all later ones are undone. Extras that are not an object cannot take the record; the new accessor's extras have it
//! then.

use std::collections::BTreeMap;

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::TRIANGLES;
use serde_json::{Value, json};

use super::append::{AccessorData, Appender};
use super::buffers::BufferTarget;
use super::error::ScanError;
use super::scan::{Scan, ScanPart};
use darn_budget::Budget;

/// Extensions under which a primitive's `indices` are not what is drawn.
const COMPRESSED: [&str; 1] = ["KHR_draco_mesh_compression"];

/// Nanoseconds of work a face that is copied.
const FACE_WORK: u64 = 4;

impl Scan {
    /// Adds to a list of faces of `surface` the same triangles as other nodes draw them; the list comes back ascending,
    /// each face once.
    pub fn spread_to_instances(&self, faces: &mut Vec<u32>) {
        let mut starts: BTreeMap<(usize, usize), Vec<u32>> = BTreeMap::new();
        for part in self.parts.iter().filter(|part| part.shared) {
            let instances = starts.entry((part.mesh, part.primitive)).or_default();
            instances.push(part.faces.start);
        }
        if !starts.is_empty() {
            let spread = |face: u32| {
                let part = self.part_of_face(face).and_then(|p| self.parts.get(p));
                let instances = part.and_then(|p| starts.get(&(p.mesh, p.primitive)));
                let within = part.map_or(0, |p| face - p.faces.start);
                instances.into_iter().flatten().map(move |s| s + within)
            };
            let others: Vec<u32> = faces.iter().flat_map(|f| spread(*f)).collect();
            faces.extend(others);
        }
        faces.sort_unstable();
        faces.dedup();
    }

    /// The scan without some faces of `surface`; vertices keep their numbers. Call
    /// [`spread_to_instances`](Scan::spread_to_instances) first: a triangle is drawn by all nodes of its mesh or by none.
    ///
    /// # Errors
    /// [`ScanError::Unsupported`] for a primitive whose triangles are compressed, [`ScanError::NotCut`] for an OBJ or a
    /// PLY; `Exhausted`.
    pub fn without_faces(&self, cut: &[bool], budget: &Budget) -> Result<Scan, ScanError> {
        if self.origin.is_some() {
            return Err(ScanError::NotCut);
        }
        budget.hold(self.decoded_bytes() + self.json_held)?;
        budget.spend(FACE_WORK * self.surface.faces.len() as u64)?;
        let mut scan = self.clone();
        let is_cut = |face: u32| cut.get(face as usize) == Some(&true);
        let mut kept = Vec::with_capacity(self.surface.faces.len());
        for part in &mut scan.parts {
            let start = kept.len() as u32;
            let faces = part.faces.clone();
            let rest = faces.clone().filter(|f| !is_cut(*f));
            kept.extend(rest.filter_map(|f| self.surface.faces.get(f as usize).copied()));
            part.faces = start..kept.len() as u32;
            if part.faces.len() < faces.len() {
                uncompressed(&self.json, part)?;
                scan.cut.insert((part.mesh, part.primitive));
            }
        }
        scan.surface.faces = kept;
        Ok(scan)
    }
}

/// Refuses a primitive whose index list is not what is drawn.
fn uncompressed(json: &Value, part: &ScanPart) -> Result<(), ScanError> {
    let pointer = pointer_of(part);
    let extensions = json.pointer(&format!("{pointer}/extensions"));
    let compressed = |name: &&str| extensions.is_some_and(|all| all.get(*name).is_some());
    match COMPRESSED.into_iter().find(compressed) {
        None => Ok(()),
        Some(extension) => Err(ScanError::Unsupported {
            pointer: format!("{pointer}/extensions/{extension}"),
            extension,
        }),
    }
}

fn pointer_of(part: &ScanPart) -> String {
    format!("/meshes/{}/primitives/{}", part.mesh, part.primitive)
}

/// Gives every primitive of which triangles were cut out its new indices, and records what they were.
pub(super) fn cut_primitives(scan: &Scan, out: &mut Appender<'_>) -> Result<(), ScanError> {
    let mut written = None;
    let mut parts: Vec<&ScanPart> = (scan.parts.iter())
        .filter(|part| scan.cut.contains(&(part.mesh, part.primitive)))
        .collect();
    parts.sort_by_key(|part| (part.mesh, part.primitive));
    for part in parts {
        let key = (part.mesh, part.primitive);
        // All nodes that draw a primitive draw the same triangles.
        if written.replace(key) == Some(key) {
            continue;
        }
        cut_primitive(scan, part, out)?;
    }
    Ok(())
}

fn cut_primitive(scan: &Scan, part: &ScanPart, out: &mut Appender<'_>) -> Result<(), ScanError> {
    let pointer = pointer_of(part);
    let primitive = (scan.json.pointer(&pointer)).ok_or_else(|| ScanError::Invalid {
        pointer: pointer.clone(),
        detail: "is missing".into(),
    })?;
    let member = |key: &str| primitive.get(key).cloned().unwrap_or_default();
    let mirrored = part.transform.mirrors();
    let start = part.vertices.start;
    let range = part.faces.start as usize..part.faces.end as usize;
    let faces = scan.surface.faces.get(range).unwrap_or_default();
    let local = faces.iter().map(|face| {
        let [a, b, c] = face.map(|v| v - start);
        if mirrored { [a, c, b] } else { [a, b, c] }
    });
    // An accessor has at least one element; a triangle without extent draws nothing.
    let none = faces.is_empty().then_some([0; 3]);
    let (component, bytes) = index_bytes(local.chain(none), part.vertices.len());
    let mut record = json!({
        "indices": member("indices"),
        "mode": member("mode"),
        "trianglesLeft": faces.len(),
    });
    let old = member("indices");
    let old = old
        .as_u64()
        .map(|index| format!("/accessors/{index}/count"));
    if let Some(count) = old.and_then(|count| scan.json.pointer(&count)) {
        record["count"] = count.clone();
    }
    let indices = out.accessor(AccessorData {
        name: "darn cut",
        target: BufferTarget::Indices,
        component,
        kind: Type::Scalar,
        bytes,
        bounds: None,
    });
    let (mesh, index) = (part.mesh.to_string(), part.primitive.to_string());
    let at = |members: &[&str]| -> Vec<String> {
        let path = ["meshes", &mesh, "primitives", &index].into_iter();
        path.chain(members.iter().copied())
            .map(str::to_owned)
            .collect()
    };
    let darn = primitive.pointer("/extras/darn");
    let takes_record =
        (primitive.get("extras")).is_none_or(Value::is_object) && darn.is_none_or(Value::is_object);
    if !takes_record {
        out.extras_of_last("accessors", json!({ "darn": { "cuts": [record] } }));
    } else if let Some(darn) = darn {
        let earlier = darn.get("cuts").and_then(Value::as_array);
        let mut cuts = earlier.cloned().unwrap_or_default();
        cuts.push(record);
        out.set(at(&["extras", "darn", "cuts"]), Value::Array(cuts));
    } else if primitive.get("extras").is_some() {
        out.set(at(&["extras", "darn"]), json!({ "cuts": [record] }));
    } else {
        out.set(at(&["extras"]), json!({ "darn": { "cuts": [record] } }));
    }
    out.set(at(&["indices"]), indices);
    if (member("mode").as_u64()).is_some_and(|mode| mode != u64::from(TRIANGLES)) {
        out.set(at(&["mode"]), json!(TRIANGLES));
    }
    Ok(())
}

/// Triangles over so many vertices as the bytes of an index list. In u16, 65535 is not an index: it restarts a
/// primitive.
pub(super) fn index_bytes(
    faces: impl Iterator<Item = [u32; 3]>,
    vertices: usize,
) -> (ComponentType, Vec<u8>) {
    let indices = faces.flatten();
    if vertices <= usize::from(u16::MAX) {
        let bytes = indices.flat_map(|index| (index as u16).to_le_bytes());
        (ComponentType::U16, bytes.collect())
    } else {
        let bytes = indices.flat_map(u32::to_le_bytes);
        (ComponentType::U32, bytes.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ScanLimits;
    use crate::testing::Builder;
    use darn_geometry::mesh::Vec3;

    fn read(bytes: &[u8]) -> Scan {
        Scan::read(bytes.to_vec(), &ScanLimits::default()).unwrap()
    }

    /// A strip of four triangles over six vertices as one primitive with these members.
    fn strip(indices: Option<&[u16]>, members: &Value) -> Builder {
        let mut scan = Builder::new();
        let corners = [0, 1, 2, 3, 4, 5].map(|k| [k as f32, (k % 2) as f32, 0.25]);
        let position = scan.floats(&corners);
        let indices = indices.map(|indices| scan.indices_u16(indices));
        let mut primitive = members.clone();
        primitive["attributes"] = json!({"POSITION": position});
        if let Some(indices) = indices {
            primitive["indices"] = json!(indices);
        }
        scan.primitive(primitive);
        scan
    }

    /// The places of all triangles, in order.
    fn triangles(scan: &Scan) -> Vec<[Vec3; 3]> {
        (0..scan.surface.faces.len())
            .map(|f| scan.surface.triangle(f))
            .collect()
    }

    fn json_of(bytes: &[u8]) -> Value {
        let layout = crate::container::layout(bytes).unwrap();
        serde_json::from_slice(&bytes[layout.json]).unwrap()
    }

    /// Cuts out the second triangle, and returns the scan as written.
    fn cut_second(bytes: &[u8]) -> Vec<u8> {
        let scan = read(bytes);
        let mut chosen = vec![1];
        scan.spread_to_instances(&mut chosen);
        let mut cut = vec![false; scan.surface.faces.len()];
        chosen.iter().for_each(|f| cut[*f as usize] = true);
        let never = Budget::unlimited();
        let rest = scan.without_faces(&cut, never).unwrap();
        let kept = triangles(&scan).into_iter().zip(&cut);
        let kept: Vec<[Vec3; 3]> = kept.filter(|(_, cut)| !**cut).map(|(t, _)| t).collect();
        assert_eq!(triangles(&rest), kept);
        let out = rest.write(&[]).unwrap();
        assert_eq!(
            triangles(&read(&out)),
            kept,
            "the same triangles on the same side"
        );
        let [old, new] = [bytes, &out].map(|glb| {
            let bin = crate::container::layout(glb).unwrap().bin.unwrap();
            glb[bin].to_vec()
        });
        assert_eq!(new[..old.len()], old, "every old byte is still there");
        gltf::Gltf::from_slice(&out).expect("a valid glTF");
        out
    }

    /// Puts back what the last cut recorded.
    fn undone(bytes: &[u8]) -> Scan {
        let mut json = json_of(bytes);
        for primitive in json["meshes"][0]["primitives"].as_array_mut().unwrap() {
            let Some(cuts) = primitive.pointer("/extras/darn/cuts").cloned() else {
                continue;
            };
            for key in ["indices", "mode"] {
                match &cuts[0][key] {
                    Value::Null => drop(primitive.as_object_mut().unwrap().remove(key)),
                    old => primitive[key] = old.clone(),
                }
            }
        }
        let bin = crate::container::layout(bytes).unwrap().bin.unwrap();
        let glb = crate::container::pack_glb(json.to_string().as_bytes(), Some(&bytes[bin]), &[]);
        read(&glb.unwrap())
    }

    #[test]
    fn a_triangle_leaves_a_primitive_of_any_kind_and_can_be_put_back() {
        let lists = [0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5];
        let ribbon = [0, 1, 2, 3, 4, 5];
        let restarted = [0, 1, 2, 3, 65535, 2, 3, 4, 5];
        for (indices, mode) in [
            (Some(&lists[..]), None),
            (Some(&lists[..]), Some(4)),
            (Some(&ribbon[..]), Some(5)),
            (Some(&restarted[..]), Some(5)),
            (Some(&ribbon[..]), Some(6)),
            (None, None),
            (None, Some(5)),
            (None, Some(6)),
        ] {
            let mut members = json!({"extras": {"loan": 1.50}});
            if let Some(mode) = mode {
                members["mode"] = json!(mode);
            }
            let mut scan = strip(indices, &members);
            let plain = scan.clone().glb();
            let out = cut_second(&plain);
            assert_eq!(
                triangles(&undone(&out)),
                triangles(&read(&plain)),
                "{mode:?}"
            );
            let primitive = &json_of(&out)["meshes"][0]["primitives"][0];
            assert_eq!(primitive["extras"]["loan"].to_string(), "1.5");
            assert_eq!(primitive["mode"].as_u64().unwrap_or(4), 4);
            // Mirrored by its node, and drawn by two.
            scan.json["nodes"] = json!([{"mesh": 0, "scale": [-1, 1, 1]}, {"mesh": 0}]);
            scan.json["scenes"][0]["nodes"] = json!([0, 1]);
            cut_second(&scan.glb());
        }
    }

    #[test]
    fn a_cut_of_a_cut_is_recorded_beside_the_first() {
        let members = json!({"extras": {"darn": {"reconstructed": true}}});
        let scan = strip(Some(&[0, 1, 2, 2, 1, 3, 2, 3, 4]), &members);
        let once = cut_second(&scan.clone().glb());
        let twice = cut_second(&once);
        let darn = &json_of(&twice)["meshes"][0]["primitives"][0]["extras"]["darn"];
        assert_eq!(darn["reconstructed"], true);
        assert_eq!(darn["cuts"].as_array().unwrap().len(), 2);
        assert_eq!(triangles(&undone(&twice)), triangles(&read(&scan.glb())));
    }

    #[test]
    fn what_a_primitive_without_triangles_was_is_kept_by_its_accessor() {
        let mut scan = strip(None, &json!({"extras": "loan 7"}));
        let other = scan.json["meshes"][0]["primitives"][0].clone();
        scan.primitive(other);
        let scan = read(&scan.glb());
        let first = scan.parts[0].faces.len();
        let cut: Vec<bool> = (0..scan.surface.faces.len()).map(|f| f < first).collect();
        let out = scan
            .without_faces(&cut, Budget::unlimited())
            .unwrap()
            .write(&[])
            .unwrap();
        assert_eq!(read(&out).surface.faces.len(), first);
        let json = json_of(&out);
        let primitive = &json["meshes"][0]["primitives"][0];
        assert_eq!(primitive["extras"], "loan 7");
        let indices = &json["accessors"][primitive["indices"].as_u64().unwrap() as usize];
        assert_eq!(indices["count"], 3);
        let record = &indices["extras"]["darn"]["cuts"][0];
        assert_eq!(
            record,
            &json!({"indices": null, "mode": null, "trianglesLeft": 0})
        );
    }

    #[test]
    fn compressed_triangles_are_not_cut() {
        let draco = json!({"extensions": {"KHR_draco_mesh_compression": {"bufferView": 0}}});
        let scan = read(&strip(Some(&[0, 1, 2, 2, 1, 3]), &draco).glb());
        let refused = scan
            .without_faces(&[true, false], Budget::unlimited())
            .unwrap_err();
        let ScanError::Unsupported { pointer, .. } = refused else {
            panic!("{refused:?}");
        };
        assert!(pointer.starts_with("/meshes/0/primitives/0/extensions/KHR_draco"));
    }
}
