//! Typed reading of JSON objects with errors that name file, field and value.

use crate::CaptureError;
use serde_json::{Map, Value};

/// A JSON object, where it stands, and the object whose keys it inherits (nerfstudio's per-frame
/// over global keys).
pub(crate) struct Fields<'a> {
    pub object: &'a Map<String, Value>,
    pub inherits: Option<&'a Map<String, Value>>,
    pub place: String,
}

impl<'a> Fields<'a> {
    /// The value of `key`, here or inherited.
    pub fn get(&self, key: &str) -> Option<&'a Value> {
        self.object.get(key).or_else(|| self.inherits.and_then(|g| g.get(key)))
    }

    pub fn wrong(&self, key: &str, value: &Value, expected: &str) -> CaptureError {
        let mut text = value.to_string();
        if text.len() > 80 {
            text = text.chars().take(77).collect::<String>() + "...";
        }
        // The reader turned NaN and Infinity into null.
        let has_null = value.is_null() || value.as_array().is_some_and(|a| a.contains(&Value::Null));
        let what = if has_null { "a number is not finite (NaN, inf or null)" } else { "a field has the wrong type" };
        CaptureError::new(
            format!("{what}: {key} should be {expected}"),
            format!("{}.{key} = {text}", self.place),
            format!("write {key} as {expected}"),
        )
    }

    pub fn missing(&self, key: &str, expected: &str) -> CaptureError {
        CaptureError::new(
            format!("a field is missing: {key}"),
            format!("{}.{key}", self.place),
            format!("add {key}: {expected}"),
        )
    }

    pub fn number(&self, key: &str) -> Result<Option<f64>, CaptureError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        match value.as_f64() {
            Some(x) if x.is_finite() => Ok(Some(x)),
            _ => Err(self.wrong(key, value, "a finite number")),
        }
    }

    /// A whole number >= 0; 3.0 counts as 3.
    pub fn count(&self, key: &str) -> Result<Option<usize>, CaptureError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        match value.as_f64() {
            Some(x) if x >= 0.0 && x.fract() == 0.0 && x < 1e9 => Ok(Some(x as usize)),
            _ => Err(self.wrong(key, value, "a whole number from 0")),
        }
    }

    /// A number from 1 to 65535 or a list of such; an absent key is an empty list.
    pub fn ids(&self, key: &str) -> Result<Vec<u16>, CaptureError> {
        let Some(value) = self.get(key) else { return Ok(Vec::new()) };
        let one = |v: &Value| v.as_u64().and_then(|n| u16::try_from(n).ok()).filter(|n| *n > 0);
        let all = match value {
            Value::Array(list) => list.iter().map(one).collect::<Option<Vec<u16>>>().filter(|l| !l.is_empty()),
            other => one(other).map(|n| vec![n]),
        };
        all.ok_or_else(|| self.wrong(key, value, "a number of the label images, from 1, or a list of such"))
    }

    pub fn text(&self, key: &str) -> Result<Option<&'a str>, CaptureError> {
        match self.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(s)) if !s.is_empty() => Ok(Some(s)),
            Some(other) => Err(self.wrong(key, other, "a text")),
        }
    }

    pub fn flag(&self, key: &str) -> Result<Option<bool>, CaptureError> {
        match self.get(key) {
            None => Ok(None),
            Some(Value::Bool(b)) => Ok(Some(*b)),
            Some(other) => Err(self.wrong(key, other, "true or false")),
        }
    }

    pub fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, CaptureError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        numbers(value).map(Some).ok_or_else(|| self.wrong(key, value, &format!("a list of {N} finite numbers")))
    }

    /// A 4x4 (or 3x4, as some exporters write) row-major matrix as rows.
    pub fn matrix(&self, key: &str) -> Result<Option<[[f64; 4]; 4]>, CaptureError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let wrong = || self.wrong(key, value, "a 4x4 matrix: four rows of four finite numbers");
        let rows = value.as_array().ok_or_else(wrong)?;
        if rows.len() != 3 && rows.len() != 4 {
            return Err(wrong());
        }
        let mut m = [[0.0, 0.0, 0.0, 1.0]; 4];
        for (i, row) in rows.iter().enumerate() {
            // Name the row: a matrix has sixteen numbers to search otherwise.
            let place = format!("{key}[{i}]");
            m[i] = numbers(row).ok_or_else(|| self.wrong(&place, row, "a row of four finite numbers"))?;
        }
        Ok(Some(m))
    }

    /// A list of texts; an absent key is an empty list.
    pub fn texts(&self, key: &str) -> Result<Vec<&'a str>, CaptureError> {
        let Some(value) = self.get(key) else { return Ok(Vec::new()) };
        let list = value.as_array().and_then(|a| a.iter().map(Value::as_str).collect::<Option<Vec<_>>>());
        list.ok_or_else(|| self.wrong(key, value, "a list of texts"))
    }
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let list = value.as_array().filter(|a| a.len() == N)?;
    let mut out = [0.0; N];
    for (slot, v) in out.iter_mut().zip(list) {
        *slot = v.as_f64().filter(|x| x.is_finite())?;
    }
    Some(out)
}
