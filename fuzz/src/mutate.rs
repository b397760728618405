//! Damage: what transfer errors, other exporters and malice do to a file.

use fastrand::Rng;

/// Numbers that code gets wrong, as text.
const NUMBERS: [&str; 20] = [
    "0",
    "-1",
    "1",
    "2",
    "3",
    "255",
    "256",
    "65536",
    "-2147483648",
    "2147483647",
    "4294967295",
    "4294967296",
    "999999999",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999",
    "1e308",
    "-1e-320",
    "NaN",
    "inf",
];
/// The same as whole numbers.
const WHOLE: [u64; 14] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    i64::MAX as u64,
    u64::MAX,
];
/// Pieces of the formats.
const WORDS: [&str; 40] = [
    "null",
    "true",
    "[]",
    "{}",
    "\"\"",
    "[",
    "{",
    "\"a\":",
    "NaN",
    "Infinity",
    "<a>",
    "</a>",
    "<body>",
    "</body>",
    "<!DOCTYPE a [<!ENTITY b \"bb\">]>",
    "&b;",
    "\0",
    "\n",
    " ",
    "-",
    "1/2/3",
    "f 1 2 3\n",
    "f -1 -2 -99\n",
    "f 1 2 3 4 5 6 7\n",
    "l 1 2\n",
    "p 1\n",
    "v 1 2\n",
    "usemtl x\n",
    "element vertex 3\n",
    "element face 99999999\n",
    "element none 18446744073709551615\n",
    "property list uchar int x\n",
    "property double x\n",
    "end_header\n",
    "format ascii 1.0\n",
    "<f8",
    "|S1",
    "(4294967296, 4294967296)",
    "../",
    "/dev/null",
];
/// No file grows beyond this.
const LARGEST: usize = 1 << 20;

/// One to four injuries.
pub fn damage(bytes: &mut Vec<u8>, rng: &mut Rng) {
    for _ in 0..rng.usize(1..=4) {
        injure(bytes, rng);
        bytes.truncate(LARGEST);
    }
}

fn injure(bytes: &mut Vec<u8>, rng: &mut Rng) {
    if bytes.is_empty() {
        bytes.extend_from_slice(rng.choice(WORDS).expect("some").as_bytes());
        return;
    }
    let n = bytes.len();
    let at = rng.usize(..n);
    let most = (n - at - 1).min(1 << rng.usize(..10));
    let range = at..(at + 1 + rng.usize(..=most)).min(n);
    match rng.usize(..12) {
        0 => bytes[at] ^= 1 << rng.u32(..8),
        1 => bytes[at] = rng.u8(..),
        2 => {
            let value = rng.choice(WHOLE).expect("some").to_le_bytes();
            let width = (1 << rng.usize(..4)).min(n - at);
            bytes[at..at + width].copy_from_slice(&value[..width]);
        }
        3 => drop(bytes.drain(range)),
        4 => {
            let piece = bytes[range].to_vec();
            let to = rng.usize(..=n);
            bytes.splice(to..to, piece);
        }
        5 => bytes.truncate(at),
        6 => {
            let word = rng.choice(WORDS).expect("some").bytes();
            let end = if rng.bool() { at } else { range.end };
            bytes.splice(at..end, word);
        }
        // A word very often: depth, width, exponential growth.
        7 if rng.usize(..8) == 0 => {
            let word = rng.choice(WORDS).expect("some").repeat(1 << rng.usize(4..16));
            bytes.splice(at..at, word.bytes());
        }
        7 => {
            let piece = bytes[range].repeat(rng.usize(2..200));
            bytes.splice(at..at, piece);
        }
        8 => {
            let piece = bytes[range.clone()].to_vec();
            let to = rng.usize(..=n - piece.len());
            bytes[to..to + piece.len()].copy_from_slice(&piece);
        }
        // Most of what our formats say are numbers as text.
        _ => number(bytes, at, rng),
    }
}

/// Puts another number in the place of the next one after `at`.
fn number(bytes: &mut Vec<u8>, at: usize, rng: &mut Rng) {
    let digit = |b: &u8| b.is_ascii_digit();
    let Some(start) = bytes[at..].iter().position(digit).map(|i| at + i) else { return };
    let start = bytes[..start].iter().rposition(|b| !digit(b)).map_or(0, |i| i + 1);
    let end = bytes[start..].iter().position(|b| !digit(b) && *b != b'.').map_or(bytes.len(), |i| start + i);
    let text = match rng.usize(..4) {
        0 => {
            let bits = rng.u32(1..40);
            rng.u64(..1 << bits).to_string()
        }
        _ => rng.choice(NUMBERS).expect("some").to_string(),
    };
    bytes.splice(start..end, text.bytes());
}
