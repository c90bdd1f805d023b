//! Folding and compacting: many files to few, in an order of steps that a crash cannot tear.
//!
//! New part, then the manifest that lists it, then the old files. Before the manifest is renamed the new part is an
//! unlisted leftover; after that the old files are.

use super::layout::{Files, Manifest, Part};
use super::state::{Block, Source, State};
use super::{Ledger, empty};
use crate::canonical::Digest;
use crate::store::{StoreError, atomic};
use crate::tables::{Keyed, io};
use std::collections::BTreeSet;

/// Number of journal files at which they are folded into a part: opening a ledger stays fast after a kill, and the
/// parts written before are not written again.
pub const FOLD_AT: usize = 256;

/// Number of keys up to which a part is merged with whatever comes after it.
pub const SMALL: usize = 1 << 16;
/// A larger part is merged once what has come after it times this is as much.
const SHARE: usize = 4;

impl<R: Keyed> Ledger<R> {
    /// Merges everything into one part, sorted by key. Its bytes depend on the rows alone. A part of more than [`SMALL`]
    /// keys is left as it is until a quarter as many have come after it, so that few rows more are few rows to write;
    /// which parts there are depends then on which compactions came before. Does nothing when there is nothing to merge.
    ///
    /// # Errors
    /// [`StoreError::Busy`], [`StoreError::Io`] or [`StoreError::Table`]; no row is lost then.
    pub fn compact(&self) -> Result<(), StoreError> {
        if self.is_compact() {
            return Ok(());
        }
        let _turn = self.take_turn()?;
        let chosen = to_merge(&self.read());
        self.merge(&chosen)?;
        // With no journal left its numbers start again, so that the files tell nothing of how the rows came in.
        let manifest = Manifest::new(0, self.read().manifest.parts.clone());
        manifest.publish(&self.folder)?;
        let mut state = self.write();
        (state.sequence, state.untidy, state.manifest) = (0, false, manifest);
        Ok(())
    }

    /// Merges the journal into one more part. The caller has the turn.
    pub(super) fn fold(&self) -> Result<(), StoreError> {
        let chosen = self.read().blocks.iter().filter(|(_, block)| block.is_journal()).map(|(at, _)| *at).collect();
        self.merge(&chosen)
    }

    fn is_compact(&self) -> bool {
        let state = self.read();
        !state.untidy && state.journal_length() == 0 && to_merge(&state).len() <= 1
    }

    fn merge(&self, chosen: &BTreeSet<u64>) -> Result<(), StoreError> {
        let (batch, spans) = self.read().gather(empty::<R>()?, |block| chosen.contains(&block))?;
        let part = match spans.len() {
            0 => None,
            keys => Some(self.write_part(&io::encode(R::SPEC, &batch)?, keys, batch.num_rows())?),
        };
        let manifest = self.manifest_without(chosen, part.clone());
        manifest.publish(&self.folder)?;
        let mut state = self.write();
        state.blocks.retain(|at, _| !chosen.contains(at));
        if let Some(part) = part {
            state.add(Block::held(R::SPEC, &batch, Source::Part(part), spans.len()), &spans);
        }
        state.manifest = manifest;
        drop(state);
        self.remove_leftovers()
    }

    fn write_part(&self, bytes: &[u8], keys: usize, rows: usize) -> Result<Part, StoreError> {
        let part = Part::new(Digest::of_content(bytes), bytes.len() as u64, rows as u64, keys as u64);
        atomic::publish(&self.folder.join(part.file_name()), bytes)?;
        Ok(part)
    }

    /// The manifest once the chosen blocks have gone into `part`.
    fn manifest_without(&self, chosen: &BTreeSet<u64>, part: Option<Part>) -> Manifest {
        let state = self.read();
        let kept = state.blocks.iter().filter(|(at, _)| !chosen.contains(at));
        let kept = kept.filter_map(|(_, block)| match &block.source {
            Source::Part(part) => Some(part.clone()),
            Source::Journal => None,
        });
        Manifest::new(state.sequence, kept.chain(part).collect())
    }

    fn remove_leftovers(&self) -> Result<(), StoreError> {
        let leftovers = Files::list(&self.folder)?.leftovers(&self.read().manifest);
        leftovers.iter().try_for_each(|path| atomic::remove(path))?;
        // A journal file that came back after a power cut would override newer rows.
        let mut folders = leftovers.iter().filter_map(|path| path.parent()).collect::<Vec<_>>();
        folders.dedup();
        folders.into_iter().try_for_each(atomic::sync_folder)
    }
}

/// The blocks that go into one part: all from the last large one on.
fn to_merge(state: &State) -> BTreeSet<u64> {
    let mut chosen = BTreeSet::new();
    let mut keys = 0;
    for (number, block) in state.blocks.iter().rev() {
        if !block.is_journal() && block.keys > SMALL.max(SHARE * keys) {
            break;
        }
        chosen.insert(*number);
        keys += block.keys;
    }
    chosen
}
