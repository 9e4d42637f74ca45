//! The layers of the forward pass and of the adjoint pass, laid out for the kernels.
//!
//! They are packed on one thread. The first to ask may be a thread of a pool; if it waited for others there, it could be given work that
//! asks for the same layers again.

use super::feature_map::level_side;
use super::fuse::{FusedConv, FusedWeights};
use super::gate::PackedGate;
use super::gate_adjoint::PackedGateAdjoint;
use super::pack::{ConvAlgorithm, PackedConv, layout};

/// The layers of the forward pass, but for the last.
#[derive(Debug)]
pub struct ForwardLayers {
    /// By level, two convolutions each.
    pub down: Vec<[PackedConv; 2]>,
    /// By level.
    pub up: Vec<UpLayers>,
}

/// The layers of one step up.
#[derive(Debug)]
pub struct UpLayers {
    pub conv: PackedConv,
    pub gate: PackedGate,
    pub block: [PackedConv; 2],
}

impl ForwardLayers {
    /// Lays out fused weights.
    pub fn pack(weights: &FusedWeights) -> ForwardLayers {
        // `run` is the length of the runs of the input's channels.
        let block = |level: usize, [first, second]: &[FusedConv; 2], run: usize| {
            let algorithm = ConvAlgorithm::for_side(level_side(level));
            let inner = first.out_channels;
            [
                PackedConv::pack(algorithm, first, layout(run, inner)),
                PackedConv::pack(algorithm, second, layout(inner, inner)),
            ]
        };
        let down = weights.down.iter().enumerate();
        let up = weights.up.iter().enumerate();
        ForwardLayers {
            down: down
                .map(|(level, convs)| block(level, convs, convs[0].in_channels))
                .collect(),
            up: up
                .map(|(level, up)| UpLayers {
                    conv: PackedConv::pack(
                        ConvAlgorithm::Upsample,
                        &up.conv,
                        layout(up.conv.in_channels, up.conv.out_channels),
                    ),
                    gate: PackedGate::pack(&up.gate),
                    block: block(level, &up.block, up.conv.out_channels),
                })
                .collect(),
        }
    }

    /// All convolutions.
    pub fn convs(&self) -> impl Iterator<Item = &PackedConv> {
        let up = self.up.iter();
        let up = up.flat_map(|up| up.block.iter().chain(std::iter::once(&up.conv)));
        self.down.iter().flatten().chain(up)
    }
}

/// The layers of the adjoint pass; those of a block in the order of the forward pass.
#[derive(Debug)]
pub struct AdjointLayers {
    /// By level, two convolutions each.
    pub down: Vec<[PackedConv; 2]>,
    /// By level.
    pub up: Vec<UpAdjointLayers>,
}

/// The adjoint layers of one step up.
#[derive(Debug)]
pub struct UpAdjointLayers {
    pub conv: PackedConv,
    pub gate: PackedGateAdjoint,
    pub block: [PackedConv; 2],
}

impl AdjointLayers {
    /// Lays out the adjoints of fused weights.
    pub fn pack(weights: &FusedWeights) -> AdjointLayers {
        // `run` is the length of the runs of the block's input channels, which are the adjoint's output channels.
        let block = |level: usize, [first, second]: &[FusedConv; 2], run: usize| {
            let algorithm = ConvAlgorithm::for_side(level_side(level));
            let inner = first.out_channels;
            [
                PackedConv::pack(algorithm, &first.adjoint(), layout(inner, run)),
                PackedConv::pack(algorithm, &second.adjoint(), layout(inner, inner)),
            ]
        };
        let down = weights.down.iter().enumerate();
        let up = weights.up.iter().enumerate();
        AdjointLayers {
            down: down
                .map(|(level, convs)| block(level, convs, convs[0].in_channels))
                .collect(),
            up: up
                .map(|(level, up)| UpAdjointLayers {
                    conv: PackedConv::pack(
                        ConvAlgorithm::UpsampleAdjoint,
                        &up.conv.transposed(),
                        layout(up.conv.out_channels, up.conv.in_channels),
                    ),
                    gate: PackedGateAdjoint::pack(&up.gate),
                    block: block(level, &up.block, up.conv.out_channels),
                })
                .collect(),
        }
    }

    /// All convolutions.
    pub fn convs(&self) -> impl Iterator<Item = &PackedConv> {
        let up = self.up.iter();
        let up = up.flat_map(|up| up.block.iter().chain(std::iter::once(&up.conv)));
        self.down.iter().flatten().chain(up)
    }
}
