//! Laws of the anchor search's loss: its gradient is that of finite differences in f64, in burn and in the engine, and an anchor on the plate
//! changes nothing.

use super::tests::{CONFIG, bent, card, disk, filled, largest_distance, silent, tensors};
use super::*;
use darn_geometry::grid::{CELLS, NormalGrid, SIDE};
use darn_net::reference::ReferenceNetwork;
use darn_net::weights::{NamedTensors, read, write};
use darn_net::{FrameKind, SIGMA, plate};

/// The anchor loss in f64, by the plain network.
fn plain_loss(tensors: &NamedTensors, grid: &NormalGrid, target: [f32; 3], at: [f64; 2]) -> f64 {
    let config = UnetConfig {
        frame: FrameKind::Given,
        ..CONFIG
    };
    let bell: Vec<f64> = (0..CELLS)
        .map(|k| {
            let off = [(k % SIDE) as f64 - at[0], (k / SIDE) as f64 - at[1]];
            let sigma = f64::from(SIGMA);
            (-0.5 * (off[0] * off[0] + off[1] * off[1]) / (sigma * sigma)).exp()
        })
        .collect();
    let known = |k: usize| f64::from(grid.known[k]);
    let positions: Vec<f64> = (0..3 * CELLS)
        .map(|n| {
            let (axis, k) = (n / CELLS, n % CELLS);
            known(k) * f64::from(grid.positions[k][axis])
                + (1.0 - known(k)) * f64::from(target[axis])
        })
        .collect();
    let soft: Vec<f64> = (0..CELLS)
        .map(|k| known(k) + bell[k] * (1.0 - known(k)))
        .collect();
    let answer = ReferenceNetwork { tensors, config }.predict(&positions, &soft);
    let total: f64 = bell.iter().sum();
    let off = (0..3).map(|axis| {
        let plane = &answer[axis * CELLS..][..CELLS];
        let read: f64 = plane.iter().zip(&bell).map(|(x, b)| x * b).sum();
        (read / total - f64::from(target[axis])) * SIDE as f64
    });
    off.map(|x| x * x).sum()
}

#[test]
fn the_gradient_of_the_anchor_loss_is_that_of_finite_differences() {
    let config = UnetConfig {
        frame: FrameKind::Given,
        ..CONFIG
    };
    let tensors = tensors(config);
    let bytes = write(&tensors, &card(config)).unwrap();
    // The tensors in the file are rounded.
    let tensors = read(&write(&tensors, &card(config)).unwrap()).unwrap().1;
    let grid = bent(disk);
    let target = [0.05, 0.1, 0.2];
    let uvs = [[0.5, 0.5], [0.47, 0.55], [0.5078125, 0.4765625]];
    let both = [BackendKind::Flex, BackendKind::Engine];
    for (kind, uv) in both.into_iter().flat_map(|kind| uvs.map(|uv| (kind, uv))) {
        let network = load_network(&bytes, kind).unwrap();
        let problem = network.anchor_problem(&grid, target, None).unwrap();
        let told = network.anchor_gradients(&problem, &[uv]).unwrap()[0];
        let at = uv.map(|x: f32| f64::from(x) * SIDE as f64 - 0.5);
        let loss = plain_loss(&tensors, &grid, target, at);
        assert!((f64::from(told.loss) - loss).abs() < 1e-3 * (1.0 + loss));
        for axis in 0..2 {
            let step = 1e-6;
            let moved = |by: f64| {
                let mut at = at;
                at[axis] += by;
                plain_loss(&tensors, &grid, target, at)
            };
            let slope = (moved(step) - moved(-step)) / (2.0 * step);
            let told = f64::from(told.gradient[axis]);
            assert!(
                (slope - told).abs() < 0.01 * slope.abs() + 0.005,
                "{kind:?} {uv:?} {axis}: {slope} {told}"
            );
        }
    }
}

#[test]
fn the_engines_gradient_is_that_of_burns_autodiff() {
    let kinds = [
        (FrameKind::Canonical, InputKind::Plate),
        (FrameKind::Given, InputKind::Membrane),
        (FrameKind::Canonical, InputKind::Zeros),
    ];
    for (frame, input) in kinds {
        let config = UnetConfig {
            frame,
            input,
            ..CONFIG
        };
        let bytes = write(&tensors(config), &card(config)).unwrap();
        let grid = bent(disk);
        let uvs = [[0.5, 0.5], [0.45, 0.56], [0.52, 0.41]];
        let by = |settings: BackendSettings| {
            let network = load_network(&bytes, settings).unwrap();
            let problem = network.anchor_problem(&grid, [0.02, 0.1, 0.25], None);
            network.anchor_gradients(&problem.unwrap(), &uvs).unwrap()
        };
        let own = by(BackendKind::Engine.into());
        let burn = by(BackendSettings {
            autodiff: Some(BackendKind::Flex),
            ..BackendSettings::default()
        });
        for (own, burn) in own.iter().zip(&burn) {
            let size = 1.0 + burn.gradient[0].hypot(burn.gradient[1]);
            assert!((own.loss - burn.loss).abs() < 1e-3 * (1.0 + burn.loss));
            for (a, b) in own.gradient.iter().zip(burn.gradient) {
                assert!((a - b).abs() < 2e-3 * size, "{own:?} {burn:?}");
            }
        }
    }
}

#[test]
fn an_anchor_on_the_plate_moves_no_cell_of_the_input_fill() {
    let config = UnetConfig {
        input: InputKind::Plate,
        ..CONFIG
    };
    let network = load_network(&silent(config), BackendKind::Engine).unwrap();
    let mut grid = bent(disk);
    let known: Vec<bool> = grid.known.iter().map(|k| *k > 0.5).collect();
    let base = plate(&grid.positions, &known).unwrap();
    grid.base = Some(base.clone());
    let free = filled(&network, std::slice::from_ref(&grid)).unwrap();
    assert!(largest_distance(&free[0], &base) < 1e-5);
    let cell = 32 * SIDE + 32;
    (grid.positions[cell], grid.known[cell]) = (base[cell], 1.0);
    let on_it = filled(&network, std::slice::from_ref(&grid)).unwrap();
    assert!(largest_distance(&on_it[0], &base) < 1e-5);
    grid.positions[cell][2] += 0.1;
    let lifted = filled(&network, std::slice::from_ref(&grid)).unwrap();
    assert!(lifted[0][cell][2] > base[cell][2] + 0.09);
    let beside = cell + 3;
    let rise = lifted[0][beside][2] - base[beside][2];
    assert!((0.01..0.1).contains(&rise), "{rise}");
}
