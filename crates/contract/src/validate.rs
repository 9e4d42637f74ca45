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
    /// Gestures on the new cloth, in order (entry `i` is `/edits/i`).
    pub edits: Vec<Edit>,
    /// Name of the weights; none: the mender's choice.
    pub weights: Option<String>,
    /// Direction against gravity, of any length but zero.
    pub up: Option<[f64; 3]>,
}

/// One hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HoleSelector {
    /// By the loop's id.
    Id(u32),
    /// The hole whose rim comes nearest to a point in scene space.
    Near([f64; 3]),
}

/// A point the new cloth should pass through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// The id of its hole; none when one hole is filled.
    pub hole: Option<u32>,
    /// Where on the hole's chart, each in [0, 1]; none: to be searched.
    pub uv: Option<[f64; 2]>,
    /// Where in scene space.
    pub position: [f64; 3],
    /// Whether the cloth must pass through it.
    pub hard: bool,
}

/// A gesture on the new cloth of a hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edit {
    /// The id of its hole; none when one hole is filled.
    pub hole: Option<u32>,
    /// What the hand does.
    pub gesture: Gesture,
}

/// What a hand does to cloth; uvs are in [0, 1]², offsets and axes in scene space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gesture {
    /// Pulls a point by an offset.
    Grab {
        /// Where on the chart.
        uv: [f64; 2],
        /// How far and where to.
        offset: [f64; 3],
    },
    /// Turns a disk.
    Twist {
        /// Its centre on the chart.
        uv: [f64; 2],
        /// Its radius on the chart, in (0, 1].
        radius: f64,
        /// Axis of the turn; not zero.
        axis: [f64; 3],
        /// Angle of the turn, radians.
        angle: f64,
    },
    /// Draws two points together.
    Pinch {
        /// The points on the chart.
        uvs: [[f64; 2]; 2],
        /// How much of their distance to take away, in [0, 1].
        amount: f64,
    },
}

/// What an anchor search is asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// The id of the hole; none when the scan has one.
    pub hole: Option<u32>,
    /// The point in scene space that the cloth should reach.
    pub target: [f64; 3],
    /// Where the search starts, each in [0, 1]; none: where the unedited cloth is nearest.
    pub start: Option<[f64; 2]>,
    /// Whether every cell is tried.
    pub exhaustive: bool,
    /// Whether the loss of every cell is answered.
    pub map: bool,
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
        wrong.count("/edits", message.edits.len());
        if !wrong.0.is_empty() {
            return Err(wrong.0);
        }

        let holes = (message.holes.iter().enumerate())
            .filter_map(|(i, hole)| wrong.hole(&format!("/holes/{i}"), hole))
            .collect();
        let anchors = (message.anchors.iter().enumerate())
            .filter_map(|(i, anchor)| wrong.anchor(&format!("/anchors/{i}"), anchor))
            .collect();
        let edits = (message.edits.iter().enumerate())
            .filter_map(|(i, edit)| wrong.edit(&format!("/edits/{i}"), edit))
            .collect();
        let up = match message.up.as_slice() {
            [] => None,
            up => wrong.direction("/up", up),
        };
        if wrong.0.is_empty() {
            Ok(Self {
                holes,
                anchors,
                edits,
                weights: message.weights.clone(),
                up,
            })
        } else {
            Err(wrong.0)
        }
    }
}

impl Search {
    /// Checks a message field by field.
    ///
    /// # Errors
    /// Every field that is wrong, in the message's order.
    pub fn check(message: &v1::AnchorQuery) -> Result<Self, Vec<FieldError>> {
        let mut wrong = Wrong::default();
        let target = wrong.point("/target", &message.target);
        let start = match message.start.as_slice() {
            [] => None,
            start => wrong.uv("/start", start),
        };
        match target {
            Some(target) if wrong.0.is_empty() => Ok(Self {
                hole: message.hole,
                target,
                start,
                exhaustive: message.exhaustive,
                map: message.map,
            }),
            _ => Err(wrong.0),
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
        let uv = match anchor.uv.as_slice() {
            [] => Some(None),
            uv => self.uv(&format!("{at}/uv"), uv).map(Some),
        };
        let position = self.point(&format!("{at}/position"), &anchor.position);
        Some(Anchor {
            hole: anchor.hole,
            uv: uv?,
            position: position?,
            hard: anchor.hard,
        })
    }

    fn edit(&mut self, at: &str, edit: &v1::Edit) -> Option<Edit> {
        let gesture = match &edit.gesture {
            None => {
                self.say(
                    at,
                    "exactly one of `grab`, `twist` and `pinch` says what to do",
                );
                return None;
            }
            Some(v1::edit::Gesture::Grab(grab)) => {
                let at = format!("{at}/grab");
                let uv = self.uv(&format!("{at}/uv"), &grab.uv);
                let offset = self.point(&format!("{at}/offset"), &grab.offset);
                Gesture::Grab {
                    uv: uv?,
                    offset: offset?,
                }
            }
            Some(v1::edit::Gesture::Twist(twist)) => {
                let at = format!("{at}/twist");
                let turn = |x: f64| x.is_finite();
                let disk = |x: f64| x > 0.0 && x <= 1.0;
                let uv = self.uv(&format!("{at}/uv"), &twist.uv);
                let expected = "expected a number above 0, at most 1";
                let radius = self.number(&format!("{at}/radius"), twist.radius, disk, expected);
                let axis = self.direction(&format!("{at}/axis"), &twist.axis);
                let expected = "expected a finite number of radians";
                let angle = self.number(&format!("{at}/angle"), twist.angle, turn, expected);
                Gesture::Twist {
                    uv: uv?,
                    radius: radius?,
                    axis: axis?,
                    angle: angle?,
                }
            }
            Some(v1::edit::Gesture::Pinch(pinch)) => {
                let at = format!("{at}/pinch");
                let ends = if let [a, b] = pinch.uvs.as_slice() {
                    let a = self.uv(&format!("{at}/uvs/0"), &numbers(a));
                    let b = self.uv(&format!("{at}/uvs/1"), &numbers(b));
                    a.zip(b)
                } else {
                    let count = pinch.uvs.len();
                    self.say(
                        &format!("{at}/uvs"),
                        format!("expected two uvs; got {count}"),
                    );
                    None
                };
                let share = |x: f64| (0.0..=1.0).contains(&x);
                let expected = "expected a number from 0 to 1";
                let amount = self.number(&format!("{at}/amount"), pinch.amount, share, expected);
                let (a, b) = ends?;
                Gesture::Pinch {
                    uvs: [a, b],
                    amount: amount?,
                }
            }
        };
        Some(Edit {
            hole: edit.hole,
            gesture,
        })
    }

    fn number(
        &mut self,
        at: &str,
        number: Option<f64>,
        fine: fn(f64) -> bool,
        detail: &str,
    ) -> Option<f64> {
        match number {
            Some(x) if fine(x) => Some(x),
            Some(x) => {
                self.say(at, format!("{detail}; got {x}"));
                None
            }
            None => {
                self.say(at, format!("{detail}; got none"));
                None
            }
        }
    }

    fn direction(&mut self, at: &str, numbers: &[f64]) -> Option<[f64; 3]> {
        let direction = self.point(at, numbers)?;
        let length2: f64 = direction.iter().map(|x| x * x).sum();
        if length2 > f64::MIN_POSITIVE {
            return Some(direction);
        }
        self.say(at, "a direction has a length; got zero");
        None
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

/// The numbers of a JSON list; anything else in it is NaN, which no check lets pass.
fn numbers(list: &pbjson_types::ListValue) -> Vec<f64> {
    use pbjson_types::value::Kind;
    let number = |value: &pbjson_types::Value| match value.kind {
        Some(Kind::NumberValue(x)) => x,
        _ => f64::NAN,
    };
    list.values.iter().map(number).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::from_json;

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
                    uv: Some([0.0, 1.0]),
                    position: [1.0, 2.0, 3.0],
                    hard: false
                }],
                ..Constraints::default()
            })
        );
    }

    #[test]
    fn every_wrong_field_is_named() {
        let text = r#"{
            "holes": [{}, {"id": 1, "near": [0, 0, 0]}, {"near": [0, 1]}, {"cut": {}}, {"near": ["NaN", 0, "Infinity"]}],
            "anchors": [{"uv": [0.5, 1.5], "position": [0, 0, 0]}, {"position": [0, 0, 0], "hard": true}, {"uv": [0, 0, 0]}],
            "edits": [{}, {"grab": {"uv": [2, 0], "offset": [0, 0, 0]}}, {"twist": {"uv": [0, 0], "radius": 0, "axis": [0, 1, 0], "angle": 1}},
                      {"twist": {"uv": [0, 0], "radius": 0.1, "axis": [0, 0, 0], "angle": 1}}, {"pinch": {"uvs": [[0, 0], [0, "x"]], "amount": 1}},
                      {"pinch": {"uvs": [[0, 0]]}}, {"pinch": {"uvs": [[0, 0], [1, 1]]}}],
            "up": [1]
        }"#;
        let expected = [
            "/holes/0",
            "/holes/1",
            "/holes/2/near",
            "/holes/3/cut",
            "/holes/4/near/0",
            "/holes/4/near/2",
            "/anchors/0/uv/1",
            "/anchors/2/uv",
            "/anchors/2/position",
            "/edits/0",
            "/edits/1/grab/uv/0",
            "/edits/2/twist/radius",
            "/edits/3/twist/axis",
            "/edits/4/pinch/uvs/1/1",
            "/edits/5/pinch/uvs",
            "/edits/5/pinch/amount",
            "/edits/6/pinch/amount",
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
                prop_assert!(asked.anchors[0].uv.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
                prop_assert!(asked.anchors[0].position.iter().all(|x| x.is_finite()));
            }
        }
    }
}
