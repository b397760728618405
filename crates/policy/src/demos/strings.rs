//! Makes string attributes what the HDF5 library itself writes.
//!
//! A string of any length has the datatype "variable length" with a base type. The library's base
//! is an unsigned byte; rust-hdf5 0.7 writes a string of one character. h5py 3 reads both, but
//! `H5Aread` into the library's own string type, and with it C, C++ and older h5py, refuses the
//! second: there is no conversion from characters to bytes.
//!
//! The right type is four bytes longer. So an attribute is first written under a name with four
//! bytes more, which give their room to the type afterwards; nothing else in the file moves.
//! Source: HDF5 file format specification 3.0, IV.A.1.b (object header, version 2), IV.A.2.d
//! (datatype message), IV.A.2.m (attribute message, version 3), IV.A.2.q (continuation).

use rust_hdf5::format::checksum::checksum_metadata;
use std::fs::File;
use std::io::{Error, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Ends the names of string attributes until [`settle`] has been there: four bytes.
pub(super) const ROOM: &str = "+str";

/// Class 9 (variable length) version 1, kind string, ends with a zero, UTF-8, 16 bytes (length,
/// address and index in the heap); base class 0 (whole number) version 1, one byte of 8 bits.
const STRING: [u8; 20] = [0x19, 1, 1, 0, 16, 0, 0, 0, 0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0];
/// Bytes of the datatype that rust-hdf5 writes.
const SHORT: usize = 16;
/// Bytes of an attribute message (version 3) before the name.
const HEAD: usize = 9;
/// Numbers of the messages that hold an attribute, and where the header goes on.
const ATTRIBUTE: u8 = 0x0c;
const CONTINUATION: u8 = 0x10;

/// Gives the string attributes of a closed file their names and the library's datatype. `expected`
/// is how many there are: fewer would mean a layout that this does not know.
pub(super) fn settle(path: &Path, expected: usize) -> Result<(), Error> {
    let mut file = File::options().read(true).write(true).open(path)?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    let (mut settled, mut at) = (0, 0);
    while let Some(next) = bytes[at..].windows(4).position(|w| w == b"OHDR") {
        at += next;
        // The letters may stand in somebody's numbers; a checksum that fits does not.
        let Some(first) = first_chunk(&bytes, at) else {
            at += 4;
            continue;
        };
        // By flag a message has two bytes more: when it was made.
        let prefix = if bytes[at + 5] >> 2 & 1 == 1 { 6 } else { 4 };
        at = first.end + 4;
        let mut chunks = vec![first];
        while let Some(chunk) = chunks.pop() {
            let (changed, more) = rewrite(&mut bytes[chunk.messages..chunk.end], prefix);
            chunks.extend(more.into_iter().filter_map(|(start, size)| next_chunk(&bytes, start, size)));
            if changed > 0 {
                let sum = checksum_metadata(&bytes[chunk.start..chunk.end]);
                bytes[chunk.end..chunk.end + 4].copy_from_slice(&sum.to_le_bytes());
                file.seek(SeekFrom::Start(chunk.start as u64))?;
                file.write_all(&bytes[chunk.start..chunk.end + 4])?;
                settled += changed;
            }
        }
    }
    if settled != expected {
        return Err(Error::other(format!("{settled} string attributes in the file, {expected} were written")));
    }
    Ok(())
}

/// A piece of an object header: where it starts, where its messages do, and where its checksum is.
struct Chunk {
    start: usize,
    messages: usize,
    end: usize,
}

impl Chunk {
    /// `None` where the checksum does not fit.
    fn checked(self, bytes: &[u8]) -> Option<Self> {
        let sum = bytes.get(self.end..self.end.checked_add(4)?)?;
        (checksum_metadata(&bytes[self.start..self.end]).to_le_bytes() == sum).then_some(self)
    }
}

/// The object header (version 2) at `start`; `None` when there is none.
fn first_chunk(bytes: &[u8], start: usize) -> Option<Chunk> {
    let (version, flags) = (*bytes.get(start + 4)?, *bytes.get(start + 5)?);
    if version != 2 {
        return None;
    }
    // Four times, and two limits of attribute storage, are there by flag.
    let at = start + 6 + 16 * usize::from(flags >> 5 & 1) + 4 * usize::from(flags >> 4 & 1);
    let width = 1 << (flags & 3);
    let mut size = [0; 8];
    size[..width].copy_from_slice(bytes.get(at..at + width)?);
    let messages = at + width;
    let end = messages.checked_add(usize::try_from(u64::from_le_bytes(size)).ok()?)?;
    Chunk { start, messages, end }.checked(bytes)
}

/// Where a header goes on: signature, messages, checksum.
fn next_chunk(bytes: &[u8], start: usize, size: usize) -> Option<Chunk> {
    let (messages, end) = (start.checked_add(4)?, start.checked_add(size)?.checked_sub(4)?);
    (bytes.get(start..messages)? == b"OCHK").then_some(())?;
    Chunk { start, messages, end }.checked(bytes)
}

/// Rewrites the marked attributes among these messages: how many there were, and address and size
/// of the chunks in which the header goes on. Before each message: kind, size (2 bytes), flags.
fn rewrite(messages: &mut [u8], prefix: usize) -> (usize, Vec<(usize, usize)>) {
    let (mut at, mut changed, mut more) = (0, 0, Vec::new());
    while at + prefix <= messages.len() {
        let kind = messages[at];
        let size = usize::from(u16::from_le_bytes([messages[at + 1], messages[at + 2]]));
        at += prefix;
        let Some(message) = messages.get_mut(at..at + size) else {
            break;
        };
        at += size;
        match kind {
            ATTRIBUTE => changed += usize::from(attribute(message).is_some()),
            CONTINUATION if size == 16 => {
                let number = |k: usize| u64::from_le_bytes(message[k..k + 8].try_into().expect("eight bytes")) as usize;
                more.push((number(0), number(8)));
            }
            _ => {}
        }
    }
    (changed, more)
}

/// version, flags, sizes of name, datatype and dataspace, character set; name, datatype, ...
fn attribute(message: &mut [u8]) -> Option<()> {
    if message.len() < HEAD {
        return None;
    }
    let sizes = [2, 4].map(|k| usize::from(u16::from_le_bytes([message[k], message[k + 1]])));
    let [name, datatype] = sizes;
    let marked = message.get(HEAD..HEAD + name)?.strip_suffix(b"\0")?.ends_with(ROOM.as_bytes());
    if message[0] != 3 || datatype != SHORT || !marked {
        return None;
    }
    let short = name - ROOM.len();
    message[2..4].copy_from_slice(&(short as u16).to_le_bytes());
    message[4..6].copy_from_slice(&(STRING.len() as u16).to_le_bytes());
    message[HEAD + short - 1] = 0;
    message[HEAD + short..HEAD + short + STRING.len()].copy_from_slice(&STRING);
    Some(())
}
