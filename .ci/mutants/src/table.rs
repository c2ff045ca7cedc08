//! Scores with their intervals, as a table.

/// What was found of a room.
#[derive(Clone, Debug, Default)]
pub struct Count {
    /// Mutants that there are.
    pub all: usize,
    pub drawn: usize,
    pub not_compiling: usize,
    pub killed: usize,
    /// Of those that are killed.
    pub late: usize,
    pub not_reached: usize,
    /// Reached by tests that do not see them.
    pub alive: usize,
    /// Those in which nothing can be seen.
    pub equivalent: usize,
}

impl Count {
    fn judged(&self) -> usize {
        self.drawn - self.equivalent
    }

    /// Mutants of the room that compile and can be seen, as the sample has it.
    fn weight(&self) -> f64 {
        self.all as f64 * self.judged() as f64 / (self.drawn + self.not_compiling).max(1) as f64
    }
}

/// Two-sided 95 % of the normal distribution.
const Z: f64 = 1.96;

/// Wilson's interval of a share, in percent.
fn interval(killed: usize, judged: usize) -> [f64; 2] {
    let (n, share) = (judged as f64, killed as f64 / judged as f64);
    let (middle, scale) = (share + Z * Z / (2.0 * n), 1.0 + Z * Z / n);
    let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    [(middle - half) / scale * 100.0, (middle + half) / scale * 100.0]
}

/// The share of all mutants that are killed, in percent: rooms count with the mutants that they have. Its variance is
/// that of a layered sample, with two more that are killed and two that are not in each room (Agresti and Coull).
fn overall(rooms: &[Count]) -> (f64, [f64; 2]) {
    let sum: f64 = rooms.iter().map(Count::weight).sum();
    let (mut share, mut variance) = (0.0, 0.0);
    for room in rooms.iter().filter(|room| room.judged() > 0) {
        let (weight, n) = (room.weight() / sum, room.judged() as f64);
        share += weight * room.killed as f64 / n;
        let cautious = (room.killed as f64 + 2.0) / (n + 4.0);
        variance += weight * weight * cautious * (1.0 - cautious) / (n + 4.0);
    }
    let half = Z * variance.sqrt();
    (share * 100.0, [(share - half) * 100.0, ((share + half) * 100.0).min(100.0)])
}

pub fn print(rooms: &[(&str, Count)]) -> String {
    let mut text = String::from(
        "| room | mutants | drawn | of these killed | by time | not seen | not reached | equivalent | score % | \
         95 % interval | drawn in vain |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut row = |name: &str, count: &Count, score: f64, [low, high]: [f64; 2]| {
        let Count { all, drawn, not_compiling, killed, late, not_reached, alive, equivalent } = count;
        text += &format!(
            "| {name} | {all} | {drawn} | {killed} | {late} | {alive} | {not_reached} | {equivalent} | {score:.0} | \
             {low:.0} to {high:.0} | {not_compiling} |\n"
        );
    };
    let mut sum = Count::default();
    for (name, count) in rooms {
        let score = 100.0 * count.killed as f64 / count.judged().max(1) as f64;
        row(name, count, score, interval(count.killed, count.judged().max(1)));
        sum.all += count.all;
        sum.drawn += count.drawn;
        sum.not_compiling += count.not_compiling;
        sum.killed += count.killed;
        sum.late += count.late;
        sum.not_reached += count.not_reached;
        sum.alive += count.alive;
        sum.equivalent += count.equivalent;
    }
    let counts: Vec<Count> = rooms.iter().map(|(_, count)| count.clone()).collect();
    let (score, limits) = overall(&counts);
    row("all, by their mutants", &sum, score, limits);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_the_literature() {
        // Newcombe, Statistics in Medicine 17 (1998), table I, method 3: 81/263 and 1/29.
        for (killed, judged, expected) in [(81, 263, [25.53, 36.62]), (1, 29, [0.61, 17.18])] {
            for (found, expected) in interval(killed, judged).iter().zip(expected) {
                assert!((found - expected).abs() < 0.006, "{found} {expected}");
            }
        }
    }

    #[test]
    fn rooms_count_with_their_mutants() {
        let room = |all, killed| Count { all, drawn: 10, killed, ..Count::default() };
        let (score, [low, high]) = overall(&[room(300, 10), room(100, 0)]);
        assert!((score - 75.0).abs() < 1e-12 && low < score && score < high && high - low < 40.0, "{low} {high}");
    }
}
