//! Which of the loaded networks imagines the cloth, and the frame it wants to see it in.

use darn_contract::{FieldError, v1};
use darn_geometry::grid::NormalGrid;
use darn_net::{
    AnchorLoss, AnchorProblem, Averaging, FillRequest, NetError, Network, Networks, WeightsCard,
};

/// The network for a request that gives an up direction and names no weights.
const FOR_UP: &str = "gravity";

/// A network and how its cloth is turned.
pub struct Inpainter<'a> {
    network: &'a Network,
    voice: Voice,
    /// What a person should know about the choice.
    pub note: Option<String>,
}

/// What decides an inpainter's answers: two of the same voice give the same.
#[derive(Debug, Clone, PartialEq)]
pub struct Voice {
    name: String,
    up: Option<[f64; 3]>,
}

impl<'a> Inpainter<'a> {
    /// The network that the request names; without a name the default one, or `gravity` where `up` is given.
    ///
    /// # Errors
    /// At `/weights`: a name that is not loaded, or weights that need `up` without it.
    pub fn chosen(
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
        let (name, given) = (&card.name, card.architecture.frame.knows_up());
        if given && up.is_none() {
            let detail = format!(
                "`{name}` was trained on cloth that hangs; it needs `up`, the direction against gravity"
            );
            return Err(FieldError::new("/weights", detail));
        }
        let note = (up.is_some() && !given).then(|| match weights {
            Some(_) => format!("`{name}` knows no up; the direction given had no effect"),
            None => format!(
                "no weights `{FOR_UP}` are loaded; `{name}` filled the holes, and `up` had no effect"
            ),
        });
        let up = up.filter(|_| given);
        Ok(Inpainter {
            network,
            voice: Voice {
                name: name.clone(),
                up,
            },
            note,
        })
    }

    /// What decides its answers.
    pub fn voice(&self) -> &Voice {
        &self.voice
    }

    /// What its weights are.
    pub fn card(&self) -> &WeightsCard {
        self.network.card()
    }

    /// Its weights, as a report names them.
    pub fn weights(&self) -> v1::Weights {
        let card = self.card();
        v1::Weights {
            name: card.name.clone(),
            sha256: card.sha256.clone(),
        }
    }

    /// Predicts every cell of every grid, in the network's units.
    pub fn fill(
        &self,
        grids: &[NormalGrid],
        averaging: Averaging,
    ) -> Result<Vec<Vec<[f32; 3]>>, NetError> {
        self.network.fill(&FillRequest {
            grids,
            up: self.voice.up,
            averaging,
        })
    }

    /// A grid and a target, both in the network's units, as the network sees them.
    pub fn anchor_problem(
        &self,
        grid: &NormalGrid,
        target: [f32; 3],
    ) -> Result<AnchorProblem, NetError> {
        self.network.anchor_problem(grid, target, self.voice.up)
    }

    /// Losses of an anchor at uvs.
    pub fn losses(&self, problem: &AnchorProblem, uvs: &[[f32; 2]]) -> Result<Vec<f32>, NetError> {
        self.network.anchor_losses(problem, uvs)
    }

    /// The same with gradients.
    pub fn slopes(
        &self,
        problem: &AnchorProblem,
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        self.network.anchor_gradients(problem, uvs)
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
