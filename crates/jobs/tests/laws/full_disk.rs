//! A disk that is full: a file system of a few megabytes, in a mount namespace of its own.

use std::path::PathBuf;

use darn_jobs::{JobError, Jobs, Outcome, Place, Settings, State};
use tempfile::TempDir;

use crate::{
    bench::{claim, failed, product, submission, submit},
    small_disk::on_small_disk,
};

#[test]
fn a_full_disk_refuses_what_is_new_and_lets_everything_end() {
    let folder = TempDir::new().unwrap();
    let this = std::env::current_exe().unwrap();
    let Some(mut command) = on_small_disk(folder.path(), "24m", &this) else {
        return;
    };
    let test = [
        "--exact",
        "full_disk::on_a_small_disk",
        "--ignored",
        "--nocapture",
    ];
    let ran = command
        .args(test)
        .env(DISK, folder.path())
        .output()
        .unwrap();
    let output = format!(
        "{}{}",
        String::from_utf8_lossy(&ran.stdout),
        String::from_utf8_lossy(&ran.stderr)
    );
    assert!(
        ran.status.success() && output.contains("1 passed"),
        "the law is broken:\n{output}"
    );
}

/// The variable that names the small disk.
const DISK: &str = "DARN_TEST_SMALL_DISK";

fn disk() -> PathBuf {
    std::env::var_os(DISK)
        .expect("the test above sets it")
        .into()
}

/// Takes all space that is left, as anything else on the disk might.
fn fill() -> PathBuf {
    let path = disk().join("filler");
    let mut file = std::fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(&path)
        .unwrap();
    for size in [1 << 20, 1 << 12, 1] {
        while std::io::Write::write_all(&mut file, &vec![7; size]).is_ok() {}
    }
    path
}

#[tokio::test]
#[ignore = "run by the test above, on a disk of its own"]
async fn on_a_small_disk() {
    let folder = disk();
    assert!(
        std::fs::read_dir(&folder).unwrap().next().is_none(),
        "this is not the small disk"
    );
    let place = Place::Folder(folder.join("data"));
    let jobs = Jobs::open(&place, Settings::default()).await.unwrap();
    let mut ids = Vec::new();
    for _ in 0..40 {
        ids.push(submit(&jobs, "client").await.id);
    }
    let finishing = claim(jobs.store()).await.unwrap();
    let failing = claim(jobs.store()).await.unwrap();
    let mut held = jobs.claim("worker").await.unwrap().unwrap();
    held.input().await.unwrap();

    // Until neither the database nor a file can grow.
    let filler = fill();
    let refused = loop {
        fill();
        match jobs.submit(submission("client"), &b"scan"[..]).await {
            Ok(job) => ids.push(job.into_job().id),
            Err(error) => break error,
        }
    };
    assert!(matches!(refused, JobError::StorageFull), "{refused:?}");
    let result = vec![7; 1 << 20];
    let refused = held.finish(&result[..], &b"{}"[..], "{}".to_owned()).await;
    assert!(matches!(refused, Err(JobError::StorageFull)), "{refused:?}");

    // Everything can end.
    let claimed = [finishing.job.id, failing.job.id, held.job().id];
    for (place, id) in ids.iter().filter(|id| !claimed.contains(id)).enumerate() {
        match place % 2 {
            0 => assert_eq!(jobs.cancel(*id).await.unwrap().state, State::Cancelled),
            _ => jobs.delete(*id).await.unwrap(),
        }
        // What is held back for this is not given to what is new.
        let refused = jobs.submit(submission("client"), &b"scan"[..]).await;
        assert!(matches!(refused, Err(JobError::StorageFull)), "{refused:?}");
    }
    let Outcome::Failed { failure, answer } = failed() else {
        unreachable!()
    };
    held.fail(failure, answer).await.unwrap();
    jobs.store()
        .end(finishing.lease, &product(&finishing))
        .await
        .unwrap();
    jobs.store().end(failing.lease, &failed()).await.unwrap();
    // Nothing is lost.
    for id in claimed {
        assert!(jobs.get(id).await.unwrap().state.is_finished());
    }

    // With space again, work goes on, and the reserve is taken again.
    std::fs::remove_file(filler).unwrap();
    while jobs
        .submit(submission("client"), &b"scan"[..])
        .await
        .is_err()
    {
        tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    }
    assert_eq!(
        std::fs::metadata(folder.join("data/reserve"))
            .unwrap()
            .len(),
        8 << 20
    );
    submit(&jobs, "client").await;
}
