//! The pieces that a contour is cut into: equally long, exact sums, straight runs, nothing along the image's border.

use nalgebra::Vector2;
use regionpose::internals::contour::pieces::{Piece, pieces};
use regionpose::internals::geometry::rings::PlaneRings;

fn cut(ring: &[(f64, f64)], pixels: f64, on_border: &[Vec<bool>]) -> Vec<Piece> {
    let ring = ring.iter().map(|&(x, y)| Vector2::new(x, y)).collect();
    pieces(&PlaneRings::polygon(vec![ring]).unwrap(), on_border, pixels, 1)
}

const SQUARE: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];

#[test]
fn pieces_of_a_square_lie_on_its_sides_and_each_side_is_one_run() {
    let pieces = cut(&SQUARE, 30.0, &[]);
    assert_eq!(pieces.len(), 40);
    for (index, piece) in pieces.iter().enumerate() {
        let beside = piece.mean.x.min(piece.mean.y).min(1.0 - piece.mean.x).min(1.0 - piece.mean.y);
        assert!(beside.abs() < 1e-12);
        // A tenth of a side spreads along it by its length squared over twelve, and not across.
        assert!((piece.spread.trace() - 0.01 / 12.0).abs() < 1e-12);
        assert!(piece.spread.symmetric_eigenvalues().min().abs() < 1e-12);
        assert_eq!(piece.run, pieces[index / 10 * 10].run);
    }
    let runs: Vec<[usize; 2]> = (0..4).map(|side| pieces[10 * side].run.unwrap()).collect();
    // Each side ends at the corner where the next begins, the last at the first one's.
    (0..4).for_each(|side| assert_eq!(runs[side][1], runs[(side + 1) % 4][0]));
    assert_eq!(runs.iter().collect::<std::collections::HashSet<_>>().len(), 4);
}

#[test]
fn pieces_over_a_stair_lie_on_no_run() {
    let mut stair: Vec<(f64, f64)> = (0..40).flat_map(|k| [(k as f64, k as f64), (k as f64 + 1.0, k as f64)]).collect();
    stair.push((40.0, 40.0));
    stair.push((0.0, 40.0));
    let pieces = cut(&stair, 1.0, &[]);
    let on_the_stair = |piece: &&Piece| piece.mean.x > 2.0 && piece.mean.x < 38.0 && piece.mean.y < piece.mean.x + 1.0;
    let over: Vec<&Piece> = pieces.iter().filter(on_the_stair).collect();
    assert!(over.len() > 20);
    assert!(over.iter().all(|piece| piece.run.is_none() && piece.spread.symmetric_eigenvalues().min() > 0.01));
}

#[test]
fn pieces_that_touch_the_border_are_left_out() {
    let whole = cut(&SQUARE, 30.0, &[]);
    let without = cut(&SQUARE, 30.0, &[vec![false, true, false, false]]);
    assert_eq!((whole.len(), without.len()), (40, 30));
    assert!(without.iter().all(|piece| piece.mean.x < 1.0));
}
