//! Mutates small scans of every kind that is read, and reads them: none may panic, and none may decode to more than its
//! limits allow. `scripts/fuzz` runs it.
//!
//! ```sh
//! scripts/fuzz --minutes 10 --seed 7 [--target glb|json|draco|meshopt|zip|obj|ply]
//! ```
//!
//! The same seed gives the same mutations. A scan that fails is written to the working directory as `fuzz-TARGET-SEED-RUN`. A target of
//! which nothing can be read fails, too: it would test the first check alone.

mod seeds;

use std::any::Any;
use std::collections::BTreeMap;
use std::error::Error;
use std::panic::catch_unwind;
use std::time::{Duration, Instant};

use darn_budget::{Budget, Limits};
use darn_gltf_scan::{Scan, ScanLimits, stripped};
use seeds::{Seed, Target, targets};

/// Most bytes of memory that the process may ever have: those of one budget, the seeds and the program.
const MOST_RESIDENT: usize = 448 << 20;

/// A reproducible sequence of numbers (SplitMix64).
struct Numbers(u64);

/// What became of a target's scans.
#[derive(Default)]
struct Tally {
    runs: u64,
    read: u64,
    failures: u64,
}

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
    let mut tallies: BTreeMap<&str, Tally> = BTreeMap::new();
    let mut runs = 0;
    // At least some of each, so that no minutes at all are a quick check.
    while Instant::now() < end || runs < 200 * targets.len() {
        let target = &targets[runs % targets.len()];
        runs += 1;
        let tally = tallies.entry(target.name).or_default();
        tally.runs += 1;
        match run(target, &mut numbers) {
            Ok(read) => tally.read += u64::from(read),
            Err((bytes, why)) => {
                tally.failures += 1;
                eprintln!("{}, run {runs}: {why}", target.name);
                std::fs::write(format!("fuzz-{}-{seed}-{runs}", target.name), &bytes)?;
            }
        }
    }
    for (name, tally) in &tallies {
        println!(
            "{name}: {} scans, {} of them readable, {} failures; seed {seed}",
            tally.runs, tally.read, tally.failures
        );
    }
    if tallies.values().any(|tally| tally.failures > 0) {
        return Err("a scan fails; see the files fuzz-*".into());
    }
    match tallies.iter().find(|(_, tally)| tally.read == 0) {
        Some((name, _)) => Err(format!("{name}: not one scan is readable").into()),
        None => Ok(()),
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

/// Reads a mutated scan of a target: whether that went, else the scan and what is wrong.
fn run(target: &Target, numbers: &mut Numbers) -> Result<bool, (Vec<u8>, String)> {
    let chosen = numbers.below(target.seeds.len());
    let bytes = mutated(&target.seeds, chosen, numbers);
    let seed = Seed {
        bytes: bytes.clone(),
        siblings: target.seeds[chosen].siblings.clone(),
    };
    match catch_unwind(|| reads(seed)) {
        Ok(Ok(read)) => Ok(read),
        Ok(Err(why)) => Err((bytes, why)),
        Err(panic) => Err((bytes, format!("panics: {}", said(panic.as_ref())))),
    }
}

/// What a panic says.
fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("")
}

/// Reads a scan, and writes it back if it can be read; whether it can. An error is a limit that does not hold.
fn reads(seed: Seed) -> Result<bool, String> {
    let limits = ScanLimits {
        max_vertices: 20_000,
        max_faces: 40_000,
        max_attribute_values: 200_000,
        max_decoded_bytes: 4 << 20,
        max_image_texels: 1 << 16,
        ..ScanLimits::default()
    };
    let memory = 256 << 20;
    let most = Limits {
        memory,
        ..Limits::default()
    };
    let budget = Budget::new(most.clone(), &|| false);
    drop(stripped(seed.bytes.clone(), &limits, &budget));
    let budget = Budget::new(most, &|| false);
    let length = seed.bytes.len();
    let scan = Scan::read_with_siblings(seed.bytes, seed.siblings, &limits, &budget);
    let read = match scan {
        Ok(scan) => {
            keeps_to(&scan, &limits, budget.held(), length)?;
            // The images of all seeds; the others are not there.
            (0..4).for_each(|index| drop(scan.image(index, &limits, &budget)));
            let written = scan.write(&[]);
            written.is_ok_and(|written| scan.packed(&written).is_ok() || !written.is_empty())
        }
        Err(_) => false,
    };
    match resident() {
        Some(bytes) if bytes > MOST_RESIDENT => Err(format!("{bytes} bytes resident")),
        _ => Ok(read),
    }
}

/// Checks what a scan was read to against its limits. `held` are the bytes that its budget counts.
fn keeps_to(scan: &Scan, limits: &ScanLimits, held: usize, length: usize) -> Result<(), String> {
    let values = |part: &darn_gltf_scan::ScanPart| {
        let texcoords: usize = part.texcoords.iter().map(|set| 2 * set.len()).sum();
        let colors: usize = part.colors.iter().map(|set| 3 * set.len()).sum();
        texcoords + colors + part.normals.as_ref().map_or(0, |set| 3 * set.len())
    };
    // Parts that share an attribute count it once, and limits are for what is read.
    let attributes = scan.parts.iter().map(values).max().unwrap_or(0);
    for (what, found, allowed) in [
        (
            "vertices",
            scan.surface.positions.len(),
            limits.max_vertices,
        ),
        ("faces", scan.surface.faces.len(), limits.max_faces),
        ("attribute values", attributes, limits.max_attribute_values),
        // A scan counts its own bytes, and the budget what they were read to.
        ("bytes", scan.bytes_held(), 2 * length + (1 << 20) + held),
    ] {
        if found > allowed {
            return Err(format!(
                "it was read to {found} {what}, more than {allowed}"
            ));
        }
    }
    let vertices = scan.surface.positions.len();
    let corners = scan.surface.faces.iter().flatten();
    match corners.max() {
        Some(corner) if *corner as usize >= vertices => {
            Err(format!("a face has the vertex {corner} of {vertices}"))
        }
        _ => Ok(()),
    }
}

/// Most bytes of memory that this process ever had; `None` where the system does not say.
fn resident() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: usize = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}

/// The seed of that number with some bytes changed.
fn mutated(seeds: &[Seed], chosen: usize, numbers: &mut Numbers) -> Vec<u8> {
    let mut bytes = seeds[chosen].bytes.clone();
    for _ in 0..1 + numbers.below(6) {
        let at = numbers.below(bytes.len());
        match numbers.below(6) {
            0 => bytes[at] ^= 1 << numbers.below(8),
            1 => bytes[at] = numbers.next() as u8,
            2 => bytes[at] = [0, 0x7F, 0x80, 0xFF][numbers.below(4)],
            3 => bytes.truncate(at.max(1)),
            4 => {
                // A piece of another seed, at the same place: lengths then often agree.
                let other = &seeds[numbers.below(seeds.len())].bytes;
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
