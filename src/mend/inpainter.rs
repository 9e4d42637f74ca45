//! Which of the loaded networks imagines the cloth, and the frame it wants to see it in.

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::contract::{FieldError, v1};
use crate::grid::NormalGrid;
use crate::mesh::Vec3;
use crate::net::{AnchorLoss, Averaging, NetError, Network, Networks, WeightsCard};

/// The network for a request that gives an up direction and names no weights.
const FOR_UP: &str = "gravity";

/// A network and how its cloth is turned.
pub struct Inpainter<'a> {
    network: &'a Network,
    /// To the network's frame; none when it takes the cloth as it lies.
    turn: Option<Matrix3<f32>>,
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
            turn: up.map(upright),
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
        let Some(turn) = &self.turn else {
            return self.network.fill_averaged(grids, averaging);
        };
        let turned: Vec<NormalGrid> = grids.iter().map(|g| self.turned(g)).collect();
        let back = turn.transpose();
        let mut answers = self.network.fill_averaged(&turned, averaging)?;
        for p in answers.iter_mut().flatten() {
            *p = times(&back, *p);
        }
        Ok(answers)
    }

    /// A grid as the network wants to see it.
    pub fn turned(&self, grid: &NormalGrid) -> NormalGrid {
        let turned = |cells: &[[f32; 3]]| cells.iter().map(|p| self.entering(*p)).collect();
        NormalGrid {
            positions: turned(&grid.positions),
            known: grid.known.clone(),
            base: grid.base.as_deref().map(turned),
        }
    }

    /// A position as the network wants to see it.
    pub fn entering(&self, p: [f32; 3]) -> [f32; 3] {
        self.turn.map_or(p, |turn| times(&turn, p))
    }

    /// Losses of an anchor at uvs; grid and target [turned](Self::turned).
    pub fn losses(
        &self,
        grid: &NormalGrid,
        target: [f32; 3],
        uvs: &[[f32; 2]],
    ) -> Result<Vec<f32>, NetError> {
        self.network.anchor_losses(grid, target, uvs)
    }

    /// The same with gradients.
    pub fn slopes(
        &self,
        grid: &NormalGrid,
        target: [f32; 3],
        uvs: &[[f32; 2]],
    ) -> Result<Vec<AnchorLoss>, NetError> {
        self.network.anchor_gradients(grid, target, uvs)
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

/// The smallest turn that brings `up` to +z.
fn upright(up: [f64; 3]) -> Matrix3<f32> {
    let up = Vec3::from(up);
    let turn = Rotation3::rotation_between(&up, &Vec3::z());
    // None for the opposite direction: any half turn about a horizontal axis will do.
    let turn =
        turn.unwrap_or_else(|| Rotation3::from_axis_angle(&Vec3::x_axis(), std::f64::consts::PI));
    turn.matrix().cast()
}

fn times(matrix: &Matrix3<f32>, p: [f32; 3]) -> [f32; 3] {
    (matrix * Vector3::from(p)).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn up_becomes_z(up in prop::array::uniform3(-1.0..1.0f64)) {
            prop_assume!(Vec3::from(up).norm() > 1e-3);
            let unit = Vec3::from(up).normalize().cast::<f32>();
            prop_assert!((upright(up) * unit - Vector3::z()).norm() < 1e-5);
        }
    }

    #[test]
    fn straight_down_turns_over() {
        let turn = upright([0.0, 0.0, -2.0]);
        assert!((turn * -Vector3::z() - Vector3::z()).norm() < 1e-6);
        assert!((turn.determinant() - 1.0).abs() < 1e-6);
    }
}
