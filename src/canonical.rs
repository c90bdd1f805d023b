//! Canonical bytes: the one encoding behind every key, seed and hash.
//!
//! Takes names, numbers and lists; gives bytes in which no two different inputs collide, because every
//! field carries a type tag and a length. A `f64` is stored as its bits after `-0.0` became `0.0`; NaN is refused.
//! Deliberately not serde: a change of a struct's derive must never silently move every key.

use std::fmt;
use std::str::FromStr;

/// A value that has no canonical encoding.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CanonicalError {
    /// NaN has many bit patterns and no meaning as a setting.
    #[error("a number to be hashed is NaN; give a finite value")]
    NotANumber,
    /// A text is not a digest.
    #[error("`{0}` is not a digest of 64 lower-case hexadecimal digits")]
    NotADigest(String),
}

/// Builder of canonical bytes.
#[derive(Debug, Clone, Default)]
pub struct Encoder {
    bytes: Vec<u8>,
}

impl Encoder {
    /// An empty encoding.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends a text: tag `s`, length, UTF-8 bytes.
    pub fn str(&mut self, text: &str) -> &mut Self {
        self.tagged(b's', text.as_bytes())
    }

    /// Appends raw bytes: tag `b`, length, bytes.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.tagged(b'b', bytes)
    }

    /// Appends an integer: tag `u`, eight little-endian bytes.
    pub fn u64(&mut self, value: u64) -> &mut Self {
        self.bytes.push(b'u');
        self.bytes.extend_from_slice(&value.to_le_bytes());
        self
    }

    /// Appends a number: tag `f`, the bits of the normalised value.
    ///
    /// # Errors
    /// [`CanonicalError::NotANumber`] for NaN.
    pub fn f64(&mut self, value: f64) -> Result<&mut Self, CanonicalError> {
        if value.is_nan() {
            return Err(CanonicalError::NotANumber);
        }
        let normal = if value == 0.0 { 0.0 } else { value };
        self.bytes.push(b'f');
        self.bytes.extend_from_slice(&normal.to_bits().to_le_bytes());
        Ok(self)
    }

    /// Opens a list of `len` items, which the caller appends next.
    pub fn list(&mut self, len: usize) -> &mut Self {
        self.bytes.push(b'l');
        self.bytes.extend_from_slice(&(len as u64).to_le_bytes());
        self
    }

    /// Appends what another encoder holds, as if its calls had been made here.
    pub fn append(&mut self, other: &Self) -> &mut Self {
        self.bytes.extend_from_slice(&other.bytes);
        self
    }

    fn tagged(&mut self, tag: u8, bytes: &[u8]) -> &mut Self {
        self.bytes.push(tag);
        self.bytes.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
        self.bytes.extend_from_slice(bytes);
        self
    }
}

/// A blake3 digest: 32 bytes, printed as 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Digest(pub [u8; 32]);

impl Digest {
    /// The digest of plain content, such as the bytes of a file.
    pub fn of_content(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// The first eight bytes as an integer, for seeds.
    pub fn to_u64(self) -> u64 {
        let mut head = [0; 8];
        head.copy_from_slice(&self.0[..8]);
        u64::from_le_bytes(head)
    }
}

/// Hashes an encoding under `context` (blake3 `derive_key`), so that equal bytes with different purposes never collide.
pub fn digest(context: &str, encoder: &Encoder) -> Digest {
    Digest(blake3::derive_key(context, &encoder.bytes))
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Digest({self})")
    }
}

impl FromStr for Digest {
    type Err = CanonicalError;

    /// Takes lower-case digits only: a digest has one text, and a damaged one is not taken for it.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let lower = !text.bytes().any(|digit| digit.is_ascii_uppercase());
        let hash = blake3::Hash::from_hex(text).ok().filter(|_| lower);
        hash.map(|hash| Self(*hash.as_bytes())).ok_or_else(|| CanonicalError::NotADigest(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(build: impl Fn(&mut Encoder)) -> Digest {
        let mut encoder = Encoder::new();
        build(&mut encoder);
        digest("test", &encoder)
    }

    #[test]
    fn moving_a_boundary_between_fields_changes_the_digest() {
        let texts = |texts: &[&str]| {
            key(|e| {
                for text in texts {
                    e.str(text);
                }
            })
        };
        assert_ne!(texts(&["ab", "c"]), texts(&["a", "bc"]));
        let bytes = key(|e| {
            e.bytes(b"a");
        });
        assert_ne!(texts(&["a"]), bytes);
        let list_first = key(|e| {
            e.list(1).u64(1);
        });
        let list_last = key(|e| {
            e.u64(1).list(1);
        });
        assert_ne!(list_first, list_last);
    }

    #[test]
    fn negative_zero_equals_zero_and_nan_is_refused() {
        let zero = |v: f64| {
            key(|e| {
                e.f64(v).unwrap();
            })
        };
        assert_eq!(zero(0.0), zero(-0.0));
        assert_eq!(Encoder::new().f64(f64::NAN).err(), Some(CanonicalError::NotANumber));
    }

    #[test]
    fn digests_print_and_parse() {
        let digest = Digest::of_content(b"sand");
        assert_eq!(digest.to_string().parse(), Ok(digest));
        assert!("sand".parse::<Digest>().is_err());
        assert!(digest.to_string().to_uppercase().parse::<Digest>().is_err(), "one digest, one text");
    }
}
