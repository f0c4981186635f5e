//! Warnings as Python takes them: a code, the regions it is about, values by name.

use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use regionpose::internals::verdict::warning::{Cause, RelativePose, Warning};

pub type WarningFields<'py> = (&'static str, Vec<usize>, Bound<'py, PyDict>);

const PERCENT: f64 = 1e-2;

/// The code, regions and values of a warning; the package's table of warnings holds its text.
pub fn warning_fields<'py>(py: Python<'py>, warning: &Warning) -> PyResult<WarningFields<'py>> {
    Ok((warning.code(), warning.region().into_iter().collect(), values_of(py, warning)?))
}

/// The numbers of a warning, percentages as fractions.
fn values_of<'py>(py: Python<'py>, warning: &Warning) -> PyResult<Bound<'py, PyDict>> {
    let values = PyDict::new(py);
    let set = |name: &str, value: f64| values.set_item(name, value);
    match warning {
        Warning::Ambiguous { others } => set_others(&values, others)?,
        Warning::PoorOverlap { percent, .. } => set("overlap_error", PERCENT * percent)?,
        Warning::OutlierRegion { percent, others, .. } | Warning::AmbiguousRegion { percent, others, .. } => {
            set("contour_fraction", PERCENT * percent)?;
            set("contour_fraction_of_others", PERCENT * others)?;
            if let Warning::AmbiguousRegion { degrees, .. } = warning {
                set("rotation_deg", *degrees)?;
            }
        }
        Warning::LowConfidence { percent } => set("confidence", PERCENT * percent)?,
        Warning::WeakGeometry { degrees, axis, shift, along, most_degrees, most_shift, causes } => {
            set("rotation_sigma_deg", *degrees)?;
            set("translation_sigma_m", *shift)?;
            set("max_rotation_sigma_deg", *most_degrees)?;
            set("max_translation_sigma_m", *most_shift)?;
            if degrees.is_finite() && shift.is_finite() {
                values.set_item("rotation_axis", tuple(axis))?;
                values.set_item("translation_axis", tuple(along))?;
            }
            set_causes(&values, causes)?;
        }
        Warning::InitialContradicted { degrees, shift, sigmas } => {
            set("rotation_deg", *degrees)?;
            set("shift_m", *shift)?;
            sigmas.map_or(Ok(()), |sigmas| set("sigmas", sigmas))?;
        }
        Warning::UpContradicted { degrees, sigmas } => {
            set("angle_deg", *degrees)?;
            set("sigmas", *sigmas)?;
        }
        Warning::PlaceContradicted { shift, sigmas } => {
            set("shift_m", *shift)?;
            set("sigmas", *sigmas)?;
        }
        Warning::NotConverged { termination } => values.set_item("termination", termination.to_string())?,
        _ => {}
    }
    Ok(values)
}

/// Number of other poses that fit, and the least rotation and shift to any of them.
fn set_others(values: &Bound<'_, PyDict>, others: &[RelativePose]) -> PyResult<()> {
    let least = |numbers: &mut dyn Iterator<Item = f64>| numbers.fold(f64::INFINITY, f64::min);
    values.set_item("others", others.len())?;
    values.set_item("rotation_deg", least(&mut others.iter().map(|other| other.degrees)))?;
    values.set_item("shift_m", least(&mut others.iter().map(|other| other.shift)))
}

/// Causes of a weak geometry, each by the name of its number.
fn set_causes(values: &Bound<'_, PyDict>, causes: &[Cause]) -> PyResult<()> {
    for cause in causes {
        match cause {
            Cause::Frontal { degrees } => values.set_item("frontal_deg", degrees)?,
            Cause::Tiny { pixels } => values.set_item("largest_px", pixels)?,
            Cause::Lines { count, .. } => values.set_item("line_regions", count)?,
            Cause::Coplanar => values.set_item("is_coplanar", true)?,
            _ => {}
        }
    }
    Ok(())
}

fn tuple(direction: &Vector3<f64>) -> (f64, f64, f64) {
    (direction.x, direction.y, direction.z)
}
