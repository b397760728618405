//! Depth in as few bytes as it can be had back from exactly.

/// Depth of one view, (h, w).
pub enum PackedDepth {
    /// There is none.
    None,
    /// As a 16-bit file holds it.
    Stored {
        /// Multiples of `scale`; 0 = unknown.
        units: Vec<u16>,
        /// Scene units of one.
        scale: f32,
    },
    /// Scene units.
    Full(Vec<f32>),
}

impl PackedDepth {
    /// Depth that came from 16-bit files in units of `scale` goes back to it exactly; anything else
    /// stays as it is.
    pub fn new(depth: &[f32], scale: f32) -> Self {
        let units =
            || depth.iter().map(|&z| (z / scale).round()).map(|u| (0.0..65536.0).contains(&u).then_some(u as u16));
        match units().collect::<Option<Vec<u16>>>() {
            _ if depth.is_empty() => Self::None,
            Some(units) if units.iter().zip(depth).all(|(&u, &z)| f32::from(u) * scale == z) => {
                Self::Stored { units, scale }
            }
            _ => Self::Full(depth.to_vec()),
        }
    }

    /// Scene units, 0 = unknown; empty where there is none.
    pub fn unpack(&self) -> Vec<f32> {
        match self {
            Self::None => Vec::new(),
            Self::Stored { units, scale } => units.iter().map(|&u| f32::from(u) * scale).collect(),
            Self::Full(depth) => depth.clone(),
        }
    }

    /// What it takes.
    pub fn bytes(&self) -> usize {
        match self {
            Self::None => 0,
            Self::Stored { units, .. } => 2 * units.len(),
            Self::Full(depth) => 4 * depth.len(),
        }
    }
}
