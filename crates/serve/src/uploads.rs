//! How many bodies are received at once, by size and by client: who sends slowly must not keep others from being heard.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use axum::body::{Body, HttpBody as _};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::{
    client::{Client, ClientId},
    parameters,
};

/// Most bytes of a small body. Edits of a session are never larger.
const SMALL_BODY: u64 = parameters::MAX_BYTES as u64;
/// Slots for small bodies for each slot for large ones. A small body costs its client so little that many are sent at once.
const SMALL_FOR_LARGE: usize = 8;
/// Most requests without a body between their arrival and the queue; each holds next to nothing.
const MAX_BODILESS: usize = 1 << 20;

/// The size of a body, as its request declares it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodySize {
    /// There is no body.
    None,
    /// At most 1 MiB.
    Small,
    /// Larger, or not declared.
    Large,
}

impl BodySize {
    /// The size of a body of which at most `limit` bytes are read.
    pub fn of(body: &Body, limit: usize) -> Self {
        let declared = body.size_hint().upper().unwrap_or(u64::MAX);
        match declared.min(limit as u64) {
            0 => Self::None,
            1..=SMALL_BODY => Self::Small,
            _ => Self::Large,
        }
    }
}

/// Why a body is not received now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UploadRefusal {
    /// So many bodies of its size are being received.
    Full(usize),
    /// So many bodies of its size are being received from its client, and no more could be received beside them from all others.
    ShareFull(usize),
}

/// The bodies being received. Those of each size have slots of their own, and one client may hold as many of them as are left free: half of
/// them when it is alone, and so many clients as halve them again and again until one is left are needed to take them all.
#[derive(Debug)]
pub struct Uploads {
    bodiless: Slots,
    small: Slots,
    large: Slots,
}

impl Uploads {
    /// So many slots for large bodies, and [`SMALL_FOR_LARGE`] times as many for small ones.
    pub fn new(slots: usize) -> Self {
        Self {
            bodiless: Slots::new(MAX_BODILESS),
            small: Slots::new(SMALL_FOR_LARGE * slots),
            large: Slots::new(slots),
        }
    }

    /// Takes a slot. Who is no client in particular may hold all of them, and so may anybody that sends no body.
    ///
    /// # Errors
    /// All slots of this size are taken, or this client's share of them.
    pub fn take(&self, size: BodySize, client: &Client) -> Result<UploadSlot, UploadRefusal> {
        match size {
            BodySize::None => self.bodiless.take(&None),
            BodySize::Small => self.small.take(client),
            BodySize::Large => self.large.take(client),
        }
    }

    /// Waits until no slot is taken.
    pub async fn drained(&self) {
        for slots in [&self.bodiless, &self.small, &self.large] {
            let all = u32::try_from(slots.limit).unwrap_or(u32::MAX);
            // The semaphore is never closed, so this is never an error.
            slots.free.acquire_many(all).await.ok();
        }
    }
}

/// Slots for bodies of one size.
#[derive(Debug)]
struct Slots {
    free: Arc<Semaphore>,
    limit: usize,
    held: Arc<Held>,
}

impl Slots {
    fn new(limit: usize) -> Self {
        Self {
            free: Arc::new(Semaphore::new(limit)),
            limit,
            held: Arc::default(),
        }
    }

    fn take(&self, client: &Client) -> Result<UploadSlot, UploadRefusal> {
        // Counted with the slot: another request may take slots meanwhile, so the share is that of a moment ago at worst.
        let free = self.free.available_permits();
        let slot = Arc::clone(&self.free).try_acquire_owned();
        let slot = slot.map_err(|_| UploadRefusal::Full(self.limit))?;
        let share = match client {
            Some(client) => {
                let share = Held::take(&self.held, client.clone(), free);
                Some(share.map_err(UploadRefusal::ShareFull)?)
            }
            None => None,
        };
        Ok(UploadSlot {
            _slot: slot,
            _share: share,
        })
    }
}

/// A slot; given back when dropped.
#[derive(Debug)]
pub struct UploadSlot {
    _slot: OwnedSemaphorePermit,
    _share: Option<Share>,
}

/// Slots that each client holds.
#[derive(Debug, Default)]
struct Held(Mutex<HashMap<ClientId, usize>>);

impl Held {
    fn lock(&self) -> MutexGuard<'_, HashMap<ClientId, usize>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// One more slot for a client, unless it holds `most` already.
    ///
    /// # Errors
    /// The number of slots that it holds.
    fn take(self: &Arc<Self>, client: ClientId, most: usize) -> Result<Share, usize> {
        let mut held = self.lock();
        let count = held.get(&client).copied().unwrap_or(0);
        if count >= most {
            return Err(count);
        }
        held.insert(client.clone(), count + 1);
        drop(held);
        let held = Arc::clone(self);
        Ok(Share { client, held })
    }
}

/// One slot of a client; given back when dropped.
#[derive(Debug)]
struct Share {
    client: ClientId,
    held: Arc<Held>,
}

impl Drop for Share {
    fn drop(&mut self) {
        let mut held = self.held.lock();
        match held.get_mut(&self.client) {
            Some(count) if *count > 1 => *count -= 1,
            _ => drop(held.remove(&self.client)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::client_address::ClientAddress;

    fn client(last: u8) -> Client {
        let address = ClientAddress::of([192, 0, 2, last].into());
        Some(ClientId::Address(address))
    }

    #[test]
    fn many_clients_leave_a_slot_for_one_more() {
        let uploads = Uploads::new(18);
        let mut slots = Vec::new();
        for last in 0..6 {
            while let Ok(slot) = uploads.take(BodySize::Small, &client(last)) {
                slots.push(slot);
            }
        }
        assert!(slots.len() > 100);
        assert!(uploads.take(BodySize::Small, &client(7)).is_ok());
    }

    #[test]
    fn one_client_holds_at_most_half_of_the_slots() {
        let uploads = Uploads::new(3);
        let take = |size, last| uploads.take(size, &client(last));
        let first = take(BodySize::Large, 1).unwrap();
        let _second = take(BodySize::Large, 1).unwrap();
        let refusal = take(BodySize::Large, 1).unwrap_err();
        assert_eq!(refusal, UploadRefusal::ShareFull(2));
        assert!(take(BodySize::Small, 1).is_ok(), "sizes are apart");
        let _third = take(BodySize::Large, 2).unwrap();
        let refusal = take(BodySize::Large, 2).unwrap_err();
        assert_eq!(refusal, UploadRefusal::Full(3));
        drop(first);
        assert!(
            take(BodySize::Large, 1).is_err(),
            "it holds as many as are free"
        );
        assert!(take(BodySize::Large, 3).is_ok());
    }

    #[test]
    fn a_client_that_holds_nothing_is_forgotten() {
        let uploads = Uploads::new(4);
        let slots = [(); 2].map(|()| uploads.take(BodySize::Small, &client(1)).unwrap());
        drop(slots);
        assert!(uploads.small.held.lock().is_empty());
    }

    #[test]
    fn who_is_no_client_in_particular_may_hold_all_slots() {
        let uploads = Uploads::new(2);
        let _slots = [(); 2].map(|()| uploads.take(BodySize::Large, &None).unwrap());
        let refusal = uploads.take(BodySize::Large, &None).unwrap_err();
        assert_eq!(refusal, UploadRefusal::Full(2));
    }

    #[test]
    fn a_body_has_the_size_that_it_declares_or_that_is_read() {
        let large = 1 << 30;
        for (body, limit, size) in [
            (Body::empty(), large, BodySize::None),
            (Body::from("cloth"), large, BodySize::Small),
            (Body::from(vec![7; 2 << 20]), large, BodySize::Large),
            (
                Body::from(vec![7; 2 << 20]),
                parameters::MAX_BYTES,
                BodySize::Small,
            ),
        ] {
            assert_eq!(BodySize::of(&body, limit), size);
        }
    }
}
