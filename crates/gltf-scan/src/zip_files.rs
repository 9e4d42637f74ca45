//! A zip with a glTF, an OBJ or a PLY, and its files: entries are read when they are needed, and copied as they are into the mended zip.

use std::collections::BTreeMap;
use std::io::{Cursor, Read, Write};
use std::ops::Range;
use std::sync::Arc;

use bytes::Bytes;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::compressed::DecodeAllowance;
use super::error::ScanError;
use super::files::relative;
use super::patch_buffer::NewFile;
use super::zip_undo;

/// The first bytes of a zip.
pub(super) const MAGIC: &[u8] = b"PK\x03\x04";

/// The first bytes of an entry's header in the central directory.
const ENTRY_MAGIC: &[u8] = b"PK\x01\x02";
/// Names of the entries that undo mends, with a number between.
const UNDO_NAME: &str = "darn-undo-";
const UNDO_ENDING: &str = ".bin";
/// Most entries of a zip.
const MAX_ENTRIES: usize = 10_000;
/// Most bytes that a byte of an entry unpacks to: floats compress a few times, zeros a thousand times.
const MAX_RATIO: u64 = 200;
/// Entries of fewer bytes may compress as well as they like.
const SMALL_ENTRY: u64 = 1 << 20;
/// Nanoseconds of work an unpacked byte.
const BYTE_WORK: u64 = 5;

/// A zip and the entry that is the scan.
#[derive(Debug, Clone)]
pub(super) struct ZipFiles {
    /// The whole zip.
    pub bytes: Bytes,
    /// Name of the scan in it, as spelled there.
    pub main: String,
    /// Per path in the zip the number of its entry, however the name is spelled: `./a`, `b\\a`, `b//a`.
    places: Arc<BTreeMap<String, usize>>,
    /// The same bytes with their directory; a clone shares both.
    archive: ZipArchive<Cursor<Bytes>>,
}

impl ZipFiles {
    /// Finds the one glTF in a zip, or the one OBJ or PLY of a zip without glTFs.
    pub fn open(bytes: Bytes) -> Result<Self, ScanError> {
        // Before the directory is read, which takes ten times its bytes of memory.
        let headers = bytes.windows(ENTRY_MAGIC.len());
        let entries = headers.filter(|bytes| *bytes == ENTRY_MAGIC).count();
        if entries > MAX_ENTRIES {
            return Err(broken(format!(
                "it has {entries} entries, more than {MAX_ENTRIES}"
            )));
        }
        let archive = ZipArchive::new(Cursor::new(bytes.clone())).map_err(zip_error)?;
        let is_scan = |name: &&str, endings: [&str; 2]| {
            let path = relative(name).unwrap_or_default();
            let hidden = path
                .split('/')
                .any(|part| part.starts_with('.') || part == "__MACOSX");
            let lower = path.to_ascii_lowercase();
            !hidden && endings.iter().any(|ending| lower.ends_with(ending))
        };
        let named = |endings| -> Vec<&str> {
            let names = archive.file_names();
            names.filter(|name| is_scan(name, endings)).collect()
        };
        let mut scans = named([".gltf", ".glb"]);
        if scans.is_empty() {
            scans = named([".obj", ".ply"]);
        }
        scans.sort_unstable();
        let main = match scans.as_slice() {
            [main] => (*main).to_owned(),
            [] => return Err(broken("it holds no .gltf, .glb, .obj or .ply".into())),
            [a, b, ..] => {
                return Err(broken(format!(
                    "it holds {} scans ({a:?}, {b:?}); send one at a time",
                    scans.len()
                )));
            }
        };
        let places = Arc::new(places(&archive));
        Ok(Self {
            bytes,
            main,
            places,
            archive,
        })
    }

    /// The scan.
    pub fn main(&self, allowance: &DecodeAllowance<'_>) -> Result<Bytes, ScanError> {
        let main = self.named(&self.main, allowance)?;
        main.ok_or_else(|| broken(format!("{:?} is not there", self.main)))
    }

    /// The file at a path relative to the glTF.
    pub fn sibling(
        &self,
        path: &str,
        allowance: &DecodeAllowance<'_>,
    ) -> Result<Option<Bytes>, ScanError> {
        let file = self.place(path).map(|index| self.entry(index, allowance));
        file.transpose()
    }

    /// The number of the entry at a path relative to the glTF.
    pub fn place(&self, path: &str) -> Option<usize> {
        let main = relative(&self.main).unwrap_or_default();
        let folder = main.rsplit_once('/').map_or("", |(folder, _)| folder);
        let path = relative(format!("{folder}/{path}").trim_start_matches('/'))?;
        self.places.get(&path).copied()
    }

    /// The same zip with the mended glTF, a file that it refers to, if there is a new one, and an entry with which
    /// [`ZipFiles::before`] undoes that.
    pub fn with_main(&self, main: &[u8], file: Option<&NewFile>) -> Result<Vec<u8>, ScanError> {
        let number = 1 + self.undo_entries().last().map_or(0, |(number, _)| number);
        let mut mended = self.with_entries(main, |_| true)?;
        if let Some(file) = file {
            // As the glTF's own folder is spelled.
            let folder = self.main.rfind(['/', '\\']).map_or(0, |at| at + 1);
            let name = [&self.main[..folder], &file.path].concat();
            mended = with_entry(mended, &name, &file.bytes)?;
        }
        let undo = zip_undo::record(self, &ZipFiles::open(mended.clone().into())?)?;
        with_entry(mended, &format!("{UNDO_NAME}{number}{UNDO_ENDING}"), &undo)
    }

    /// The same zip with other bytes for the glTF, and without the entries that undo its mends.
    pub fn replaced(&self, main: &[u8]) -> Result<Vec<u8>, ScanError> {
        let undo: Vec<String> = self.undo_entries().map(|(_, name)| name).collect();
        self.with_entries(main, |name| !undo.iter().any(|it| it == name))
    }

    /// The zip before its last mend; `None` if it does not say so, or was changed afterwards.
    pub fn before(&self, allowance: &DecodeAllowance<'_>) -> Result<Option<Vec<u8>>, ScanError> {
        let Some((_, name)) = self.undo_entries().last() else {
            return Ok(None);
        };
        let record = self.named(&name, allowance)?;
        record.map_or(Ok(None), |record| {
            zip_undo::before(&self.bytes, &record, allowance)
        })
    }

    /// The entries that undo mends, by their numbers, the last mend last.
    fn undo_entries(&self) -> impl Iterator<Item = (u32, String)> + use<> {
        let numbered = |name: &str| {
            let digits = name.strip_prefix(UNDO_NAME)?.strip_suffix(UNDO_ENDING)?;
            Some((digits.parse().ok()?, name.to_owned()))
        };
        let mut all: Vec<(u32, String)> = self.archive.file_names().filter_map(numbered).collect();
        all.sort_unstable();
        all.into_iter()
    }

    /// The zip's bytes in the entry with this name, still compressed, as a range of `bytes`; `None` if it is not there.
    pub fn compressed(&self, name: &str) -> Result<Option<Range<usize>>, ScanError> {
        let mut archive = self.archive.clone();
        let Some(index) = archive.index_for_name(name) else {
            return Ok(None);
        };
        let entry = archive.by_index_raw(index).map_err(zip_error)?;
        let start = entry.data_start().and_then(|it| usize::try_from(it).ok());
        let length = usize::try_from(entry.compressed_size()).ok();
        let range = start
            .zip(length)
            .and_then(|(start, length)| Some(start..start.checked_add(length)?));
        Ok(range.filter(|range| range.end <= self.bytes.len()))
    }

    /// The names of all entries.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.archive.file_names()
    }

    /// The zip with other bytes for the glTF; of the other entries those that are kept have their compressed bytes.
    fn with_entries(
        &self,
        main: &[u8],
        keeps: impl Fn(&str) -> bool,
    ) -> Result<Vec<u8>, ScanError> {
        let mut archive = self.archive.clone();
        let mut out = ZipWriter::new(Cursor::new(Vec::with_capacity(self.bytes.len())));
        for index in 0..archive.len() {
            let entry = archive.by_index_raw(index).map_err(zip_error)?;
            if !keeps(entry.name()) {
                continue;
            }
            if entry.name() != self.main {
                out.raw_copy_file(entry).map_err(zip_error)?;
                continue;
            }
            let method = match entry.compression() {
                CompressionMethod::Stored => CompressionMethod::Stored,
                _ => CompressionMethod::Deflated,
            };
            let options = SimpleFileOptions::default()
                .compression_method(method)
                .last_modified_time(entry.last_modified().unwrap_or_default())
                .large_file(u32::try_from(main.len()).is_err());
            drop(entry);
            out.start_file(&self.main, options).map_err(zip_error)?;
            out.write_all(main)
                .map_err(|error| broken(error.to_string()))?;
        }
        out.set_raw_comment(self.archive.comment().into());
        Ok(out.finish().map_err(zip_error)?.into_inner())
    }

    /// The entry with this name, exactly.
    fn named(
        &self,
        name: &str,
        allowance: &DecodeAllowance<'_>,
    ) -> Result<Option<Bytes>, ScanError> {
        let index = self.archive.index_for_name(name);
        index.map(|index| self.entry(index, allowance)).transpose()
    }

    fn entry(&self, index: usize, allowance: &DecodeAllowance<'_>) -> Result<Bytes, ScanError> {
        let mut archive = self.archive.clone();
        let entry = archive.by_index(index).map_err(zip_error)?;
        let name = entry.name().to_owned();
        let (size, packed) = (entry.size(), entry.compressed_size());
        if size > SMALL_ENTRY && size / MAX_RATIO > packed {
            return Err(broken(format!(
                "{name:?} unpacks from {packed} to {size} bytes, more than {MAX_RATIO} times as many"
            )));
        }
        let length = usize::try_from(size).unwrap_or(usize::MAX);
        allowance.take(length, "")?;
        allowance
            .budget
            .spend_at_once(BYTE_WORK.saturating_mul(size))?;
        let mut bytes = Vec::new();
        // The declared size is only a claim: never more than it is read.
        let read = entry.take(size.saturating_add(1)).read_to_end(&mut bytes);
        read.map_err(|error| broken(format!("{name:?}: {error}")))?;
        if bytes.len() != length {
            return Err(broken(format!("{name:?} is not as long as the zip says")));
        }
        Ok(bytes.into())
    }
}

/// A zip with one more entry.
fn with_entry(zip: Vec<u8>, name: &str, bytes: &[u8]) -> Result<Vec<u8>, ScanError> {
    let mut out = ZipWriter::new_append(Cursor::new(zip)).map_err(zip_error)?;
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(u32::try_from(bytes.len()).is_err());
    out.start_file(name, options).map_err(zip_error)?;
    let written = out.write_all(bytes);
    written.map_err(|error| broken(error.to_string()))?;
    Ok(out.finish().map_err(zip_error)?.into_inner())
}

/// The entries by their paths. Of several at one path the one counts that is spelled as the path is, else the first.
fn places(archive: &ZipArchive<Cursor<Bytes>>) -> BTreeMap<String, usize> {
    let mut places = BTreeMap::new();
    for (index, name) in archive.file_names().enumerate() {
        match relative(name) {
            Some(path) if path == name => {
                places.insert(path, index);
            }
            Some(path) => {
                places.entry(path).or_insert(index);
            }
            None => {}
        }
    }
    places
}

fn zip_error(error: ZipError) -> ScanError {
    broken(error.to_string())
}

pub(super) fn broken(detail: String) -> ScanError {
    ScanError::Container {
        offset: 0,
        detail: format!("the zip: {detail}"),
    }
}
