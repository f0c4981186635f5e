//! Triangulated regions and outlines of point sets: the only module that names spade.

pub mod alpha_shape;
pub mod triangulation;
