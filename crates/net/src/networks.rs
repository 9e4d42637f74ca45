//! The networks that a service has loaded, by name.

use crate::network::Network;
use crate::weights::WeightsCard;
use std::time::Duration;

/// Loaded networks; at least one.
#[derive(Debug)]
pub struct Networks {
    default: Network,
    others: Vec<Network>,
}

impl Networks {
    /// Prepares the default network now; the others are prepared at their first prediction. Of several networks with one name, the first
    /// is used.
    pub fn new(default: Network, others: Vec<Network>) -> Networks {
        default.prepare();
        Networks { default, others }
    }

    /// The network of requests that name none.
    pub fn default(&self) -> &Network {
        &self.default
    }

    /// The network of this name.
    pub fn get(&self, name: &str) -> Option<&Network> {
        self.all().find(|network| network.card().name == name)
    }

    /// All names, that of the default first.
    pub fn names(&self) -> Vec<&str> {
        self.all().map(|n| n.card().name.as_str()).collect()
    }

    /// All cards, that of the default first.
    pub fn cards(&self) -> impl Iterator<Item = &WeightsCard> {
        self.all().map(Network::card)
    }

    /// Frees what calls left for later calls, if no call has used it for so long.
    pub fn release_idle(&self, unused: Duration) {
        self.all().for_each(|network| network.release_idle(unused));
    }

    fn all(&self) -> impl Iterator<Item = &Network> {
        std::iter::once(&self.default).chain(&self.others)
    }
}
