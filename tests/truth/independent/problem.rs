//! Contact problems of a few contacts, solved by trying everything: each contact in each of its modes.

use super::Scene;
use super::dense::{Matrix, dot, eliminate, zeros};
use contact_dynamics::ContactLaw;

/// What is asked of one contact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    /// Whether its normal row is held at zero by a multiplier of either sign; else 0 ≤ y ⊥ λ ≥ 0.
    pub(crate) held: bool,
    pub(crate) friction: Option<Friction>,
}

/// Coulomb's friction along one tangent, whose row is `row` of the problem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Friction {
    pub(crate) row: usize,
    pub(crate) coefficient: f64,
    /// The direction in which it is known to act.
    pub(crate) direction: Option<f64>,
    /// Whether it belongs to a change of forces, which may press or pull.
    pub(crate) of_change: bool,
}

/// y = W r + q; rows of the contacts come first, those of tangents behind them.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub(crate) contacts: Vec<Contact>,
    pub(crate) w: Matrix,
    pub(crate) q: Vec<f64>,
    /// What of y is rounding.
    pub(crate) noise: Vec<f64>,
}

impl Problem {
    /// That of the gaps of some rows at displacements u, without friction; `responses` are what multipliers make of u.
    pub(crate) fn of_gaps(scene: &Scene, rows: &[usize], responses: &[Vec<f64>], t: f64, u: &[f64]) -> Self {
        let held = |i: usize| scene.rows[i].law == ContactLaw::Equality;
        Self {
            contacts: rows.iter().map(|&i| Contact { held: held(i), friction: None }).collect(),
            w: rows.iter().map(|&i| responses.iter().map(|x| dot(&scene.rows[i].g, x)).collect()).collect(),
            q: rows.iter().map(|&i| scene.gap(i, t, u)).collect(),
            noise: rows.iter().map(|&i| scene.rounding(i, t, u)).collect(),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    /// λ = 0.
    Open,
    /// y = 0, without friction.
    Closed,
    /// y = 0 and no slip.
    Stick,
    /// y = 0 and friction at its bound, in this direction: against the slip, or where it is known.
    Slide(f64),
}

impl Contact {
    fn modes(&self) -> Vec<Mode> {
        let mut modes = if self.held { vec![] } else { vec![Mode::Open] };
        match self.friction {
            None => modes.push(Mode::Closed),
            Some(Friction { direction, .. }) => {
                match direction {
                    None => modes.extend([Mode::Stick, Mode::Slide(1.0), Mode::Slide(-1.0)]),
                    Some(direction) => modes.push(Mode::Slide(direction)),
                }
                if self.held && self.friction.is_some_and(|friction| !friction.of_change) {
                    // It pulls: there is no friction.
                    modes.push(Mode::Closed);
                }
            }
        }
        modes
    }
}

impl Problem {
    /// The multipliers: those of the first choice of modes that violates nothing by more than rounding, or else of the
    /// one that violates least.
    pub(crate) fn solve(&self) -> Vec<f64> {
        let modes: Vec<Vec<Mode>> = self.contacts.iter().map(Contact::modes).collect();
        let choices: usize = modes.iter().map(Vec::len).product();
        let size = self.q.len();
        let mut best = (f64::INFINITY, vec![0.0; size]);
        let (mut matrix, mut r, mut chosen) = (zeros(size, size), vec![0.0; size], Vec::new());
        for choice in 0..choices {
            let mut rest = choice;
            chosen.clear();
            chosen.extend(modes.iter().map(|modes| {
                let mode = modes[rest % modes.len()];
                rest /= modes.len();
                mode
            }));
            if self.multipliers(&chosen, &mut matrix, &mut r) {
                let violation = self.violation(&chosen, &r);
                if violation < best.0 {
                    best = (violation, r.clone());
                }
                if violation <= 1.0 {
                    break;
                }
            }
        }
        best.1
    }

    /// The multipliers of a choice of modes, if there are any; `a` is room for a matrix.
    fn multipliers(&self, modes: &[Mode], a: &mut Matrix, r: &mut Vec<f64>) -> bool {
        a.iter_mut().for_each(|row| row.fill(0.0));
        r.fill(0.0);
        let vanish = |a: &mut Matrix, r: &mut Vec<f64>, row: usize| {
            a[row].clone_from(&self.w[row]);
            r[row] = -self.q[row];
        };
        for (i, (contact, mode)) in self.contacts.iter().zip(modes).enumerate() {
            match mode {
                Mode::Open => a[i][i] = 1.0,
                Mode::Closed | Mode::Stick | Mode::Slide(_) => vanish(a, r, i),
            }
            let Some(Friction { row, coefficient, .. }) = contact.friction else { continue };
            match mode {
                Mode::Open | Mode::Closed => a[row][row] = 1.0,
                Mode::Stick => vanish(a, r, row),
                Mode::Slide(direction) => {
                    a[row][row] = 1.0;
                    a[row][i] = -coefficient * direction;
                }
            }
        }
        eliminate(a, std::slice::from_mut(r))
    }

    /// By how much a solution violates the conditions of its modes, in units of rounding.
    fn violation(&self, modes: &[Mode], r: &[f64]) -> f64 {
        let y = |row: usize| dot(&self.w[row], r) + self.q[row];
        let mut worst = 0.0_f64;
        // A multiplier is compared by the way that it makes in its own row.
        let mut ask = |value: f64, row: usize| worst = worst.max(-value / self.noise[row].max(f64::MIN_POSITIVE));
        for (i, (contact, &mode)) in self.contacts.iter().zip(modes).enumerate() {
            let way = r[i] * self.w[i][i];
            match (mode, contact.friction) {
                (Mode::Open, _) => ask(y(i), i),
                (Mode::Closed, None) if contact.held => {}
                (Mode::Closed, None) => ask(way, i),
                (Mode::Closed, Some(_)) => ask(-way, i),
                (Mode::Stick, friction) => {
                    let Some(Friction { row, coefficient, .. }) = friction else { continue };
                    ask(way, i);
                    ask((coefficient * r[i] - r[row].abs()) * self.w[row][row], row);
                }
                (Mode::Slide(direction), friction) => {
                    let Some(Friction { row, direction: known, of_change, .. }) = friction else { continue };
                    if !of_change {
                        ask(way, i);
                    }
                    if known.is_none() {
                        ask(-direction * y(row), row);
                    }
                }
            }
        }
        worst
    }
}
