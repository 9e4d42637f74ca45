//! What a file holds beside the default scene: other scenes, and other levels of detail.

use std::collections::BTreeSet;

use serde_json::Value;

use super::Scan;

/// An element of a list in the file's JSON, and its name if it has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NamedPlace<'a> {
    /// Its index in the list.
    pub index: usize,
    /// Its name.
    pub name: Option<&'a str>,
}

impl Scan {
    /// The scenes that draw a mesh which the default scene does not draw. Linear in the JSON.
    pub fn other_scenes(&self) -> Vec<NamedPlace<'_>> {
        let draws = self.draws_other_meshes();
        let leads =
            |scene: &Value| indices(scene.get("nodes")).any(|n| draws.get(n) == Some(&true));
        self.named("scenes", leads)
    }

    /// The nodes with further levels of detail (MSFT_lod) that the default scene does not draw. Linear in the JSON.
    pub fn other_levels(&self) -> Vec<NamedPlace<'_>> {
        let draws = self.draws_other_meshes();
        let leads = |node: &Value| {
            let ids = node.pointer("/extensions/MSFT_lod/ids");
            indices(ids).any(|n| draws.get(n) == Some(&true))
        };
        self.named("nodes", leads)
    }

    /// The elements of a list at the top of the JSON that pass a test.
    fn named(&self, key: &str, test: impl Fn(&Value) -> bool) -> Vec<NamedPlace<'_>> {
        let passing = list(&self.json, key).iter().enumerate();
        let passing = passing.filter(|(_, value)| test(value));
        passing
            .map(|(index, value)| NamedPlace {
                index,
                name: value.get("name").and_then(Value::as_str),
            })
            .collect()
    }

    /// Per node whether it or a node below it draws a mesh that the default scene does not draw.
    fn draws_other_meshes(&self) -> Vec<bool> {
        let drawn: BTreeSet<usize> = self.parts.iter().map(|part| part.mesh).collect();
        let nodes = list(&self.json, "nodes");
        let mut parent = vec![None; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            for child in indices(node.get("children")) {
                if let Some(parent) = parent.get_mut(child) {
                    *parent = Some(index);
                }
            }
        }
        let mut draws = vec![false; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            let mesh = node.get("mesh").and_then(index_of);
            let mut at = mesh.filter(|mesh| !drawn.contains(mesh)).map(|_| index);
            // A node that is marked has marked its ancestors.
            while let Some(node) = at.filter(|&node| !draws[node]) {
                draws[node] = true;
                at = parent[node];
            }
        }
        draws
    }
}

/// The elements of a list at the top of the JSON.
fn list<'a>(json: &'a Value, key: &str) -> &'a [Value] {
    let list = json.get(key).and_then(Value::as_array);
    list.map_or(&[], Vec::as_slice)
}

/// The indices in a list.
fn indices(list: Option<&Value>) -> impl Iterator<Item = usize> {
    let list = list.and_then(Value::as_array);
    list.into_iter().flatten().filter_map(index_of)
}

fn index_of(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|n| usize::try_from(n).ok())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::testing::Builder;
    use crate::{Scan, ScanLimits};

    #[test]
    fn scenes_and_levels_that_draw_other_meshes_are_named() {
        let mut file = Builder::square();
        let other = file.json["meshes"][0].clone();
        file.push("meshes", other);
        file.json["nodes"] = json!([
            {"mesh": 0, "name": "fine", "extensions": {"MSFT_lod": {"ids": [1]}}},
            {"mesh": 1},
            {"children": [3]},
            {"mesh": 1},
            {"mesh": 0, "extensions": {"MSFT_lod": {"ids": [0, 77]}}},
        ]);
        file.json["scenes"] = json!([
            {"nodes": [0]},
            {"nodes": [2], "name": "coarse"},
            {"nodes": [4]},
            {},
        ]);
        let scan = Scan::read(file.glb(), &ScanLimits::default()).expect("a scan");
        let named = |places: Vec<crate::NamedPlace>| -> Vec<(usize, Option<String>)> {
            let each = places.iter();
            each.map(|p| (p.index, p.name.map(str::to_owned))).collect()
        };
        let coarse = Some("coarse".to_owned());
        assert_eq!(named(scan.other_scenes()), [(1, coarse)]);
        assert_eq!(named(scan.other_levels()), [(0, Some("fine".to_owned()))]);
    }
}
