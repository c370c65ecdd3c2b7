//! Formulas: functions of x, y and z as text, such as `x^2 + y^2 - 1`.
//!
//! 1. text to a postfix list of operations, every fault with its column - `Formula::parse`
//! 2. values with gradients, by forward differentiation - `Slope`
//! 3. bounds of the values over a box, by interval arithmetic, so that empty boxes are skipped - `Range`
//!
//! Both walk the same list: [G08] Griewank, Walther, *Evaluating Derivatives*, §3.1 (forward mode); [M66] Moore, *Interval
//! Analysis*, ch. 3 (the natural extension; results are rounded outwards by one unit in the last place).

use crate::geom::Aabb;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// Operands that wait at most: brackets, powers and calls within each other.
const DEEPEST: usize = 64;
/// Letters of a formula at most: a sum of twenty thousand terms, and no file by mistake.
const LONGEST: usize = 1 << 17;
/// Whole powers up to this are products; others are what the machine's power function says.
const LARGEST_PRODUCT: i32 = 16;

/// A function of x, y and z. Negative inside, positive outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    text: Arc<str>,
    steps: Arc<[Step]>,
}

/// What is wrong with a formula.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} (column {column} of the formula) - hint: {hint}")]
pub struct FormulaError {
    /// What is wrong.
    pub what: String,
    /// Letter of the text, from 1.
    pub column: usize,
    /// What to do.
    pub hint: String,
}

/// One operation on the operands that wait.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Number(f64),
    Axis(usize),
    One(One),
    Two(Two),
    /// To a whole power.
    Power(i32),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum One {
    Minus,
    Abs,
    Sqrt,
    Exp,
    Log,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Two {
    Plus,
    Minus,
    Times,
    Over,
    Power,
    Min,
    Max,
    Atan2,
}

const ONES: [(&str, One); 14] = [
    ("abs", One::Abs),
    ("sqrt", One::Sqrt),
    ("exp", One::Exp),
    ("log", One::Log),
    ("ln", One::Log),
    ("sin", One::Sin),
    ("cos", One::Cos),
    ("tan", One::Tan),
    ("asin", One::Asin),
    ("acos", One::Acos),
    ("atan", One::Atan),
    ("sinh", One::Sinh),
    ("cosh", One::Cosh),
    ("tanh", One::Tanh),
];
/// Functions of two values; `min` and `max` take more.
const TWOS: [(&str, Two); 3] = [("min", Two::Min), ("max", Two::Max), ("atan2", Two::Atan2)];
const NAMES: &str =
    "x, y, z, pi, e, abs, sqrt, exp, log, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, min, max, atan2";

impl Formula {
    /// Reads a formula: numbers, `x`, `y`, `z`, `pi`, `e`; `+ - * / ^` (also `**`; powers from the right, and before a sign);
    /// brackets; `abs sqrt exp log (ln) sin cos tan asin acos atan sinh cosh tanh` of one value, `atan2(y, x)`, `min` and
    /// `max` of two or more. Angles are radians.
    /// # Errors
    /// [`FormulaError`] with the column of the fault.
    pub fn parse(text: &str) -> Result<Formula, FormulaError> {
        let mut reader = Reader { letters: text.chars().collect(), at: 0, steps: Vec::new(), waiting: 0 };
        if reader.letters.len() > LONGEST {
            return Err(reader.fault(format!("the formula has more than {LONGEST} letters"), "shorten it"));
        }
        reader.sum(0)?;
        if reader.peek().is_some() {
            return Err(reader.unexpected());
        }
        Ok(Formula { text: text.into(), steps: reader.steps.into() })
    }

    /// The text as it was given.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Value and unit gradient at `p`; NaN where the formula has no value, zero where it has no gradient.
    pub fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        let found = self.walk(|axis| Slope { value: p[axis], slope: DVec3::AXES[axis] });
        (found.value, found.slope.try_normalize().unwrap_or(DVec3::ZERO))
    }

    /// Least and greatest value over a box; without bounds if there may be places without a value.
    pub fn interval(&self, aabb: &Aabb) -> [f64; 2] {
        let found = self.walk(|axis| Range { low: aabb.min[axis], high: aabb.max[axis] });
        [found.low, found.high]
    }

    fn walk<N: Number>(&self, variable: impl Fn(usize) -> N) -> N {
        let mut waiting = [N::of(0.0); DEEPEST];
        let mut n = 0;
        for step in self.steps.iter() {
            match *step {
                Step::Number(x) => {
                    waiting[n] = N::of(x);
                    n += 1;
                }
                Step::Axis(axis) => {
                    waiting[n] = variable(axis);
                    n += 1;
                }
                Step::One(one) => waiting[n - 1] = waiting[n - 1].one(one),
                Step::Power(k) => waiting[n - 1] = waiting[n - 1].whole_power(k),
                Step::Two(two) => {
                    n -= 1;
                    waiting[n - 1] = waiting[n - 1].two(two, waiting[n]);
                }
            }
        }
        waiting[0]
    }
}

/// A formula's text on its way to steps.
struct Reader {
    letters: Vec<char>,
    at: usize,
    steps: Vec<Step>,
    /// Operands that wait at this point.
    waiting: usize,
}

impl Reader {
    fn peek(&mut self) -> Option<char> {
        while self.letters.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.letters.get(self.at).copied()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    fn fault(&self, what: impl Into<String>, hint: impl Into<String>) -> FormulaError {
        FormulaError { what: what.into(), column: self.at + 1, hint: hint.into() }
    }

    fn unexpected(&mut self) -> FormulaError {
        match self.peek() {
            None => self.fault("the formula ends where a value should follow", "finish it"),
            Some('=') => {
                self.fault("\"=\" has no place in a formula", "write left - right: the surface is where it is zero")
            }
            Some(',') => self.fault("a comma has no place here", "write decimals with a point"),
            Some(')') => self.fault("a bracket is closed that was not opened", "leave it out"),
            Some(c) if c.is_alphanumeric() || c == '(' => {
                self.fault(format!("an operator is missing before \"{c}\""), "write products with *")
            }
            Some(c) => self.fault(format!("\"{c}\" is not understood"), "operators are + - * / ^"),
        }
    }

    fn add(&mut self, step: Step) -> Result<(), FormulaError> {
        match step {
            Step::Number(_) | Step::Axis(_) => self.waiting += 1,
            Step::Two(_) => self.waiting -= 1,
            Step::One(_) | Step::Power(_) => {}
        }
        if self.waiting > DEEPEST {
            return Err(self.deep());
        }
        self.steps.push(step);
        Ok(())
    }

    fn deep(&self) -> FormulaError {
        self.fault("brackets and calls are nested too deep", format!("use at most {DEEPEST} levels"))
    }

    fn sum(&mut self, depth: usize) -> Result<(), FormulaError> {
        if depth > DEEPEST {
            return Err(self.deep());
        }
        self.product(depth)?;
        loop {
            let two = if self.take('+') {
                Two::Plus
            } else if self.take('-') {
                Two::Minus
            } else {
                return Ok(());
            };
            self.product(depth)?;
            self.add(Step::Two(two))?;
        }
    }

    fn product(&mut self, depth: usize) -> Result<(), FormulaError> {
        self.signed(depth)?;
        loop {
            let two = if self.take('*') {
                Two::Times
            } else if self.take('/') {
                Two::Over
            } else {
                return Ok(());
            };
            self.signed(depth)?;
            self.add(Step::Two(two))?;
        }
    }

    /// A sign holds for the whole power behind it: `-x^2` is `-(x^2)`.
    fn signed(&mut self, depth: usize) -> Result<(), FormulaError> {
        let mut minus = false;
        loop {
            if self.take('-') {
                minus = !minus;
            } else if !self.take('+') {
                break;
            }
        }
        self.power(depth)?;
        if minus { self.add(Step::One(One::Minus)) } else { Ok(()) }
    }

    fn power(&mut self, depth: usize) -> Result<(), FormulaError> {
        self.value(depth)?;
        if !self.takes_power() {
            return Ok(());
        }
        if depth > DEEPEST {
            return Err(self.deep());
        }
        let begin = self.steps.len();
        self.signed(depth + 1)?;
        // A whole number is the most common exponent, and takes no logarithm.
        let whole = |x: f64| x == x.trunc() && x.abs() <= f64::from(LARGEST_PRODUCT);
        let exponent = match self.steps[begin..] {
            [Step::Number(x)] if whole(x) => Some(x as i32),
            [Step::Number(x), Step::One(One::Minus)] if whole(x) => Some(-x as i32),
            _ => None,
        };
        match exponent {
            Some(k) => {
                self.steps.truncate(begin);
                self.waiting -= 1;
                self.add(Step::Power(k))
            }
            None => self.add(Step::Two(Two::Power)),
        }
    }

    fn takes_power(&mut self) -> bool {
        if self.peek() == Some('*') && self.letters.get(self.at + 1) == Some(&'*') {
            self.at += 2;
            return true;
        }
        self.take('^')
    }

    fn value(&mut self, depth: usize) -> Result<(), FormulaError> {
        match self.peek() {
            Some('(') => {
                self.at += 1;
                self.sum(depth + 1)?;
                self.close()
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() => self.name(depth),
            Some('*' | '/' | '^') => Err(self.fault("a value is missing before the operator", "write it")),
            _ => Err(self.unexpected()),
        }
    }

    fn close(&mut self) -> Result<(), FormulaError> {
        if self.take(')') {
            return Ok(());
        }
        match self.peek() {
            None => Err(self.fault("a bracket is not closed", "add \")\"")),
            _ => Err(self.unexpected()),
        }
    }

    fn number(&mut self) -> Result<(), FormulaError> {
        let begin = self.at;
        let digit = |c: Option<&char>| c.is_some_and(|c| c.is_ascii_digit() || *c == '.');
        while digit(self.letters.get(self.at)) {
            self.at += 1;
        }
        if matches!(self.letters.get(self.at), Some('e' | 'E')) {
            let sign = usize::from(matches!(self.letters.get(self.at + 1), Some('+' | '-')));
            if self.letters.get(self.at + 1 + sign).is_some_and(char::is_ascii_digit) {
                self.at += 1 + sign;
                while self.letters.get(self.at).is_some_and(char::is_ascii_digit) {
                    self.at += 1;
                }
            }
        }
        let text: String = self.letters[begin..self.at].iter().collect();
        match text.parse::<f64>() {
            Ok(x) if x.is_finite() => self.add(Step::Number(x)),
            _ => {
                self.at = begin;
                Err(self.fault(format!("\"{text}\" is no number"), "write it like 12.5 or 1.2e-3"))
            }
        }
    }

    fn name(&mut self, depth: usize) -> Result<(), FormulaError> {
        let begin = self.at;
        while self.letters.get(self.at).is_some_and(|c| c.is_alphanumeric() || *c == '_') {
            self.at += 1;
        }
        let name: String = self.letters[begin..self.at].iter().collect();
        let axis = ["x", "y", "z"].iter().position(|n| *n == name);
        let number = match name.as_str() {
            "pi" => Some(PI),
            "e" => Some(std::f64::consts::E),
            _ => None,
        };
        if let Some(step) = axis.map(Step::Axis).or(number.map(Step::Number)) {
            return self.add(step);
        }
        let one = ONES.iter().find(|(n, _)| *n == name).map(|o| o.1);
        let two = TWOS.iter().find(|(n, _)| *n == name).map(|t| t.1);
        if one.is_none() && two.is_none() {
            self.at = begin;
            return Err(self.fault(format!("\"{name}\" is no name of a formula"), format!("names are {NAMES}")));
        }
        if !self.take('(') {
            return Err(self.fault(format!("{name} needs a bracket"), format!("write {name}(...)")));
        }
        self.sum(depth + 1)?;
        let mut count = 1;
        while self.take(',') {
            count += 1;
            if one.is_some() || (two == Some(Two::Atan2) && count > 2) {
                self.at -= 1;
                let wanted = if one.is_some() { "one value" } else { "two values" };
                return Err(self.fault(format!("{name} takes {wanted}"), "write decimals with a point"));
            }
            self.sum(depth + 1)?;
            if let Some(two) = two {
                self.add(Step::Two(two))?;
            }
        }
        if two.is_some() && count < 2 {
            return Err(self.fault(format!("{name} takes two values"), format!("write {name}(a, b)")));
        }
        self.close()?;
        one.map_or(Ok(()), |one| self.add(Step::One(one)))
    }
}

/// What formulas are made of: values with gradients, or bounds of values.
trait Number: Copy {
    fn of(x: f64) -> Self;
    fn one(self, one: One) -> Self;
    fn two(self, two: Two, other: Self) -> Self;
    fn whole_power(self, k: i32) -> Self;
}

/// A product for small exponents, the same on every machine.
fn product(x: f64, k: i32) -> f64 {
    let mut power = 1.0;
    for _ in 0..k.unsigned_abs() {
        power *= x;
    }
    if k < 0 { 1.0 / power } else { power }
}

/// A value with its gradient.
#[derive(Clone, Copy)]
struct Slope {
    value: f64,
    slope: DVec3,
}

impl Slope {
    /// A function's value here, and what it rises by.
    fn chain(self, value: f64, rise: f64) -> Slope {
        // Where something does not change at all, an infinite rise of it is no change, either.
        let slope = if self.slope == DVec3::ZERO { DVec3::ZERO } else { self.slope * rise };
        Slope { value, slope }
    }
}

impl Number for Slope {
    fn of(x: f64) -> Slope {
        Slope { value: x, slope: DVec3::ZERO }
    }

    fn one(self, one: One) -> Slope {
        let x = self.value;
        match one {
            One::Minus => self.chain(-x, -1.0),
            One::Abs => self.chain(x.abs(), if x < 0.0 { -1.0 } else { 1.0 }),
            One::Sqrt => self.chain(x.sqrt(), 0.5 / x.sqrt()),
            One::Exp => self.chain(x.exp(), x.exp()),
            One::Log => self.chain(x.ln(), 1.0 / x),
            One::Sin => self.chain(x.sin(), x.cos()),
            One::Cos => self.chain(x.cos(), -x.sin()),
            One::Tan => self.chain(x.tan(), 1.0 + x.tan() * x.tan()),
            One::Asin => self.chain(x.asin(), 1.0 / (1.0 - x * x).sqrt()),
            One::Acos => self.chain(x.acos(), -1.0 / (1.0 - x * x).sqrt()),
            One::Atan => self.chain(x.atan(), 1.0 / (1.0 + x * x)),
            One::Sinh => self.chain(x.sinh(), x.cosh()),
            One::Cosh => self.chain(x.cosh(), x.sinh()),
            One::Tanh => self.chain(x.tanh(), 1.0 - x.tanh() * x.tanh()),
        }
    }

    fn two(self, two: Two, other: Slope) -> Slope {
        let (a, b) = (self, other);
        let unknown = Slope { value: f64::NAN, slope: DVec3::ZERO };
        match two {
            Two::Plus => Slope { value: a.value + b.value, slope: a.slope + b.slope },
            Two::Minus => Slope { value: a.value - b.value, slope: a.slope - b.slope },
            Two::Times => Slope { value: a.value * b.value, slope: a.slope * b.value + b.slope * a.value },
            Two::Over => {
                let value = a.value / b.value;
                Slope { value, slope: (a.slope - b.slope * value) / b.value }
            }
            Two::Power => {
                let value = a.value.powf(b.value);
                let base = a.chain(value, b.value * a.value.powf(b.value - 1.0)).slope;
                Slope { value, slope: base + b.chain(value, value * a.value.ln()).slope }
            }
            Two::Min | Two::Max if a.value.is_nan() || b.value.is_nan() => unknown,
            Two::Min => {
                if b.value < a.value {
                    b
                } else {
                    a
                }
            }
            Two::Max => {
                if b.value > a.value {
                    b
                } else {
                    a
                }
            }
            Two::Atan2 => {
                let square = a.value * a.value + b.value * b.value;
                Slope { value: a.value.atan2(b.value), slope: (a.slope * b.value - b.slope * a.value) / square }
            }
        }
    }

    fn whole_power(self, k: i32) -> Slope {
        if k == 0 {
            return Slope::of(1.0);
        }
        self.chain(product(self.value, k), f64::from(k) * product(self.value, k - 1))
    }
}

/// Bounds of a value.
#[derive(Clone, Copy)]
struct Range {
    low: f64,
    high: f64,
}

/// Nothing is known: the value may be anything, or none.
const ANY: Range = Range { low: f64::NEG_INFINITY, high: f64::INFINITY };

impl Range {
    /// Bounds of a result, rounded outwards.
    fn out(low: f64, high: f64) -> Range {
        if low.is_nan() || high.is_nan() { ANY } else { Range { low: low.next_down(), high: high.next_up() } }
    }

    /// What a function that rises makes of it, where it has values from `least` to `most`.
    fn rising(self, f: impl Fn(f64) -> f64, least: f64, most: f64) -> Range {
        if self.low >= least && self.high <= most { Range::out(f(self.low), f(self.high)) } else { ANY }
    }

    fn corners(all: [f64; 4]) -> Range {
        if all.iter().any(|x| x.is_nan()) {
            return ANY;
        }
        Range::out(all.into_iter().fold(f64::INFINITY, f64::min), all.into_iter().fold(f64::NEG_INFINITY, f64::max))
    }

    fn has(self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// Is `phase` plus a whole number of periods in it?
    fn meets(self, phase: f64, period: f64) -> bool {
        let next = phase + ((self.low - phase) / period).ceil() * period;
        next <= self.high
    }

    fn minus(self) -> Range {
        Range { low: -self.high, high: -self.low }
    }

    fn sine(self) -> Range {
        let is_within_a_turn = self.high - self.low < TAU;
        // Beyond this the machine's own argument is too coarse to tell where it turns.
        if !is_within_a_turn || self.low.abs().max(self.high.abs()) > 1.0 / f64::EPSILON.sqrt() {
            return if self.low.is_finite() && self.high.is_finite() { Range { low: -1.0, high: 1.0 } } else { ANY };
        }
        let (a, b) = (self.low.sin(), self.high.sin());
        let low = if self.meets(-FRAC_PI_2, TAU) { -1.0 } else { a.min(b) };
        let high = if self.meets(FRAC_PI_2, TAU) { 1.0 } else { a.max(b) };
        Range::out(low, high)
    }

    fn absolute(self) -> Range {
        let most = self.low.abs().max(self.high.abs());
        if self.has(0.0) {
            Range { low: 0.0, high: most }
        } else {
            Range { low: self.low.abs().min(self.high.abs()), high: most }
        }
    }
}

impl Number for Range {
    fn of(x: f64) -> Range {
        Range { low: x, high: x }
    }

    fn one(self, one: One) -> Range {
        let always = f64::INFINITY;
        match one {
            One::Minus => self.minus(),
            One::Abs => self.absolute(),
            One::Sqrt => self.rising(f64::sqrt, 0.0, always),
            One::Exp => self.rising(f64::exp, -always, always),
            One::Log => self.rising(f64::ln, 0.0, always),
            One::Sin => self.sine(),
            One::Cos => Range::out(self.low + FRAC_PI_2, self.high + FRAC_PI_2).sine(),
            One::Tan if self.high - self.low < PI && !Range::out(self.low, self.high).meets(FRAC_PI_2, PI) => {
                Range::out(self.low.tan(), self.high.tan())
            }
            One::Tan => ANY,
            One::Asin => self.rising(f64::asin, -1.0, 1.0),
            One::Acos => self.minus().rising(|x| (-x).acos(), -1.0, 1.0),
            One::Atan => self.rising(f64::atan, -always, always),
            One::Sinh => self.rising(f64::sinh, -always, always),
            One::Cosh => self.absolute().rising(f64::cosh, 0.0, always),
            One::Tanh => self.rising(f64::tanh, -always, always),
        }
    }

    fn two(self, two: Two, other: Range) -> Range {
        let (a, b) = (self, other);
        match two {
            Two::Plus => Range::out(a.low + b.low, a.high + b.high),
            Two::Minus => Range::out(a.low - b.high, a.high - b.low),
            Two::Times => Range::corners([a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high]),
            Two::Over if b.has(0.0) => ANY,
            Two::Over => Range::corners([a.low / b.low, a.low / b.high, a.high / b.low, a.high / b.high]),
            Two::Power if a.low > 0.0 => {
                let power = |x: f64, k: f64| x.powf(k);
                Range::corners([power(a.low, b.low), power(a.low, b.high), power(a.high, b.low), power(a.high, b.high)])
            }
            Two::Power => ANY,
            // Bounds that say nothing may hide that there is no value at all.
            Two::Min | Two::Max if a.is_any() || b.is_any() => ANY,
            Two::Min => Range { low: a.low.min(b.low), high: a.high.min(b.high) },
            Two::Max => Range { low: a.low.max(b.low), high: a.high.max(b.high) },
            Two::Atan2 if b.low > 0.0 || !a.has(0.0) => {
                let at = |y: f64, x: f64| y.atan2(x);
                Range::corners([at(a.low, b.low), at(a.low, b.high), at(a.high, b.low), at(a.high, b.high)])
            }
            Two::Atan2 => Range::out(-PI, PI),
        }
    }

    fn whole_power(self, k: i32) -> Range {
        if k < 0 {
            return Range::of(1.0).two(Two::Over, self.whole_power(-k));
        }
        let base = if k % 2 == 0 { self.absolute() } else { self };
        Range::out(product(base.low, k), product(base.high, k))
    }
}

impl Range {
    fn is_any(self) -> bool {
        self.low == f64::NEG_INFINITY && self.high == f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn value(text: &str, p: [f64; 3]) -> f64 {
        Formula::parse(text).unwrap_or_else(|e| panic!("{text}: {e}")).evaluate(p.into()).0
    }

    #[test]
    fn signs_powers_and_brackets_are_read_as_in_mathematics() {
        let p = [2.0, 3.0, 5.0];
        for (text, wanted) in [
            ("x^2 + y^2 + z^2 - 1", 37.0),
            ("-x^2", -4.0),
            ("2^-x", 0.25),
            ("2^3^2", 512.0),
            ("2**x*y", 12.0),
            ("x - y - z", -6.0),
            ("z / x / y", 5.0 / 6.0),
            ("-(x + -+y)*.5", 0.5),
            ("1.5e1 - 2E+0", 13.0),
            ("max(x, y, min(z, 4)) + abs(-1)", 5.0),
            ("sin(pi/2) + log(e) + atan2(0, 1)", 2.0),
            ("(x + y)^0.5", 5f64.sqrt()),
        ] {
            assert_eq!(value(text, p), wanted, "{text}");
        }
        assert!(value("sqrt(-x)", p).is_nan() && value("min(sqrt(-x), 1)", p).is_nan());
    }

    #[test]
    fn faults_are_told_with_their_column() {
        for (text, column, what) in [
            ("", 1, "ends"),
            ("x^2 + ", 7, "ends"),
            ("x^2 + y^2 = 1", 11, "\"=\""),
            ("2x", 2, "operator is missing before \"x\""),
            ("(x + y", 7, "not closed"),
            ("x)", 2, "not opened"),
            ("x + foo(y)", 5, "\"foo\""),
            ("sin x", 5, "bracket"),
            ("sin(x, y)", 6, "one value"),
            ("atan2(x, y, z)", 11, "two values"),
            ("max(x)", 6, "two values"),
            ("1,5 * x", 2, "comma"),
            ("x # y", 3, "\"#\""),
            ("1.2.3", 1, "no number"),
            ("x * * y", 5, "missing before"),
        ] {
            let error = Formula::parse(text).expect_err(text);
            assert_eq!(error.column, column, "{text}: {error}");
            assert!(error.to_string().contains(what) && error.to_string().contains(" - hint: "), "{text}: {error}");
        }
        let deep = "(".repeat(5000) + "x" + &")".repeat(5000);
        assert!(Formula::parse(&deep).unwrap_err().what.contains("deep"));
        assert!(Formula::parse(&("x^".repeat(5000) + "2")).unwrap_err().what.contains("deep"));
        // Long sums are no deep ones.
        assert_eq!(value(&("x".to_owned() + &" + x".repeat(5000)), [1.0, 0.0, 0.0]), 5001.0);
    }

    const MANY: [&str; 16] = [
        "x^2 + y^2 + z^2 - 1",
        "sin(3*x)*cos(3*y) + sin(3*y)*cos(3*z) + sin(3*z)*cos(3*x)",
        "max(abs(x), abs(y), abs(z)) - 0.8",
        "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3",
        "exp(-x^2) + log(2 + y) - tanh(z)",
        "x^3 - y^5 + z^-2",
        "atan2(y, x) - z/2",
        "sqrt(x + 1) - y*z",
        "min(x, y) / (z - 0.3)",
        "asin(x/2) + acos(y/2) + atan(z)",
        "tan(x) - sinh(y) + cosh(z)",
        "(x + 2)^(y + 0.5)",
        "(x + 2)^1.5 - y^4",
        "cos(20*x) - sin(15*y*z)",
        "-x^3/(1 + y^2)",
        "2^x - 3^y",
    ];

    fn place(seed: u64, n: u64) -> DVec3 {
        (DVec3::new(random::unit(seed, 3 * n), random::unit(seed, 3 * n + 1), random::unit(seed, 3 * n + 2)) - 0.5)
            * 2.6
    }

    #[test]
    fn gradients_agree_with_differences_to_1e_5() {
        for text in MANY {
            let formula = Formula::parse(text).unwrap();
            let (mut off, mut tried) = (0, 0);
            for n in 0..400 {
                let (p, e) = (place(5, n), 1e-6);
                let along = |d: DVec3| (formula.evaluate(p + d * e).0 - formula.evaluate(p - d * e).0) / (2.0 * e);
                let difference = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
                if !difference.is_finite() || difference.length() < 1e-3 {
                    continue;
                }
                tried += 1;
                off += usize::from(difference.normalize().distance(formula.evaluate(p).1) > 1e-5);
            }
            // Creases of least and greatest ones, and poles, are next to none of the places.
            assert!(off <= 2 && tried > 200, "{text}: {off} of {tried}");
        }
    }

    #[test]
    fn intervals_hold_all_values_and_have_no_bounds_where_a_value_may_be_missing() {
        let mut bounded = 0;
        for text in MANY {
            let formula = Formula::parse(text).unwrap();
            for n in 0..300 {
                let c = place(7, n);
                let size = 10f64.powf(-2.0 * random::unit(8, n));
                let aabb = Aabb { min: c - size, max: c + size * 0.7 };
                let [low, high] = formula.interval(&aabb);
                bounded += usize::from(low.is_finite() && high.is_finite());
                for m in 0..12 {
                    let r = |k: u64| random::unit(n, 3 * m + k);
                    let p = aabb.min + (aabb.max - aabb.min) * DVec3::new(r(0), r(1), r(2));
                    let d = formula.evaluate(p).0;
                    let fits = if d.is_nan() {
                        low == f64::NEG_INFINITY && high == f64::INFINITY
                    } else {
                        low <= d && d <= high
                    };
                    assert!(fits, "{text}: {d} is not from {low} to {high}");
                }
            }
        }
        assert!(bounded > 3000, "{bounded}");
    }
}
