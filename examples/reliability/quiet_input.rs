//! Input that was quietly read differently: normals of any length, walls that move without rates.

use super::{Anything, Row};
use contact_dynamics::contact::GapOffset;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{ContactLaw, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Simulation};

/// Two free masses, the first one fixed, the second under a force of −10.
fn masses() -> Result<LinearSystem<'static, f64>, Anything> {
    let none = [Triplet::new(0, 0, 0.0), Triplet::new(1, 1, 0.0)];
    let k = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &none)?;
    Ok(LinearSystem::lumped(vec![1.0; 2], k)?.load(|_, f: &mut [f64]| f[1] = -10.0).fix(0)?)
}

/// Force on a weight of 10 and its speed after ten steps on a floor, or on one that lifts it at a constant speed.
fn force_and_speed(rows: LinearRows<'static, f64>, speed: f64) -> Result<String, Anything> {
    let built = Simulation::builder(masses()?, Newmark::trapezoidal(), 0.01)
        .velocity(vec![0.0, speed])
        .constraint(rows)
        .corrector(PersistencyCorrection::with_history_projection())
        .build();
    match built {
        Ok(mut run) => {
            for _ in 0..10 {
                run.step()?;
            }
            Ok(format!("{:.3}, {:.3}", run.state().contacts().forces()[0], run.state().velocity()[1]))
        }
        Err(error) => Ok(format!("refused: {}", error.to_string().split(';').next().unwrap_or_default())),
    }
}

pub(crate) fn cases(_: bool) -> Result<Vec<Row>, Anything> {
    let twice = LinearRows::new().pair(ContactLaw::Rigid, [0], [1], [2.0], 0.0)?;
    let silent = LinearRows::new().unilateral(&[(1, 1.0)], GapOffset::moving(|t| [-3.0 * t, 0.0, 0.0]));
    Ok(vec![
        Row {
            case: "`LinearRows::pair` with a normal of length 2: force on a weight of 10 and its speed".into(),
            before: TWICE_BEFORE,
            now: force_and_speed(twice, 0.0)?,
        },
        Row {
            case:
                "A floor that rises with speed 3 and gives no rates: force on a weight of 10 that it carries and its \
                   speed"
                    .into(),
            before: SILENT_BEFORE,
            now: force_and_speed(silent, 3.0)?,
        },
    ])
}

const TWICE_BEFORE: &str = "5.000, 0.000";
const SILENT_BEFORE: &str = "10.000, 0.000";
