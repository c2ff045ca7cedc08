//! How many states a scheme reads, and which values of them rows read that come later.

use contact_dynamics::tableau::{MAX_PAST, Row, Stage, Tableau};

/// Whether later rows read u, v or a of state k, counted from the state that a stage has just made.
pub(crate) type Reads = Vec<[bool; 3]>;

/// What a row reads of the past, with the unknown chosen such that the acceleration row vanishes with it: what cancels
/// is not read.
fn coefficients(row: &Row, zero: &Row) -> Vec<[f64; 3]> {
    let factor = row.z / zero.z;
    (0..MAX_PAST)
        .map(|k| {
            let (own, other) = (row.past(k), zero.past(k));
            [0, 1, 2].map(|field| {
                let difference = own[field] - factor * other[field];
                let terms = own[field].abs() + (factor * other[field]).abs();
                if difference.abs() <= 1e-14 * terms { 0.0 } else { difference }
            })
        })
        .collect()
}

fn rows(stage: &Stage) -> Vec<Row> {
    stage.recovery.each().into_iter().chain(stage.balance.each()).collect()
}

/// The states that a step reads where it starts.
pub(crate) fn depth(tableau: &Tableau) -> usize {
    let mut depth = 1;
    for (s, stage) in tableau.stages.iter().enumerate() {
        for row in rows(stage) {
            for k in 0..MAX_PAST {
                if k >= s && row.past(k).iter().any(|c| c.abs() > 0.0) {
                    depth = depth.max(k - s + 1);
                }
            }
        }
    }
    depth
}

/// Follows the states by name through the rest of the step and the next one, and notes what is read of them.
pub(crate) fn reads_after(tableau: &Tableau, s: usize) -> Reads {
    let (stages, depth) = (tableau.stages.len(), depth(tableau));
    // States by their number from the one just made; none for those that come later.
    let mut states: Vec<Option<usize>> = (0..depth + stages).map(Some).collect();
    let mut reads = vec![[false; 3]; depth + stages];
    let mut go = |states: &mut Vec<Option<usize>>, stage: &Stage| {
        for row in rows(stage) {
            for (read, state) in coefficients(&row, &stage.recovery.a).iter().zip(states.iter()) {
                if let Some(place) = state.and_then(|state| reads.get_mut(state)) {
                    place.iter_mut().zip(read).for_each(|(place, c)| *place |= c.abs() > 0.0);
                }
            }
        }
        states.insert(0, None);
    };
    for stage in &tableau.stages[s + 1..] {
        go(&mut states, stage);
    }
    states.drain(1..stages);
    for stage in &tableau.stages {
        go(&mut states, stage);
    }
    reads
}
