//! Small matrices of fixed size as arrays of rows.
//!
//! They are loops, which are fast in the profile that tests and planners are built with; generic code of nalgebra is not.

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
        *sum = dot(row, v);
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

/// v · w.
pub fn dot(v: &[f64], w: &[f64]) -> f64 {
    v.iter().zip(w).map(|(v, w)| v * w).sum()
}

/// These numbers on the diagonal.
pub fn diagonal<const R: usize>(numbers: &[f64; R]) -> Matrix<R, R> {
    let mut all = zeros::<R, R>();
    for (number, row) in all.iter_mut().enumerate() {
        row[number] = numbers[number];
    }
    all
}

/// Adds B to A.
pub fn add<const R: usize, const C: usize>(a: &mut Matrix<R, C>, b: &Matrix<R, C>) {
    for (sum, number) in a.iter_mut().flatten().zip(b.iter().flatten()) {
        *sum += number;
    }
}

/// Makes a matrix symmetric that is so but for rounding.
pub fn level<const R: usize>(a: &mut Matrix<R, R>) {
    for row in 1..R {
        let (above, below) = a.split_at_mut(row);
        for (column, other) in above.iter_mut().enumerate() {
            let mean = f64::midpoint(other[row], below[0][column]);
            (other[row], below[0][column]) = (mean, mean);
        }
    }
}

/// The lower triangle L of A = L Lᵀ, with the reciprocals of the diagonal in its place. None if A is not positive definite.
pub fn cholesky<const R: usize>(a: &Matrix<R, R>) -> Option<Matrix<R, R>> {
    let mut lower = zeros::<R, R>();
    for row in 0..R {
        for column in 0..=row {
            let rest = a[row][column] - dot(&lower[row][..column], &lower[column][..column]);
            if row > column {
                lower[row][column] = rest * lower[column][column];
            } else if rest > 0.0 {
                lower[row][row] = libm::sqrt(rest).recip();
            } else {
                return None;
            }
        }
    }
    Some(lower)
}

/// The solution of A x = v, by the triangle of [`cholesky`].
pub fn solved<const R: usize>(lower: &Matrix<R, R>, v: &[f64; R]) -> [f64; R] {
    let mut x = *v;
    for row in 0..R {
        x[row] -= dot(&lower[row][..row], &x[..row]);
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
