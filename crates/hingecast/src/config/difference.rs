//! Which settings differ between a run that is there and a build that goes on in it: a forgotten
//! `--preset` or `--config` changes a twin without a word otherwise.

use super::Config;
use std::collections::BTreeMap;
use toml::{Table, Value};

/// Keys that are named; the rest are counted.
const NAMED: usize = 5;

/// One line, `None` where nothing differs; `before` is the run's `config.toml`.
pub fn sentence(before: &str, now: &Config) -> Option<String> {
    let before = flat(&before.parse().ok()?);
    // By its text, too: only there are 32-bit numbers as short as they were.
    let now = flat(&toml::to_string_pretty(now).ok()?.parse().ok()?);
    let keys: std::collections::BTreeSet<&String> = before.keys().chain(now.keys()).collect();
    let said = |value: Option<&String>| value.map_or("none", String::as_str).to_string();
    let mut differ: Vec<String> = keys
        .into_iter()
        .filter(|k| before.get(*k) != now.get(*k))
        .map(|k| format!("{k} {} -> {}", said(before.get(k)), said(now.get(k))))
        .collect();
    // The preset explains others, and what a person wrote by hand is the dearest.
    let first = |line: &String| !(line.starts_with("preset ") || line.starts_with("[[joint]]"));
    differ.sort_by_key(first);
    let more = differ.len().saturating_sub(NAMED);
    differ.truncate(NAMED);
    let more = if more > 0 { format!(", and {more} more") } else { String::new() };
    (!differ.is_empty()).then(|| format!("other settings than this run had: {}{more}", differ.join(", ")))
}

/// Keys with dots and their values as text. Corrections go by the joint that they are about.
fn flat(table: &Table) -> BTreeMap<String, String> {
    let mut out = BTreeMap::new();
    walk(table, "", &mut out);
    out
}

fn walk(table: &Table, at: &str, out: &mut BTreeMap<String, String>) {
    for (key, value) in table {
        match value {
            Value::Table(inner) => walk(inner, &format!("{at}{key}."), out),
            Value::Array(entries) if at.is_empty() && key == "joint" => corrections(entries, out),
            value => {
                out.insert(format!("{at}{key}"), value.to_string());
            }
        }
    }
}

fn corrections(entries: &[Value], out: &mut BTreeMap<String, String>) {
    for entry in entries.iter().filter_map(Value::as_table) {
        let joint = entry.get("joint").and_then(Value::as_str).unwrap_or_default();
        let said: Vec<String> =
            entry.iter().filter(|(k, _)| *k != "joint").map(|(k, v)| format!("{k} = {v}")).collect();
        let said = said.join(", ");
        // Several entries may be about one joint.
        out.entry(format!("[[joint]] {joint}")).and_modify(|s| *s += &format!("; {said}")).or_insert(said);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;

    /// A rebuild without the preset and the corrections of before once said nothing.
    #[test]
    fn forgotten_settings_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("mine.toml");
        std::fs::write(&file, "[[joint]]\njoint = \"joint_1\"\nname = \"door\"\n").unwrap();
        let before = Config::resolve(Preset::Fast, Some(&file), &["twin.density=800".into()]).unwrap();
        let text = toml::to_string_pretty(&before).unwrap();
        assert_eq!(sentence(&text, &before), None);

        let line = sentence(&text, &Config::preset(Preset::Default)).unwrap();
        let start = "other settings than this run had: [[joint]] joint_1 name = \"door\" -> none, \
                     preset \"fast\" -> \"default\", fit.gaussians 12000 -> 24000, fit.steps 1500 -> 4000, ";
        assert!(line.starts_with(start) && line.ends_with(" more") && !line.contains('\n'), "{line}");
        let density = sentence(&text, &Config { twin: Config::preset(Preset::Fast).twin, ..before }).unwrap();
        assert_eq!(density, "other settings than this run had: twin.density 800.0 -> 500.0");
        assert_eq!(sentence("not = [toml", &Config::default()), None);
    }
}
