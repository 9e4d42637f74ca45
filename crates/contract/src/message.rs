//! Checked constraints as messages again, for answers that tell what a session met last.

use super::{Anchor, Constraints, Edit, Gesture, v1, validate::list};

impl Constraints {
    /// The anchors and edits as a message. What is said when a session is opened is left out.
    pub fn edits_message(&self) -> v1::Constraints {
        v1::Constraints {
            anchors: self.anchors.iter().map(v1::Anchor::from).collect(),
            edits: self.edits.iter().map(v1::Edit::from).collect(),
            ..v1::Constraints::default()
        }
    }
}

impl From<&Anchor> for v1::Anchor {
    fn from(anchor: &Anchor) -> Self {
        Self {
            hole: anchor.hole,
            uv: anchor.uv.into_iter().flatten().collect(),
            position: anchor.position.to_vec(),
            hard: anchor.hard,
        }
    }
}

impl From<&Edit> for v1::Edit {
    fn from(edit: &Edit) -> Self {
        let gesture = match edit.gesture {
            Gesture::Grab { uv, offset } => v1::edit::Gesture::Grab(v1::Grab {
                uv: uv.to_vec(),
                offset: offset.to_vec(),
            }),
            Gesture::Twist {
                uv,
                radius,
                axis,
                angle,
            } => v1::edit::Gesture::Twist(v1::Twist {
                uv: uv.to_vec(),
                radius: Some(radius),
                axis: axis.to_vec(),
                angle: Some(angle),
            }),
            Gesture::Pinch { uvs, amount } => v1::edit::Gesture::Pinch(v1::Pinch {
                uvs: uvs.iter().map(|uv| list(uv)).collect(),
                amount: Some(amount),
            }),
        };
        Self {
            hole: edit.hole,
            gesture: Some(gesture),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::from_json;

    #[test]
    fn anchors_and_edits_come_back_as_they_were_checked() {
        let text = br#"{
            "anchors": [{"hole": 1, "uv": [0.5, 0.25], "position": [1, 2, 3], "hard": true}, {"position": [0, 0, 0.5]}],
            "edits": [{"hole": 1, "grab": {"uv": [0.5, 0.5], "offset": [0, 1, 0]}},
                      {"twist": {"uv": [0.5, 0.5], "radius": 0.25, "axis": [0, 0, 2], "angle": -1}},
                      {"pinch": {"uvs": [[0.25, 0.5], [0.75, 0.5]], "amount": 0.5}}]
        }"#;
        let asked: v1::Constraints = from_json(text).unwrap();
        let checked = Constraints::check(&asked).unwrap();
        assert_eq!(checked.edits_message(), asked);
    }
}
