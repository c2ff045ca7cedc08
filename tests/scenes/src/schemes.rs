//! Every scheme of the library with what the literature says of it: the one list that tests and examples go through.

use contact_dynamics::tableau::{ContactLevel, Rows, Stage, Tableau};
use contact_dynamics::{
    Bathe, Bdf2, CdLagrange, CentralDifference, ChungLee, Composite, EnergyMomentum, GeneralizedAlpha, Gssss, Houbolt,
    HulbertChung, MoreauJean, Newmark, NohBathe, Oalts, Park, TchamwaWielgosz, TimeIntegrator,
};

/// A scheme and its published figures.
#[derive(Clone, Copy, Debug)]
pub struct Listed {
    /// Makes it.
    pub make: fn() -> Box<dyn TimeIntegrator>,
    /// Order of u, v and a.
    pub order: u32,
    /// Spectral radius at infinite frequency; `None` for explicit schemes.
    pub radius: Option<f64>,
    /// Period error and numerical damping in %, at h/T = 0.1, with the digits that are published, if they are.
    pub published: Option<[f64; 2]>,
    /// Largest stable Ω; `None` if there is no limit.
    pub critical: Option<f64>,
}

impl Listed {
    /// What the scheme calls itself.
    pub fn name(&self) -> String {
        (self.make)().name()
    }

    /// Whether contact is imposed on the displacements of the state, where corrections apply.
    pub fn takes_corrections(&self) -> bool {
        (self.make)().tableau().stages.iter().all(|stage| stage.contact == ContactLevel::POSITION)
    }

    /// Whether a multiplier can impose contact.
    pub fn takes_multipliers(&self) -> bool {
        (self.make)().tableau().stages.iter().all(|stage| stage.contact_row().z != 0.0)
    }
}

/// A scheme of one's own, given by its rows.
#[derive(Clone, Debug)]
pub struct Tabulated(pub &'static str, pub Tableau);

impl Tabulated {
    /// One stage.
    pub fn single(name: &'static str, rows: Rows) -> Self {
        Self(name, Tableau::single(Stage::new(rows)))
    }
}

impl TimeIntegrator for Tabulated {
    fn name(&self) -> String {
        self.0.into()
    }
    fn tableau(&self) -> Tableau {
        self.1.clone()
    }
}

fn implicit(
    make: fn() -> Box<dyn TimeIntegrator>,
    order: u32,
    radius: f64,
    published: impl Into<Option<[f64; 2]>>,
) -> Listed {
    Listed { make, order, radius: Some(radius), published: published.into(), critical: None }
}

fn explicit(
    make: fn() -> Box<dyn TimeIntegrator>,
    order: u32,
    critical: f64,
    published: impl Into<Option<[f64; 2]>>,
) -> Listed {
    Listed { make, order, radius: None, published: published.into(), critical: Some(critical) }
}

/// All schemes: one line a scheme (or a member of a family that the literature tabulates).
#[rustfmt::skip]
pub fn all() -> Vec<Listed> {
    vec![
        implicit(|| Box::new(Composite), 2, 0.0, [8.448, 1.032]),
        implicit(|| Box::new(Newmark::trapezoidal()), 2, 1.0, [3.207, 0.0]),
        implicit(|| Box::new(Newmark::new(0.3025, 0.6).unwrap()), 1, 0.818, [3.295, 2.951]),
        implicit(|| Box::new(Newmark::new(0.5, 1.0).unwrap()), 1, 1.0, [4.21, 14.9]),
        implicit(|| Box::new(GeneralizedAlpha::hht(0.5).unwrap()), 2, 0.5, [4.67, 0.378]),
        implicit(|| Box::new(GeneralizedAlpha::wbz(0.5).unwrap()), 2, 0.5, [6.22, 1.27]),
        implicit(|| Box::new(GeneralizedAlpha::chung_hulbert(0.9).unwrap()), 2, 0.9, [3.25, 0.002]),
        implicit(|| Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()), 2, 0.8, [3.383, 0.016]),
        implicit(|| Box::new(GeneralizedAlpha::chung_hulbert(0.5).unwrap()), 2, 0.5, [4.67, 0.378]),
        implicit(|| Box::new(GeneralizedAlpha::chung_hulbert(0.0).unwrap()), 2, 0.0, [12.321, 5.499]),
        implicit(|| Box::new(Gssss::new(0.8, 0.8, 0.8).unwrap()), 2, 0.8, [3.383, 0.016]),
        implicit(|| Box::new(Gssss::new(1.0, 1.0, 0.0).unwrap()), 2, 1.0, [3.207, 0.0]),
        implicit(|| Box::new(Houbolt), 2, 0.0, [12.321, 5.499]),
        implicit(|| Box::new(Park), 2, 0.0, [6.707, 0.445]),
        implicit(|| Box::new(Bdf2), 2, 0.0, [10.206, 3.443]),
        implicit(|| Box::new(Oalts::new(0.5).unwrap()), 2, 0.5, None),
        implicit(|| Box::new(Bathe::default()), 2, 0.0, [1.571, 0.087]),
        implicit(|| Box::new(Bathe::new(0.5).unwrap()), 2, 0.0, [1.62, 0.082]),
        implicit(|| Box::new(Bathe::with_radius(0.5).unwrap()), 2, 0.5, [1.149, 0.046]),
        implicit(|| Box::new(Bathe::with_radius(0.9).unwrap()), 2, 0.9, [0.88, 0.009]),
        implicit(|| Box::new(Bathe::with_radius(1.0).unwrap()), 2, 1.0, [0.817, 0.0]),
        implicit(|| Box::new(MoreauJean::new(0.5).unwrap()), 2, 1.0, [3.207, 0.0]),
        implicit(|| Box::new(MoreauJean::new(1.0).unwrap()), 1, 0.0, [12.003, 29.657]),
        implicit(|| Box::new(EnergyMomentum), 2, 1.0, [3.207, 0.0]),
        explicit(|| Box::new(CentralDifference), 2, 2.0, [-1.693, 0.0]),
        explicit(|| Box::new(CdLagrange), 2, 2.0, [-1.693, 0.0]),
        explicit(|| Box::new(TchamwaWielgosz::new(1.033).unwrap()), 1, 1.937, [-2.021, 1.022]),
        explicit(|| Box::new(ChungLee::new(28.0 / 27.0).unwrap()), 2, 1.8665, [-1.092, 0.445]),
        explicit(|| Box::new(HulbertChung::new(0.8).unwrap()), 2, 1.9758, [-1.654, 0.018]),
        explicit(|| Box::new(HulbertChung::new(0.5).unwrap()), 2, 1.8665, [-1.092, 0.445]),
        explicit(|| Box::new(NohBathe::new(0.54).unwrap()), 2, 3.745, [-0.247, 0.052]),
        explicit(|| Box::new(NohBathe::with_radius(0.0).unwrap()), 2, 3.571, [-0.11, 0.091]),
    ]
}

/// Those that impose rigid contact on the displacements of the state: corrections apply.
pub fn correctable() -> impl Iterator<Item = Listed> {
    all().into_iter().filter(|listed| listed.takes_corrections() && listed.takes_multipliers())
}
