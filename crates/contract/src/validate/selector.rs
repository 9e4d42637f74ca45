//! The entries of `holes`: which hole is filled, and what is cut out before.

use super::{FieldErrors, MAX_ENTRIES, numbers};
use crate::v1;

/// Selects one hole, or the holes that a cut leaves.
#[derive(Debug, Clone, PartialEq)]
pub enum HoleSelector {
    /// The hole of this boundary loop id.
    Id(u32),
    /// The hole whose rim is nearest to this point in scene space.
    Near([f64; 3]),
    /// The holes that are left when this cloth is cut out.
    Cut(Cut),
    /// A stretch of the cloth's own edge.
    Border(Border),
}

/// A stretch of the cloth's own edge; points in scene space.
#[derive(Debug, Clone, PartialEq)]
pub enum Border {
    /// Every bite, rip and torn corner that is found.
    Auto,
    /// The way into the cloth along the edge from one place to another.
    Line {
        /// Near where it starts.
        from: [f64; 3],
        /// Near where it ends.
        to: [f64; 3],
        /// Points that the new hem goes through; none has it continue the hem on both sides.
        along: Vec<[f64; 3]>,
    },
    /// What lies between two torn edges that face each other.
    Tear([TornEdge; 2]),
}

/// The edge of a tear: of the two ways along the cloth's own edge from one place to another, the one nearer to the edge that faces it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TornEdge {
    /// Near where it starts.
    pub from: [f64; 3],
    /// Near where it ends.
    pub to: [f64; 3],
}

/// Cloth to cut out; points and lengths in scene space, in the scene's unit.
#[derive(Debug, Clone, PartialEq)]
pub enum Cut {
    /// The triangles that reach into a ball.
    Ball {
        /// Its centre.
        center: [f64; 3],
        /// Its radius, above 0.
        radius: f64,
    },
    /// The triangles that reach into a prism over a polygon.
    Prism {
        /// The polygon's corners, at least three; the prism stands along the mean normal of the polygon, whose vector area is not zero.
        polygon: Vec<[f64; 3]>,
        /// How far the prism reaches to either side of the polygon's mean plane, above 0.
        depth: f64,
    },
    /// The triangles that touch one of these loops.
    Rims(Vec<u32>),
}

impl From<Border> for v1::Border {
    fn from(border: Border) -> v1::Border {
        match border {
            Border::Auto => v1::Border {
                auto: true,
                ..v1::Border::default()
            },
            Border::Line { from, to, along } => v1::Border {
                from: from.to_vec(),
                to: to.to_vec(),
                along: along.iter().map(|p| list(p)).collect(),
                ..v1::Border::default()
            },
            Border::Tear([own, facing]) => v1::Border {
                from: own.from.to_vec(),
                to: own.to.to_vec(),
                facing: Some(v1::TornEdge {
                    from: facing.from.to_vec(),
                    to: facing.to.to_vec(),
                }),
                ..v1::Border::default()
            },
        }
    }
}

impl From<Cut> for v1::Cut {
    fn from(cut: Cut) -> v1::Cut {
        match cut {
            Cut::Ball { center, radius } => v1::Cut {
                center: center.to_vec(),
                radius: Some(radius),
                ..v1::Cut::default()
            },
            Cut::Prism { polygon, depth } => v1::Cut {
                polygon: polygon.iter().map(|p| list(p)).collect(),
                depth: Some(depth),
                ..v1::Cut::default()
            },
            Cut::Rims(loops) => v1::Cut {
                loops,
                ..v1::Cut::default()
            },
        }
    }
}

/// Numbers as a JSON list.
pub fn list(numbers: &[f64]) -> pbjson_types::ListValue {
    use pbjson_types::value::Kind;
    let value = |x: &f64| pbjson_types::Value {
        kind: Some(Kind::NumberValue(*x)),
    };
    pbjson_types::ListValue {
        values: numbers.iter().map(value).collect(),
    }
}

impl FieldErrors {
    pub(super) fn hole(&mut self, at: &str, hole: &v1::HoleSelector) -> Option<HoleSelector> {
        match (hole.id, hole.near.as_slice(), &hole.cut, &hole.border) {
            (Some(id), [], None, None) => Some(HoleSelector::Id(id)),
            (None, near @ [_, ..], None, None) => self
                .point(&format!("{at}/near"), near)
                .map(HoleSelector::Near),
            (None, [], Some(cut), None) => {
                self.cut(&format!("{at}/cut"), cut).map(HoleSelector::Cut)
            }
            (None, [], None, Some(border)) => self
                .border(&format!("{at}/border"), border)
                .map(HoleSelector::Border),
            _ => {
                self.push(
                    at,
                    "exactly one of `id`, `near`, `cut` and `border` says which hole",
                );
                None
            }
        }
    }

    fn cut(&mut self, at: &str, cut: &v1::Cut) -> Option<Cut> {
        let is_length = |x: f64| x > 0.0 && x <= super::MAX_COORDINATE;
        let expected = "expected a length above 0, at most 1e18";
        let is_ball = !cut.center.is_empty() || cut.radius.is_some();
        let is_prism = !cut.polygon.is_empty() || cut.depth.is_some();
        match (is_ball, is_prism, cut.loops.as_slice()) {
            (true, false, []) => {
                let center = self.point(&format!("{at}/center"), &cut.center);
                let radius = self.number(&format!("{at}/radius"), cut.radius, is_length, expected);
                Some(Cut::Ball {
                    center: center?,
                    radius: radius?,
                })
            }
            (false, true, []) => {
                let polygon = self.polygon(&format!("{at}/polygon"), &cut.polygon);
                let depth = self.number(&format!("{at}/depth"), cut.depth, is_length, expected);
                Some(Cut::Prism {
                    polygon: polygon?,
                    depth: depth?,
                })
            }
            (false, false, loops @ [_, ..]) => {
                let before = self.0.len();
                self.count(&format!("{at}/loops"), loops.len());
                (self.0.len() == before).then(|| Cut::Rims(loops.to_vec()))
            }
            _ => {
                let detail = "exactly one of a ball (`center`, `radius`), a polygon (`polygon`, `depth`) and `loops` says what to cut out";
                self.push(at, detail);
                None
            }
        }
    }

    fn border(&mut self, at: &str, border: &v1::Border) -> Option<Border> {
        let given = [border.from.len(), border.to.len(), border.along.len()];
        if border.auto {
            if given == [0; 3] && border.facing.is_none() {
                return Some(Border::Auto);
            }
            let detail = "`auto` stands alone, without `from`, `to`, `along` and `facing`";
            self.push(at, detail);
            return None;
        }
        let from = self.point(&format!("{at}/from"), &border.from);
        let to = self.point(&format!("{at}/to"), &border.to);
        let before = self.0.len();
        self.count(&format!("{at}/along"), border.along.len());
        if self.0.len() > before {
            return None;
        }
        let along: Vec<[f64; 3]> = (border.along.iter().enumerate())
            .filter_map(|(i, point)| self.point(&format!("{at}/along/{i}"), &numbers(point)))
            .collect();
        let Some(facing) = &border.facing else {
            return (along.len() == border.along.len()).then_some(Border::Line {
                from: from?,
                to: to?,
                along,
            });
        };
        if !border.along.is_empty() {
            let detail = "stands without `facing`: between two torn edges both hems go on smoothly";
            self.push(&format!("{at}/along"), detail);
        }
        let facing_from = self.point(&format!("{at}/facing/from"), &facing.from);
        let facing_to = self.point(&format!("{at}/facing/to"), &facing.to);
        let edges = [
            TornEdge {
                from: from?,
                to: to?,
            },
            TornEdge {
                from: facing_from?,
                to: facing_to?,
            },
        ];
        border.along.is_empty().then_some(Border::Tear(edges))
    }

    /// A closed polygon that has a mean normal.
    fn polygon(&mut self, at: &str, corners: &[pbjson_types::ListValue]) -> Option<Vec<[f64; 3]>> {
        if !(3..=MAX_ENTRIES).contains(&corners.len()) {
            let detail = format!(
                "a polygon has 3 to {MAX_ENTRIES} corners; got {}",
                corners.len()
            );
            self.push(at, detail);
            return None;
        }
        let before = self.0.len();
        let points: Vec<[f64; 3]> = (corners.iter().enumerate())
            .filter_map(|(i, corner)| self.point(&format!("{at}/{i}"), &numbers(corner)))
            .collect();
        if self.0.len() > before {
            return None;
        }
        if !has_normal(&points) {
            self.push(
                at,
                "the corners lie on a line, or their areas cancel: the polygon has no normal",
            );
            return None;
        }
        Some(points)
    }
}

/// Least vector area of a polygon, as a share of the square of its size.
const LEAST_AREA: f64 = 1e-9;

/// Whether a polygon's vector area is larger than rounding errors.
fn has_normal(points: &[[f64; 3]]) -> bool {
    let Some(first) = points.first() else {
        return false;
    };
    let from_first = |p: &[f64; 3]| [0, 1, 2].map(|k| p[k] - first[k]);
    let size = (points.iter().flat_map(from_first)).fold(0.0_f64, |m, x| m.max(x.abs()));
    // In units of the size, so that no square overflows.
    let scaled: Vec<[f64; 3]> = (points.iter())
        .map(|p| from_first(p).map(|x| x / size))
        .collect();
    let mut area = [0.0; 3];
    for pair in scaled.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        for (k, sum) in area.iter_mut().enumerate() {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            *sum += a[i] * b[j] - a[j] * b[i];
        }
    }
    area.iter().map(|x| x * x).sum::<f64>().sqrt() > LEAST_AREA
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Constraints, FieldError, from_json};

    fn check(selector: &str) -> Result<Vec<HoleSelector>, Vec<FieldError>> {
        let text = format!(r#"{{"holes": [{selector}]}}"#);
        let message: v1::Constraints = from_json(text.as_bytes()).unwrap();
        Constraints::check(&message).map(|asked| asked.holes)
    }

    #[test]
    fn cuts_of_every_form_pass() {
        let ball = Cut::Ball {
            center: [0.0, 1.0, 2.0],
            radius: 0.5,
        };
        let prism = Cut::Prism {
            polygon: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1e-3, 0.0]],
            depth: 1e-3,
        };
        for (text, cut) in [
            (r#"{"cut": {"center": [0, 1, 2], "radius": 0.5}}"#, ball),
            (
                r#"{"cut": {"polygon": [[0, 0, 0], [1, 0, 0], [0, 1e-3, 0]], "depth": 1e-3}}"#,
                prism,
            ),
            (r#"{"cut": {"loops": [3, 1]}}"#, Cut::Rims(vec![3, 1])),
        ] {
            let written = v1::HoleSelector {
                cut: Some(cut.clone().into()),
                ..Default::default()
            };
            assert_eq!(check(text), Ok(vec![HoleSelector::Cut(cut)]), "{text}");
            let again = serde_json::to_string(&written).unwrap();
            assert_eq!(check(&again), check(text), "{again}");
        }
    }

    #[test]
    fn borders_are_read_and_refused_at_their_place() {
        let line = |along: &[[f64; 3]]| Border::Line {
            from: [0.0; 3],
            to: [1.0, 0.0, 0.0],
            along: along.to_vec(),
        };
        for (text, border) in [
            (r#"{"border": "auto"}"#, Border::Auto),
            (r#"{"border": {"auto": true}}"#, Border::Auto),
            (
                r#"{"border": {"from": [0, 0, 0], "to": [1, 0, 0]}}"#,
                line(&[]),
            ),
            (
                r#"{"border": {"from": [0, 0, 0], "to": [1, 0, 0], "along": [[0.5, 1, 0]]}}"#,
                line(&[[0.5, 1.0, 0.0]]),
            ),
            (
                r#"{"border": {"from": [0, 0, 0], "to": [1, 0, 0], "facing": {"from": [1, 1, 0], "to": [0, 1, 0]}}}"#,
                Border::Tear([
                    TornEdge {
                        from: [0.0; 3],
                        to: [1.0, 0.0, 0.0],
                    },
                    TornEdge {
                        from: [1.0, 1.0, 0.0],
                        to: [0.0, 1.0, 0.0],
                    },
                ]),
            ),
        ] {
            assert_eq!(
                check(text),
                Ok(vec![HoleSelector::Border(border)]),
                "{text}"
            );
        }
        for (text, at) in [
            (r#"{"border": {}}"#, "/holes/0/border/from"),
            (
                r#"{"border": {"auto": true, "from": [0, 0, 0]}}"#,
                "/holes/0/border",
            ),
            (r#"{"border": {"from": [0, 0, 0]}}"#, "/holes/0/border/to"),
            (
                r#"{"border": {"from": [0, 0, 0], "to": [1, 0, 0], "along": [[0, 0, 0], [1]]}}"#,
                "/holes/0/border/along/1",
            ),
            (r#"{"border": "auto", "id": 1}"#, "/holes/0"),
            (
                r#"{"border": {"auto": true, "facing": {"from": [0, 0, 0], "to": [1, 0, 0]}}}"#,
                "/holes/0/border",
            ),
            (
                r#"{"border": {"from": [0, 0, 0], "to": [1, 0, 0], "facing": {"from": [0, 0, 0]}}}"#,
                "/holes/0/border/facing/to",
            ),
            (
                r#"{"border": {"from": [0, 0, 0], "to": [1, 0, 0], "along": [[0, 0, 0]],
                    "facing": {"from": [0, 0, 0], "to": [1, 0, 0]}}}"#,
                "/holes/0/border/along",
            ),
        ] {
            let wrong = check(text).expect_err(text);
            assert_eq!(wrong[0].pointer, at, "{text}");
        }
        let other = from_json::<v1::Constraints>(br#"{"holes": [{"border": "all"}]}"#);
        assert!(other.is_err());
    }

    #[test]
    fn a_cut_that_is_not_whole_is_refused_at_its_place() {
        let many = format!("[{}0]", "0,".repeat(MAX_ENTRIES));
        let round = format!("[{}[0,0,0]]", "[0,0,0],".repeat(MAX_ENTRIES));
        let loops = format!(r#"{{"cut": {{"loops": {many}}}}}"#);
        let corners = format!(r#"{{"cut": {{"polygon": {round}, "depth": 1}}}}"#);
        for (text, at) in [
            (r#"{"cut": {}}"#, "/holes/0/cut"),
            (r#"{"cut": {"loops": []}}"#, "/holes/0/cut"),
            (r#"{"cut": {"loops": [1], "radius": 1}}"#, "/holes/0/cut"),
            (
                r#"{"cut": {"center": [0, 0, 0], "radius": 1, "depth": 1}}"#,
                "/holes/0/cut",
            ),
            (r#"{"cut": {"loops": [1]}, "id": 1}"#, "/holes/0"),
            (r#"{"cut": {"radius": 1}}"#, "/holes/0/cut/center"),
            (r#"{"cut": {"center": [0, 0, 0]}}"#, "/holes/0/cut/radius"),
            (
                r#"{"cut": {"center": [0, 0, 0], "radius": -1}}"#,
                "/holes/0/cut/radius",
            ),
            (
                r#"{"cut": {"polygon": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}}"#,
                "/holes/0/cut/depth",
            ),
            (
                r#"{"cut": {"polygon": [[0, 0, 0], [1, 0, 0]], "depth": 1}}"#,
                "/holes/0/cut/polygon",
            ),
            (
                r#"{"cut": {"polygon": [[0, 0, 0], [1, 0, 0], [2, 0, 0]], "depth": 1}}"#,
                "/holes/0/cut/polygon",
            ),
            (
                r#"{"cut": {"polygon": [[0, 0, 0], [1, 0], [0, 1, 0]], "depth": 1}}"#,
                "/holes/0/cut/polygon/1",
            ),
            (
                r#"{"cut": {"polygon": [[0, 0, 0], [1, 0, true], [0, 1, 0]], "depth": 1}}"#,
                "/holes/0/cut/polygon/1/2",
            ),
            (&loops, "/holes/0/cut/loops"),
            (&corners, "/holes/0/cut/polygon"),
        ] {
            let wrong = check(text).expect_err(text);
            assert_eq!(wrong[0].pointer, at, "{text}");
        }
        let wrong = check(&loops).expect_err("too many loops");
        assert!(wrong[0].detail.contains("limit is 4096"), "{wrong:?}");
    }
}
