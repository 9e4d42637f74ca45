//! How much of a request's work one of several holes may take. One that needs more is left, so that the others are filled.

use darn_budget::Exhausted;

use crate::error::MendError;
use crate::mender::Call;
use crate::select::HoleRequest;

/// The work that is left for a request over what one of its holes may take. Holes of real scans take less than a twenty-fifth.
const WHOLE_OVER_SHARE: u64 = 2;

/// What each hole of a request may take of its work.
pub struct HoleShares<'a> {
    call: Call<'a>,
    /// Nanoseconds of one core; `None` where a hole may take all.
    work: Option<u64>,
}

impl<'a> HoleShares<'a> {
    /// The shares of holes that are prepared or filled from now on.
    pub fn of(requests: &[HoleRequest], call: Call<'a>) -> HoleShares<'a> {
        let several = requests.len() > 1;
        let left = call.budget.work_left().filter(|_| several);
        let work = left.map(|work| work / WHOLE_OVER_SHARE);
        HoleShares { call, work }
    }

    /// Does the work of a hole within its share. A hole of which the request says something in particular may take all.
    ///
    /// # Errors
    /// `Costly` for a hole that needs more than its share; what the work gives.
    pub fn within<T>(
        &self,
        request: &HoleRequest,
        work: impl FnOnce(Call) -> Result<T, MendError>,
    ) -> Result<T, MendError> {
        let Some(most) = self.work.filter(|_| !request.is_particular()) else {
            return work(self.call);
        };
        let share = self.call.budget.share(most);
        let call = Call {
            budget: &share,
            ..self.call
        };
        work(call).map_err(|error| match error {
            MendError::Exhausted(source @ Exhausted::Share { .. }) => MendError::Costly {
                hole: request.id,
                source,
            },
            other => other,
        })
    }
}
