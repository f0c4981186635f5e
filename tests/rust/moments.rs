//! t
use regionpose::moments::sphere::spherical_moments;
use regionpose::moments::plane::planar_moments;
use nalgebra::*;
#[test]
fn octant() {
    let r = [Vector3::x(), Vector3::y(), Vector3::z()];
    let m = spherical_moments([&r[..]], 5);
    println!("{:?} {}", m.values(), std::f64::consts::FRAC_PI_2);
    let r = [vector![100., -70.], vector![101., -70.], vector![101., -69.], vector![100., -69.]];
    println!("{:?}", planar_moments([&r[..]], 3).values());
}
