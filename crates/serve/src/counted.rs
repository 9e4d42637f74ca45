//! Bodies and answers whose memory counts in the service's pool for as long as they are held.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
};

use axum::body::{Body, HttpBody};
use bytes::{Bytes, BytesMut};
use hyper::body::{Frame, SizeHint};

use super::error::RequestError;
use darn_budget::{Memory, MemoryPool};

/// Answers of fewer bytes are not counted.
const SMALL_ANSWER: u64 = 16 << 10;

/// A body that comes in pieces.
#[derive(Debug)]
pub struct CountedBytes {
    bytes: BytesMut,
    memory: Memory,
}

impl CountedBytes {
    /// An empty body.
    ///
    /// # Errors
    /// `MemoryFull`.
    pub fn new(pool: &Arc<MemoryPool>) -> Result<Self, RequestError> {
        Ok(Self {
            bytes: BytesMut::new(),
            memory: take(pool, 0)?,
        })
    }

    /// How many bytes have come.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Adds a piece.
    ///
    /// # Errors
    /// `MemoryFull`.
    pub fn extend(&mut self, piece: &[u8]) -> Result<(), RequestError> {
        // Before the buffer grows, which at most doubles it.
        if self.bytes.capacity() - self.bytes.len() < piece.len() {
            let grown = (2 * self.bytes.capacity()).max(self.bytes.len() + piece.len());
            if !self.memory.resize(grown) {
                return Err(memory_full(self.memory.pool()));
            }
            self.bytes.reserve(piece.len());
        }
        self.bytes.extend_from_slice(piece);
        Ok(())
    }

    /// The whole body; its memory counts until the last clone is dropped.
    pub fn freeze(self) -> Bytes {
        counted(self.bytes.freeze(), self.memory)
    }
}

/// Takes memory from the pool.
///
/// # Errors
/// `MemoryFull`.
pub fn take(pool: &Arc<MemoryPool>, bytes: usize) -> Result<Memory, RequestError> {
    pool.take(bytes).ok_or_else(|| memory_full(pool))
}

fn memory_full(pool: &MemoryPool) -> RequestError {
    RequestError::MemoryFull {
        limit: pool.limit(),
    }
}

/// Bytes whose memory counts until their last clone is dropped.
pub fn counted(bytes: Bytes, memory: Memory) -> Bytes {
    struct Owner {
        bytes: Bytes,
        _memory: Memory,
    }
    impl AsRef<[u8]> for Owner {
        fn as_ref(&self) -> &[u8] {
            &self.bytes
        }
    }
    Bytes::from_owner(Owner {
        bytes,
        _memory: memory,
    })
}

/// An answer's body whose memory counts until it is sent or given up. It exists already, so it counts even beyond the pool's limit; then
/// new requests wait.
pub fn counted_answer(body: Body, pool: &Arc<MemoryPool>) -> Body {
    match body.size_hint().exact() {
        Some(bytes) if bytes > SMALL_ANSWER => Body::new(CountedAnswer {
            body,
            _memory: pool.take_anyway(usize::try_from(bytes).unwrap_or(usize::MAX)),
        }),
        _ => body,
    }
}

struct CountedAnswer {
    body: Body,
    _memory: Memory,
}

impl HttpBody for CountedAnswer {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_counts_until_its_last_clone_is_dropped() {
        let pool = MemoryPool::new(1 << 20);
        let mut body = CountedBytes::new(&pool).unwrap();
        for _ in 0..10 {
            body.extend(&[7; 1000]).unwrap();
            assert!(pool.used() >= body.len());
        }
        let bytes = body.freeze();
        let clone = bytes.slice(1..);
        assert_eq!(bytes.len(), 10_000);
        assert!((10_000..30_000).contains(&pool.used()));
        drop(bytes);
        assert!(pool.used() >= 10_000);
        drop(clone);
        assert_eq!(pool.used(), 0);
    }

    #[test]
    fn a_body_beyond_the_pool_is_refused_before_it_is_held() {
        let pool = MemoryPool::new(5000);
        let mut body = CountedBytes::new(&pool).unwrap();
        body.extend(&[0; 4000]).unwrap();
        let refused = body.extend(&[0; 4000]);
        assert_eq!(refused, Err(RequestError::MemoryFull { limit: 5000 }));
        assert!(pool.used() <= 5000);
    }

    #[test]
    fn an_answer_counts_beyond_the_limit() {
        let pool = MemoryPool::new(1000);
        let body = counted_answer(Body::from(vec![0; 100_000]), &pool);
        assert_eq!(pool.used(), 100_000);
        assert!(pool.take(1).is_none());
        drop(body);
        assert_eq!(pool.used(), 0);
    }
}
