//! sRGB's transfer function, by tables.

use std::sync::OnceLock;

/// Bytes to linear numbers from 0 to 1.
pub(crate) struct Decoders {
    pub srgb: [f32; 256],
    pub linear: [f32; 256],
}

pub(crate) fn decoders() -> &'static Decoders {
    static TABLES: OnceLock<Decoders> = OnceLock::new();
    TABLES.get_or_init(|| Decoders {
        srgb: std::array::from_fn(|k| decode(k as f64 / 255.0) as f32),
        linear: std::array::from_fn(|k| k as f32 / 255.0),
    })
}

/// sRGB to linear.
pub(crate) fn decode(x: f64) -> f64 {
    if x <= 0.04045 {
        x / 12.92
    } else {
        ((x + 0.055) / 1.055).powf(2.4)
    }
}

const STEPS: usize = 4096;

/// Linear to a byte of sRGB; numbers outside of 0 to 1 are clamped.
pub(crate) fn encode(x: f32) -> u8 {
    static TABLE: OnceLock<Vec<f32>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let encode = |x: f64| {
            if x <= 0.003_130_8 {
                12.92 * x
            } else {
                1.055 * x.powf(1.0 / 2.4) - 0.055
            }
        };
        (0..=STEPS + 1)
            .map(|k| (255.0 * encode(k as f64 / STEPS as f64)) as f32)
            .collect()
    });
    let at = x.clamp(0.0, 1.0) * STEPS as f32;
    let k = at as usize;
    let value = table[k] + (at - k as f32) * (table[k + 1] - table[k]);
    (value + 0.5).min(255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_comes_back() {
        for k in 0..=255u8 {
            assert_eq!(encode(decoders().srgb[k as usize]), k);
        }
    }
}
