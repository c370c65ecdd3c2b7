//! Linear equations with small whole coefficients, solved by substitution: exact, and as sparse as the equations.

/// `sum of coefficient * unknown + constant`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Affine {
    /// Unknowns in rising order with their coefficients, none of them 0.
    pub terms: Vec<(u32, f64)>,
    pub constant: f64,
}

impl Affine {
    /// From terms in any order.
    pub fn new(mut terms: Vec<(u32, f64)>, constant: f64) -> Affine {
        terms.sort_unstable_by_key(|t| t.0);
        let mut sum: Vec<(u32, f64)> = Vec::with_capacity(terms.len());
        for (unknown, c) in terms {
            match sum.last_mut() {
                Some(last) if last.0 == unknown => last.1 += c,
                _ => sum.push((unknown, c)),
            }
        }
        sum.retain(|t| t.1 != 0.0);
        Affine { terms: sum, constant }
    }
}

/// Unknowns of which some are expressed by others.
pub(super) struct Elimination {
    known: Vec<Option<Affine>>,
    /// The first unknowns, so many, go before the others.
    first: u32,
    /// For each of the others how many unknowns it would drag along where it is left; empty if that does not matter.
    drag: Vec<u32>,
}

/// A constant that is left of an equation without unknowns counts as zero up to this.
const CONTRADICTION: f64 = 1e-6;

impl Elimination {
    /// * `first` - so many of the unknowns are expressed by the others rather than the other way around
    pub fn new(unknowns: usize, first: u32) -> Elimination {
        Elimination { known: vec![None; unknowns], first, drag: Vec::new() }
    }

    /// As [`Elimination::new`] for equations with coefficients of 1 and 2. First unknowns go even if that takes halves, which are as exact,
    /// and of the others those with the least `drag`.
    pub fn sparse(first: u32, drag: Vec<u32>) -> Elimination {
        Elimination { known: vec![None; first as usize + drag.len()], first, drag }
    }

    /// Demands that `terms + constant` is zero. False if that contradicts what was demanded before.
    ///
    /// The unknown that goes is one with a coefficient of 1 or -1 if there is any, of the first ones rather than the others,
    /// and of these the last.
    pub fn demand(&mut self, terms: Vec<(u32, f64)>, constant: f64) -> bool {
        let sum = self.expand(&terms, constant);
        let pivot = sum.terms.iter().min_by(|a, b| {
            let order = |t: &(u32, f64)| {
                let is_whole = t.1.abs() == 1.0;
                let is_exact = is_whole || (!self.drag.is_empty() && t.1.abs() == 2.0);
                let drag = t.0.checked_sub(self.first).and_then(|i| self.drag.get(i as usize)).copied();
                (!is_exact, t.0 >= self.first, drag, !is_whole, u32::MAX - t.0)
            };
            order(a).cmp(&order(b))
        });
        let Some(&(pivot, c)) = pivot else { return sum.constant.abs() <= CONTRADICTION };
        let rest = sum.terms.into_iter().filter(|t| t.0 != pivot).map(|(u, d)| (u, -d / c)).collect();
        self.known[pivot as usize] = Some(Affine { terms: rest, constant: -sum.constant / c });
        true
    }

    /// An unknown by those that are left.
    pub fn value(&mut self, unknown: u32) -> Affine {
        self.expand(&[(unknown, 1.0)], 0.0)
    }

    fn expand(&mut self, terms: &[(u32, f64)], constant: f64) -> Affine {
        for &(unknown, _) in terms {
            self.settle(unknown);
        }
        self.substitute(terms, constant)
    }

    /// Puts in what is known, one level deep.
    fn substitute(&self, terms: &[(u32, f64)], constant: f64) -> Affine {
        let mut sum = constant;
        let mut all = Vec::with_capacity(terms.len());
        for &(unknown, c) in terms {
            match &self.known[unknown as usize] {
                None => all.push((unknown, c)),
                Some(known) => {
                    sum += c * known.constant;
                    all.extend(known.terms.iter().map(|&(u, d)| (u, c * d)));
                }
            }
        }
        Affine::new(all, sum)
    }

    /// Expresses an unknown by those that are left, and on the way all that it depends on.
    fn settle(&mut self, unknown: u32) {
        let mut stack = vec![unknown];
        while let Some(&top) = stack.last() {
            let Some(known) = &self.known[top as usize] else {
                stack.pop();
                continue;
            };
            let stale = |u: u32| {
                self.known[u as usize]
                    .as_ref()
                    .is_some_and(|k| k.terms.iter().any(|t| self.known[t.0 as usize].is_some()))
            };
            let before = stack.len();
            let pending: Vec<u32> = known.terms.iter().map(|t| t.0).filter(|&u| stale(u)).collect();
            stack.extend(pending);
            if stack.len() == before {
                if known.terms.iter().any(|t| self.known[t.0 as usize].is_some()) {
                    let flat = self.substitute(&known.terms, known.constant);
                    self.known[top as usize] = Some(flat);
                }
                stack.pop();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_of_10_000_equations_ends_in_its_one_free_unknown() {
        let mut system = Elimination::new(10_001, 10_001);
        for i in (0..10_000).rev() {
            assert!(system.demand(vec![(i + 1, 1.0), (i, -1.0)], -2.0));
        }
        assert_eq!(system.value(10_000), Affine { terms: vec![(0, 1.0)], constant: 20_000.0 });
        assert!(system.demand(vec![(10_000, 1.0)], -5.0));
        assert_eq!(system.value(5_000).constant, 5.0 - 10_000.0);
        assert!(!system.demand(vec![(0, 1.0)], 0.0), "0 is 19 995 off by now");
    }
}
