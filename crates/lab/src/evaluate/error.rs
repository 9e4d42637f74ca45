//! Why nothing could be measured.

type BoxedError = Box<dyn std::error::Error + Send + Sync>;

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// The linear system of a smooth fill has no solution.
    #[error("the {fill} system of sample {sample} cannot be solved")]
    Singular {
        /// Name of the fill.
        fill: &'static str,
        /// Number of the sample.
        sample: usize,
    },
    /// A sample has hardly any known cells.
    #[error("sample {sample} has too little known cloth")]
    TooLittleKnown {
        /// Number of the sample.
        sample: usize,
    },
    /// The network failed.
    #[error("the network: {0}")]
    Filler(BoxedError),
    /// A scan could not be mended.
    #[error("a scan: {0}")]
    Mender(BoxedError),
    /// There is no input.
    #[error("there is nothing to measure: {0}")]
    Nothing(&'static str),
}
