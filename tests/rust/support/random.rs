//! Seeded random numbers, rotations and poses.

use std::f64::consts::TAU;

use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use regionpose::Pose;
use regionpose::internals::geometry::pose::Tangent;

/// The SplitMix64 generator (Steele, Lea and Flood 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// One of `0..count`.
    pub fn index(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    /// Normally distributed, mean 0 and variance 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(0.0, 1.0)).ln()).sqrt();
        radius * (TAU * self.uniform(0.0, 1.0)).cos()
    }

    /// Three of these.
    pub fn normals(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal())
    }

    /// Uniform on the sphere.
    pub fn direction(&mut self) -> Vector3<f64> {
        self.normals().normalize()
    }

    /// Uniform over all rotations.
    pub fn rotation(&mut self) -> Rotation3<f64> {
        let quaternion = Quaternion::from_parts(self.normal(), self.normals());
        UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix()
    }

    /// Any rotation, and a translation of `size`.
    pub fn pose(&mut self, size: f64) -> Pose {
        Pose::new(self.rotation(), self.direction() * size)
    }

    /// Rotation and translation parts of the given lengths.
    pub fn tangent(&mut self, angle: f64, length: f64) -> Tangent {
        let (omega, tau) = (self.direction() * angle, self.direction() * length);
        Tangent::new(omega.x, omega.y, omega.z, tau.x, tau.y, tau.z)
    }
}
