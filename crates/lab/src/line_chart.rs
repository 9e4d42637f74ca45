//! Line charts as SVG: axes with round numbers, a legend, lines. For training curves and histograms.
//!
//! The text of a chart is SVG text, so no font is needed here. The same charts give the same bytes.

use std::fmt::Write as _;

/// Line colours that most eyes can tell apart (after Okabe and Ito 2008), sRGB.
pub(crate) const INKS: [[u8; 3]; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [60, 60, 60],
    [86, 180, 233],
    [180, 140, 0],
];

/// Colour of axes and text.
const AXIS: &str = "#5a5a5a";
/// Colour of the lines at the numbers.
const RULE: &str = "#e4e4e4";
/// Space left of the lines of a chart, pixels.
const LEFT: f64 = 100.0;
/// Space above them.
const TOP: f64 = 44.0;
/// Space right of them.
const RIGHT: f64 = 24.0;
/// Space below them.
const BOTTOM: f64 = 62.0;
/// Most numbers along a linear axis.
const MOST_TICKS: i64 = 21;

/// Width and height of one chart, pixels; larger than its margins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ChartSize {
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
}

/// How numbers become lengths along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AxisScale {
    /// In proportion.
    Linear,
    /// By powers of ten; numbers that are not positive are left out.
    Logarithmic,
}

/// An axis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChartAxis {
    /// What is measured along it, with its unit.
    pub label: String,
    /// Its scale.
    pub scale: AxisScale,
}

/// A line of a chart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChartLine {
    /// Its name in the legend; an empty name has no entry.
    pub name: String,
    /// Its colour, sRGB.
    pub ink: [u8; 3],
    /// Its points `[x, y]` in order; a number that has no place on its axis interrupts the line.
    pub points: Vec<[f64; 2]>,
}

/// The contents of a chart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LineChart {
    /// The text above it.
    pub title: String,
    /// The horizontal axis.
    pub x: ChartAxis,
    /// The vertical axis.
    pub y: ChartAxis,
    /// The lines; later ones are drawn over earlier ones.
    pub lines: Vec<ChartLine>,
}

/// An SVG document with the charts one below the other.
pub(crate) fn svg(charts: &[LineChart], size: ChartSize) -> String {
    let ChartSize { width, height } = size;
    let whole = height as usize * charts.len();
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{whole}\" viewBox=\"0 0 {width} {whole}\" \
         font-family=\"sans-serif\" font-size=\"14\" fill=\"{AXIS}\">\n\
         <rect width=\"{width}\" height=\"{whole}\" fill=\"#ffffff\"/>\n"
    );
    for (number, chart) in charts.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "<g transform=\"translate(0 {})\">",
            number * height as usize
        );
        chart.draw(size, &mut text);
        text.push_str("</g>\n");
    }
    text.push_str("</svg>\n");
    text
}

impl LineChart {
    fn draw(&self, size: ChartSize, text: &mut String) {
        let (right, bottom) = (
            f64::from(size.width) - RIGHT,
            f64::from(size.height) - BOTTOM,
        );
        let points = || self.lines.iter().flat_map(|line| &line.points);
        let across = Ruler::over(points().map(|p| p[0]), self.x.scale).placed(LEFT, right);
        let up = Ruler::over(points().map(|p| p[1]), self.y.scale).placed(bottom, TOP);
        draw_grid(&across, &up, text);
        for line in &self.lines {
            draw_line(line, &across, &up, text);
        }
        let middle = 0.5 * (LEFT + right);
        write_text(text, Anchor::Middle, middle, 26.0, &self.title);
        let below = f64::from(size.height) - 16.0;
        write_text(text, Anchor::Middle, middle, below, &self.x.label);
        let _ = write!(
            text,
            "<g transform=\"translate(22 {}) rotate(-90)\">",
            pixel(0.5 * (TOP + bottom))
        );
        write_text(text, Anchor::Middle, 0.0, 0.0, &self.y.label);
        text.push_str("</g>\n");
        let named = self.lines.iter().filter(|line| !line.name.is_empty());
        for (line, row) in named.zip(0u32..) {
            let y = TOP + 20.0 + 20.0 * f64::from(row);
            write_text(text, Anchor::End, right - 48.0, y, &line.name);
            let ink = colour(line.ink);
            let _ = writeln!(
                text,
                "<path d=\"M{} {y:.2}H{}\" stroke=\"{ink}\" stroke-width=\"3\"/>",
                pixel(right - 40.0),
                pixel(right - 10.0),
                y = y - 5.0,
            );
        }
    }
}

/// The axes, the lines at round numbers, and the numbers.
fn draw_grid(across: &Ruler, up: &Ruler, text: &mut String) {
    let (left, right) = (pixel(across.first), pixel(across.last));
    let (bottom, top) = (pixel(up.first), pixel(up.last));
    for x in across.ticks() {
        let Some(at) = across.pixel(x) else { continue };
        let _ = writeln!(
            text,
            "<path d=\"M{} {bottom}V{top}\" stroke=\"{RULE}\"/>",
            pixel(at)
        );
        write_text(text, Anchor::Middle, at, up.first + 20.0, &short(x));
    }
    for y in up.ticks() {
        let Some(at) = up.pixel(y) else { continue };
        let _ = writeln!(
            text,
            "<path d=\"M{left} {}H{right}\" stroke=\"{RULE}\"/>",
            pixel(at)
        );
        write_text(text, Anchor::End, across.first - 8.0, at + 5.0, &short(y));
    }
    let _ = writeln!(
        text,
        "<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"{AXIS}\" stroke-width=\"1.5\"/>"
    );
}

fn draw_line(line: &ChartLine, across: &Ruler, up: &Ruler, text: &mut String) {
    let mut path = String::new();
    let mut pen = 'M';
    for point in &line.points {
        match (across.pixel(point[0]), up.pixel(point[1])) {
            (Some(x), Some(y)) => {
                let _ = write!(path, "{pen}{} {}", pixel(x), pixel(y));
                pen = 'L';
            }
            _ => pen = 'M',
        }
    }
    let ink = colour(line.ink);
    let _ = writeln!(
        text,
        "<path d=\"{path}\" fill=\"none\" stroke=\"{ink}\" stroke-width=\"2\"/>"
    );
}

/// Which end of a text its position is at.
#[derive(Clone, Copy)]
enum Anchor {
    Middle,
    End,
}

fn write_text(text: &mut String, anchor: Anchor, x: f64, y: f64, words: &str) {
    let anchor = match anchor {
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    let _ = writeln!(
        text,
        "<text text-anchor=\"{anchor}\" x=\"{}\" y=\"{}\">{}</text>",
        pixel(x),
        pixel(y),
        escaped(words)
    );
}

/// Text with the characters that mean something in XML replaced.
fn escaped(words: &str) -> String {
    words
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

fn colour(ink: [u8; 3]) -> String {
    let [red, green, blue] = ink;
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// A length in pixels, to a hundredth.
fn pixel(x: f64) -> String {
    let text = format!("{x:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Numbers along an axis and the pixels they are at.
struct Ruler {
    scale: AxisScale,
    /// Least number shown, in decades on a logarithmic axis.
    low: f64,
    /// Greatest number shown, likewise.
    high: f64,
    /// The pixel of the least number.
    first: f64,
    /// The pixel of the greatest number.
    last: f64,
}

impl Ruler {
    fn over(numbers: impl Iterator<Item = f64>, scale: AxisScale) -> Ruler {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for x in numbers.filter_map(|x| length(x, scale)) {
            (low, high) = (low.min(x), high.max(x));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        if high - low < 1e-12 * high.abs().max(1e-300) || high == low {
            (low, high) = (low - 0.5, high + 0.5);
        }
        let margin = match scale {
            AxisScale::Linear => 0.02,
            AxisScale::Logarithmic => 0.04,
        } * (high - low);
        // An axis whose numbers start at zero starts at zero.
        let low = if low == 0.0 { 0.0 } else { low - margin };
        Ruler {
            scale,
            low,
            high: high + margin,
            first: 0.0,
            last: 1.0,
        }
    }

    /// The ruler with its ends at these pixels.
    fn placed(self, first: f64, last: f64) -> Ruler {
        Ruler {
            first,
            last,
            ..self
        }
    }

    /// The pixel of a number; `None` when it has no place on the axis.
    fn pixel(&self, x: f64) -> Option<f64> {
        let share = (length(x, self.scale)? - self.low) / (self.high - self.low);
        Some(self.first + share * (self.last - self.first))
    }

    /// Round numbers along the ruler.
    fn ticks(&self) -> Vec<f64> {
        let (low, high) = (self.low, self.high);
        if self.scale == AxisScale::Logarithmic && high - low > 1.0 {
            let decades = (low.floor() as i32..=high.ceil() as i32).map(|d| 10f64.powi(d));
            let few = high - low < 3.0;
            let parts: &[f64] = if few { &[1.0, 2.0, 5.0] } else { &[1.0] };
            let all = decades.flat_map(|d| parts.iter().map(move |p| d * p));
            return all.filter(|x| (low..=high).contains(&x.log10())).collect();
        }
        let (low, high) = match self.scale {
            AxisScale::Linear => (low, high),
            AxisScale::Logarithmic => (10f64.powf(low), 10f64.powf(high)),
        };
        let step = round_step((high - low) / 5.0);
        let first = (low / step).ceil() as i64;
        let last = (high / step).floor() as i64;
        (first..=last.min(first + MOST_TICKS - 1))
            .map(|k| k as f64 * step)
            .collect()
    }
}

/// A number as a length along an axis; `None` when it has none.
fn length(x: f64, scale: AxisScale) -> Option<f64> {
    let length = match scale {
        AxisScale::Linear => x,
        AxisScale::Logarithmic if x > 0.0 => x.log10(),
        AxisScale::Logarithmic => return None,
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

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: ChartSize = ChartSize {
        width: 400,
        height: 300,
    };

    fn chart(points: Vec<[f64; 2]>, scale: AxisScale) -> LineChart {
        let axis = |label: &str| ChartAxis {
            label: label.into(),
            scale,
        };
        LineChart {
            title: "title".into(),
            x: axis("x"),
            y: axis("y"),
            lines: vec![ChartLine {
                name: "line".into(),
                ink: INKS[0],
                points,
            }],
        }
    }

    /// The path of the line.
    fn path(document: &str) -> &str {
        let end = document
            .find("\" fill=\"none\" stroke=\"#0072b2\"")
            .unwrap();
        let start = document[..end].rfind("d=\"").unwrap() + 3;
        &document[start..end]
    }

    #[test]
    fn ticks_are_round_and_inside() {
        for (low, high) in [(0.0, 1.0), (-3.7, 12.0), (1e-7, 3e-7), (5e5, 6e6)] {
            let ruler = Ruler::over([low, high].into_iter(), AxisScale::Linear).placed(0.0, 100.0);
            let ticks = ruler.ticks();
            assert!((3..=8).contains(&ticks.len()), "{low} {high} {ticks:?}");
            assert!(
                ticks
                    .iter()
                    .all(|t| (0.0..=100.0).contains(&ruler.pixel(*t).unwrap()))
            );
        }
        let ruler = Ruler::over([0.01, 100.0].into_iter(), AxisScale::Logarithmic);
        assert_eq!(ruler.ticks(), [0.01, 0.1, 1.0, 10.0, 100.0]);
    }

    #[test]
    fn numbers_are_short() {
        let all = [0.0, 0.5, 120.0, -0.25, 1e-6, 2e7].map(short);
        assert_eq!(all, ["0", "0.5", "120", "-0.25", "1e-6", "2e7"]);
        assert_eq!([10.0, 0.125, 3.999].map(pixel), ["10", "0.12", "4"]);
    }

    #[test]
    fn a_line_goes_through_its_points() {
        let line = chart(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 4.0]], AxisScale::Linear);
        let document = svg(&[line], SIZE);
        // 276 pixels from 100 for 2.04, and 194 pixels up from 238 for 4.08.
        assert_eq!(path(&document), "M100 238L235.29 190.45L370.59 47.8");
    }

    #[test]
    fn numbers_without_a_place_interrupt_the_line() {
        let gap = vec![[0.0, 0.0], [1.0, 1.0], [f64::NAN, 2.0], [3.0, 3.0]];
        let document = svg(&[chart(gap, AxisScale::Linear)], SIZE);
        assert_eq!(path(&document).matches('M').count(), 2);
        let nonsense = vec![[f64::NAN, 1.0], [0.0, f64::INFINITY], [1.0, -1.0]];
        for scale in [AxisScale::Linear, AxisScale::Logarithmic] {
            for points in [nonsense.clone(), Vec::new()] {
                let document = svg(&[chart(points, scale)], SIZE);
                assert!(!document.contains("NaN") && !document.contains("inf"));
            }
        }
    }

    #[test]
    fn charts_stand_one_below_the_other_and_text_is_escaped() {
        let mut one = chart(vec![[0.0, 0.0], [1.0, 1.0]], AxisScale::Linear);
        one.title = "a < b & c".into();
        let document = svg(&[one.clone(), one.clone()], SIZE);
        assert!(document.contains("viewBox=\"0 0 400 600\""));
        assert!(document.contains("translate(0 300)"));
        assert_eq!(document.matches(">a &lt; b &amp; c</text>").count(), 2);
        assert_eq!(document, svg(&[one.clone(), one], SIZE));
    }
}
