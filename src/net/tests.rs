//! Laws of the room: backends agree, files round-trip or name what is wrong, fills are smooth, directions do not matter.

use burn::backend::{Autodiff, Flex, NdArray};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Distribution, Tensor, TensorData, TensorPrimitive};
use nalgebra::{Rotation3, Vector3};

use super::engine::reference::Reference;
use super::weights::{NamedTensors, export, read, write};
use super::*;
use crate::grid::cell_centre;

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
        darn_version: "0".into(),
    }
}

/// Random weights whose last layer is not near zero.
fn tensors(config: UnetConfig) -> NamedTensors {
    Flex::seed(&Default::default(), 7);
    let mut tensors = export(&config.init::<Flex>(&Default::default()));
    for value in tensors
        .get_mut("last.weight")
        .map(|t| &mut t.1)
        .into_iter()
        .flatten()
    {
        *value *= 300.0;
    }
    tensors
}

fn silent(config: UnetConfig) -> Vec<u8> {
    let mut tensors = tensors(config);
    tensors.get_mut("last.weight").unwrap().1.fill(0.0);
    write(&tensors, &card(config)).unwrap()
}

/// Half a cylinder's bend with a round hole in the middle.
fn bent(hole: impl Fn(usize, usize) -> bool) -> NormalGrid {
    let mut grid = NormalGrid {
        positions: Vec::new(),
        known: Vec::new(),
        base: None,
    };
    for k in 0..CELLS {
        let uv = cell_centre(k);
        let angle = (uv.x - 0.5) * 2.0;
        let known = !hole(k % SIDE, k / SIDE);
        let p = [0.5 * angle.sin(), 0.5 - 0.5 * angle.cos(), uv.y - 0.5].map(|x| x as f32);
        grid.positions.push(if known { p } else { [0.0; 3] });
        grid.known.push(f32::from(u8::from(known)));
    }
    grid
}

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
fn backends_have_names() {
    assert_eq!("flex".parse::<BackendKind>().unwrap(), BackendKind::Flex);
    let refused = "tpu".parse::<BackendKind>().unwrap_err().to_string();
    assert!(
        refused.contains("tpu") && refused.contains("flex"),
        "{refused}"
    );
}

#[cfg(feature = "ndarray")]
#[test]
fn backends_agree_with_the_reference() {
    for input in [InputKind::Plate, InputKind::Membrane, InputKind::Zeros] {
        let config = UnetConfig { input, ..CONFIG };
        let bytes = write(&tensors(config), &card(config)).unwrap();
        let grids = [bent(disk), bent(|i, j| i > 40 || j < 5)];
        let answers = [BackendKind::Engine, BackendKind::Flex, BackendKind::Ndarray]
            .map(|kind| Network::load(&bytes, kind).unwrap().fill(&grids).unwrap());
        for fast in &answers[..2] {
            for (fast, reference) in fast.iter().zip(&answers[2]) {
                assert!(largest_distance(fast, reference) < 1e-4 * CELL);
            }
        }
        let silent = Network::load(&silent(config), BackendKind::Flex)
            .unwrap()
            .fill(&grids)
            .unwrap();
        assert!(
            largest_distance(&silent[0], &answers[0][0]) > 0.01 * CELL,
            "the network must have a say in this test"
        );
    }
}

#[cfg(feature = "ndarray")]
#[test]
fn convolution_gradients_agree_with_the_reference() {
    fn gradients<B>(x: &TensorData, kernel: &TensorData) -> [Vec<f32>; 3]
    where
        B: AutodiffBackend + Convolve,
    {
        let device = Default::default();
        let x = Tensor::<B, 4>::from_data(x.clone(), &device).require_grad();
        let kernel = Tensor::<B, 4>::from_data(kernel.clone(), &device).require_grad();
        let y = B::convolve(
            x.clone().into_primitive().tensor(),
            kernel.clone().into_primitive().tensor(),
        );
        let y = Tensor::<B, 4>::from_primitive(TensorPrimitive::Float(y));
        let gradients = y.clone().mul(y.clone()).sum().backward();
        let values = |t: Tensor<B::InnerBackend, 4>| {
            t.into_data().convert::<f32>().into_vec::<f32>().unwrap()
        };
        [
            values(y.inner()),
            values(x.grad(&gradients).unwrap()),
            values(kernel.grad(&gradients).unwrap()),
        ]
    }
    let random = |shape: [usize; 4]| {
        Tensor::<NdArray, 4>::random(shape, Distribution::Normal(0.0, 1.0), &Default::default())
            .into_data()
    };
    // Images that go into products together (a group and a part of one), one by one, and sides that differ.
    for [count, from, to, height, width] in [[70, 3, 5, 4, 4], [2, 4, 3, 40, 40], [3, 2, 2, 5, 9]] {
        let (x, kernel) = (
            random([count, from, height, width]),
            random([to, from, 3, 3]),
        );
        let [own, reference] = [
            gradients::<Autodiff<Flex>>(&x, &kernel),
            gradients::<Autodiff<NdArray>>(&x, &kernel),
        ];
        for (own, reference) in own.iter().zip(&reference) {
            let scale = reference.iter().fold(0.0f32, |m, v| m.max(v.abs()));
            assert!(
                own.iter()
                    .zip(reference)
                    .all(|(a, b)| (a - b).abs() < 1e-5 * scale)
            );
        }
    }
}

#[test]
fn weights_survive_the_file() {
    let tensors = tensors(CONFIG);
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
    assert_eq!(
        tensors.keys().collect::<Vec<_>>(),
        back.keys().collect::<Vec<_>>()
    );
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
        let rounded = |v: f32| {
            if shape.len() > 1 {
                half::f16::from_f32(v).to_f32()
            } else {
                v
            }
        };
        assert_eq!(back[name].0, *shape);
        assert!(
            back[name]
                .1
                .iter()
                .zip(values)
                .all(|(b, v)| *b == rounded(*v)),
            "{name}"
        );
    }
}

#[test]
fn a_damaged_file_is_refused_by_the_tensors_name() {
    let refusal = |change: &dyn Fn(&mut NamedTensors)| {
        let mut tensors = tensors(CONFIG);
        change(&mut tensors);
        let bytes = write(&tensors, &card(CONFIG)).unwrap();
        Network::load(&bytes, BackendKind::Flex)
            .unwrap_err()
            .to_string()
    };
    let missing = refusal(&|t| drop(t.remove("up.1.conv.weight")));
    assert!(
        missing.contains("`up.1.conv.weight` is missing"),
        "{missing}"
    );
    let surplus = refusal(&|t| drop(t.insert("up.9".into(), (vec![1], vec![0.0]))));
    assert!(surplus.contains("`up.9`"), "{surplus}");
    let shape = refusal(&|t| drop(t.insert("down.1.norm0.mean".into(), (vec![3], vec![0.0; 3]))));
    assert!(
        shape.contains("`down.1.norm0.mean`") && shape.contains("[4]"),
        "{shape}"
    );

    let mut infinite = tensors(CONFIG);
    infinite.get_mut("down.2.norm0.mean").unwrap().1[1] = f32::NAN;
    assert!(
        write(&infinite, &card(CONFIG))
            .unwrap_err()
            .to_string()
            .contains("`down.2.norm0.mean`")
    );

    let whole = write(&tensors(CONFIG), &card(CONFIG)).unwrap();
    for cut in [0, 7, 8, 100, whole.len() - 1] {
        assert!(Network::load(&whole[..cut], BackendKind::Flex).is_err());
    }
    let wide = card(UnetConfig {
        width: 200,
        ..CONFIG
    });
    let wide = write(&tensors(CONFIG), &wide).unwrap();
    let refused = Network::load(&wide, BackendKind::Flex)
        .unwrap_err()
        .to_string();
    assert!(refused.contains("`last.weight`"), "{refused}");
}

#[test]
fn a_value_that_is_not_finite_is_refused_on_reading() {
    let mut bytes = write(&tensors(CONFIG), &card(CONFIG)).unwrap();
    let end = bytes.len();
    bytes[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(matches!(
        Network::load(&bytes, BackendKind::Flex),
        Err(NetError::NotFinite { .. })
    ));
}

#[test]
fn a_known_grid_comes_back() {
    let network = Network::load(&silent(CONFIG), BackendKind::Flex).unwrap();
    let grid = bent(|_, _| false);
    let answer = network.fill(std::slice::from_ref(&grid)).unwrap();
    assert!(largest_distance(&answer[0], &grid.positions) < 1e-3 * CELL);
}

#[test]
fn a_hole_in_a_plane_is_filled_with_the_plane() {
    let network = Network::load(&silent(CONFIG), BackendKind::Flex).unwrap();
    let plane: Vec<[f32; 3]> = (0..CELLS)
        .map(|k| {
            [
                cell_centre(k).x as f32 - 0.5,
                0.3,
                cell_centre(k).y as f32 - 0.5,
            ]
        })
        .collect();
    let known: Vec<f32> = (0..CELLS)
        .map(|k| f32::from(u8::from(!disk(k % SIDE, k / SIDE))))
        .collect();
    let answer = network
        .fill(&[NormalGrid {
            positions: plane.clone(),
            known,
            base: None,
        }])
        .unwrap();
    // The sweeps stop short of convergence; the hole is 20 cells wide.
    let worst = largest_distance(&answer[0], &plane) / CELL;
    assert!(worst < 0.5, "{worst}");
}

#[test]
fn what_stands_in_unknown_cells_does_not_matter() {
    let bytes = write(&tensors(CONFIG), &card(CONFIG)).unwrap();
    let network = Network::load(&bytes, BackendKind::Flex).unwrap();
    let grid = bent(disk);
    let mut other = grid.clone();
    other
        .positions
        .iter_mut()
        .zip(&grid.known)
        .filter(|(_, k)| **k == 0.0)
        .for_each(|(p, _)| *p = [3.0, -2.0, 9.0]);
    assert_eq!(
        network.fill(&[grid]).unwrap(),
        network.fill(&[other]).unwrap()
    );
}

#[test]
fn the_fill_turns_with_the_cloth() {
    let bytes = write(&tensors(CONFIG), &card(CONFIG)).unwrap();
    let network = Network::load(&bytes, BackendKind::Flex).unwrap();
    let grid = bent(disk);
    let straight = network.fill(std::slice::from_ref(&grid)).unwrap();
    for axis in [Vector3::new(0.3, 1.9, -0.4), Vector3::new(-2.0, 0.1, 2.0)] {
        let turn = Rotation3::new(axis);
        let turned = |cells: &[[f32; 3]]| -> Vec<[f32; 3]> {
            cells
                .iter()
                .map(|p| (turn * Vector3::from(*p)).into())
                .collect()
        };
        let answer = network
            .fill(&[NormalGrid {
                positions: turned(&grid.positions),
                known: grid.known.clone(),
                base: None,
            }])
            .unwrap();
        assert!(largest_distance(&answer[0], &turned(&straight[0])) < 1e-3 * CELL);
    }
}

#[test]
fn a_batch_is_its_grids_one_by_one() {
    let bytes = write(&tensors(CONFIG), &card(CONFIG)).unwrap();
    let network = Network::load(&bytes, BackendKind::Flex).unwrap();
    let grids: Vec<NormalGrid> = (0..18).map(|n| bent(|i, j| disk(i + n, j))).collect();
    let together = network.fill(&grids).unwrap();
    assert_eq!(together.len(), grids.len());
    for (grid, answer) in grids.iter().zip(&together).step_by(8) {
        let alone = network.fill(std::slice::from_ref(grid)).unwrap();
        assert!(largest_distance(&alone[0], answer) < 1e-4 * CELL);
    }
}

#[test]
fn grids_that_cannot_be_filled_are_named() {
    let network = Network::load(&silent(CONFIG), BackendKind::Flex).unwrap();
    let short = NormalGrid {
        positions: vec![[0.0; 3]; 5],
        known: vec![1.0; CELLS],
        base: None,
    };
    assert!(matches!(
        network.fill(&[bent(disk), short]),
        Err(NetError::GridSize {
            index: 1,
            positions: 5,
            ..
        })
    ));
    let mut wild = bent(disk);
    wild.positions[0] = [f32::NAN; 3];
    assert!(matches!(
        network.fill(&[bent(disk), wild]),
        Err(NetError::Answer { index: 1 })
    ));
    let nothing = NormalGrid {
        positions: vec![[0.0; 3]; CELLS],
        known: vec![0.0; CELLS],
        base: None,
    };
    assert!(
        network.fill(&[nothing]).unwrap()[0]
            .iter()
            .flatten()
            .all(|x| x.abs() < 1e-3)
    );
}

#[test]
fn the_membrane_is_differentiable_in_position_and_mask() {
    type B = Autodiff<Flex>;
    let grid = bent(disk);
    let device = Default::default();
    let planes = planes(std::slice::from_ref(&grid.positions));
    let anchor = 33 * SIDE + 30;
    // Sum of the fill's height over a few hole cells, as a function of a soft anchor's height and its mask.
    let height = |z: f32, soft: f32| {
        let (mut positions, mut known) = (planes.clone(), grid.known.clone());
        (positions[CELLS + anchor], known[anchor]) = (z, soft);
        let positions =
            Tensor::<B, 4>::from_data(TensorData::new(positions, [1, 3, SIDE, SIDE]), &device)
                .require_grad();
        let known = Tensor::<B, 4>::from_data(TensorData::new(known, [1, 1, SIDE, SIDE]), &device)
            .require_grad();
        let filled = membrane(positions.clone(), known.clone());
        let sum = filled.slice([0..1, 1..2, 28..38, 26..36]).sum();
        let value = sum.clone().into_scalar();
        let gradients = sum.backward();
        let at = |t: Tensor<Flex, 4>, k: usize| t.into_data().into_vec::<f32>().unwrap()[k];
        (
            value,
            at(positions.grad(&gradients).unwrap(), CELLS + anchor),
            at(known.grad(&gradients).unwrap(), anchor),
        )
    };
    let (z, soft, h) = (0.4, 0.6, 0.02);
    let (_, by_position, by_mask) = height(z, soft);
    let slope_position = (height(z + h, soft).0 - height(z - h, soft).0) / (2.0 * h);
    let slope_mask = (height(z, soft + h).0 - height(z, soft - h).0) / (2.0 * h);
    assert!(
        (by_position - slope_position).abs() < 0.02 * slope_position.abs().max(0.1),
        "{by_position} {slope_position}"
    );
    assert!(
        (by_mask - slope_mask).abs() < 0.02 * slope_mask.abs().max(0.1),
        "{by_mask} {slope_mask}"
    );
}

/// The anchor loss in f64, by the plain network.
fn plain_loss(tensors: &NamedTensors, grid: &NormalGrid, target: [f32; 3], at: [f64; 2]) -> f64 {
    let config = UnetConfig {
        frame: FrameKind::Given,
        ..CONFIG
    };
    let bell: Vec<f64> = (0..CELLS)
        .map(|k| {
            let off = [(k % SIDE) as f64 - at[0], (k / SIDE) as f64 - at[1]];
            let sigma = f64::from(anchor::SIGMA);
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
    let answer = Reference { tensors, config }.predict(&positions, &soft);
    let total: f64 = bell.iter().sum();
    let off = (0..3).map(|axis| {
        let plane = &answer[axis * CELLS..][..CELLS];
        let read: f64 = plane.iter().zip(&bell).map(|(x, b)| x * b).sum();
        (read / total - f64::from(target[axis])) * SIDE as f64
    });
    off.map(|x| x * x).sum()
}

#[test]
fn the_anchor_loss_falls_as_its_gradient_says() {
    let config = UnetConfig {
        frame: FrameKind::Given,
        ..CONFIG
    };
    let tensors = tensors(config);
    let bytes = write(&tensors, &card(config)).unwrap();
    // What is on disk is rounded.
    let tensors = read(&write(&tensors, &card(config)).unwrap()).unwrap().1;
    let grid = bent(disk);
    let target = [0.05, 0.1, 0.2];
    let uvs = [[0.5, 0.5], [0.47, 0.55], [0.5078125, 0.4765625]];
    let both = [BackendKind::Flex, BackendKind::Engine];
    for (kind, uv) in both.into_iter().flat_map(|kind| uvs.map(|uv| (kind, uv))) {
        let network = Network::load(&bytes, kind).unwrap();
        let told = network.anchor_gradients(&grid, target, &[uv]).unwrap()[0];
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
        let by = |settings: Settings| {
            let network = Network::load(&bytes, settings).unwrap();
            network
                .anchor_gradients(&grid, [0.02, 0.1, 0.25], &uvs)
                .unwrap()
        };
        let own = by(BackendKind::Engine.into());
        let burn = by(Settings {
            autodiff: Some(BackendKind::Flex),
            ..Settings::default()
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
fn an_anchor_on_the_plate_moves_no_cell_of_what_the_network_sees() {
    let config = UnetConfig {
        input: InputKind::Plate,
        ..CONFIG
    };
    let network = Network::load(&silent(config), BackendKind::Engine).unwrap();
    let mut grid = bent(disk);
    let known: Vec<bool> = grid.known.iter().map(|k| *k > 0.5).collect();
    let base = plate(&grid.positions, &known).unwrap();
    grid.base = Some(base.clone());
    let free = network.fill(std::slice::from_ref(&grid)).unwrap();
    assert!(largest_distance(&free[0], &base) < 1e-5);
    let cell = 32 * SIDE + 32;
    (grid.positions[cell], grid.known[cell]) = (base[cell], 1.0);
    let on_it = network.fill(std::slice::from_ref(&grid)).unwrap();
    assert!(largest_distance(&on_it[0], &base) < 1e-5);
    grid.positions[cell][2] += 0.1;
    let lifted = network.fill(std::slice::from_ref(&grid)).unwrap();
    assert!(lifted[0][cell][2] > base[cell][2] + 0.09);
    let beside = cell + 3;
    let rise = lifted[0][beside][2] - base[beside][2];
    assert!((0.01..0.1).contains(&rise), "{rise}");
}
