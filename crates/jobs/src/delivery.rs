//! What the store keeps of the ends of jobs that webhooks are to be told of. Every time is in milliseconds since 1970-01-01 UTC.

use std::time::Duration;

use uuid::Uuid;

use super::job::State;

/// An end of a job, and how far its webhook has been told of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Delivery {
    /// The job.
    pub job: Uuid,
    /// The job's version at its end. A job that is retried ends again, with a higher one.
    pub version: i64,
    /// Whose job it is.
    pub client: String,
    /// The client's name for the job.
    pub name: Option<String>,
    /// Where its end is to be told; opaque here.
    pub webhook: String,
    /// How the job ended.
    pub state: State,
    /// When it ended.
    pub ended_at: i64,
    /// Whether it is told.
    pub outcome: DeliveryOutcome,
    /// Tries that have begun.
    pub tries: i64,
    /// When the next try is due; while one runs, when that counts as crashed. Nothing once there will be none.
    pub next_try_at: Option<i64>,
    /// When the last try ended.
    pub last_try_at: Option<i64>,
    /// The status of the last answer.
    pub last_status: Option<i64>,
    /// Why the last try failed.
    pub last_error: Option<String>,
}

/// Whether an end is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeliveryOutcome {
    /// Not yet.
    Waiting,
    /// The receiver has taken it.
    Delivered,
    /// No try succeeded.
    GivenUp,
    /// The receiver wants to be told nothing of this job.
    Disabled,
}

impl DeliveryOutcome {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Waiting,
        Self::Delivered,
        Self::GivenUp,
        Self::Disabled,
    ];

    /// Its word in the store.
    pub fn word(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Delivered => "delivered",
            Self::GivenUp => "given_up",
            Self::Disabled => "disabled",
        }
    }
}

/// A delivery in the hands of whoever tries it. As long as nobody else has claimed it since, its end may be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClaimedDelivery {
    /// The delivery, this try counted.
    pub delivery: Delivery,
    /// The token of this try alone.
    pub token: Uuid,
}

/// How a try ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TryOutcome {
    /// The receiver has taken it.
    Delivered {
        /// The status of its answer.
        status: i64,
    },
    /// It failed.
    Failed {
        /// The status of the answer, if there was one.
        status: Option<i64>,
        /// Why, for people.
        error: String,
        /// After which time it is tried again; nothing: not any more.
        again_after: Option<Duration>,
    },
    /// The receiver wants to be told nothing of this job: neither this nor another end.
    Disabled {
        /// The status of its answer.
        status: i64,
    },
    /// It did not take place, as when the process shuts down: the try does not count, and is due at once.
    GivenBack,
}
