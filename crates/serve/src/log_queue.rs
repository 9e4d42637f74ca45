//! Log lines on their way to standard error. Whoever logs never waits and never fails: a thread of its own writes the lines, and those
//! that it cannot write, or that find no room while it waits for a slow reader, are dropped and counted.
//!
//! Not `tracing-appender`: it does not count lines that could not be written, panics when its thread cannot be started, and writes to
//! standard output, with a panic when that fails, when its reader is slow at the end.

use std::{
    io::{self, ErrorKind, Write},
    mem,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    thread,
    time::Duration,
};

use tracing_subscriber::fmt::MakeWriter;

/// Most bytes of lines that wait to be written: some thousand lines.
const CAPACITY: usize = 1 << 20;
/// Longest time that the end of the process waits for the last lines to be written.
const FLUSH_TIME: Duration = Duration::from_secs(1);
/// Pause before the next try when standard error would block.
const RETRY_PAUSE: Duration = Duration::from_millis(10);

/// The queue of this process, once it was started.
static QUEUE: OnceLock<LogQueue> = OnceLock::new();

/// How many log lines were dropped, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DroppedLines {
    /// They came while too many others waited to be written.
    pub queue_full: u64,
    /// Standard error did not take them.
    pub write_failed: u64,
}

/// The log lines that this process has dropped.
pub fn dropped_lines() -> DroppedLines {
    QUEUE.get().map(LogQueue::dropped).unwrap_or_default()
}

/// Writes a line to standard error as the log lines are written, waits at most a second until it is written, and ignores errors. Unlike
/// `eprintln!` it neither panics nor waits for long once logging in the queue has started.
pub fn write_to_stderr(line: &str) {
    let line = format!("{line}\n");
    match QUEUE.get() {
        Some(queue) => {
            queue.push(line.as_bytes());
            queue.flush(FLUSH_TIME);
        }
        None => drop(io::stderr().write_all(line.as_bytes())),
    }
}

/// Waits, when dropped, until the lines logged so far are written, at most a second.
#[derive(Debug)]
#[must_use = "it waits for the lines logged before it is dropped"]
pub struct LogGuard(());

impl LogGuard {
    /// The guard of this process's queue; it waits for nothing if there is none.
    pub(crate) fn new() -> Self {
        Self(())
    }
}

impl Drop for LogGuard {
    fn drop(&mut self) {
        if let Some(queue) = QUEUE.get() {
            queue.flush(FLUSH_TIME);
        }
    }
}

/// Lines that wait for a thread that writes them.
#[derive(Debug, Clone)]
pub struct LogQueue(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    lines: Mutex<Lines>,
    /// Lines have come.
    filled: Condvar,
    /// No line waits and none is being written.
    emptied: Condvar,
    queue_full: AtomicU64,
    write_failed: AtomicU64,
}

#[derive(Debug, Default)]
struct Lines {
    /// The lines that wait, one after the other.
    waiting: Vec<u8>,
    /// Whether the thread is writing others.
    writing: bool,
}

impl LogQueue {
    /// Starts the queue of this process, which writes to standard error; the same one for every call.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn of_process() -> io::Result<&'static Self> {
        if let Some(queue) = QUEUE.get() {
            return Ok(queue);
        }
        let started = Self::start(io::stderr())?;
        Ok(QUEUE.get_or_init(|| started))
    }

    /// Starts a thread that writes to `output` for the rest of the process.
    fn start(output: impl Write + Send + 'static) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let queue = Self(Arc::clone(&shared));
        thread::Builder::new()
            .name("log".to_owned())
            .spawn(move || shared.write_lines(output))?;
        Ok(queue)
    }

    /// Queues a line, which ends with a line feed; drops it when there is no room.
    fn push(&self, line: &[u8]) {
        let mut lines = self.0.lock();
        if lines.waiting.len() + line.len() > CAPACITY {
            self.0.queue_full.fetch_add(1, Relaxed);
            return;
        }
        lines.waiting.extend_from_slice(line);
        drop(lines);
        self.0.filled.notify_one();
    }

    /// Waits until no line waits any more, at most `time`.
    fn flush(&self, time: Duration) {
        let is_busy = |lines: &mut Lines| lines.writing || !lines.waiting.is_empty();
        drop((self.0.emptied).wait_timeout_while(self.0.lock(), time, is_busy));
    }

    fn dropped(&self) -> DroppedLines {
        DroppedLines {
            queue_full: self.0.queue_full.load(Relaxed),
            write_failed: self.0.write_failed.load(Relaxed),
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Lines> {
        // Nothing under the lock panics halfway through a change, so a poisoned state is still consistent.
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the thread does.
    fn write_lines(&self, mut output: impl Write) {
        let mut batch = Vec::new();
        loop {
            batch.clear();
            let mut lines = self.lock();
            lines.writing = false;
            while lines.waiting.is_empty() {
                self.emptied.notify_all();
                lines = (self.filled.wait(lines)).unwrap_or_else(PoisonError::into_inner);
            }
            lines.writing = true;
            mem::swap(&mut batch, &mut lines.waiting);
            drop(lines);
            // Line by line, since a pipe that several processes write to keeps short writes whole.
            for line in batch.split_inclusive(|&byte| byte == b'\n') {
                if write_line(&mut output, line).is_err() {
                    self.write_failed.fetch_add(1, Relaxed);
                }
            }
        }
    }
}

/// Writes a line whole; waits while an output that does not block takes nothing.
fn write_line(output: &mut impl Write, mut line: &[u8]) -> io::Result<()> {
    while !line.is_empty() {
        match output.write(line) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(written) => line = line.get(written..).unwrap_or_default(),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(RETRY_PAUSE),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

impl Write for &LogQueue {
    /// Takes a whole line; never an error.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.push(line);
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<'a> MakeWriter<'a> for LogQueue {
    type Writer = &'a LogQueue;

    fn make_writer(&'a self) -> &'a LogQueue {
        self
    }
}

/// Standard error, written by the thread that logs, which waits for a slow reader; errors are ignored.
#[derive(Debug)]
pub struct PatientStderr;

impl Write for PatientStderr {
    /// Takes a whole line; never an error.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        io::stderr().write_all(line).ok();
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::{
        sync::mpsc::{Receiver, SyncSender, sync_channel},
        time::Instant,
    };

    use super::*;

    /// Far longer than any of these tests takes.
    const LONG: Duration = Duration::from_secs(60);

    /// Takes a write once the test reads the last one.
    struct SlowOutput(SyncSender<Vec<u8>>);

    impl Write for SlowOutput {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.send(bytes.to_vec()).ok();
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn slow_queue() -> (LogQueue, Receiver<Vec<u8>>) {
        let (sender, reader) = sync_channel(0);
        (LogQueue::start(SlowOutput(sender)).unwrap(), reader)
    }

    /// Answers each write with the next of these, then takes everything.
    struct ScriptedOutput(Vec<io::Result<usize>>, Arc<Mutex<Vec<u8>>>);

    impl Write for ScriptedOutput {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let answer = self.0.pop().unwrap_or(Ok(bytes.len()));
            if let Ok(taken) = answer {
                self.1.lock().unwrap().extend_from_slice(&bytes[..taken]);
            }
            answer
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// What is written of the lines `ab` and `cd`, and how many were dropped, when the output answers so.
    fn written_when(mut answers: Vec<io::Result<usize>>) -> (String, DroppedLines) {
        answers.reverse();
        let written = Arc::<Mutex<Vec<u8>>>::default();
        let queue = LogQueue::start(ScriptedOutput(answers, Arc::clone(&written))).unwrap();
        queue.push(b"ab\n");
        queue.push(b"cd\n");
        queue.flush(LONG);
        let text = String::from_utf8(written.lock().unwrap().clone()).unwrap();
        (text, queue.dropped())
    }

    #[test]
    fn lines_are_written_whole_and_in_order() {
        let refused = |kind: ErrorKind| Err(kind.into());
        let answers = vec![
            Ok(1),
            refused(ErrorKind::WouldBlock),
            refused(ErrorKind::Interrupted),
        ];
        let expected = ("ab\ncd\n".to_owned(), DroppedLines::default());
        assert_eq!(written_when(answers), expected);
    }

    #[test]
    fn a_line_that_cannot_be_written_is_counted_and_the_next_is_tried() {
        for kind in [ErrorKind::BrokenPipe, ErrorKind::StorageFull] {
            let (written, dropped) = written_when(vec![Err(kind.into())]);
            assert_eq!((written.as_str(), dropped.write_failed), ("cd\n", 1));
        }
        assert_eq!(written_when(vec![Ok(0)]).1.write_failed, 1);
    }

    #[test]
    fn nobody_waits_for_an_output_that_takes_nothing() {
        let (queue, reader) = slow_queue();
        let line = [b"x".repeat(999), b"\n".to_vec()].concat();
        // Those being written and those that wait: at most twice the capacity.
        let pushed = 3 * CAPACITY / line.len();
        for _ in 0..pushed {
            queue.push(&line);
        }
        let dropped = queue.dropped().queue_full as usize;
        assert!((pushed / 4..pushed).contains(&dropped), "{dropped}");

        // The end waits for its own time only.
        let began = Instant::now();
        queue.flush(Duration::from_millis(20));
        assert!(began.elapsed() < LONG);

        // What was not dropped comes once it is read.
        for _ in dropped..pushed {
            assert_eq!(reader.recv_timeout(LONG).unwrap(), line);
        }
        queue.flush(LONG);
        queue.push(b"and goes on\n");
        assert_eq!(reader.recv_timeout(LONG).unwrap(), b"and goes on\n");
        assert_eq!(queue.dropped().queue_full as usize, dropped);
    }

    #[test]
    fn a_line_longer_than_the_queue_is_dropped() {
        let (queue, _reader) = slow_queue();
        queue.push(&vec![b'x'; CAPACITY + 1]);
        assert_eq!(queue.dropped().queue_full, 1);
    }
}
