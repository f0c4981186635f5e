//! Numbers of as many edges, worked on in loops that the compiler turns into vector instructions.

/// Edges of a group: few enough that most groups of neighbors lie wholly inside or outside a view, and a multiple of what vectors hold.
pub(super) const GROUP: usize = 32;

/// A number of each edge of a group.
pub(super) type Floats = [f32; GROUP];

/// A whole number of each edge of a group: vectors hold as many of these as of floats.
pub(super) type Numbers = [i32; GROUP];

/// None yet.
pub(super) const ZEROS: Floats = [0.0; GROUP];

/// The whole part of a number between 0 and `most`, below 2^23; that of the nearer of both for numbers beyond these, 0 for NaN.
///
/// The compiler makes no vector instructions of `as`, but it does of this: above 2^23 a float's last bits are a whole number.
#[inline(always)]
pub(super) fn whole(value: f32, most: f32) -> i32 {
    const ABOVE: f32 = 8_388_608.0;
    let value = if value > 0.0 { value } else { 0.0 };
    let value = if value < most { value } else { most };
    (value.floor() + ABOVE).to_bits() as i32 - ABOVE.to_bits() as i32
}

/// The sum over the edges whose number in `shown` is not 0, in halves: in one order on every machine, and to a few roundings.
#[inline(always)]
pub(super) fn total(values: &Floats, shown: &Numbers) -> f64 {
    let mut sums = ZEROS;
    for edge in 0..GROUP {
        sums[edge] = if shown[edge] == 0 { 0.0 } else { values[edge] };
    }
    let mut half = GROUP / 2;
    while half > 0 {
        for edge in 0..half {
            sums[edge] += sums[edge + half];
        }
        half /= 2;
    }
    f64::from(sums[0])
}
