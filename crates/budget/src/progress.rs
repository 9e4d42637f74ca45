//! How far a request's work is, told to whoever waits for it.

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
};

/// How far the work is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// What is done now, as one word.
    pub stage: &'static str,
    /// How many of `all` are done.
    pub done: usize,
    /// How many there are to do in this stage; 0 where it is one piece.
    pub all: usize,
}

/// Who is told of progress. It is called on the threads that work, possibly by several at once, and must not wait.
#[derive(Clone)]
pub struct Listener(Arc<dyn Fn(Progress) + Send + Sync>);

impl Listener {
    /// Tells a function.
    pub fn new(hear: impl Fn(Progress) + Send + Sync + 'static) -> Self {
        Self(Arc::new(hear))
    }
}

impl fmt::Debug for Listener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Listener")
    }
}

/// A stage that has begun. Shared by reference between the threads that work.
#[derive(Debug)]
pub struct Stage<'a> {
    listener: Option<&'a Listener>,
    name: &'static str,
    done: AtomicUsize,
    all: usize,
}

impl<'a> Stage<'a> {
    /// Begins a stage with so many pieces.
    pub(crate) fn begin(listener: Option<&'a Listener>, name: &'static str, all: usize) -> Self {
        let stage = Self {
            listener,
            name,
            done: AtomicUsize::new(0),
            all,
        };
        stage.tell(0);
        stage
    }

    /// One piece more is done.
    pub fn one_done(&self) {
        let before = self.done.fetch_add(1, Relaxed);
        self.tell(before + 1);
    }

    fn tell(&self, done: usize) {
        if let Some(Listener(hear)) = self.listener {
            hear(Progress {
                stage: self.name,
                done,
                all: self.all,
            });
        }
    }
}
