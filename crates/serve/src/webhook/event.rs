//! What a webhook is told: a thin message (the scan and its report are to be fetched), which is the same in every try.

use darn_contract::v1;
use darn_jobs::{Delivery, State};

use crate::{
    job_message::{path, state, timestamp},
    response,
};

/// The id of a message: the same in all tries of it, and in no other one. Receivers that have seen it pass over it.
pub fn id(delivery: &Delivery) -> String {
    format!("{}-{}", delivery.job, delivery.version)
}

/// The body of a message.
pub fn body(delivery: &Delivery) -> Vec<u8> {
    let job = delivery.job;
    let file = |name: &str| (delivery.state == State::Done).then(|| path(job, name));
    response::json(&v1::WebhookEvent {
        r#type: format!("job.{}", delivery.state),
        timestamp: Some(timestamp(delivery.ended_at)),
        data: Some(v1::EndedJob {
            id: job.to_string(),
            name: delivery.name.clone(),
            state: state(delivery.state).into(),
            version: u32::try_from(delivery.version).unwrap_or(u32::MAX),
            links: Some(v1::JobLinks {
                job: format!("/jobs/{job}"),
                result: file("result"),
                report: file("report"),
            }),
        }),
    })
}
