//! The order of waiting jobs: fair between clients, cheap jobs before dear ones, and nobody waits for ever.
//!
//! A job gets a tag when it comes: the queue's time, plus its cost times the jobs that its client has in the queue and running, itself
//! included. The job with the least tag starts first, and the queue's time moves on to that tag. So a client with many jobs waits behind
//! one with few, a large scan waits for small ones that come soon after it, and no tag is passed over for ever (start-time fair queueing,
//! Goyal, Vin & Cheng 1996, with the client's present load instead of its past).

use std::collections::HashMap;

use super::client::Client;

/// Waiting jobs, and what their clients have running.
#[derive(Debug)]
pub(crate) struct FairQueue<T> {
    waiting: Vec<Waiting<T>>,
    loads: HashMap<Client, Load>,
    /// The tag of the job that started last, or more.
    time: u64,
    /// How many jobs have come.
    come: u64,
    /// Most large jobs that run at once.
    large_limit: usize,
    /// Most of them that are of one client.
    large_limit_of_client: usize,
    /// Large jobs that run.
    large_running: usize,
    /// Jobs that run.
    running: usize,
    /// Whether the worker for first jobs runs one.
    first_runs: bool,
}

/// Jobs of at least this cost are large: they leave workers to small ones.
const LARGE: u64 = 500_000;

#[derive(Debug)]
struct Waiting<T> {
    tag: u64,
    /// Among equal tags the first job starts first.
    number: u64,
    client: Client,
    class: JobClass,
    job: T,
}

/// Whether a job is large.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JobClass {
    Small,
    Large,
}

/// Which jobs a worker starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WorkerKind {
    /// Small jobs of known clients that have nothing running: they need not wait for those of busy clients to end.
    First,
    /// All others, and those while the worker for them is busy.
    Any,
}

/// A job that has started; to be given back to [`FairQueue::ended`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Started {
    client: Client,
    class: JobClass,
    worker: WorkerKind,
}

/// The jobs of a client.
#[derive(Debug, Default, Clone, Copy)]
struct Load {
    waiting: usize,
    running: usize,
    /// Large ones among those that run.
    large_running: usize,
}

impl<T> FairQueue<T> {
    /// An empty queue in front of workers of which large jobs may use `large_limit`; where that is more than two, those of one client one fewer.
    pub(crate) fn new(large_limit: usize) -> Self {
        let large_limit = large_limit.max(1);
        Self {
            waiting: Vec::new(),
            loads: HashMap::new(),
            time: 0,
            come: 0,
            large_limit,
            large_limit_of_client: if large_limit > 2 {
                large_limit - 1
            } else {
                large_limit
            },
            large_running: 0,
            running: 0,
            first_runs: false,
        }
    }

    /// How many jobs wait.
    pub(crate) fn len(&self) -> usize {
        self.waiting.len()
    }

    /// How many jobs run.
    pub(crate) fn running(&self) -> usize {
        self.running
    }

    /// Adds a job that is estimated to cost this much.
    pub(crate) fn push(&mut self, client: Client, cost: u64, job: T) {
        let load = self.loads.entry(client.clone()).or_default();
        load.waiting += 1;
        let jobs = (load.waiting + load.running) as u64;
        self.waiting.push(Waiting {
            tag: self.time.saturating_add(cost.saturating_mul(jobs)),
            number: self.come,
            client,
            class: if cost < LARGE {
                JobClass::Small
            } else {
                JobClass::Large
            },
            job,
        });
        self.come += 1;
    }

    /// Takes the next job that a worker may start; it counts as running until [`FairQueue::ended`] is called.
    pub(crate) fn pop(&mut self, worker: WorkerKind) -> Option<(Started, T)> {
        let load_of = |client: &Client| self.loads.get(client).copied().unwrap_or_default();
        let is_first = |job: &Waiting<T>| {
            job.class == JobClass::Small
                && job.client.is_some()
                && load_of(&job.client).running == 0
        };
        let may_start = |job: &Waiting<T>| match worker {
            WorkerKind::First => is_first(job),
            WorkerKind::Any if !self.first_runs && is_first(job) => false,
            WorkerKind::Any => {
                job.class == JobClass::Small
                    || (self.large_running < self.large_limit
                        && load_of(&job.client).large_running < self.large_limit_of_client)
            }
        };
        let next = (self.waiting.iter().enumerate())
            .filter(|(_, job)| may_start(job))
            .min_by_key(|(_, job)| (job.tag, job.number))
            .map(|(index, _)| index)?;
        let Waiting {
            tag,
            client,
            class,
            job,
            ..
        } = self.waiting.swap_remove(next);
        self.time = self.time.max(tag);
        let large = usize::from(class == JobClass::Large);
        self.large_running += large;
        self.running += 1;
        self.first_runs |= worker == WorkerKind::First;
        if let Some(load) = self.loads.get_mut(&client) {
            load.waiting -= 1;
            load.running += 1;
            load.large_running += large;
        }
        let started = Started {
            client,
            class,
            worker,
        };
        Some((started, job))
    }

    /// A job has ended.
    pub(crate) fn ended(&mut self, started: Started) {
        let Started {
            client,
            class,
            worker,
        } = started;
        let large = usize::from(class == JobClass::Large);
        self.large_running -= large;
        self.running -= 1;
        self.first_runs &= worker != WorkerKind::First;
        if let Some(load) = self.loads.get_mut(&client) {
            load.running -= 1;
            load.large_running -= large;
        }
        self.forget_idle(&client);
    }

    /// Takes out the jobs that are not wanted any more.
    pub(crate) fn take_unwanted(&mut self, is_wanted: impl Fn(&T) -> bool) -> Vec<T> {
        let (kept, unwanted): (Vec<_>, Vec<_>) = std::mem::take(&mut self.waiting)
            .into_iter()
            .partition(|waiting| is_wanted(&waiting.job));
        self.waiting = kept;
        let mut jobs = Vec::with_capacity(unwanted.len());
        for Waiting { client, job, .. } in unwanted {
            if let Some(load) = self.loads.get_mut(&client) {
                load.waiting -= 1;
            }
            self.forget_idle(&client);
            jobs.push(job);
        }
        jobs
    }

    fn forget_idle(&mut self, client: &Client) {
        if (self.loads.get(client)).is_some_and(|load| load.waiting + load.running == 0) {
            self.loads.remove(client);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use proptest::prelude::*;

    use super::*;
    use crate::{client::ClientId, client_address::ClientAddress};

    fn client(n: u8) -> Client {
        let address = ClientAddress::of(Ipv4Addr::new(192, 0, 2, n).into());
        Some(ClientId::Address(address))
    }

    /// The next job that any worker may start.
    fn next<T>(queue: &mut FairQueue<T>) -> Option<(Started, T)> {
        let first = queue.pop(WorkerKind::First);
        first.or_else(|| queue.pop(WorkerKind::Any))
    }

    /// The jobs in the order in which one worker starts them.
    fn order(mut queue: FairQueue<u32>) -> Vec<u32> {
        let mut order = Vec::new();
        while let Some((started, job)) = next(&mut queue) {
            order.push(job);
            queue.ended(started);
        }
        order
    }

    #[test]
    fn a_quiet_client_comes_before_the_rest_of_a_flood() {
        let mut queue = FairQueue::new(1);
        (0..50).for_each(|job| queue.push(client(1), 10, job));
        queue.push(client(2), 10, 100);
        let order = order(queue);
        let place = order.iter().position(|job| *job == 100);
        assert!(place <= Some(1), "{order:?}");
    }

    #[test]
    fn the_worker_for_first_jobs_takes_small_ones_of_clients_that_have_nothing_running() {
        let mut queue = FairQueue::new(3);
        (0..3).for_each(|job| queue.push(client(1), 10, job));
        assert_eq!(queue.pop(WorkerKind::Any), None, "the first is not for it");
        let (first, job) = queue.pop(WorkerKind::First).unwrap();
        assert_eq!(job, 0);
        assert_eq!(queue.pop(WorkerKind::First), None, "one of its client runs");
        assert_eq!(queue.pop(WorkerKind::Any).map(|(_, job)| job), Some(1));
        queue.push(client(2), 10, 20);
        queue.push(client(3), LARGE, 30);
        queue.push(None, 10, 40);
        queue.ended(first);
        assert_eq!(queue.pop(WorkerKind::First).map(|(_, job)| job), Some(20));
        assert_eq!(queue.pop(WorkerKind::First), None);
        // While it is busy, others take what it would take.
        queue.push(client(4), 10, 50);
        let mut rest: Vec<u32> = std::iter::from_fn(|| queue.pop(WorkerKind::Any))
            .map(|(_, job)| job)
            .collect();
        rest.sort_unstable();
        assert_eq!(rest, [2, 30, 40, 50]);
        assert_eq!(queue.running(), 6);
    }

    #[test]
    fn a_small_job_passes_large_ones_and_a_large_one_is_not_passed_for_ever() {
        let mut queue = FairQueue::new(1);
        (0..8).for_each(|job| queue.push(client(1), 1000, job));
        queue.push(client(1), 10, 100);
        let (started, job) = next(&mut queue).unwrap();
        assert_eq!(job, 100);
        queue.ended(started);
        // Small jobs keep coming: the first large one starts after about as much work as it costs itself.
        let mut passed = 0;
        loop {
            queue.push(client(2), 10, 200);
            match next(&mut queue) {
                Some((started, 200)) => queue.ended(started),
                _ => break,
            }
            passed += 1;
            assert!(passed < 200, "still passed over");
        }
    }

    #[test]
    fn large_jobs_leave_workers_to_small_ones_and_to_other_clients() {
        let mut queue = FairQueue::new(3);
        (0..5).for_each(|job| queue.push(client(1), LARGE, job));
        let mut started: Vec<Started> = Vec::new();
        while let Some((large, _)) = next(&mut queue) {
            started.push(large);
        }
        assert_eq!(started.len(), 2);
        queue.push(client(2), LARGE, 100);
        let (other, job) = next(&mut queue).unwrap();
        assert_eq!(job, 100);
        // The small job of a client whose large ones run and wait.
        queue.push(client(1), 10, 200);
        assert_eq!(next(&mut queue).map(|(_, job)| job), Some(200));
        assert_eq!(next(&mut queue), None);
        queue.ended(other);
        assert_eq!(next(&mut queue), None);
        queue.ended(started.remove(0));
        assert!(next(&mut queue).is_some());
    }

    proptest! {
        #[test]
        fn every_job_starts_once_and_equal_jobs_of_a_client_in_their_order(
            jobs in prop::collection::vec((0..4u8, 1..4u64), 0..60)
        ) {
            let mut queue = FairQueue::new(2);
            for (k, (n, cost)) in (0u32..).zip(&jobs) {
                queue.push(client(*n), *cost, k);
            }
            let order = order(queue);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            prop_assert!(sorted.into_iter().eq(0..jobs.len() as u32));
            for (n, cost) in &jobs {
                let alike: Vec<u32> = order.iter().copied().filter(|k| jobs[*k as usize] == (*n, *cost)).collect();
                prop_assert!(alike.is_sorted(), "{:?}", alike);
            }
        }

        #[test]
        fn unwanted_jobs_leave_no_load_behind(wanted in prop::collection::vec(any::<bool>(), 0..40)) {
            let mut queue = FairQueue::new(1);
            for keep in &wanted {
                queue.push(client(1), 1, *keep);
            }
            let unwanted = queue.take_unwanted(|keep| *keep);
            prop_assert_eq!(unwanted.len() + queue.len(), wanted.len());
            while let Some((started, keep)) = next(&mut queue) {
                prop_assert!(keep);
                queue.ended(started);
            }
            prop_assert!(queue.loads.is_empty());
        }
    }
}
