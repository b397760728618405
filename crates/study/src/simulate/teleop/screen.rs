//! What stands on the terminal, as text with ANSI's codes: pictures in half blocks, two pixels a
//! character, and the status lines.

use super::session::Status;
use std::fmt::Write as _;

/// Lines below the pictures.
pub const LINES: usize = 6;
/// The pictures never get larger, characters: a ray a pixel has its price.
const LARGEST: [usize; 2] = [160, 40];
/// A character is about twice as high as wide, so its two halves are square. Both pictures together
/// are at most so wide for their height.
const ASPECT: f64 = 2.4;
/// Share of the width that the left picture gets.
const LEFT: f64 = 0.6;

/// Sizes in pixels on a terminal of `columns` x `rows` characters: widths of the left and the right
/// picture, and their height. `None` where nothing fits.
pub fn picture_sizes(columns: usize, rows: usize) -> Option<([usize; 2], usize)> {
    let height = 2 * rows.checked_sub(LINES)?.min(LARGEST[1]);
    let width = columns.min(LARGEST[0]).min((ASPECT * height as f64) as usize);
    let left = (LEFT * width as f64) as usize;
    (width >= 20 && height >= 8).then(|| ([left, width - left - 1], height))
}

/// Two pictures of one height side by side, a black column between them.
pub fn beside(left: &[u8], right: &[u8], widths: [usize; 2]) -> Vec<u8> {
    let rows = left.chunks_exact(3 * widths[0]).zip(right.chunks_exact(3 * widths[1]));
    rows.flat_map(|(a, b)| [a, &[0; 3], b].concat()).collect()
}

/// RGB pixels as half blocks: the upper pixel is the character's colour, the lower its background.
/// Colours are only said when they change.
pub fn half_blocks(rgb: &[u8], width: usize) -> String {
    let mut out = String::new();
    for rows in rgb.chunks_exact(6 * width) {
        let (upper, lower) = rows.split_at(3 * width);
        let mut last: [Option<&[u8]>; 2] = [None; 2];
        for (a, b) in upper.chunks_exact(3).zip(lower.chunks_exact(3)) {
            for (k, (code, c)) in [(38, a), (48, b)].into_iter().enumerate() {
                if last[k] != Some(c) {
                    let _ = write!(out, "\x1b[{code};2;{};{};{}m", c[0], c[1], c[2]);
                    last[k] = Some(c);
                }
            }
            out.push('▀');
        }
        out += "\x1b[0m\x1b[K\r\n";
    }
    out
}

/// The lines below the picture.
pub fn status_lines(s: &Status, wanted: usize, frames_a_second: f64) -> [String; LINES] {
    let state = if s.recording { "\x1b[41;97m REC \x1b[0m" } else { "\x1b[42;30m practice \x1b[0m" };
    let mark = if s.success { "\x1b[42;30m done \x1b[0m" } else { "" };
    let mm = |x: f64, [forward, backward]: [&str; 2]| {
        format!("{:.0} mm {}", 1e3 * x.abs(), if x < 0.0 { backward } else { forward })
    };
    let [x, y, z] = s.to_grasp;
    [
        format!(
            "{state} step {}/{}  opened {:.0} % {mark}  kept {}/{wanted}  speed {:.0} %  {:.0} pictures/s",
            s.steps,
            s.horizon,
            // No -0 %.
            (100.0 * s.moved).round() + 0.0,
            s.kept,
            100.0 * s.speed,
            frames_a_second
        ),
        format!(
            "gripper {}{}; to the grasp: {}, {}, {}",
            if s.closed { "closes" } else { "opens" },
            if s.holding { ", holds the part" } else { "" },
            mm(x, ["right", "left"]),
            mm(y, ["away", "near"]),
            mm(z, ["up", "down"])
        ),
        s.notice.clone(),
        "a d left right   w s away near (in the right picture: right, left)   r f up down   z x, t g, c v turn".into(),
        "Space gripper   + - speed   Enter record / stop and keep   Backspace discard   u undo 1 s".into(),
        "Delete take back the last kept   q quit (what is kept is in the file already)".into(),
    ]
}

/// A whole frame: begun and ended so that terminals that can show it at once.
pub fn frame(picture: &str, lines: &[String], columns: usize) -> String {
    let mut out = String::from("\x1b[?2026h\x1b[H");
    out += picture;
    for (k, line) in lines.iter().enumerate() {
        out += &cut(line, columns);
        // No line feed after the last line: it would scroll the picture.
        out += if k + 1 < lines.len() { "\x1b[0m\x1b[K\r\n" } else { "\x1b[0m\x1b[K\x1b[J" };
    }
    out + "\x1b[?2026l"
}

/// The first `columns` characters that are seen; codes between them stay.
fn cut(line: &str, columns: usize) -> String {
    let (mut out, mut seen, mut code) = (String::new(), 0, false);
    for c in line.chars() {
        code |= c == '\x1b';
        if code || seen < columns {
            out.push(c);
        }
        seen += usize::from(!code);
        code &= c != 'm';
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_pixels_a_character_and_colours_only_when_they_change() {
        // Two columns, two rows: red over green, then the same again.
        let rgb = [200, 0, 0, 200, 0, 0, 0, 99, 0, 0, 99, 0];
        assert_eq!(half_blocks(&rgb, 2), "\x1b[38;2;200;0;0m\x1b[48;2;0;99;0m▀▀\x1b[0m\x1b[K\r\n");
    }

    #[test]
    fn lines_are_cut_at_the_edge_and_codes_are_not() {
        assert_eq!(cut("\x1b[41mabc\x1b[0mdef", 4), "\x1b[41mabc\x1b[0md");
        assert_eq!(picture_sizes(80, 24), Some(([48, 31], 36)));
        assert_eq!(picture_sizes(300, 100), Some(([96, 63], 80)));
        assert_eq!(picture_sizes(80, LINES + 3), None);
        assert_eq!(
            beside(&[1; 6], &[2; 12], [1, 2]),
            [1, 1, 1, 0, 0, 0, 2, 2, 2, 2, 2, 2, 1, 1, 1, 0, 0, 0, 2, 2, 2, 2, 2, 2]
        );
    }
}
