//! A PLY with patches, and without them again.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::Unpatched;
use crate::added::AddedPatch;
use crate::mesh::FileMesh;
use crate::ply::PlyFile;
use crate::ply_header::{Header, RECORD, header};
use crate::ply_rows::RowWriter;

/// What precedes the digest in darn's comment.
const DIGEST: &str = ", SHA-256 of the file before: ";

/// What darn's comment in the header says.
struct Record {
    patches: usize,
    /// How many vertices and faces were added.
    vertices: usize,
    faces: usize,
    /// Where their rows are, from the start of the body.
    vertex_rows: Range<usize>,
    face_rows: Range<usize>,
    /// Length of the body.
    body: usize,
    /// Digest of the file before.
    sha256: String,
}

impl PlyFile {
    /// The file with the patches as rows behind its vertices and faces.
    pub fn with_patches(&self, mesh: &FileMesh, patches: &[AddedPatch], sha256: &str) -> Vec<u8> {
        let (vertices, faces) = (self.vertices.element, self.faces.element);
        let rows_after = |element: usize| {
            let before = &self.bytes[..self.rows[element].end];
            RowWriter::new(before, self.header.encoding, self.header.line_break)
        };
        let (mut vertex_rows, mut face_rows) = (rows_after(vertices), rows_after(faces));
        let mut next = mesh.positions.len() as u32;
        let (first, mut face_count) = (next, 0);
        for patch in patches {
            let (numbers, new) = patch.numbered(next);
            new.iter()
                .for_each(|index| self.vertex(patch, *index, &mut vertex_rows));
            patch
                .faces
                .iter()
                .for_each(|face| self.face(patch, face, &numbers, &mut face_rows));
            next += new.len() as u32;
            face_count += patch.faces.len();
        }
        let added = BTreeMap::from([(vertices, vertex_rows.out), (faces, face_rows.out)]);
        let mut body = Vec::with_capacity(self.bytes.len());
        let mut places = BTreeMap::new();
        for (element, rows) in self.rows.iter().enumerate() {
            body.extend_from_slice(&self.bytes[rows.clone()]);
            if let Some(rows) = added.get(&element) {
                places.insert(element, body.len()..body.len() + rows.len());
                body.extend_from_slice(rows);
            }
        }
        let end = self.rows.last().map_or(self.header.body, |rows| rows.end);
        body.extend_from_slice(&self.bytes[end..]);
        let place = |element: usize| places.get(&element).cloned().unwrap_or_default();
        let record = Record {
            patches: patches.len(),
            vertices: (next - first) as usize,
            faces: face_count,
            vertex_rows: place(vertices),
            face_rows: place(faces),
            body: body.len(),
            sha256: sha256.to_owned(),
        };
        let mut out = self.header_with(&record);
        out.extend_from_slice(&body);
        out
    }

    fn header_with(&self, record: &Record) -> Vec<u8> {
        let header = &self.header;
        let more = BTreeMap::from([
            (self.vertices.element, record.vertices),
            (self.faces.element, record.faces),
        ]);
        let counts = header.elements.iter().enumerate();
        let counts = counts.map(|(k, e)| (e.count.clone(), e.rows + more.get(&k).unwrap_or(&0)));
        let mut out = with_counts(&self.bytes[..header.end], counts);
        out.extend_from_slice(format!("{}{}", record.text(), header.line_break).as_bytes());
        out.extend_from_slice(&self.bytes[header.end..header.body]);
        out
    }

    fn vertex(&self, patch: &AddedPatch, index: usize, rows: &mut RowWriter) {
        let (at, properties) = (
            &self.vertices,
            &self.header.elements[self.vertices.element].properties,
        );
        let of = |places: [usize; 3], property: usize| places.iter().position(|k| *k == property);
        let place = patch.place(index);
        rows.start_row();
        for (k, property) in properties.iter().enumerate() {
            if let Some(length) = property.length {
                // An empty list.
                rows.push(0.0, length);
                continue;
            }
            let colour = |d: usize| {
                let own = patch.colours.get(index).copied().unwrap_or([1.0; 4]);
                f64::from(own[d].clamp(0.0, 1.0)) * property.scalar.full()
            };
            let number = if let Some(d) = of(at.position, k) {
                place[d]
            } else if let Some(d) = at.normal.and_then(|places| of(places, k)) {
                patch.normals.get(index).map_or(0.0, |normal| normal[d])
            } else if let Some(d) = at.colour.and_then(|places| of(places, k)) {
                colour(d)
            } else if at.alpha == Some(k) {
                colour(3)
            } else if let Some(d) = at
                .texcoord
                .and_then(|places| places.iter().position(|p| *p == k))
            {
                patch.texcoords.get(index).map_or(0.0, |uv| uv[d])
            } else {
                0.0
            };
            rows.push(number, property.scalar);
        }
        rows.end_row();
    }

    fn face(&self, patch: &AddedPatch, face: &[u32; 3], numbers: &[u32], rows: &mut RowWriter) {
        let (at, properties) = (
            &self.faces,
            &self.header.elements[self.faces.element].properties,
        );
        rows.start_row();
        for (k, property) in properties.iter().enumerate() {
            let list: Vec<f64> = if k == at.vertices {
                face.iter()
                    .map(|p| f64::from(numbers[*p as usize]))
                    .collect()
            } else if at.texcoords == Some(k) {
                let uv = |p: &u32| patch.texcoords.get(*p as usize).copied();
                face.iter().filter_map(uv).flatten().collect()
            } else {
                Vec::new()
            };
            match property.length {
                Some(length) => {
                    rows.push(list.len() as f64, length);
                    list.iter().for_each(|x| rows.push(*x, property.scalar));
                }
                None => {
                    let texture = patch.material.as_ref().filter(|_| at.texture == Some(k));
                    let texture = texture.and_then(|number| number.parse().ok());
                    rows.push(texture.unwrap_or(0.0), property.scalar);
                }
            }
        }
        rows.end_row();
    }
}

impl Record {
    fn text(&self) -> String {
        let range = |r: &Range<usize>| format!("{}..{}", r.start, r.end);
        format!(
            "{RECORD}reconstructed cloth, {} patches: {} vertices in bytes {}, {} faces in bytes {}, of a body of {}{DIGEST}{}",
            self.patches,
            self.vertices,
            range(&self.vertex_rows),
            self.faces,
            range(&self.face_rows),
            self.body,
            self.sha256
        )
    }

    /// The record that a comment is, if it is one.
    fn of(text: &str) -> Option<Record> {
        let (numbers, sha256) = text.strip_prefix(RECORD)?.split_once(DIGEST)?;
        let numbers: Option<Vec<usize>> = numbers
            .split(|c: char| !c.is_ascii_digit())
            .filter(|word| !word.is_empty())
            .map(|word| word.parse().ok())
            .collect();
        let [patches, vertices, a, b, faces, c, d, body] = numbers?[..] else {
            return None;
        };
        let record = Record {
            patches,
            vertices,
            faces,
            vertex_rows: a..b,
            face_rows: c..d,
            body,
            sha256: sha256.to_owned(),
        };
        (record.text() == text).then_some(record)
    }
}

/// A header's text with other numbers of rows.
fn with_counts(text: &[u8], counts: impl Iterator<Item = (Range<usize>, usize)>) -> Vec<u8> {
    let mut out = Vec::with_capacity(text.len() + 200);
    let mut from = 0;
    for (place, count) in counts {
        out.extend_from_slice(&text[from..place.start]);
        out.extend_from_slice(count.to_string().as_bytes());
        from = place.end;
    }
    out.extend_from_slice(&text[from..]);
    out
}

/// The file without what darn's last comment records; `None` without a comment, or when the file does not have the length
/// that it records.
pub fn without_patches(bytes: &[u8]) -> Option<Unpatched> {
    let header: Header = header(bytes).ok()?;
    let (text, line) = header.records.last()?;
    let record = Record::of(text)?;
    let body = bytes.get(header.body..)?;
    if body.len() != record.body {
        return None;
    }
    let less = |name: &str, count: usize| match name {
        "vertex" => count.checked_sub(record.vertices),
        "face" => count.checked_sub(record.faces),
        _ => Some(count),
    };
    let mut counts = Vec::new();
    for element in &header.elements {
        counts.push((element.count.clone(), less(&element.name, element.rows)?));
    }
    let mut out = with_counts(bytes.get(..line.start)?, counts.into_iter());
    out.extend_from_slice(bytes.get(line.end..header.body)?);
    let mut cuts = [record.vertex_rows.clone(), record.face_rows.clone()];
    cuts.sort_by_key(|cut| cut.start);
    let [first, second] = cuts;
    out.extend_from_slice(body.get(..first.start)?);
    out.extend_from_slice(body.get(first.end..second.start)?);
    out.extend_from_slice(body.get(second.end..)?);
    Some(Unpatched {
        bytes: out,
        patches: record.patches,
        sha256: record.sha256,
    })
}
