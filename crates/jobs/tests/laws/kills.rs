//! Processes that are killed at random moments: what was acknowledged is there afterwards, ends once, and leaves no other file.

use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader, Write},
    path::Path,
    process::{Child, Command, Stdio},
    sync::Arc,
    time::Duration,
};

use darn_jobs::{CRASHED, Jobs, Place, Settings, State, blobs::Files};
use rand::{Rng, SeedableRng, rngs::StdRng};
use tokio::io::AsyncReadExt;
use uuid::Uuid;

use crate::bench::{Bench, Engine, submission};

/// Times that a process is killed.
const KILLS: usize = 20;
/// How often at most, where few jobs were acknowledged.
const MOST_KILLS: usize = 10 * KILLS;
/// Jobs that are acknowledged at least: a sixth of what the killed processes make when they have the time.
const FEWEST_JOBS: usize = 10;

/// Where the processes find what to do: in the folder in which they are started.
const PLACE: &str = "place";
/// The bucket, where there is one; how it is reached stands in their environment.
const BUCKET: &str = "bucket";

fn settings() -> Settings {
    Settings {
        // Short, so that dead workers are noticed soon.
        lease: Duration::from_millis(600),
        renewal: Duration::from_millis(150),
        poll: Duration::from_millis(50),
        ..Settings::default()
    }
}

/// The place that is written in a folder.
fn place(folder: &Path) -> Place {
    let url = std::fs::read_to_string(folder.join(PLACE)).unwrap();
    let bucket = std::fs::read_to_string(folder.join(BUCKET));
    let folder = folder.join("data");
    match url.is_empty() {
        true => Place::Folder(folder),
        false => Place::Shared {
            url,
            files: match bucket {
                Ok(bucket) => Files::Bucket(bucket.parse().unwrap()),
                Err(_) => Files::Folder(folder),
            },
        },
    }
}

/// A process that makes jobs and works on them until it is killed, or has nothing left to do.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "run by the tests below, as processes to be killed"]
async fn process() {
    let folder = std::env::current_dir().unwrap();
    let jobs = Jobs::open(&place(&folder), settings()).await.unwrap();
    let house = jobs.clone();
    tokio::spawn(async move {
        loop {
            house.expire_leases().await.unwrap();
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    });
    for _ in 0..2 {
        tokio::spawn(work(jobs.clone()));
    }
    for client in ["a", "b", "c"] {
        let input = Uuid::new_v4().to_string();
        let job = jobs
            .submit(submission(client), input.as_bytes())
            .await
            .unwrap()
            .into_job();
        // The acknowledgement: from here on the job is promised.
        println!("acknowledged {} {input}", job.id);
        std::io::stdout().flush().unwrap();
    }
    loop {
        let counts = jobs.counts().await.unwrap();
        if counts[&State::Waiting] + counts[&State::Running] == 0 {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

async fn work(jobs: Arc<Jobs>) {
    loop {
        let mut claimed = jobs.next_job("process").await;
        let mut input = Vec::new();
        claimed
            .input()
            .await
            .unwrap()
            .read_to_end(&mut input)
            .await
            .unwrap();
        tokio::time::sleep(Duration::from_millis(20)).await;
        input.reverse();
        // Another process may have the job by now.
        let _ = claimed
            .finish(&input[..], &b"{}"[..], "{}".to_owned())
            .await;
    }
}

fn start(bench: &Bench) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    if let Some(s3) = &bench.s3 {
        command.envs(s3.settings());
    }
    command
        .args(["--exact", "kills::process", "--ignored", "--nocapture"])
        .current_dir(bench.folder.path())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Collects what a process that has ended has acknowledged: the jobs and their inputs.
fn acknowledged(process: &mut Child, jobs: &mut BTreeMap<Uuid, String>) {
    process.wait().unwrap();
    for line in BufReader::new(process.stdout.take().unwrap()).lines() {
        let line = line.unwrap();
        // The test runner writes its own text before the first one.
        let Some((_, line)) = line.split_once("acknowledged ") else {
            continue;
        };
        // A line that was cut off was not heard.
        if let Some((id, input)) = line.split_once(' ')
            && input.len() == 36
        {
            jobs.insert(id.parse().unwrap(), input.to_owned());
        }
    }
}

async fn what_is_acknowledged_survives(engine: Engine) {
    let mut bench = Bench::new(engine).await;
    bench.settings = settings();
    let url = match &bench.place {
        Place::Folder(_) => "",
        Place::Shared { url, .. } => url,
    };
    std::fs::write(bench.folder.path().join(PLACE), url).unwrap();
    if let Some(s3) = &bench.s3 {
        let bucket = s3.bucket().to_string();
        std::fs::write(bench.folder.path().join(BUCKET), bucket).unwrap();
    }
    let seed = rand::random();
    println!("seed {seed}");
    let mut random = StdRng::seed_from_u64(seed);
    let mut jobs = BTreeMap::new();
    // On PostgreSQL another process always works on; only one may have a folder.
    let mut other = (engine != Engine::Sqlite).then(|| start(&bench));
    // On a busy machine a process takes few jobs before it is killed: then more are.
    let mut kills = 0;
    while kills < KILLS || (jobs.len() < FEWEST_JOBS && kills < MOST_KILLS) {
        kills += 1;
        let mut process = start(&bench);
        std::thread::sleep(Duration::from_millis(random.random_range(50..500)));
        process.kill().unwrap();
        acknowledged(&mut process, &mut jobs);
        if let Some(process) = &mut other
            && process.try_wait().unwrap().is_some()
        {
            acknowledged(process, &mut jobs);
            *process = start(&bench);
        }
    }
    let mut last = vec![start(&bench)];
    last.extend(other);
    for process in &mut last {
        acknowledged(process, &mut jobs);
    }
    assert!(jobs.len() >= FEWEST_JOBS, "only {} jobs", jobs.len());

    let store = bench.open().await;
    store.sweep(Duration::ZERO).await.unwrap();
    let mut files = 0;
    for (id, input) in &jobs {
        let job = store.get(*id).await.unwrap();
        files += job.blobs().count();
        if job.state == State::Error {
            // Killed three times in the midst of this one.
            assert_eq!(job.failure.unwrap().code, CRASHED);
            continue;
        }
        assert_eq!(job.state, State::Done);
        let mut result = String::new();
        store
            .result(*id)
            .await
            .unwrap()
            .1
            .read_to_string(&mut result)
            .await
            .unwrap();
        assert_eq!(result, input.chars().rev().collect::<String>());
    }
    // A job may be stored whose acknowledgement was not heard, and no other file.
    let counts = store.counts().await.unwrap();
    let unheard = counts.values().sum::<i64>() as usize - jobs.len();
    assert!(
        bench.files().len() <= files + 2 * unheard,
        "{counts:?} {:?}",
        bench.files()
    );
}

#[tokio::test]
async fn what_is_acknowledged_survives_on_sqlite() {
    what_is_acknowledged_survives(Engine::Sqlite).await;
}

#[tokio::test]
async fn what_is_acknowledged_survives_on_postgres() {
    what_is_acknowledged_survives(Engine::Postgres).await;
}

#[tokio::test]
async fn what_is_acknowledged_survives_on_postgres_and_s3() {
    what_is_acknowledged_survives(Engine::PostgresAndS3).await;
}
