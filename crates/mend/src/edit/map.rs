//! The map of an anchor search as a picture: for each cell how far the cloth stays from the target, and the path of the
//! search.

use image::{ImageFormat, Rgb, RgbImage};

use super::search::{CellLoss, PathCell};
use darn_geometry::grid::SIDE;
use darn_geometry::mesh::Vec2;

/// Pixels of a cell's side.
const CELL: i32 = 8;
/// Pixels around the map, and of the legend beside it.
const MARGIN: i32 = 16;
const LEGEND: i32 = 72;
const BAR: i32 = 14;
/// Of this many columns, and of as many rows, one has strokes along the gradient.
const EVERY: usize = 3;
/// Seven colours of Viridis (van der Walt & Smith), from near to far.
const STOPS: [[u8; 3]; 7] = [
    [253, 231, 37],
    [144, 215, 67],
    [53, 183, 121],
    [33, 145, 140],
    [49, 104, 142],
    [68, 57, 131],
    [68, 1, 84],
];
const PAPER: Rgb<u8> = Rgb([250, 250, 248]);
const CLOTH: Rgb<u8> = Rgb([222, 224, 228]);
const INK: Rgb<u8> = Rgb([30, 30, 34]);
const PATH: Rgb<u8> = Rgb([255, 255, 255]);
const END: Rgb<u8> = Rgb([214, 48, 49]);
/// Digits of three by five dots, a row in three bits, the upper row first.
const DIGITS: [[u8; 5]; 10] = [
    [7, 5, 5, 5, 7],
    [2, 6, 2, 2, 7],
    [7, 1, 7, 4, 7],
    [7, 1, 7, 1, 7],
    [5, 5, 7, 1, 1],
    [7, 4, 7, 1, 7],
    [7, 4, 7, 5, 7],
    [7, 1, 2, 2, 2],
    [7, 5, 7, 5, 7],
    [7, 5, 7, 1, 7],
];
/// Pixels of a dot.
const DOT: i32 = 2;

/// Distances of the cloth from the target, in cells.
#[derive(Clone, Copy)]
struct DistanceRange {
    low: f64,
    high: f64,
}

/// Draws the map: `losses[cell]` for each of the 64 × 64 cells, `None` outside the hole; the path on top, with a disk
/// at its end.
///
/// A colour is the distance in cells (the root of the loss), bright where it is small, from the least to the largest;
/// the legend names both ends and the middle. Short strokes point downhill. u runs right, v up.
pub fn picture(losses: &[Option<CellLoss>], path: &[PathCell]) -> RgbImage {
    let side = SIDE as i32 * CELL;
    let size = [side + 2 * MARGIN + LEGEND, side + 2 * MARGIN].map(|s| s as u32);
    let mut image = RgbImage::from_pixel(size[0], size[1], PAPER);
    let far = |at: &CellLoss| at.loss.max(0.0).sqrt();
    let seen = (losses.iter().flatten().map(far)).filter(|d| d.is_finite());
    let (low, high) = seen.fold((f64::INFINITY, 0.0f64), |(l, h), d| (l.min(d), h.max(d)));
    let low = low.min(high);
    let share = |d: f64| (d - low) / (high - low).max(f64::MIN_POSITIVE);

    for (cell, loss) in losses.iter().enumerate().take(SIDE * SIDE) {
        let colour = loss.map_or(CLOTH, |at| ramp(share(far(&at))));
        let corner = middle(cell) - Vec2::repeat(f64::from(CELL) / 2.0);
        fill(
            &mut image,
            [corner.x as i32, corner.y as i32],
            [CELL, CELL],
            colour,
        );
    }
    for (cell, loss) in losses.iter().enumerate().take(SIDE * SIDE) {
        let marked = cell % SIDE % EVERY == 1 && cell / SIDE % EVERY == 1;
        if let (true, Some(loss)) = (marked, loss)
            && let Some(down) = (-loss.gradient).try_normalize(1e-12)
        {
            let to = Vec2::new(down.x, -down.y) * f64::from(CELL) * 1.1;
            line(&mut image, middle(cell), middle(cell) + to, 0, INK);
        }
    }
    for (thickness, colour) in [(2, INK), (1, PATH)] {
        for pair in path.windows(2) {
            let (from, to) = (middle(pair[0].cell), middle(pair[1].cell));
            line(&mut image, from, to, thickness, colour);
        }
    }
    for step in path {
        dot(&mut image, middle(step.cell), 2, PATH);
    }
    if let Some(end) = path.last() {
        dot(&mut image, middle(end.cell), 5, INK);
        dot(&mut image, middle(end.cell), 4, END);
    }
    legend(&mut image, DistanceRange { low, high });
    image
}

/// An image as PNG bytes.
///
/// # Errors
/// Whatever the encoder fails with.
pub fn png(image: &RgbImage) -> Result<Vec<u8>, image::ImageError> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

/// The bar of colours, near at the bottom, with the distances at its ends and middle.
fn legend(image: &mut RgbImage, distances: DistanceRange) {
    let DistanceRange { low, high } = distances;
    let side = SIDE as i32 * CELL;
    let left = side + 2 * MARGIN;
    for row in 0..side {
        let share = 1.0 - f64::from(row) / f64::from(side - 1);
        fill(image, [left, MARGIN + row], [BAR, 1], ramp(share));
    }
    for (share, row) in [(0.0, side - 1), (0.5, side / 2), (1.0, 0)] {
        fill(image, [left + BAR, MARGIN + row], [4, 1], INK);
        let top = (MARGIN + row - 5 * DOT / 2).clamp(0, side + 2 * MARGIN - 5 * DOT);
        let value = low + (high - low) * share;
        number(image, [left + BAR + 7, top], value);
    }
}

/// The colour of a share from 0 (near) to 1 (far).
fn ramp(share: f64) -> Rgb<u8> {
    let at = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let below = (at as usize).min(STOPS.len() - 2);
    let t = at - below as f64;
    let mixed = |c: usize| {
        let (a, b) = (f64::from(STOPS[below][c]), f64::from(STOPS[below + 1][c]));
        (a + (b - a) * t).round() as u8
    };
    Rgb([mixed(0), mixed(1), mixed(2)])
}

/// The pixel in the middle of a cell.
fn middle(cell: usize) -> Vec2 {
    let (i, j) = ((cell % SIDE) as f64, (SIDE - 1 - cell / SIDE) as f64);
    (Vec2::new(i, j) + Vec2::repeat(0.5)) * f64::from(CELL) + Vec2::repeat(f64::from(MARGIN))
}

fn put(image: &mut RgbImage, x: i32, y: i32, colour: Rgb<u8>) {
    if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
        && x < image.width()
        && y < image.height()
    {
        image.put_pixel(x, y, colour);
    }
}

fn fill(image: &mut RgbImage, corner: [i32; 2], size: [i32; 2], colour: Rgb<u8>) {
    for y in corner[1]..corner[1] + size[1] {
        for x in corner[0]..corner[0] + size[0] {
            put(image, x, y, colour);
        }
    }
}

fn dot(image: &mut RgbImage, at: Vec2, radius: i32, colour: Rgb<u8>) {
    for y in -radius..=radius {
        for x in -radius..=radius {
            if x * x + y * y <= radius * radius {
                put(image, at.x as i32 + x, at.y as i32 + y, colour);
            }
        }
    }
}

fn line(image: &mut RgbImage, from: Vec2, to: Vec2, radius: i32, colour: Rgb<u8>) {
    let way = to - from;
    let steps = way.amax().ceil().max(1.0) as i32;
    for k in 0..=steps {
        let at = from + way * (f64::from(k) / f64::from(steps));
        dot(image, at, radius, colour);
    }
}

/// A number with one decimal, from its upper left corner on.
fn number(image: &mut RgbImage, corner: [i32; 2], value: f64) {
    let mut x = corner[0];
    for character in format!("{value:.1}").chars() {
        let Some(digit) = character.to_digit(10) else {
            fill(image, [x, corner[1] + 4 * DOT], [DOT, DOT], INK);
            x += 2 * DOT;
            continue;
        };
        for (row, bits) in (0i32..).zip(DIGITS[digit as usize]) {
            for column in (0..3).filter(|c| bits >> (2 - c) & 1 == 1) {
                let dot = [x + column * DOT, corner[1] + row * DOT];
                fill(image, dot, [DOT, DOT], INK);
            }
        }
        x += 4 * DOT;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_geometry::grid::{CELLS, cell_index};

    #[test]
    fn near_cells_are_bright_and_cells_outside_the_hole_are_grey() {
        let cell_loss = |loss| {
            Some(CellLoss {
                loss,
                gradient: Vec2::zeros(),
            })
        };
        let mut losses = vec![None; CELLS];
        losses[cell_index(30, 30)] = cell_loss(0.0);
        losses[cell_index(31, 30)] = cell_loss(100.0);
        let image = picture(&losses, &[]);
        let pixel = |cell| {
            let at = middle(cell);
            *image.get_pixel(at.x as u32, at.y as u32)
        };
        assert_eq!(pixel(cell_index(30, 30)), Rgb(STOPS[0]));
        assert_eq!(pixel(cell_index(31, 30)), Rgb(STOPS[6]));
        assert_eq!(pixel(cell_index(2, 2)), CLOTH);
        assert_eq!(png(&image).unwrap()[..8], [137, 80, 78, 71, 13, 10, 26, 10]);
    }

    #[test]
    fn a_hole_without_cells_gives_a_map_of_the_same_size() {
        let image = picture(&vec![None; CELLS], &[]);
        assert_eq!(image.height(), 544);
    }
}
