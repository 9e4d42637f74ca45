//! Line charts: axes with round numbers, a legend, lines; for training curves and histograms. A pure function of what is passed in.

use super::letters;
use image::{Rgb, RgbImage};

/// Inks that are told apart by most eyes (after Okabe and Ito 2008), for the lines of a chart in turn.
pub const INKS: [[u8; 3]; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [60, 60, 60],
    [86, 180, 233],
    [180, 140, 0],
];

const PAPER: [u8; 3] = [255, 255, 255];
const AXIS: [u8; 3] = [90, 90, 90];
const RULE: [u8; 3] = [228, 228, 228];
/// Pixels a dot of a letter takes.
const DOT: u32 = 2;
/// Pixels left of, above, right of and below the lines.
const MARGINS: [f64; 4] = [110.0, 44.0, 24.0, 62.0];
/// Width of a line in pixels.
const STROKE: f64 = 2.2;

/// How numbers become lengths along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By powers of ten; numbers that are not positive are left out.
    Logarithmic,
}

/// An axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What is measured along it, with its unit; ASCII.
    pub label: String,
    /// How.
    pub scale: Scale,
}

/// A line of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Its name in the legend; ASCII.
    pub name: String,
    /// Its colour, sRGB.
    pub ink: [u8; 3],
    /// Its points in order; a number that is not finite breaks the line.
    pub points: Vec<[f64; 2]>,
}

/// What a chart shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// The line above it; ASCII.
    pub title: String,
    /// Along the bottom.
    pub x: Axis,
    /// Along the left side.
    pub y: Axis,
    /// The lines, later ones over earlier ones.
    pub lines: Vec<Line>,
}

impl Chart {
    /// The chart as a picture of at least 240 × 160 pixels.
    pub fn drawn(&self, size: [u32; 2]) -> RgbImage {
        let size = [
            size[0].clamp(240, super::MAX_SIDE),
            size[1].clamp(160, super::MAX_SIDE),
        ];
        let mut picture = RgbImage::from_pixel(size[0], size[1], Rgb(PAPER));
        let [left, top, right, bottom] = MARGINS;
        let spans = [&self.x, &self.y].map(|axis| axis.scale);
        let ends = [
            [left, f64::from(size[0]) - right],
            [f64::from(size[1]) - bottom, top],
        ];
        let rulers: [Ruler; 2] = std::array::from_fn(|axis| {
            let all = self.lines.iter().flat_map(|line| &line.points);
            Ruler::over(all.map(|p| p[axis]), spans[axis], ends[axis])
        });
        rules(&mut picture, &rulers);
        for line in &self.lines {
            let ink = line.ink;
            for pair in line.points.windows(2) {
                let [a, b] = [pair[0], pair[1]]
                    .map(|p| Some([rulers[0].pixel(p[0])?, rulers[1].pixel(p[1])?]));
                if let (Some(a), Some(b)) = (a, b) {
                    stroke(&mut picture, [a, b], STROKE, ink);
                }
            }
        }
        self.words(&mut picture, &rulers);
        picture
    }

    /// Title, names of the axes, legend.
    fn words(&self, picture: &mut RgbImage, [across, up]: &[Ruler; 2]) {
        let height = i64::from(picture.height());
        let middle = ((across.ends[0] + across.ends[1]) / 2.0) as i64;
        centred(picture, [middle, 14], &self.title);
        centred(picture, [middle, height - 24], &self.x.label);
        // Letters are not turned: the name of the vertical axis stands over it.
        letters::write(picture, [8, 14], &self.y.label, DOT, AXIS);
        let named: Vec<&Line> = self.lines.iter().filter(|l| !l.name.is_empty()).collect();
        let widest = named
            .iter()
            .map(|l| letters::extent(&l.name, DOT)[0])
            .max()
            .unwrap_or(0);
        let left = across.ends[1] as i64 - i64::from(widest) - 14;
        for (line, row) in named.iter().zip(0..) {
            let top = up.ends[1] as i64 + 10 + row * 20;
            let y = (top + 7) as f64;
            stroke(
                picture,
                [[(left - 34) as f64, y], [(left - 8) as f64, y]],
                STROKE + 1.0,
                line.ink,
            );
            letters::write(picture, [left, top], &line.name, DOT, AXIS);
        }
    }
}

/// Pictures of equal width one under the other.
pub fn stacked(pictures: &[RgbImage]) -> RgbImage {
    let width = pictures.iter().map(RgbImage::width).max().unwrap_or(1);
    let height = pictures.iter().map(RgbImage::height).sum::<u32>().max(1);
    let mut all = RgbImage::from_pixel(width, height, Rgb(PAPER));
    let mut top = 0;
    for picture in pictures {
        image::imageops::replace(&mut all, picture, 0, i64::from(top));
        top += picture.height();
    }
    all
}

/// Numbers along an axis and the pixels they are at.
struct Ruler {
    scale: Scale,
    /// Least and greatest number shown, in decades on a logarithmic axis.
    span: [f64; 2],
    /// The pixels of those two.
    ends: [f64; 2],
}

impl Ruler {
    fn over(numbers: impl Iterator<Item = f64>, scale: Scale, ends: [f64; 2]) -> Ruler {
        let [mut low, mut high] = numbers
            .filter_map(|x| measure(x, scale))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            });
        if low > high {
            [low, high] = [0.0, 1.0];
        }
        if high - low < 1e-12 * high.abs().max(1e-300) || high == low {
            [low, high] = [low - 0.5, high + 0.5];
        }
        let air = if scale == Scale::Linear { 0.02 } else { 0.04 } * (high - low);
        // A line of numbers that starts at zero keeps zero in its corner.
        let low = if low == 0.0 { 0.0 } else { low - air };
        Ruler {
            scale,
            span: [low, high + air],
            ends,
        }
    }

    fn pixel(&self, x: f64) -> Option<f64> {
        let [low, high] = self.span;
        let share = (measure(x, self.scale)? - low) / (high - low);
        Some(self.ends[0] + share * (self.ends[1] - self.ends[0]))
    }

    /// Round numbers along the ruler.
    fn ticks(&self) -> Vec<f64> {
        let [low, high] = self.span;
        if self.scale == Scale::Logarithmic && high - low > 1.0 {
            let decades = (low.floor() as i32..=high.ceil() as i32).map(|d| 10f64.powi(d));
            let few = high - low < 3.0;
            let parts: &[f64] = if few { &[1.0, 2.0, 5.0] } else { &[1.0] };
            let all = decades.flat_map(|d| parts.iter().map(move |p| d * p));
            return all.filter(|x| (low..=high).contains(&x.log10())).collect();
        }
        let [low, high] = match self.scale {
            Scale::Linear => [low, high],
            Scale::Logarithmic => [10f64.powf(low), 10f64.powf(high)],
        };
        let step = round_step((high - low) / 5.0);
        let first = (low / step).ceil() as i64;
        let last = (high / step).floor() as i64;
        (first..=last.min(first + 20))
            .map(|k| k as f64 * step)
            .collect()
    }
}

/// A number as a length along an axis; `None` when it has none.
fn measure(x: f64, scale: Scale) -> Option<f64> {
    let length = match scale {
        Scale::Linear => x,
        Scale::Logarithmic if x > 0.0 => x.log10(),
        Scale::Logarithmic => return None,
    };
    length.is_finite().then_some(length)
}

/// The least of 1, 2, 5 times a power of ten that is not below `least`.
fn round_step(least: f64) -> f64 {
    let decade = 10f64.powf(least.max(1e-300).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade);
    steps
        .into_iter()
        .find(|step| *step >= least * (1.0 - 1e-9))
        .unwrap_or(10.0 * decade)
}

/// Rules, axes and the numbers at them.
fn rules(picture: &mut RgbImage, [across, up]: &[Ruler; 2]) {
    for x in across.ticks() {
        let Some(at) = across.pixel(x) else { continue };
        stroke(picture, [[at, up.ends[0]], [at, up.ends[1]]], 1.0, RULE);
        let below = up.ends[0] as i64 + 10;
        centred(picture, [at as i64, below], &short(x));
    }
    for y in up.ticks() {
        let Some(at) = up.pixel(y) else { continue };
        stroke(
            picture,
            [[across.ends[0], at], [across.ends[1], at]],
            1.0,
            RULE,
        );
        let text = short(y);
        let [width, height] = letters::extent(&text, DOT).map(i64::from);
        let corner = [across.ends[0] as i64 - width - 8, at as i64 - height / 2];
        letters::write(picture, corner, &text, DOT, AXIS);
    }
    let corner = [across.ends[0], up.ends[0]];
    stroke(picture, [corner, [across.ends[1], corner[1]]], 1.6, AXIS);
    stroke(picture, [corner, [corner[0], up.ends[1]]], 1.6, AXIS);
}

/// A number in few characters.
fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&x.abs()) {
        return format!("{x:e}");
    }
    let text = format!("{x:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn centred(picture: &mut RgbImage, [middle, top]: [i64; 2], text: &str) {
    let half = i64::from(letters::extent(text, DOT)[0]) / 2;
    letters::write(picture, [middle - half, top], text, DOT, AXIS);
}

/// A straight stroke with smooth edges; what lies beyond the picture is left out.
fn stroke(picture: &mut RgbImage, [a, b]: [[f64; 2]; 2], width: f64, ink: [u8; 3]) {
    let reach = width / 2.0 + 1.0;
    let range = |axis: usize, most: u32| {
        let low = (a[axis].min(b[axis]) - reach).floor().max(0.0) as u32;
        // `as` saturates, so strokes outside the picture have an empty range.
        low..((a[axis].max(b[axis]) + reach).ceil().max(0.0) as u32).min(most)
    };
    let along = [b[0] - a[0], b[1] - a[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];
    let (columns, rows) = (range(0, picture.width()), range(1, picture.height()));
    for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
        let from = [f64::from(x) + 0.5 - a[0], f64::from(y) + 0.5 - a[1]];
        let part = if length2 > 0.0 {
            ((from[0] * along[0] + from[1] * along[1]) / length2).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let away = (from[0] - part * along[0]).hypot(from[1] - part * along[1]);
        let cover = (width / 2.0 + 0.5 - away).clamp(0.0, 1.0);
        if cover > 0.0 {
            let pixel = picture.get_pixel_mut(x, y);
            for (under, over) in pixel.0.iter_mut().zip(ink) {
                let mixed = f64::from(*under) + (f64::from(over) - f64::from(*under)) * cover;
                *under = mixed.round() as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<[f64; 2]>, scale: Scale) -> Chart {
        let axis = |label: &str| Axis {
            label: label.into(),
            scale,
        };
        Chart {
            title: "title".into(),
            x: axis("x"),
            y: axis("y"),
            lines: vec![Line {
                name: "line".into(),
                ink: INKS[0],
                points,
            }],
        }
    }

    fn inked(picture: &RgbImage) -> usize {
        picture.pixels().filter(|p| p.0 == INKS[0]).count()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        for (low, high) in [(0.0, 1.0), (-3.7, 12.0), (1e-7, 3e-7), (5e5, 6e6)] {
            let ruler = Ruler::over([low, high].into_iter(), Scale::Linear, [0.0, 100.0]);
            let ticks = ruler.ticks();
            assert!((3..=8).contains(&ticks.len()), "{low} {high} {ticks:?}");
            assert!(
                ticks
                    .iter()
                    .all(|t| (0.0..=100.0).contains(&ruler.pixel(*t).unwrap()))
            );
        }
        let ruler = Ruler::over([0.01, 100.0].into_iter(), Scale::Logarithmic, [0.0, 1.0]);
        assert_eq!(ruler.ticks(), [0.01, 0.1, 1.0, 10.0, 100.0]);
    }

    #[test]
    fn numbers_are_short() {
        let all = [0.0, 0.5, 120.0, -0.25, 1e-6, 2e7].map(short);
        assert_eq!(all, ["0", "0.5", "120", "-0.25", "1e-6", "2e7"]);
    }

    #[test]
    fn a_line_is_drawn_and_nonsense_is_left_out() {
        let size = [400, 300];
        let line = chart(vec![[1.0, 1.0], [2.0, 4.0]], Scale::Linear).drawn(size);
        assert!(inked(&line) > 300);
        let nonsense = vec![[f64::NAN, 1.0], [0.0, f64::INFINITY], [1.0, -1.0]];
        for scale in [Scale::Linear, Scale::Logarithmic] {
            let drawn = chart(nonsense.clone(), scale).drawn(size);
            assert_eq!(drawn.dimensions(), (400, 300));
            chart(Vec::new(), scale).drawn([0, 0]);
        }
    }

    #[test]
    fn charts_stand_one_under_the_other() {
        let one = chart(vec![[0.0, 0.0], [1.0, 1.0]], Scale::Linear).drawn([300, 200]);
        let two = stacked(&[one.clone(), one.clone()]);
        assert_eq!(two.dimensions(), (300, 400));
        assert_eq!(two.get_pixel(110, 380), one.get_pixel(110, 180));
    }
}
