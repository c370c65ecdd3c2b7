//! Changes that do not touch each other, so that they can be made together.

use std::collections::HashSet;

/// The parts (vertices, cells, arcs) that the changes of a batch touch.
#[derive(Default)]
pub(crate) struct Taken(HashSet<u32>);

impl Taken {
    /// True if no change touches one of `parts`.
    pub fn spares(&self, parts: &[u32]) -> bool {
        !parts.iter().any(|p| self.0.contains(p))
    }

    /// Adds a change that touches `parts`.
    pub fn add(&mut self, parts: &[u32]) {
        self.0.extend(parts);
    }
}

/// The changes made of `items` in their order, each of which touches no part that one before it touches, and the items
/// that have to wait for the next batch.
/// * `parts` - what the change of an item touches
/// * `change` - the change; an item without one touches nothing and does not wait
pub(crate) fn disjoint<T, C>(
    items: impl IntoIterator<Item = T>,
    parts: impl Fn(&T) -> Vec<u32>,
    change: impl Fn(T) -> Option<C>,
) -> (Vec<C>, Vec<T>) {
    let mut taken = Taken::default();
    let (mut now, mut later) = (Vec::new(), Vec::new());
    for item in items {
        let touched = parts(&item);
        if !taken.spares(&touched) {
            later.push(item);
        } else if let Some(change) = change(item) {
            taken.add(&touched);
            now.push(change);
        }
    }
    (now, later)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_touches_an_earlier_change_waits_and_what_changes_nothing_holds_nobody_up() {
        let items = [[1, 2], [2, 3], [3, 4], [4, 5], [6, 7]];
        let (now, later) = disjoint(items, |x| x.to_vec(), |x| (x != [3, 4]).then_some(x));
        assert_eq!((now, later), (vec![[1, 2], [4, 5], [6, 7]], vec![[2, 3]]));
    }
}
