//! The content of a checkpoint file, in this order, and its checks. Any change here requires a new [`FORMAT`].

use super::clock::{Clock, Pace};
use super::contacts::{ContactState, Names};
use super::history::{ComputedMotions, History};
use super::read::{COUNT, count, length, number, optional, vector};
use super::{Motion, Overclosures, State};
use crate::contact::{BrokenBond, Tangents};
use crate::contact_id::ContactId;
use crate::error::Result;
use crate::real::Real;
use crate::tableau::MAX_PAST;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::marker::PhantomData;

/// The format that is written, and the only one that is read.
const FORMAT: u32 = 5;

/// How every file begins.
const KIND: &str = "contact-dynamics checkpoint";

/// A checkpoint borrowed for writing, or as read.
#[derive(Serialize, Deserialize)]
#[serde(bound = "T: Real", expecting = "a checkpoint of contact-dynamics")]
pub(super) struct Record<'r, T: Real> {
    // These two come first, so that other files are rejected by them, not by missing fields.
    format: Format,
    scalar: ScalarName<T>,
    scheme: Cow<'r, str>,
    rows: u32,
    state: StateRecord<'r, T>,
    history: HistoryRecord<'r, T>,
}

#[derive(Serialize, Deserialize)]
#[serde(bound = "T: Real")]
struct StateRecord<'r, T: Real> {
    motion: Cow<'r, Motion<T>>,
    /// v and a at the time of the state, if the stored ones have another time.
    shown: [Cow<'r, [T]>; 2],
    contacts: ContactsRecord<'r, T>,
    broken_bonds: Cow<'r, [BrokenBond]>,
}

#[derive(Serialize, Deserialize)]
#[serde(bound = "T: Real")]
struct ContactsRecord<'r, T: Real> {
    /// Constraint, feature, candidate.
    ids: Vec<[usize; 3]>,
    forces: Cow<'r, [T]>,
    raw_forces: Cow<'r, [T]>,
    closed: Cow<'r, [bool]>,
    gaps: Cow<'r, [T]>,
    impulses: Cow<'r, [T]>,
    lambda_v: Cow<'r, [T]>,
    lambda_a: Cow<'r, [T]>,
    dissipated: Cow<'r, [T]>,
    /// For each contact with friction: its number, the coefficient, and the number of its tangential rows.
    friction: Vec<(usize, f64, usize)>,
    slips: Cow<'r, [T]>,
    sliding: Cow<'r, [bool]>,
}

#[derive(Serialize, Deserialize)]
#[serde(bound = "T: Real")]
struct HistoryRecord<'r, T: Real> {
    /// Past states 1, 2, …, as far as they are read.
    past: Vec<Cow<'r, Motion<T>>>,
    known: usize,
    smooth: usize,
    clock: Clock,
    pace: Pace,
    made_with: f64,
    /// Length of the trail, 0 if there is none, and its known motions with the step sizes that led to them.
    trail_room: usize,
    trail: Vec<(Cow<'r, Motion<T>>, f64)>,
    unmoved: [Cow<'r, [T]>; 2],
    slopes: Cow<'r, [T]>,
    overclosures: Cow<'r, Option<Overclosures<T>>>,
}

/// Kind and format of the file.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
struct Format;

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
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String", bound = "T: Real")]
struct ScalarName<T>(PhantomData<T>);

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

impl<'r, T: Real> Record<'r, T> {
    pub(super) fn of(state: &'r State<T>, history: &'r History<T>, rows: u32) -> Self {
        let State { motion, rates, contacts, broken } = state;
        Self {
            format: Format,
            scalar: ScalarName(PhantomData),
            scheme: (&history.scheme).into(),
            rows,
            state: StateRecord {
                motion: Cow::Borrowed(motion),
                shown: both(rates),
                contacts: ContactsRecord::of(contacts),
                broken_bonds: broken.into(),
            },
            history: HistoryRecord::of(history, is_shifted(state)),
        }
    }

    /// State, history and fingerprint of the rows, after all checks.
    pub(super) fn checked(self) -> Result<(State<T>, History<T>, u32)> {
        let Self { format: _, scalar: _, scheme, rows, state, history } = self;
        let StateRecord { motion, shown, contacts, broken_bonds } = state;
        let dofs = motion.u.len();
        let motion = checked(motion, dofs)?;
        let [v, a] = shown;
        let rates = [optional("a velocity shown", v, dofs)?, optional("an acceleration shown", a, dofs)?];
        let contacts = contacts.checked()?;
        let broken = broken_bonds.into_owned();
        for bond in &broken {
            number("the time at which a bond of a checkpoint broke", bond.time, "finite", f64::is_finite)?;
            number("the load of a broken bond of a checkpoint", bond.load, "1 or more", |load| load >= 1.0)?;
        }
        let state = State { motion, rates, contacts, broken };
        let history = history.checked(scheme.into_owned(), dofs, is_shifted(&state))?;
        Ok((state, history, rows))
    }
}

/// A motion as read, if its numbers are finite and its vectors have one entry a dof.
fn checked<T: Real>(motion: Cow<'_, Motion<T>>, dofs: usize) -> Result<Motion<T>> {
    let Motion { t, u, v, a } = motion.into_owned();
    number("a time of a checkpoint", t, "finite", f64::is_finite)?;
    Ok(Motion {
        t,
        u: vector("a displacement of a checkpoint", u.into(), dofs)?,
        v: vector("a velocity of a checkpoint", v.into(), dofs)?,
        a: vector("an acceleration of a checkpoint", a.into(), dofs)?,
    })
}

impl<'r, T: Real> ContactsRecord<'r, T> {
    fn of(contacts: &'r ContactState<T>) -> Self {
        let ContactState { ids, lambda, lambda_raw, closed, gap, impulse, lambda_v, lambda_a, dissipated, .. } =
            contacts;
        let ContactState { tangents, slip, sliding, names: _, .. } = contacts;
        let friction = |contact: usize| (contact, tangents.friction(contact), tangents.of(contact).len());
        Self {
            ids: ids.iter().map(|id| [id.constraint, id.feature, id.candidate]).collect(),
            forces: lambda.into(),
            raw_forces: lambda_raw.into(),
            closed: closed.into(),
            gaps: gap.into(),
            impulses: impulse.into(),
            lambda_v: lambda_v.into(),
            lambda_a: lambda_a.into(),
            dissipated: dissipated.into(),
            friction: tangents.contacts().map(friction).collect(),
            slips: slip.into(),
            sliding: sliding.into(),
        }
    }

    fn checked(self) -> Result<ContactState<T>> {
        let n = self.ids.len();
        let id = |[constraint, feature, candidate]: [usize; 3]| ContactId { constraint, feature, candidate };
        let (closed, sliding) = (self.closed.into_owned(), self.sliding.into_owned());
        length("the closed flags of a checkpoint", closed.len(), n)?;
        let tangents = tangents(&self.friction, n)?;
        let (m, flags) = (n + tangents.len(), if tangents.is_empty() { 0 } else { n });
        length("the flags of sliding contacts of a checkpoint", sliding.len(), flags)?;
        Ok(ContactState {
            ids: self.ids.into_iter().map(id).collect(),
            names: Names::default(),
            lambda: vector("the contact forces of a checkpoint", self.forces, m)?,
            lambda_raw: vector("the raw multipliers of a checkpoint", self.raw_forces, m)?,
            closed,
            gap: vector("the gaps of a checkpoint", self.gaps, n)?,
            impulse: vector("the impulses of a checkpoint", self.impulses, m)?,
            lambda_v: vector("λ_v of a checkpoint", self.lambda_v, m)?,
            lambda_a: vector("λ_a of a checkpoint", self.lambda_a, m)?,
            dissipated: vector("the dissipated energies of a checkpoint", self.dissipated, n)?,
            slip: vector("the slips of a checkpoint", self.slips, tangents.len())?,
            sliding,
            tangents,
        })
    }
}

/// The tangential rows of contacts with friction among n contacts, from a file; contacts ascend.
fn tangents(friction: &[(usize, f64, usize)], n: usize) -> Result<Tangents> {
    let mut tangents = Tangents::default();
    if friction.is_empty() {
        return Ok(tangents);
    }
    tangents.begin(n);
    for &(contact, coefficient, rows) in friction {
        let range = tangents.listed() as u64..=(n as u64).saturating_sub(1);
        count("a contact with friction of a checkpoint", contact as u64, range)?;
        count("the tangents of a contact of a checkpoint", rows as u64, 1..=2)?;
        number("a friction coefficient of a checkpoint", coefficient, "not negative and finite", |friction| {
            friction >= 0.0 && friction.is_finite()
        })?;
        (tangents.listed()..contact).for_each(|_| tangents.push(0.0, 0));
        tangents.push(coefficient, rows);
    }
    (tangents.listed()..n).for_each(|_| tangents.push(0.0, 0));
    Ok(tangents)
}

/// Whether the scheme stores v or a at another time than the time of the state.
fn is_shifted<T: Real>(state: &State<T>) -> bool {
    state.rates.iter().any(|rate| !rate.is_empty())
}

/// Number of past states that steps and changes of the step size read, given the numbers of known and smooth states.
/// One-step schemes read none; if they store v or a at another time, a first change of the step size reads one.
fn read(known: usize, smooth: usize, shifted: bool) -> usize {
    let needed = if shifted { smooth.min(2) } else { 1 };
    known.max(needed).saturating_sub(1)
}

impl<'r, T: Real> HistoryRecord<'r, T> {
    fn of(history: &'r History<T>, shifted: bool) -> Self {
        let past = history.slots.iter().skip(1).take(read(history.known, history.smooth, shifted));
        Self {
            past: past.map(Cow::Borrowed).collect(),
            known: history.known,
            smooth: history.smooth,
            clock: history.clock,
            pace: history.pace,
            made_with: history.made_with,
            trail_room: history.computed.room(),
            trail: history.computed.known().map(|(motion, h)| (Cow::Borrowed(motion), h)).collect(),
            unmoved: both(&history.unshifted),
            slopes: (&history.slopes).into(),
            overclosures: Cow::Borrowed(&history.overclosures),
        }
    }

    fn checked(self, scheme: String, dofs: usize, shifted: bool) -> Result<History<T>> {
        let Self { past, known, smooth, clock, pace, made_with, trail_room, trail, unmoved, slopes, overclosures } =
            self;
        count("the number of known states of a checkpoint", known as u64, 1..=MAX_PAST as u64)?;
        count("the number of smooth states of a checkpoint", smooth as u64, 1..=COUNT)?;
        length("the past of a checkpoint", past.len(), read(known, smooth, shifted))?;
        clock.check_read()?;
        pace.check_read(clock.h)?;
        let size = |h| number("a step size of a checkpoint", h, "positive and finite", |h| h > 0.0 && h.is_finite());
        size(made_with)?;
        // No scheme keeps more; see `keep_computed`.
        count("the length of the trail of a checkpoint", trail_room as u64, 0..=3 * MAX_PAST as u64)?;
        count("the known length of the trail of a checkpoint", trail.len() as u64, 0..=trail_room as u64)?;
        let mut slots = vec![Motion::zero(dofs)];
        for motion in past {
            slots.push(checked(motion, dofs)?);
        }
        let mut computed = Vec::with_capacity(trail_room);
        for (motion, h) in trail {
            size(h)?;
            computed.push((checked(motion, dofs)?, h));
        }
        let [v, a] = unmoved;
        let unshifted = [optional("an unmoved velocity", v, dofs)?, optional("an unmoved acceleration", a, dofs)?];
        let massless = slopes.len();
        let overclosures = overclosures.into_owned();
        if let Some(overclosures) = &overclosures {
            overclosures.check_read()?;
        }
        Ok(History {
            slots,
            known,
            smooth,
            clock,
            pace,
            made_with,
            computed: ComputedMotions::of(computed, trail_room, dofs),
            unshifted,
            slopes: vector("the slopes of a checkpoint", slopes, massless)?,
            scheme,
            overclosures,
        })
    }
}

fn both<T: Real>(fields: &[Vec<T>; 2]) -> [Cow<'_, [T]>; 2] {
    fields.each_ref().map(Into::into)
}
