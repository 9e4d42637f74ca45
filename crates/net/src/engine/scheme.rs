//! Fast convolutions as one shape: a tile of the input is transformed, multiplied frequency by frequency with the transformed
//! kernel, and transformed back. Winograd's (Lavin & Gray, "Fast Algorithms for Convolutional Neural Networks", 2016) for 3×3; and two
//! of our own for a 3×3 convolution of an image upsampled to twice its side, and its adjoint.

use super::simd::Simd;

/// Transforms along one axis; the other axis is the same.
///
/// `I` cells of input become `F` frequencies, and these `O` cells of output; the next tile begins `STEP` cells further in the input and
/// `O` in the output. The input's tile begins one cell before its first output.
pub trait Scheme<const I: usize, const F: usize, const O: usize> {
    const STEP: usize;
    /// The kernel's frequencies.
    fn kernel(w: [f64; 3]) -> [f64; F];
    /// The input's frequencies.
    fn enter<S: Simd>(s: S, x: [S::V; I]) -> [S::V; F];
    /// The output's cells.
    fn leave<S: Simd>(s: S, m: [S::V; F]) -> [S::V; O];
}

/// Winograd's F(4, 3): 36 products for 16 cells in place of 144.
pub struct Four;

impl Scheme<6, 6, 4> for Four {
    const STEP: usize = 4;

    fn kernel([a, b, c]: [f64; 3]) -> [f64; 6] {
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
    fn enter<S: Simd>(s: S, x: [S::V; 6]) -> [S::V; 6] {
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
    fn leave<S: Simd>(s: S, m: [S::V; 6]) -> [S::V; 4] {
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
pub struct Two;

impl Scheme<4, 4, 2> for Two {
    const STEP: usize = 2;

    fn kernel([a, b, c]: [f64; 3]) -> [f64; 4] {
        [a, (a + b + c) / 2.0, (a - b + c) / 2.0, c]
    }

    #[inline(always)]
    fn enter<S: Simd>(s: S, x: [S::V; 4]) -> [S::V; 4] {
        [
            s.sub(x[0], x[2]),
            s.add(x[1], x[2]),
            s.sub(x[2], x[1]),
            s.sub(x[1], x[3]),
        ]
    }

    #[inline(always)]
    fn leave<S: Simd>(s: S, m: [S::V; 4]) -> [S::V; 2] {
        [
            s.add(s.add(m[0], m[1]), m[2]),
            s.sub(s.sub(m[1], m[2]), m[3]),
        ]
    }
}

/// A convolution of the image with every cell doubled: 9 products for 4 cells in place of 36, and nothing but differences around them.
///
/// Of doubled cells …, x₋, x, x, x₊, … a kernel (a, b, c) makes a x₋ + (b + c) x and (a + b) x + c x₊, which is
/// (a + b + c) x + a (x₋ − x) and (a + b + c) x + c (x₊ − x).
pub struct Up;

impl Scheme<3, 3, 2> for Up {
    const STEP: usize = 1;

    fn kernel([a, b, c]: [f64; 3]) -> [f64; 3] {
        [a, a + b + c, c]
    }

    #[inline(always)]
    fn enter<S: Simd>(s: S, x: [S::V; 3]) -> [S::V; 3] {
        [s.sub(x[0], x[1]), x[1], s.sub(x[2], x[1])]
    }

    #[inline(always)]
    fn leave<S: Simd>(s: S, m: [S::V; 3]) -> [S::V; 2] {
        [s.add(m[1], m[0]), s.add(m[1], m[2])]
    }
}

/// The adjoint of [`Up`], in the same frequencies: cells y₋, y, y′, y₊ of the finer image, of which the coarse cell fed y and y′ most,
/// make (a + b + c)(y + y′) + a (y₊ − y) + c (y₋ − y′).
///
/// The kernel is the forward one: not turned, its channels swapped.
pub struct Down;

impl Scheme<4, 3, 1> for Down {
    const STEP: usize = 2;

    fn kernel(w: [f64; 3]) -> [f64; 3] {
        Up::kernel(w)
    }

    #[inline(always)]
    fn enter<S: Simd>(s: S, x: [S::V; 4]) -> [S::V; 3] {
        [s.sub(x[3], x[1]), s.add(x[1], x[2]), s.sub(x[0], x[2])]
    }

    #[inline(always)]
    fn leave<S: Simd>(s: S, m: [S::V; 3]) -> [S::V; 1] {
        [s.add(s.add(m[0], m[1]), m[2])]
    }
}
