//! Colour for patches: the cloth around a hole, laid flat, and its example-based completion.
//!
//! ```text
//! Cloth, PatchChart ─▶ rasters: known texels, hole ─▶ offsets at which the cloth is like itself ─▶ one offset per place ─▶ images
//!                      density, frame, resample,      features, correlation, shading, offsets,     expansion, labels       compose, blend,
//!                      mirror, gather                 selection, search                                                    gutter
//! ```
//!
//! The chart is isometric, so cloth looks in it as it lies on a table, and its pattern goes on in the hole by translation.
//!
//! 1. The images around the hole are resampled into a raster of the chart at the texel density of the rim. Normals are turned into the chart's frame.
//!    Where the cloth shows its images twice, mirrored at a line, what one side lacks is taken from the other (`mirror`).
//! 2. The cloth is compared with itself at all offsets by Fourier transforms. The offsets at which it is most alike are its repeats (He and Sun 2012).
//!    Differences that remain there and change slowly are light, and are taken out.
//! 3. Few offsets are chosen so that every place of the hole has some that suit the cloth at the rim in each direction (`selection`).
//! 4. Every place gets one of them, so that seams are seen least (α-expansion), and every texel copies, in all layers, the known texel at that offset.
//! 5. Copies meet the rim and each other in the gradient domain, normals excepted. Known texels keep their bits.
//!
//! [`Completion::score_continued`] tells whether continuing the scan's texture coordinates would do as well.
//!
//! The same input gives the same bytes on any number of threads. Memory follows from [`Settings::max_side`] ([`estimated_bytes`]).

mod blend;
mod completion;
mod compose;
mod continued;
mod correlation;
mod density;
mod expansion;
mod features;
mod fft;
mod flow;
mod frame;
mod gather;
mod gutter;
mod input;
mod labels;
mod mean;
mod mirror;
mod offsets;
mod resample;
mod sample;
mod seams;
mod search;
mod selection;
mod shading;
mod srgb;
mod tangent;
pub mod testset;

pub use completion::{Completion, PatchTexture, estimated_bytes};
pub use continued::{ContinuedPatch, ContinuedScore};
pub use input::{
    Cloth, CornerTexcoords, LayerKind, PatchChart, Settings, Source, SourceImage, TextureError,
    Wrap,
};
pub use mean::mean_texels;
pub use tangent::tangents;
