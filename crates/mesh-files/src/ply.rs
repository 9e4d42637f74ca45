//! PLY, the Polygon File Format.

use std::ops::Range;

use bytes::Bytes;
use darn_budget::{Budget, Steps};

use crate::MeshFileLimits;
use crate::error::MeshFileError;
use crate::mesh::{Corner, FileMesh, LARGEST, MeshBuilder};
use crate::ply_header::{Element, Header, header};
use crate::ply_rows::RowReader;

/// Nanoseconds of work a number.
const NUMBER_WORK: u64 = 20;
/// Numbers that a list may have.
const MAX_LIST: f64 = 1_000_000.0;
/// Bytes of memory for a byte of a file.
const HELD: usize = 6;

/// A PLY file as it was read.
#[derive(Debug, Clone)]
pub struct PlyFile {
    pub bytes: Bytes,
    pub header: Header,
    /// Where the rows of each element are.
    pub rows: Vec<Range<usize>>,
    pub vertices: VertexProperties,
    pub faces: FaceProperties,
}

/// Which properties of the vertices have what is known; indices into the element's properties.
#[derive(Debug, Clone, Default)]
pub struct VertexProperties {
    /// Index of the element.
    pub element: usize,
    pub position: [usize; 3],
    pub normal: Option<[usize; 3]>,
    /// Red, green and blue.
    pub colour: Option<[usize; 3]>,
    pub alpha: Option<usize>,
    pub texcoord: Option<[usize; 2]>,
}

/// The same of the faces.
#[derive(Debug, Clone, Default)]
pub struct FaceProperties {
    /// Index of the element.
    pub element: usize,
    pub vertices: usize,
    /// u and v of each corner.
    pub texcoords: Option<usize>,
    /// The number of the texture.
    pub texture: Option<usize>,
}

impl VertexProperties {
    fn of(header: &Header) -> Option<VertexProperties> {
        let element = header.elements.iter().position(|e| e.name == "vertex")?;
        let all = &header.elements[element];
        let scalar = |names: &[&str]| {
            all.property(names)
                .filter(|k| all.properties[*k].length.is_none())
        };
        Some(VertexProperties {
            element,
            position: [scalar(&["x"])?, scalar(&["y"])?, scalar(&["z"])?],
            normal: three([scalar(&["nx"]), scalar(&["ny"]), scalar(&["nz"])]),
            colour: three([
                scalar(&["red", "diffuse_red", "r"]),
                scalar(&["green", "diffuse_green", "g"]),
                scalar(&["blue", "diffuse_blue", "b"]),
            ]),
            alpha: scalar(&["alpha", "diffuse_alpha", "a"]),
            texcoord: scalar(&["s", "u", "texture_u", "tex_u", "texcoord_u"])
                .zip(scalar(&["t", "v", "texture_v", "tex_v", "texcoord_v"]))
                .map(|(u, v)| [u, v]),
        })
    }
}

impl FaceProperties {
    fn of(header: &Header) -> Option<FaceProperties> {
        let element = header.elements.iter().position(|e| e.name == "face")?;
        let all = &header.elements[element];
        let list = |names: &[&str]| {
            all.property(names)
                .filter(|k| all.properties[*k].length.is_some())
        };
        Some(FaceProperties {
            element,
            vertices: list(&["vertex_indices", "vertex_index"])?,
            texcoords: list(&["texcoord", "texcoords"]),
            texture: all.property(&["texnumber"]),
        })
    }
}

fn three(found: [Option<usize>; 3]) -> Option<[usize; 3]> {
    match found {
        [Some(a), Some(b), Some(c)] => Some([a, b, c]),
        _ => None,
    }
}

/// Reads a PLY.
///
/// # Errors
/// See [`MeshFileError`].
pub fn read(
    bytes: Bytes,
    limits: MeshFileLimits,
    budget: &Budget<'_>,
) -> Result<(FileMesh, PlyFile), MeshFileError> {
    let header = header(&bytes)?;
    let line = bytes[..header.end]
        .iter()
        .filter(|byte| **byte == b'\n')
        .count()
        + 1;
    let vertices = VertexProperties::of(&header).ok_or_else(|| {
        MeshFileError::line(
            line,
            "the header declares no element `vertex` with x, y and z",
        )
    })?;
    let faces = FaceProperties::of(&header).ok_or_else(|| {
        let detail = "the header declares no element `face` with a list `vertex_indices`; point clouds and strips of triangles have no \
                      holes that could be mended here";
        MeshFileError::line(line, detail)
    })?;
    let count = header.elements[vertices.element].rows;
    let builder = MeshBuilder::new(limits);
    builder.check_vertices(count)?;
    budget.hold(HELD * bytes.len())?;
    let mut reader = PlyReader {
        rows: RowReader::new(&bytes, header.encoding, header.body),
        builder,
        vertices: &vertices,
        of_faces: &faces,
        vertex_count: count,
    };
    let mut rows = Vec::new();
    let mut steps = Steps::of(budget);
    for (index, element) in header.elements.iter().enumerate() {
        let start = reader.rows.at;
        reader.element(index, element, &mut steps)?;
        rows.push(start..reader.rows.at);
    }
    let mesh = reader.builder.mesh;
    let file = PlyFile {
        bytes,
        header,
        rows,
        vertices,
        faces,
    };
    Ok((mesh, file))
}

struct PlyReader<'r> {
    rows: RowReader<'r>,
    builder: MeshBuilder,
    vertices: &'r VertexProperties,
    of_faces: &'r FaceProperties,
    /// How many vertices there are, whether they come before the faces or after them.
    vertex_count: usize,
}

impl PlyReader<'_> {
    /// Reads the rows of an element.
    fn element(
        &mut self,
        index: usize,
        element: &Element,
        steps: &mut Steps,
    ) -> Result<(), MeshFileError> {
        // The numbers of a row, property after property, and where each property's start.
        let (mut numbers, mut starts) = (Vec::new(), Vec::new());
        for row in 0..element.rows {
            numbers.clear();
            starts.clear();
            for property in &element.properties {
                starts.push(numbers.len());
                let truncated = || MeshFileError::Truncated {
                    element: element.name.clone(),
                    row,
                    rows: element.rows,
                };
                let count = match property.length {
                    None => 1,
                    Some(length) => {
                        let count = self.rows.next(length).ok_or_else(truncated)?;
                        if !(0.0..=MAX_LIST).contains(&count) || count.fract() != 0.0 {
                            let detail = format!("a list has {count} numbers, of 0 to {MAX_LIST}");
                            return Err(error(element, row, detail));
                        }
                        count as u64
                    }
                };
                for _ in 0..count {
                    steps.take(NUMBER_WORK)?;
                    numbers.push(self.rows.next(property.scalar).ok_or_else(truncated)?);
                }
            }
            starts.push(numbers.len());
            // An element without properties has no rows in the file, however many it declares.
            if element.properties.is_empty() {
                return Ok(());
            }
            self.rows.end_line();
            let of = |property: usize| &numbers[starts[property]..starts[property + 1]];
            if index == self.vertices.element {
                self.vertex(element, row, of)?;
            } else if index == self.of_faces.element {
                self.face(element, row, of)?;
            }
        }
        Ok(())
    }

    fn vertex<'n>(
        &mut self,
        element: &Element,
        row: usize,
        of: impl Fn(usize) -> &'n [f64],
    ) -> Result<(), MeshFileError> {
        let (at, mesh) = (self.vertices, &mut self.builder.mesh);
        let number = |property: usize| of(property).first().copied().unwrap_or_default();
        let position = at.position.map(number);
        // So compared, NaN is none.
        if !position.iter().all(|x| x.abs() <= LARGEST) {
            let detail = format!("a coordinate is not finite or beyond {LARGEST:e}");
            return Err(error(element, row, detail));
        }
        mesh.positions.push(position);
        if let Some(normal) = at.normal {
            mesh.normals.push(normal.map(number).map(finite_or_zero));
        }
        if let Some(texcoord) = at.texcoord {
            mesh.texcoords
                .push(texcoord.map(number).map(finite_or_zero));
        }
        if let Some([r, g, b]) = at.colour {
            let share =
                |k: usize| finite_or_zero(number(k) / element.properties[k].scalar.full()) as f32;
            mesh.colours
                .push([share(r), share(g), share(b), at.alpha.map_or(1.0, share)]);
        }
        Ok(())
    }

    fn face<'n>(
        &mut self,
        element: &Element,
        row: usize,
        of: impl Fn(usize) -> &'n [f64],
    ) -> Result<(), MeshFileError> {
        let at = self.of_faces;
        let corners = of(at.vertices);
        self.builder.count_polygon(corners.len())?;
        let of_corners = at
            .texcoords
            .map(&of)
            .filter(|all| all.len() == 2 * corners.len());
        let first = self.builder.mesh.texcoords.len() as u32;
        if let Some(all) = of_corners {
            let (pairs, _) = all.as_chunks::<2>();
            self.builder
                .mesh
                .texcoords
                .extend(pairs.iter().map(|uv| uv.map(finite_or_zero)));
        }
        let corner = |(k, vertex): (usize, &f64)| {
            let is_one =
                *vertex >= 0.0 && *vertex < self.vertex_count as f64 && vertex.fract() == 0.0;
            let detail = || {
                format!(
                    "there is no vertex {vertex}; the file has {}",
                    self.vertex_count
                )
            };
            let position = is_one
                .then_some(*vertex as u32)
                .ok_or_else(|| error(element, row, detail()))?;
            Ok(Corner {
                position,
                texcoord: match of_corners {
                    Some(_) => Some(first + k as u32),
                    None => self.vertices.texcoord.map(|_| position),
                },
                normal: self.vertices.normal.map(|_| position),
            })
        };
        let corners: Vec<Corner> = corners
            .iter()
            .enumerate()
            .map(corner)
            .collect::<Result<_, MeshFileError>>()?;
        let texture = at.texture.and_then(|k| of(k).first()).map(f64::to_string);
        self.builder.push_polygon(texture.as_deref(), &corners)
    }
}

fn error(element: &Element, row: usize, detail: impl Into<String>) -> MeshFileError {
    MeshFileError::Row {
        element: element.name.clone(),
        row,
        detail: detail.into(),
    }
}

fn finite_or_zero(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}
