//! `regionpose._core`: the core crate's kernels for Python.
//!
//! Each function checks shapes, copies what it needs, calls one core function without the interpreter, and converts.
#![forbid(unsafe_code)]

mod alignment;
mod arrays;
mod contours;
mod interrupts;
mod masks;
mod mesh;
mod moments;
mod pictures;
mod pose_search;
mod poses;
mod prior;
mod regions;
mod solve;
mod warnings;

/// Kernels of regionpose.
#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use crate::alignment::blurred;
    #[pymodule_export]
    use crate::contours::{contour_pieces, nearest_edges};
    #[pymodule_export]
    use crate::interrupts::work_counter;
    #[pymodule_export]
    use crate::masks::{color_levels, flood_levels, mask_contours, outline_sums};
    #[pymodule_export]
    use crate::mesh::{alpha_shape, bridging_gap, even_mesh, even_spacing, plane_rings, triangulate};
    #[pymodule_export]
    use crate::moments::{
        mesh_planar_moments, mesh_spherical_moments, pixel_moments, planar_moments, quad_solid_angles,
        spherical_moments,
    };
    #[pymodule_export]
    use crate::pictures::png_bytes;
    #[pymodule_export]
    use crate::pose_search::{
        AlignmentFrame, CloudEdges, Density, LocalWeights, Projection, edge_spreads, search_poses,
    };
    #[pymodule_export]
    use crate::poses::{retract_pose, rotation_confidence};
    #[pymodule_export]
    use crate::prior::Prior;
    #[pymodule_export]
    use crate::regions::{ObservedRegion, WorldRegion, cells_along, robust_plane};
    #[pymodule_export]
    use crate::solve::{Estimate, Minimum, Problem, Search, Solution, estimate_batch};

    #[pymodule_export]
    const TRUSTED: f64 = regionpose::internals::verdict::solution::TRUSTED;

    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "Python's name for it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
