//! Pairs of facets that may be in contact: lists kept over many steps, and the pairs that are near now.

use crate::contact::surface::{Base, Bounds, Material, Neighborhood, Point, Surface};

/// For each slave facet the master facets near it.
#[derive(Debug, Default)]
pub(super) struct Pairs {
    lists: Neighborhood,
    /// The boxes and normals of the master's facets, each used by several slave facets, and the normals of the
    /// slave's facets, used by their neighbors.
    masters: Vec<(Bounds, Option<Point>)>,
    normals: Vec<Option<Point>>,
    starts: Vec<usize>,
    near: Vec<usize>,
    /// The previous `starts` and `near`.
    before: [Vec<usize>; 2],
}

impl Pairs {
    pub(super) fn clear(&mut self) {
        self.near.clear();
        self.starts.clear();
    }

    /// Rebuilds the lists of facets within `range`.
    pub(super) fn build(&mut self, [slave, master]: [&Surface; 2], positions: &[Point], range: f64) {
        self.lists.build(slave.boxes(positions), master.boxes(positions), range);
    }

    /// Selects from the lists the pairs that face each other within `range`, penetrate by at most `depth`, do not
    /// belong to facets behind sharp edges, and do not face each other through both bodies. Returns whether the pairs
    /// have changed. The result does not depend on the age of the lists.
    pub(super) fn take_near(
        &mut self,
        [slave, master]: [&Surface; 2],
        [own, other]: [&Material; 2],
        positions: &[Point],
        (range, depth): (f64, f64),
    ) -> bool {
        std::mem::swap(&mut self.starts, &mut self.before[0]);
        std::mem::swap(&mut self.near, &mut self.before[1]);
        self.clear();
        self.starts.push(0);
        let Self { lists, masters, normals, starts, near, before } = self;
        masters.clear();
        masters.extend(master.boxes(positions).zip(master.facets().iter().map(|facet| facet.normal(positions))));
        normals.clear();
        normals.extend(slave.facets().iter().map(|facet| facet.normal(positions)));
        for (index, facet) in slave.facets().iter().enumerate() {
            let listed = lists.of(index);
            if let Some(mut base) = Base::new(facet, positions).filter(|_| !listed.is_empty()) {
                base.see_beside(slave, index, (positions, normals));
                let around = Bounds::of_corners(&base.shape).inflated(range);
                let behind = own.behind_facet(slave, index);
                near.extend(listed.iter().copied().filter(|&partner| {
                    let (bounds, normal) = &masters[partner];
                    let between = behind + other.behind_facet(master, partner);
                    let facet = &master.facets()[partner];
                    let meets = |normal| base.may_meet(normal, facet, positions, depth);
                    around.intersects(bounds)
                        && normal.is_some_and(meets)
                        && !base.has_beside(facet, positions)
                        && !base.is_deeper(facet, positions, between)
                }));
            }
            starts.push(near.len());
        }
        before[0] != *starts || before[1] != *near
    }

    /// The master facets near a slave facet, ascending.
    pub(super) fn of(&self, facet: usize) -> &[usize] {
        match self.starts.get(facet..facet + 2) {
            Some(range) => &self.near[range[0]..range[1]],
            None => &[],
        }
    }
}
