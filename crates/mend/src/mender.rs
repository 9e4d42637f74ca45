//! The loaded networks with their limits, and a call to them.

use std::sync::Arc;

use darn_contract::port::Cancellation;
use darn_gltf_scan::ScanLimits;
use darn_net::Networks;

use crate::error::MendError;
use crate::limits::MendLimits;

/// The loaded networks, and the limits of a mend.
#[derive(Debug)]
pub struct NetworkMender {
    /// The networks that predict the cloth.
    pub networks: Networks,
    /// The limits and options of a mend.
    pub limits: MendLimits,
    /// The limits of reading a scan.
    pub scan_limits: ScanLimits,
}

impl NetworkMender {
    /// A mender with default limits.
    pub fn new(networks: Networks) -> NetworkMender {
        NetworkMender {
            networks,
            limits: MendLimits::default(),
            scan_limits: ScanLimits::default(),
        }
    }
}

/// A mender and its caller's cancellation check. A call made from a [`NetworkMender`] alone is never cancelled.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// The networks and limits.
    pub mender: &'a NetworkMender,
    /// Whether the caller still waits.
    pub cancellation: Cancellation<'a>,
}

impl<'a> From<&'a NetworkMender> for Call<'a> {
    fn from(mender: &'a NetworkMender) -> Self {
        Call {
            mender,
            cancellation: Cancellation::NEVER,
        }
    }
}

impl<'a> From<&'a Arc<NetworkMender>> for Call<'a> {
    fn from(mender: &'a Arc<NetworkMender>) -> Self {
        Call::from(&**mender)
    }
}

/// # Errors
/// `Abandoned` when the call was cancelled.
pub(crate) fn check_cancelled(cancellation: Cancellation) -> Result<(), MendError> {
    match cancellation.is_cancelled() {
        true => Err(MendError::Abandoned),
        false => Ok(()),
    }
}
