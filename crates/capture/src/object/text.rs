//! Object files as text: URDF, MJCF and COLLADA are XML, and XML may be in other encodings than
//! UTF-8.

use crate::CaptureError;
use std::path::Path;

/// The text of an XML file: UTF-8, UTF-16 with its mark, or ISO-8859-1 that says so.
///
/// # Errors
/// When the file cannot be read, or is in an encoding that is not read.
pub(super) fn read(file: &Path) -> Result<String, CaptureError> {
    let bytes = std::fs::read(file).map_err(|e| CaptureError::read(file, e))?;
    decode(bytes, file)
}

pub(super) fn decode(bytes: Vec<u8>, file: &Path) -> Result<String, CaptureError> {
    let refused = |what: String, hint: &str| CaptureError::new(what, file.display().to_string(), hint);
    if let Some(wide) = utf16(&bytes) {
        return wide.map_err(|()| refused("the file is not the UTF-16 that it begins as".into(), "save it as UTF-8"));
    }
    let named = declared(&bytes).unwrap_or_else(|| "UTF-8".into());
    match named.to_ascii_uppercase().replace('_', "-").as_str() {
        // Every byte of ISO-8859-1 is the character of that number.
        "ISO-8859-1" | "ISO8859-1" | "LATIN1" | "LATIN-1" | "L1" => Ok(bytes.into_iter().map(char::from).collect()),
        "UTF-8" | "UTF8" | "US-ASCII" | "ASCII" => {
            let text = String::from_utf8(bytes).map_err(|e| {
                let hint = "save it as UTF-8, or let its first line say the encoding that it has";
                refused(format!("the file says {named} and is not: {e}"), hint)
            })?;
            Ok(text.strip_prefix('\u{feff}').map(String::from).unwrap_or(text))
        }
        _ => Err(refused(format!("the file is in the encoding {named}, which is not read"), "save it as UTF-8")),
    }
}

/// UTF-16 that begins with its byte order mark, or with `<` in two bytes.
fn utf16(bytes: &[u8]) -> Option<Result<String, ()>> {
    let (low_first, skip) = match bytes {
        [0xff, 0xfe, ..] => (true, 2),
        [0xfe, 0xff, ..] => (false, 2),
        [b'<', 0, ..] => (true, 0),
        [0, b'<', ..] => (false, 0),
        _ => return None,
    };
    let (pairs, rest) = bytes[skip..].as_chunks::<2>();
    let units = pairs.iter().map(|p| if low_first { u16::from_le_bytes(*p) } else { u16::from_be_bytes(*p) });
    let text: Result<String, ()> = char::decode_utf16(units).map(|c| c.map_err(|_| ())).collect();
    Some(if rest.is_empty() { text } else { Err(()) })
}

/// What `<?xml ... encoding="..."?>` says.
fn declared(bytes: &[u8]) -> Option<String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).strip_prefix(b"<?xml")?;
    let end = bytes.windows(2).position(|w| w == b"?>")?;
    let line = String::from_utf8_lossy(&bytes[..end]);
    let (_, value) = line.split_once("encoding")?;
    let value = value.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| ['"', '\''].contains(c))?;
    value[1..].split(quote).next().map(String::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(bytes: &[u8]) -> Result<String, String> {
        decode(bytes.to_vec(), Path::new("a.urdf")).map_err(|e| e.to_string())
    }

    /// Files that say ISO-8859-1 were refused with "check the path and its rights".
    #[test]
    fn encodings_are_read_or_named() {
        let latin = b"<?xml version='1.0' encoding='iso-8859-1'?><a b='Schr\xe4nkchen'/>";
        assert!(decoded(latin).unwrap().contains("Schränkchen"));
        assert_eq!(decoded("\u{feff}<a b='ä'/>".as_bytes()).unwrap(), "<a b='ä'/>");
        for big in [false, true] {
            let bytes = |u: u16| if big { u.to_be_bytes() } else { u.to_le_bytes() };
            for text in ["\u{feff}<a b='ä'/>", "<a b='ä'/>"] {
                let wide: Vec<u8> = text.encode_utf16().flat_map(bytes).collect();
                assert_eq!(decoded(&wide).unwrap(), "<a b='ä'/>");
            }
        }
        let error = decoded(b"<?xml version=\"1.0\" encoding=\"KOI8-R\"?><a/>").unwrap_err();
        assert!(error.contains("KOI8-R") && error.contains("save it as UTF-8"), "{error}");
        assert!(decoded(b"<a b='\xe4'/>").unwrap_err().contains("says UTF-8 and is not"));
        assert!(decoded(b"\xff\xfe<\0a").is_err());
        for cut in 0..latin.len() {
            let _ = decoded(&latin[..cut]);
        }
    }
}
