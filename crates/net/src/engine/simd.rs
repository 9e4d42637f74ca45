//! Sixteen floats at a time: one trait, its instances for AVX-512, AVX2 with FMA, NEON and plain Rust, and the choice between them.
//! The only file of darn with `unsafe`. Every instance computes the same per lane, in the same order; the plain one rounds a product
//! before it is added, the others do not.

#![allow(unsafe_code)]

use std::str::FromStr;

/// Floats in a block, and channels in a panel.
pub const LANES: usize = 16;

/// Sixteen channels of one cell; aligned to a cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Block(pub [f32; LANES]);

impl Block {
    pub const ZERO: Block = Block([0.0; LANES]);

    /// Sum of the lanes, in an order that is the same on every CPU.
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
/// A value of an implementing type is the proof that the CPU has the instructions: only [`Target::run`] makes one.
pub trait Simd: Copy {
    /// Sixteen floats in registers.
    type V: Copy;
    /// Rows of accumulators that fit the registers beside their operands.
    const ROWS: usize;
    fn splat(self, x: f32) -> Self::V;
    fn load(self, x: &Block) -> Self::V;
    fn store(self, x: Self::V, to: &mut Block);
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// a · b + c.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// The larger one, lane by lane; `b` where they are equal.
    fn max(self, a: Self::V, b: Self::V) -> Self::V;
    /// `x` where `by` is positive, zero elsewhere.
    fn gate(self, x: Self::V, by: Self::V) -> Self::V;
    /// Asks for the block so many further on, which need not exist.
    #[inline(always)]
    fn prefetch(self, _near: &Block, _ahead: usize) {}
}

/// Work that is compiled once for every instruction set. Implementations must be `#[inline(always)]`, and all they call with a
/// [`Simd`], so that the intrinsics end up in a function that has the instructions.
pub trait Kernel {
    fn run<S: Simd>(self, s: S);
}

/// An instruction set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// Plain Rust, vectorised by the compiler for the least CPU of the platform; runs everywhere.
    Portable,
    /// 128 bits on Arm.
    Neon,
    /// 256 bits on x86.
    Avx2,
    /// 512 bits on x86.
    Avx512,
}

impl Isa {
    /// All of them, best last.
    pub const ALL: [Isa; 4] = [Isa::Portable, Isa::Neon, Isa::Avx2, Isa::Avx512];

    /// The name that [`FromStr`] reads.
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
            #[allow(unreachable_patterns)] // which ones are left depends on the platform
            _ => false,
        }
    }
}

/// A name that is no instruction set's.
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

/// An instruction set that this CPU was seen to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target(Isa);

impl Target {
    /// `None` where the CPU lacks it.
    pub fn new(isa: Isa) -> Option<Target> {
        isa.is_available().then_some(Target(isa))
    }

    /// The best of this CPU.
    pub fn best() -> Target {
        Isa::ALL
            .into_iter()
            .rev()
            .find_map(Target::new)
            .unwrap_or(Target(Isa::Portable))
    }

    pub fn isa(self) -> Isa {
        self.0
    }

    /// Runs a kernel with this instruction set.
    pub fn run<K: Kernel>(self, kernel: K) {
        match self.0 {
            // SAFETY: `Target::new` is the only way to a target other than the portable one, and it has asked the CPU.
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => unsafe { run_avx512(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => unsafe { run_avx2(kernel) },
            // SAFETY: as above.
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
    fn gate(self, x: Block, by: Block) -> Block {
        each(x, by, |x, by| if by > 0.0 { x } else { 0.0 })
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Block, Simd};
    use std::arch::x86_64::*;

    /// Proof of AVX-512F; made by `run_avx512` alone.
    #[derive(Clone, Copy)]
    pub struct Avx512(pub(super) ());

    /// Proof of AVX2 and FMA; made by `run_avx2` alone.
    #[derive(Clone, Copy)]
    pub struct Avx2(pub(super) ());

    #[inline(always)]
    fn prefetch(near: &Block, ahead: usize) {
        let far = std::ptr::from_ref(near).wrapping_add(ahead);
        // SAFETY: a hint that never faults, whatever the address; every x86-64 has it.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(far.cast()) }
    }

    impl Simd for Avx512 {
        type V = __m512;
        const ROWS: usize = 16;

        #[inline(always)]
        fn splat(self, x: f32) -> __m512 {
            // SAFETY: `self` proves AVX-512F; so in all functions of this instance.
            unsafe { _mm512_set1_ps(x) }
        }
        #[inline(always)]
        fn load(self, x: &Block) -> __m512 {
            // SAFETY: AVX-512F as above; a `Block` is 64 bytes, aligned to 64.
            unsafe { _mm512_load_ps(x.0.as_ptr()) }
        }
        #[inline(always)]
        fn store(self, x: __m512, to: &mut Block) {
            // SAFETY: AVX-512F as above; a `Block` is 64 bytes, aligned to 64, and borrowed mutably.
            unsafe { _mm512_store_ps(to.0.as_mut_ptr(), x) }
        }
        #[inline(always)]
        fn add(self, a: __m512, b: __m512) -> __m512 {
            // SAFETY: AVX-512F as above.
            unsafe { _mm512_add_ps(a, b) }
        }
        #[inline(always)]
        fn sub(self, a: __m512, b: __m512) -> __m512 {
            // SAFETY: AVX-512F as above.
            unsafe { _mm512_sub_ps(a, b) }
        }
        #[inline(always)]
        fn mul(self, a: __m512, b: __m512) -> __m512 {
            // SAFETY: AVX-512F as above.
            unsafe { _mm512_mul_ps(a, b) }
        }
        #[inline(always)]
        fn mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
            // SAFETY: AVX-512F as above.
            unsafe { _mm512_fmadd_ps(a, b, c) }
        }
        #[inline(always)]
        fn max(self, a: __m512, b: __m512) -> __m512 {
            // SAFETY: AVX-512F as above.
            unsafe { _mm512_max_ps(a, b) }
        }
        #[inline(always)]
        fn gate(self, x: __m512, by: __m512) -> __m512 {
            // SAFETY: AVX-512F as above.
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
            // SAFETY: `self` proves AVX2 and FMA; so in all functions of this instance.
            unsafe { [_mm256_set1_ps(x); 2] }
        }
        #[inline(always)]
        fn load(self, x: &Block) -> [__m256; 2] {
            let (low, high) = x.0.split_at(8);
            // SAFETY: AVX2 as above; each half of a `Block` is 32 bytes, aligned to 32.
            unsafe { [_mm256_load_ps(low.as_ptr()), _mm256_load_ps(high.as_ptr())] }
        }
        #[inline(always)]
        fn store(self, x: [__m256; 2], to: &mut Block) {
            let (low, high) = to.0.split_at_mut(8);
            // SAFETY: AVX2 as above; each half of a `Block` is 32 bytes, aligned to 32, and borrowed mutably.
            unsafe {
                _mm256_store_ps(low.as_mut_ptr(), x[0]);
                _mm256_store_ps(high.as_mut_ptr(), x[1]);
            }
        }
        #[inline(always)]
        fn add(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: AVX2 as above.
            unsafe { [_mm256_add_ps(a[0], b[0]), _mm256_add_ps(a[1], b[1])] }
        }
        #[inline(always)]
        fn sub(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: AVX2 as above.
            unsafe { [_mm256_sub_ps(a[0], b[0]), _mm256_sub_ps(a[1], b[1])] }
        }
        #[inline(always)]
        fn mul(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: AVX2 as above.
            unsafe { [_mm256_mul_ps(a[0], b[0]), _mm256_mul_ps(a[1], b[1])] }
        }
        #[inline(always)]
        fn mul_add(self, a: [__m256; 2], b: [__m256; 2], c: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: AVX2 and FMA as above.
            unsafe {
                [
                    _mm256_fmadd_ps(a[0], b[0], c[0]),
                    _mm256_fmadd_ps(a[1], b[1], c[1]),
                ]
            }
        }
        #[inline(always)]
        fn max(self, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: AVX2 as above.
            unsafe { [_mm256_max_ps(a[0], b[0]), _mm256_max_ps(a[1], b[1])] }
        }
        #[inline(always)]
        fn gate(self, x: [__m256; 2], by: [__m256; 2]) -> [__m256; 2] {
            // SAFETY: AVX2 as above.
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

    /// Proof of NEON; made by `run_neon` alone.
    #[derive(Clone, Copy)]
    pub struct Neon(pub(super) ());

    type Four = [float32x4_t; 4];

    /// One operation on every quarter.
    #[inline(always)]
    fn quarters(f: impl Fn(usize) -> float32x4_t) -> Four {
        [f(0), f(1), f(2), f(3)]
    }

    impl Simd for Neon {
        type V = Four;
        const ROWS: usize = 6;

        #[inline(always)]
        fn splat(self, x: f32) -> Four {
            // SAFETY: `self` proves NEON; so in all functions of this instance.
            quarters(|_| unsafe { vdupq_n_f32(x) })
        }
        #[inline(always)]
        fn load(self, x: &Block) -> Four {
            // SAFETY: NEON as above; four floats lie behind each quarter's start.
            quarters(|i| unsafe { vld1q_f32(x.0[4 * i..4 * i + 4].as_ptr()) })
        }
        #[inline(always)]
        fn store(self, x: Four, to: &mut Block) {
            for (i, x) in x.into_iter().enumerate() {
                // SAFETY: NEON as above; four floats lie behind each quarter's start, borrowed mutably.
                unsafe { vst1q_f32(to.0[4 * i..4 * i + 4].as_mut_ptr(), x) }
            }
        }
        #[inline(always)]
        fn add(self, a: Four, b: Four) -> Four {
            // SAFETY: NEON as above.
            quarters(|i| unsafe { vaddq_f32(a[i], b[i]) })
        }
        #[inline(always)]
        fn sub(self, a: Four, b: Four) -> Four {
            // SAFETY: NEON as above.
            quarters(|i| unsafe { vsubq_f32(a[i], b[i]) })
        }
        #[inline(always)]
        fn mul(self, a: Four, b: Four) -> Four {
            // SAFETY: NEON as above.
            quarters(|i| unsafe { vmulq_f32(a[i], b[i]) })
        }
        #[inline(always)]
        fn mul_add(self, a: Four, b: Four, c: Four) -> Four {
            // SAFETY: NEON as above.
            quarters(|i| unsafe { vfmaq_f32(c[i], a[i], b[i]) })
        }
        #[inline(always)]
        fn max(self, a: Four, b: Four) -> Four {
            // SAFETY: NEON as above.
            quarters(|i| unsafe { vbslq_f32(vcgtq_f32(a[i], b[i]), a[i], b[i]) })
        }
        #[inline(always)]
        fn gate(self, x: Four, by: Four) -> Four {
            // SAFETY: NEON as above.
            quarters(|i| unsafe {
                let zero = vdupq_n_f32(0.0);
                vbslq_f32(vcgtq_f32(by[i], zero), x[i], zero)
            })
        }
    }
}
