//! Scenes of planar regions and what a camera sees of them.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

use super::random::Random;
use regionpose::{Integration, ObservedRegion, Pose, Problem, System, WorldRegion};

/// Pixels per radian of the cameras.
pub const FOCAL: f64 = 1000.0;

pub type Ring = Vec<Vector2<f64>>;
pub type SpaceRing = Vec<Vector3<f64>>;

/// Counter-clockwise rectangle around the origin.
pub fn rectangle(width: f64, height: f64) -> Ring {
    [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]| Vector2::new(x * width, y * height)).to_vec()
}

/// Regular polygon around the origin.
pub fn regular(count: usize, radius: f64) -> Ring {
    let corner =
        |k: usize| radius * Vector2::new((TAU * k as f64 / count as f64).cos(), (TAU * k as f64 / count as f64).sin());
    (0..count).map(corner).collect()
}

/// A ring in the shape of an L, its corner's square 0.4 of its sides.
pub fn angle_piece(size: f64) -> Ring {
    let corners = [[-0.4, -0.4], [0.6, -0.4], [0.6, 0.0], [0.0, 0.0], [0.0, 0.8], [-0.4, 0.8]];
    corners.map(|[x, y]| Vector2::new(x * size, y * size)).to_vec()
}

/// A star-shaped ring without symmetry: distances from 0.45 to 1 of `radius`, at uneven angles.
pub fn star(random: &mut Random, count: usize, radius: f64) -> Ring {
    let vertex = |k: usize| {
        let angle = TAU * (k as f64 + random.uniform(-0.3, 0.3)) / count as f64;
        random.uniform(0.45, 1.0) * radius * Vector2::new(angle.cos(), angle.sin())
    };
    (0..count).map(vertex).collect()
}

/// A star with a square hole.
pub fn pierced_star(random: &mut Random, count: usize, radius: f64) -> Vec<Ring> {
    let turn = nalgebra::Rotation2::new(random.uniform(0.0, TAU));
    let hole = rectangle(0.25 * radius, 0.2 * radius).iter().map(|p| turn * p).collect();
    vec![star(random, count.max(8), radius), hole]
}

/// A plane seen by a camera: its origin `distance` away along `direction`, its normal `tilt` off the ray towards the camera
/// (or away from it), turned any way in itself.
pub fn seen_plane(random: &mut Random, direction: &Vector3<f64>, distance: f64, tilt: f64, front: bool) -> Pose {
    let spread = random.direction();
    let across = direction.cross(&spread).normalize();
    let side = if front { -1.0 } else { 1.0 };
    let normal = Rotation3::from_scaled_axis(across * tilt) * direction * side;
    let turn = Rotation3::from_scaled_axis(normal * random.uniform(0.0, TAU));
    let first = turn * normal.cross(&(across + direction)).normalize();
    let axes = Matrix3::from_columns(&[first, normal.cross(&first), normal]);
    Pose::new(Rotation3::from_matrix_unchecked(axes), direction * distance)
}

/// The rings of a plane in the space of `space_from_plane`.
pub fn placed(rings: &[Ring], space_from_plane: &Pose) -> Vec<SpaceRing> {
    let lift = |p: &Vector2<f64>| space_from_plane.transform(&Vector3::new(p.x, p.y, 0.0));
    rings.iter().map(|ring| ring.iter().map(lift).collect()).collect()
}

/// What a camera at `camera_from_world` sees of world rings, row by row of the matrix; the area from the solid angle.
pub fn rendered(rings: &[SpaceRing], camera_from_world: &Pose) -> ObservedRegion {
    let (r, t) = (camera_from_world.rotation, camera_from_world.translation);
    let coordinate = |x: &Vector3<f64>, k: usize| r[(k, 0)] * x[0] + r[(k, 1)] * x[1] + r[(k, 2)] * x[2] + t[k];
    let bearing = |x: &Vector3<f64>| {
        let [a, b, c] = [0, 1, 2].map(|k| coordinate(x, k));
        let length = a.hypot(b).hypot(c);
        Vector3::new(a / length, b / length, c / length)
    };
    let seen: Vec<SpaceRing> = rings.iter().map(|ring| ring.iter().map(bearing).collect()).collect();
    let holes: f64 = seen[1..].iter().map(|ring| solid_angle(ring)).sum();
    ObservedRegion::new(seen.clone(), (solid_angle(&seen[0]) - holes) * FOCAL * FOCAL)
}

/// Solid angle inside a ring of bearings, by the triangles with its mean direction (Van Oosterom and Strackee 1983).
fn solid_angle(ring: &[Vector3<f64>]) -> f64 {
    let center = ring.iter().sum::<Vector3<f64>>().normalize();
    let triangle = |k: usize| {
        let (a, b) = (ring[k], ring[(k + 1) % ring.len()]);
        2.0 * a.dot(&b.cross(&center)).atan2(1.0 + a.dot(&b) + b.dot(&center) + center.dot(&a))
    };
    (0..ring.len()).map(triangle).sum::<f64>().abs()
}

/// Regions of the world and their image.
pub struct Scene {
    pub pose: Pose,
    pub observed: Vec<ObservedRegion>,
    pub worlds: Vec<WorldRegion>,
}

/// How a random scene is built; lengths in the scene's unit.
#[derive(Clone, Copy)]
pub struct Layout {
    pub regions: usize,
    pub vertices: usize,
    /// Largest angle of the regions off the view's axis, rad.
    pub field: f64,
    /// Meters per unit.
    pub unit: f64,
    /// Distance of the world's origin from the scene, in units.
    pub offset: f64,
    pub front: bool,
    /// Direction of the scene in camera axes; any where there is none.
    pub axis: Option<Vector3<f64>>,
    /// Range of the angles between rays and normals, rad.
    pub tilt: [f64; 2],
}

impl Default for Layout {
    fn default() -> Self {
        Self {
            regions: 1,
            vertices: 8,
            field: 0.5,
            unit: 1.0,
            offset: 5.0,
            front: true,
            axis: None,
            tilt: [0.35, 0.95],
        }
    }
}

impl Scene {
    /// Star-shaped regions of about a unit, 3 to 5 units away.
    pub fn random(random: &mut Random, layout: Layout) -> Self {
        let shapes = (0..layout.regions).map(|_| vec![star(random, layout.vertices, 1.0)]).collect();
        Self::of_shapes(random, shapes, layout)
    }

    /// These shapes, placed at random as in [`Scene::random`].
    pub fn of_shapes(random: &mut Random, shapes: Vec<Vec<Ring>>, layout: Layout) -> Self {
        let pose = random.pose(layout.offset * layout.unit);
        let axis = layout.axis.unwrap_or_else(|| random.direction());
        let start = random.uniform(0.0, TAU);
        let count = shapes.len();
        let place = |(k, shape): (usize, Vec<Ring>)| {
            let aside = axis.cross(&random.direction()).normalize() * if count > 1 { 0.0 } else { 1.0 };
            let spoke =
                Rotation3::from_scaled_axis(axis * (start + TAU * k as f64 / count as f64)) * perpendicular(&axis);
            let away = if count > 1 { spoke } else { aside };
            let direction = Rotation3::from_scaled_axis(away * random.uniform(0.6, 1.0) * layout.field) * axis;
            let (distance, tilt) =
                (random.uniform(3.0, 5.0) * layout.unit, random.uniform(layout.tilt[0], layout.tilt[1]));
            let camera_from_plane = seen_plane(random, &direction, distance, tilt, layout.front);
            let scaled: Vec<Ring> = shape.iter().map(|ring| ring.iter().map(|p| p * layout.unit).collect()).collect();
            placed(&scaled, &pose.inverse().after(&camera_from_plane))
        };
        let rings: Vec<Vec<SpaceRing>> = shapes.into_iter().enumerate().map(place).collect();
        Self::of_rings(pose, &rings)
    }

    /// World rings seen from a pose.
    pub fn of_rings(pose: Pose, regions: &[Vec<SpaceRing>]) -> Self {
        let observed = regions.iter().map(|rings| rendered(rings, &pose)).collect();
        let worlds = regions.iter().map(|rings| WorldRegion::from_rings(rings).unwrap()).collect();
        Self { pose, observed, worlds }
    }

    pub fn problem(&self, system: System, integration: Integration) -> Problem {
        Problem::with(&self.observed, &self.worlds, system, integration).unwrap()
    }

    /// Mean of the world regions' centers.
    pub fn middle(&self) -> Vector3<f64> {
        self.worlds.iter().map(|world| world.frame().origin()).sum::<Vector3<f64>>() / self.worlds.len() as f64
    }

    /// Rotation error (rad) of a pose, and the error of the place of the regions' middle over its distance.
    pub fn errors(&self, pose: &Pose) -> (f64, f64) {
        errors(pose, &self.pose, &self.middle())
    }
}

/// Rotation between two poses (rad), and the distance between the places where they put `middle` over its distance.
pub fn errors(pose: &Pose, truth: &Pose, middle: &Vector3<f64>) -> (f64, f64) {
    let place = truth.transform(middle);
    (pose.angle_to(truth), (pose.transform(middle) - place).norm() / place.norm())
}

fn perpendicular(axis: &Vector3<f64>) -> Vector3<f64> {
    let least = axis.iamin();
    axis.cross(&Vector3::ith(least, 1.0)).normalize()
}
