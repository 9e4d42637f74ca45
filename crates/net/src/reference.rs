//! The network a second time, in f64 with plain loops and unfused batch norm: the oracle of the engine's tests.
//!
//! It proves more than a comparison with burn's model: in f64, difference quotients with steps of 1e-9 are accurate enough to test the
//! engine's gradients, and the tests of this crate need no burn. The tests of `darn-lab` compare burn's loss of the anchor search with it.

use crate::config::{INPUT_SCALE, OUTPUT_SCALE, UnetConfig};
use crate::fill::{InputKind, NOTHING, SATURATION, SWEEPS};
use crate::tensors::NamedTensors;
use darn_geometry::grid::{CELLS, SIDE};

/// The channels of one image, each a square plane.
#[derive(Clone)]
struct ChannelPlanes {
    side: usize,
    planes: Vec<Vec<f64>>,
}

impl ChannelPlanes {
    fn map(mut self, f: impl Fn(f64) -> f64) -> ChannelPlanes {
        self.planes.iter_mut().flatten().for_each(|x| *x = f(*x));
        self
    }

    fn relu(self) -> ChannelPlanes {
        self.map(|x| x.max(0.0))
    }

    fn concat(mut self, other: ChannelPlanes) -> ChannelPlanes {
        self.planes.extend(other.planes);
        self
    }

    fn add(mut self, other: &ChannelPlanes) -> ChannelPlanes {
        let others = other.planes.iter().flatten();
        let all = self.planes.iter_mut().flatten();
        all.zip(others).for_each(|(x, y)| *x += y);
        self
    }

    /// Planes of another side: `f` gives a cell from its channel's plane, row and column.
    fn remap(self, side: usize, f: impl Fn(&[f64], usize, usize) -> f64) -> ChannelPlanes {
        let cells = |plane: &Vec<f64>| {
            let cells = (0..side * side).map(|at| f(plane, at / side, at % side));
            cells.collect()
        };
        ChannelPlanes {
            side,
            planes: self.planes.iter().map(cells).collect(),
        }
    }
}

/// A network by its tensors.
pub struct ReferenceNetwork<'a> {
    /// All tensors of the network.
    pub tensors: &'a NamedTensors,
    /// Its architecture.
    pub config: UnetConfig,
}

impl ReferenceNetwork<'_> {
    fn values(&self, name: &str) -> &[f32] {
        &self.tensors[name].1
    }

    /// A convolution of the tensor's own size, and its bias where it has one.
    fn conv(&self, name: &str, x: ChannelPlanes) -> ChannelPlanes {
        let (shape, weights) = &self.tensors[&format!("{name}.weight")];
        let (from, size) = (shape[1], shape[2]);
        let bias = self.tensors.get(&format!("{name}.bias"));
        let side = x.side as isize;
        let half = (size / 2) as isize;
        let plane = |to: usize| {
            let mut out = vec![bias.map_or(0.0, |b| f64::from(b.1[to])); x.side * x.side];
            for (k, plane) in x.planes.iter().enumerate() {
                for tap in 0..size * size {
                    let w = f64::from(weights[(to * from + k) * size * size + tap]);
                    let (down, right) =
                        ((tap / size) as isize - half, (tap % size) as isize - half);
                    for row in 0..side {
                        for column in 0..side {
                            let (r, c) = (row + down, column + right);
                            if (0..side).contains(&r) && (0..side).contains(&c) {
                                out[(row * side + column) as usize] +=
                                    w * plane[(r * side + c) as usize];
                            }
                        }
                    }
                }
            }
            out
        };
        ChannelPlanes {
            side: x.side,
            planes: (0..shape[0]).map(plane).collect(),
        }
    }

    fn norm(&self, name: &str, mut x: ChannelPlanes) -> ChannelPlanes {
        let value = |part: &str, c: usize| f64::from(self.values(&format!("{name}.{part}"))[c]);
        for (c, plane) in x.planes.iter_mut().enumerate() {
            let deviation = (value("variance", c) + 1e-5).sqrt();
            for x in plane {
                *x = (*x - value("mean", c)) / deviation * value("scale", c) + value("shift", c);
            }
        }
        x
    }

    fn block(&self, name: &str, x: ChannelPlanes) -> ChannelPlanes {
        let half = |i: usize, x: ChannelPlanes| {
            let x = self.conv(&format!("{name}.conv{i}"), x);
            self.norm(&format!("{name}.norm{i}"), x).relu()
        };
        half(1, half(0, x))
    }

    fn gate(&self, name: &str, skip: ChannelPlanes, signal: ChannelPlanes) -> ChannelPlanes {
        let part = |part: &str, x: ChannelPlanes| {
            let x = self.conv(&format!("{name}.{part}"), x);
            self.norm(&format!("{name}.{part}_norm"), x)
        };
        let joint = part("skip", skip.clone()).add(&part("signal", signal));
        let score = self.conv(&format!("{name}.score"), joint.relu());
        let open = score.map(|x| 1.0 / (1.0 + (-x).exp()));
        let mut skip = skip;
        for plane in &mut skip.planes {
            let both = plane.iter_mut().zip(&open.planes[0]);
            both.for_each(|(x, open)| *x *= open);
        }
        skip
    }

    fn up(&self, name: &str, x: ChannelPlanes, skip: ChannelPlanes) -> ChannelPlanes {
        let from = x.side;
        let x = x.remap(skip.side, |p, r, c| p[r / 2 * from + c / 2]);
        let x = self.conv(&format!("{name}.conv"), x);
        let x = self.norm(&format!("{name}.norm"), x).relu();
        let skip = self.gate(&format!("{name}.gate"), skip, x.clone());
        self.block(&format!("{name}.block"), skip.concat(x))
    }

    fn forward(&self, mut x: ChannelPlanes) -> ChannelPlanes {
        let mut skips = Vec::new();
        for level in 0..5 {
            if level > 0 {
                let side = x.side;
                x = x.remap(side / 2, |p, r, c| {
                    let at = 2 * r * side + 2 * c;
                    p[at].max(p[at + 1]).max(p[at + side]).max(p[at + side + 1])
                });
            }
            x = self.block(&format!("down.{level}"), x);
            skips.push(x.clone());
        }
        skips.pop();
        for level in (0..4).rev() {
            if let Some(skip) = skips.pop() {
                x = self.up(&format!("up.{level}"), x, skip);
            }
        }
        self.conv("last", x)
    }

    /// The prediction `[3, 64, 64]` for one grid of positions `[3, 64, 64]` and mask `[1, 64, 64]` without a base.
    pub fn predict(&self, positions: &[f64], known: &[f64]) -> Vec<f64> {
        self.predict_over(&vec![0.0; positions.len()], positions, known)
    }

    /// The prediction for one grid with a base `[3, 64, 64]`.
    pub fn predict_over(&self, base: &[f64], positions: &[f64], known: &[f64]) -> Vec<f64> {
        let off: Vec<f64> = positions.iter().zip(base).map(|(x, b)| x - b).collect();
        let given = |axis: usize| off[axis * CELLS..][..CELLS].to_vec();
        let mask = ChannelPlanes {
            side: SIDE,
            planes: vec![known.to_vec()],
        };
        let mut filled = ChannelPlanes {
            side: SIDE,
            planes: (0..3).map(given).collect(),
        };
        for (axis, plane) in filled.planes.iter_mut().enumerate() {
            match self.config.input {
                InputKind::Membrane | InputKind::Plate => {
                    let over = membrane(plane, known);
                    let base = &base[axis * CELLS..][..CELLS];
                    *plane = over.iter().zip(base).map(|(x, b)| x + b).collect();
                }
                InputKind::Zeros => plane.iter_mut().zip(known).for_each(|(x, k)| *x *= k),
            }
        }
        let x = filled.clone().map(|x| x * f64::from(INPUT_SCALE));
        let y = self
            .forward(x.concat(mask))
            .map(|x| x * f64::from(OUTPUT_SCALE));
        let y = match self.config.input {
            InputKind::Membrane | InputKind::Plate => y.add(&filled),
            InputKind::Zeros => y,
        };
        y.planes.concat()
    }
}

/// The membrane of one plane of positions.
pub fn membrane(positions: &[f64], known: &[f64]) -> Vec<f64> {
    let values: Vec<f64> = positions.iter().zip(known).map(|(x, k)| x * k).collect();
    pyramid(&values, known, 0)
}

/// The fill of one plane at a level, given its values times their weights.
fn pyramid(values: &[f64], weight: &[f64], level: usize) -> Vec<f64> {
    let side = SIDE >> level;
    let share: Vec<f64> = weight
        .iter()
        .map(|w| match level {
            0 => *w,
            _ => (w * f64::from(SATURATION)).min(1.0),
        })
        .collect();
    let given: Vec<f64> = (0..side * side)
        .map(|i| values[i] / (weight[i] + f64::from(NOTHING)) * share[i])
        .collect();
    if side == 1 {
        return given;
    }
    let halve = |x: &[f64]| -> Vec<f64> {
        let mean = |at: usize| {
            let (r, c) = (at / (side / 2), at % (side / 2));
            let at = 2 * r * side + 2 * c;
            (x[at] + x[at + 1] + x[at + side] + x[at + side + 1]) / 4.0
        };
        (0..side * side / 4).map(mean).collect()
    };
    let coarse = pyramid(&halve(values), &halve(weight), level + 1);
    let n = side / 2;
    let along = |fine: usize| -> [(usize, f64); 2] {
        let at = ((fine as f64 + 0.5) / 2.0 - 0.5).clamp(0.0, (n - 1) as f64);
        let low = at.floor();
        [
            (low as usize, 1.0 - (at - low)),
            ((low as usize + 1).min(n - 1), at - low),
        ]
    };
    let mut u: Vec<f64> = (0..side * side)
        .map(|at| {
            let mut sum = 0.0;
            for (r, wr) in along(at / side) {
                for (c, wc) in along(at % side) {
                    sum += wr * wc * coarse[r * n + c];
                }
            }
            given[at] + sum * (1.0 - share[at])
        })
        .collect();
    for _ in 0..SWEEPS.get(level).copied().unwrap_or(0) {
        u = (0..side * side)
            .map(|at| {
                let (r, c) = (at / side, at % side);
                let mean = (u[r.saturating_sub(1) * side + c]
                    + u[(r + 1).min(side - 1) * side + c]
                    + u[r * side + c.saturating_sub(1)]
                    + u[r * side + (c + 1).min(side - 1)])
                    / 4.0;
                given[at] + mean * (1.0 - share[at])
            })
            .collect();
    }
    u
}
