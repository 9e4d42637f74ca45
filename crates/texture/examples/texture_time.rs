//! Prints the time of completing a hole of 512² texels, three times for each layout.

use std::time::Instant;

use darn_budget::Budget;
use darn_texture::testset::{Fabric, LAYOUTS, TestScan};
use darn_texture::{Completion, Settings};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for layout in LAYOUTS {
        let scan = TestScan::new(Fabric::Plaid, layout, 512);
        let cloth = scan.cloth();
        for _ in 0..3 {
            let begin = Instant::now();
            let completion = Completion::new(
                &cloth,
                &scan.patch,
                &Settings::default(),
                Budget::unlimited(),
            )?;
            let texture = completion.texture(Budget::unlimited())?;
            let milliseconds = begin.elapsed().as_secs_f64() * 1000.0;
            println!(
                "{:<9} {}×{} {milliseconds:.0} ms",
                layout.name(),
                texture.width,
                texture.height
            );
        }
    }
    Ok(())
}
