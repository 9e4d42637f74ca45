//! Scans that are OBJ or PLY meshes: read as a glTF with the same triangles, and written in their own format.

use std::collections::HashMap;
use std::sync::Arc;

use bytes::Bytes;
use darn_budget::Budget;
use darn_geometry::mesh::Vec3;
use darn_mesh_files::{
    AddedPatch, AddedPoint, Corner, FaceGroup, FileMesh, MeshFile, MeshFileError, MeshFileLimits,
    MeshFormat, without_patches,
};
use serde_json::{Value, json};

use super::compressed::DecodeAllowance;
use super::container::{Container, float_bytes, pack_glb};
use super::content::SceneContent;
use super::digests::FileDigests;
use super::error::ScanError;
use super::files::{Companions, Siblings};
use super::patch_primitive::{PatchPoint, PatchPrimitive};
use super::read::read_files;
use super::scan::Scan;
use super::strip::Stripped;
use super::unmarked::Marks;

/// The mesh file that a scan was read from.
#[derive(Debug)]
pub(crate) struct MeshOrigin {
    file: MeshFile,
    /// Per vertex of the scan's surface its number in the file.
    vertex_of: Vec<u32>,
}

impl MeshOrigin {
    /// The file's bytes.
    pub fn bytes(&self) -> &Bytes {
        self.file.bytes()
    }

    /// The container of scans like it that are one file.
    pub fn container(&self) -> Container {
        mesh_container(self.file.format())
    }

    /// Bytes of memory that it holds, estimated.
    pub fn bytes_held(&self) -> usize {
        let mesh = self.file.mesh();
        let faces: usize = mesh.groups.iter().map(|group| group.faces.len()).sum();
        self.bytes().len()
            + 24 * (mesh.positions.len() + mesh.normals.len())
            + 16 * (mesh.colours.len() + mesh.texcoords.len())
            + size_of::<[Corner; 3]>() * faces
            + 4 * self.vertex_of.len()
    }

    /// The file with the patches of a scan that was read from it.
    pub fn with_patches(&self, scan: &Scan, patches: &[PatchPrimitive]) -> Vec<u8> {
        let added: Vec<AddedPatch> = patches
            .iter()
            .map(|patch| self.added(scan, patch))
            .collect();
        self.file.with_patches(&added, &scan.digests().sha256)
    }

    fn added(&self, scan: &Scan, patch: &PatchPrimitive) -> AddedPatch {
        let point = |point: &PatchPoint| match point {
            PatchPoint::New(place) => AddedPoint::New((*place).into()),
            PatchPoint::Scan(vertex) => AddedPoint::Old(self.vertex_of[*vertex as usize]),
        };
        let has_normals = scan.parts[patch.part].normals.is_some();
        let normal = |n: &Vec3| n.try_normalize(0.0).unwrap_or_else(Vec3::z).into();
        let normals = patch.normals.iter().filter(|_| has_normals);
        let group = scan.parts[patch.material_of].primitive;
        let back = patch.faces.iter().filter(|_| patch.both_sides);
        let back = back.map(|[a, b, c]| [*c, *b, *a]);
        AddedPatch {
            name: patch.name.replace(['\n', '\r'], " "),
            material: (self.file.mesh().groups.get(group)).and_then(|group| group.material.clone()),
            points: patch.points.iter().map(point).collect(),
            normals: normals.map(normal).collect(),
            texcoords: (patch.texcoords.first().into_iter().flatten())
                .map(|[u, v]| [f64::from(*u), 1.0 - f64::from(*v)])
                .collect(),
            colours: patch.colors.first().cloned().unwrap_or_default(),
            faces: patch.faces.iter().copied().chain(back).collect(),
        }
    }
}

/// The container of a mesh file.
pub(super) fn mesh_container(format: MeshFormat) -> Container {
    match format {
        MeshFormat::Obj => Container::Obj,
        MeshFormat::Ply => Container::Ply,
    }
}

/// Bytes of memory a triangle while a mesh becomes a glTF: each of its corners may be a vertex of its own.
const CONVERTED: usize = 350;
/// Nanoseconds of work a triangle of that.
const FACE_WORK: u64 = 500;

/// Reads a scan from a mesh file, which came alone, with files beside it, or in a zip.
///
/// # Errors
/// [`ScanError::MeshFile`]; `Exhausted`.
pub(super) fn read_mesh_file(
    bytes: Bytes,
    format: MeshFormat,
    companions: Companions,
    allowance: DecodeAllowance<'_>,
) -> Result<Scan, ScanError> {
    let limits = MeshFileLimits {
        max_vertices: allowance.limits.max_vertices,
        max_faces: allowance.limits.max_faces,
        max_materials: allowance.limits.max_primitives,
    };
    let budget = allowance.budget;
    let file = MeshFile::read(bytes, format, limits, budget)?;
    let mesh = file.mesh();
    if mesh.groups.is_empty() {
        let content = SceneContent::default();
        return Err(ScanError::NoTriangles { content });
    }
    let faces: usize = mesh.groups.iter().map(|group| group.faces.len()).sum();
    budget.hold(CONVERTED * faces)?;
    budget.spend_at_once(FACE_WORK * faces as u64)?;
    let as_gltf = MeshAsGltf::of(mesh).ok_or(MeshFileError::Limit {
        what: "bytes as a glTF",
        limit: "GLB length",
        allowed: u32::MAX as usize,
        found: u32::MAX as usize,
    })?;
    budget.release(CONVERTED * faces);
    budget.hold(as_gltf.glb.len())?;
    let alone = Companions::Siblings(Siblings::default());
    let mut scan = read_files(as_gltf.glb.into(), alone, allowance)?;
    scan.companions = companions;
    // The file has more digits than a glTF.
    for (position, vertex) in scan.surface.positions.iter_mut().zip(&as_gltf.vertex_of) {
        *position = mesh.positions[*vertex as usize].into();
    }
    let origin = MeshOrigin {
        vertex_of: as_gltf.vertex_of,
        file,
    };
    budget.hold(origin.bytes_held())?;
    scan.origin = Some(Arc::new(origin));
    Ok(scan)
}

/// A mesh as a GLB with one mesh, and a primitive for each material.
struct MeshAsGltf {
    glb: Vec<u8>,
    /// Per vertex of the GLB, primitive after primitive, its number in the file.
    vertex_of: Vec<u32>,
}

impl MeshAsGltf {
    /// `None` when it would exceed the length of a GLB.
    fn of(mesh: &FileMesh) -> Option<MeshAsGltf> {
        let bound = |pick: fn(f64, f64) -> f64, d: usize| {
            let along = mesh.positions.iter().map(|p| p[d]);
            along.reduce(pick).unwrap_or_default()
        };
        // Coordinates far from the origin (of a map, of a scanner's room) keep their digits.
        let middle = [0, 1, 2].map(|d| 0.5 * bound(f64::min, d) + 0.5 * bound(f64::max, d));
        let mut out = GltfBuilder::default();
        let primitives = mesh.groups.iter().enumerate();
        let primitives: Vec<Value> = primitives
            .map(|(k, group)| out.primitive(mesh, group, middle, k))
            .collect();
        let materials = mesh.groups.iter().map(|group| match &group.material {
            Some(name) => json!({"name": name, "doubleSided": true}),
            None => json!({"doubleSided": true}),
        });
        let document = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "translation": middle}],
            "meshes": [{"primitives": primitives}],
            "materials": materials.collect::<Vec<_>>(),
            "accessors": out.accessors,
            "bufferViews": out.views,
            "buffers": [{"byteLength": out.bin.len()}],
        });
        Some(MeshAsGltf {
            glb: pack_glb(document.to_string().as_bytes(), Some(&out.bin), &[])?,
            vertex_of: out.vertex_of,
        })
    }
}

#[derive(Default)]
struct GltfBuilder {
    /// Per position the last group that has a corner there, and the number of the group's first.
    first_at: Vec<(usize, u32)>,
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    vertex_of: Vec<u32>,
}

impl GltfBuilder {
    /// A primitive whose vertices are the distinct corners of the group's faces, in the order of their first use.
    fn primitive(
        &mut self,
        mesh: &FileMesh,
        group: &FaceGroup,
        middle: [f64; 3],
        material: usize,
    ) -> Value {
        // Most positions have one corner: the first of a group is found by its position alone.
        self.first_at.resize(mesh.positions.len(), (usize::MAX, 0));
        let mut others: HashMap<Corner, u32> = HashMap::new();
        let mut corners: Vec<Corner> = Vec::new();
        let mut indices = Vec::with_capacity(12 * group.faces.len());
        for corner in group.faces.iter().flatten() {
            let next = corners.len() as u32;
            let (of, first) = &mut self.first_at[corner.position as usize];
            let number = if *of != material {
                (*of, *first) = (material, next);
                next
            } else if corners[*first as usize] == *corner {
                *first
            } else {
                *others.entry(*corner).or_insert(next)
            };
            if number == next {
                corners.push(*corner);
            }
            indices.extend_from_slice(&number.to_le_bytes());
        }
        drop(others);
        self.vertex_of.extend(corners.iter().map(|c| c.position));
        let count = corners.len();
        let place = |c: &Corner| {
            let place = mesh.positions[c.position as usize];
            [0, 1, 2].map(|d| (place[d] - middle[d]) as f32)
        };
        let positions: Vec<[f32; 3]> = corners.iter().map(place).collect();
        let mut attributes = json!({});
        attributes["POSITION"] = self.push(&float_bytes(&positions), 5126, "VEC3", count);
        let normals = corners.iter().map(|c| {
            let normal = *mesh.normals.get(c.normal? as usize)?;
            Some(normal.map(|x| x as f32))
        });
        if let Some(normals) = normals.collect::<Option<Vec<_>>>() {
            attributes["NORMAL"] = self.push(&float_bytes(&normals), 5126, "VEC3", count);
        }
        let texcoords = corners.iter().map(|c| {
            let [u, v] = *mesh.texcoords.get(c.texcoord? as usize)?;
            // glTF's v runs downwards.
            Some([u as f32, (1.0 - v) as f32])
        });
        if let Some(texcoords) = texcoords.collect::<Option<Vec<_>>>() {
            attributes["TEXCOORD_0"] = self.push(&float_bytes(&texcoords), 5126, "VEC2", count);
        }
        let colours = corners
            .iter()
            .map(|c| mesh.colours.get(c.position as usize).copied());
        if let Some(colours) = colours.collect::<Option<Vec<_>>>() {
            attributes["COLOR_0"] = self.push(&float_bytes(&colours), 5126, "VEC4", count);
        }
        let indices = self.push(&indices, 5125, "SCALAR", indices.len() / 4);
        json!({"attributes": attributes, "indices": indices, "material": material})
    }

    /// Appends an accessor with a buffer view of its own; returns its index.
    fn push(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> Value {
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend_from_slice(bytes);
        self.accessors.push(json!({
            "bufferView": self.views.len(), "componentType": component, "type": kind, "count": count,
        }));
        self.views.push(view);
        json!(self.accessors.len() - 1)
    }
}

/// Nanoseconds of work a byte of a file for each mend that is undone.
const BYTE_WORK: u64 = 10;

/// A mesh file without the patches of all mends. `None` if it has none.
///
/// # Errors
/// `Exhausted`.
pub(super) fn stripped_mesh_file(
    bytes: Bytes,
    format: MeshFormat,
    budget: &Budget<'_>,
) -> Result<Option<Stripped>, ScanError> {
    let input = FileDigests::of(&bytes);
    let (mut output, mut bytes) = (input.clone(), bytes.to_vec());
    let (mut mends, mut marks, mut exact) = (0, Marks::default(), true);
    loop {
        budget.spend_at_once(BYTE_WORK * bytes.len() as u64)?;
        let Some(before) = without_patches(&bytes, format) else {
            break;
        };
        mends += 1;
        marks.patches += before.patches;
        bytes = before.bytes;
        output = FileDigests::of(&bytes);
        exact &= output.sha256 == before.sha256;
    }
    let changed =
        "the file was changed after darn mended it; the patches were taken out of what it is now";
    Ok((mends > 0).then(|| Stripped {
        bytes,
        container: mesh_container(format),
        exact,
        mends,
        marks,
        notes: (!exact).then(|| changed.to_owned()).into_iter().collect(),
        input,
        output,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ScanLimits, stripped};

    /// A square of two materials with a corner missing, far from the origin.
    const OBJ: &str = "mtllib a.mtl\nv 500000.125 0 7\nv 500001.25 0 7\nv 500001.25 1 7\nv 500000.125 1 7\nv 500002 1 7\n\
        vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl linen\nf 1/1 2/2 3/3 4/4\nusemtl silk\nf 2 5 3\n";

    fn read(bytes: &[u8]) -> Scan {
        Scan::read(bytes.to_vec(), &ScanLimits::default()).unwrap()
    }

    fn patch(scan: &Scan) -> PatchPrimitive {
        let mut hole = serde_json::Map::new();
        hole.insert("id".into(), json!(0));
        PatchPrimitive {
            part: 0,
            material_of: 0,
            points: vec![
                PatchPoint::Scan(0),
                PatchPoint::Scan(1),
                PatchPoint::New(Vec3::new(500000.5, -0.5, 7.0)),
            ],
            faces: vec![[1, 0, 2]],
            both_sides: false,
            normals: vec![Vec3::z(); 3],
            tangents: Vec::new(),
            texcoords: vec![vec![[0.25, 0.75]; 3]; scan.parts[0].texcoords.len()],
            colors: Vec::new(),
            appearance: super::super::PatchAppearance::Continued,
            name: "darn reconstruction, hole 0".into(),
            deviations: Vec::new(),
            hole,
            method: serde_json::Map::new(),
        }
    }

    #[test]
    fn an_obj_is_read_with_its_own_digits_and_written_as_it_was() {
        let scan = read(OBJ.as_bytes());
        assert_eq!(scan.container(), Container::Obj);
        assert_eq!(scan.surface.faces.len(), 3);
        assert_eq!(scan.surface.positions[0], Vec3::new(500000.125, 0.0, 7.0));
        assert_eq!(scan.parts.len(), 2);
        assert_eq!(scan.write(&[]).unwrap(), OBJ.as_bytes());
        let mended = scan.write(&[patch(&scan)]).unwrap();
        let text = String::from_utf8(mended.clone()).unwrap();
        let added = text.strip_prefix(OBJ).expect("all that was there");
        let lines = "g darn reconstruction, hole 0\nusemtl linen\nv 500000.5000000 -0.5000000 7.0000000\nvt 0.2500000 0.2500000\n";
        assert!(added.contains(lines), "{added}");
        assert!(added.contains("\nf 2/6 1/5 6/7\n"), "{added}");
        assert_eq!(read(&mended).surface.faces.len(), 4);
        let stripped = stripped(mended, &ScanLimits::default(), Budget::unlimited())
            .unwrap()
            .unwrap();
        assert!(stripped.exact && stripped.mends == 1 && stripped.marks.patches == 1);
        assert_eq!(stripped.bytes, OBJ.as_bytes());
        assert_eq!(stripped.output, *scan.digests());
    }

    #[test]
    fn a_mesh_file_that_was_changed_is_stripped_and_that_is_said() {
        let scan = read(OBJ.as_bytes());
        let mended = String::from_utf8(scan.write(&[patch(&scan)]).unwrap()).unwrap();
        let changed = mended.replacen("v 500002 1 7", "v 500003 1 7", 1);
        let found = stripped(changed, &ScanLimits::default(), Budget::unlimited())
            .unwrap()
            .unwrap();
        assert!(!found.exact);
        assert_eq!(found.notes.len(), 1);
        assert_eq!(
            found.bytes,
            OBJ.replacen("v 500002 1 7", "v 500003 1 7", 1).as_bytes()
        );
        assert!(
            stripped(OBJ, &ScanLimits::default(), Budget::unlimited())
                .unwrap()
                .is_none()
        );
    }

    #[test]
    fn mistakes_and_limits_of_mesh_files_are_named() {
        let error =
            |text: &'static str| Scan::read(text.as_bytes(), &ScanLimits::default()).unwrap_err();
        assert_eq!(
            error("v 0 0 0\nf 1 2 3\n").to_string(),
            "line 2: \"2\": there is no v 2; 1 come before"
        );
        assert!(matches!(
            error("v 0 0 0\nl 1 1\n"),
            ScanError::NoTriangles { .. }
        ));
        let limits = ScanLimits {
            max_vertices: 2,
            ..ScanLimits::default()
        };
        let error = Scan::read(OBJ.as_bytes(), &limits).unwrap_err().to_string();
        assert_eq!(error, "the file has 3 vertices; the limit max_vertices = 2");
    }
}
