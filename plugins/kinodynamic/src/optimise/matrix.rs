//! Small matrices of fixed size as arrays of rows.
//!
//! Products of these in plain loops take a third of the time of nalgebra's where its generic code is compiled with few
//! optimisations, as in the profile that tests and planners are built with.

/// So many rows, and so many columns.
pub type Matrix<const R: usize, const C: usize> = [[f64; C]; R];

/// All zeros.
pub fn zeros<const R: usize, const C: usize>() -> Matrix<R, C> {
    [[0.0; C]; R]
}

/// A B.
pub fn product<const R: usize, const S: usize, const C: usize>(
    a: &Matrix<R, S>,
    b: &Matrix<S, C>,
) -> Matrix<R, C> {
    let mut all = zeros::<R, C>();
    for (row, a) in all.iter_mut().zip(a) {
        for (factor, b) in a.iter().zip(b) {
            for (sum, number) in row.iter_mut().zip(b) {
                *sum += factor * number;
            }
        }
    }
    all
}

/// Aᵀ B.
pub fn transposed_product<const R: usize, const S: usize, const C: usize>(
    a: &Matrix<S, R>,
    b: &Matrix<S, C>,
) -> Matrix<R, C> {
    let mut all = zeros::<R, C>();
    for (a, b) in a.iter().zip(b) {
        for (row, factor) in all.iter_mut().zip(a) {
            for (sum, number) in row.iter_mut().zip(b) {
                *sum += factor * number;
            }
        }
    }
    all
}

/// A v.
pub fn times<const R: usize, const C: usize>(a: &Matrix<R, C>, v: &[f64; C]) -> [f64; R] {
    let mut all = [0.0; R];
    for (sum, row) in all.iter_mut().zip(a) {
        *sum = row.iter().zip(v).map(|(a, b)| a * b).sum();
    }
    all
}

/// Aᵀ v.
pub fn transposed_times<const R: usize, const C: usize>(
    a: &Matrix<R, C>,
    v: &[f64; R],
) -> [f64; C] {
    let mut all = [0.0; C];
    for (row, factor) in a.iter().zip(v) {
        for (sum, number) in all.iter_mut().zip(row) {
            *sum += factor * number;
        }
    }
    all
}

/// v + w.
pub fn sum<const R: usize>(v: &[f64; R], w: &[f64; R]) -> [f64; R] {
    std::array::from_fn(|number| v[number] + w[number])
}

/// The lower triangle L of A = L Lᵀ, with the reciprocals of the diagonal in its place. None if A is not positive definite.
pub fn cholesky<const R: usize>(a: &Matrix<R, R>) -> Option<Matrix<R, R>> {
    let mut lower = zeros::<R, R>();
    for row in 0..R {
        for column in 0..=row {
            let mut rest = a[row][column];
            for before in 0..column {
                rest -= lower[row][before] * lower[column][before];
            }
            if row == column {
                if rest.is_nan() || rest <= 0.0 {
                    return None;
                }
                lower[row][row] = libm::sqrt(rest).recip();
            } else {
                lower[row][column] = rest * lower[column][column];
            }
        }
    }
    Some(lower)
}

/// The solution of A x = v, by the triangle of [`cholesky`].
pub fn solved<const R: usize>(lower: &Matrix<R, R>, v: &[f64; R]) -> [f64; R] {
    let mut x = *v;
    for row in 0..R {
        for before in 0..row {
            x[row] -= lower[row][before] * x[before];
        }
        x[row] *= lower[row][row];
    }
    for row in (0..R).rev() {
        for after in row + 1..R {
            x[row] -= lower[after][row] * x[after];
        }
        x[row] *= lower[row][row];
    }
    x
}
