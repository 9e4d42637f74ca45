//! A server for tests that speaks S3 on a socket of its own and checks signatures; its objects are files in a folder.

use std::{
    net::{SocketAddr, TcpListener},
    path::{Path, PathBuf},
    pin::Pin,
    thread::JoinHandle,
};

use darn_jobs::blobs::Bucket;
use hyper::server::conn::http1;
use hyper_util::rt::TokioIo;
use s3s::{
    S3Result,
    access::{S3Access, S3AccessContext},
    auth::SimpleAuth,
    s3_error,
    service::S3ServiceBuilder,
};
use s3s_fs::FileSystem;
use tokio::sync::oneshot;

/// The bucket that is there.
pub const BUCKET: &str = "scans";
/// What the names of the jobs' files begin with in it.
pub const PREFIX: &str = "museum/darn";

pub const KEY: &str = "AKIDFORTESTS";
pub const SECRET: &str = "secret-for-tests";

/// A server that runs until this is dropped.
pub struct S3 {
    address: SocketAddr,
    root: PathBuf,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl S3 {
    /// Starts a server with one bucket, in a folder.
    pub fn start(root: PathBuf) -> Self {
        std::fs::create_dir_all(root.join(BUCKET)).unwrap();
        let mut server = Self {
            address: ([127, 0, 0, 1], 0).into(),
            root,
            stop: None,
            thread: None,
        };
        server.go_on();
        server
    }

    /// Breaks all connections and takes no more.
    pub fn stop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }

    /// Serves, at the same address as before.
    pub fn go_on(&mut self) {
        let listener = TcpListener::bind(self.address).unwrap();
        listener.set_nonblocking(true).unwrap();
        self.address = listener.local_addr().unwrap();
        let (stop, stopped) = oneshot::channel();
        let root = self.root.clone();
        self.stop = Some(stop);
        self.thread = Some(std::thread::spawn(move || serve(listener, &root, stopped)));
    }

    /// The bucket, with all that is needed to reach it.
    pub fn bucket(&self) -> Bucket {
        let bucket: Bucket = format!("s3://{BUCKET}/{PREFIX}").parse().unwrap();
        bucket.with_settings(self.settings())
    }

    /// The variables with which a client finds the server.
    pub fn settings(&self) -> [(String, String); 4] {
        let url = format!("http://{}", self.address);
        [
            ("AWS_ENDPOINT_URL", url.as_str()),
            ("AWS_ALLOW_HTTP", "true"),
            ("AWS_ACCESS_KEY_ID", KEY),
            ("AWS_SECRET_ACCESS_KEY", SECRET),
        ]
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
    }

    /// Where the objects are whose names begin with the prefix.
    pub fn objects(&self) -> PathBuf {
        self.root.join(BUCKET).join(PREFIX)
    }

    /// Uploads that are neither completed nor aborted, and their parts.
    pub fn unfinished(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.root).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.starts_with(".upload")).collect()
    }
}

impl Drop for S3 {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Refuses what is not signed, and what concerns another bucket, which the server would make.
struct Buckets(PathBuf);

impl S3Access for Buckets {
    fn check<'this, 'context, 'inner, 'answer>(
        &'this self,
        request: &'context mut S3AccessContext<'inner>,
    ) -> Pin<Box<dyn Future<Output = S3Result<()>> + Send + 'answer>>
    where
        Self: 'answer,
        'this: 'answer,
        'context: 'answer,
        'inner: 'answer,
    {
        Box::pin(async move {
            let bucket = request.s3_path().get_bucket_name().unwrap_or_default();
            if request.credentials().is_none() {
                return Err(s3_error!(AccessDenied, "Not signed."));
            }
            match self.0.join(bucket).is_dir() {
                true => Ok(()),
                false => Err(s3_error!(NoSuchBucket, "There is no such bucket.")),
            }
        })
    }
}

fn serve(listener: TcpListener, root: &Path, stopped: oneshot::Receiver<()>) {
    let mut service = S3ServiceBuilder::new(FileSystem::new(root).unwrap());
    service.set_auth(SimpleAuth::from_single(KEY, SECRET));
    service.set_access(Buckets(root.to_owned()));
    let service = service.build();
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    let accept = async {
        let listener = tokio::net::TcpListener::from_std(listener).unwrap();
        loop {
            let (socket, _) = listener.accept().await.unwrap();
            let service = service.clone();
            tokio::spawn(async move {
                let http = http1::Builder::new();
                // Clients go away.
                let _ = http.serve_connection(TokioIo::new(socket), service).await;
            });
        }
    };
    runtime.block_on(async {
        tokio::select! {
            _ = stopped => {}
            () = accept => {}
        }
    });
    // Ends the connections with it.
    runtime.shutdown_background();
}
