//! Tests of the network in burn: backends agree, and damaged tensors are refused by name.

use burn::backend::{Autodiff, Flex, NdArray};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Distribution, Tensor, TensorData, TensorPrimitive};
use nalgebra::Vector3;

use super::fill::membrane;
use super::*;
use darn_geometry::grid::cell_centre;
use darn_geometry::grid::{CELLS, NormalGrid, SIDE};
use darn_net::weights::{NamedTensors, write};
use darn_net::{
    Averaging, FillRequest, FrameKind, NetError, Network, TrainingCard, WeightsCard, planes,
};

pub(super) const CONFIG: UnetConfig = UnetConfig {
    width: 2,
    input: InputKind::Membrane,
    frame: FrameKind::Canonical,
};
const CELL: f32 = 1.0 / SIDE as f32;

pub(super) fn card(architecture: UnetConfig) -> WeightsCard {
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

/// Random weights whose last layer is not near zero.
pub(super) fn tensors(config: UnetConfig) -> NamedTensors {
    Flex::seed(&Default::default(), 7);
    let mut tensors = export(&Unet::<Flex>::init(&config, &Default::default()));
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

pub(super) fn silent(config: UnetConfig) -> Vec<u8> {
    let mut tensors = tensors(config);
    tensors.get_mut("last.weight").unwrap().1.fill(0.0);
    write(&tensors, &card(config)).unwrap()
}

/// One pass over each grid.
pub(super) fn filled(
    network: &Network,
    grids: &[NormalGrid],
) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
    let filled = network.fill(&FillRequest {
        grids,
        up: None,
        averaging: Averaging::Once,
    })?;
    Ok(filled.into_iter().map(|grid| grid.positions).collect())
}

/// Half a cylinder's bend with a round hole in the middle.
pub(super) fn bent(hole: impl Fn(usize, usize) -> bool) -> NormalGrid {
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

pub(super) fn disk(i: usize, j: usize) -> bool {
    (i as f32 - 30.0).powi(2) + (j as f32 - 33.0).powi(2) < 100.0
}

pub(super) fn largest_distance(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    a.iter()
        .zip(b)
        .map(|(p, q)| (Vector3::from(*p) - Vector3::from(*q)).norm())
        .fold(0.0, f32::max)
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

#[test]
fn backends_agree_with_the_reference() {
    for (input, frame) in [
        (InputKind::Plate, FrameKind::Canonical),
        (InputKind::Plate, FrameKind::Hanging),
        (InputKind::Membrane, FrameKind::Canonical),
        (InputKind::Zeros, FrameKind::Given),
    ] {
        let config = UnetConfig {
            input,
            frame,
            ..CONFIG
        };
        let bytes = write(&tensors(config), &card(config)).unwrap();
        let grids = [bent(disk), bent(|i, j| i > 40 || j < 5)];
        let answers = [BackendKind::Engine, BackendKind::Flex, BackendKind::Ndarray]
            .map(|kind| filled(&load_network(&bytes, kind).unwrap(), &grids).unwrap());
        for fast in &answers[..2] {
            for (fast, reference) in fast.iter().zip(&answers[2]) {
                assert!(largest_distance(fast, reference) < 1e-4 * CELL);
            }
        }
        let silent = load_network(&silent(config), BackendKind::Flex);
        let silent = filled(&silent.unwrap(), &grids).unwrap();
        assert!(
            largest_distance(&silent[0], &answers[0][0]) > 0.01 * CELL,
            "the network must matter in this test"
        );
    }
}

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
    // Images that share products (a group and a part of one), images one by one, and images that are not square.
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
fn a_damaged_file_is_refused_by_the_tensors_name() {
    let refusal = |change: &dyn Fn(&mut NamedTensors)| {
        let mut tensors = tensors(CONFIG);
        change(&mut tensors);
        let bytes = write(&tensors, &card(CONFIG)).unwrap();
        load_network(&bytes, BackendKind::Flex)
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
