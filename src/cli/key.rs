//! `darn key`: keys for `darn serve --keys`.

use super::failure::{Failure, OrFail};
use darn_serve::{EntryDigest, Expiry, KeyEntry, KeyId, Scope, Secret};
use rand::TryRngCore;
use rand::rngs::OsRng;

#[derive(Debug, clap::Args)]
pub struct KeyArgs {
    #[command(subcommand)]
    command: KeyCommand,
}

#[derive(Debug, clap::Subcommand)]
enum KeyCommand {
    /// Make a key: prints its secret, then its entry for the file of keys
    New(NewArgs),
}

#[derive(Debug, clap::Args)]
struct NewArgs {
    /// Its name, of letters, digits, `-` and `_`. Its jobs and its lines in the log have it
    #[arg(long, value_name = "NAME")]
    id: KeyId,
    /// What it may do, with commas between
    #[arg(long, value_name = "SCOPE", value_delimiter = ',', default_values_t = [Scope::Mend, Scope::Jobs])]
    scopes: Vec<Scope>,
    /// From when on it is refused, such as 2027-01-01T00:00:00Z; left out, never
    #[arg(long, value_name = "TIME")]
    expires: Option<Expiry>,
}

/// Runs `darn key`.
pub fn run(args: &KeyArgs) -> Result<(), Failure> {
    let KeyCommand::New(new) = &args.command;
    let mut random = [0; 32];
    OsRng
        .try_fill_bytes(&mut random)
        .or_fail("get random bytes from the system")?;
    let secret = Secret::of(random);
    let entry = KeyEntry {
        id: new.id.clone(),
        sha256: EntryDigest(secret.digest()),
        scopes: new.scopes.clone(),
        limits: None,
        webhook_secrets: Default::default(),
        expires: new.expires,
    };
    let entry = serde_json::to_string(&entry).or_fail("write the key's entry")?;
    println!("{}\n{entry}", secret.text());
    // Not on standard output, so that a script reads two lines there.
    darn_serve::write_to_stderr(&format!(
        "The first line is the secret. It is kept nowhere: give it to the client, who sends `Authorization: Bearer` and the secret.\n\
         The second line goes into the list `keys` of the file that the service reads (darn serve --keys FILE):\n\
         {{\"keys\": [{{\"id\": \"{}\", …}}]}}. A running service reads the file again within a second or two.",
        new.id
    ));
    Ok(())
}
