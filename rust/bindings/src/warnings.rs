//! Warnings as Python holds them: a code, a sentence, the regions it is about, values by name.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use regionpose::internals::verdict::warning::Warning;

pub type WarningFields<'py> = (&'static str, String, Vec<usize>, Bound<'py, PyDict>);

const PERCENT: f64 = 1e-2;

/// A warning whose sentence has `{0}` for its region, as of Python's `str.format`.
pub fn warning_fields<'py>(py: Python<'py>, warning: &Warning) -> PyResult<WarningFields<'py>> {
    let region = warning.region();
    let plain = warning.to_string().replace('{', "{{").replace('}', "}}");
    let sentence = match region {
        Some(index) => plain.replacen(&format!("region {index}"), "{0}", 1),
        None => plain,
    };
    Ok((warning.code(), sentence, region.into_iter().collect(), values_of(py, warning)?))
}

/// The numbers of a warning, shares as fractions.
fn values_of<'py>(py: Python<'py>, warning: &Warning) -> PyResult<Bound<'py, PyDict>> {
    let values = PyDict::new(py);
    let set = |name: &str, value: f64| values.set_item(name, value);
    match warning {
        Warning::Ambiguous { others } => set("others", others.len() as f64)?,
        Warning::PoorOverlap { percent, .. } => set("overlap_error", PERCENT * percent)?,
        Warning::OutlierRegion { percent, others, .. } | Warning::AmbiguousRegion { percent, others, .. } => {
            set("contour_share", PERCENT * percent)?;
            set("contour_share_of_others", PERCENT * others)?;
            if let Warning::AmbiguousRegion { degrees, .. } = warning {
                set("rotation_deg", *degrees)?;
            }
        }
        Warning::LowConfidence { percent } => set("confidence", PERCENT * percent)?,
        Warning::WeakGeometry { degrees, shift, most_degrees, most_shift, .. } => {
            set("rotation_sigma_deg", *degrees)?;
            set("translation_sigma_m", *shift)?;
            set("max_rotation_sigma_deg", *most_degrees)?;
            set("max_translation_sigma_m", *most_shift)?;
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
