//! Tests of weights files and of [`Network::fill`]: files survive or are refused by the tensor's name, fills are smooth, directions and
//! other grids do not matter.

use darn_geometry::grid::{CELLS, NormalGrid, SIDE, cell_centre};
use half::f16;
use nalgebra::{Rotation3, Vector3};

use super::*;
use crate::engine::EngineOptions;
use crate::testing::random_tensors;
use crate::weights::{NamedTensors, read, write};

const CONFIG: UnetConfig = UnetConfig {
    width: 2,
    input: InputKind::Membrane,
    frame: FrameKind::Canonical,
};
const CELL: f32 = 1.0 / SIDE as f32;

fn card(architecture: UnetConfig) -> WeightsCard {
    WeightsCard {
        name: "test".into(),
        sha256: String::new(),
        architecture,
        training: TrainingCard::default(),
        scores: [("rmse_cells".to_owned(), 1.25)].into(),
        errors: None,
        darn_version: "0".into(),
    }
}

fn load(bytes: &[u8]) -> Result<Network, NetError> {
    Network::load(bytes, EngineOptions::default())
}

/// A network of random weights.
fn random_network(config: UnetConfig) -> Network {
    load(&write(&random_tensors(&config), &card(config)).unwrap()).unwrap()
}

/// A network whose last layer is zero, so that it changes nothing in the fill.
fn zero_network() -> Network {
    let mut tensors = random_tensors(&CONFIG);
    for name in ["last.weight", "last.bias"] {
        tensors.get_mut(name).unwrap().1.fill(0.0);
    }
    load(&write(&tensors, &card(CONFIG)).unwrap()).unwrap()
}

/// Fills with one pass over each grid.
fn filled(network: &Network, grids: &[NormalGrid]) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
    let filled = network.fill(&FillRequest {
        grids,
        up: None,
        averaging: Averaging::Once,
    })?;
    Ok(filled.into_iter().map(|grid| grid.positions).collect())
}

/// A grid of a surface, unknown in the hole.
fn grid(surface: impl Fn(f64, f64) -> [f64; 3], hole: impl Fn(usize, usize) -> bool) -> NormalGrid {
    let mut grid = NormalGrid {
        positions: Vec::new(),
        known: Vec::new(),
        base: None,
    };
    for k in 0..CELLS {
        let uv = cell_centre(k);
        let known = !hole(k % SIDE, k / SIDE);
        let p = surface(uv.x, uv.y).map(|x| x as f32);
        grid.positions.push(if known { p } else { [0.0; 3] });
        grid.known.push(f32::from(u8::from(known)));
    }
    grid
}

/// A part of a cylinder.
fn bent(hole: impl Fn(usize, usize) -> bool) -> NormalGrid {
    let cylinder = |u: f64, v: f64| {
        let angle = (u - 0.5) * 2.0;
        [0.5 * angle.sin(), 0.5 - 0.5 * angle.cos(), v - 0.5]
    };
    grid(cylinder, hole)
}

/// A round hole, 20 cells wide, near the middle.
fn disk(i: usize, j: usize) -> bool {
    (i as f32 - 30.0).powi(2) + (j as f32 - 33.0).powi(2) < 100.0
}

fn largest_distance(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    a.iter()
        .zip(b)
        .map(|(p, q)| (Vector3::from(*p) - Vector3::from(*q)).norm())
        .fold(0.0, f32::max)
}

#[test]
fn a_network_is_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<Network>();
}

#[test]
fn weights_survive_the_file() {
    let tensors = random_tensors(&CONFIG);
    let bytes = write(&tensors, &card(CONFIG)).unwrap();
    assert_eq!(
        bytes,
        write(&tensors, &card(CONFIG)).unwrap(),
        "the same weights give the same bytes"
    );
    let (card, back) = read(&bytes).unwrap();
    assert_eq!(
        (card.name.as_str(), card.architecture, card.sha256.len()),
        ("test", CONFIG, 64)
    );
    assert!(tensors.keys().eq(back.keys()));
    for name in [
        "down.0.conv0.weight",
        "down.4.norm1.variance",
        "up.3.gate.score.bias",
        "up.0.block.norm0.scale",
        "last.weight",
    ] {
        assert!(
            back.contains_key(name),
            "{name} is gone; old files would not load"
        );
    }
    for (name, (shape, values)) in &tensors {
        let rounded = |v: &f32| match shape.len() {
            1 => *v,
            _ => f16::from_f32(*v).to_f32(),
        };
        assert_eq!(back[name].0, *shape);
        assert!(
            values.iter().map(rounded).eq(back[name].1.iter().copied()),
            "{name}"
        );
    }
}

#[test]
fn a_damaged_file_is_refused_by_the_tensors_name() {
    let refusal = |change: &dyn Fn(&mut NamedTensors)| {
        let mut tensors = random_tensors(&CONFIG);
        change(&mut tensors);
        let bytes = write(&tensors, &card(CONFIG)).unwrap();
        load(&bytes).unwrap_err().to_string()
    };
    let missing = refusal(&|t| drop(t.remove("up.1.conv.weight")));
    assert!(
        missing.contains("`up.1.conv.weight` is missing"),
        "{missing}"
    );
    let shape = refusal(&|t| drop(t.insert("down.1.norm0.mean".into(), (vec![3], vec![0.0; 3]))));
    assert!(
        shape.contains("`down.1.norm0.mean`") && shape.contains("[4]"),
        "{shape}"
    );
    let mut infinite = random_tensors(&CONFIG);
    infinite.get_mut("down.2.norm0.mean").unwrap().1[1] = f32::NAN;
    let infinite = write(&infinite, &card(CONFIG)).unwrap_err().to_string();
    assert!(infinite.contains("`down.2.norm0.mean`"), "{infinite}");
}

#[test]
fn a_truncated_file_is_refused() {
    let whole = write(&random_tensors(&CONFIG), &card(CONFIG)).unwrap();
    for cut in [0, 7, 8, 100, whole.len() - 1] {
        assert!(load(&whole[..cut]).is_err());
    }
}

#[test]
fn a_card_of_another_width_than_the_tensors_is_refused() {
    let wide = UnetConfig {
        width: 200,
        ..CONFIG
    };
    let bytes = write(&random_tensors(&CONFIG), &card(wide)).unwrap();
    let refused = load(&bytes).unwrap_err().to_string();
    assert!(refused.contains("`last.weight`"), "{refused}");
}

/// A network's tensors in those of a wider one, whose other channels are zero.
fn padded(narrow: &NamedTensors, wide: &UnetConfig) -> NamedTensors {
    let padded = random_tensors(wide).into_iter().map(|(name, (shape, _))| {
        let (old, values) = &narrow[&name];
        let fill = f32::from(u8::from(name.ends_with(".variance")));
        let mut all = vec![fill; shape.iter().product()];
        let columns = |shape: &[usize]| shape.get(1).copied().unwrap_or(1);
        let taps = shape.iter().skip(2).product::<usize>();
        // A block after a skip reads two groups of channels, one behind the other.
        let groups = 1 + usize::from(name.ends_with(".block.conv0.weight"));
        let (each, old_each) = (columns(&shape) / groups, columns(old) / groups);
        for (row, values) in values.chunks_exact(columns(old) * taps).enumerate() {
            for (column, kernel) in values.chunks_exact(taps).enumerate() {
                let column = column / old_each * each + column % old_each;
                let at = (row * columns(&shape) + column) * taps;
                all[at..at + taps].copy_from_slice(kernel);
            }
        }
        (name, (shape, all))
    });
    padded.collect()
}

#[test]
fn files_of_wider_networks_load_and_answer_as_the_network_inside() {
    let narrow = UnetConfig {
        width: 16,
        ..CONFIG
    };
    let tensors = random_tensors(&narrow);
    let grids = [bent(disk)];
    let expected = filled(&random_network(narrow), &grids).unwrap();
    for width in [24, 31] {
        let wide = UnetConfig { width, ..narrow };
        let bytes = write(&padded(&tensors, &wide), &card(wide)).unwrap();
        assert!(bytes.len() <= 16 << 20, "{width}: {}", bytes.len());
        let answer = filled(&load(&bytes).unwrap(), &grids).unwrap();
        let gap = largest_distance(&answer[0], &expected[0]);
        assert!(gap < 1e-3 * CELL, "{width}: {gap}");
    }
}

#[test]
fn a_value_that_is_not_finite_is_refused_on_reading() {
    let mut bytes = write(&random_tensors(&CONFIG), &card(CONFIG)).unwrap();
    let end = bytes.len();
    bytes[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(matches!(load(&bytes), Err(NetError::NotFinite { .. })));
}

#[test]
fn a_known_grid_comes_back() {
    let grid = bent(|_, _| false);
    let answer = filled(&zero_network(), std::slice::from_ref(&grid)).unwrap();
    assert!(largest_distance(&answer[0], &grid.positions) < 1e-3 * CELL);
}

#[test]
fn a_hole_in_a_plane_is_filled_with_the_plane() {
    let plane = |u: f64, v: f64| [u - 0.5, 0.3, v - 0.5];
    let whole = grid(plane, |_, _| false);
    let answer = filled(&zero_network(), &[grid(plane, disk)]).unwrap();
    // The sweeps stop before they converge; the hole is 20 cells wide.
    let worst = largest_distance(&answer[0], &whole.positions) / CELL;
    assert!(worst < 0.5, "{worst}");
}

#[test]
fn positions_of_unknown_cells_do_not_matter() {
    let network = random_network(CONFIG);
    let grid = bent(disk);
    let mut other = grid.clone();
    for (p, known) in other.positions.iter_mut().zip(&grid.known) {
        if *known == 0.0 {
            *p = [3.0, -2.0, 9.0];
        }
    }
    assert_eq!(
        filled(&network, &[grid]).unwrap(),
        filled(&network, &[other]).unwrap()
    );
}

/// The largest distance between the fill of a rotated grid and the rotated fill.
fn off_the_rotated_fill(frame: FrameKind, rotation: Vector3<f32>) -> f32 {
    let network = random_network(UnetConfig { frame, ..CONFIG });
    let rotation = Rotation3::new(rotation);
    let rotated = |cells: &[[f32; 3]]| -> Vec<[f32; 3]> {
        let cells = cells.iter().map(|p| (rotation * Vector3::from(*p)).into());
        cells.collect()
    };
    let grid = bent(disk);
    let moved = NormalGrid {
        positions: rotated(&grid.positions),
        known: grid.known.clone(),
        base: None,
    };
    let answers = filled(&network, &[grid, moved]).unwrap();
    largest_distance(&answers[1], &rotated(&answers[0]))
}

#[test]
fn the_fill_turns_with_the_cloth() {
    for rotation in [Vector3::new(0.3, 1.9, -0.4), Vector3::new(-2.0, 0.1, 2.0)] {
        assert!(off_the_rotated_fill(FrameKind::Canonical, rotation) < 1e-3 * CELL);
    }
}

#[test]
fn the_fill_of_a_network_that_is_given_up_turns_about_up_only() {
    let about_up = Vector3::new(0.0, 0.0, 1.3);
    assert!(off_the_rotated_fill(FrameKind::Hanging, about_up) < 1e-3 * CELL);
    let over = Vector3::new(1.3, 0.0, 0.0);
    assert!(off_the_rotated_fill(FrameKind::Hanging, over) > 0.01 * CELL);
}

#[test]
fn a_batch_is_its_grids_one_by_one() {
    let network = random_network(CONFIG);
    let grids: Vec<NormalGrid> = (0..18).map(|n| bent(|i, j| disk(i + n, j))).collect();
    let together = filled(&network, &grids).unwrap();
    assert_eq!(together.len(), grids.len());
    for (grid, answer) in grids.iter().zip(&together).step_by(8) {
        let alone = filled(&network, std::slice::from_ref(grid)).unwrap();
        assert_eq!(alone[0], *answer);
    }
}

#[test]
fn grids_that_cannot_be_filled_are_named() {
    let network = zero_network();
    let short = NormalGrid {
        positions: vec![[0.0; 3]; 5],
        known: vec![1.0; CELLS],
        base: None,
    };
    assert!(matches!(
        filled(&network, &[bent(disk), short]),
        Err(NetError::GridSize {
            index: 1,
            positions: 5,
            ..
        })
    ));
    let mut wild = bent(disk);
    wild.positions[0] = [f32::NAN; 3];
    assert!(matches!(
        filled(&network, &[bent(disk), wild]),
        Err(NetError::Answer { index: 1 })
    ));
}

#[test]
fn a_grid_without_known_cells_is_filled_with_zeros() {
    let nothing = NormalGrid {
        positions: vec![[0.0; 3]; CELLS],
        known: vec![0.0; CELLS],
        base: None,
    };
    let answer = filled(&zero_network(), &[nothing]).unwrap();
    assert!(answer[0].iter().flatten().all(|x| x.abs() < 1e-3));
}
