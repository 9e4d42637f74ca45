//! Laws of making sheets: interrupted runs, growing sets, files of another seed.

use super::*;
use crate::scarffolds::lattice::{SIDE, SPACING, VERTICES};

/// A flat sheet at the height of its index, made without a simulation.
fn flat(index: usize) -> Result<(SimulatedSheet, SheetRecord), ScarfError> {
    let scene = Scene::draw(&mut ChaCha8Rng::seed_from_u64(index as u64));
    let z = index as f32;
    let positions = (0..VERTICES)
        .map(|k| [(k % SIDE) as f32 * SPACING, (k / SIDE) as f32 * SPACING, z])
        .collect();
    let record = SheetRecord {
        index,
        scene,
        dropped_crossing: 1,
        dropped_strain: 0,
        strain: 0.0,
    };
    Ok((SimulatedSheet { positions }, record))
}

fn gather(count: usize, out: &Path, maker: Maker) -> Result<SheetSetSummary, ScarfError> {
    collect(count, 4, out, &|_| (), maker)
}

fn bytes(out: &Path) -> [Vec<u8>; 2] {
    [WHOLE, MANIFEST].map(|name| std::fs::read(out.join(name)).unwrap())
}

#[test]
fn an_interrupted_run_ends_like_an_uninterrupted_one() {
    let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let summary = gather(23, a.path(), &flat).unwrap();
    assert_eq!((summary.sheets, summary.crossing_share), (23, 0.5));
    let breaking = |index| {
        if index < 20 {
            flat(index)
        } else {
            Err(ScarfError::NoSheet { index, attempts: 1 })
        }
    };
    assert!(gather(23, b.path(), &breaking).is_err());
    assert_eq!(
        read(b.path()).unwrap().len(),
        20,
        "finished parts are readable early"
    );
    gather(23, b.path(), &|index| {
        if index >= 20 {
            flat(index)
        } else {
            panic!("made twice")
        }
    })
    .unwrap();
    assert_eq!(bytes(a.path()), bytes(b.path()));
    assert_eq!(
        std::fs::read_dir(b.path()).unwrap().count(),
        2,
        "parts are deleted"
    );
}

#[test]
fn a_finished_set_grows() {
    let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    gather(12, a.path(), &flat).unwrap();
    gather(25, a.path(), &|index| {
        if index >= 10 {
            flat(index)
        } else {
            panic!("made twice")
        }
    })
    .unwrap();
    gather(25, b.path(), &flat).unwrap();
    assert_eq!(bytes(a.path()), bytes(b.path()));
    assert_eq!(read_manifest(a.path()).unwrap().sheets.len(), 25);
}

#[test]
fn a_sheet_passes_its_checks_and_depends_on_seed_and_index_only() {
    let (sheet, record) = make(4, 3).unwrap();
    assert!(record.strain < 0.005, "{}", record.strain);
    assert!(!sheet.crosses_itself());
    assert_eq!(make(4, 3).unwrap(), (sheet, record));
}

#[test]
fn parts_of_another_seed_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let sheet = SimulatedSheet {
        positions: vec![[0.0; 3]; VERTICES],
    };
    let part = PartHeader {
        version: VERSION,
        seed: 1,
        sheets: Vec::new(),
    };
    write_file(
        &dir.path().join("part-000000.safetensors"),
        &[sheet],
        Some(&part),
    )
    .unwrap();
    assert!(matches!(
        generate(1, 2, dir.path(), &|_| ()),
        Err(ScarfError::Foreign {
            found: 1,
            seed: 2,
            ..
        })
    ));
}

#[test]
fn a_sheet_folded_through_itself_crosses() {
    let flat = |k: usize| {
        [
            (k % SIDE) as f32 * SPACING,
            (k / SIDE) as f32 * SPACING,
            0.0,
        ]
    };
    let mut sheet = SimulatedSheet {
        positions: (0..VERTICES).map(flat).collect(),
    };
    assert!(!sheet.crosses_itself());
    for p in sheet.positions.iter_mut().filter(|p| p[0] > 0.5) {
        // The right half is folded over the left one and passes through it.
        *p = [1.0 - p[0], p[1], 0.1 - 0.4 * (p[0] - 0.5)];
    }
    assert!(sheet.crosses_itself());
}
