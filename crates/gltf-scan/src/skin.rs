//! Skins: which meshes have one, and which joints move a vertex.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::Value;

use super::json::integral;

/// The weights of up to four joints on a vertex: its element of JOINTS_n and WEIGHTS_n.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Influence {
    pub joints: [u16; 4],
    pub weights: [f32; 4],
}

/// One set of them, of all vertices of a primitive.
pub(super) type Influences = Arc<[Influence]>;

/// The meshes that some node draws with a skin, even a node outside the default scene: three.js skins such a mesh
/// wherever it is drawn.
pub(super) fn skinned_meshes(json: &Value) -> BTreeSet<usize> {
    let nodes = json.get("nodes").and_then(Value::as_array);
    let mesh = |node: &Value| {
        node.get("skin")?;
        usize::try_from(integral(node.get("mesh")?.as_number()?)?).ok()
    };
    nodes.into_iter().flatten().filter_map(mesh).collect()
}
