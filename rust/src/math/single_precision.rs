//! Functions in single precision without branches, so that the compiler works on as many numbers at once as its vectors hold.

/// The standard normal distribution, to 2e-6: `2 (1 - cumulative(x))` is close to `(1 + c_1 x + ... + c_5 x^5)^-16` (the form of
/// Abramowitz and Stegun, 7.1.28), with the largest error of the coefficients as small as it gets.
#[inline(always)]
pub fn cumulative(x: f32) -> f32 {
    const C: [f32; 5] = [0.049_872_022, 0.021_104_284, 0.003_365_175_3, -4.775_439e-5, 8.500_218e-5];
    let far = x.abs();
    let base = 1.0 + far * (C[0] + far * (C[1] + far * (C[2] + far * (C[3] + far * C[4]))));
    let square = base * base;
    let fourth = square * square;
    let eighth = fourth * fourth;
    let beyond = 0.5 / (eighth * eighth);
    if x < 0.0 { beyond } else { 1.0 - beyond }
}

/// The exponential of a number of at most 0, to a relative error of 1e-6; 0 where it is less than 1e-37.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    // Rounds to a whole number, which is then in the last bits.
    const WHOLE: f32 = 12_582_912.0;
    const LEAST: f32 = -85.0;
    let x = if x > LEAST { x } else { LEAST };
    let shifted = x * std::f32::consts::LOG2_E + WHOLE;
    let whole = shifted - WHOLE;
    // ln 2 in two parts, of which the first times a whole number is exact.
    let rest = (x - whole * 0.693_359_4) + whole * 2.121_944_4e-4;
    let cubed = 1.0 / 6.0 + rest * (1.0 / 24.0 + rest * (1.0 / 120.0 + rest * (1.0 / 720.0)));
    let power = 1.0 + rest * (1.0 + rest * (0.5 + rest * cubed));
    let exponent = shifted.to_bits().wrapping_sub(WHOLE.to_bits()).wrapping_add(127) << 23;
    let value = power * f32::from_bits(exponent);
    if x > LEAST { value } else { 0.0 }
}

/// The natural logarithm of a positive number, to 1e-6 or a relative error as small; of one less than 1e-38, that of that.
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    let x = if x > f32::MIN_POSITIVE { x } else { f32::MIN_POSITIVE };
    // A number between the roots of 1/2 and 2 times a power of 2.
    const ROOT: u32 = std::f32::consts::FRAC_1_SQRT_2.to_bits();
    let above = x.to_bits().wrapping_sub(ROOT);
    let exponent = (above as i32 >> 23) as f32;
    let number = f32::from_bits((above & 0x007f_ffff).wrapping_add(ROOT));
    let share = (number - 1.0) / (number + 1.0);
    let square = share * share;
    exponent * std::f32::consts::LN_2
        + 2.0 * share * (1.0 + square * (1.0 / 3.0 + square * (0.2 + square * (1.0 / 7.0 + square * (1.0 / 9.0)))))
}
