//! The networks that a service has loaded, by name.

use crate::Network;

/// Loaded networks; never empty, and no two of the same name.
#[derive(Debug)]
pub struct Networks {
    default: Network,
    others: Vec<Network>,
}

impl Networks {
    /// Networks of which the first is used where nobody chooses; of several with one name, the first counts. The
    /// others are prepared when first asked.
    pub fn new(default: Network, others: Vec<Network>) -> Networks {
        default.prepare();
        Networks { default, others }
    }

    /// The one used where nobody chooses.
    pub fn default(&self) -> &Network {
        &self.default
    }

    /// The one of this name.
    pub fn get(&self, name: &str) -> Option<&Network> {
        self.all().find(|network| network.card().name == name)
    }

    /// All names, the default's first.
    pub fn names(&self) -> Vec<&str> {
        self.all().map(|n| n.card().name.as_str()).collect()
    }

    fn all(&self) -> impl Iterator<Item = &Network> {
        std::iter::once(&self.default).chain(&self.others)
    }
}
