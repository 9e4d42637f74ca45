//! The input of a job that is still to be made: its file is there, its row is not.

use uuid::Uuid;

use super::{
    blobs::{self, BlobFile, BlobName, Blobs, Written},
    error::JobError,
    jobs::Jobs,
};
use tokio::io::AsyncRead;

/// An input that is stored, for [`Jobs::submit_received`]. Dropped without that, its file is deleted.
#[derive(Debug)]
pub struct ReceivedInput {
    pub(crate) id: Uuid,
    pub(crate) name: BlobName,
    pub(crate) written: Written,
    blobs: Blobs,
    is_kept: bool,
}

impl ReceivedInput {
    /// Its bytes.
    pub fn bytes(&self) -> u64 {
        self.written.bytes
    }

    /// What is known of its file.
    pub fn written(&self) -> &Written {
        &self.written
    }

    /// Opens it for reading.
    pub async fn open(&self) -> Result<BlobFile, JobError> {
        self.blobs.open_blob(&self.name).await
    }

    /// Leaves its file to the row that names it, or may name it.
    pub(crate) fn keep(mut self) {
        self.is_kept = true;
    }
}

impl Drop for ReceivedInput {
    fn drop(&mut self) {
        if self.is_kept {
            return;
        }
        self.blobs.delete_soon(&self.name);
    }
}

impl Jobs {
    /// Stores an input whose job is made later: by then all of it has come, and what goes with it is known.
    ///
    /// # Errors
    /// [`JobError::StorageFull`], [`JobError::Stream`] where the stream fails. Nothing is left then.
    pub async fn receive(&self, input: impl AsyncRead) -> Result<ReceivedInput, JobError> {
        self.store().check_room().await?;
        let id = Uuid::new_v4();
        let name = BlobName::input(id);
        let written = self.blobs().put(&name, input).await?;
        Ok(ReceivedInput {
            id,
            name,
            written,
            blobs: self.blobs().clone(),
            is_kept: false,
        })
    }

    /// Reads an input whose job was made before, for [`Self::repeated`]: nothing is stored, so it takes no space.
    ///
    /// # Errors
    /// [`JobError::Stream`] where the stream fails.
    pub async fn measure(&self, input: impl AsyncRead) -> Result<Written, JobError> {
        blobs::measure(input).await
    }
}
