//! The priority of threads: work that can wait leaves the processors to work that cannot.

/// Nice levels by which threads stand behind others: each is worth about a fifth of a processor that all want, so a thread that is this far
/// behind gets a third of what others get.
#[cfg(target_os = "linux")]
const BEHIND: i32 = 5;

/// Puts the calling thread, and threads that it will start, behind others that want a processor; once for all, as a process may not raise a
/// priority. Only Linux has priorities of threads: elsewhere, and where the system refuses, nothing changes.
pub fn lower_this_thread() {
    // By "this process" Linux understands the calling thread (setpriority(2)).
    #[cfg(target_os = "linux")]
    if let Ok(own) = rustix::process::getpriority_process(None) {
        rustix::process::setpriority_process(None, own + BEHIND).ok();
    }
}

/// The nice level of the calling thread, and of threads that it starts: the higher, the less urgent. 0 where threads have none.
pub fn of_this_thread() -> i32 {
    #[cfg(target_os = "linux")]
    let own = rustix::process::getpriority_process(None).unwrap_or(0);
    #[cfg(not(target_os = "linux"))]
    let own = 0;
    own
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::thread;

    #[test]
    fn a_lowered_thread_lowers_those_that_it_starts_and_no_other() {
        let before = of_this_thread();
        let [own, started] = thread::spawn(|| {
            lower_this_thread();
            let started = thread::spawn(of_this_thread).join().unwrap();
            [of_this_thread(), started]
        })
        .join()
        .unwrap();
        assert!(own > before || before + BEHIND > 19, "{own}, {before}");
        assert_eq!(started, own);
        assert_eq!(of_this_thread(), before);
    }
}
