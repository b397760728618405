//! A hash that changes when the recording does: stages compare it with their stamp to know whether to run again.

use super::{Recording, transforms};
use crate::CaptureError;
use rayon::prelude::*;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use xxhash_rust::xxh3::Xxh3;

/// Sampled at the start, middle and end of each image: a PNG's checksums stand at its end, and reading 1500 x 3 files
/// whole would cost seconds on each start.
const SAMPLE_BYTES: usize = 4096;

impl Recording {
    /// 32 hex digits over `transforms.json` and each file's name, size and samples of its content; not over times.
    ///
    /// # Errors
    /// When a file is missing.
    pub fn fingerprint(&self) -> Result<String, CaptureError> {
        let mut whole = Xxh3::new();
        for document in transforms::read(&self.root)? {
            whole.update(&std::fs::read(&document.file).map_err(|e| CaptureError::read(&document.file, e))?);
        }
        let files: Vec<&Path> = self
            .frames
            .iter()
            .flat_map(|f| [Some(&f.color), f.depth.as_ref(), f.mask.as_ref(), f.occluder_mask.as_ref()])
            .flatten()
            .map(|p| p.as_path())
            .collect();
        let hashes: Vec<u128> =
            files.par_iter().map(|p| sample(p).map_err(|e| CaptureError::read(p, e))).collect::<Result<_, _>>()?;
        for hash in hashes {
            whole.update(&hash.to_le_bytes());
        }
        Ok(format!("{:032x}", whole.digest128()))
    }
}

fn sample(path: &Path) -> std::io::Result<u128> {
    let mut file = std::fs::File::open(path)?;
    let size = file.metadata()?.len();
    let mut hash = Xxh3::new();
    hash.update(&size.to_le_bytes());
    let chunk = SAMPLE_BYTES as u64;
    if size <= 3 * chunk {
        let mut all = Vec::new();
        file.read_to_end(&mut all)?;
        hash.update(&all);
    } else {
        let mut buffer = vec![0; SAMPLE_BYTES];
        for start in [0, size / 2, size - chunk] {
            file.seek(SeekFrom::Start(start))?;
            file.read_exact(&mut buffer)?;
            hash.update(&buffer);
        }
    }
    Ok(hash.digest128())
}
