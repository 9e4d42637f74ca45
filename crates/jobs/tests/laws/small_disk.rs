//! A small disk: a file system of a few megabytes, in a mount namespace of its own, which nobody else sees.

use std::{io::Write as _, path::Path, process::Command};

/// Mounts the disk (`$1`, of the size `$2`) and goes on as the program that follows.
const MOUNT: &str = r#"mount -t tmpfs -o "size=$2" darn-small-disk "$1" && shift 2 && exec "$@""#;

/// How a namespace is made in which a file system can be mounted: by anybody, or by root where others may not.
const NAMESPACES: [&[&str]; 2] = [&["--user", "--map-root-user", "--mount"], &["--mount"]];

/// A program for which a disk of this size (such as `24m`) is mounted on a folder; `None` where this system lets nobody mount, as containers may. The
/// test has nothing to look at then, and that is said past the test harness, which would show it with failed tests alone.
pub fn on_small_disk(folder: &Path, size: &str, program: &Path) -> Option<Command> {
    let mounting = |namespace: &[&str], program: &Path| {
        let mut command = Command::new("unshare");
        command.args(namespace).args(["sh", "-c", MOUNT, "sh"]);
        command.arg(folder).arg(size).arg(program);
        command
    };
    let may_mount = |namespace: &&&[&str]| {
        let trial = mounting(namespace, Path::new("true")).output();
        trial.is_ok_and(|ran| ran.status.success())
    };
    let namespace = NAMESPACES.iter().find(may_mount);
    if namespace.is_none() {
        let said = "SKIPPED: a full disk was not looked at, since this system lets nobody mount a file system";
        writeln!(std::io::stderr(), "{said}").ok();
    }
    namespace.map(|namespace| mounting(namespace, program))
}
