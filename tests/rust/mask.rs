//! Contours of masks: small pictures with their rings, and laws over random ones.

use nalgebra::Vector2;
use proptest::prelude::*;
use regionpose::Error;
use regionpose::internals::view::mask::{Mask, MaskContours, MaskValue};

fn contours<T: MaskValue>(values: &[T], columns: usize) -> Result<MaskContours, Error> {
    MaskContours::of(Mask::new(values, columns).expect("whole rows"))
}

/// A mask drawn in rows of `#` and `.`.
fn drawn(rows: &[&str]) -> (Vec<u8>, usize) {
    (rows.concat().bytes().map(|pixel| u8::from(pixel == b'#')).collect(), rows[0].len())
}

fn traced(rows: &[&str]) -> MaskContours {
    let (values, columns) = drawn(rows);
    contours(&values, columns).expect("a mask")
}

#[test]
fn a_pixel_is_a_diamond_of_half_an_area() {
    let found = traced(&["....", ".#..", "...."]);
    assert_eq!(found.rings.area(), 0.5);
    assert_eq!((found.rows, found.columns, found.binary), (1..2, 1..2, true));
    assert!(found.rings.rings()[0].contains(&Vector2::new(0.5, 1.0)));
}

#[test]
fn a_block_has_straight_sides_and_cut_corners() {
    let found = traced(&[".....", ".###.", ".###.", ".###.", "....."]);
    assert_eq!(found.rings.area(), 9.0 - 4.0 * 0.125);
    assert_eq!(found.rings.rings()[0].len(), 8);
}

#[test]
fn a_ring_has_a_hole_and_pixels_that_touch_at_a_corner_are_apart() {
    assert_eq!(traced(&[".....", ".###.", ".#.#.", ".###.", "....."]).rings.rings().len(), 2);
    let apart = traced(&["....", ".#..", "..#.", "...."]).rings;
    assert_eq!((apart.rings().len(), apart.area()), (2, 1.0));
}

#[test]
fn the_border_cuts_half_a_pixel_outside_the_outermost_centers() {
    let whole = traced(&["###", "###"]).rings;
    assert_eq!(whole.bounds(), (Vector2::new(-0.5, -0.5), Vector2::new(2.5, 1.5)));
    assert_eq!((whole.area(), whole.rings()[0].len()), (6.0, 4));
}

#[test]
fn the_contour_of_a_coverage_is_interpolated() {
    let values = [0.0, 0.0, 0.0, 0.0, 0.75, 0.0, 0.0, 0.0, 0.0];
    let found = contours(&values, 3).expect("a mask");
    // From 0.75 to 0 the level is a third of the way from the center.
    assert!((found.rings.area() - 2.0 / 9.0).abs() < 1e-12 && !found.binary);
}

#[test]
fn a_pixel_at_the_level_is_no_region_and_joins_its_neighbors_without_a_touch() {
    let lone = [0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(contours(&lone, 4).expect("a mask").rings.rings().len(), 1);
    let neck = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(contours(&neck, 5).expect("a mask").rings.rings().len(), 1);
    assert_eq!(contours(&[0.5_f32, 0.25], 2), Err(Error::EmptyMask));
}

#[test]
fn other_values_are_named() {
    assert_eq!(contours(&[0_u8, 3, 7], 3), Err(Error::MaskIntegers { found: 3 }));
    assert_eq!(contours(&[0_i64, 0], 1), Err(Error::EmptyMask));
    let refused = contours(&[0.0, f64::NAN, 2.0], 3).expect_err("no coverage");
    assert_eq!(refused.to_string(), "mask holds values from nan to nan; needed coverage in [0, 1]");
    let refused = contours(&[0.25_f32, 1.5, 0.5], 3).expect_err("no coverage");
    assert_eq!(refused.to_string(), "mask holds values from 0.25 to 1.5; needed coverage in [0, 1]");
}

#[test]
fn values_that_fill_no_rows_are_no_mask() {
    assert!(Mask::new(&[1_u8; 5], 2).is_none());
    assert!(Mask::new(&[1_u8; 5], 0).is_none());
    assert!(Mask::<u8>::new(&[], 3).is_none());
}

fn turned(values: &[f64], columns: usize) -> Vec<f64> {
    let rows = values.len() / columns;
    (0..values.len()).map(|k| values[(k % rows) * columns + k / rows]).collect()
}

proptest! {
    #[test]
    fn a_mask_and_its_mirror_have_one_area(
        (values, columns) in (1_usize..70).prop_flat_map(|columns| {
            let value = prop_oneof![Just(0.0), Just(1.0), 0.0..=1.0_f64];
            let rows = 1_usize..7;
            (rows.prop_flat_map(move |rows| prop::collection::vec(value.clone(), rows * columns)), Just(columns))
        })
    ) {
        let rows = values.len() / columns;
        match (contours(&values, columns), contours(&turned(&values, columns), rows)) {
            (Ok(found), Ok(mirrored)) => {
                // Vertices are left out of one ring that stay in the other.
                let allowed = 0.02 * found.rings.edges().map(|(a, b)| (b - a).norm()).sum::<f64>();
                prop_assert!((found.rings.area() - mirrored.rings.area()).abs() <= allowed);
                prop_assert_eq!((found.rows, found.columns), (mirrored.columns, mirrored.rows));
            }
            (found, mirrored) => prop_assert_eq!(found, mirrored),
        }
    }
}
