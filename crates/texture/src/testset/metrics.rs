//! How near a picture of a hole comes to the truth.

use super::fabric::Swatch;
use super::ssim::{LightPair, window};

/// A picture of the patch beside the truth.
pub struct Comparison<'a> {
    /// Columns of the pictures.
    pub width: usize,
    /// What was made, sRGB.
    pub made: &'a [[u8; 4]],
    /// What is true, sRGB.
    pub truth: &'a [[u8; 4]],
    /// Which texels were to be filled.
    pub hole: &'a [bool],
    /// Which texels the cloth covers.
    pub known: &'a [bool],
}

/// The numbers of one comparison.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scores {
    /// Mean CIEDE2000 in the hole.
    pub delta_e: f64,
    /// Share of the hole's texels within 10.
    pub within_10: f64,
    /// Mean structural similarity of the lightness in the hole, windows of 7 × 7.
    pub ssim: f64,
    /// Mean step of lightness across the seam ÷ that of the truth.
    pub seam: f64,
    /// Displacement against the truth at the seam, in periods; NaN for fabrics without one.
    pub phase: f64,
}

impl Comparison<'_> {
    /// All numbers.
    pub fn scores(&self, phases: &Phases) -> Scores {
        let lab = |t: &[u8; 4]| lab([t[0], t[1], t[2]]);
        let (made, truth): (Vec<[f64; 3]>, Vec<[f64; 3]>) = (
            self.made.iter().map(lab).collect(),
            self.truth.iter().map(lab).collect(),
        );
        let texels: Vec<usize> = (0..self.hole.len()).filter(|at| self.hole[*at]).collect();
        let count = texels.len().max(1) as f64;
        let differences: Vec<f64> = texels
            .iter()
            .map(|at| ciede2000(made[*at], truth[*at]))
            .collect();
        let light = |all: &[[f64; 3]]| all.iter().map(|c| c[0]).collect::<Vec<f64>>();
        let (made, truth) = (light(&made), light(&truth));
        let pair = LightPair {
            width: self.width,
            made: &made,
            truth: &truth,
        };
        Scores {
            delta_e: differences.iter().sum::<f64>() / count,
            within_10: differences.iter().filter(|d| **d <= 10.0).count() as f64 / count,
            ssim: texels.iter().map(|at| pair.ssim(*at)).sum::<f64>() / count,
            seam: self.seam(&made) / self.seam(&truth).max(1e-9),
            phase: self.phase(&made, &truth, phases),
        }
    }

    fn seam(&self, light: &[f64]) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0f64);
        for at in 0..self.hole.len() {
            for other in [at + 1, at + self.width] {
                let wraps = other == at + 1 && other % self.width == 0;
                if wraps || other >= self.hole.len() {
                    continue;
                }
                if self.hole[at] && self.known[other] || self.known[at] && self.hole[other] {
                    sum += (light[at] - light[other]).abs();
                    count += 1.0;
                }
            }
        }
        sum / count.max(1.0)
    }

    /// The displacement, within half a period, at which what was made fits the truth best along the seam.
    fn phase(&self, made: &[f64], truth: &[f64], phases: &Phases) -> f64 {
        if phases.periods == [0.0; 2] {
            return f64::NAN;
        }
        let near = |at: usize| window(self.width, self.hole.len(), at, 10);
        let near: Vec<usize> = (0..self.hole.len())
            .filter(|at| self.hole[*at] && near(*at).any(|k| self.known[k]))
            .collect();
        let (width, height) = (self.width as i64, (self.hole.len() / self.width) as i64);
        let cost = |[dx, dy]: [i64; 2]| {
            let (mut sum, mut count) = (0.0, 0.0f64);
            for at in &near {
                let (x, y) = (
                    (*at % self.width) as i64 + dx,
                    (*at / self.width) as i64 + dy,
                );
                if x >= 0 && y >= 0 && x < width && y < height {
                    sum += (made[*at] - truth[(y * width + x) as usize]).powi(2);
                    count += 1.0;
                }
            }
            sum / count.max(1.0)
        };
        let mut best = (f64::INFINITY, [0i64; 2]);
        for by in phases.movements() {
            let own = cost(by);
            if own < best.0 {
                best = (own, by);
            }
        }
        let [dx, dy] = best.1;
        let fraction = |before: [i64; 2], after: [i64; 2]| {
            let (before, after) = (cost(before), cost(after));
            let bend = before + after - 2.0 * best.0;
            if bend > 1e-9 {
                (0.5 * (before - after) / bend).clamp(-0.5, 0.5)
            } else {
                0.0
            }
        };
        let x = dx as f64 + fraction([dx - 1, dy], [dx + 1, dy]);
        let y = dy as f64 + fraction([dx, dy - 1], [dx, dy + 1]);
        let [along, across] = phases.of([x, y]);
        along.hypot(across)
    }
}

/// Movements over a picture in periods of its pattern.
pub struct Phases {
    swatch: Swatch,
    /// Length of a texel on the cloth.
    step: f32,
    periods: [f32; 2],
}

impl Phases {
    /// For pictures with texels of a length.
    pub fn new(swatch: &Swatch, step: f64) -> Phases {
        Phases {
            swatch: *swatch,
            step: step as f32,
            periods: swatch.fabric.periods(),
        }
    }

    fn pattern(&self, [x, y]: [f64; 2]) -> [f32; 2] {
        // Rows go down.
        self.swatch
            .movement([x as f32 * self.step, -(y as f32) * self.step])
    }

    /// A movement in texels in periods along each axis of the pattern; zero along an axis without.
    fn of(&self, movement: [f64; 2]) -> [f64; 2] {
        let along = self.pattern(movement);
        [0, 1].map(|k: usize| match self.periods[k] {
            0.0 => 0.0,
            period => f64::from(along[k] / period),
        })
    }

    /// Whether no repeat of the pattern is nearer to a movement, given in periods, than standing still.
    fn is_least(&self, [x, y]: [f64; 2]) -> bool {
        let mut repeats = self.swatch.fabric.repeats_within().iter();
        repeats.all(|r| {
            let r = r.map(f64::from);
            2.0 * (x * r[0] + y * r[1]).abs() <= 1.001 * (r[0] * r[0] + r[1] * r[1])
        })
    }

    /// All movements of whole texels within half a period; along an axis without a period, within half a texel.
    fn movements(&self) -> impl Iterator<Item = [i64; 2]> + '_ {
        let longest = self.periods[0].max(self.periods[1]);
        let texel = self.pattern([1.0, 0.0]);
        let texel = texel[0].hypot(texel[1]);
        let reach = (0.75 * longest / texel).ceil() as i64;
        let within = move |by: &[i64; 2]| {
            let along = self.pattern(by.map(|x| x as f64));
            (0..2).all(|k| {
                let most = match self.periods[k] {
                    0.0 => 0.51 * texel,
                    period => 0.5 * period,
                };
                along[k].abs() <= most
            }) && self.is_least(self.of(by.map(|x| x as f64)))
        };
        (-reach..=reach)
            .flat_map(move |y| (-reach..=reach).map(move |x| [x, y]))
            .filter(within)
    }
}

/// CIE L*a*b* (D65) of an sRGB colour.
pub fn lab(colour: [u8; 3]) -> [f64; 3] {
    let [r, g, b] = colour.map(|x| crate::srgb::decode(f64::from(x) / 255.0));
    let x = (0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b) / 0.950_47;
    let y = 0.212_672_9 * r + 0.715_152_2 * g + 0.072_175 * b;
    let z = (0.019_333_9 * r + 0.119_192 * g + 0.950_304_1 * b) / 1.088_83;
    let f = |t: f64| {
        if t > 0.008_856 {
            t.cbrt()
        } else {
            7.787 * t + 16.0 / 116.0
        }
    };
    let (x, y, z) = (f(x), f(y), f(z));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIEDE2000 (Sharma, Wu and Dalal 2005).
pub fn ciede2000(first: [f64; 3], second: [f64; 3]) -> f64 {
    let chroma = |c: [f64; 3]| c[1].hypot(c[2]);
    let seventh = |c: f64| (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt();
    let g = 0.5 * (1.0 - seventh(0.5 * (chroma(first) + chroma(second))));
    let polar = |[l, a, b]: [f64; 3]| {
        let a = (1.0 + g) * a;
        (l, a.hypot(b), b.atan2(a).to_degrees().rem_euclid(360.0))
    };
    let ((l1, c1, h1), (l2, c2, h2)) = (polar(first), polar(second));
    let grey = c1 * c2 == 0.0;
    let turn = match h2 - h1 {
        _ if grey => 0.0,
        d if d > 180.0 => d - 360.0,
        d if d < -180.0 => d + 360.0,
        d => d,
    };
    let (l, c) = (0.5 * (l1 + l2), 0.5 * (c1 + c2));
    let h = match h1 + h2 {
        sum if grey => sum,
        sum if (h1 - h2).abs() <= 180.0 => 0.5 * sum,
        sum if sum < 360.0 => 0.5 * (sum + 360.0),
        sum => 0.5 * (sum - 360.0),
    };
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(h - 30.0) + 0.24 * cos(2.0 * h) + 0.32 * cos(3.0 * h + 6.0)
        - 0.2 * cos(4.0 * h - 63.0);
    let sl = 1.0 + 0.015 * (l - 50.0).powi(2) / (20.0 + (l - 50.0).powi(2)).sqrt();
    let (sc, sh) = (1.0 + 0.045 * c, 1.0 + 0.015 * c * t);
    let rotation = -2.0
        * seventh(c)
        * (60.0 * (-((h - 275.0) / 25.0).powi(2)).exp())
            .to_radians()
            .sin();
    let (dl, dc) = ((l2 - l1) / sl, (c2 - c1) / sc);
    let dh = 2.0 * (c1 * c2).sqrt() * (0.5 * turn).to_radians().sin() / sh;
    (dl * dl + dc * dc + dh * dh + rotation * dc * dh)
        .max(0.0)
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_those_of_the_published_pairs() {
        let pairs = [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
            (
                [60.2574, -34.0099, 36.2677],
                [60.4626, -34.1751, 39.4387],
                1.2644,
            ),
            (
                [22.7233, 20.0904, -46.694],
                [23.0331, 14.973, -42.5619],
                2.0373,
            ),
        ];
        for (first, second, wanted) in pairs {
            let got = ciede2000(first, second);
            assert!((got - wanted).abs() < 1e-4, "{got} {wanted}");
        }
    }
}
