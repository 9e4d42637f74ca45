//! Tests of the checks of constraints.

use proptest::prelude::*;

use super::*;
use crate::from_json;

fn check(text: &str) -> Result<Constraints, Vec<String>> {
    let message: v1::Constraints = from_json(text.as_bytes()).unwrap();
    Constraints::check(&message).map_err(|errors| errors.into_iter().map(|e| e.pointer).collect())
}

#[test]
fn valid_constraints_pass() {
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
fn every_invalid_field_is_reported() {
    let text = r#"{
        "holes": [{}, {"id": 1, "near": [0, 0, 0]}, {"near": [0, 1]}, {"cut": {}}, {"near": ["NaN", 0, "Infinity"]}],
        "anchors": [{"uv": [0.5, 1.5], "position": [0, 0, 0]}, {"position": [0, 0, 0], "hard": true}, {"uv": [0, 0, 0]}],
        "edits": [{}, {"grab": {"uv": [2, 0], "offset": [0, 0, 0]}}, {"twist": {"uv": [0, 0], "radius": 0, "axis": [0, 1, 0], "angle": 1}},
                  {"twist": {"uv": [0, 0], "radius": 0.1, "axis": [0, 0, 0], "angle": 1}}, {"pinch": {"uvs": [[0, 0], [0, "x"]], "amount": 1}},
                  {"pinch": {"uvs": [[0, 0]]}}, {"pinch": {"uvs": [[0, 0], [1, 1]]}}],
        "up": [1],
        "weights": "NAME",
        "fill": "everything",
        "maxDiameter": -1,
        "minDiameter": "NaN"
    }"#;
    let text = text.replace("NAME", &"n".repeat(257));
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
        "/weights",
        "/fill",
        "/maxDiameter",
        "/minDiameter",
    ];
    assert_eq!(check(&text).unwrap_err(), expected);
}

#[test]
fn diameters_and_kinds_to_fill_are_read() {
    let text = r#"{"fill": "all", "minDiameter": 0.1, "maxDiameter": 2, "except": [3, 4], "acceptDoubtful": true}"#;
    let expected = Constraints {
        fill: Some(Fill::All),
        diameters: Diameters {
            min: Some(0.1),
            max: Some(2.0),
        },
        except: vec![3, 4],
        accept_doubtful: true,
        ..Constraints::default()
    };
    assert_eq!(check(text), Ok(expected));
    let rare = check(r#"{"alternative": 7}"#).map(|asked| asked.alternative);
    assert_eq!(rare, Ok(Some(7)));
    let buffer = |text: &str| check(text).map(|asked| asked.patch_buffer);
    assert_eq!(buffer("{}"), Ok(PatchBuffer::Data));
    assert_eq!(buffer(r#"{"patchBuffer": "data"}"#), Ok(PatchBuffer::Data));
    assert_eq!(buffer(r#"{"patchBuffer": "file"}"#), Ok(PatchBuffer::File));
    let unknown = Err(vec!["/patchBuffer".to_owned()]);
    assert_eq!(buffer(r#"{"patchBuffer": "disk"}"#), unknown);
    let beyond = check(r#"{"alternative": 8}"#);
    assert_eq!(beyond, Err(vec!["/alternative".to_owned()]));
    let crossed = check(r#"{"minDiameter": 2, "maxDiameter": 1}"#);
    assert_eq!(crossed, Err(vec!["/minDiameter".to_owned()]));
}

proptest! {
    #[test]
    fn values_that_pass_are_finite_and_in_range(
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
