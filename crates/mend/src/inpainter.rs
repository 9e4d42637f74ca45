//! The network that predicts a request's cloth, with the up direction it is told.

use crate::error::MendError;
use darn_contract::{FieldError, v1};
use darn_geometry::grid::NormalGrid;
use darn_net::{
    AnchorLoss, AnchorProblem, Averaging, FillRequest, FilledGrid, NetError, Network, Networks,
    WeightsCard,
};

/// Name of the network for a request that gives an up direction and names no weights.
const FOR_UP: &str = "gravity";

/// A network, and the up direction of a request.
#[derive(Clone)]
pub struct Inpainter<'a> {
    network: &'a Network,
    key: FillKey,
    /// What a person should know about the choice of network.
    pub note: Option<String>,
}

/// What decides an inpainter's answers to a grid: inpainters with equal keys answer alike.
#[derive(Debug, Clone, PartialEq)]
pub struct FillKey {
    name: String,
    up: Option<[f64; 3]>,
    /// Which of the plausible fills it answers with, 0 the likeliest.
    pub alternative: u8,
}

impl<'a> Inpainter<'a> {
    /// The network that the request names; without a name the default one, or `gravity` where `up` is given.
    ///
    /// # Errors
    /// At `/weights`: a name that is not loaded, or weights that need `up` without it.
    pub fn choose(
        networks: &'a Networks,
        weights: Option<&str>,
        up: Option<[f64; 3]>,
    ) -> Result<Inpainter<'a>, MendError> {
        Self::chosen(networks, weights, up).map_err(|wrong| MendError::Constraints(vec![wrong]))
    }

    fn chosen(
        networks: &'a Networks,
        weights: Option<&str>,
        up: Option<[f64; 3]>,
    ) -> Result<Inpainter<'a>, FieldError> {
        let network = match (weights, up) {
            (Some(name), _) => networks.get(name).ok_or_else(|| unknown(name, networks))?,
            (None, Some(_)) => networks.get(FOR_UP).unwrap_or_else(|| networks.default()),
            (None, None) => networks.default(),
        };
        let card = network.card();
        let (name, knows_up) = (&card.name, card.architecture.frame.knows_up());
        if knows_up && up.is_none() {
            let detail = format!(
                "`{name}` was trained on cloth that hangs; it needs `up`, the direction against gravity"
            );
            return Err(FieldError::new("/weights", detail));
        }
        let note = (up.is_some() && !knows_up).then(|| match weights {
            Some(_) => format!("`{name}` knows no up; the direction given had no effect"),
            None => format!(
                "no weights `{FOR_UP}` are loaded; `{name}` filled the holes, and `up` had no effect"
            ),
        });
        let up = up.filter(|_| knows_up);
        Ok(Inpainter {
            network,
            key: FillKey {
                name: name.clone(),
                up,
                alternative: 0,
            },
            note,
        })
    }

    /// The same inpainter, for another of the plausible fills.
    pub fn with_alternative(mut self, alternative: u8) -> Self {
        self.key.alternative = alternative;
        self
    }

    /// The fill of a grid that was asked for; network's units. `None` where there is none.
    ///
    /// # Errors
    /// What [`Network::fill`] refuses.
    pub fn alternative(&self, grid: &NormalGrid) -> Result<Option<Vec<[f32; 3]>>, NetError> {
        if self.key.alternative == 0 {
            return Ok(None);
        }
        let fills = self.network.alternatives(grid, self.key.up)?;
        Ok(fills.into_iter().nth(self.key.alternative.into()))
    }

    /// What decides its answers.
    pub fn key(&self) -> &FillKey {
        &self.key
    }

    /// What its weights are.
    pub fn card(&self) -> &WeightsCard {
        self.network.card()
    }

    /// Its weights, as a report names them.
    pub fn weights(&self) -> v1::Weights {
        weights_of(self.card())
    }

    /// Predicts every cell of every grid, in the network's units.
    ///
    /// # Errors
    /// What [`Network::fill`] refuses.
    pub fn fill(
        &self,
        grids: &[NormalGrid],
        averaging: Averaging,
    ) -> Result<Vec<FilledGrid>, NetError> {
        self.network.fill(&FillRequest {
            grids,
            up: self.key.up,
            averaging,
        })
    }

    /// The anchor search's problem: a grid and a target, both in the network's units, as the network sees them.
    ///
    /// # Errors
    /// A grid of another size.
    pub fn anchor_problem(
        &self,
        grid: &NormalGrid,
        target: [f32; 3],
    ) -> Result<AnchorProblem, NetError> {
        self.network.anchor_problem(grid, target, self.key.up)
    }

    /// The loss of an anchor at each of the uvs, squared cells.
    ///
    /// # Errors
    /// Values that make the answer overflow.
    pub fn losses(&self, problem: &AnchorProblem, uvs: &[[f32; 2]]) -> Result<Vec<f32>, NetError> {
        self.network.anchor_losses(problem, uvs)
    }

    /// The same losses with their gradients.
    ///
    /// # Errors
    /// As of [`Inpainter::losses`].
    pub fn gradients(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        self.network.anchor_gradients(problem, uvs)
    }
}

/// The weights of a card, as the contract names them.
pub fn weights_of(card: &WeightsCard) -> v1::Weights {
    v1::Weights {
        name: card.name.clone(),
        sha256: card.sha256.clone(),
    }
}

fn unknown(name: &str, networks: &Networks) -> FieldError {
    let known: Vec<String> = networks.names().iter().map(|n| format!("`{n}`")).collect();
    FieldError::new(
        "/weights",
        format!(
            "no weights `{name}` are loaded; there are: {}",
            known.join(", ")
        ),
    )
}
