//! Tables of projections see what the cameras see.

use std::f64::consts::{PI, TAU};

use nalgebra::{Vector2, Vector3};
use regionpose::Error;
use regionpose::internals::alignment::projection::Projection;

use crate::support::random::Random;

const DEGREE: f64 = PI / 180.0;

/// Where a camera sees a bearing, NaN where it sees none.
type Camera = Box<dyn Fn(&Vector3<f64>) -> Vector2<f64>>;

fn none() -> Vector2<f64> {
    Vector2::repeat(f64::NAN)
}

fn pinhole(focal: f64, [width, height]: [f64; 2]) -> Camera {
    distorted(focal, [width, height], [0.0; 3])
}

/// With two radial terms and a tangential one; distorted images would come back upon themselves far beyond their borders.
fn distorted(focal: f64, [width, height]: [f64; 2], [k1, k2, p]: [f64; 3]) -> Camera {
    Box::new(move |bearing| {
        if bearing.z <= 0.0 {
            return none();
        }
        let at = bearing.xy() / bearing.z;
        let squares = at.norm_squared();
        if [k1, k2, p] != [0.0; 3] && squares > 4.0 {
            return none();
        }
        let radial = at * (1.0 + (k1 + k2 * squares) * squares);
        let tangential = Vector2::new(2.0 * p * at.x * at.y, p * (squares + 2.0 * at.y * at.y));
        (radial + tangential) * focal + Vector2::new(0.5 * (width - 1.0), 0.5 * (height - 1.0))
    })
}

/// A fisheye of so many degrees that fill the width of its image.
fn equidistant(field: f64, width: f64) -> Camera {
    let (most, focal) = (0.5 * field * DEGREE, width / (field * DEGREE));
    Box::new(move |bearing| {
        let away = bearing.xy().norm();
        let angle = away.atan2(bearing.z);
        // A little more than what the image shows.
        if angle > most + 0.05 {
            return none();
        }
        let scale = if away > 1e-12 { angle / away } else { 1.0 };
        bearing.xy() * (scale * focal) + Vector2::repeat(0.5 * (width - 1.0))
    })
}

fn panorama(width: f64) -> Camera {
    let scale = width / TAU;
    Box::new(move |bearing| {
        let (longitude, latitude) = (bearing.x.atan2(bearing.z), bearing.y.atan2(bearing.x.hypot(bearing.z)));
        Vector2::new((longitude + PI) * scale - 0.5, (latitude + 0.5 * PI) * scale - 0.5)
    })
}

fn table(size: [f64; 2], camera: &Camera) -> Projection {
    Projection::new(size, |bearings| Ok::<_, Error>(bearings.iter().map(camera).collect())).unwrap()
}

/// The largest error along either axis of pixels of the image, of bearings of any length, and how many it shows. All those of `within` must be seen.
fn worst(
    size: [f64; 2],
    camera: &Camera,
    around: f64,
    within: impl Fn(&Vector3<f64>, &Vector2<f64>) -> bool,
) -> (f64, usize) {
    let (made, mut random) = (table(size, camera), Random::new(31));
    let (mut worst, mut count) = (0.0_f64, 0);
    for _ in 0..40_000 {
        let bearing = if around < 1.0 {
            Vector3::new(random.uniform(-around, around), random.uniform(-around, around), 1.0)
        } else {
            random.direction()
        };
        let expected = camera(&bearing);
        let is_shown = (0..2).all(|axis| expected[axis] > -0.5 && expected[axis] < size[axis] - 0.5);
        if !is_shown || !within(&bearing.normalize(), &expected) {
            continue;
        }
        let seen = made.pixel_of(&(bearing * random.uniform(0.01, 100.0)));
        let Some(seen) = seen else { panic!("{bearing} is not seen at {expected}") };
        worst = worst.max((seen - expected).amax());
        count += 1;
    }
    assert!(count > 500, "{count} are too few for this test");
    (worst, count)
}

fn anywhere(_: &Vector3<f64>, _: &Vector2<f64>) -> bool {
    true
}

/// Within a right angle, up to rounding of single precision, which is that of a place within a cell times the cell's pixels.
#[test]
fn a_pinhole_is_exact() {
    for (focal, size) in [(700.0, [1242.0, 375.0]), (1000.0, [1920.0, 1080.0]), (2000.0, [1600.0, 1200.0])] {
        let (worst, _) = worst(size, &pinhole(focal, size), 1.1, anywhere);
        assert!(worst < 2e-3, "{focal}: {worst}");
    }
}

/// An image smaller than a cell of the first table, off the axis or on it.
#[test]
fn a_narrow_camera_is_seen_within_a_cell() {
    let size = [1000.0, 1000.0];
    let focal = 500.0 / (0.5 * DEGREE).tan();
    let (worst_error, _) = worst(size, &pinhole(focal, size), 0.01, anywhere);
    assert!(worst_error < 0.05, "{worst_error}");
    // Between the nodes of the coarsest table.
    let aside: Camera = Box::new(move |bearing| pinhole(focal, size)(bearing) - Vector2::new(0.06, 0.03) * focal);
    let (worst_error, _) = worst(size, &aside, 0.07, anywhere);
    assert!(worst_error < 0.05, "{worst_error}");
}

/// Fields of 150 degrees reach over the sides of the cube, whose maps are not linear: at its border the finest table is off by
/// tenths of a pixel.
#[test]
fn a_wide_camera_is_seen_on_all_faces() {
    let size = [2000.0, 2000.0];
    let focal = 1000.0 / (75.0 * DEGREE).tan();
    let made = table(size, &pinhole(focal, size));
    for way in [Vector2::x(), -Vector2::x(), Vector2::y(), -Vector2::y()] {
        let bearing = (way * (70.0 * DEGREE).tan()).push(1.0);
        let seen = made.pixel_of(&bearing).unwrap();
        assert!((seen - pinhole(focal, size)(&bearing)).norm() < 0.1, "{seen}");
    }
    let (worst, _) = worst(size, &pinhole(focal, size), 1.1, anywhere);
    assert!(worst < 0.5, "{worst}");
}

#[test]
fn distortion_is_seen_to_a_tenth_of_a_pixel() {
    let size = [1920.0, 1080.0];
    for terms in [[-0.3, 0.09, 0.0], [0.1, -0.02, 1e-3], [-0.05, 0.0, 5e-3]] {
        let (worst, _) = worst(size, &distorted(1000.0, size, terms), 1.1, anywhere);
        assert!(worst < 0.1, "{terms:?}: {worst}");
    }
}

#[test]
fn fisheyes_are_seen_to_a_tenth_of_a_pixel_beyond_half_a_turn() {
    for field in [180.0, 220.0] {
        let size = [1600.0; 2];
        let most = (0.5 * field * DEGREE).cos();
        let (worst, count) = worst(size, &equidistant(field, 1600.0), 1.1, |bearing, _| bearing.z > most);
        assert!(worst < 0.1 && count > 15_000, "{field}: {worst} {count}");
    }
}

/// Meridians meet at the poles, and the picture wraps around behind the camera.
#[test]
fn a_panorama_is_seen_to_a_tenth_of_a_pixel_but_at_its_seams() {
    let size = [2048.0, 1024.0];
    let beside = |bearing: &Vector3<f64>, pixel: &Vector2<f64>| {
        let from_seam = pixel.x.min(2047.0 - pixel.x) * (TAU / 2048.0) * bearing.xz().norm();
        bearing.y.abs() < (70.0 * DEGREE).sin() && from_seam > DEGREE
    };
    let (worst, count) = worst(size, &panorama(2048.0), 1.1, beside);
    assert!(worst < 0.1 && count > 30_000, "{worst} {count}");
}

/// No bearing is seen where the camera does not: not in between both ends of a panorama, and not behind a pinhole.
#[test]
fn nothing_is_seen_where_the_camera_sees_none() {
    let (size, mut random) = ([2048.0, 1024.0], Random::new(32));
    let camera = panorama(2048.0);
    let made = table(size, &camera);
    for _ in 0..20_000 {
        let side = random.uniform(-0.02, 0.02);
        let bearing = Vector3::new(side, random.uniform(-1.0, 1.0), -1.0);
        if let Some(seen) = made.pixel_of(&bearing) {
            assert!((seen - camera(&bearing)).norm() < 1.0, "{bearing} {seen}");
        }
    }
    let made = table([640.0, 480.0], &pinhole(500.0, [640.0, 480.0]));
    for _ in 0..2_000 {
        let mut bearing = random.direction();
        bearing.z = -bearing.z.abs();
        assert_eq!(made.pixel_of(&bearing), None);
    }
    for bearing in [Vector3::zeros(), Vector3::repeat(f64::NAN)] {
        assert_eq!(made.pixel_of(&bearing), None);
    }
}

#[test]
fn a_camera_that_sees_nothing_is_refused() {
    let nowhere = |bearings: &[Vector3<f64>]| Ok::<_, Error>(vec![none(); bearings.len()]);
    let beside = |bearings: &[Vector3<f64>]| Ok::<_, Error>(vec![Vector2::new(5000.0, 100.0); bearings.len()]);
    for error in
        [Projection::new([640.0, 480.0], nowhere).unwrap_err(), Projection::new([640.0, 480.0], beside).unwrap_err()]
    {
        assert!(error.to_string().contains("sees nothing within its 640 x 480 pixels"), "{error}");
    }
    let failed =
        |_: &[Vector3<f64>]| Err(Error::InvalidOption { item: "it", found: "fails".into(), needed: "not to".into() });
    assert!(Projection::new([640.0, 480.0], failed).unwrap_err().to_string().contains("it"));
}
