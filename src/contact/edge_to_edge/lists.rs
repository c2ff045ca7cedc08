//! The edges at which surfaces turn, and lists of those near each other.

use super::edges::Edge;
use crate::contact::surface::{Neighborhood, Nodes, Surface, Vicinity};

#[derive(Debug, Default)]
pub(super) struct Lists {
    /// By edge of either surface, whether the surface turned there at the last search.
    sharp: [Vec<bool>; 2],
    /// The edges that were sharp when the neighborhood was built.
    listed: [Vec<usize>; 2],
    /// For each listed edge of the first surface the places of those near it in the list of the second.
    near: Neighborhood,
}

impl Lists {
    /// Forgets which edges are sharp.
    pub(super) fn restart(&mut self) {
        self.sharp.iter_mut().for_each(Vec::clear);
    }

    /// Finds the edges around which the surfaces turn by more than an angle, once after a restart, and makes the lists
    /// complete for them and for distances up to `range`.
    pub(super) fn update(
        &mut self,
        (edges, surfaces): (&[Vec<Edge>; 2], &[Surface; 2]),
        angle: f64,
        (nodes, vicinity): (&Nodes, &mut Vicinity),
        range: f64,
    ) {
        let angle = angle.sin_cos().into();
        let [first, second] = &mut self.sharp;
        if first.is_empty() {
            let turns = |surface: &Surface, edge: &Edge| edge.is_sharp(surface, angle, &nodes.positions);
            first.extend(edges[0].iter().map(|edge| turns(&surfaces[0], edge)));
            match vicinity.is_of_itself() {
                true => second.clone_from(first),
                false => second.extend(edges[1].iter().map(|edge| turns(&surfaces[1], edge))),
            }
        }
        let (Self { sharp, listed, near }, Vicinity { reach, .. }) = (self, vicinity);
        let are_listed = |(sharp, listed): (&Vec<bool>, &Vec<usize>)| {
            let count = sharp.iter().filter(|&&sharp| sharp).count();
            count == listed.iter().filter(|&&edge| sharp.get(edge) == Some(&true)).count()
        };
        if !sharp.iter().zip(&*listed).all(are_listed) {
            reach.forget();
        }
        let Some(range) = reach.renew(&reach.motions(nodes), range, &nodes.positions) else { return };
        for (listed, sharp) in listed.iter_mut().zip(sharp) {
            listed.clear();
            listed.extend((0..sharp.len()).filter(|&edge| sharp[edge]));
        }
        let [one, other] = [0, 1].map(|body: usize| {
            let edges = &edges[body];
            listed[body].iter().map(|&edge| edges[edge].bounds(&nodes.positions))
        });
        near.build(one, other, range);
    }

    /// The pairs of sharp edges that are near each other.
    pub(super) fn pairs(&self) -> impl Iterator<Item = [usize; 2]> {
        let Self { sharp, listed: [firsts, seconds], near } = self;
        let firsts = firsts.iter().enumerate().filter(|&(_, &first)| sharp[0][first]);
        firsts.flat_map(move |(place, &first)| {
            let seconds = near.of(place).iter().map(|&place| seconds[place]);
            seconds.filter(|&second| sharp[1][second]).map(move |second| [first, second])
        })
    }
}
