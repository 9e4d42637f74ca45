//! Sheets for viewing: one as a GLB, or many in one picture.

use super::lattice::SIDE;
use super::sheet::SimulatedSheet;
use darn_geometry::mesh::curvature::vertex_normals;
use darn_geometry::mesh::{TriMesh, Vec3};
use darn_gltf_scan::ScanError;
use darn_gltf_scan::export::{NewMesh, glb};
use darn_render::{CLOTH, CameraDirection, EdgeLines, Framing, PictureOptions, picture};
use image::RgbImage;

/// Pictures in a row of a contact sheet.
const COLUMNS: u32 = 4;
/// Width and height of a sheet's picture in a contact sheet.
const TILE: [u32; 2] = [480, 400];

/// The sheet as a GLB: metres, the simulation's +z as glTF's +y, texture coordinates over the unit square with v downwards.
///
/// # Errors
/// See [`glb`].
pub fn as_glb(sheet: &SimulatedSheet, name: &str) -> Result<Vec<u8>, ScanError> {
    let mesh = upright(sheet);
    let triple = |p: &Vec3| [p.x as f32, p.y as f32, p.z as f32];
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(triple).collect();
    let normals: Vec<[f32; 3]> = vertex_normals(&mesh).iter().map(triple).collect();
    let along = |k: usize| k as f32 / (SIDE - 1) as f32;
    let texcoords: Vec<[f32; 2]> = (0..positions.len())
        .map(|k| [along(k % SIDE), 1.0 - along(k / SIDE)])
        .collect();
    glb(&NewMesh {
        name,
        positions: &positions,
        normals: &normals,
        texcoords: &texcoords,
        faces: &mesh.faces,
    })
}

/// The sheets in one picture, four in a row, each seen from above at 35°.
pub fn contact_sheet(sheets: &[&SimulatedSheet]) -> RgbImage {
    let rows = (sheets.len() as u32).div_ceil(COLUMNS).max(1);
    let mut all = RgbImage::new(COLUMNS * TILE[0], rows * TILE[1]);
    let view = PictureOptions {
        size: TILE,
        direction: CameraDirection::Angles {
            azimuth: 30.0,
            elevation: 35.0,
        },
        framing: Framing::Whole,
        lines: EdgeLines::Rims,
    };
    for (place, sheet) in
        (0..rows * COLUMNS).zip(sheets.iter().map(Some).chain(std::iter::repeat(None)))
    {
        let mesh = sheet.map_or_else(TriMesh::default, |sheet| upright(sheet));
        let tile = picture(&mesh, &vec![CLOTH; mesh.faces.len()], &view);
        let corner = [place % COLUMNS * TILE[0], place / COLUMNS * TILE[1]];
        image::imageops::replace(&mut all, &tile, corner[0].into(), corner[1].into());
    }
    all
}

/// The sheet's mesh with +y up: rotated about x, not mirrored.
fn upright(sheet: &SimulatedSheet) -> TriMesh {
    let mut mesh = sheet.mesh();
    for p in &mut mesh.positions {
        *p = Vec3::new(p.x, p.z, -p.y);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_gltf_scan::{Scan, ScanLimits};

    /// A flat sheet that rises along v.
    fn ramp() -> SimulatedSheet {
        let along = |k: usize| k as f32 / (SIDE - 1) as f32;
        let at = |k: usize| {
            [
                along(k % SIDE),
                0.8 * along(k / SIDE),
                0.6 * along(k / SIDE),
            ]
        };
        SimulatedSheet {
            positions: (0..SIDE * SIDE).map(at).collect(),
        }
    }

    #[test]
    fn height_in_the_simulation_is_height_in_the_scan() {
        let scan = Scan::read(as_glb(&ramp(), "ramp").unwrap(), &ScanLimits::default()).unwrap();
        assert_eq!(scan.surface.faces.len(), 2 * (SIDE - 1) * (SIDE - 1));
        for (p, q) in scan.surface.positions.iter().zip(ramp().positions) {
            assert_eq!([p.x, p.y, p.z], [q[0], q[2], -q[1]].map(f64::from));
        }
        // Normals of the faces point up, as in the simulation.
        let normal = vertex_normals(&upright(&ramp()))[0];
        assert!(normal.y > 0.7, "{normal}");
    }

    #[test]
    fn a_contact_sheet_is_large_enough_for_all_sheets() {
        let sheet = ramp();
        assert_eq!(contact_sheet(&[&sheet; 5]).dimensions(), (1920, 800));
        assert_eq!(contact_sheet(&[]).dimensions(), (1920, 400));
    }
}
