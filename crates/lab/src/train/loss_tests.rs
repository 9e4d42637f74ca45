//! Laws of the loss beyond those in `tests`: the paper's form, the repulsion computed by hand, and the gradient against finite differences.

use burn::backend::{Autodiff, Flex};
use burn::tensor::{Tensor, TensorData};

use super::super::batch::{TrainingBatch, prepare};
use super::*;
use crate::scarffolds::samples::TrainingSample;
use darn_geometry::grid::{cell_centre, cell_index};
use darn_net::UnetConfig;

/// A batch of one flat sheet, all of it known but the given cells.
fn flat(hole: &[usize]) -> TrainingBatch {
    let open: Vec<bool> = (0..CELLS).map(|k| hole.contains(&k)).collect();
    let sample = TrainingSample {
        truth: (0..CELLS)
            .map(|k| [cell_centre(k).x as f32, cell_centre(k).y as f32, 0.0])
            .collect(),
        valid: vec![true; CELLS],
        known: open.iter().map(|h| !h).collect(),
        hole: open,
    };
    TrainingBatch::of(&[prepare(&sample, &UnetConfig::default()).unwrap()])
}

/// The truth with one cell moved to the position of cell `over` plus an offset in cells.
fn moved(batch: &TrainingBatch, cell: usize, over: usize, by: [f32; 3]) -> Vec<f32> {
    let mut answer = batch.truth.clone();
    for (axis, step) in by.iter().enumerate() {
        answer[axis * CELLS + cell] = batch.truth[axis * CELLS + over] + step / SIDE as f32;
    }
    answer
}

fn only_repulsion() -> LossWeights {
    LossWeights {
        gradient: 0.0,
        stretch: 0.0,
        self_penetration: 3.0,
        ..LossWeights::default()
    }
}

fn number(x: Tensor<Flex, 1>) -> f64 {
    f64::from(x.into_scalar())
}

fn terms(answer: &[f32], batch: &TrainingBatch, weights: &LossWeights) -> LossTensors<Flex> {
    let device = Default::default();
    let predicted = Tensor::from_data(
        TensorData::new(answer.to_vec(), [1, 3, SIDE, SIDE]),
        &device,
    );
    loss(predicted, &LossTarget::of(batch.clone(), &device), weights)
}

#[test]
fn cloth_far_from_cloth_does_not_repel() {
    let batch = flat(&[cell_index(20, 30), cell_index(21, 30)]);
    let found = terms(&batch.truth, &batch, &only_repulsion());
    assert_eq!(number(found.self_penetration), 0.0);
}

#[test]
fn a_cell_over_others_repels_by_how_deep_it_is() {
    let (cell, over) = (cell_index(20, 30), cell_index(40, 30));
    let batch = flat(&[cell, cell_index(50, 50)]);
    // Half a cell over cell (40, 30): that one is 0.5 away, its neighbours more than 1.
    let answer = moved(&batch, cell, over, [0.0, 0.0, 0.5]);
    let found = terms(&answer, &batch, &only_repulsion());
    let repelled = number(found.self_penetration);
    // (1 − 0.5)² over two hole cells.
    assert!((repelled - 0.125).abs() < 1e-4, "{repelled}");
    assert!((number(found.total) - number(found.data) - 3.0 * repelled).abs() < 1e-4);
    // Without a weight it is not computed.
    let found = terms(&answer, &batch, &LossWeights::default());
    assert_eq!(number(found.self_penetration), 0.0);
}

#[test]
fn neighbours_on_the_sheet_do_not_repel() {
    let cell = cell_index(20, 30);
    let batch = flat(&[cell]);
    let onto = |over| {
        let answer = moved(&batch, cell, over, [0.0, 0.0, 0.1]);
        number(terms(&answer, &batch, &only_repulsion()).self_penetration)
    };
    assert_eq!(onto(cell_index(21, 30)), 0.0);
    // Over the cell four columns on, which is no neighbour. The cell three columns on is a neighbour, and the others are too far away.
    assert!((onto(cell_index(24, 30)) - 0.81).abs() < 2e-3);
}

#[test]
fn the_papers_form_squares_and_ignores_lengths() {
    let cell = cell_index(20, 30);
    let batch = flat(&[cell]);
    let answer = moved(&batch, cell, cell, [0.0, 0.0, 2.0]);
    let weight = f64::from(batch.weight.iter().sum::<f32>());
    let weights = LossWeights::paper();
    let found = terms(&answer, &batch, &weights);
    let (data, gradient) = (number(found.data), number(found.gradient));
    assert!((data - 4.0 / weight).abs() < 1e-6, "{data}");
    assert!((gradient - 4.0).abs() < 1e-4, "{gradient}");
    assert!((number(found.total) - data - weights.gradient * gradient).abs() < 1e-4);
}

#[test]
fn the_gradient_is_what_finite_differences_give() {
    type Auto = Autodiff<Flex>;
    let hole = [cell_index(20, 30), cell_index(21, 30), cell_index(20, 31)];
    let batch = flat(&hole);
    let mut answer = moved(&batch, hole[0], cell_index(40, 30), [0.21, 0.13, 0.4]);
    let second = moved(&batch, hole[2], cell_index(41, 31), [-0.3, 0.2, -0.35]);
    for axis in 0..3 {
        answer[axis * CELLS + hole[2]] = second[axis * CELLS + hole[2]];
    }
    for kind in [LossKind::Softened, LossKind::Squared] {
        let weights = LossWeights {
            kind,
            self_penetration: 50.0,
            ..LossWeights::default()
        };
        let device = Default::default();
        let input = Tensor::<Auto, 4>::from_data(
            TensorData::new(answer.clone(), [1, 3, SIDE, SIDE]),
            &device,
        )
        .require_grad();
        let total = loss(
            input.clone(),
            &LossTarget::of(batch.clone(), &device),
            &weights,
        )
        .total;
        let gradients = total.backward();
        let gradient: Vec<f32> = input
            .grad(&gradients)
            .unwrap()
            .into_data()
            .into_vec()
            .unwrap();
        for cell in hole {
            for axis in 0..3 {
                let at = axis * CELLS + cell;
                let step = 0.02 / SIDE as f32;
                let value = |shift: f32| {
                    let mut answer = answer.clone();
                    answer[at] += shift;
                    number(terms(&answer, &batch, &weights).total)
                };
                let slope = (value(step) - value(-step)) / f64::from(2.0 * step);
                let found = f64::from(gradient[at]);
                assert!(
                    (slope - found).abs() < 0.01 * slope.abs() + 2.0,
                    "{kind:?} cell {cell} axis {axis}: {found} against {slope}"
                );
            }
        }
    }
}

#[test]
fn weights_of_an_older_run_are_read() {
    let read: LossWeights = serde_json::from_str(r#"{"gradient": 2.0, "stretch": 5.0}"#).unwrap();
    assert_eq!(read, LossWeights::default());
}
