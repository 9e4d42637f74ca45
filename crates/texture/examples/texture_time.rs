//! Prints the time of completing a hole of 512² texels, and of small ones, for each layout: `texture_time [DIAMETER] [TIMES]`.

use std::time::Instant;

use darn_budget::Budget;
use darn_texture::testset::{Fabric, LAYOUTS, TestScan};
use darn_texture::{Completion, Settings};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |otherwise: usize| match arguments.next() {
        Some(text) => text.parse(),
        None => Ok(otherwise),
    };
    let (diameter, times) = (number(512)?, number(5)?);
    for layout in LAYOUTS {
        let scan = TestScan::new(Fabric::Plaid, layout, diameter);
        let cloth = scan.cloth();
        let mut milliseconds = Vec::new();
        let mut size = [0; 2];
        for _ in 0..times {
            let begin = Instant::now();
            let completion = Completion::new(
                &cloth,
                &scan.patch,
                &Settings::default(),
                Budget::unlimited(),
            )?;
            let texture = completion.texture(Budget::unlimited())?;
            milliseconds.push(begin.elapsed().as_secs_f64() * 1000.0);
            size = [texture.width, texture.height];
        }
        milliseconds.sort_by(f64::total_cmp);
        println!(
            "{:<9} {}×{} least {:.1}, median {:.1} ms",
            layout.name(),
            size[0],
            size[1],
            milliseconds[0],
            milliseconds[times / 2],
        );
    }
    Ok(())
}
