//! The pose of a camera from two polygons that are known in the world and seen in an image.
//!
//! `cargo run --example 02_pose_from_polygons`

use nalgebra::Vector3;
use regionpose::{ObservedRegion, Problem, Result, WorldRegion};

/// A pinhole camera: focal length and center in pixels.
const CAMERA: [f64; 3] = [1200.0, 960.0, 540.0];

/// A door on the wall y = 0 and a sign on the wall x = 2, meters, z up.
const DOOR: [[f64; 3]; 4] = [[0.2, 0.0, 0.0], [1.1, 0.0, 0.0], [1.1, 0.0, 2.0], [0.2, 0.0, 2.0]];
const SIGN: [[f64; 3]; 5] = [[2.0, -1.2, 1.0], [2.0, -0.4, 1.0], [2.0, -0.4, 1.5], [2.0, -0.8, 1.8], [2.0, -1.2, 1.5]];

/// Their outlines in the image, pixels to a tenth; neither the order of the vertices nor their number has to agree.
const DOOR_IMAGE: [[f64; 2]; 4] = [[931.9, 236.4], [933.9, 867.1], [653.6, 920.4], [627.2, 220.8]];
const SIGN_IMAGE: [[f64; 2]; 5] = [[1347.6, 297.0], [1456.6, 410.7], [1445.2, 607.5], [1245.5, 562.5], [1250.9, 402.9]];

fn observed(polygon: &[[f64; 2]]) -> ObservedRegion {
    let [focal, x, y] = CAMERA;
    let bearings = polygon.iter().map(|p| Vector3::new((p[0] - x) / focal, (p[1] - y) / focal, 1.0)).collect();
    let next = polygon.iter().cycle().skip(1);
    let area = polygon.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum::<f64>().abs();
    ObservedRegion::new(vec![bearings], area)
}

fn main() -> Result<()> {
    let world = |polygon: &[[f64; 3]]| WorldRegion::from_rings(&[polygon.iter().map(|&p| Vector3::from(p)).collect()]);
    let worlds = [world(&DOOR)?, world(&SIGN)?];
    let images = [observed(&DOOR_IMAGE), observed(&SIGN_IMAGE)];
    let estimate = Problem::new(&images, &worlds)?.estimate()?;
    let pose = estimate.best.pose;
    let deviation = |k: usize| estimate.best.covariance[(k, k)].sqrt();
    println!("camera center (world)   {:.3?} m", pose.inverse().translation.as_slice());
    println!("viewing direction       {:.3?}", (pose.rotation.inverse() * Vector3::z()).as_slice());
    println!("standard deviations     {:.3?} deg", [0, 1, 2].map(|k| deviation(k).to_degrees()));
    println!("                        {:.4?} m", [3, 4, 5].map(deviation));
    println!("overlap error           {:.2} %", 100.0 * estimate.best.overlap_error);
    println!("boundary noise          {:.2} pixels", estimate.boundary_noise);
    println!("{} other pose(s), {} evaluations", estimate.alternatives.len(), estimate.evaluations);
    for warning in &estimate.warnings {
        println!("warning: {}", warning.code());
    }
    Ok(())
}
