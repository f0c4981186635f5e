//! Gauss-Legendre rules, computed by the compiler.

/// A point of a rule on [0, 1] and its weight; the weights of a rule sum to 1.
pub(crate) type Node = (f64, f64);

/// Newton steps per root; the slowest start, a deflated step from 1, needs under 40 for 16 nodes.
const NEWTON_STEPS: usize = 60;

/// The Gauss-Legendre rule of `N` nodes on [0, 1], exact to degree `2 N - 1`.
///
/// Newton steps from 1 with the roots already found divided out (Maehly 1954) fall onto the next largest root.
pub(crate) const fn gauss_legendre<const N: usize>() -> [Node; N] {
    let mut roots = [0.0; N];
    let mut rule = [(0.0, 0.0); N];
    let mut found = 0;
    while found < N {
        let root = next_root(&roots, found);
        let slope = legendre(N, root).1;
        roots[found] = root;
        rule[found] = (0.5 * (1.0 + root), 1.0 / ((1.0 - root * root) * slope * slope));
        found += 1;
    }
    rule
}

/// The largest root of the Legendre polynomial of degree `N` below the `found` first ones of `roots`.
const fn next_root<const N: usize>(roots: &[f64; N], found: usize) -> f64 {
    let mut x = 1.0;
    let mut step = 0;
    while step < NEWTON_STEPS {
        let (value, slope) = legendre(N, x);
        let mut deflation = 0.0;
        let mut i = 0;
        while i < found {
            deflation += 1.0 / (x - roots[i]);
            i += 1;
        }
        x -= value / (slope - value * deflation);
        step += 1;
    }
    x
}

/// The Legendre polynomial of a degree and its derivative at `x`.
const fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (0.0, 1.0);
    let (mut slope_before, mut slope) = (0.0, 0.0);
    let mut k = 1;
    while k <= degree {
        let next = ((2 * k - 1) as f64 * x * value - (k - 1) as f64 * before) / k as f64;
        let next_slope = slope_before + (2 * k - 1) as f64 * value;
        (before, value) = (value, next);
        (slope_before, slope) = (slope, next_slope);
        k += 1;
    }
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::gauss_legendre;

    /// Rounding of a sum of 16 terms of size 1.
    const ROUNDING: f64 = 4e-15;

    fn check<const N: usize>() {
        for degree in 0..2 * N {
            let sum: f64 = gauss_legendre::<N>().iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
            assert!((sum - 1.0 / (degree + 1) as f64).abs() < ROUNDING, "{N} nodes, degree {degree}: {sum}");
        }
    }

    #[test]
    fn a_rule_of_n_nodes_integrates_degree_2n_minus_1() {
        check::<1>();
        check::<2>();
        check::<3>();
        check::<5>();
        check::<8>();
        check::<12>();
        check::<16>();
    }
}
