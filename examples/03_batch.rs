//! Many images at once: a camera on a circle around a plate, its pose solved in each image on all cores.
//!
//! `cargo run --release --example 03_batch`

use std::f64::consts::TAU;
use std::time::Instant;

use nalgebra::{Rotation3, Vector3};
use regionpose::{ObservedRegion, Pose, Problem, Result, WorldRegion, in_parallel};

/// Images around the plate.
const IMAGES: usize = 200;

/// An L-shaped plate, meters.
const PLATE: [[f64; 2]; 6] = [[-0.3, -0.3], [0.5, -0.3], [0.5, 0.0], [0.0, 0.0], [0.0, 0.6], [-0.3, 0.6]];

/// `camera_from_world` of a camera 2 m from the plate's middle and 1.5 m above it, looking at it.
fn camera(angle: f64) -> Pose {
    let center = Vector3::new(2.0 * angle.cos(), 2.0 * angle.sin(), 1.5);
    let rotation = Rotation3::face_towards(&-center, &-Vector3::z()).inverse();
    Pose::new(rotation, -(rotation * center))
}

fn main() -> Result<()> {
    let plate: Vec<_> = PLATE.iter().map(|p| Vector3::new(p[0], p[1], 0.0)).collect();
    let worlds = [WorldRegion::from_rings(std::slice::from_ref(&plate))?];
    let cameras: Vec<Pose> = (0..IMAGES).map(|k| camera(TAU * k as f64 / IMAGES as f64)).collect();
    let solve = |truth: &Pose| {
        let seen = plate.iter().map(|x| truth.transform(x)).collect();
        let image = ObservedRegion::new(vec![seen], 40_000.0);
        let estimate = Problem::new(&[image], &worlds)?.estimate()?;
        Ok(estimate.best.pose.angle_to(truth).to_degrees())
    };
    let start = Instant::now();
    let errors = in_parallel(&cameras, None, solve)?;
    let elapsed = start.elapsed().as_secs_f64();
    let solved: Vec<f64> = errors.into_iter().flatten().collect();
    let worst = solved.iter().copied().fold(0.0, f64::max);
    println!("{} of {IMAGES} images solved, {:.2} ms each", solved.len(), 1e3 * elapsed / IMAGES as f64);
    println!("largest rotation error {worst:.1e} deg");
    Ok(())
}
