//! What a request asks, once it is known to make sense by itself: lengths, ranges, finiteness, and what this version serves.
//!
//! Whether a hole exists is not known here: that needs the scan.

use super::v1;

/// Most entries a list of constraints may have; far above any use, far below any harm.
const MOST: usize = 4096;
/// Largest coordinate: its square still fits the f32 positions of a glTF.
const FARTHEST: f64 = 1e18;
const LATER: &str = "not served by this version yet";

/// One field of a request and what is wrong with it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{pointer}{}{detail}", if .pointer.is_empty() { "" } else { ": " })]
pub struct FieldError {
    /// JSON pointer (RFC 6901) into the constraints; empty for the whole.
    pub pointer: String,
    /// What is wrong, for a person.
    pub detail: String,
}

impl FieldError {
    /// An error at `pointer`.
    pub fn new(pointer: impl Into<String>, detail: impl Into<String>) -> Self {
        Self {
            pointer: pointer.into(),
            detail: detail.into(),
        }
    }
}

/// What a request asks; the default asks for all holes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Constraints {
    /// The holes to fill, in the request's order (entry `i` is `/holes/i`); empty means all.
    pub holes: Vec<HoleSelector>,
    /// Points the new cloth should pass through (entry `i` is `/anchors/i`).
    pub anchors: Vec<Anchor>,
}

/// One hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HoleSelector {
    /// By the loop's id.
    Id(u32),
    /// The hole whose rim comes nearest to a point in scene space.
    Near([f64; 3]),
}

/// A point the new cloth should pass through, softly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// The id of its hole; none when one hole is filled.
    pub hole: Option<u32>,
    /// Where on the hole's chart, each in [0, 1].
    pub uv: [f64; 2],
    /// Where in scene space.
    pub position: [f64; 3],
}

impl Constraints {
    /// Checks a message field by field.
    ///
    /// # Errors
    /// Every field that is wrong or not served, in the message's order.
    pub fn check(message: &v1::Constraints) -> Result<Self, Vec<FieldError>> {
        let mut wrong = Wrong::default();
        wrong.count("/holes", message.holes.len());
        wrong.count("/anchors", message.anchors.len());
        if !wrong.0.is_empty() {
            return Err(wrong.0);
        }

        let holes = (message.holes.iter().enumerate())
            .filter_map(|(i, hole)| wrong.hole(&format!("/holes/{i}"), hole))
            .collect();
        let anchors = (message.anchors.iter().enumerate())
            .filter_map(|(i, anchor)| wrong.anchor(&format!("/anchors/{i}"), anchor))
            .collect();
        if !message.edits.is_empty() {
            wrong.say("/edits", LATER);
        }
        if message.weights.is_some() {
            wrong.say("/weights", LATER);
        }
        if !message.up.is_empty() {
            wrong.say("/up", LATER);
        }
        if wrong.0.is_empty() {
            Ok(Self { holes, anchors })
        } else {
            Err(wrong.0)
        }
    }
}

#[derive(Default)]
struct Wrong(Vec<FieldError>);

impl Wrong {
    fn say(&mut self, pointer: &str, detail: impl Into<String>) {
        self.0.push(FieldError::new(pointer, detail));
    }

    fn count(&mut self, pointer: &str, count: usize) {
        if count > MOST {
            self.say(pointer, format!("{count} entries; the limit is {MOST}"));
        }
    }

    fn hole(&mut self, at: &str, hole: &v1::HoleSelector) -> Option<HoleSelector> {
        match (hole.id, hole.near.as_slice(), &hole.cut) {
            (Some(id), [], None) => Some(HoleSelector::Id(id)),
            (None, near, None) if !near.is_empty() => self
                .point(&format!("{at}/near"), near)
                .map(HoleSelector::Near),
            (None, [], Some(_)) => {
                self.say(&format!("{at}/cut"), LATER);
                None
            }
            _ => {
                self.say(at, "exactly one of `id`, `near` and `cut` says which hole");
                None
            }
        }
    }

    fn anchor(&mut self, at: &str, anchor: &v1::Anchor) -> Option<Anchor> {
        if anchor.hard {
            self.say(&format!("{at}/hard"), LATER);
        }
        let uv = if anchor.uv.is_empty() {
            self.say(
                &format!("{at}/uv"),
                format!("an anchor without uv is {LATER}"),
            );
            None
        } else {
            self.uv(&format!("{at}/uv"), &anchor.uv)
        };
        let position = self.point(&format!("{at}/position"), &anchor.position);
        Some(Anchor {
            hole: anchor.hole,
            uv: uv?,
            position: position?,
        })
    }

    fn point(&mut self, at: &str, numbers: &[f64]) -> Option<[f64; 3]> {
        let Ok(point) = <[f64; 3]>::try_from(numbers) else {
            self.say(
                at,
                format!("a point is [x, y, z]; got {} numbers", numbers.len()),
            );
            return None;
        };
        self.each(
            at,
            &point,
            |x| x.abs() <= FARTHEST,
            "expected a finite coordinate, at most 1e18 in size",
        )
        .then_some(point)
    }

    fn uv(&mut self, at: &str, numbers: &[f64]) -> Option<[f64; 2]> {
        let Ok(uv) = <[f64; 2]>::try_from(numbers) else {
            self.say(at, format!("a uv is [u, v]; got {} numbers", numbers.len()));
            return None;
        };
        self.each(
            at,
            &uv,
            |x| (0.0..=1.0).contains(&x),
            "expected a number from 0 to 1",
        )
        .then_some(uv)
    }

    /// Whether every number is fine; NaN never is.
    fn each(&mut self, at: &str, numbers: &[f64], fine: fn(f64) -> bool, detail: &str) -> bool {
        let before = self.0.len();
        for (i, &number) in numbers.iter().enumerate() {
            if !fine(number) {
                self.say(&format!("{at}/{i}"), format!("{detail}; got {number}"));
            }
        }
        self.0.len() == before
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::contract::from_json;

    fn check(text: &str) -> Result<Constraints, Vec<String>> {
        let message: v1::Constraints = from_json(text.as_bytes()).unwrap();
        Constraints::check(&message)
            .map_err(|errors| errors.into_iter().map(|e| e.pointer).collect())
    }

    #[test]
    fn what_is_served_passes() {
        assert_eq!(check("{}"), Ok(Constraints::default()));
        let asked = check(
            r#"{"holes": [{"id": 0}, {"near": [1, 2, 3]}], "anchors": [{"uv": [0, 1], "position": [1, 2, 3]}]}"#,
        );
        assert_eq!(
            asked,
            Ok(Constraints {
                holes: vec![HoleSelector::Id(0), HoleSelector::Near([1.0, 2.0, 3.0])],
                anchors: vec![Anchor {
                    hole: None,
                    uv: [0.0, 1.0],
                    position: [1.0, 2.0, 3.0]
                }],
            })
        );
    }

    #[test]
    fn every_wrong_field_is_named() {
        let text = r#"{
            "holes": [{}, {"id": 1, "near": [0, 0, 0]}, {"near": [0, 1]}, {"cut": {}}, {"near": ["NaN", 0, "Infinity"]}],
            "anchors": [{"uv": [0.5, 1.5], "position": [0, 0, 0]}, {"position": [0, 0, 0], "hard": true}, {"uv": [0, 0, 0]}],
            "edits": [{}], "weights": "x", "up": [1]
        }"#;
        let expected = [
            "/holes/0",
            "/holes/1",
            "/holes/2/near",
            "/holes/3/cut",
            "/holes/4/near/0",
            "/holes/4/near/2",
            "/anchors/0/uv/1",
            "/anchors/1/hard",
            "/anchors/1/uv",
            "/anchors/2/uv",
            "/anchors/2/position",
            "/edits",
            "/weights",
            "/up",
        ];
        assert_eq!(check(text).unwrap_err(), expected);
    }

    proptest! {
        #[test]
        fn what_passes_is_finite_and_in_range(
            uv in prop::collection::vec(prop::num::f64::ANY, 0..4),
            position in prop::collection::vec(prop::num::f64::ANY, 0..5),
        ) {
            let message = v1::Constraints {
                anchors: vec![v1::Anchor { hole: None, uv, position, hard: false }],
                ..Default::default()
            };
            if let Ok(asked) = Constraints::check(&message) {
                prop_assert!(asked.anchors[0].uv.iter().all(|x| (0.0..=1.0).contains(x)));
                prop_assert!(asked.anchors[0].position.iter().all(|x| x.is_finite()));
            }
        }
    }
}
