//! Wavefront OBJ.

use bytes::Bytes;
use darn_budget::{Budget, Steps};

use crate::added::AddedPatch;
use crate::error::MeshFileError;
use crate::mesh::{Corner, FileMesh, LARGEST, MeshBuilder};
use crate::text::{decimals, finite, number, shown, words};
use crate::{MeshFileLimits, Unpatched};

/// First words of the lines of an OBJ.
const KEYWORDS: [&[u8]; 15] = [
    b"v", b"vt", b"vn", b"vp", b"f", b"o", b"g", b"s", b"l", b"p", b"mtllib", b"usemtl", b"mg",
    b"usemap", b"maplib",
];
/// Bytes of a file that are looked at to tell whether it is an OBJ.
const LOOKED_AT: usize = 4096;
/// Nanoseconds of work a byte.
const BYTE_WORK: u64 = 20;
/// Bytes of memory for a byte of a file: `f 1 1 1` is a triangle.
const HELD: usize = 6;
/// The first line of what darn adds, up to the number of patches.
const BEGIN: &str = "# darn: reconstructed cloth; without the lines from here to the end the file is as it was. Patches: ";
/// What precedes the digest in that line.
const DIGEST: &str = ", SHA-256 of the file before: ";
/// The last line of it.
const END: &str = "# darn: end of the reconstructed cloth";

/// An OBJ file as it was read.
#[derive(Debug, Clone)]
pub struct ObjFile {
    pub bytes: Bytes,
    /// The material that is in use at the end.
    last_material: Option<String>,
}

/// Whether the first line that is no comment begins as one of an OBJ, and all of the first bytes are text.
pub fn looks_like_one(bytes: &[u8]) -> bool {
    let head = bytes.get(..LOOKED_AT).unwrap_or(bytes);
    let head = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head);
    if head.contains(&0) {
        return false;
    }
    let lines = head.split(|byte| matches!(byte, b'\n' | b'\r'));
    let mut said = lines
        .map(<[u8]>::trim_ascii)
        .filter(|line| !line.is_empty() && !line.starts_with(b"#"));
    // A word alone is no evidence: `g` may be the start of anything.
    said.next().is_some_and(|line| {
        let mut words = words(line);
        words.next().is_some_and(|word| KEYWORDS.contains(&word)) && words.next().is_some()
    })
}

/// Reads an OBJ.
///
/// # Errors
/// See [`MeshFileError`].
pub fn read(
    bytes: Bytes,
    limits: MeshFileLimits,
    budget: &Budget<'_>,
) -> Result<(FileMesh, ObjFile), MeshFileError> {
    let mut reader = ObjReader {
        builder: MeshBuilder::new(limits),
        material: None,
        line: 0,
    };
    budget.hold(HELD * bytes.len())?;
    let mut steps = Steps::of(budget);
    let mut joined = Vec::new();
    for line in bytes.split(|byte| *byte == b'\n') {
        steps.take(BYTE_WORK * line.len() as u64)?;
        reader.line += 1;
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        // A line that ends in a backslash goes on in the next one.
        if let Some(part) = line.strip_suffix(b"\\") {
            joined.extend_from_slice(part);
            joined.push(b' ');
        } else if joined.is_empty() {
            reader.read(line)?;
        } else {
            joined.extend_from_slice(line);
            reader.read(&std::mem::take(&mut joined))?;
        }
    }
    let mut mesh = reader.builder.mesh;
    // Colours count where every vertex has one.
    if mesh.colours.len() != mesh.positions.len() {
        mesh.colours.clear();
    }
    let file = ObjFile {
        bytes,
        last_material: reader.material,
    };
    Ok((mesh, file))
}

struct ObjReader {
    builder: MeshBuilder,
    /// The material in use.
    material: Option<String>,
    line: usize,
}

impl ObjReader {
    fn read(&mut self, line: &[u8]) -> Result<(), MeshFileError> {
        let mut words = words(line);
        match words.next() {
            Some(b"v") => self.vertex(words),
            Some(b"vt") => {
                let [u, v] = self.numbers(&mut words, 1)?;
                self.builder.mesh.texcoords.push([u, v]);
                Ok(())
            }
            Some(b"vn") => {
                let normal = self.numbers(&mut words, 3)?;
                self.builder.mesh.normals.push(normal);
                Ok(())
            }
            Some(b"f" | b"fo") => self.face(words),
            Some(b"usemtl") => {
                let name = line.trim_ascii().get(b"usemtl".len()..).unwrap_or_default();
                let name = String::from_utf8_lossy(name.trim_ascii());
                self.material = Some(name.into_owned());
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn error(&self, detail: impl Into<String>) -> MeshFileError {
        MeshFileError::line(self.line, detail)
    }

    /// The next N numbers, of which `least` must be there; the others are 0.
    fn numbers<'l, const N: usize>(
        &self,
        words: &mut impl Iterator<Item = &'l [u8]>,
        least: usize,
    ) -> Result<[f64; N], MeshFileError> {
        let mut numbers = [0.0; N];
        for (k, slot) in numbers.iter_mut().enumerate() {
            match words.next() {
                Some(word) => {
                    let wrong = || self.error(format!("{} is no finite number", shown(word)));
                    *slot = finite(word).ok_or_else(wrong)?;
                }
                None if k < least => {
                    return Err(self.error(format!("has {k} of at least {least} numbers")));
                }
                None => break,
            }
        }
        Ok(numbers)
    }

    /// `v x y z`, `v x y z w`, `v x y z r g b` or `v x y z r g b a`.
    fn vertex<'l>(
        &mut self,
        mut words: impl Iterator<Item = &'l [u8]>,
    ) -> Result<(), MeshFileError> {
        self.builder
            .check_vertices(self.builder.mesh.positions.len() + 1)?;
        let position: [f64; 3] = self.numbers(&mut words, 3)?;
        if let Some(far) = position.iter().find(|x| x.abs() > LARGEST) {
            return Err(self.error(format!("{far:e} is beyond {LARGEST:e}")));
        }
        self.builder.mesh.positions.push(position);
        let rest: Vec<&[u8]> = words.take(5).collect();
        if rest.len() >= 3 {
            let [r, g, b, a] = self.numbers(&mut rest.iter().copied(), 3)?;
            let alpha = if rest.len() > 3 { a } else { 1.0 };
            self.builder
                .mesh
                .colours
                .push([r, g, b, alpha].map(|x: f64| x as f32));
        }
        Ok(())
    }

    fn face<'l>(&mut self, words: impl Iterator<Item = &'l [u8]>) -> Result<(), MeshFileError> {
        let words = words.take_while(|word| !word.starts_with(b"#"));
        // One more than may be is enough to say so.
        let most = self.builder.too_many_corners();
        let corners = words.take(most).map(|word| self.corner(word));
        let corners: Vec<Corner> = corners.collect::<Result<_, _>>()?;
        if corners.len() < 3 {
            let detail = format!("a face has {} corners; it needs three", corners.len());
            return Err(self.error(detail));
        }
        self.builder.count_polygon(corners.len())?;
        self.builder
            .push_polygon(self.material.as_deref(), &corners)
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&self, word: &[u8]) -> Result<Corner, MeshFileError> {
        let mut parts = word.split(|byte| *byte == b'/');
        let mut index = |name: &str, count: usize| match parts.next() {
            None | Some(b"") => Ok(None),
            Some(part) => {
                let wrong = |detail: String| self.error(format!("{}: {detail}", shown(word)));
                let Some(index) = number::<i64>(part) else {
                    return Err(wrong(format!("{} is no index", shown(part))));
                };
                // Positive ones count from 1, negative ones back from the last.
                let from_zero = match index {
                    0.. => index - 1,
                    _ => count as i64 + index,
                };
                match u32::try_from(from_zero) {
                    Ok(at) if (at as usize) < count => Ok(Some(at)),
                    _ => Err(wrong(format!(
                        "there is no {name} {index}; {count} come before"
                    ))),
                }
            }
        };
        let position = index("v", self.builder.mesh.positions.len())?;
        let texcoord = index("vt", self.builder.mesh.texcoords.len())?;
        let normal = index("vn", self.builder.mesh.normals.len())?;
        let position = position.ok_or_else(|| self.error(format!("{} names no v", shown(word))))?;
        Ok(Corner {
            position,
            texcoord,
            normal,
        })
    }
}

impl ObjFile {
    /// The file with the patches as lines at its end.
    pub fn with_patches(&self, mesh: &FileMesh, patches: &[AddedPatch], sha256: &str) -> Vec<u8> {
        let mut out = self.bytes.to_vec();
        // The file's last line may have no end. This line break is the block's, and goes when the block goes.
        let mut writer = ObjWriter {
            vertices: mesh.positions.len() as u32,
            texcoords: mesh.texcoords.len(),
            normals: mesh.normals.len(),
            decimals: decimals(mesh.extent()),
            has_colours: !mesh.colours.is_empty(),
            material: self.last_material.clone(),
            out: String::new(),
        };
        writer.line(format_args!(""));
        writer.line(format_args!("{BEGIN}{}{DIGEST}{sha256}", patches.len()));
        for patch in patches {
            writer.patch(patch);
        }
        writer.line(format_args!("{END}"));
        out.extend_from_slice(writer.out.as_bytes());
        out
    }
}

struct ObjWriter {
    /// How many vertices there are.
    vertices: u32,
    texcoords: usize,
    normals: usize,
    decimals: usize,
    has_colours: bool,
    /// The material in use.
    material: Option<String>,
    out: String,
}

impl ObjWriter {
    fn line(&mut self, line: std::fmt::Arguments<'_>) {
        use std::fmt::Write as _;
        // Writing to a string does not fail.
        writeln!(self.out, "{line}").ok();
    }

    fn patch(&mut self, patch: &AddedPatch) {
        self.line(format_args!("g {}", patch.name));
        if let Some(material) = &patch.material
            && self.material.as_ref() != Some(material)
        {
            self.line(format_args!("usemtl {material}"));
            self.material = Some(material.clone());
        }
        let (numbers, new) = patch.numbered(self.vertices);
        let decimals = self.decimals;
        for &index in &new {
            let [x, y, z] = patch.place(index);
            match patch.colours.get(index) {
                Some([r, g, b, _]) if self.has_colours => self.line(format_args!(
                    "v {x:.decimals$} {y:.decimals$} {z:.decimals$} {r:.6} {g:.6} {b:.6}"
                )),
                _ => self.line(format_args!(
                    "v {x:.decimals$} {y:.decimals$} {z:.decimals$}"
                )),
            }
        }
        for [u, v] in &patch.texcoords {
            self.line(format_args!("vt {u:.7} {v:.7}"));
        }
        for [x, y, z] in &patch.normals {
            self.line(format_args!("vn {x:.6} {y:.6} {z:.6}"));
        }
        let (texcoords, normals) = (self.texcoords + 1, self.normals + 1);
        for face in &patch.faces {
            let corners = face.map(|point| {
                let vertex = numbers[point as usize] + 1;
                let (vt, vn) = (texcoords + point as usize, normals + point as usize);
                match (patch.texcoords.is_empty(), patch.normals.is_empty()) {
                    (true, true) => format!("{vertex}"),
                    (false, true) => format!("{vertex}/{vt}"),
                    (true, false) => format!("{vertex}//{vn}"),
                    (false, false) => format!("{vertex}/{vt}/{vn}"),
                }
            });
            self.line(format_args!("f {}", corners.join(" ")));
        }
        self.vertices += new.len() as u32;
        self.texcoords += patch.texcoords.len();
        self.normals += patch.normals.len();
    }
}

/// The file without the last block of lines that darn added, if it ends with one.
pub fn without_patches(bytes: &[u8]) -> Option<Unpatched> {
    bytes.strip_suffix(format!("{END}\n").as_bytes())?;
    let mark = format!("\n{BEGIN}");
    let at = bytes
        .windows(mark.len())
        .rposition(|window| window == mark.as_bytes())?;
    let said = bytes.get(at + mark.len()..)?;
    let said = std::str::from_utf8(said.split(|byte| *byte == b'\n').next()?).ok()?;
    let (patches, sha256) = said.split_once(DIGEST)?;
    Some(Unpatched {
        bytes: bytes.get(..at)?.to_vec(),
        patches: patches.parse().ok()?,
        sha256: sha256.to_owned(),
    })
}
