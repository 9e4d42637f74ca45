//! Fast 3×3 convolutions by tiles: transform a tile of the input, multiply it frequency by frequency with the transformed kernel, and
//! transform the products back. Two are Winograd's (Lavin & Gray, "Fast Algorithms for Convolutional Neural Networks", 2016); one is for
//! a 3×3 convolution of an image upsampled to twice its side, and one is the adjoint of that.

use super::simd::Simd;

/// The transforms along one axis; both axes use the same.
///
/// `I` input cells become `F` frequencies, and these become `O` output cells. The next tile begins `STEP` cells further in the input and
/// `O` cells further in the output. A tile's input begins one cell before its first output.
pub trait TileTransform<const I: usize, const F: usize, const O: usize> {
    /// Input cells from a tile to the next.
    const STEP: usize;
    /// Frequencies of a kernel's three taps.
    fn kernel(taps: [f64; 3]) -> [f64; F];
    /// Frequencies of input cells.
    fn forward<S: Simd>(s: S, x: [S::V; I]) -> [S::V; F];
    /// Output cells of the products.
    fn inverse<S: Simd>(s: S, m: [S::V; F]) -> [S::V; O];
}

/// Winograd's F(4, 3): 36 products for 16 cells in place of 144.
pub struct WinogradF4;

impl TileTransform<6, 6, 4> for WinogradF4 {
    const STEP: usize = 4;

    fn kernel(taps: [f64; 3]) -> [f64; 6] {
        let [a, b, c] = taps;
        [
            a / 4.0,
            -(a + b + c) / 6.0,
            -(a - b + c) / 6.0,
            (a + 2.0 * b + 4.0 * c) / 24.0,
            (a - 2.0 * b + 4.0 * c) / 24.0,
            c,
        ]
    }

    #[inline(always)]
    fn forward<S: Simd>(s: S, x: [S::V; 6]) -> [S::V; 6] {
        let (two, four, five) = (s.splat(2.0), s.splat(4.0), s.splat(-5.0));
        let minus_four = s.splat(-4.0);
        let even = s.mul_add(minus_four, x[2], x[4]);
        let odd = s.mul_add(minus_four, x[1], x[3]);
        let near = s.sub(x[4], x[2]);
        let far = s.mul(two, s.sub(x[3], x[1]));
        [
            s.mul_add(four, x[0], s.mul_add(five, x[2], x[4])),
            s.add(even, odd),
            s.sub(even, odd),
            s.add(near, far),
            s.sub(near, far),
            s.mul_add(four, x[1], s.mul_add(five, x[3], x[5])),
        ]
    }

    #[inline(always)]
    fn inverse<S: Simd>(s: S, m: [S::V; 6]) -> [S::V; 4] {
        let (two, four, eight) = (s.splat(2.0), s.splat(4.0), s.splat(8.0));
        let (sum1, sum2) = (s.add(m[1], m[2]), s.add(m[3], m[4]));
        let (gap1, gap2) = (s.sub(m[1], m[2]), s.sub(m[3], m[4]));
        [
            s.add(s.add(m[0], sum1), sum2),
            s.mul_add(two, gap2, gap1),
            s.mul_add(four, sum2, sum1),
            s.add(s.mul_add(eight, gap2, gap1), m[5]),
        ]
    }
}

/// Winograd's F(2, 3): 16 products for 4 cells in place of 36.
pub struct WinogradF2;

impl TileTransform<4, 4, 2> for WinogradF2 {
    const STEP: usize = 2;

    fn kernel(taps: [f64; 3]) -> [f64; 4] {
        let [a, b, c] = taps;
        [a, (a + b + c) / 2.0, (a - b + c) / 2.0, c]
    }

    #[inline(always)]
    fn forward<S: Simd>(s: S, x: [S::V; 4]) -> [S::V; 4] {
        [
            s.sub(x[0], x[2]),
            s.add(x[1], x[2]),
            s.sub(x[2], x[1]),
            s.sub(x[1], x[3]),
        ]
    }

    #[inline(always)]
    fn inverse<S: Simd>(s: S, m: [S::V; 4]) -> [S::V; 2] {
        [
            s.add(s.add(m[0], m[1]), m[2]),
            s.sub(s.sub(m[1], m[2]), m[3]),
        ]
    }
}

/// The convolution of an image whose cells are repeated twice along both axes: 9 products for 4 cells in place of 36.
///
/// On the repeated cells …, x₋, x, x, x₊, … the kernel (a, b, c) gives a x₋ + (b + c) x and (a + b) x + c x₊. These equal
/// (a + b + c) x + a (x₋ − x) and (a + b + c) x + c (x₊ − x).
pub struct Upsample;

impl TileTransform<3, 3, 2> for Upsample {
    const STEP: usize = 1;

    fn kernel(taps: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = taps;
        [a, a + b + c, c]
    }

    #[inline(always)]
    fn forward<S: Simd>(s: S, x: [S::V; 3]) -> [S::V; 3] {
        [s.sub(x[0], x[1]), x[1], s.sub(x[2], x[1])]
    }

    #[inline(always)]
    fn inverse<S: Simd>(s: S, m: [S::V; 3]) -> [S::V; 2] {
        [s.add(m[1], m[0]), s.add(m[1], m[2])]
    }
}

/// The adjoint of [`Upsample`], in the same frequencies. Of the finer cells y₋, y, y′, y₊, where y and y′ lie in the coarse cell, it gives
/// (a + b + c)(y + y′) + a (y₊ − y) + c (y₋ − y′).
///
/// Its kernel is the forward one with channels swapped; it is not turned.
pub struct UpsampleAdjoint;

impl TileTransform<4, 3, 1> for UpsampleAdjoint {
    const STEP: usize = 2;

    fn kernel(taps: [f64; 3]) -> [f64; 3] {
        Upsample::kernel(taps)
    }

    #[inline(always)]
    fn forward<S: Simd>(s: S, x: [S::V; 4]) -> [S::V; 3] {
        [s.sub(x[3], x[1]), s.add(x[1], x[2]), s.sub(x[0], x[2])]
    }

    #[inline(always)]
    fn inverse<S: Simd>(s: S, m: [S::V; 3]) -> [S::V; 1] {
        [s.add(s.add(m[0], m[1]), m[2])]
    }
}
