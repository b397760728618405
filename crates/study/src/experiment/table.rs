//! The rows as Markdown for people and as CSV for everything else.

use super::{Count, Experiment, Row};
use crate::simulate::record::outcome_name;
use hingecast_policy::statistics::Comparison;
use std::fmt::Write as _;

fn percent(x: f64) -> f64 {
    100.0 * x
}

/// `95.0 [92.1, 97.0]`, per cent.
fn rate(count: &Count, episodes: usize) -> String {
    let [lo, hi] = count.interval.map(percent);
    format!("{:.1} [{lo:.1}, {hi:.1}]", percent(count.successes as f64 / episodes.max(1) as f64))
}

/// Points.
fn difference(count: &Count) -> String {
    count.against_true.map_or("-".into(), |c| {
        let [lo, hi] = c.interval.map(percent);
        format!("{:+.1} [{lo:+.1}, {hi:+.1}]", percent(c.difference))
    })
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".into(), |v| format!("{v:.digits$}"))
}

/// Two tables: the rows, rates and differences in per cent with their 95 % intervals, and what was
/// demonstrated. Of a row that failed it says why.
pub fn markdown(experiment: &Experiment) -> String {
    let mut out = String::from(
        "| object | world | axis deg | pivot mm | goal mm | episodes | success % | true - this | as true % | true - this | off mm | ends |\n",
    );
    out += &("|---".repeat(12) + "|\n");
    for row in &experiment.rows {
        let _ = writeln!(out, "{}", line(row));
    }
    out += "\n| demonstrated on | joint | metres per unit | kept | thrown away |\n|---|---|---|---|---|\n";
    for d in &experiment.demonstrated {
        let thrown: Vec<String> = d.thrown_away.iter().map(|(o, k)| format!("{k} {}", outcome_name(*o))).collect();
        let thrown = if thrown.is_empty() { "0".to_string() } else { thrown.join(", ") };
        let _ = writeln!(out, "| {} ({}) | {} | {:.3} | {} | {thrown} |", d.object, d.on, d.joint, d.scale, d.kept);
    }
    out
}

fn line(row: &Row) -> String {
    let (Some(success), Some(as_true)) = (&row.success, &row.as_true) else {
        let why = row.failed.as_deref().unwrap_or("-").replace('|', "/");
        return format!("| {} | {} | - | - | - | 0 | - | - | - | - | - | {why} |", row.object, row.world);
    };
    let ends: Vec<String> = row.outcomes.iter().map(|(o, k)| format!("{k} {}", outcome_name(*o))).collect();
    format!(
        "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
        row.object,
        row.world,
        number(row.error.map(|e| e.axis_deg), 2),
        number(row.error.and_then(|e| e.pivot_mm), 2),
        number(row.error.map(|e| e.goal_mm), 2),
        row.episodes,
        rate(success, row.episodes),
        difference(success),
        rate(as_true, row.episodes),
        difference(as_true),
        number(row.median_off_mm, 1),
        ends.join(", ")
    )
}

/// The rows with a header line. Rates, differences and intervals are shares, not per cent, lengths
/// simulated mm; `success` and `as_true` are numbers of episodes. A cell is empty where there is no
/// figure; a comma in a world's name is written as `+`.
pub fn csv(experiment: &Experiment) -> String {
    let mut out = String::from("object,world,axis_deg,pivot_mm,goal_mm,episodes");
    for name in ["success", "as_true"] {
        let _ =
            write!(out, ",{name},{name}_low,{name}_high,{name}_lost,{name}_lost_low,{name}_lost_high,{name}_mcnemar");
    }
    out += ",median_off_mm,failed\n";
    for row in &experiment.rows {
        let cell = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
        let mut cells = vec![
            row.object.clone(),
            row.world.replace(',', "+"),
            cell(row.error.map(|e| e.axis_deg)),
            cell(row.error.and_then(|e| e.pivot_mm)),
            cell(row.error.map(|e| e.goal_mm)),
            row.episodes.to_string(),
        ];
        for count in [&row.success, &row.as_true] {
            let against: Option<Comparison> = count.as_ref().and_then(|c| c.against_true);
            cells.extend([
                count.as_ref().map_or(String::new(), |c| c.successes.to_string()),
                cell(count.as_ref().map(|c| c.interval[0])),
                cell(count.as_ref().map(|c| c.interval[1])),
                cell(against.map(|c| c.difference)),
                cell(against.map(|c| c.interval[0])),
                cell(against.map(|c| c.interval[1])),
                cell(against.map(|c| c.p_value)),
            ]);
        }
        cells.push(cell(row.median_off_mm));
        cells.push(row.failed.as_deref().map_or(String::new(), |f| format!("\"{}\"", f.replace('"', "'"))));
        let _ = writeln!(out, "{}", cells.join(","));
    }
    out
}
