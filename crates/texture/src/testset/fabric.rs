//! Ten kinds of fabric as functions of the place, in texels.

use std::f32::consts::{PI, TAU};

use super::draw::{Draw, Family};

/// A fabric with a known colour everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fabric {
    /// Plain weave.
    Plain,
    /// Twill: diagonal lines.
    Twill,
    /// Stripes of four colours, a little askew.
    Stripes,
    /// A tartan.
    Plaid,
    /// Flowers in a half-drop repeat.
    Print,
    /// Discs and rings of several colours in a large repeat.
    LargePrint,
    /// Round openings in a hexagonal net.
    Lace,
    /// Knitted stitches.
    Knit,
    /// A band with a motif across plain cloth.
    Border,
    /// Irregular, like a photograph, in uneven light.
    Photograph,
}

/// All fabrics.
pub const FABRICS: [Fabric; 10] = [
    Fabric::Plain,
    Fabric::Twill,
    Fabric::Stripes,
    Fabric::Plaid,
    Fabric::Print,
    Fabric::LargePrint,
    Fabric::Lace,
    Fabric::Knit,
    Fabric::Border,
    Fabric::Photograph,
];

/// sRGB from 0 to 1.
pub(super) type Colour = [f32; 3];

fn mix(a: Colour, b: Colour, t: f32) -> Colour {
    std::array::from_fn(|k| a[k] + t.clamp(0.0, 1.0) * (b[k] - a[k]))
}

fn scaled(a: Colour, by: f32) -> Colour {
    a.map(|x| x * by)
}

/// A number from −1 to 1 for a lattice point.
fn hash(x: i32, y: i32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x85EB_CA6B) ^ (y as u32).wrapping_mul(0xC2B2_AE35);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    (h ^ (h >> 15)) as f32 / 2_147_483_648.0 - 1.0
}

/// Smooth noise from −1 to 1 with features of size 1.
fn noise(x: f32, y: f32) -> f32 {
    let (i, j) = (x.floor(), y.floor());
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (s, t) = (smooth(x - i), smooth(y - j));
    let at = |a: i32, b: i32| hash(i as i32 + a, j as i32 + b);
    let top = at(0, 0) + s * (at(1, 0) - at(0, 0));
    let bottom = at(0, 1) + s * (at(1, 1) - at(0, 1));
    top + t * (bottom - top)
}

/// 1 inside of an edge, 0 outside, over one texel; `inward` is the distance to the edge.
fn edge(inward: f32) -> f32 {
    (inward + 0.5).clamp(0.0, 1.0)
}

/// x within a period, centred on zero.
fn centred(x: f32, period: f32) -> f32 {
    x - period * (x / period).round()
}

impl Fabric {
    /// A name for tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Fabric::Plain => "plain",
            Fabric::Twill => "twill",
            Fabric::Stripes => "stripes",
            Fabric::Plaid => "plaid",
            Fabric::Print => "print",
            Fabric::LargePrint => "large print",
            Fabric::Lace => "lace",
            Fabric::Knit => "knit",
            Fabric::Border => "border",
            Fabric::Photograph => "photograph",
        }
    }

    /// Lengths of the pattern after which it looks the same along its axes; zero where it does not, or where it does not change.
    pub fn periods(self) -> [f32; 2] {
        match self {
            Fabric::Plain => [6.4, 6.4],
            Fabric::Twill => [9.3, 9.3],
            Fabric::Stripes => [37.5, 0.0],
            Fabric::Plaid => [52.3, 52.3],
            Fabric::Print => [61.0, 47.0],
            Fabric::LargePrint => [96.0, 84.0],
            Fabric::Lace => [24.6, 42.6],
            Fabric::Knit => [10.7, 8.2],
            Fabric::Border => [33.4, 0.0],
            Fabric::Photograph => [0.0, 0.0],
        }
    }

    /// Movements within a period, in periods, that leave the pattern as it is; [`Fabric::periods`] are not the shortest ones then.
    pub fn repeats_within(self) -> &'static [[f32; 2]] {
        match self {
            Fabric::Plain | Fabric::Lace => &[[0.5, 0.5], [0.5, -0.5]],
            Fabric::Twill => &[[0.25, -0.25], [0.5, 0.5]],
            Fabric::Print => &[[1.0, 0.5], [1.0, -0.5]],
            _ => &[],
        }
    }
}

/// A cloth of one kind: the kind as the constants of the completion were chosen on it, or a sibling.
///
/// Siblings are turned, have another scale along each axis, other colours and other numbers in their pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swatch {
    /// The kind.
    pub fabric: Fabric,
    draw: Draw,
    /// Radians from the sheet's axes to the pattern's.
    turn: f32,
    /// Lengths of the pattern in one of the sheet, along the pattern's axes.
    scale: [f32; 2],
    /// The pattern's point in the middle of the sheet.
    shift: [f32; 2],
}

impl Swatch {
    /// The member of a family.
    pub fn new(fabric: Fabric, family: Family) -> Swatch {
        let draw = Draw::new(family, fabric.name());
        let scale = draw.between(1, 1.0, [0.7, 1.4]);
        // The border stays in the middle, and the photograph has its light there.
        let most = match fabric {
            Fabric::Border => [200.0, 12.0],
            Fabric::Photograph => [0.0; 2],
            _ => [200.0; 2],
        };
        Swatch {
            fabric,
            draw,
            turn: draw.between(3, 0.0, [-PI, PI]),
            scale: [scale, scale * draw.between(2, 1.0, [0.92, 1.08])],
            shift: [0, 1].map(|k: usize| draw.between(4 + k as u32, 0.0, [-most[k], most[k]])),
        }
    }

    /// A movement over the sheet in the pattern's lengths, along its axes.
    pub fn movement(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        let (sin, cos) = self.turn.sin_cos();
        [
            self.scale[0] * (cos * x + sin * y),
            self.scale[1] * (cos * y - sin * x),
        ]
    }

    /// sRGB from 0 to 1 at a place of the sheet, in texels from the middle.
    pub fn colour(&self, place: [f32; 2]) -> Colour {
        let [x, y] = self.movement(place);
        let (x, y) = (x + self.shift[0], y + self.shift[1]);
        let draw = &self.draw;
        let colour = match self.fabric {
            Fabric::Plain => weave(x, y, 6.4, [0.62, 0.55, 0.45]),
            Fabric::Twill => twill(x, y),
            Fabric::Stripes => stripes(x, y, draw),
            Fabric::Plaid => plaid(x, y, draw),
            Fabric::Print => print(x, y, draw),
            Fabric::LargePrint => large_print(x, y, draw),
            Fabric::Lace => lace(x, y, draw),
            Fabric::Knit => knit(x, y),
            Fabric::Border => border(x, y, draw),
            Fabric::Photograph => photograph(x, y, draw),
        };
        // Uneven yarn.
        let amount = draw.between(6, 1.0, [0.5, 1.8]);
        let uneven = 0.012 * noise(0.31 * x, 0.29 * y) + 0.008 * noise(0.9 * x + 70.0, 0.9 * y);
        let order = draw.between(7, 0.0, [0.0, 6.0]) as usize;
        CHANNELS[order.min(5)].map(|k| (colour[k] + amount * uneven).clamp(0.0, 1.0))
    }
}

/// Orders of red, green and blue.
const CHANNELS: [[usize; 3]; 6] = [
    [0, 1, 2],
    [1, 2, 0],
    [2, 0, 1],
    [0, 2, 1],
    [2, 1, 0],
    [1, 0, 2],
];

fn weave(x: f32, y: f32, period: f32, colour: Colour) -> Colour {
    let (u, v) = (TAU * x / period, TAU * y / period);
    // Warp over weft where the product is positive.
    let over = u.cos() * v.cos();
    scaled(colour, 0.86 + 0.14 * over)
}

fn twill(x: f32, y: f32) -> Colour {
    let t = 0.5 + 0.5 * (TAU * (x + y) / 9.3).sin();
    let thread = 0.06 * (TAU * (x - y) / 9.3 * 2.0).cos();
    scaled(mix([0.16, 0.22, 0.42], [0.42, 0.5, 0.68], t), 1.0 + thread)
}

fn stripes(x: f32, y: f32, draw: &Draw) -> Colour {
    let (sin, cos) = 0.17f32.sin_cos();
    let t = (cos * x + sin * y).rem_euclid(37.5 * cos) / cos;
    let bands = [
        (0.0, [0.85, 0.82, 0.74]),
        (draw.about(20, 14.0), [0.55, 0.16, 0.18]),
        (draw.about(21, 20.0), [0.9, 0.75, 0.4]),
        (draw.about(22, 24.0), [0.14, 0.25, 0.38]),
    ];
    let mut colour = bands[3].1;
    for (start, own) in bands {
        colour = mix(colour, own, edge(t - start));
    }
    // The last band ends where the first begins.
    scaled(
        mix(colour, bands[0].1, edge(t - 37.5)),
        0.97 + 0.03 * (TAU * y / 3.7).sin(),
    )
}

fn plaid(x: f32, y: f32, draw: &Draw) -> Colour {
    let (wide, middle, narrow) = (
        draw.about(20, 15.0),
        draw.about(21, 9.0),
        draw.about(22, 2.0),
    );
    let sett = |t: f32| -> Colour {
        let d = centred(t, 52.3).abs();
        let mut colour = [0.12, 0.28, 0.2];
        colour = mix([0.65, 0.12, 0.13], colour, edge(d - wide));
        colour = mix([0.12, 0.28, 0.2], colour, edge(d - middle));
        mix([0.88, 0.84, 0.7], colour, edge(d - narrow))
    };
    let over = 0.5 + 0.5 * (TAU * (x + y) / 5.23).sin();
    mix(sett(x), sett(y), over)
}

fn print(x: f32, y: f32, draw: &Draw) -> Colour {
    let column = (x / 61.0).round();
    let drop = if column.rem_euclid(2.0) > 0.5 {
        23.5
    } else {
        0.0
    };
    let (u, v) = (x - 61.0 * column, centred(y - drop, 47.0));
    let (r, angle) = (u.hypot(v), v.atan2(u));
    let petals = draw.about(20, 11.0)
        + draw.about(21, 5.0) * (draw.between(22, 5.0, [3.0, 7.99]).floor() * angle).cos();
    let ground = weave(x, y, 4.0, [0.9, 0.87, 0.8]);
    let flower = mix(ground, [0.74, 0.2, 0.34], edge(petals - r));
    let heart = mix(flower, [0.95, 0.78, 0.2], edge(draw.about(23, 4.5) - r));
    let stem = (u - 0.15 * v).abs();
    let leaf = edge(1.2 - stem) * edge(v - 15.0);
    mix(heart, [0.2, 0.42, 0.22], leaf)
}

fn large_print(x: f32, y: f32, draw: &Draw) -> Colour {
    let mut colour = weave(x, y, 4.0, [0.2, 0.24, 0.3]);
    let motifs = [
        (20.0, 18.0, 15.0, [0.85, 0.5, 0.25]),
        (66.0, 30.0, 21.0, [0.3, 0.55, 0.6]),
        (30.0, 60.0, 18.0, [0.8, 0.75, 0.6]),
        (80.0, 72.0, 10.0, [0.65, 0.2, 0.25]),
    ];
    for (k, (cx, cy, radius, own)) in (20..).step_by(3).zip(motifs) {
        let cx = cx + draw.between(k, 0.0, [-12.0, 12.0]);
        let cy = cy + draw.between(k + 1, 0.0, [-12.0, 12.0]);
        let radius = draw.about(k + 2, radius);
        let r = centred(x - cx, 96.0).hypot(centred(y - cy, 84.0));
        colour = mix(colour, own, edge(radius - r));
        colour = mix(
            colour,
            scaled(own, 0.5),
            edge(2.0 - (r - 0.6 * radius).abs()),
        );
    }
    colour
}

fn lace(x: f32, y: f32, draw: &Draw) -> Colour {
    let opening_radius = draw.about(20, 8.0);
    let rows = 21.3;
    let row = (y / rows).round();
    let shift = if row.rem_euclid(2.0) > 0.5 { 12.3 } else { 0.0 };
    let (u, v) = (centred(x - shift, 24.6), y - rows * row);
    let r = u.hypot(v);
    let thread = 0.92 + 0.08 * (TAU * r / 3.0).cos();
    let opening = mix(
        scaled([0.88, 0.86, 0.8], thread),
        [0.1, 0.09, 0.1],
        edge(opening_radius - r),
    );
    let cross = edge(1.0 - u.abs()).max(edge(1.0 - v.abs())) * edge(opening_radius - r);
    mix(opening, [0.82, 0.8, 0.75], cross)
}

fn knit(x: f32, y: f32) -> Colour {
    let u = centred(x, 10.7) / 10.7;
    let t = (y / 8.2 + 1.4 * u.abs()).rem_euclid(1.0);
    let stitch = (t * std::f32::consts::PI).sin();
    let groove = 1.0 - 0.35 * (-(u * 10.7).powi(2) / 2.0).exp();
    scaled([0.55, 0.3, 0.34], (0.62 + 0.45 * stitch) * groove)
}

fn border(x: f32, y: f32, draw: &Draw) -> Colour {
    let ground = weave(x, y, 5.1, [0.82, 0.8, 0.76]);
    // The band lies 7 texels above the origin, where the holes' middle is.
    let v = y - 7.0;
    let band = mix(
        ground,
        [0.3, 0.12, 0.2],
        edge(draw.about(20, 24.0) - v.abs()),
    );
    let u = centred(x, 33.4);
    let diamond = mix(
        band,
        [0.86, 0.68, 0.3],
        edge(draw.about(21, 14.0) - u.abs() - v.abs()),
    );
    let eye = mix(
        diamond,
        [0.2, 0.4, 0.5],
        edge(draw.about(22, 5.0) - u.hypot(v)),
    );
    let zigzag = (v.abs() - 19.0 - 2.0 * (TAU * x / 16.7).sin()).abs();
    mix(eye, [0.9, 0.86, 0.7], edge(1.3 - zigzag))
}

fn photograph(x: f32, y: f32, draw: &Draw) -> Colour {
    let mut sum = 0.0;
    // Another part of the same noise.
    let part = draw.between(20, 0.0, [100.0, 900.0]);
    for (k, size) in [48.0f32, 21.0, 9.0, 4.0, 2.0].into_iter().enumerate() {
        let shift = 100.0 * k as f32;
        sum += (0.055 - 0.006 * k as f32) * noise(x / size + shift + part, y / size - shift);
    }
    let light = 0.9 + draw.between(21, 0.0006, [-0.0009, 0.0009]) * x
        - draw.between(22, 0.000_35, [-0.0005, 0.0005]) * y
        - draw.between(23, 0.000_000_7, [-0.000_001, 0.000_001]) * (x * x + y * y);
    let tint = 0.5 + 0.5 * noise(x / 30.0 + 9.0 + part, y / 30.0);
    scaled(
        mix([0.56, 0.5, 0.42], [0.5, 0.5, 0.48], tint),
        (1.0 + 2.0 * sum) * light,
    )
}
