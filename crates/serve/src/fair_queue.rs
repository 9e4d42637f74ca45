//! The order of waiting jobs: fair between clients, cheap jobs before dear ones, and nobody waits for ever.
//!
//! A job gets a tag when it comes: the queue's time, plus its cost times the jobs that its client has in the queue and running, itself
//! included. The job with the least tag starts first, and the queue's time moves on to that tag. So a client with many jobs waits behind
//! one with few, a large scan waits for small ones that come soon after it, and no tag is passed over for ever (start-time fair queueing,
//! Goyal, Vin & Cheng 1996, with the client's present load instead of its past).

use std::collections::HashMap;

use super::client_address::ClientAddress;

/// Whom a job is for. Jobs without an address share one place among the clients.
pub type Client = Option<ClientAddress>;

/// Waiting jobs, and what their clients have running.
#[derive(Debug)]
pub(crate) struct FairQueue<T> {
    waiting: Vec<Waiting<T>>,
    loads: HashMap<Client, Load>,
    /// The tag of the job that started last, or more.
    time: u64,
    /// How many jobs have come.
    come: u64,
    /// Most jobs of one client that run at once.
    running_limit: usize,
}

#[derive(Debug)]
struct Waiting<T> {
    tag: u64,
    /// Among equal tags the first job starts first.
    number: u64,
    client: Client,
    job: T,
}

/// The jobs of a client.
#[derive(Debug, Default, Clone, Copy)]
struct Load {
    waiting: usize,
    running: usize,
}

impl<T> FairQueue<T> {
    /// An empty queue in front of workers of which one client may use `running_limit`.
    pub(crate) fn new(running_limit: usize) -> Self {
        Self {
            waiting: Vec::new(),
            loads: HashMap::new(),
            time: 0,
            come: 0,
            running_limit: running_limit.max(1),
        }
    }

    /// How many jobs wait.
    pub(crate) fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Adds a job that is estimated to cost this much.
    pub(crate) fn push(&mut self, client: Client, cost: u64, job: T) {
        let load = self.loads.entry(client).or_default();
        load.waiting += 1;
        let jobs = (load.waiting + load.running) as u64;
        self.waiting.push(Waiting {
            tag: self.time.saturating_add(cost.saturating_mul(jobs)),
            number: self.come,
            client,
            job,
        });
        self.come += 1;
    }

    /// Takes the next job that may start; its client has one more running until [`FairQueue::ended`] is called.
    pub(crate) fn pop(&mut self) -> Option<(Client, T)> {
        let (loads, limit) = (&self.loads, self.running_limit);
        let may_start = |job: &Waiting<T>| {
            loads
                .get(&job.client)
                .is_none_or(|load| load.running < limit)
        };
        let next = (self.waiting.iter().enumerate())
            .filter(|(_, job)| may_start(job))
            .min_by_key(|(_, job)| (job.tag, job.number))
            .map(|(index, _)| index)?;
        let Waiting {
            tag, client, job, ..
        } = self.waiting.swap_remove(next);
        self.time = self.time.max(tag);
        if let Some(load) = self.loads.get_mut(&client) {
            load.waiting -= 1;
            load.running += 1;
        }
        Some((client, job))
    }

    /// A job of this client has ended.
    pub(crate) fn ended(&mut self, client: Client) {
        if let Some(load) = self.loads.get_mut(&client) {
            load.running -= 1;
        }
        self.forget_idle(client);
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
            self.forget_idle(client);
            jobs.push(job);
        }
        jobs
    }

    fn forget_idle(&mut self, client: Client) {
        if (self.loads.get(&client)).is_some_and(|load| load.waiting + load.running == 0) {
            self.loads.remove(&client);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use proptest::prelude::*;

    use super::*;

    fn client(n: u8) -> Client {
        Some(ClientAddress::of(Ipv4Addr::new(192, 0, 2, n).into()))
    }

    /// The jobs in the order in which one worker starts them.
    fn order(mut queue: FairQueue<u32>) -> Vec<u32> {
        let mut order = Vec::new();
        while let Some((client, job)) = queue.pop() {
            order.push(job);
            queue.ended(client);
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
    fn a_small_job_passes_large_ones_and_a_large_one_is_not_passed_for_ever() {
        let mut queue = FairQueue::new(1);
        (0..8).for_each(|job| queue.push(client(1), 1000, job));
        queue.push(client(1), 10, 100);
        assert_eq!(queue.pop(), Some((client(1), 100)));
        queue.ended(client(1));
        // Small jobs keep coming: the first large one starts after about as much work as it costs itself.
        let mut passed = 0;
        loop {
            queue.push(client(2), 10, 200);
            match queue.pop() {
                Some((client, 200)) => queue.ended(client),
                _ => break,
            }
            passed += 1;
            assert!(passed < 200, "still passed over");
        }
    }

    #[test]
    fn one_client_leaves_a_worker_to_others() {
        let mut queue = FairQueue::new(3);
        (0..5).for_each(|job| queue.push(client(1), 10, job));
        let started = (0..5).filter_map(|_| queue.pop()).count();
        assert_eq!(started, 3);
        queue.push(client(2), 1_000_000, 100);
        assert_eq!(queue.pop(), Some((client(2), 100)));
        assert_eq!(queue.pop(), None);
        queue.ended(client(1));
        assert!(queue.pop().is_some());
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
            while let Some((client, keep)) = queue.pop() {
                prop_assert!(keep);
                queue.ended(client);
            }
            prop_assert!(queue.loads.is_empty());
        }
    }
}
