//! FNV-1a, 64 bits: stable between releases and machines, unlike the standard library's hashers.

/// A running hash.
#[derive(Debug, Clone)]
pub struct Fnv(u64);

impl Fnv {
    /// The offset basis.
    #[allow(clippy::new_without_default)] // a hash without input has no use
    pub fn new() -> Self {
        Fnv(0xcbf2_9ce4_8422_2325)
    }

    /// Adds bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// Adds a number.
    pub fn number(&mut self, number: u64) {
        self.bytes(&number.to_le_bytes());
    }

    /// Adds a text and its length, so that "a","bc" and "ab","c" differ.
    pub fn text(&mut self, text: &str) {
        self.number(text.len() as u64);
        self.bytes(text.as_bytes());
    }

    /// The hash of what was added.
    pub fn value(&self) -> u64 {
        self.0
    }
}

#[cfg(all(test, not(simulated)))]
mod tests {
    use super::Fnv;

    #[test]
    fn hash_of_a_is_the_published_one() {
        let mut hash = Fnv::new();
        hash.bytes(b"a");
        assert_eq!(hash.value(), 0xaf63_dc4c_8601_ec8c); // Fowler, Noll, Vo: test vectors
    }
}
