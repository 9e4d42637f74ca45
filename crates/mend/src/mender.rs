//! The loaded networks with their limits, and a call to them.

use std::sync::Arc;
use std::time::Duration;

use darn_budget::Budget;
use darn_geometry::patch::PatchWork;
use darn_gltf_scan::ScanLimits;
use darn_net::Networks;

use crate::call_pools::CallPools;
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
    /// The threads of calls that come through the port.
    pub pools: CallPools,
}

impl NetworkMender {
    /// A mender with default limits.
    pub fn new(networks: Networks) -> NetworkMender {
        NetworkMender {
            networks,
            limits: MendLimits::default(),
            scan_limits: ScanLimits::default(),
            pools: CallPools::default(),
        }
    }

    /// Frees buffers and threads that no call has used for so long; the next call makes them anew.
    pub fn release_idle(&self, unused: Duration) {
        self.networks.release_idle(unused);
        self.pools.release_idle(unused);
    }
}

/// A mender and what the call to it may cost. A call made from a [`NetworkMender`] alone has no limits.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// The networks and limits.
    pub mender: &'a NetworkMender,
    /// What the call may cost, and whether the caller still waits.
    pub budget: &'a Budget<'a>,
}

impl<'a> From<Call<'a>> for PatchWork<'a> {
    fn from(call: Call<'a>) -> PatchWork<'a> {
        PatchWork {
            last: None,
            options: &call.mender.limits.patch,
            budget: call.budget,
        }
    }
}

impl<'a> From<&'a NetworkMender> for Call<'a> {
    fn from(mender: &'a NetworkMender) -> Self {
        Call {
            mender,
            budget: Budget::unlimited(),
        }
    }
}

impl<'a> From<&'a Arc<NetworkMender>> for Call<'a> {
    fn from(mender: &'a Arc<NetworkMender>) -> Self {
        Call::from(&**mender)
    }
}
