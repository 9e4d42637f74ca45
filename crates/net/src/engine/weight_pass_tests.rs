//! Tests of the gradient with respect to the weights: it is the difference quotient, and that of several grids is the sum.

use std::ops::Range;

use super::tests::{available, engine, input};
use super::*;
use crate::fill::InputKind;
use crate::reference::ReferenceNetwork;
use crate::testing::{Random, config, grids, random_tensors, wide};
use darn_geometry::grid::CELLS;

#[test]
fn the_weight_gradient_is_the_difference_quotient() {
    let width = 3;
    let config = config(width, InputKind::Membrane);
    let tensors = random_tensors(&config);
    let (positions, known) = grids(1);
    let mut random = Random(11);
    let cotangent = random.values(positions.len(), 1.0);
    let loss = |tensors: &NamedTensors| -> f64 {
        let prediction =
            ReferenceNetwork { tensors, config }.predict(&wide(&positions), &wide(&known));
        let both = prediction.iter().zip(&cotangent);
        both.map(|(p, c)| p * f64::from(*c)).sum()
    };
    // One weight of each kind of tensor, at the finest level, the coarsest and between.
    let names = [
        "down.0.conv0.weight",
        "down.0.norm1.scale",
        "down.2.conv1.weight",
        "down.4.conv0.weight",
        "down.4.norm0.shift",
        "up.2.conv.weight",
        "up.1.gate.skip.weight",
        "up.1.gate.signal_norm.scale",
        "up.0.gate.score.weight",
        "up.0.gate.score.bias",
        "up.0.block.conv0.weight",
        "up.2.block.conv1.weight",
        "last.weight",
        "last.bias",
    ];
    // Exact in f32, and for most weights smaller than the distance to the next kink of a ReLU.
    let step = 1.0 / 65536.0;
    let places: Vec<(&str, usize, f64)> = names
        .into_iter()
        .map(|name| {
            let place = (random.next().abs() * tensors[name].1.len() as f32) as usize;
            let moved = |by: f32| {
                let mut tensors = tensors.clone();
                let value = tensors.get_mut(name).map(|(_, values)| &mut values[place]);
                let value = value.unwrap();
                let before = *value;
                *value += by;
                let by = f64::from(*value) - f64::from(before);
                (loss(&tensors), by)
            };
            let (above, below) = (moved(step), moved(-step));
            (name, place, (above.0 - below.0) / (above.1 - below.1))
        })
        .collect();
    for isa in available() {
        let engine = engine(&tensors, config, isa, 1);
        let mut buffers = WeightGradientBuffers::default();
        let given = |_: Range<usize>, _: &[f32], to: &mut [f32]| to.copy_from_slice(&cotangent);
        let input = input(&positions, &known);
        let (slopes, _) = engine
            .weight_gradients(&mut buffers, &tensors, input, &given)
            .unwrap();
        let statistics = |name: &str| name.ends_with(".mean") || name.ends_with(".variance");
        let trained = tensors.keys().filter(|name| !statistics(name));
        assert!(trained.eq(slopes.keys()));
        for (name, place, quotient) in &places {
            let slope = f64::from(slopes[*name].1[*place]);
            eprintln!(
                "{width} {} {name}[{place}]: {slope:.6} {quotient:.6}",
                isa.name()
            );
            assert!((slope - quotient).abs() < 0.02 * quotient.abs().max(0.2));
        }
    }
}

#[test]
fn gradients_of_several_grids_are_the_sum_of_those_of_each() {
    let config = config(4, InputKind::Zeros);
    let tensors = random_tensors(&config);
    let (positions, known) = grids(6);
    let cotangent = Random(5).values(positions.len(), 1.0);
    let engine = engine(&tensors, config, TargetIsa::best().isa(), 1);
    let mut buffers = WeightGradientBuffers::default();
    let mut gradients = |grids: Range<usize>| {
        let part = input(&positions, &known).part(grids.clone());
        let cotangent = &cotangent[grids.start * 3 * CELLS..grids.end * 3 * CELLS];
        let given = |grids: Range<usize>, _: &[f32], to: &mut [f32]| {
            to.copy_from_slice(&cotangent[grids.start * 3 * CELLS..grids.end * 3 * CELLS]);
        };
        engine
            .weight_gradients(&mut buffers, &tensors, part, &given)
            .unwrap()
            .0
    };
    let all = gradients(0..6);
    let each: Vec<NamedTensors> = (0..6).map(|grid| gradients(grid..grid + 1)).collect();
    for (name, (_, values)) in &all {
        for (place, x) in values.iter().enumerate() {
            let sum: f32 = each.iter().map(|one| one[name].1[place]).sum();
            assert!(
                (x - sum).abs() < 1e-3 * sum.abs().max(1.0),
                "{name}: {x} {sum}"
            );
        }
    }
}
