//! Moments of a polygon on the plane, and of the same polygon on the sphere of viewing directions.
//!
//! `cargo run --example 01_moments`

use nalgebra::{Vector2, Vector3};
use regionpose::moments::plane::planar_moments;
use regionpose::moments::sphere::spherical_moments;

fn main() {
    // A window frame on the normalized image plane: the outer ring counter-clockwise, the hole clockwise.
    let frame = [[0.0, 0.0], [0.4, 0.0], [0.4, 0.3], [0.0, 0.3]].map(Vector2::from);
    let pane = [[0.1, 0.1], [0.1, 0.2], [0.3, 0.2], [0.3, 0.1]].map(Vector2::from);

    let plane = planar_moments([&frame[..], &pane[..]], 2);
    let area = plane.get(0, 0);
    println!("area            {area:.6}  (0.4 x 0.3 - 0.2 x 0.1)");
    println!("centroid        ({:.4}, {:.4})", plane.get(1, 0) / area, plane.get(0, 1) / area);
    println!("second moments  xx {:.3e}, xy {:.3e}, yy {:.3e}", plane.get(2, 0), plane.get(1, 1), plane.get(0, 2));

    let bearing = |p: &Vector2<f64>| Vector3::new(p.x, p.y, 1.0).normalize();
    let [frame, pane] = [frame, pane].map(|ring| ring.map(|p| bearing(&p)));
    let sphere = spherical_moments([&frame[..], &pane[..]], 1);
    let mean = Vector3::new(sphere.get(1, 0, 0), sphere.get(0, 1, 0), sphere.get(0, 0, 1)).normalize();
    println!("solid angle     {:.6} sr", sphere.get(0, 0, 0));
    println!("mean direction  ({:.4}, {:.4}, {:.4})", mean.x, mean.y, mean.z);
}
