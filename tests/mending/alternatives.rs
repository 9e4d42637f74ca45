//! Plausible fills beside the likeliest one.

use std::sync::Arc;

use darn_budget::Budget;
use darn_contract::{Constraints, LAST_ALTERNATIVE};
use darn_geometry::mesh::Vec3;
use darn_mend::ScanSession;

use super::cloth::{MendedScan, ROUND, holed, laid, mended, mender, packed, read, sheet};

fn asked(alternative: u8) -> Constraints {
    Constraints {
        alternative: Some(alternative),
        ..Constraints::default()
    }
}

/// A folded sheet with a hole.
fn folded() -> Vec<u8> {
    packed(&holed(sheet(1), &ROUND).mesh, &[])
}

#[test]
fn every_alternative_is_sound_cloth_of_another_shape() {
    let bytes = folded();
    let likeliest = mended(&bytes, &Constraints::default()).unwrap();
    let first = MendedScan::of(&likeliest.bytes).new_positions();
    let mut seen: Vec<Vec<Vec3>> = Vec::new();
    for number in 0..=LAST_ALTERNATIVE {
        let done = mended(&bytes, &asked(number)).unwrap();
        let report = &done.report.holes[0];
        let patch = report.patch.as_ref().unwrap();
        assert_eq!(patch.alternative, u32::from(number));
        assert!(report.doubts.is_empty() && patch.self_intersections == 0);
        assert!(
            (patch.stretch_mean - 1.0).abs() < 0.02,
            "{number}: {}",
            patch.stretch_mean
        );
        assert_eq!(done.bytes == likeliest.bytes, number == 0);
        let new = MendedScan::of(&done.bytes).new_positions();
        assert_eq!(new.len(), first.len());
        let apart = |other: &Vec<Vec3>| {
            let each = new.iter().zip(other);
            each.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
        };
        // The sheet has a side of 1 and the hole a quarter of that.
        assert!(seen.iter().all(|other| apart(other) > 1e-4), "{number}");
        seen.push(new);
    }
}

#[test]
fn a_session_gives_the_bytes_of_single_calls() {
    let opened = |constraints| {
        let scan = read(&folded());
        ScanSession::open(
            scan,
            &constraints,
            Arc::clone(mender()),
            Budget::unlimited(),
        )
        .unwrap()
    };
    let single = mended(&folded(), &asked(2)).unwrap().bytes;
    let plain = opened(Constraints::default());
    let call = plain.call(Budget::unlimited());
    assert!(call.mended(&asked(2)).unwrap().bytes == single);
    let likeliest = call.mended(&Constraints::default()).unwrap().bytes;
    assert!(likeliest == mended(&folded(), &Constraints::default()).unwrap().bytes);
    let other = opened(asked(2));
    let call = other.call(Budget::unlimited());
    assert!(call.mended(&Constraints::default()).unwrap().bytes == single);
}

#[test]
fn smooth_cloth_has_one_fill() {
    let flat = packed(&holed(&laid(|u, v| [u, 0.25, -v]), &ROUND).mesh, &[]);
    let done = mended(&flat, &asked(1)).unwrap();
    assert_eq!(done.report.holes[0].patch.as_ref().unwrap().alternative, 0);
    assert!(done.bytes == mended(&flat, &Constraints::default()).unwrap().bytes);
}
