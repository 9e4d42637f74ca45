//! Laws of the gradient by the weights: it is the gradient, and that of many grids is the sum.

use super::tests::{Random, config, engine, grids, input, targets, tensors, wide};
use super::*;
use crate::InputKind;
use crate::reference::Reference;

#[test]
fn the_gradient_by_the_weights_is_the_difference_quotient() {
    for width in [3] {
        let (tensors, config) = (tensors(width), config(width, InputKind::Membrane));
        let (positions, known) = grids(1);
        let mut random = Random(11);
        let cotangent = random.values(positions.len(), 1.0);
        let loss = |tensors: &NamedTensors| -> f64 {
            let prediction =
                Reference { tensors, config }.predict(&wide(&positions), &wide(&known));
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
        // Below the distance to the next kink of a ReLU, for most weights; exact in f32.
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
        for isa in targets() {
            let engine = engine(&tensors, config, isa, 1);
            let mut lessons = Lessons::default();
            let given = |_: Range<usize>, _: &[f32], to: &mut [f32]| to.copy_from_slice(&cotangent);
            let input = input(&positions, &known);
            let (slopes, _) = engine.learn(&mut lessons, &tensors, input, &given).unwrap();
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
}

#[test]
fn lessons_of_many_grids_are_the_sum_of_lessons_of_one() {
    let (tensors, config) = (tensors(4), config(4, InputKind::Zeros));
    let (positions, known) = grids(6);
    let cotangent = Random(5).values(positions.len(), 1.0);
    let engine = engine(&tensors, config, Target::best().isa(), 1);
    let mut lessons = Lessons::default();
    let mut learn = |grids: Range<usize>| {
        let part = input(&positions, &known).part(grids.clone());
        let cotangent = &cotangent[grids.start * 3 * CELLS..grids.end * 3 * CELLS];
        let given = |grids: Range<usize>, _: &[f32], to: &mut [f32]| {
            to.copy_from_slice(&cotangent[grids.start * 3 * CELLS..grids.end * 3 * CELLS]);
        };
        engine
            .learn(&mut lessons, &tensors, part, &given)
            .unwrap()
            .0
    };
    let all = learn(0..6);
    let each: Vec<NamedTensors> = (0..6).map(|grid| learn(grid..grid + 1)).collect();
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
