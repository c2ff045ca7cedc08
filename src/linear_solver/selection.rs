//! Places in a vector that belong together, such as the dofs of a body or along a string.

use std::ops::Range;

/// Places in a vector, in any order without repetition.
#[derive(Debug)]
pub(super) enum Selection {
    /// Runs of consecutive places: the number of the first one in the selection, the places, and their direction.
    Runs(Vec<(usize, Range<usize>, Direction)>),
    List(Vec<usize>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Up,
    Down,
}

/// Average length of runs from which runs are faster than a list.
const RUN: usize = 8;

impl Selection {
    pub(super) fn new(order: Vec<usize>) -> Self {
        let mut runs: Vec<(usize, Range<usize>, Direction)> = Vec::new();
        for (place, &dof) in order.iter().enumerate() {
            match runs.last_mut() {
                Some((_, dofs, Direction::Up)) if dofs.end == dof => dofs.end += 1,
                Some((_, dofs, Direction::Down)) if dofs.start == dof + 1 => dofs.start -= 1,
                Some((_, dofs, direction)) if dofs.len() == 1 && dofs.start == dof + 1 => {
                    (*dofs, *direction) = (dof..dof + 2, Direction::Down);
                }
                _ => runs.push((place, dof..dof + 1, Direction::Up)),
            }
        }
        if runs.len() < 2 || RUN * runs.len() <= order.len() { Self::Runs(runs) } else { Self::List(order) }
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::Runs(runs) => runs.last().map_or(0, |(number, places, _)| number + places.len()),
            Self::List(list) => list.len(),
        }
    }

    /// The place with a number.
    pub(super) fn at(&self, number: usize) -> usize {
        match self {
            Self::Runs(runs) => {
                let (first, places, direction) = &runs[runs.partition_point(|run| run.0 <= number) - 1];
                match direction {
                    Direction::Up => places.start + (number - first),
                    Direction::Down => places.end - 1 - (number - first),
                }
            }
            Self::List(list) => list[number],
        }
    }

    /// The places, if they are one ascending run.
    pub(super) fn range(&self) -> Option<Range<usize>> {
        match self {
            Self::Runs(runs) => match &runs[..] {
                [] => Some(0..0),
                [(_, places, Direction::Up)] => Some(places.clone()),
                _ => None,
            },
            Self::List(_) => None,
        }
    }

    /// The selected values, copied to `scratch` unless they are one ascending run.
    pub(super) fn read<'x, T: Copy>(&self, x: &'x [T], scratch: &'x mut [T]) -> &'x [T] {
        if let Some(places) = self.range() {
            return &x[places];
        }
        let scratch = &mut scratch[..self.len()];
        self.gather(x, scratch);
        scratch
    }

    pub(super) fn gather<T: Copy>(&self, from: &[T], to: &mut [T]) {
        match self {
            Self::Runs(runs) => {
                for (place, dofs, direction) in runs {
                    let to = &mut to[*place..place + dofs.len()];
                    match direction {
                        Direction::Up => to.copy_from_slice(&from[dofs.clone()]),
                        Direction::Down => {
                            to.iter_mut().zip(from[dofs.clone()].iter().rev()).for_each(|(to, &from)| *to = from);
                        }
                    }
                }
            }
            Self::List(order) => to.iter_mut().zip(order).for_each(|(to, &dof)| *to = from[dof]),
        }
    }

    pub(super) fn scatter<T: Copy>(&self, from: &[T], to: &mut [T]) {
        match self {
            Self::Runs(runs) => {
                for (place, dofs, direction) in runs {
                    let from = &from[*place..place + dofs.len()];
                    match direction {
                        Direction::Up => to[dofs.clone()].copy_from_slice(from),
                        Direction::Down => {
                            to[dofs.clone()].iter_mut().rev().zip(from).for_each(|(to, &from)| *to = from);
                        }
                    }
                }
            }
            Self::List(order) => from.iter().zip(order).for_each(|(&from, &dof)| to[dof] = from),
        }
    }

    /// Calls `call` with every number and its place, in that order.
    pub(super) fn for_each(&self, mut call: impl FnMut(usize, usize)) {
        match self {
            Self::Runs(runs) => {
                for (place, dofs, direction) in runs {
                    match direction {
                        Direction::Up => (*place..).zip(dofs.clone()).for_each(|(place, dof)| call(place, dof)),
                        Direction::Down => (*place..).zip(dofs.clone().rev()).for_each(|(place, dof)| call(place, dof)),
                    }
                }
            }
            Self::List(order) => order.iter().enumerate().for_each(|(place, &dof)| call(place, dof)),
        }
    }
}
