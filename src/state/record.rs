//! The content of a checkpoint file, in this order, and its checks. Any change here requires a new [`FORMAT`].

use super::clock::{Clock, Pace};
use super::contacts::{ContactState, Names};
use super::history::{ComputedMotions, History};
use super::read::{COUNT, count, finite, length, not_negative, number, positive, vector};
use super::{Motion, Overclosures, State};
use crate::contact::{BrokenBond, Tangents};
use crate::contact_id::ContactId;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::tableau::MAX_PAST;
use serde::{Deserialize, Serialize};
use std::marker::PhantomData;

/// The format that is written, and the only one that is read.
const FORMAT: u32 = 6;

/// How every file begins.
const KIND: &str = "contact-dynamics checkpoint";

/// A checkpoint as read.
#[derive(Deserialize)]
#[serde(bound = "T: Real", expecting = "a checkpoint of contact-dynamics")]
pub(super) struct Record<T> {
    // These two come first, so that other files are rejected by them, not by missing fields.
    pub(super) format: Format,
    pub(super) scalar: ScalarName<T>,
    pub(super) rows: u32,
    #[serde(with = "StateRecord")]
    pub(super) state: State<T>,
    #[serde(with = "HistoryRecord")]
    pub(super) history: History<T>,
}

// The fields of public types; these types themselves are not read from files, because nothing would check them.

#[derive(Serialize, Deserialize)]
#[serde(remote = "State", bound = "T: Real")]
pub(super) struct StateRecord<T> {
    motion: Motion<T>,
    rates: [Vec<T>; 2],
    #[serde(with = "ContactsRecord")]
    contacts: ContactState<T>,
    broken: Vec<BrokenBond>,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "ContactState", bound = "T: Real")]
struct ContactsRecord<T> {
    ids: Vec<ContactId>,
    tangents: Tangents,
    #[serde(skip)]
    names: Names,
    lambda: Vec<T>,
    lambda_raw: Vec<T>,
    closed: Vec<bool>,
    gap: Vec<T>,
    impulse: Vec<T>,
    lambda_v: Vec<T>,
    lambda_a: Vec<T>,
    dissipated: Vec<T>,
    slip: Vec<T>,
    sliding: Vec<bool>,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "History", bound = "T: Real")]
pub(super) struct HistoryRecord<T> {
    slots: Vec<Motion<T>>,
    known: usize,
    smooth: usize,
    clock: Clock,
    pace: Pace,
    made_with: f64,
    computed: ComputedMotions<T>,
    unshifted: [Vec<T>; 2],
    slopes: Vec<T>,
    scheme: String,
    overclosures: Option<Overclosures<T>>,
}

/// Kind and format of the file.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub(super) struct Format;

impl From<Format> for String {
    fn from(_: Format) -> Self {
        format!("{KIND} {FORMAT}")
    }
}

impl TryFrom<String> for Format {
    type Error = String;

    fn try_from(found: String) -> std::result::Result<Self, String> {
        match found.strip_prefix(KIND).map(|number| number.trim_start().parse()) {
            Some(Ok(FORMAT)) => Ok(Self),
            Some(Ok::<u32, _>(other)) => {
                Err(format!("a checkpoint of format {other}; this version of contact-dynamics reads format {FORMAT}"))
            }
            _ => Err("this is no checkpoint of contact-dynamics".into()),
        }
    }
}

/// Name of the scalar.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String", bound = "T: Real")]
pub(super) struct ScalarName<T>(PhantomData<T>);

impl<T: Real> From<ScalarName<T>> for String {
    fn from(_: ScalarName<T>) -> Self {
        T::NAME.into()
    }
}

impl<T: Real> TryFrom<String> for ScalarName<T> {
    type Error = String;

    fn try_from(found: String) -> std::result::Result<Self, String> {
        match found == T::NAME {
            true => Ok(Self(PhantomData)),
            false => Err(format!("a checkpoint of a run in {found:?} cannot be continued in {}", T::NAME)),
        }
    }
}

/// The friction coefficient of each contact, and the number of its tangential rows; nothing without friction.
impl From<Tangents> for Vec<(f64, usize)> {
    fn from(tangents: Tangents) -> Self {
        (0..tangents.listed()).map(|contact| (tangents.friction(contact), tangents.of(contact).len())).collect()
    }
}

impl TryFrom<Vec<(f64, usize)>> for Tangents {
    type Error = Error;

    fn try_from(contacts: Vec<(f64, usize)>) -> Result<Self> {
        let mut tangents = Self::default();
        if !contacts.is_empty() {
            tangents.begin(contacts.len());
        }
        for (friction, rows) in contacts {
            not_negative("a friction coefficient of a checkpoint", friction)?;
            count("the tangents of a contact of a checkpoint", rows as u64, 0..=2)?;
            tangents.push(friction, rows);
        }
        Ok(tangents)
    }
}

impl<T: Real> Record<T> {
    /// Rejects a record whose lists do not fit together, or with values that no run produces.
    pub(super) fn check(&mut self) -> Result<()> {
        check_state(&self.state)?;
        check_history(&mut self.history, self.state.motion.u.len(), self.state.is_shifted())
    }
}

fn check_state<T: Real>(state: &State<T>) -> Result<()> {
    let State { motion, rates, contacts, broken } = state;
    let dofs = motion.u.len();
    check_motion(motion, dofs)?;
    rates.iter().try_for_each(|rate| optional("a rate of a checkpoint", rate, dofs))?;
    for bond in broken {
        finite("the time at which a bond of a checkpoint broke", bond.time)?;
        number("the load of a broken bond of a checkpoint", bond.load, "1 or more", |load| load >= 1.0)?;
    }
    let ContactState { ids, tangents, names: _, lambda, lambda_raw, closed, gap, impulse, .. } = contacts;
    let ContactState { lambda_v, lambda_a, dissipated, slip, sliding, .. } = contacts;
    let n = ids.len();
    let (rows, listed) = (n + tangents.len(), if tangents.listed() == 0 { 0 } else { n });
    length("the friction of the contacts of a checkpoint", tangents.listed(), listed)?;
    length("the closed flags of a checkpoint", closed.len(), n)?;
    length("the flags of sliding contacts of a checkpoint", sliding.len(), if tangents.is_empty() { 0 } else { n })?;
    vector("the contact forces of a checkpoint", lambda, rows)?;
    vector("the raw multipliers of a checkpoint", lambda_raw, rows)?;
    vector("the gaps of a checkpoint", gap, n)?;
    vector("the impulses of a checkpoint", impulse, rows)?;
    vector("λ_v of a checkpoint", lambda_v, rows)?;
    vector("λ_a of a checkpoint", lambda_a, rows)?;
    vector("the dissipated energies of a checkpoint", dissipated, n)?;
    vector("the slips of a checkpoint", slip, tangents.len())
}

fn check_history<T: Real>(history: &mut History<T>, dofs: usize, is_shifted: bool) -> Result<()> {
    let History { slots, known, smooth, clock, pace, made_with, computed, unshifted, slopes, .. } = &*history;
    count("the number of known states of a checkpoint", *known as u64, 1..=MAX_PAST as u64)?;
    count("the number of smooth states of a checkpoint", *smooth as u64, 1..=COUNT)?;
    count("the past of a checkpoint", history.read(is_shifted) as u64, 1..=slots.len() as u64)?;
    clock.check_read()?;
    pace.check_read(clock.h)?;
    positive("a step size of a checkpoint", *made_with)?;
    // No scheme keeps more; see `keep_computed`.
    count("the length of the trail of a checkpoint", computed.room() as u64, 0..=3 * MAX_PAST as u64)?;
    count("the known length of the trail of a checkpoint", computed.known as u64, 0..=computed.room() as u64)?;
    computed.known().try_for_each(|(_, h)| positive("a step size of a checkpoint", h))?;
    unshifted.iter().try_for_each(|rate| optional("an unmoved rate of a checkpoint", rate, dofs))?;
    vector("the slopes of a checkpoint", slopes, slopes.len())?;
    history.overclosures.as_ref().map_or(Ok(()), Overclosures::check_read)?;
    let mut motions = history.motions(is_shifted);
    motions.try_for_each(|(is_read, motion)| check_motion(motion, if is_read { dofs } else { 0 }))
}

fn check_motion<T: Real>(motion: &Motion<T>, dofs: usize) -> Result<()> {
    finite("a time of a checkpoint", motion.t)?;
    vector("a displacement of a checkpoint", &motion.u, dofs)?;
    vector("a velocity of a checkpoint", &motion.v, dofs)?;
    vector("an acceleration of a checkpoint", &motion.a, dofs)
}

/// Checks a vector that may be missing and is then empty.
fn optional<T: Real>(what: &'static str, values: &[T], dofs: usize) -> Result<()> {
    vector(what, values, if values.is_empty() { 0 } else { dofs })
}
