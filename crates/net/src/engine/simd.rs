//! Arithmetic on sixteen floats: one trait, its implementations for AVX-512, AVX2 with FMA, NEON and plain Rust, and the choice of one
//! at run time. This is the only file of darn with `unsafe`.
//!
//! Every implementation computes the same per lane, in the same order. Only the plain one rounds a product before it is added.

#![allow(unsafe_code)]

use std::str::FromStr;

/// Floats in a [`Block`], and channels in a channel block.
pub const LANES: usize = 16;

/// Sixteen channels of one cell; aligned to a cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Block(pub [f32; LANES]);

impl Block {
    /// All lanes zero.
    pub const ZERO: Block = Block([0.0; LANES]);

    /// Sum of the lanes, in the same order on every CPU.
    #[inline(always)]
    pub fn sum(&self) -> f32 {
        let mut eight = [0.0; 8];
        for (i, x) in eight.iter_mut().enumerate() {
            *x = self.0[i] + self.0[i + 8];
        }
        let mut four = [0.0; 4];
        for (i, x) in four.iter_mut().enumerate() {
            *x = eight[i] + eight[i + 4];
        }
        (four[0] + four[2]) + (four[1] + four[3])
    }
}

/// Arithmetic on sixteen floats.
///
/// A value of an implementing type proves that the CPU has the instructions: only [`TargetIsa::run`] makes one, after the CPU was asked.
pub trait Simd: Copy {
    /// Sixteen floats in registers.
    type V: Copy;
    /// Accumulators that fit the registers beside their operands.
    const ROWS: usize;
    /// `x` in every lane.
    fn splat(self, x: f32) -> Self::V;
    /// Reads a block.
    fn load(self, x: &Block) -> Self::V;
    /// Writes a block.
    fn store(self, x: Self::V, to: &mut Block);
    /// a + b.
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    /// a − b.
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    /// a · b.
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// a · b + c.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// The larger one, lane by lane; `b` where they are equal.
    fn max(self, a: Self::V, b: Self::V) -> Self::V;
    /// `x` where `by` is positive, zero elsewhere.
    fn where_positive(self, x: Self::V, by: Self::V) -> Self::V;
    /// Prefetches the block `ahead` blocks after `near`, which need not exist.
    #[inline(always)]
    fn prefetch(self, _near: &Block, _ahead: usize) {}
}

/// A computation that is compiled once for every instruction set.
///
/// `run`, and every function that it gives its [`Simd`] to, must be `#[inline(always)]`: the intrinsics must be inlined into a function
/// that is compiled for the instruction set.
pub trait Kernel {
    /// Computes with an instruction set.
    fn run<S: Simd>(self, s: S);
}

/// An instruction set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// Plain Rust, compiled for the oldest CPU of the platform; runs everywhere.
    Portable,
    /// 128 bits on Arm.
    Neon,
    /// 256 bits on x86.
    Avx2,
    /// 512 bits on x86.
    Avx512,
}

impl Isa {
    /// All instruction sets, the fastest last.
    pub const ALL: [Isa; 4] = [Isa::Portable, Isa::Neon, Isa::Avx2, Isa::Avx512];

    /// The name, as [`FromStr`] reads it.
    pub fn name(self) -> &'static str {
        match self {
            Isa::Portable => "portable",
            Isa::Neon => "neon",
            Isa::Avx2 => "avx2",
            Isa::Avx512 => "avx512",
        }
    }

    /// Whether this CPU has it.
    pub fn is_available(self) -> bool {
        match self {
            Isa::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => is_x86_feature_detected!("avx512f") && Isa::Avx2.is_available(),
            #[cfg(target_arch = "aarch64")]
            Isa::Neon => std::arch::is_aarch64_feature_detected!("neon"),
            #[allow(unreachable_patterns)] // the remaining variants depend on the platform
            _ => false,
        }
    }
}

/// A name that no instruction set has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("instruction set `{0}` is unknown; there are: portable, neon, avx2, avx512")]
pub struct UnknownIsa(String);

impl FromStr for Isa {
    type Err = UnknownIsa;

    fn from_str(name: &str) -> Result<Isa, UnknownIsa> {
        Isa::ALL
            .into_iter()
            .find(|isa| isa.name() == name)
            .ok_or_else(|| UnknownIsa(name.to_owned()))
    }
}

/// An instruction set that this CPU has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TargetIsa(Isa);

impl TargetIsa {
    /// `None` if the CPU lacks the instruction set.
    pub fn new(isa: Isa) -> Option<TargetIsa> {
        isa.is_available().then_some(TargetIsa(isa))
    }

    /// The fastest of this CPU.
    pub fn best() -> TargetIsa {
        Isa::ALL
            .into_iter()
            .rev()
            .find_map(TargetIsa::new)
            .unwrap_or(TargetIsa(Isa::Portable))
    }

    /// The instruction set.
    pub fn isa(self) -> Isa {
        self.0
    }

    /// Runs a kernel with this instruction set.
    pub fn run<K: Kernel>(self, kernel: K) {
        match self.0 {
            // SAFETY: only `TargetIsa::new` makes a value with AVX-512, after `is_available` found AVX-512F, AVX2 and FMA on this CPU.
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => unsafe { run_avx512(kernel) },
            // SAFETY: only `TargetIsa::new` makes a value with AVX2, after `is_available` found AVX2 and FMA on this CPU.
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => unsafe { run_avx2(kernel) },
            // SAFETY: only `TargetIsa::new` makes a value with NEON, after `is_available` found NEON on this CPU.
            #[cfg(target_arch = "aarch64")]
            Isa::Neon => unsafe { run_neon(kernel) },
            _ => kernel.run(Portable),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx2,fma")]
fn run_avx512<K: Kernel>(kernel: K) {
    kernel.run(x86::Avx512(()));
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<K: Kernel>(kernel: K) {
    kernel.run(x86::Avx2(()));
}

#[cfg(target_arch = "aarch64")]
#[target_feature(enable = "neon")]
fn run_neon<K: Kernel>(kernel: K) {
    kernel.run(arm::Neon(()));
}

/// Plain Rust.
#[derive(Clone, Copy)]
struct Portable;

/// One operation on every lane.
#[inline(always)]
fn each(a: Block, b: Block, f: impl Fn(f32, f32) -> f32) -> Block {
    let mut out = Block::ZERO;
    for i in 0..LANES {
        out.0[i] = f(a.0[i], b.0[i]);
    }
    out
}

impl Simd for Portable {
    type V = Block;
    const ROWS: usize = 2;

    #[inline(always)]
    fn splat(self, x: f32) -> Block {
        Block([x; LANES])
    }
    #[inline(always)]
    fn load(self, x: &Block) -> Block {
        *x
    }
    #[inline(always)]
    fn store(self, x: Block, to: &mut Block) {
        *to = x;
    }
    #[inline(always)]
    fn add(self, a: Block, b: Block) -> Block {
        each(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, a: Block, b: Block) -> Block {
        each(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, a: Block, b: Block) -> Block {
        each(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn mul_add(self, a: Block, b: Block, c: Block) -> Block {
        self.add(self.mul(a, b), c)
    }
    #[inline(always)]
    fn max(self, a: Block, b: Block) -> Block {
        each(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn where_positive(self, x: Block, by: Block) -> Block {
        each(x, by, |x, by| if by > 0.0 { x } else { 0.0 })
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Block, Simd};
    use std::arch::x86_64::*;

    /// Proof that the CPU has AVX-512F; only `run_avx512` makes one.
    #[derive(Clone, Copy)]
    pub struct Avx512(pub(super) ());

    /// Proof that the CPU has AVX2 and FMA; only `run_avx2` makes one.
    #[derive(Clone, Copy)]
    pub struct Avx2(pub(super) ());

    #[inline(always)]
    fn prefetch(near: &Block, ahead: usize) {
        let far = std::ptr::from_ref(near).wrapping_add(ahead);
        // SAFETY: prefetching is a hint that never faults, whatever the address; every x86-64 CPU has it.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(far.cast()) }
    }

    impl Simd for Avx512 {
        type V = __m512;
        const ROWS: usize = 16;

        #[inline(always)]
        fn splat(self, x: f32) -> __m512 {
            // SAFETY: `self` proves AVX-512F.
            unsafe { _mm512_set1_ps(x) }
        }
        #[inline(always)]
        fn load(self, x: &Block) -> __m512 {
            // SAFETY: `self` proves AVX-512F. A `Block` is 64 bytes, aligned to 64.
            unsafe { _mm512_load_ps(x.0.as_ptr()) }
        }
        #[inline(always)]
        fn store(self, x: __m512, to: &mut Block) {
            // SAFETY: `self` proves AVX-512F. A `Block` is 64 bytes, aligned to 64, and borrowed mutably.
            unsafe { _mm512_store_ps(to.0.as_mut_ptr(), x) }
        }
        #[inline(always)]
        fn add(self, a: __m512, b: __m512) -> __m512 {
            // SAFETY: `self` proves AVX-512F.
            unsafe { _mm512_add_ps(a, b) }
        }
        #[inline(always)]
        fn sub(self, a: __m512, b: __m512) -> __m512 {
            // SAFETY: `self` proves AVX-512F.
            unsafe { _mm512_sub_ps(a, b) }
        }
        #[inline(always)]
        fn mul(self, a: __m512, b: __m512) -> __m512 {
            // SAFETY: `self` proves AVX-512F.
            unsafe { _mm512_mul_ps(a, b) }
        }
        #[inline(always)]
        fn mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
            // SAFETY: `self` proves AVX-512F.
            unsafe { _mm512_fmadd_ps(a, b, c) }
        }
        #[inline(always)]
        fn max(self, a: __m512, b: __m512) -> __m512 {
            // SAFETY: `self` proves AVX-512F.
            unsafe { _mm512_max_ps(a, b) }
        }
        #[inline(always)]
        fn where_positive(self, x: __m512, by: __m512) -> __m512 {
            // SAFETY: `self` proves AVX-512F.
            unsafe {
                let open = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(by, _mm512_setzero_ps());
                _mm512_maskz_mov_ps(open, x)
            }
        }
        #[inline(always)]
        fn prefetch(self, near: &Block, ahead: usize) {
            prefetch(near, ahead);
        }
    }

    impl Simd for Avx2 {
        type V = [__m256; 2];
        const ROWS: usize = 6;

        #[inline(always)]
        fn splat(self, x: f32) -> [__m256; 2] {
            // SAFETY: `self` proves AVX2 and FMA.
            unsafe { [_mm256_set1_ps(x); 2] }
        }
        #[inline(always)]
        fn load(self, x: &Block) -> [__m256; 2] {
            let (low, high) = x.0.split_at(8);
            // SAFETY: `self` proves AVX2. Each half of a `Block` is 32 bytes, aligned to 32.
            unsafe { [_mm256_load_ps(low.as_ptr()), _mm256_load_ps(high.as_ptr())] }
        }
        #[inline(always)]
        fn store(self, x: [__m256; 2], to: &mut Block) {
            let (low, high) = to.0.split_at_mut(8);
            // SAFETY: `self` proves AVX2. Each half of a `Block` is 32 bytes, aligned to 32, and borrowed mutably.
            unsafe {
                _mm256_store_ps(low.as_mut_ptr(), x[0]);
                _mm256_store_ps(high.as_mut_ptr(), x[1]);
            }
        }
        #[inline(always)]
        fn add(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: `self` proves AVX2.
            unsafe { [_mm256_add_ps(a[0], b[0]), _mm256_add_ps(a[1], b[1])] }
        }
        #[inline(always)]
        fn sub(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: `self` proves AVX2.
            unsafe { [_mm256_sub_ps(a[0], b[0]), _mm256_sub_ps(a[1], b[1])] }
        }
        #[inline(always)]
        fn mul(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: `self` proves AVX2.
            unsafe { [_mm256_mul_ps(a[0], b[0]), _mm256_mul_ps(a[1], b[1])] }
        }
        #[inline(always)]
        fn mul_add(self, a: [__m256; 2], b: [__m256; 2], c: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: `self` proves AVX2 and FMA.
            unsafe {
                [
                    _mm256_fmadd_ps(a[0], b[0], c[0]),
                    _mm256_fmadd_ps(a[1], b[1], c[1]),
                ]
            }
        }
        #[inline(always)]
        fn max(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: `self` proves AVX2.
            unsafe { [_mm256_max_ps(a[0], b[0]), _mm256_max_ps(a[1], b[1])] }
        }
        #[inline(always)]
        fn where_positive(self, x: [__m256; 2], by: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: `self` proves AVX2.
            unsafe {
                let zero = _mm256_setzero_ps();
                [
                    _mm256_and_ps(x[0], _mm256_cmp_ps::<_CMP_GT_OQ>(by[0], zero)),
                    _mm256_and_ps(x[1], _mm256_cmp_ps::<_CMP_GT_OQ>(by[1], zero)),
                ]
            }
        }
        #[inline(always)]
        fn prefetch(self, near: &Block, ahead: usize) {
            prefetch(near, ahead);
        }
    }
}

#[cfg(target_arch = "aarch64")]
mod arm {
    use super::{Block, Simd};
    use std::arch::aarch64::*;

    /// Proof that the CPU has NEON; only `run_neon` makes one.
    #[derive(Clone, Copy)]
    pub struct Neon(pub(super) ());

    /// The four quarters of a block.
    type Quarters = [float32x4_t; 4];

    /// One operation on every quarter.
    #[inline(always)]
    fn quarters(f: impl Fn(usize) -> float32x4_t) -> Quarters {
        [f(0), f(1), f(2), f(3)]
    }

    impl Simd for Neon {
        type V = Quarters;
        const ROWS: usize = 6;

        #[inline(always)]
        fn splat(self, x: f32) -> Quarters {
            // SAFETY: `self` proves NEON.
            quarters(|_| unsafe { vdupq_n_f32(x) })
        }
        #[inline(always)]
        fn load(self, x: &Block) -> Quarters {
            // SAFETY: `self` proves NEON. Four floats lie from each quarter's start on.
            quarters(|i| unsafe { vld1q_f32(x.0[4 * i..4 * i + 4].as_ptr()) })
        }
        #[inline(always)]
        fn store(self, x: Quarters, to: &mut Block) {
            for (i, x) in x.into_iter().enumerate() {
                // SAFETY: `self` proves NEON. Four floats lie from each quarter's start on, borrowed mutably.
                unsafe { vst1q_f32(to.0[4 * i..4 * i + 4].as_mut_ptr(), x) }
            }
        }
        #[inline(always)]
        fn add(self, a: Quarters, b: Quarters) -> Quarters {
            // SAFETY: `self` proves NEON.
            quarters(|i| unsafe { vaddq_f32(a[i], b[i]) })
        }
        #[inline(always)]
        fn sub(self, a: Quarters, b: Quarters) -> Quarters {
            // SAFETY: `self` proves NEON.
            quarters(|i| unsafe { vsubq_f32(a[i], b[i]) })
        }
        #[inline(always)]
        fn mul(self, a: Quarters, b: Quarters) -> Quarters {
            // SAFETY: `self` proves NEON.
            quarters(|i| unsafe { vmulq_f32(a[i], b[i]) })
        }
        #[inline(always)]
        fn mul_add(self, a: Quarters, b: Quarters, c: Quarters) -> Quarters {
            // SAFETY: `self` proves NEON.
            quarters(|i| unsafe { vfmaq_f32(c[i], a[i], b[i]) })
        }
        #[inline(always)]
        fn max(self, a: Quarters, b: Quarters) -> Quarters {
            // SAFETY: `self` proves NEON.
            quarters(|i| unsafe { vbslq_f32(vcgtq_f32(a[i], b[i]), a[i], b[i]) })
        }
        #[inline(always)]
        fn where_positive(self, x: Quarters, by: Quarters) -> Quarters {
            // SAFETY: `self` proves NEON.
            quarters(|i| unsafe {
                let zero = vdupq_n_f32(0.0);
                vbslq_f32(vcgtq_f32(by[i], zero), x[i], zero)
            })
        }
    }
}
