//! Scans, a hole and a network without weights, for unit tests.

use std::sync::{Arc, LazyLock};

use crate::context::HoleContext;
use crate::hole::Hole;
use crate::inpainter::Inpainter;
use crate::mender::NetworkMender;
use crate::prepare::prepare_hole;
use crate::select::{Entry, HoleRequest};
use crate::welded_scan::WeldedScan;
use darn_budget::Budget;
use darn_contract::{Anchor, Edit, Gesture};
use darn_geometry::mesh::loops::LoopKind;
use darn_geometry::mesh::shapes::holed_sheet;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::export::{NewMesh, glb};
use darn_gltf_scan::{Scan, ScanLimits};
use darn_net::{
    AnchorLoss, AnchorProblem, ErrorModel, GridPlanes, NetError, Network, Networks, Runtime,
    TrainingCard, UnetConfig, WeightsCard,
};
use serde_json::{Value, json};

/// Where the loss of every anchor is least for [`PlateRuntime`].
pub const BEST_UV: [f32; 2] = [0.55, 0.46];

/// A network without weights: its prediction is the smooth plate that it is shown, and the loss of an anchor is the
/// squared distance from [`BEST_UV`].
#[derive(Debug)]
struct PlateRuntime;

impl PlateRuntime {
    fn loss(uv: &[f32; 2]) -> AnchorLoss {
        let off = [0, 1].map(|d| 64.0 * (uv[d] - BEST_UV[d]));
        AnchorLoss {
            loss: off[0] * off[0] + off[1] * off[1],
            gradient: off.map(|x| 2.0 * x),
        }
    }
}

impl Runtime for PlateRuntime {
    fn predict(&self, shown: &GridPlanes) -> Result<Vec<f32>, NetError> {
        Ok(shown.base.clone().expect("a plate"))
    }

    fn anchor_losses(&self, _: &AnchorProblem, uvs: &[[f32; 2]]) -> Result<Vec<f32>, NetError> {
        Ok(uvs.iter().map(|uv| Self::loss(uv).loss).collect())
    }

    fn anchor_gradients(
        &self,
        _: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        Ok(uvs.iter().map(Self::loss).collect())
    }
}

/// A mender whose network needs no weights.
pub fn mender() -> &'static Arc<NetworkMender> {
    static MENDER: LazyLock<Arc<NetworkMender>> = LazyLock::new(|| {
        let card = WeightsCard {
            name: "plate".into(),
            sha256: String::new(),
            architecture: UnetConfig::default(),
            training: TrainingCard::default(),
            scores: Default::default(),
            errors: Some(ErrorModel {
                spread: 3.0,
                roughness: 1.0,
                growth: Vec::new(),
            }),
            darn_version: String::new(),
        };
        let network = Network::of(card, Box::new(PlateRuntime), None);
        Arc::new(NetworkMender::new(Networks::new(network, Vec::new())))
    });
    &MENDER
}

/// A mesh as a scan.
pub fn scan_of(mesh: &TriMesh) -> Scan {
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.cast().into()).collect();
    let fresh = NewMesh {
        name: "cloth",
        positions: &positions,
        normals: &vec![[0.0, 0.0, 1.0]; positions.len()],
        texcoords: &[],
        faces: &mesh.faces,
    };
    let bytes = glb(&fresh).expect("a small file");
    Scan::read(bytes.clone(), &ScanLimits::default()).expect("a readable scan")
}

/// Meshes as a scan of a node each, whose origin is given: positions are stored relative to it. Those that are not finite are stored, too.
pub fn scan_of_tiles(tiles: &[(TriMesh, Vec3)]) -> Scan {
    let mut bin: Vec<u8> = Vec::new();
    let (mut views, mut accessors) = (Vec::new(), Vec::new());
    let mut stored = |bytes: Vec<u8>, mut accessor: Value| {
        views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
        bin.extend(bytes);
        accessor["bufferView"] = json!(accessors.len());
        accessors.push(accessor);
        accessors.len() - 1
    };
    let (mut meshes, mut nodes) = (Vec::new(), Vec::new());
    for (mesh, origin) in tiles {
        let each = mesh.positions.iter();
        let local: Vec<[f32; 3]> = each.map(|p| (p - origin).cast().into()).collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            [0, 1, 2].map(|k| {
                let finite = local.iter().map(|p| p[k]).filter(|x| x.is_finite());
                finite.reduce(pick).unwrap_or(0.0)
            })
        };
        let (min, max) = (bound(f32::min), bound(f32::max));
        let floats = local.iter().flatten();
        let position = stored(
            floats.flat_map(|x| x.to_le_bytes()).collect(),
            json!({"componentType": 5126, "type": "VEC3", "count": local.len(), "min": min, "max": max}),
        );
        let corners = mesh.faces.iter().flatten();
        let indices = stored(
            corners.flat_map(|v| v.to_le_bytes()).collect(),
            json!({"componentType": 5125, "type": "SCALAR", "count": 3 * mesh.faces.len()}),
        );
        nodes.push(json!({"mesh": meshes.len(), "translation": [origin.x, origin.y, origin.z]}));
        let primitive = json!({"attributes": {"POSITION": position}, "indices": indices});
        meshes.push(json!({"primitives": [primitive]}));
    }
    let document = json!({
        "asset": {"version": "2.0"}, "scene": 0,
        "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
        "nodes": nodes, "meshes": meshes, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": bin.len()}],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |number: usize| (number as u32).to_le_bytes();
    let file: [&[u8]; 9] = [
        b"glTF",
        &word(2),
        &word(28 + text.len() + bin.len()),
        &word(text.len()),
        b"JSON",
        &text,
        &word(bin.len()),
        b"BIN\0",
        &bin,
    ];
    Scan::read(file.concat(), &ScanLimits::default()).expect("a readable scan")
}

/// A round hole in a flat sheet; on the chart it is about a disk of radius ¼ in the middle.
pub fn context() -> HoleContext<'static> {
    static HOLE: LazyLock<Hole> = LazyLock::new(|| {
        let welded = WeldedScan::of(&scan_of(&holed_sheet(30, 0.15)), Budget::unlimited()).unwrap();
        let mut loops = welded.loops.iter();
        let hole = loops.find(|l| l.kind == LoopKind::Hole).expect("a hole");
        prepare_hole(&welded, hole.id.0, mender().into()).expect("cloth that lies flat")
    });
    let inpainter = Inpainter::choose(&mender().networks, None, None).expect("a network");
    HoleContext::new(&HOLE, &inpainter, mender().into()).expect("a patch")
}

/// A request with these anchors and gestures, in this order.
pub fn request(anchors: &[Anchor], gestures: &[Gesture]) -> HoleRequest {
    let edit = |gesture: &Gesture| Edit {
        hole: None,
        gesture: *gesture,
    };
    HoleRequest {
        named: true,
        id: 0,
        anchors: entries(anchors.iter().copied()),
        edits: entries(gestures.iter().map(edit)),
    }
}

fn entries<T>(values: impl Iterator<Item = T>) -> Vec<Entry<T>> {
    let entry = |(index, value)| Entry { index, value };
    values.enumerate().map(entry).collect()
}

/// Some anchor of a hole.
pub fn anchor_at(hole: Option<u32>) -> Anchor {
    Anchor {
        hole,
        uv: Some([0.5, 0.5]),
        position: [0.5, 0.5, 0.0],
        hard: false,
    }
}

/// Some gesture on a hole.
pub fn grab_at(hole: Option<u32>) -> Edit {
    let gesture = Gesture::Grab {
        uv: [0.5, 0.5],
        offset: [0.0, 0.0, 0.01],
    };
    Edit { hole, gesture }
}
