//! Parameters of schemes: those of their ranges are taken, ends included; others, and NaN, are refused with the number.

use contact_dynamics::{
    Bathe, ChungLee, Error, GeneralizedAlpha, Gssss, HulbertChung, MoreauJean, Newmark, NohBathe, Oalts, Result,
    TchamwaWielgosz, TimeIntegrator,
};

type Scheme = Box<dyn TimeIntegrator>;

fn boxed<I: TimeIntegrator + 'static>(made: Result<I>) -> Result<Scheme> {
    made.map(|scheme| Box::new(scheme) as Scheme)
}

/// A parameter with its range; least and most as their papers have them.
type Ranged = (&'static str, fn(f64) -> Result<Scheme>, [f64; 2]);

const PARAMETERS: [Ranged; 22] = [
    ("Newmark, β", |x| boxed(Newmark::new(x, 0.5)), [f64::MIN_POSITIVE, 1.0]),
    ("Newmark, γ", |x| boxed(Newmark::new(0.25, x)), [0.5, 1.0]),
    ("Chung–Hulbert", |x| boxed(GeneralizedAlpha::chung_hulbert(x)), [0.0, 1.0]),
    ("HHT-α", |x| boxed(GeneralizedAlpha::hht(x)), [0.5, 1.0]),
    ("WBZ-α", |x| boxed(GeneralizedAlpha::wbz(x)), [0.0, 1.0]),
    ("generalized-α, α_m", |x| boxed(GeneralizedAlpha::new(x, 0.5, 0.25, 0.5)), [-1.0, 0.5]),
    ("generalized-α, α_f", |x| boxed(GeneralizedAlpha::new(0.0, x, 0.25, 0.5)), [0.0, 0.5]),
    ("generalized-α, β", |x| boxed(GeneralizedAlpha::new(0.0, 0.0, x, 0.5)), [f64::MIN_POSITIVE, 1.0]),
    ("generalized-α, γ", |x| boxed(GeneralizedAlpha::new(0.0, 0.0, 0.25, x)), [0.5, 1.5]),
    ("Bathe, γ", |x| boxed(Bathe::new(x)), [0.01, 0.99]),
    ("ρ∞-Bathe", |x| boxed(Bathe::with_radius(x)), [0.0, 1.0]),
    ("Noh–Bathe, p", |x| boxed(NohBathe::new(x)), [0.5, 2.0 - std::f64::consts::SQRT_2]),
    ("Noh–Bathe, ρ", |x| boxed(NohBathe::with_radius(x)), [0.0, 1.0]),
    ("Tchamwa–Wielgosz, φ", |x| boxed(TchamwaWielgosz::new(x)), [1.0, 2.0]),
    ("Tchamwa–Wielgosz, ρ", |x| boxed(TchamwaWielgosz::with_radius(x)), [0.0, 1.0]),
    ("Hulbert–Chung", |x| boxed(HulbertChung::new(x)), [0.0, 1.0]),
    ("Chung–Lee", |x| boxed(ChungLee::new(x)), [1.0, 28.0 / 27.0]),
    ("Moreau–Jean", |x| boxed(MoreauJean::new(x)), [0.5, 1.0]),
    ("two-step family", |x| boxed(Oalts::new(x)), [0.0, 1.0]),
    ("GSSSS, ρ₁", |x| boxed(Gssss::new(x, 0.8, 0.3)), [0.3, 0.8]),
    ("GSSSS, ρ₂", |x| boxed(Gssss::new(0.4, x, 0.0)), [0.4, 1.0]),
    ("GSSSS, ρ₃", |x| boxed(Gssss::new(0.4, 0.8, x)), [0.0, 0.4]),
];

#[test]
fn parameters_have_their_ranges() {
    for (name, make, [least, most]) in PARAMETERS {
        for inside in [least, 0.5 * (least + most), most] {
            if let Err(error) = make(inside) {
                panic!("{name}: {inside} is refused: {error}");
            }
        }
        let beyond = 1e-3 * (most - least);
        for outside in [least - beyond, most + beyond, f64::NEG_INFINITY, f64::INFINITY, f64::NAN] {
            match make(outside).map(|scheme| scheme.name()) {
                Err(Error::Parameter { value, range, .. }) => {
                    assert!(
                        !range.is_empty()
                            && (value.to_bits() == outside.to_bits()
                                || !value.is_finite()
                                || name.starts_with("GSSSS"))
                    );
                }
                taken => panic!("{name}: {outside}: {taken:?}"),
            }
        }
    }
}
