//! Poses from three points and the rays on which they are seen, in closed form (`docs/math.md`, section 13).

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::geometry::pose::Pose;

/// Newton steps on the depths: the closed form leaves 1e-10 or so, and each step squares that.
const POLISHES: usize = 4;

/// Half the digits, the root of the precision, which is what a double root is good to: depths nearer than this, as a
/// share of them, are one solution, may miss a squared side by this share of the sum of all, and a sine below it is
/// none.
const HALF_THE_DIGITS: f64 = 1.0 / (1_u64 << (f64::MANTISSA_DIGITS / 2)) as f64;

/// All poses (up to four) that see three world points along three unit bearings, `camera_from_world`.
///
/// The depths are the common points of two conics. A member of their pencil that is a pair of lines meets either of them
/// in those points (Persson and Nordberg 2018; Ding et al. 2023). None for points on one line.
pub fn three_point_poses(points: &[Vector3<f64>; 3], bearings: &[Vector3<f64>; 3]) -> Vec<Pose> {
    let Some(world) = axes(points) else { return Vec::new() };
    let posed = |depths: Vector3<f64>| {
        let in_camera = [0, 1, 2].map(|k| bearings[k] * depths[k]);
        let rotation = Rotation3::from_matrix_unchecked(axes(&in_camera)? * world.transpose());
        let middle = |x: &[Vector3<f64>; 3]| (x[0] + x[1] + x[2]) / 3.0;
        Some(Pose::new(rotation, middle(&in_camera) - rotation * middle(points)))
    };
    depths(points, bearings).into_iter().filter_map(posed).collect()
}

/// Right-handed orthonormal axes of a triangle, the first along its first side, the third normal to it.
fn axes([a, b, c]: &[Vector3<f64>; 3]) -> Option<Matrix3<f64>> {
    let (along, other) = (b - a, c - a);
    let first = along.try_normalize(0.0)?;
    let third = first.cross(&other).try_normalize(HALF_THE_DIGITS * other.norm())?;
    Some(Matrix3::from_columns(&[first, third.cross(&first), third]))
}

/// The sides of the triangle as pairs of corners.
const SIDES: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// Distances of the points along their bearings, `|d_i y_i - d_j y_j| = |x_i - x_j|` for each side (`docs/math.md`, eq. 13.1).
fn depths(points: &[Vector3<f64>; 3], bearings: &[Vector3<f64>; 3]) -> Vec<Vector3<f64>> {
    let squares = SIDES.map(|(i, j)| (points[i] - points[j]).norm_squared());
    let unit = squares.iter().sum::<f64>();
    let squares = Vector3::from(squares) / unit;
    let cosines = SIDES.map(|(i, j)| bearings[i].dot(&bearings[j]));
    let forms = [0, 1, 2].map(|side| side_form(SIDES[side], cosines[side]));
    let one = forms[0] * squares[2] - forms[2] * squares[0];
    let two = forms[1] * squares[2] - forms[2] * squares[1];
    let all = forms[0] + forms[1] + forms[2];
    let mut found: Vec<Vector3<f64>> = Vec::new();
    for direction in common_points(&one.unscale(one.norm()), &two.unscale(two.norm())) {
        let size = direction.dot(&(all * direction));
        let sign = if direction.sum() < 0.0 { -1.0 } else { 1.0 };
        let start = direction * (sign / size.max(f64::MIN_POSITIVE).sqrt());
        let depths = polished(start, &squares, &cosines);
        let right = sides_missed(&depths, &squares, &cosines).amax() < HALF_THE_DIGITS && depths.min() > 0.0;
        if right && found.iter().all(|other| (other - depths).norm() > HALF_THE_DIGITS * depths.norm()) {
            found.push(depths);
        }
    }
    found.into_iter().map(|depths| depths * unit.sqrt()).collect()
}

/// The squared length of a side as a form of the depths.
fn side_form((i, j): (usize, usize), cosine: f64) -> Matrix3<f64> {
    let mut form = Matrix3::zeros();
    form[(i, i)] = 1.0;
    form[(j, j)] = 1.0;
    form[(i, j)] = -cosine;
    form[(j, i)] = -cosine;
    form
}

/// The points, up to factors, that two conics share.
fn common_points(one: &Matrix3<f64>, two: &Matrix3<f64>) -> Vec<Vector3<f64>> {
    // With the larger determinant in front, the pencil's cubic keeps its degree.
    let (one, two) = if one.determinant().abs() > two.determinant().abs() { (two, one) } else { (one, two) };
    let pencil = |root: f64| {
        let form = one + two * root;
        (root, form.unscale(form.norm()))
    };
    // A pair of real lines has eigenvalues of both signs: the farther from zero, the better determined are the lines.
    let spread = |form: &Matrix3<f64>| adjugate(form).trace();
    let members = pencil_roots(one, two).into_iter().map(pencil);
    let Some((root, lines)) = members.min_by(|a, b| spread(&a.1).total_cmp(&spread(&b.1))) else { return Vec::new() };
    let other = one * root - two;
    line_pair(&lines).iter().flat_map(|line| on_line(line, &other)).collect()
}

/// The factors at which `one + factor * two` is a pair of lines.
fn pencil_roots(one: &Matrix3<f64>, two: &Matrix3<f64>) -> Vec<f64> {
    let mixed = |a: &Matrix3<f64>, b: &Matrix3<f64>| (adjugate(a) * b).trace();
    let (cubic, constant) = (two.determinant(), one.determinant());
    if cubic == 0.0 {
        return vec![0.0];
    }
    real_roots(mixed(two, one) / cubic, mixed(one, two) / cubic, constant / cubic)
}

/// The real roots of `x^3 + a x^2 + b x + c`.
fn real_roots(a: f64, b: f64, c: f64) -> Vec<f64> {
    let polynomial = |x: f64| (((x + a) * x + b) * x + c, (3.0 * x + 2.0 * a) * x + b);
    // The formulas cancel where the roots differ in size.
    let polished = |x: f64| {
        let (value, slope) = polynomial(x);
        let next = x - value / slope;
        if polynomial(next).0.abs() < value.abs() { next } else { x }
    };
    cardano(a, b, c).into_iter().map(|root| polished(polished(root))).collect()
}

/// The same by Vieta's cosines where there are three, else by Cardano's formula.
fn cardano(a: f64, b: f64, c: f64) -> Vec<f64> {
    let third = a / 3.0;
    let (p, q) = (third * third - b / 3.0, third * (third * third - b / 2.0) + c / 2.0);
    if p > 0.0 && q * q < p * p * p {
        let (radius, angle) = (-2.0 * p.sqrt(), (q / (p * p.sqrt())).clamp(-1.0, 1.0).acos());
        return [0.0, 1.0, 2.0].map(|k| radius * ((angle + std::f64::consts::TAU * k) / 3.0).cos() - third).to_vec();
    }
    let size = (q.abs() + (q * q - p * p * p).max(0.0).sqrt()).cbrt();
    let first = if q > 0.0 { -size } else { size };
    let second = if first == 0.0 { 0.0 } else { p / first };
    vec![first + second - third]
}

/// The two lines of a degenerate conic (Richter-Gebert 2011, section 11.1); none where they are complex.
fn line_pair(conic: &Matrix3<f64>) -> Vec<Vector3<f64>> {
    let meeting = -adjugate(conic);
    let largest = meeting.diagonal().imax();
    let square = meeting[(largest, largest)];
    let point = if square > 0.0 { meeting.column(largest) / square.sqrt() } else { Vector3::zeros() };
    let split = conic + point.cross_matrix();
    let (row, column) = split.iamax_full();
    vec![split.row(row).transpose(), split.column(column).into_owned()]
}

/// Intersection of a line and a conic, up to factors.
fn on_line(line: &Vector3<f64>, conic: &Matrix3<f64>) -> Vec<Vector3<f64>> {
    let Some(normal) = line.try_normalize(0.0) else { return Vec::new() };
    let one = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    let two = normal.cross(&one);
    let (a, b, c) = (one.dot(&(conic * one)), one.dot(&(conic * two)), two.dot(&(conic * two)));
    // Of s one + t two, without cancellation; of complex factors the real part, which the sides refuse.
    let root = (b * b - a * c).max(0.0).sqrt();
    let sum = -(b + if b < 0.0 { -root } else { root });
    vec![one * sum + two * a, one * c + two * sum]
}

fn adjugate(m: &Matrix3<f64>) -> Matrix3<f64> {
    let [a, b, c] = [0, 1, 2].map(|k| m.row(k).transpose());
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)])
}

/// Residuals of the squared sides at the depths.
fn sides_missed(depths: &Vector3<f64>, squares: &Vector3<f64>, cosines: &[f64; 3]) -> Vector3<f64> {
    Vector3::from_fn(|side, _| {
        let (i, j) = SIDES[side];
        let (a, b) = (depths[i], depths[j]);
        (a - b) * (a - b) + 2.0 * a * b * (1.0 - cosines[side]) - squares[side]
    })
}

/// The depths after Newton steps on the sides.
fn polished(mut depths: Vector3<f64>, squares: &Vector3<f64>, cosines: &[f64; 3]) -> Vector3<f64> {
    for _ in 0..POLISHES {
        let mut slopes = Matrix3::zeros();
        for (side, (i, j)) in SIDES.into_iter().enumerate() {
            slopes[(side, i)] = 2.0 * (depths[i] - cosines[side] * depths[j]);
            slopes[(side, j)] = 2.0 * (depths[j] - cosines[side] * depths[i]);
        }
        let missed = sides_missed(&depths, squares, cosines);
        let Some(step) = slopes.lu().solve(&missed) else { break };
        let next = depths - step;
        if sides_missed(&next, squares, cosines).amax() < missed.amax() {
            depths = next;
        } else {
            break;
        }
    }
    depths
}
