//! Mutates small scans of every kind that is read, and reads them: none may panic, and none may decode to more than its
//! limits allow. `scripts/fuzz` runs it.
//!
//! ```sh
//! scripts/fuzz --minutes 10 --seed 7 [--target glb|json|draco|meshopt|zip|obj|ply]
//! ```
//!
//! The same seed gives the same mutations. A scan that panics is written to the working directory as `fuzz-TARGET-SEED-RUN`.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{Cursor, Write as _};
use std::panic::catch_unwind;
use std::time::{Duration, Instant};

use darn_budget::{Budget, Limits};
use darn_gltf_scan::{Scan, ScanLimits, stripped};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

#[allow(dead_code, reason = "tests use the rest")]
#[path = "../src/compressed/encoded.rs"]
mod encoded;

use encoded::{Coding, PlainMesh};

/// What is mutated.
struct Target {
    name: &'static str,
    seeds: Vec<Vec<u8>>,
}

/// A reproducible sequence of numbers (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    let get = |name: &str, default: f64| {
        let text = options.get(name).map(|text| text.parse::<f64>());
        text.transpose().map(|number| number.unwrap_or(default))
    };
    let (minutes, seed) = (get("minutes", 1.0)?, get("seed", 1.0)? as u64);
    let only = options.get("target").map(String::as_str);
    let mut targets = targets()?;
    targets.retain(|target| only.is_none_or(|only| only == target.name));
    if targets.is_empty() {
        return Err("there is no such target".into());
    }
    let end = Instant::now() + Duration::from_secs_f64(60.0 * minutes);
    let mut numbers = Numbers(seed);
    let (mut runs, mut read, mut panics) = (0_u64, 0_u64, 0_u64);
    // At least once each, so that no minutes at all are a quick check.
    while Instant::now() < end || runs < 50 * targets.len() as u64 {
        let target = &targets[runs as usize % targets.len()];
        let bytes = mutated(&target.seeds, &mut numbers);
        runs += 1;
        match catch_unwind(|| reads(&bytes)) {
            Ok(done) => read += u64::from(done),
            Err(_) => {
                panics += 1;
                std::fs::write(format!("fuzz-{}-{seed}-{runs}", target.name), &bytes)?;
            }
        }
    }
    println!("{runs} scans, {read} of them readable, {panics} panics; seed {seed}");
    match panics {
        0 => Ok(()),
        _ => Err("a scan panics; see the files fuzz-*".into()),
    }
}

fn options() -> Result<BTreeMap<String, String>, Box<dyn Error>> {
    let mut options = BTreeMap::new();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let name = word.strip_prefix("--").ok_or("options begin with --")?;
        options.insert(
            name.to_owned(),
            words.next().ok_or("an option has a value")?,
        );
    }
    Ok(options)
}

/// Reads a scan, and writes it back if it can be read.
fn reads(bytes: &[u8]) -> bool {
    let limits = ScanLimits {
        max_vertices: 20_000,
        max_faces: 40_000,
        max_decoded_bytes: 4 << 20,
        ..ScanLimits::default()
    };
    let budget = Limits {
        memory: 256 << 20,
        ..Limits::default()
    };
    let budget = Budget::new(budget, &|| false);
    drop(stripped(bytes.to_vec(), &limits, &budget));
    let scan = Scan::read_within(bytes.to_vec(), &limits, &budget);
    scan.is_ok_and(|scan| scan.write(&[]).is_ok())
}

fn mutated(seeds: &[Vec<u8>], numbers: &mut Numbers) -> Vec<u8> {
    let mut bytes = seeds[numbers.below(seeds.len())].clone();
    for _ in 0..1 + numbers.below(6) {
        let at = numbers.below(bytes.len());
        match numbers.below(6) {
            0 => bytes[at] ^= 1 << numbers.below(8),
            1 => bytes[at] = numbers.next() as u8,
            2 => bytes[at] = [0, 0x7F, 0x80, 0xFF][numbers.below(4)],
            3 => bytes.truncate(at.max(1)),
            4 => {
                // A piece of another seed, at the same place: lengths then often agree.
                let other = &seeds[numbers.below(seeds.len())];
                let end = (at + numbers.below(64)).min(bytes.len()).min(other.len());
                if at < end {
                    bytes[at..end].copy_from_slice(&other[at..end]);
                }
            }
            _ => {
                // A digit of the JSON, where most counts and offsets stand.
                let digits: Vec<usize> = (0..bytes.len())
                    .filter(|k| bytes[*k].is_ascii_digit())
                    .collect();
                if !digits.is_empty() {
                    bytes[digits[numbers.below(digits.len())]] = b'0' + numbers.below(10) as u8;
                }
            }
        }
    }
    bytes
}

fn targets() -> Result<Vec<Target>, Box<dyn Error>> {
    let mesh = cloth();
    let of = |codings: &[Coding]| codings.iter().map(|coding| mesh.encode(*coding)).collect();
    let (json, bin) = separate(&mesh.encode(Coding::Quantized))?;
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in [("cloth.gltf", &json), ("cloth.bin", &bin)] {
        zip.start_file(name, SimpleFileOptions::default())?;
        zip.write_all(bytes)?;
    }
    let meshopt = [
        Coding::MeshoptQuantized,
        Coding::MeshoptFloat,
        Coding::MeshoptExponential,
    ];
    let draco = [Coding::DracoEdgebreaker, Coding::DracoSequential];
    Ok(vec![
        Target {
            name: "glb",
            seeds: of(&[Coding::Quantized]),
        },
        Target {
            name: "json",
            seeds: vec![json],
        },
        Target {
            name: "draco",
            seeds: of(&draco),
        },
        Target {
            name: "meshopt",
            seeds: of(&meshopt),
        },
        Target {
            name: "zip",
            seeds: vec![zip.finish()?.into_inner()],
        },
        Target {
            name: "obj",
            seeds: vec![obj(&mesh)],
        },
        Target {
            name: "ply",
            seeds: vec![ply(&mesh, false), ply(&mesh, true)],
        },
    ])
}

/// A GLB as glTF with its buffer beside it.
fn separate(glb: &[u8]) -> Result<(Vec<u8>, Vec<u8>), Box<dyn Error>> {
    let length = u32::from_le_bytes(glb[12..16].try_into()?) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&glb[20..20 + length])?;
    json["buffers"][0]["uri"] = "cloth.bin".into();
    Ok((json.to_string().into_bytes(), glb[28 + length..].to_vec()))
}

/// The mesh as OBJ, with relative indices and a mark like darn's.
fn obj(mesh: &PlainMesh) -> Vec<u8> {
    let mut text = String::from("mtllib cloth.mtl\nusemtl linen\n");
    for ([x, y, z], [u, v]) in mesh.positions.iter().zip(&mesh.texcoords) {
        text += &format!("v {x} {y} {z} 0.5 0.5 1\nvt {u} {v}\n");
    }
    let count = mesh.positions.len() as i64;
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| i64::from(v) + 1);
        text += &format!("f {a}/{a} {b}/{b} {}/{c}\n", c - count - 1);
    }
    text += "\n# darn: reconstructed cloth; without the lines from here to the end the file is as it was. Patches: 1, \
        SHA-256 of the file before: 00\nv 0 0 1\nf 1 2 -1\n# darn: end of the reconstructed cloth\n";
    text.into_bytes()
}

/// The mesh as PLY, with a property that darn does not know and a comment like darn's.
fn ply(mesh: &PlainMesh, ascii: bool) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
         element face {}\nproperty list uchar int vertex_indices\ncomment darn: reconstructed cloth, 1 patches: 0 vertices in bytes 0..0, \
         0 faces in bytes 0..0, of a body of 9, SHA-256 of the file before: 00\nend_header\n",
        if ascii { "ascii" } else { "binary_little_endian" },
        mesh.positions.len(),
        mesh.faces.len()
    )
    .into_bytes();
    for [x, y, z] in &mesh.positions {
        if ascii {
            bytes.extend(format!("{x} {y} {z} 7\n").bytes());
        } else {
            bytes.extend([x, y, z].into_iter().flat_map(|x| x.to_le_bytes()));
            bytes.push(7);
        }
    }
    for [a, b, c] in &mesh.faces {
        if ascii {
            bytes.extend(format!("3 {a} {b} {c}\n").bytes());
        } else {
            bytes.push(3);
            bytes.extend([a, b, c].into_iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    bytes
}

/// A wave of 9 × 9 vertices.
fn cloth() -> PlainMesh {
    const N: u32 = 9;
    let at = |k: u32| [(k % N) as f32 / 8.0, (k / N) as f32 / 8.0];
    let cells = (0..N * (N - 1)).filter(|k| k % N < N - 1);
    PlainMesh {
        positions: (0..N * N)
            .map(at)
            .map(|[u, v]| [u, v, 0.1 * (5.0 * u).sin()])
            .collect(),
        normals: vec![[0.0, 0.0, 1.0]; (N * N) as usize],
        texcoords: (0..N * N).map(at).collect(),
        faces: cells
            .flat_map(|k| [[k, k + 1, k + N + 1], [k, k + N + 1, k + N]])
            .collect(),
    }
}
