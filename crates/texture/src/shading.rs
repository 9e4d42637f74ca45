//! Slow changes of light over the cloth: what differs between places that should look the same.

use nalgebra::{Matrix5, Vector5};

/// A quadratic in a raster's coordinates without a constant (x, y, x², xy, y²) for each of four channels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shading {
    scale: f32,
    terms: [Vector5<f32>; 4],
}

/// Two texels that should look the same: their places, and by how much the second is brighter.
pub(crate) struct Pair {
    pub from: [f32; 2],
    pub to: [f32; 2],
    pub change: [f32; 4],
}

/// Share of the pairs' differences that a shading must explain to be one.
const LEAST_SHARE: f64 = 0.08;
/// Rounds of reweighting, so that pairs that do not look the same count little.
const ROUNDS: usize = 4;

impl Shading {
    /// The quadratics whose changes fit those of the pairs best (least squares with Cauchy weights); `None` when there is no shading to speak of.
    pub(crate) fn fit(pairs: &[Pair], longest_side: usize) -> Option<Shading> {
        let scale = 2.0 / longest_side as f32;
        let rows: Vec<Vector5<f32>> = (pairs.iter())
            .map(|pair| basis(pair.to.map(|x| x * scale)) - basis(pair.from.map(|x| x * scale)))
            .collect();
        let mut shading = Shading {
            scale,
            terms: [Vector5::zeros(); 4],
        };
        let size = |change: [f32; 4]| change.iter().map(|x| x * x).sum::<f32>();
        for _ in 0..ROUNDS {
            let left: Vec<f32> = (pairs.iter().zip(&rows))
                .map(|(pair, row)| size(shading.left(pair, row)))
                .collect();
            let middle = median(&left).max(1e-7);
            let mut normal = Matrix5::<f64>::identity() * 1e-9;
            let mut right = [Vector5::<f64>::zeros(); 4];
            for ((pair, row), left) in pairs.iter().zip(&rows).zip(&left) {
                let weight = 1.0 / (1.0 + f64::from(left / middle));
                let row: Vector5<f64> = row.cast();
                normal += row * row.transpose() * weight;
                (0..4).for_each(|c| right[c] += row * (weight * f64::from(pair.change[c])));
            }
            // A ridge, so that a direction without pairs has no slope.
            normal += Matrix5::identity() * (1e-3 * normal.trace());
            let inverse = normal.try_inverse()?;
            shading.terms = right.map(|r| (inverse * r).cast());
        }
        let weighed = |left: &dyn Fn(usize) -> f32| -> f64 {
            let sizes: Vec<f32> = (0..pairs.len()).map(left).collect();
            f64::from(median(&sizes))
        };
        let before = weighed(&|k| size(pairs[k].change));
        let after = weighed(&|k| size(shading.left(&pairs[k], &rows[k])));
        (before - after > LEAST_SHARE * before && before > 1e-7).then_some(shading)
    }

    /// What of a pair's change the quadratics do not explain.
    fn left(&self, pair: &Pair, row: &Vector5<f32>) -> [f32; 4] {
        std::array::from_fn(|c| pair.change[c] - self.terms[c].dot(row))
    }

    /// Values at a texel.
    pub(crate) fn at(&self, [x, y]: [f32; 2]) -> [f32; 4] {
        let basis = basis([x * self.scale, y * self.scale]);
        self.terms.map(|t| t.dot(&basis))
    }
}

fn basis([x, y]: [f32; 2]) -> Vector5<f32> {
    Vector5::new(x, y, x * x, x * y, y * y)
}

fn median(values: &[f32]) -> f32 {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(light: impl Fn([f32; 2]) -> f32) -> Vec<Pair> {
        (0..900)
            .map(|k| {
                let from = [(k % 30) as f32 * 5.0, (k / 30) as f32 * 5.0];
                let to = [
                    from[0] + (k % 7) as f32 * 9.0 - 20.0,
                    from[1] + (k % 5) as f32 * 9.0 - 15.0,
                ];
                // Every ninth pair does not look the same.
                let wrong = if k % 9 == 0 { 0.5 } else { 0.0 };
                Pair {
                    from,
                    to,
                    change: [light(to) - light(from) + wrong, wrong, 0.0, 0.0],
                }
            })
            .collect()
    }

    #[test]
    fn a_slope_of_light_is_found_among_wrong_pairs() {
        let light = |p: [f32; 2]| 0.001 * p[0] - 0.000_01 * p[1] * p[1];
        let shading = Shading::fit(&pairs(light), 150).unwrap();
        for p in [[10.0, 20.0], [140.0, 60.0]] {
            let got = shading.at(p)[0] - shading.at([70.0, 70.0])[0];
            let wanted = light(p) - light([70.0, 70.0]);
            assert!((got - wanted).abs() < 0.01, "{got} {wanted}");
        }
    }

    #[test]
    fn cloth_in_even_light_has_no_shading() {
        assert!(Shading::fit(&pairs(|_| 0.3), 150).is_none());
    }
}
