//! The patterns of the garments; measures are drawn around usual ones, metres.
//!
//! In a panel's drawing x goes across (around the body) and y along; the flat lay's plane is (x, z).

use super::body::Capsule;
use super::cloth::GarmentFabric;
use super::garment::GarmentKind;
use super::panel::RunUse::{Open, Seam};
use super::panel::{Outline, Panel, Side};
use super::pattern::{Pattern, Ring};
use darn_geometry::mesh::Vec2;
use rand::Rng;
use std::f64::consts::{FRAC_PI_2, PI};

/// A pattern with measures drawn from the generator.
pub(super) fn draw(kind: GarmentKind, rng: &mut impl Rng) -> Pattern {
    let vertices = rng.random_range(3000.0..4800.0);
    let woven = GarmentFabric {
        bend: 10.0f32.powf(rng.random_range(-4.8..-3.9)),
        compress: 3.0e5,
        knit: None,
        friction: rng.random_range(0.15..0.5),
    };
    let cut = match kind {
        GarmentKind::Sleeve => sleeve(rng),
        GarmentKind::Skirt => skirt(rng),
        GarmentKind::Shirt => shirt(rng, Top::Shirt),
        GarmentKind::Vest => shirt(rng, Top::Vest),
        GarmentKind::Trousers => trousers(rng),
        GarmentKind::Glove => glove(rng),
        GarmentKind::Hood => hood(rng),
    };
    let fabric = match kind {
        GarmentKind::Glove => GarmentFabric {
            // An edge is a third as long as in other garments.
            bend: woven.bend * 0.015,
            compress: 10.0 * woven.compress,
            ..woven
        },
        GarmentKind::Vest => GarmentFabric {
            knit: Some(2.0e5),
            ..woven
        },
        _ => woven,
    };
    let area: f64 = cut.panels.iter().map(|p| p.outline.area()).sum();
    Pattern {
        // A vertex of a hexagonal lattice has √¾ of the square of its spacing.
        spacing: (area / (0.75f64.sqrt() * vertices)).sqrt(),
        panels: cut.panels,
        openings: cut.openings,
        body: cut.body,
        rings: cut.rings,
        fabric,
    }
}

/// What the kinds of garments differ in.
struct Cut {
    panels: Vec<Panel>,
    openings: Vec<&'static str>,
    body: Vec<Capsule>,
    rings: Vec<Ring>,
}

/// The two kinds of tops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Top {
    /// Loose, with set-in sleeves.
    Shirt,
    /// Knitted, narrower than the body, without sleeves.
    Vest,
}

/// A front and a back panel of the same outline, not moved.
fn pair(outline: Outline) -> Vec<Panel> {
    let panel = |side| Panel {
        outline: outline.clone(),
        side,
        origin: Vec2::zeros(),
        turned: 0.0,
    };
    vec![panel(Side::Front), panel(Side::Back)]
}

/// A ring around a vertical axis whose circumference is `length`, `depth` times as deep as it is wide.
fn level_ring(opening: usize, centre: [f32; 3], length: f64, depth: f64) -> Ring {
    // Ramanujan's circumference of an ellipse of half axes 1 and `depth`.
    let unit = PI * (3.0 * (1.0 + depth) - ((3.0 + depth) * (1.0 + 3.0 * depth)).sqrt());
    let half = length / unit;
    Ring {
        opening,
        centre,
        along: [half as f32, 0.0, 0.0],
        front: [0.0, -(half * depth) as f32, 0.0],
    }
}

/// Two segments of a limb from `root` over a joint to its end: straight along `dir` while it grows, then turned to `upper` and `lower`.
struct Limb {
    root: [f32; 3],
    /// Lengths of the two segments.
    lengths: [f32; 2],
    /// Radii at the root, the joint and the end.
    radii: [f32; 3],
    /// Unit direction in the flat lay; in the plane y = 0.
    straight: [f32; 3],
    /// Directions of the two segments in the pose, any length.
    posed: [[f32; 3]; 2],
}

impl Limb {
    fn capsules(&self) -> [Capsule; 2] {
        let step = |from: [f32; 3], dir: [f32; 3], length: f32| {
            let norm = dir.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-6);
            std::array::from_fn(|k| from[k] + dir[k] * length / norm)
        };
        let [r0, r1, r2] = self.radii;
        let joint: [f32; 3] = step(self.root, self.straight, self.lengths[0]);
        let end = step(joint, self.straight, self.lengths[1]);
        let posed_joint: [f32; 3] = step(self.root, self.posed[0], self.lengths[0]);
        let posed_end = step(posed_joint, self.posed[1], self.lengths[1]);
        [
            Capsule {
                start: [self.root, joint],
                pose: [self.root, posed_joint],
                radius: [r0, r1],
            },
            Capsule {
                start: [joint, end],
                pose: [posed_joint, posed_end],
                radius: [r1, r2],
            },
        ]
    }
}

/// A tube on a bent arm, its cuff gathered and pushed up.
fn sleeve(rng: &mut impl Rng) -> Cut {
    let (top, cuff) = (
        rng.random_range(0.095..0.115),
        rng.random_range(0.068..0.08),
    );
    let length: f64 = rng.random_range(0.5..0.6);
    let outline = Outline::from(-cuff, 0.0)
        .line([cuff, 0.0], Open(1))
        .line([top, length], Seam(0))
        .line([-top, length], Open(0))
        .line([-cuff, 0.0], Seam(1));
    let bend: f32 = rng.random_range(0.2..0.9);
    let (half, slack) = (0.5 * length as f32, rng.random_range(0.01..0.05f32));
    let arm = Limb {
        root: [0.0, 0.0, 2.0 * half + 0.05],
        lengths: [half + 0.05, half + 0.05],
        radii: [0.055, 0.048, 0.03],
        straight: [0.0, 0.0, -1.0],
        posed: [[0.0, 0.0, -1.0], [0.0, -bend.sin(), -bend.cos()]],
    };
    let along_arm = half - slack;
    let wrist = [0.0, -bend.sin() * along_arm, half - bend.cos() * along_arm];
    let (radius, tilt) = (0.6 * 2.0 * cuff as f32 / std::f32::consts::PI + 0.008, bend);
    Cut {
        panels: pair(outline),
        openings: vec!["armhole", "cuff"],
        body: arm.capsules().to_vec(),
        rings: vec![
            level_ring(0, [0.0, 0.0, 2.0 * half], 4.0 * top * 0.97, 0.9),
            Ring {
                opening: 1,
                centre: wrist,
                along: [radius, 0.0, 0.0],
                front: [0.0, -radius * tilt.cos(), radius * tilt.sin()],
            },
        ],
    }
}

/// A flared skirt, gathered at the waist, over two legs of which one steps forward.
fn skirt(rng: &mut impl Rng) -> Cut {
    let (waist, hem) = (rng.random_range(0.24..0.32), rng.random_range(0.42..0.56));
    let length: f64 = rng.random_range(0.42..0.55);
    let outline = Outline::from(-hem, 0.0)
        .curve([0.0, -0.1], [hem, 0.0], Open(1))
        .line([waist, length], Seam(0))
        .curve([0.0, length - 0.03], [-waist, length], Open(0))
        .line([-hem, 0.0], Seam(1));
    let top = length as f32;
    let hip = top - 0.17;
    let stride: f32 = rng.random_range(0.05..0.3);
    let leg = |side: f32, forward: f32| Limb {
        root: [0.085 * side, 0.0, hip],
        lengths: [0.35, 0.35],
        radii: [0.09, 0.065, 0.05],
        straight: [0.0, 0.0, -1.0],
        posed: [[0.1 * side, -forward, -1.0], [0.0, 0.3 * forward, -1.0]],
    };
    let hips = Capsule::still([[-0.07, 0.0, hip], [0.07, 0.0, hip]], [0.1, 0.1]);
    let mut body = vec![hips];
    body.extend(leg(-1.0, stride).capsules());
    body.extend(leg(1.0, -0.5 * stride).capsules());
    let girth = 4.0 * waist * rng.random_range(0.62..0.9);
    Cut {
        panels: pair(outline),
        openings: vec!["waist", "hem"],
        body,
        rings: vec![level_ring(0, [0.0, 0.0, top + 0.01], girth, 0.8)],
    }
}

/// A shirt with set-in sleeves, or a knitted vest.
fn shirt(rng: &mut impl Rng, top: Top) -> Cut {
    let vest = top == Top::Vest;
    let half = match top {
        Top::Shirt => rng.random_range(0.24..0.28),
        Top::Vest => rng.random_range(0.2..0.23),
    };
    let length = rng.random_range(0.56..0.66);
    let (neck, depth) = (rng.random_range(0.08..0.095), rng.random_range(0.06..0.1));
    let shoulder = half - if vest { 0.055 } else { 0.035 };
    let (arm, tip) = (length - 0.22, length - 0.035);
    let at_arm = |right: bool, front: bool| match (vest, right) {
        (true, true) => Open(2),
        (true, false) => Open(3),
        (false, right) => Seam(10 + 2 * u16::from(right) + u16::from(front)),
    };
    let body = |front: bool| {
        let scoop = if front { depth } else { 0.02 };
        Outline::from(-half, 0.0)
            .line([half, 0.0], Open(1))
            .line([half, arm], Seam(0))
            .curve(
                [shoulder - 0.02, arm + 0.02],
                [shoulder, tip],
                at_arm(true, front),
            )
            .line([neck, length], Seam(1))
            .curve([0.0, length - 2.0 * scoop], [-neck, length], Open(0))
            .line([-shoulder, tip], Seam(2))
            .curve(
                [0.02 - shoulder, arm + 0.02],
                [-half, arm],
                at_arm(false, front),
            )
            .line([-half, 0.0], Seam(3))
    };
    let panel = |outline, front, origin, turned| Panel {
        outline,
        side: if front { Side::Front } else { Side::Back },
        origin,
        turned,
    };
    let mut panels = Vec::new();
    for front in [true, false] {
        panels.push(panel(body(front), front, Vec2::zeros(), 0.0));
    }
    let long = rng.random_range(0.28..0.5);
    if !vest {
        let (wide, cuff) = (0.095, rng.random_range(0.06..0.08));
        let cap = 0.05;
        for front in [true, false] {
            let right = Outline::from(-cuff, 0.0)
                .line([cuff, 0.0], Open(2))
                .line([wide, long + cap], Seam(4))
                .curve(
                    [0.0, long + cap + 0.015],
                    [-wide, long],
                    at_arm(true, front),
                )
                .line([-cuff, 0.0], Seam(5));
            let left = Outline::from(-cuff, 0.0)
                .line([cuff, 0.0], Open(3))
                .line([wide, long], Seam(6))
                .curve(
                    [0.0, long + cap + 0.015],
                    [-wide, long + cap],
                    at_arm(false, front),
                )
                .line([-cuff, 0.0], Seam(7));
            let out = 0.5 * (half + shoulder) + long + 0.5 * cap;
            let level = 0.5 * (arm + tip);
            panels.push(panel(right, front, Vec2::new(out, level), FRAC_PI_2));
            panels.push(panel(left, front, Vec2::new(-out, level), -FRAC_PI_2));
        }
    }
    let (high, wide) = (length as f32, half as f32);
    let chest = rng.random_range(0.095..0.11f32);
    let capsule = |ends, radius| Capsule::still(ends, radius);
    let mut capsules = vec![
        capsule(
            [[-0.075, 0.0, -0.1], [-0.075, 0.0, high - 0.17]],
            [0.1, chest],
        ),
        capsule(
            [[0.075, 0.0, -0.1], [0.075, 0.0, high - 0.17]],
            [0.1, chest],
        ),
        capsule(
            [[-0.15, 0.0, high - 0.085], [0.15, 0.0, high - 0.085]],
            [0.05, 0.05],
        ),
        capsule(
            [[0.0, 0.0, high - 0.12], [0.0, 0.0, high + 0.15]],
            [0.065, 0.055],
        ),
    ];
    // Belly and chest come forward with the pose: cloth over them does not lie flat.
    let bulge = |x: f32, level: f32, forward: f32, radius: f32| Capsule {
        start: [[x, 0.0, level], [x, 0.0, level + 0.02]],
        pose: [[x, -forward, level], [x, -forward, level + 0.02]],
        radius: [radius, radius],
    };
    let out = rng.random_range(0.03..0.07);
    capsules.push(bulge(0.0, 0.45 * high - 0.06, out, 0.1));
    capsules.push(bulge(-0.075, high - 0.26, out + 0.035, 0.06));
    capsules.push(bulge(0.075, high - 0.26, out + 0.035, 0.06));
    for side in [-1.0f32, 1.0] {
        let down: f32 = rng.random_range(0.3..1.0);
        let bend: f32 = rng.random_range(0.0..0.9);
        let forward = rng.random_range(0.0..0.4);
        let root = [side * (wide - 0.09).min(0.16), 0.0, high - 0.115];
        let limb = Limb {
            root,
            lengths: [0.27, 0.3],
            radii: [0.047, 0.04, 0.03],
            straight: [side, 0.0, 0.0],
            posed: [
                [side * down.cos(), -forward, -down.sin()],
                [
                    side * (down + 0.3).cos(),
                    -forward - bend,
                    -(down + 0.3).sin(),
                ],
            ],
        };
        capsules.extend(limb.capsules());
    }
    Cut {
        panels,
        openings: match top {
            Top::Shirt => vec!["neck", "hem", "cuff_right", "cuff_left"],
            Top::Vest => vec!["neck", "hem", "armhole_right", "armhole_left"],
        },
        body: capsules,
        rings: Vec::new(),
    }
}

/// Trousers, one knee raised.
fn trousers(rng: &mut impl Rng) -> Cut {
    let waist = rng.random_range(0.2..0.24);
    let hip = rng.random_range(0.25..0.28);
    let inner = 0.05;
    let cuff: f64 = inner + rng.random_range(0.15..0.2);
    let (crotch, top) = (rng.random_range(0.62..0.7), rng.random_range(0.9..0.96));
    let outline = Outline::from(-cuff, 0.0)
        .line([-inner, 0.0], Open(2))
        .line([0.0, crotch], Seam(0))
        .line([inner, 0.0], Seam(1))
        .line([cuff, 0.0], Open(1))
        .line([hip, crotch], Seam(2))
        .line([waist, top], Seam(3))
        .line([-waist, top], Open(0))
        .line([-hip, crotch], Seam(4))
        .line([-cuff, 0.0], Seam(5));
    let (crotch, high) = (crotch as f32, top as f32);
    let lift: f32 = rng.random_range(0.2..0.5);
    let shin = 0.5 * (crotch + 0.1);
    let leg = |side: f32, lift: f32| Limb {
        root: [side * 0.115, 0.0, crotch + 0.08],
        lengths: [shin, shin],
        radii: [0.08, 0.06, 0.04],
        straight: [side * 0.04, 0.0, -1.0],
        posed: [
            [side * 0.15, -lift.sin(), -lift.cos()],
            [side * 0.05, 0.2 * lift, -1.0],
        ],
    };
    let level = crotch + 0.1;
    let mut body = vec![
        Capsule::still([[-0.08, 0.0, level], [0.08, 0.0, level]], [0.1, 0.1]),
        Capsule::still(
            [[-0.06, 0.0, high - 0.03], [0.06, 0.0, high - 0.03]],
            [0.08, 0.08],
        ),
    ];
    body.extend(leg(-1.0, lift).capsules());
    body.extend(leg(1.0, -0.2).capsules());
    let girth = 4.0 * waist * rng.random_range(0.8..0.95);
    Cut {
        panels: pair(outline),
        openings: vec!["waist", "cuff_right", "cuff_left"],
        body,
        rings: vec![level_ring(0, [0.0, 0.0, high], girth, 0.75)],
    }
}

/// A glove with bent fingers; closed, or without the fingers' ends.
fn glove(rng: &mut impl Rng) -> Cut {
    let open = rng.random_bool(0.5);
    let (finger, gap, palm) = (0.0235, 0.005, 0.1);
    let wide = 2.0 * finger + 1.5 * gap;
    let length = |k: usize, scale: f64| scale * [0.068, 0.076, 0.072, 0.058][k];
    let scale = if open { 0.6 } else { 1.0 };
    let tip_use = |k: usize| {
        if open {
            Open(1 + k)
        } else {
            Seam(40 + k as u16)
        }
    };
    let mut outline = Outline::from(-0.8 * wide, 0.0)
        .line([0.8 * wide, 0.0], Open(0))
        .line([wide, 0.035], Seam(0))
        .line([wide + 0.045, 0.07], Seam(1))
        .curve([wide + 0.05, 0.098], [wide + 0.028, 0.094], tip_use(4))
        .line([wide, 0.072], Seam(2))
        .line([wide, palm], Seam(3));
    let mut body = Vec::new();
    let curl: f32 = rng.random_range(0.05..0.5);
    for k in 0..4 {
        let right = wide - k as f64 * (finger + gap);
        let (left, middle) = (right - finger, right - 0.5 * finger);
        let top = palm + length(k, scale);
        let seam = 10 + 3 * k as u16;
        outline = outline.line([right - 0.001, top], Seam(seam));
        outline = match open {
            true => outline.line([left + 0.001, top], tip_use(k)),
            false => outline.curve([middle, top + 0.016], [left + 0.001, top], tip_use(k)),
        };
        outline = outline.line([left, palm], Seam(seam + 1));
        if k < 3 {
            outline = outline.line([left - gap, palm], Seam(seam + 2));
        }
        let bone = length(k, 0.5) as f32;
        let (own, x) = (curl * (1.0 + 0.25 * k as f32), middle as f32);
        let phalanges = Limb {
            root: [x, 0.0, palm as f32],
            lengths: [bone, bone],
            radii: [0.0048, 0.0044, 0.004],
            straight: [0.0, 0.0, 1.0],
            posed: [
                [0.0, -(0.5 * own).sin(), (0.5 * own).cos()],
                [0.0, -own.sin(), own.cos()],
            ],
        };
        body.extend(phalanges.capsules());
        body.push(Capsule::still(
            [[0.6 * x, 0.0, -0.02], [x, 0.0, palm as f32]],
            [0.006, 0.005],
        ));
    }
    let outline = outline.line([-0.8 * wide, 0.0], Seam(30));
    let root = [wide as f32 - 0.008, 0.0, 0.05];
    body.push(Capsule::still(
        [root, [wide as f32 + 0.032, 0.0, 0.079]],
        [0.006, 0.005],
    ));
    let mut openings = vec!["wrist"];
    if open {
        openings.extend(["finger_1", "finger_2", "finger_3", "finger_4", "thumb"]);
    }
    Cut {
        panels: pair(outline),
        openings,
        body,
        rings: vec![level_ring(0, [0.0; 3], 3.2 * wide * 0.95, 0.55)],
    }
}

/// A hood in profile, closed under the chin: its two halves are sewn along crown and back.
fn hood(rng: &mut impl Rng) -> Cut {
    let back = rng.random_range(0.15..0.175);
    let crown = rng.random_range(0.36..0.4);
    let face = rng.random_range(0.07..0.1);
    let outline = Outline::from(-0.1, 0.0)
        .line([0.09, 0.0], Open(1))
        .line([face, 0.06], Seam(0))
        .curve([face + 0.03, 0.19], [face, crown - 0.03], Open(0))
        .curve([-0.02, crown + 0.05], [0.03 - back, crown - 0.07], Seam(1))
        .curve([-back - 0.03, crown - 0.14], [-back, 0.14], Seam(2))
        .line([-0.1, 0.0], Seam(3));
    let nod: f32 = rng.random_range(-0.02..0.03);
    let head = Capsule {
        start: [[-0.045, 0.0, 0.2], [-0.035, 0.0, 0.25]],
        pose: [[-0.04, 0.0, 0.2], [-0.035 + nod, 0.015, 0.25]],
        radius: [0.08, 0.085],
    };
    let neck = Capsule::still([[-0.01, 0.0, -0.1], [-0.03, 0.0, 0.18]], [0.05, 0.05]);
    Cut {
        panels: pair(outline),
        openings: vec!["face", "neck"],
        body: vec![head, neck],
        rings: vec![Ring {
            centre: [-0.005, 0.0, rng.random_range(0.0..0.04)],
            ..level_ring(1, [0.0; 3], 0.38 * rng.random_range(0.8..0.98), 0.85)
        }],
    }
}
