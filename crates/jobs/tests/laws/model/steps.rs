//! What can happen to jobs.

use proptest::prelude::*;

/// Something that happens. Jobs and leases are named by their place among all that there ever were, so old ones are used as often as new ones.
#[derive(Debug, Clone)]
pub enum Step {
    Create {
        client: u8,
        key: Option<u8>,
        payload: u8,
        priority: i64,
    },
    Claim(bool),
    Renew(usize),
    Progress(usize),
    End(usize, usize),
    Cancel(usize),
    Retry(usize),
    Delete(usize),
    Advance(i64),
    ExpireLeases,
    ExpireFiles,
    Forget,
}

/// Random sequences, in which jobs live through all their states.
pub fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        6 => (0..3u8, prop::option::weighted(0.3, 0..3u8), 0..2u8, 0..3i64)
            .prop_map(|(client, key, payload, priority)| Step::Create { client, key, payload, priority }),
        6 => any::<bool>().prop_map(Step::Claim),
        2 => any::<usize>().prop_map(Step::Renew),
        2 => any::<usize>().prop_map(Step::Progress),
        5 => (any::<usize>(), 0..4usize).prop_map(|(lease, how)| Step::End(lease, how)),
        2 => any::<usize>().prop_map(Step::Cancel),
        2 => any::<usize>().prop_map(Step::Retry),
        1 => any::<usize>().prop_map(Step::Delete),
        4 => (0..40_000i64).prop_map(Step::Advance),
        4 => Just(Step::ExpireLeases),
        1 => Just(Step::ExpireFiles),
        1 => Just(Step::Forget),
    ];
    prop::collection::vec(step, 1..80)
}
