//! Ten fabrics as functions of the place, in texels.

use std::f32::consts::TAU;

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

type Colour = [f32; 3];

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

    /// Texels after which the fabric looks the same along x and y; zero where it does not, or where it does not change.
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

    /// sRGB from 0 to 1 at a place.
    pub fn colour(self, x: f32, y: f32) -> [f32; 3] {
        let colour = match self {
            Fabric::Plain => weave(x, y, 6.4, [0.62, 0.55, 0.45]),
            Fabric::Twill => twill(x, y),
            Fabric::Stripes => stripes(x, y),
            Fabric::Plaid => plaid(x, y),
            Fabric::Print => print(x, y),
            Fabric::LargePrint => large_print(x, y),
            Fabric::Lace => lace(x, y),
            Fabric::Knit => knit(x, y),
            Fabric::Border => border(x, y),
            Fabric::Photograph => photograph(x, y),
        };
        // Uneven yarn.
        let uneven = 0.012 * noise(0.31 * x, 0.29 * y) + 0.008 * noise(0.9 * x + 70.0, 0.9 * y);
        colour.map(|c| (c + uneven).clamp(0.0, 1.0))
    }
}

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

fn stripes(x: f32, y: f32) -> Colour {
    let (sin, cos) = 0.17f32.sin_cos();
    let t = (cos * x + sin * y).rem_euclid(37.5 * cos) / cos;
    let bands = [
        (0.0, [0.85, 0.82, 0.74]),
        (14.0, [0.55, 0.16, 0.18]),
        (20.0, [0.9, 0.75, 0.4]),
        (24.0, [0.14, 0.25, 0.38]),
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

fn plaid(x: f32, y: f32) -> Colour {
    let sett = |t: f32| -> Colour {
        let d = centred(t, 52.3).abs();
        let mut colour = [0.12, 0.28, 0.2];
        colour = mix([0.65, 0.12, 0.13], colour, edge(d - 15.0));
        colour = mix([0.12, 0.28, 0.2], colour, edge(d - 9.0));
        mix([0.88, 0.84, 0.7], colour, edge(d - 2.0))
    };
    let over = 0.5 + 0.5 * (TAU * (x + y) / 5.23).sin();
    mix(sett(x), sett(y), over)
}

fn print(x: f32, y: f32) -> Colour {
    let column = (x / 61.0).round();
    let drop = if column.rem_euclid(2.0) > 0.5 {
        23.5
    } else {
        0.0
    };
    let (u, v) = (x - 61.0 * column, centred(y - drop, 47.0));
    let (r, angle) = (u.hypot(v), v.atan2(u));
    let petals = 11.0 + 5.0 * (5.0 * angle).cos();
    let ground = weave(x, y, 4.0, [0.9, 0.87, 0.8]);
    let flower = mix(ground, [0.74, 0.2, 0.34], edge(petals - r));
    let heart = mix(flower, [0.95, 0.78, 0.2], edge(4.5 - r));
    let stem = (u - 0.15 * v).abs();
    let leaf = edge(1.2 - stem) * edge(v - 15.0);
    mix(heart, [0.2, 0.42, 0.22], leaf)
}

fn large_print(x: f32, y: f32) -> Colour {
    let mut colour = weave(x, y, 4.0, [0.2, 0.24, 0.3]);
    let motifs = [
        (20.0, 18.0, 15.0, [0.85, 0.5, 0.25]),
        (66.0, 30.0, 21.0, [0.3, 0.55, 0.6]),
        (30.0, 60.0, 18.0, [0.8, 0.75, 0.6]),
        (80.0, 72.0, 10.0, [0.65, 0.2, 0.25]),
    ];
    for (cx, cy, radius, own) in motifs {
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

fn lace(x: f32, y: f32) -> Colour {
    let rows = 21.3;
    let row = (y / rows).round();
    let shift = if row.rem_euclid(2.0) > 0.5 { 12.3 } else { 0.0 };
    let (u, v) = (centred(x - shift, 24.6), y - rows * row);
    let r = u.hypot(v);
    let thread = 0.92 + 0.08 * (TAU * r / 3.0).cos();
    let opening = mix(
        scaled([0.88, 0.86, 0.8], thread),
        [0.1, 0.09, 0.1],
        edge(8.0 - r),
    );
    let cross = edge(1.0 - u.abs()).max(edge(1.0 - v.abs())) * edge(8.0 - r);
    mix(opening, [0.82, 0.8, 0.75], cross)
}

fn knit(x: f32, y: f32) -> Colour {
    let u = centred(x, 10.7) / 10.7;
    let t = (y / 8.2 + 1.4 * u.abs()).rem_euclid(1.0);
    let stitch = (t * std::f32::consts::PI).sin();
    let groove = 1.0 - 0.35 * (-(u * 10.7).powi(2) / 2.0).exp();
    scaled([0.55, 0.3, 0.34], (0.62 + 0.45 * stitch) * groove)
}

fn border(x: f32, y: f32) -> Colour {
    let ground = weave(x, y, 5.1, [0.82, 0.8, 0.76]);
    // The band lies 7 texels above the origin, where the holes' middle is.
    let v = y - 7.0;
    let band = mix(ground, [0.3, 0.12, 0.2], edge(24.0 - v.abs()));
    let u = centred(x, 33.4);
    let diamond = mix(band, [0.86, 0.68, 0.3], edge(14.0 - u.abs() - v.abs()));
    let eye = mix(diamond, [0.2, 0.4, 0.5], edge(5.0 - u.hypot(v)));
    let zigzag = (v.abs() - 19.0 - 2.0 * (TAU * x / 16.7).sin()).abs();
    mix(eye, [0.9, 0.86, 0.7], edge(1.3 - zigzag))
}

fn photograph(x: f32, y: f32) -> Colour {
    let mut sum = 0.0;
    for (k, size) in [48.0f32, 21.0, 9.0, 4.0, 2.0].into_iter().enumerate() {
        let shift = 100.0 * k as f32;
        sum += (0.055 - 0.006 * k as f32) * noise(x / size + shift, y / size - shift);
    }
    let light = 0.9 + 0.0006 * x - 0.000_35 * y - 0.000_000_7 * (x * x + y * y);
    let tint = 0.5 + 0.5 * noise(x / 30.0 + 9.0, y / 30.0);
    scaled(
        mix([0.56, 0.5, 0.42], [0.5, 0.5, 0.48], tint),
        (1.0 + 2.0 * sum) * light,
    )
}
