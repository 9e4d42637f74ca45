//! Tests of the engine: it agrees with the reference, its gradient is the difference quotient, and a grid's results do not depend on the
//! other grids or on the number of threads.

use super::membrane::{MembraneGrid, Pyramid, membrane};
use super::*;
use crate::fill::InputKind;
use crate::reference::{self, ReferenceNetwork};
use crate::testing::{self, Random, config, random_tensors, wide};
use darn_geometry::grid::CELLS;

const CELL: f64 = 1.0 / 64.0;

/// Planes of some grids.
struct Grids {
    positions: Vec<f32>,
    known: Vec<f32>,
}

impl Grids {
    fn new(count: usize) -> Grids {
        let (positions, known) = testing::grids(count);
        Grids { positions, known }
    }

    fn input(&self) -> EngineInput<'_> {
        input(&self.positions, &self.known)
    }
}

pub(super) fn input<'a>(positions: &'a [f32], known: &'a [f32]) -> EngineInput<'a> {
    EngineInput {
        positions,
        known,
        base: None,
        up: None,
    }
}

pub(super) fn available() -> Vec<Isa> {
    Isa::ALL
        .into_iter()
        .filter(|isa| isa.is_available())
        .collect()
}

pub(super) fn engine(
    tensors: &NamedTensors,
    config: UnetConfig,
    isa: Isa,
    threads: usize,
) -> Engine {
    let isa = Some(isa);
    Engine::new(tensors, &config, EngineOptions { isa, threads }).unwrap()
}

fn predict(engine: &Engine, scratch: &mut Scratch, input: EngineInput) -> Vec<f32> {
    let mut out = vec![f32::NAN; input.positions.len()];
    engine.predict(scratch, input, &mut out).unwrap();
    out
}

/// Prediction, gradient by positions, gradient by mask.
fn gradient(
    engine: &Engine,
    scratch: &mut Scratch,
    input: EngineInput,
    cotangent: &[f32],
) -> [Vec<f32>; 3] {
    let EngineInput {
        positions, known, ..
    } = input;
    let mut out = [positions.len(), positions.len(), known.len()].map(|n| vec![f32::NAN; n]);
    let [prediction, by_positions, by_known] = &mut out;
    let gradients = InputGradient {
        prediction,
        by_positions,
        by_known,
    };
    let given = |grid: usize, _: &[f32], to: &mut [f32]| {
        to.copy_from_slice(&cotangent[grid * 3 * CELLS..][..3 * CELLS]);
    };
    engine.gradient(scratch, input, &given, gradients).unwrap();
    out
}

fn largest_gap(a: &[f32], b: &[f64]) -> f64 {
    let gaps = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - b).abs());
    // NaN must not hide.
    gaps.fold(0.0, |most, gap| if gap <= most { most } else { gap })
}

#[test]
fn the_engine_agrees_with_the_reference() {
    for (width, kind) in [
        (3, InputKind::Membrane),
        (8, InputKind::Zeros),
        (16, InputKind::Membrane),
        (24, InputKind::Zeros),
    ] {
        let config = config(width, kind);
        let tensors = random_tensors(&config);
        let Grids {
            positions,
            mut known,
        } = Grids::new(1);
        if width == 16 {
            known.iter_mut().for_each(|k| *k = k.round());
        }
        let reference = ReferenceNetwork {
            tensors: &tensors,
            config,
        };
        let truth = reference.predict(&wide(&positions), &wide(&known));
        let size = truth.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(
            size > CELL,
            "the network must change positions in this test"
        );
        for isa in available() {
            let engine = engine(&tensors, config, isa, 1);
            let out = predict(&engine, &mut Scratch::default(), input(&positions, &known));
            let gap = largest_gap(&out, &truth);
            eprintln!("width {width} {}: {:.2e} cells", isa.name(), gap / CELL);
            assert!(gap < 1e-4 * CELL, "{} width {width}: {gap}", isa.name());
        }
    }
}

#[test]
fn the_membrane_agrees_with_the_reference() {
    let Grids { positions, known } = Grids::new(1);
    let mut holes = known.clone();
    holes.iter_mut().for_each(|k| *k = k.round());
    for known in [known, holes, vec![0.0; CELLS], vec![1.0; CELLS]] {
        let mut filled = vec![0.0; 3 * CELLS];
        let grid = MembraneGrid {
            positions: &positions,
            known: &known,
        };
        membrane(
            TargetIsa::best(),
            &mut Pyramid::default(),
            grid,
            &mut filled,
        );
        for axis in 0..3 {
            let axis = axis * CELLS..(axis + 1) * CELLS;
            let truth = reference::membrane(&wide(&positions[axis.clone()]), &wide(&known));
            assert!(largest_gap(&filled[axis], &truth) < 1e-6);
        }
    }
}

#[test]
fn the_gradient_is_the_difference_quotient() {
    for kind in [InputKind::Membrane, InputKind::Zeros] {
        let config = config(3, kind);
        let tensors = random_tensors(&config);
        let Grids { positions, known } = Grids::new(1);
        let mut random = Random(11);
        let cotangent = random.values(positions.len(), 1.0);
        let reference = ReferenceNetwork {
            tensors: &tensors,
            config,
        };
        let loss = |positions: &[f64], known: &[f64]| -> f64 {
            let prediction = reference.predict(positions, known);
            prediction
                .iter()
                .zip(&cotangent)
                .map(|(p, c)| p * f64::from(*c))
                .sum()
        };
        // Along random directions, and along one cell each near the hole's rim.
        let mut directions: Vec<(Vec<f32>, Vec<f32>)> = (0..3)
            .map(|_| (random.values(3 * CELLS, 1.0), random.values(CELLS, 1.0)))
            .collect();
        for at in [30 * 64 + 20, 30 * 64 + 33, 0, 17 * 64 + 63] {
            let mut one = (vec![0.0; 3 * CELLS], vec![0.0; CELLS]);
            one.0[at + CELLS] = 1.0;
            directions.push(one);
            let mut one = (vec![0.0; 3 * CELLS], vec![0.0; CELLS]);
            one.1[at] = 1.0;
            directions.push(one);
        }
        let quotients: Vec<f64> = directions
            .iter()
            .map(|(dx, dk)| {
                // Far below the membrane's guard against empty cells (1e-6), where it is not smooth.
                let step = 1e-9;
                let moved = |sign: f64| {
                    let go = |x: &[f32], d: &[f32]| -> Vec<f64> {
                        let both = x.iter().zip(d);
                        both.map(|(x, d)| f64::from(*x) + sign * step * f64::from(*d))
                            .collect()
                    };
                    loss(&go(&positions, dx), &go(&known, dk))
                };
                (moved(1.0) - moved(-1.0)) / (2.0 * step)
            })
            .collect();
        for isa in available() {
            let engine = engine(&tensors, config, isa, 1);
            let mut scratch = Scratch::default();
            let [prediction, by_positions, by_known] =
                gradient(&engine, &mut scratch, input(&positions, &known), &cotangent);
            let plain = predict(&engine, &mut scratch, input(&positions, &known));
            assert_eq!(prediction, plain);
            for ((dx, dk), quotient) in directions.iter().zip(&quotients) {
                let dot = |a: &[f32], b: &[f32]| -> f64 {
                    a.iter()
                        .zip(b)
                        .map(|(a, b)| f64::from(*a) * f64::from(*b))
                        .sum()
                };
                let slope = dot(&by_positions, dx) + dot(&by_known, dk);
                let gap = (slope - quotient).abs() / quotient.abs().max(0.1);
                eprintln!("{kind:?} {}: {slope:.6} {quotient:.6}", isa.name());
                assert!(gap < 1e-3, "{}: {slope} {quotient}", isa.name());
            }
        }
    }
}

#[test]
fn results_do_not_depend_on_other_grids_or_threads() {
    let config = config(5, InputKind::Membrane);
    let tensors = random_tensors(&config);
    let Grids { positions, known } = Grids::new(7);
    let cotangent = Random(5).values(positions.len(), 1.0);
    for isa in available() {
        let alone = engine(&tensors, config, isa, 1);
        let mut scratch = Scratch::default();
        let mut each = [Vec::new(), Vec::new(), Vec::new()];
        for i in 0..7 {
            let (three, one) = (
                i * 3 * CELLS..(i + 1) * 3 * CELLS,
                i * CELLS..(i + 1) * CELLS,
            );
            let grid = input(&positions[three.clone()], &known[one]);
            let parts = gradient(&alone, &mut scratch, grid, &cotangent[three]);
            for (all, part) in each.iter_mut().zip(parts) {
                all.extend(part);
            }
        }
        for threads in [1, 2, 3] {
            let engine = engine(&tensors, config, isa, threads);
            let together = gradient(&engine, &mut scratch, input(&positions, &known), &cotangent);
            assert!(together == each, "{} {threads}", isa.name());
            let plain = predict(&engine, &mut scratch, input(&positions, &known));
            assert!(plain == each[0], "{} {threads}", isa.name());
        }
        for threads in [2, 3, 7] {
            let engine = engine(&tensors, config, isa, threads);
            let grid = input(&positions[..3 * CELLS], &known[..CELLS]);
            let shared = gradient(&engine, &mut scratch, grid, &cotangent[..3 * CELLS]);
            let same = shared.iter().zip(&each).all(|(a, b)| *a == b[..a.len()]);
            assert!(same, "{} {threads}: one grid", isa.name());
        }
    }
}

#[test]
fn instruction_sets_with_fused_products_agree_to_the_bit() {
    let config = config(4, InputKind::Membrane);
    let tensors = random_tensors(&config);
    let grids = Grids::new(2);
    let fused = available().into_iter().filter(|isa| *isa != Isa::Portable);
    let answers: Vec<Vec<f32>> = fused
        .map(|isa| {
            let engine = engine(&tensors, config, isa, 1);
            predict(&engine, &mut Scratch::default(), grids.input())
        })
        .collect();
    assert!(answers.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn errors_name_what_is_wrong() {
    let mut weights = random_tensors(&config(2, InputKind::Membrane));
    let wrong = |weights: &NamedTensors, width: usize| {
        let config = config(width, InputKind::Membrane);
        Engine::new(weights, &config, EngineOptions::default())
            .unwrap_err()
            .to_string()
    };
    assert!(wrong(&weights, 0).contains("width 0"));
    assert!(wrong(&weights, 257).contains("width 257"));
    assert!(wrong(&weights, 3).contains("down.0.conv0.weight"));
    weights.remove("up.1.gate.score.bias");
    assert!(wrong(&weights, 2).contains("up.1.gate.score.bias"));
    assert_eq!("avx2".parse(), Ok(Isa::Avx2));
    assert!(
        "mmx"
            .parse::<Isa>()
            .unwrap_err()
            .to_string()
            .contains("mmx")
    );
    let config = config(2, InputKind::Zeros);
    let engine = engine(&random_tensors(&config), config, Isa::Portable, 1);
    let Grids { positions, known } = Grids::new(1);
    let mut out = vec![0.0; 5];
    let input = input(&positions, &known);
    let short = engine.predict(&mut Scratch::default(), input, &mut out);
    assert!(short.unwrap_err().to_string().contains("`out`"));
}

#[test]
fn an_engine_is_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<Engine>();
}
