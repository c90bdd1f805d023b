//! Checkpoints: everything that the rest of a run depends on, as bytes, so that it can go on elsewhere to the same bits.
//!
//! Holds grains, springs, lists, skins, walls and the book-keeping of the run; the lists too, because their order is the
//! order in which forces are added. Random numbers are drawn while filling alone, so none are left over. Numbers are
//! stored as their bits (little endian), never as decimal text.
//!
//! ```text
//! magic line | identity: digest of physics version, layout, seed and set-up | state | digest of all before
//! ```

use super::PHYSICS_VERSION;
use super::setup::Setup;
use super::vector::{AlignedRows, Row4, Row8};
use crate::canonical::{Digest, Encoder, digest};

const MAGIC: &[u8] = b"granulake checkpoint 1\n";
/// Version of what the state holds, and in which order.
const LAYOUT: u64 = 2;
const IDENTITY_CONTEXT: &str = "granulake 2026 checkpoint identity v1";
/// Length of a digest.
const DIGEST: usize = 32;

/// A run at one time, as bytes.
///
/// ```no_run
/// # use granulake::dem::{Checkpoint, Setup, Simulation};
/// # fn example(setup: &Setup) -> Result<(), Box<dyn std::error::Error>> {
/// let mut run = Simulation::new(setup, 1)?;
/// run.step()?;
/// let bytes: Vec<u8> = run.checkpoint().as_bytes().to_vec();
/// let same_run = Simulation::resume(setup, 1, &Checkpoint::from_bytes(bytes)?)?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checkpoint {
    bytes: Vec<u8>,
}

/// Why a run cannot go on from a checkpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CheckpointError {
    /// The bytes are cut short, altered, or something else.
    #[error("this is no whole checkpoint; start the run again without it")]
    Damaged,
    /// The checkpoint was made by other settings, another seed or another version of the physics.
    #[error(
        "this checkpoint belongs to another run; repeat experiment, settings, effects and seed of the run that made it, \
         with the same version of this program"
    )]
    OtherRun,
}

impl Checkpoint {
    /// The bytes of a run with this set-up and seed.
    pub(super) fn new(setup: &Setup, seed: u64, state: impl FnOnce(&mut Vec<u8>)) -> Self {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(identity(setup, seed).0);
        state(&mut bytes);
        bytes.extend(Digest::of_content(&bytes).0);
        Self { bytes }
    }

    /// The bytes, to be kept anywhere.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// A checkpoint from its bytes.
    ///
    /// # Errors
    /// [`CheckpointError::Damaged`] for bytes that are not those of a whole checkpoint.
    pub fn from_bytes(bytes: Vec<u8>) -> Result<Self, CheckpointError> {
        let (content, seal) = bytes.split_last_chunk::<DIGEST>().ok_or(CheckpointError::Damaged)?;
        let whole = content.len() >= MAGIC.len() + DIGEST && content.starts_with(MAGIC);
        if whole && Digest::of_content(content).0 == *seal {
            return Ok(Self { bytes });
        }
        Err(CheckpointError::Damaged)
    }

    /// The stored state, if it is of a run with this set-up and seed.
    pub(super) fn state(&self, setup: &Setup, seed: u64) -> Result<&[u8], CheckpointError> {
        let content = &self.bytes[MAGIC.len()..self.bytes.len() - DIGEST];
        match content.split_first_chunk::<DIGEST>() {
            Some((found, state)) if *found == identity(setup, seed).0 => Ok(state),
            _ => Err(CheckpointError::OtherRun),
        }
    }
}

/// What a run is: physics version, seed and every number of the set-up, whose debug text gives each back exactly; and the layout
/// of its state.
fn identity(setup: &Setup, seed: u64) -> Digest {
    let mut encoder = Encoder::new();
    encoder.u64(u64::from(PHYSICS_VERSION)).u64(LAYOUT).u64(seed).str(&format!("{setup:?}"));
    digest(IDENTITY_CONTEXT, &encoder)
}

/// A value that a checkpoint holds.
pub(super) trait Stored: Sized {
    /// Appends the value.
    fn put(&self, out: &mut Vec<u8>);
    /// Takes the value off the front; `None` where the bytes are not one.
    fn take(input: &mut &[u8]) -> Option<Self>;
}

/// Implements [`Stored`] for a struct, field by field.
macro_rules! stored {
    ($type:ty { $($field:ident),+ $(,)? }) => {
        impl $crate::dem::checkpoint::Stored for $type {
            fn put(&self, out: &mut Vec<u8>) {
                $($crate::dem::checkpoint::Stored::put(&self.$field, out);)+
            }

            fn take(input: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: $crate::dem::checkpoint::Stored::take(input)?),+ })
            }
        }
    };
}
pub(super) use stored;

macro_rules! number {
    ($type:ty) => {
        impl Stored for $type {
            fn put(&self, out: &mut Vec<u8>) {
                out.extend(self.to_le_bytes());
            }

            fn take(input: &mut &[u8]) -> Option<Self> {
                let (number, rest) = input.split_first_chunk()?;
                *input = rest;
                Some(Self::from_le_bytes(*number))
            }
        }
    };
}
number!(u8);
number!(u32);
number!(u64);
number!(f64);

impl Stored for usize {
    fn put(&self, out: &mut Vec<u8>) {
        (*self as u64).put(out);
    }

    fn take(input: &mut &[u8]) -> Option<Self> {
        Self::try_from(u64::take(input)?).ok()
    }
}

impl Stored for bool {
    fn put(&self, out: &mut Vec<u8>) {
        u8::from(*self).put(out);
    }

    fn take(input: &mut &[u8]) -> Option<Self> {
        match u8::take(input)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl<T: Stored + Copy, const N: usize> Stored for [T; N] {
    fn put(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|value| value.put(out));
    }

    fn take(input: &mut &[u8]) -> Option<Self> {
        let first = T::take(input)?;
        let mut values = [first; N];
        for value in &mut values[1..] {
            *value = T::take(input)?;
        }
        Some(values)
    }
}

impl<T: Stored> Stored for Vec<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(input: &mut &[u8]) -> Option<Self> {
        let count = usize::take(input)?;
        let mut values = Self::new();
        for _ in 0..count {
            values.push(T::take(input)?);
        }
        Some(values)
    }
}

impl Stored for AlignedRows {
    fn put(&self, out: &mut Vec<u8>) {
        self.to_vec().put(out);
    }

    fn take(input: &mut &[u8]) -> Option<Self> {
        let mut rows = Self::default();
        rows.refill(Vec::take(input)?.into_iter());
        Some(rows)
    }
}

impl Stored for Row4 {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
    }

    fn take(input: &mut &[u8]) -> Option<Self> {
        Stored::take(input).map(Self)
    }
}

impl Stored for Row8 {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
    }

    fn take(input: &mut &[u8]) -> Option<Self> {
        Stored::take(input).map(Self)
    }
}
