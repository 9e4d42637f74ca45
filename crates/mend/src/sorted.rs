//! Sorts what came of a request's holes: a hole that cannot be filled leaves the others to be filled.

use crate::error::MendError;
use crate::select::{HoleRequest, skipped_for};
use crate::welded_scan::WeldedScan;
use darn_contract::v1;

/// The holes of a request that went well, and those that did not.
pub struct Sorted<T> {
    /// In the request's order.
    pub filled: Vec<T>,
    /// As the report lists them.
    pub failed: Vec<v1::Skipped>,
}

/// Sorts the outcomes of a request's holes, which are in its order.
///
/// # Errors
/// The first hole's that is about the whole scan, or about a hole of which the request says something in particular; and when all fail, the first
/// hole's. The first in the request's order, and not in time.
pub fn sorted<T>(
    requests: &[HoleRequest],
    outcomes: Vec<Result<T, MendError>>,
    welded: &WeldedScan,
) -> Result<Sorted<T>, MendError> {
    let mut first = None;
    let (mut filled, mut failed) = (Vec::new(), Vec::new());
    for (request, outcome) in requests.iter().zip(outcomes) {
        match outcome {
            Ok(hole) => filled.push(hole),
            Err(error) => match error.hole() {
                Some(id) if !request.is_particular() => {
                    failed.push(skipped_for(&error, &welded.loops[id as usize]));
                    first.get_or_insert(error);
                }
                _ => return Err(error),
            },
        }
    }
    match first {
        Some(first) if filled.is_empty() => Err(match failed.len() {
            1 => first,
            holes => MendError::NoneFilled {
                holes,
                first: Box::new(first),
            },
        }),
        _ => Ok(Sorted { filled, failed }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scan_of;
    use darn_budget::Budget;
    use darn_geometry::mesh::shapes::sheet;
    use darn_geometry::mesh::{TriMesh, Vec3};

    /// A flat sheet with three square holes: loops 1 to 3.
    fn three_holes() -> WeldedScan {
        let beside = |x: f64, at: f64| (x - at).abs() > 0.06;
        let soup: TriMesh = sheet(
            24,
            |u, v| beside(v, 0.5) || [0.2, 0.5, 0.8].iter().all(|at| beside(u, *at)),
            |u, v| Vec3::new(u, v, 0.0),
        );
        WeldedScan::of(&scan_of(&soup), Budget::unlimited()).unwrap()
    }

    fn requests(named: Option<u32>) -> Vec<HoleRequest> {
        let request = |id| HoleRequest {
            id,
            named: named == Some(id),
            ..HoleRequest::default()
        };
        (1..=3).map(request).collect()
    }

    fn narrow(hole: u32) -> MendError {
        MendError::NoCells { hole }
    }

    #[test]
    fn a_hole_that_cannot_be_filled_leaves_the_others_to_be_filled() {
        let outcomes = vec![Ok(1), Err(narrow(2)), Ok(3)];
        let sorted = sorted(&requests(None), outcomes, &three_holes()).unwrap();
        assert_eq!(sorted.filled, [1, 3]);
        let [left] = &sorted.failed[..] else {
            panic!("{:?}", sorted.failed);
        };
        assert_eq!((left.id, left.code.as_str()), (2, "hole_too_narrow"));
        assert!(left.reason.contains("hole 2"), "{}", left.reason);
    }

    #[test]
    fn a_named_hole_that_cannot_be_filled_refuses_the_request() {
        let outcomes = vec![Err(narrow(1)), Err(narrow(2)), Ok(3)];
        let refused = sorted(&requests(Some(2)), outcomes, &three_holes()).err();
        assert_eq!(refused.and_then(|e| e.hole()), Some(2));
    }

    #[test]
    fn a_request_of_which_nothing_can_be_filled_is_refused_with_the_first_reason() {
        let outcomes = || (1..=3).map(|hole| Err::<u32, _>(narrow(hole))).collect();
        let refused = sorted(&requests(None), outcomes(), &three_holes()).err();
        let refused = refused.expect("a refusal");
        assert_eq!(refused.code(), narrow(1).code());
        assert!(
            refused.to_string().starts_with("none of the 3 holes"),
            "{refused}"
        );
        let single = sorted(
            &requests(None)[..1],
            vec![Err::<u32, _>(narrow(1))],
            &three_holes(),
        );
        assert_eq!(
            single.err().map(|e| e.to_string()),
            Some(narrow(1).to_string())
        );
    }

    #[test]
    fn a_failure_that_is_about_no_hole_refuses_the_request() {
        let network = || MendError::NoHoles {
            skipped: Vec::new(),
        };
        let outcomes = vec![Ok(1), Err(network()), Ok(3)];
        assert!(sorted(&requests(None), outcomes, &three_holes()).is_err());
    }
}
