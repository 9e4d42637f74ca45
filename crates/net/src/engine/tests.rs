//! Laws of the engine: it is the network, its gradient is the gradient, company and threads change nothing.

use super::*;
use crate::InputKind;
use crate::reference::{Reference, membrane};

const CELL: f64 = 1.0 / 64.0;

/// A small generator of its own, so that the tests' numbers stay.
pub(super) struct Random(pub u64);

impl Random {
    /// In −1..1.
    pub fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    pub fn values(&mut self, count: usize, size: f32) -> Vec<f32> {
        (0..count).map(|_| self.next() * size).collect()
    }
}

pub(super) fn config(width: usize, input: InputKind) -> UnetConfig {
    UnetConfig {
        width,
        input,
        ..UnetConfig::default()
    }
}

/// Random weights that keep activations O(1), with statistics away from zero and one.
pub(super) fn tensors(width: usize) -> NamedTensors {
    let mut random = Random(7);
    let mut tensors = NamedTensors::new();
    let mut put = |name: String, shape: Vec<usize>, middle: f32, size: f32| {
        let values = random.values(shape.iter().product(), size);
        let values = values.into_iter().map(|x| x + middle).collect();
        tensors.insert(name, (shape, values));
    };
    let mut conv = |name: String, norm: String, [to, from, side]: [usize; 3]| {
        let size = (6.0 / (from * side * side) as f32).sqrt();
        put(
            format!("{name}.weight"),
            vec![to, from, side, side],
            0.0,
            size,
        );
        for (part, middle, size) in [
            ("scale", 1.0, 0.3),
            ("shift", 0.0, 0.3),
            ("mean", 0.0, 0.3),
            ("variance", 1.0, 0.3),
        ] {
            put(format!("{norm}.{part}"), vec![to], middle, size);
        }
    };
    let block = |conv: &mut dyn FnMut(String, String, [usize; 3]), name: String, from, to| {
        for (i, from) in [(0, from), (1, to)] {
            conv(
                format!("{name}.conv{i}"),
                format!("{name}.norm{i}"),
                [to, from, 3],
            );
        }
    };
    block(&mut conv, "down.0".into(), 4, width);
    for level in 1..5 {
        block(
            &mut conv,
            format!("down.{level}"),
            width << (level - 1),
            width << level,
        );
    }
    for level in 0..4 {
        let name = format!("up.{level}");
        let (from, to) = (width << (level + 1), width << level);
        let inner = (to / 2).max(1);
        conv(
            format!("{name}.conv"),
            format!("{name}.norm"),
            [to, from, 3],
        );
        for part in ["skip", "signal"] {
            let part = format!("{name}.gate.{part}");
            conv(part.clone(), format!("{part}_norm"), [inner, to, 1]);
        }
        block(&mut conv, format!("{name}.block"), 2 * to, to);
    }
    for level in 0..4 {
        let inner = ((width << level) / 2).max(1);
        put(
            format!("up.{level}.gate.score.weight"),
            vec![1, inner, 1, 1],
            0.0,
            1.0,
        );
        put(format!("up.{level}.gate.score.bias"), vec![1], 0.0, 1.0);
    }
    put("last.weight".into(), vec![3, width, 1, 1], 0.0, 1.0);
    put("last.bias".into(), vec![3], 0.0, 1.0);
    tensors
}

/// Waves with noise and a soft-edged hole at a different place in each grid.
pub(super) fn grids(count: usize) -> (Vec<f32>, Vec<f32>) {
    let mut random = Random(3);
    let (mut positions, mut known) = (Vec::new(), Vec::new());
    for grid in 0..count {
        let mask: Vec<f32> = (0..CELLS)
            .map(|at| {
                let (i, j) = (
                    (at % 64) as f32 - 20.0 - 7.0 * grid as f32,
                    (at / 64) as f32 - 30.0,
                );
                ((i * i + j * j).sqrt() / 4.0 - 3.0 + 0.1 * random.next()).clamp(0.03, 0.97)
            })
            .collect();
        for axis in 0..3 {
            positions.extend((0..CELLS).map(|at| {
                let (u, v) = ((at % 64) as f32 / 64.0, (at / 64) as f32 / 64.0);
                let plane = [
                    u - 0.5,
                    v - 0.5,
                    0.1 * (9.0 * u + 4.0 * v + grid as f32).sin(),
                ];
                plane[axis] + 0.003 * random.next()
            }));
        }
        known.extend(mask);
    }
    (positions, known)
}

pub(super) fn input<'a>(positions: &'a [f32], known: &'a [f32]) -> Input<'a> {
    Input {
        positions,
        known,
        base: None,
        up: None,
    }
}

pub(super) fn wide(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}

pub(super) fn targets() -> Vec<Isa> {
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

fn predict(
    engine: &Engine,
    scratch: &mut Scratch,
    (positions, known): (&[f32], &[f32]),
) -> Vec<f32> {
    let mut out = vec![f32::NAN; positions.len()];
    engine
        .predict(scratch, input(positions, known), &mut out)
        .unwrap();
    out
}

/// Prediction, gradient by positions, gradient by mask.
fn gradient(
    engine: &Engine,
    scratch: &mut Scratch,
    (positions, known): (&[f32], &[f32]),
    cotangent: &[f32],
) -> [Vec<f32>; 3] {
    let mut out = [positions.len(), positions.len(), known.len()].map(|n| vec![f32::NAN; n]);
    let [prediction, by_positions, by_known] = &mut out;
    let room = Gradient {
        prediction,
        by_positions,
        by_known,
    };
    let given = |grid: usize, _: &[f32], to: &mut [f32]| {
        to.copy_from_slice(&cotangent[grid * 3 * CELLS..][..3 * CELLS]);
    };
    engine
        .gradient(scratch, input(positions, known), &given, room)
        .unwrap();
    out
}

fn largest_gap(a: &[f32], b: &[f64]) -> f64 {
    let gaps = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - b).abs());
    // NaN must not hide.
    gaps.fold(0.0, |most, gap| if gap <= most { most } else { gap })
}

#[test]
fn the_engine_is_the_network() {
    for (width, input) in [
        (3, InputKind::Membrane),
        (8, InputKind::Zeros),
        (16, InputKind::Membrane),
        (24, InputKind::Zeros),
    ] {
        let (tensors, config) = (tensors(width), config(width, input));
        let (positions, mut known) = grids(1);
        if width == 16 {
            known.iter_mut().for_each(|k| *k = k.round());
        }
        let reference = Reference {
            tensors: &tensors,
            config,
        };
        let truth = reference.predict(&wide(&positions), &wide(&known));
        let size = truth.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(size > CELL, "the network must have a say in this test");
        for isa in targets() {
            let engine = engine(&tensors, config, isa, 1);
            let out = predict(&engine, &mut Scratch::default(), (&positions, &known));
            let gap = largest_gap(&out, &truth);
            eprintln!("width {width} {}: {:.2e} cells", isa.name(), gap / CELL);
            assert!(gap < 1e-4 * CELL, "{} width {width}: {gap}", isa.name());
        }
    }
}

#[test]
fn the_membrane_is_the_membrane() {
    let (positions, known) = grids(1);
    let mut holes = known.clone();
    holes.iter_mut().for_each(|k| *k = k.round());
    for known in [known, holes, vec![0.0; CELLS], vec![1.0; CELLS]] {
        let mut filled = vec![0.0; 3 * CELLS];
        let mut pyramid = membrane::Pyramid::default();
        membrane::membrane(
            Target::best(),
            &mut pyramid,
            (&positions, &known),
            &mut filled,
        );
        for axis in 0..3 {
            let axis = axis * CELLS..(axis + 1) * CELLS;
            let truth = membrane(&wide(&positions[axis.clone()]), &wide(&known), 0);
            assert!(largest_gap(&filled[axis], &truth) < 1e-6);
        }
    }
}

#[test]
fn the_gradient_is_the_difference_quotient() {
    for input in [InputKind::Membrane, InputKind::Zeros] {
        let (tensors, config) = (tensors(3), config(3, input));
        let (positions, known) = grids(1);
        let mut random = Random(11);
        let cotangent = random.values(positions.len(), 1.0);
        let reference = Reference {
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
        for isa in targets() {
            let engine = engine(&tensors, config, isa, 1);
            let mut scratch = Scratch::default();
            let [prediction, by_positions, by_known] =
                gradient(&engine, &mut scratch, (&positions, &known), &cotangent);
            let plain = predict(&engine, &mut scratch, (&positions, &known));
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
                eprintln!("{input:?} {}: {slope:.6} {quotient:.6}", isa.name());
                assert!(gap < 1e-3, "{}: {slope} {quotient}", isa.name());
            }
        }
    }
}

#[test]
fn company_and_threads_change_nothing() {
    let (tensors, config) = (tensors(5), config(5, InputKind::Membrane));
    let (positions, known) = grids(7);
    let cotangent = Random(5).values(positions.len(), 1.0);
    for isa in targets() {
        let alone = engine(&tensors, config, isa, 1);
        let mut scratch = Scratch::default();
        let mut each = [Vec::new(), Vec::new(), Vec::new()];
        for i in 0..7 {
            let (three, one) = (
                i * 3 * CELLS..(i + 1) * 3 * CELLS,
                i * CELLS..(i + 1) * CELLS,
            );
            let grid = (&positions[three.clone()], &known[one]);
            let parts = gradient(&alone, &mut scratch, grid, &cotangent[three]);
            for (all, part) in each.iter_mut().zip(parts) {
                all.extend(part);
            }
        }
        for threads in [1, 2, 3] {
            let engine = engine(&tensors, config, isa, threads);
            let together = gradient(&engine, &mut scratch, (&positions, &known), &cotangent);
            assert!(together == each, "{} {threads}", isa.name());
            let plain = predict(&engine, &mut scratch, (&positions, &known));
            assert!(plain == each[0], "{} {threads}", isa.name());
        }
        for threads in [2, 3, 7] {
            let engine = engine(&tensors, config, isa, threads);
            let grid = (&positions[..3 * CELLS], &known[..CELLS]);
            let shared = gradient(&engine, &mut scratch, grid, &cotangent[..3 * CELLS]);
            let same = shared.iter().zip(&each).all(|(a, b)| *a == b[..a.len()]);
            assert!(same, "{} {threads}: one grid", isa.name());
        }
    }
}

#[test]
fn instruction_sets_with_fused_products_agree_to_the_bit() {
    let (tensors, config) = (tensors(4), config(4, InputKind::Membrane));
    let (positions, known) = grids(2);
    let fused = targets().into_iter().filter(|isa| *isa != Isa::Portable);
    let answers: Vec<Vec<f32>> = fused
        .map(|isa| {
            let engine = engine(&tensors, config, isa, 1);
            predict(&engine, &mut Scratch::default(), (&positions, &known))
        })
        .collect();
    assert!(answers.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn what_is_wrong_has_a_name() {
    let mut weights = tensors(2);
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
    let engine = engine(&tensors(2), config(2, InputKind::Zeros), Isa::Portable, 1);
    let (positions, known) = grids(1);
    let mut out = vec![0.0; 5];
    let short = engine.predict(&mut Scratch::default(), input(&positions, &known), &mut out);
    assert!(short.unwrap_err().to_string().contains("`out`"));
}

#[test]
fn an_engine_is_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<Engine>();
}
