//! The node hierarchy of the default scene: which nodes draw which meshes, and with which transform.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

use super::error::ScanError;
use super::json::JsonPlace;
use super::limits::{Limit, ScanLimits};
use darn_geometry::mesh::Vec3;

/// The transform from a node's space to the scene, accumulated in f64: x ↦ `linear` x + `offset`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NodeTransform {
    pub linear: Matrix3<f64>,
    pub offset: Vec3,
}

/// A node of the default scene that draws a mesh.
#[derive(Debug, Clone)]
pub(super) struct MeshNode {
    pub index: usize,
    pub mesh: usize,
    pub transform: NodeTransform,
}

impl NodeTransform {
    pub fn identity() -> Self {
        Self {
            linear: Matrix3::identity(),
            offset: Vec3::zeros(),
        }
    }

    /// Whether the node's space is the scene's.
    pub fn is_identity(&self) -> bool {
        self.linear == Matrix3::identity() && self.offset == Vec3::zeros()
    }

    /// A point of the node's space in the scene.
    pub fn point(&self, local: Vec3) -> Vec3 {
        self.linear * local + self.offset
    }

    /// Whether the transform reverses the winding of faces: a negative determinant (glTF 2.0, 3.7.4).
    pub fn mirrors(&self) -> bool {
        self.linear.determinant() < 0.0
    }

    /// The inverse, or `None` if the transform is singular (relative volume below 1e-12).
    pub fn inverse(&self) -> Option<Self> {
        let volume: f64 = self
            .linear
            .column_iter()
            .map(|column| column.norm())
            .product();
        let regular = self.linear.determinant().abs() > 1e-12 * volume;
        let linear = self
            .linear
            .try_inverse()
            .filter(|m| regular && m.iter().all(|x| x.is_finite()))?;
        Some(Self {
            linear,
            offset: -(linear * self.offset),
        })
    }

    /// The transform of a child whose own transform is `child`.
    fn then(&self, child: &Self) -> Self {
        Self {
            linear: self.linear * child.linear,
            offset: self.point(child.offset),
        }
    }
}

/// The nodes of the default scene that draw a mesh, depth first in the file's order.
///
/// Without `scene` the first scene is taken; without scenes, every node that is no node's child. Skins are not applied:
/// a skinned mesh keeps its stored positions and ignores its node's transform. Morph targets have weight 0.
pub(super) fn mesh_nodes(
    root: &JsonPlace<'_>,
    limits: &ScanLimits,
) -> Result<Vec<MeshNode>, ScanError> {
    let nodes = match root.get("nodes")? {
        Some(nodes) => nodes.array()?.len(),
        None => return Ok(Vec::new()),
    };
    let mut seen = vec![false; nodes];
    let mut open = roots(root)?;
    open.reverse();
    let (mut out, mut visited) = (Vec::new(), 0);
    while let Some(NodeVisit {
        reference,
        index,
        node,
        parent,
    }) = open.pop()
    {
        visited += 1;
        let limit = Limit {
            name: "max_nodes",
            allowed: limits.max_nodes,
        };
        limit.check(visited, &node.pointer)?;
        if seen
            .get_mut(index)
            .is_none_or(|seen| std::mem::replace(seen, true))
        {
            let detail = format!("node {index} is reached a second time: a cycle or two parents");
            return Err(ScanError::Invalid {
                pointer: reference,
                detail,
            });
        }
        let transform = parent.then(&local(&node)?);
        if let Some(mesh) = node.get("mesh")? {
            let (mesh, _) = root.referred("meshes", &mesh)?;
            // Only joints move a skinned mesh, its node does not (glTF 2.0, 3.7.3.3).
            let transform = match node.get("skin")? {
                Some(_) => NodeTransform::identity(),
                None => transform.clone(),
            };
            out.push(MeshNode {
                index,
                mesh,
                transform,
            });
        }
        if let Some(children) = node.get("children")? {
            let first = open.len();
            for child in children.items()? {
                open.push(NodeVisit::new(root, child, transform.clone())?);
            }
            if let Some(children) = open.get_mut(first..) {
                children.reverse();
            }
        }
    }
    Ok(out)
}

/// A node to visit.
struct NodeVisit<'a> {
    /// JSON pointer to what refers to it.
    reference: String,
    index: usize,
    node: JsonPlace<'a>,
    parent: NodeTransform,
}

impl<'a> NodeVisit<'a> {
    fn new(
        root: &JsonPlace<'a>,
        reference: JsonPlace<'a>,
        parent: NodeTransform,
    ) -> Result<Self, ScanError> {
        let (index, node) = root.referred("nodes", &reference)?;
        Ok(Self {
            reference: reference.pointer,
            index,
            node,
            parent,
        })
    }
}

/// The root nodes of the default scene.
fn roots<'a>(root: &JsonPlace<'a>) -> Result<Vec<NodeVisit<'a>>, ScanError> {
    let scene = match (root.get("scene")?, root.get("scenes")?) {
        (Some(reference), _) => Some(root.referred("scenes", &reference)?.1),
        (None, Some(scenes)) => scenes.items()?.next(),
        (None, None) => None,
    };
    let Some(scene) = scene else {
        return orphans(root);
    };
    match scene.get("nodes")? {
        Some(nodes) => nodes
            .items()?
            .map(|node| NodeVisit::new(root, node, NodeTransform::identity()))
            .collect(),
        None => Ok(Vec::new()),
    }
}

/// The nodes that are no node's child.
fn orphans<'a>(root: &JsonPlace<'a>) -> Result<Vec<NodeVisit<'a>>, ScanError> {
    let nodes: Vec<JsonPlace<'a>> = root.need("nodes")?.items()?.collect();
    let mut child = vec![false; nodes.len()];
    for node in &nodes {
        if let Some(children) = node.get("children")? {
            for reference in children.items()? {
                let (index, _) = root.referred("nodes", &reference)?;
                child
                    .iter_mut()
                    .skip(index)
                    .take(1)
                    .for_each(|child| *child = true);
            }
        }
    }
    let steps = nodes
        .into_iter()
        .enumerate()
        .zip(child)
        .filter(|(_, child)| !child)
        .map(|((index, node), _)| NodeVisit {
            reference: node.pointer.clone(),
            index,
            node,
            parent: NodeTransform::identity(),
        });
    Ok(steps.collect())
}

/// A node's transform relative to its parent: its matrix, or translation · rotation · scale.
fn local(node: &JsonPlace<'_>) -> Result<NodeTransform, ScanError> {
    if let Some(place) = node.get("matrix")? {
        let m = place.numbers::<16>()?;
        let affine = [m[3], m[7], m[11], m[15] - 1.0]
            .iter()
            .all(|x| x.abs() < 1e-6);
        if !affine {
            return Err(place.invalid("the last row must be 0 0 0 1"));
        }
        return Ok(NodeTransform {
            linear: Matrix3::new(m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]),
            offset: Vec3::new(m[12], m[13], m[14]),
        });
    }
    let triple = |key: &str, default: [f64; 3]| {
        node.get(key)?
            .map_or(Ok(default), |place| place.numbers::<3>())
    };
    let offset = Vec3::from(triple("translation", [0.0; 3])?);
    let scale = Matrix3::from_diagonal(&Vec3::from(triple("scale", [1.0; 3])?));
    let rotation = match node.get("rotation")? {
        Some(place) => {
            let [x, y, z, w] = place.numbers::<4>()?;
            // Stored quaternions are unit only up to rounding.
            UnitQuaternion::try_new(Quaternion::new(w, x, y, z), f64::MIN_POSITIVE)
                .ok_or_else(|| place.invalid("must be a unit quaternion"))?
                .to_rotation_matrix()
                .into_inner()
        }
        None => Matrix3::identity(),
    };
    Ok(NodeTransform {
        linear: rotation * scale,
        offset,
    })
}
