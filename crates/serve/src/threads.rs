//! Whether the system lets the service start its threads. tokio itself does not say when it does not: it panics, or goes on with fewer
//! threads than its tasks need, and never ends.

use std::{io, sync::RwLock, thread};

/// Starts so many threads at once, and ends them again.
///
/// # Errors
/// One of them cannot be started.
pub fn check(count: usize) -> io::Result<()> {
    let gate = RwLock::new(());
    thread::scope(|scope| {
        // Dropped at the end of this closure, also when a thread cannot be started.
        let closed = gate.write();
        let mut started = Vec::with_capacity(count);
        for _ in 0..count {
            let wait = || drop(gate.read());
            started.push(thread::Builder::new().spawn_scoped(scope, wait)?);
        }
        drop(closed);
        // Joined one by one: the scope itself does not wait until the system has ended them.
        for thread in started {
            thread.join().ok();
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_threads_can_be_started() {
        check(0).unwrap();
        check(5).unwrap();
    }
}
