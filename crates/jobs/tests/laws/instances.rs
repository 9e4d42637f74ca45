//! The processes that serve together.

use crate::bench::{Bench, PAST_LEASE, law};

law! {
    async fn an_instance_is_alive_until_it_is_silent_for_a_lease_or_ends(bench: Bench) {
        let jobs = bench.open().await;
        let store = jobs.store();
        assert!(!store.is_instance_alive("a").await.unwrap());
        store.instance_lives("a").await.unwrap();
        store.instance_lives("b").await.unwrap();
        bench.clock.advance(PAST_LEASE / 2);
        store.instance_lives("a").await.unwrap();
        assert!(store.is_instance_alive("b").await.unwrap());
        bench.clock.advance(PAST_LEASE / 2 + 1000);
        assert!(store.is_instance_alive("a").await.unwrap());
        assert!(!store.is_instance_alive("b").await.unwrap());
        store.instance_ends("a").await.unwrap();
        assert!(!store.is_instance_alive("a").await.unwrap());
    }
}
