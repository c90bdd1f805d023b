//! pipeline.lock: which key produced which output, stage by stage.
//!
//! Sorted TOML beside the study, committed with it and readable in a diff. Holds for every stage its key, version,
//! settings as text (so that `why` can name the old and the new value), the digests it read and the files it wrote.
//! Deliberately without times, hosts and machine paths.

use super::{StoreError, atomic};
use crate::canonical::Digest;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

/// Version of the file format.
const VERSION: u32 = 1;
const HEAD: &str = "# Written by granulake; commit it beside the study. It names what every stage read and wrote.\n";

/// The content of a lock file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Lock {
    /// The stages that have run, by name.
    pub stages: BTreeMap<String, StageLock>,
}

/// What a stage did when it last ran.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageLock {
    /// Key of the stage: version, settings and inputs.
    #[serde(with = "digest_text")]
    pub key: Digest,
    /// Version of the stage.
    pub version: u32,
    /// Settings as text, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub settings: BTreeMap<String, String>,
    /// Digests of what it read, by path or name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", with = "digest_map")]
    pub inputs: BTreeMap<String, Digest>,
    /// What it wrote, by path relative to the artifacts directory with `/` between folders.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub outputs: BTreeMap<String, Output>,
}

/// A file a stage wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Digest of its bytes.
    #[serde(with = "digest_text")]
    pub digest: Digest,
    /// Its size.
    pub bytes: u64,
    /// Its rows, when it is a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<u64>,
}

/// A setting that differs between two versions of a stage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// Name of the setting.
    pub name: String,
    /// Value in the lock, if there was one.
    pub old: Option<String>,
    /// Value now, if there is one.
    pub new: Option<String>,
}

impl StageLock {
    /// The settings that are not as they were, by name.
    pub fn changes(&self, now: &BTreeMap<String, String>) -> Vec<Change> {
        let mut names: Vec<&String> = self.settings.keys().chain(now.keys()).collect();
        names.sort();
        names.dedup();
        let change = |name: &String| Change {
            name: name.clone(),
            old: self.settings.get(name).cloned(),
            new: now.get(name).cloned(),
        };
        names.into_iter().map(change).filter(|change| change.old != change.new).collect()
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    version: u32,
    #[serde(default)]
    stage: BTreeMap<String, StageLock>,
}

/// Only the version, so that a file of a later version is called that and not full of unknown keys.
#[derive(Deserialize)]
struct Versioned {
    version: u32,
}

impl Lock {
    /// Reads a lock file; one that does not exist is empty.
    ///
    /// # Errors
    /// [`StoreError::BadLock`] naming file, line and remedy; [`StoreError::Io`].
    pub fn read(path: &Path) -> Result<Self, StoreError> {
        let bytes = match std::fs::read(path) {
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Self::default()),
            bytes => bytes.map_err(StoreError::io("read", path))?,
        };
        let text = String::from_utf8(bytes).map_err(|e| e.to_string());
        text.and_then(|text| Self::parse(&text)).map_err(|detail| StoreError::BadLock { path: path.to_owned(), detail })
    }

    /// Reads the text of a lock file.
    ///
    /// # Errors
    /// What is wrong and where.
    pub fn parse(text: &str) -> Result<Self, String> {
        let message = |e: toml::de::Error| e.to_string().trim_end().to_owned();
        let Versioned { version } = toml::from_str(text).map_err(message)?;
        if version != VERSION {
            return Err(format!("lock version {version}, this program reads {VERSION}"));
        }
        let file: File = toml::from_str(text).map_err(message)?;
        Ok(Self { stages: file.stage })
    }

    /// The text of the lock file: sorted, the same for the same content, with the digest of what follows at its head.
    ///
    /// # Errors
    /// What the writer said.
    pub fn to_text(&self) -> Result<String, String> {
        let file = File { version: VERSION, stage: self.stages.clone() };
        let body = toml::to_string(&file).map_err(|e| e.to_string())?;
        Ok(format!("{HEAD}# blake3 of what follows: {}\n\n{body}", Digest::of_content(body.as_bytes())))
    }

    /// Whether the file at `path`, from which this was read, is as it was written: not damaged, merged or edited since.
    ///
    /// # Errors
    /// [`StoreError::BadLock`].
    pub fn is_as_written(&self, path: &Path) -> Result<bool, StoreError> {
        let text = self.text_for(path)?;
        Ok(std::fs::read(path).is_ok_and(|found| found == text.as_bytes()))
    }

    /// Publishes the lock file; one that says the same already is left alone.
    ///
    /// # Errors
    /// [`StoreError::Io`] or [`StoreError::BadLock`].
    pub fn write(&self, path: &Path) -> Result<(), StoreError> {
        if self.is_as_written(path)? {
            return Ok(());
        }
        atomic::publish(path, self.text_for(path)?.as_bytes())
    }

    fn text_for(&self, path: &Path) -> Result<String, StoreError> {
        self.to_text().map_err(|detail| StoreError::BadLock { path: path.to_owned(), detail })
    }

    /// Every output of every stage: stage, path relative to the artifacts directory, output.
    pub fn outputs(&self) -> impl Iterator<Item = (&str, &str, &Output)> {
        let stages = self.stages.iter();
        stages.flat_map(|(stage, lock)| {
            lock.outputs.iter().map(move |(path, output)| (stage.as_str(), path.as_str(), output))
        })
    }
}

/// A digest as 64 hexadecimal digits.
mod digest_text {
    use super::Digest;
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub fn serialize<S: Serializer>(digest: &Digest, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(digest)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Digest, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}

/// Digests by name.
mod digest_map {
    use super::{BTreeMap, Digest};
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub fn serialize<S: Serializer>(map: &BTreeMap<String, Digest>, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(map.iter().map(|(name, digest)| (name, digest.to_string())))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, Digest>, D::Error> {
        let texts = BTreeMap::<String, String>::deserialize(deserializer)?;
        let parse = |(name, text): (String, String)| Ok((name, text.parse().map_err(D::Error::custom)?));
        texts.into_iter().map(parse).collect()
    }
}
