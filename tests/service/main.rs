//! The service through its real router on a real socket, mending replaced by a fake that fails on demand.

mod anchors;
mod doors;
mod faults;
mod harness;
mod load;
mod openapi;
mod sessions;
mod signals;
mod uploads;
