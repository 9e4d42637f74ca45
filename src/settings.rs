//! Settings that several commands share, and those of `darn serve` beside the service's own in `darn-serve`.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use darn_budget::{Budget, Limits};
use darn_gltf_scan::ScanLimits;
use darn_mend::NetworkMender;
use darn_serve::ServeArgs;

/// Serve HTTP and gRPC.
#[derive(Debug, Clone, Args)]
pub struct ServeCommand {
    /// The service's own settings.
    #[command(flatten)]
    pub serve: ServeArgs,

    /// Threads of each mend for what can be divided (its holes, copies of a grid), at most 8 of these; left out, one per processor
    #[arg(long, env = "DARN_THREADS", value_name = "N", value_parser = threads)]
    pub threads: Option<usize>,

    #[command(flatten)]
    pub size: SizeArgs,

    #[command(flatten)]
    pub texture: TextureArgs,

    #[command(flatten)]
    pub network: NetworkArgs,
}

/// The limits of a scan's size.
#[derive(Debug, Clone, Args)]
pub struct SizeArgs {
    /// Most triangles a scan may have
    #[arg(long, env = "DARN_MAX_FACES", value_name = "N", default_value = "10000000", value_parser = count)]
    pub max_faces: usize,

    /// Most vertices a scan may have, as its files count them: one that a texture seam splits counts twice
    #[arg(long, env = "DARN_MAX_VERTICES", value_name = "N", default_value = "6000000", value_parser = count)]
    pub max_vertices: usize,
}

impl SizeArgs {
    /// The limits.
    pub fn limits(&self) -> ScanLimits {
        ScanLimits {
            max_faces: self.max_faces,
            max_vertices: self.max_vertices,
            ..ScanLimits::default()
        }
    }
}

/// The images that patches get.
#[derive(Debug, Clone, Copy, Args)]
pub struct TextureArgs {
    /// Most texels of a side of a patch's own texture, with the cloth around it that it is completed from
    #[arg(long, env = "DARN_PATCH_TEXTURE", value_name = "N", default_value = "2048", value_parser = clap::value_parser!(u32).range(64..=8192))]
    pub patch_texture: u32,
}

impl TextureArgs {
    /// Sets them for the mends of a mender.
    pub fn apply(self, mender: &mut NetworkMender) {
        mender.limits.texture.max_side = self.patch_texture;
    }
}

/// How long a command may take.
#[derive(Debug, Clone, Copy, Args)]
pub struct DeadlineArgs {
    /// Longest time that the work may take, such as 30s; left out, as long as it takes
    #[arg(long, value_name = "TIME", value_parser = darn_serve::duration)]
    pub deadline: Option<Duration>,
}

impl DeadlineArgs {
    /// A budget that ends so long from now.
    pub fn budget(self) -> Budget<'static> {
        let limits = Limits {
            deadline: self.deadline.map(|length| Instant::now() + length),
            ..Limits::default()
        };
        Budget::new(limits, &|| false)
    }
}

/// The weights, and the backend that computes with them.
#[derive(Debug, Clone, Args)]
pub struct NetworkArgs {
    /// Directory or file of the weights; left out, the shipped ones
    #[arg(long, env = "DARN_WEIGHTS", value_name = "PATH")]
    pub weights: Option<PathBuf>,

    /// What runs the network
    #[arg(
        long,
        env = "DARN_BACKEND",
        value_name = "NAME",
        default_value = "engine"
    )]
    pub backend: Backend,

    /// What differentiates the network in the anchor search: the engine, or burn's autodiff on flex
    #[arg(
        long,
        env = "DARN_AUTODIFF",
        value_name = "NAME",
        default_value = "engine"
    )]
    pub autodiff: Autodiff,
}

/// What runs the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// darn's own kernels: the fastest.
    Engine,
    /// burn's flex: fast on a processor.
    #[cfg(feature = "burn")]
    Flex,
    /// burn's ndarray: slow, the numerical reference.
    #[cfg(feature = "burn")]
    Ndarray,
}

/// What differentiates the network in the anchor search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Autodiff {
    /// What runs the network.
    Engine,
    /// burn's autodiff on flex.
    #[cfg(feature = "burn")]
    Burn,
}

fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(number @ 1..=1024) => Ok(number),
        _ => Err("must be a whole number from 1 to 1024".to_owned()),
    }
}

fn count(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be at least 1".to_owned()),
        Ok(count) => Ok(count),
        Err(_) => Err("must be a whole number".to_owned()),
    }
}
