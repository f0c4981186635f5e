//! A few numbers of as many edges, worked on together so that the compiler uses vector instructions.

use std::ops::{Add, AddAssign, Div, Mul, Sub};

use pulp::Arch;
pub(crate) use pulp::NullaryFnOnce;

/// The result of work, compiled for the widest vectors of this machine. Products and sums are rounded one by one on
/// all of them: the numbers are the same to the last bit.
pub(crate) fn vectorized<Work: NullaryFnOnce>(work: Work) -> Work::Output {
    Arch::new().dispatch(work)
}

/// Edges in a lane group.
pub(crate) const LANES: usize = 4;

/// One number of each edge of a lane group.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Lanes(pub(crate) [f64; LANES]);

impl Lanes {
    /// Zero for every edge.
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    /// The same number for every edge.
    #[inline(always)]
    pub(crate) fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    /// The number `f` gives for each edge.
    #[inline(always)]
    pub(crate) fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = self;
        for value in &mut out.0 {
            *value = f(*value);
        }
        out
    }

    /// For each edge the smaller number; the other one's where this is not a number.
    #[inline(always)]
    pub(crate) fn lower(self, other: Self) -> Self {
        self.zipped(other, |a, b| if a < b { a } else { b })
    }

    /// For each edge the larger number; the other one's where this is not a number.
    #[inline(always)]
    pub(crate) fn upper(self, other: Self) -> Self {
        self.zipped(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn zipped(mut self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        for i in 0..LANES {
            self.0[i] = f(self.0[i], other.0[i]);
        }
        self
    }

    /// The numbers one edge on, `last` being that after the last.
    #[inline(always)]
    pub(crate) fn shifted(self, last: f64) -> Self {
        let [_, a, b, c] = self.0;
        Self([a, b, c, last])
    }

    /// The smallest number.
    #[inline(always)]
    pub(crate) fn min(self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The largest number.
    #[inline(always)]
    pub(crate) fn max(self) -> f64 {
        self.0.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// The sum over the edges.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        self.0.iter().sum()
    }
}

macro_rules! lane_wise {
    ($operator:ident, $method:ident, $symbol:tt) => {
        impl $operator for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for i in 0..LANES {
                    self.0[i] $symbol other.0[i];
                }
                self
            }
        }
    };
}

lane_wise!(Add, add, +=);
lane_wise!(Sub, sub, -=);
lane_wise!(Mul, mul, *=);
lane_wise!(Div, div, /=);

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = self.add(other);
    }
}
