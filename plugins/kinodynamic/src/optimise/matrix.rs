//! Small matrices of fixed size as arrays of rows.
//!
//! They are plain loops over indices: in the profile that tests and planners are built with, iterators are hardly inlined and take
//! twice the time.
#![expect(clippy::needless_range_loop, reason = "see above")]

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
    for row in 0..R {
        for middle in 0..S {
            for column in 0..C {
                all[row][column] += a[row][middle] * b[middle][column];
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
    for middle in 0..S {
        for row in 0..R {
            for column in 0..C {
                all[row][column] += a[middle][row] * b[middle][column];
            }
        }
    }
    all
}

/// A Bᵀ, added to what is there.
pub fn add_product_transposed<const R: usize, const S: usize, const C: usize>(
    all: &mut Matrix<R, C>,
    a: &Matrix<R, S>,
    b: &Matrix<C, S>,
) {
    for row in 0..R {
        for column in 0..C {
            for middle in 0..S {
                all[row][column] += a[row][middle] * b[column][middle];
            }
        }
    }
}

/// A v.
pub fn times<const R: usize, const C: usize>(a: &Matrix<R, C>, v: &[f64; C]) -> [f64; R] {
    let mut all = [0.0; R];
    for row in 0..R {
        for column in 0..C {
            all[row] += a[row][column] * v[column];
        }
    }
    all
}

/// Aᵀ v.
pub fn transposed_times<const R: usize, const C: usize>(
    a: &Matrix<R, C>,
    v: &[f64; R],
) -> [f64; C] {
    let mut all = [0.0; C];
    for row in 0..R {
        for column in 0..C {
            all[column] += a[row][column] * v[row];
        }
    }
    all
}

/// v + w.
pub fn sum<const R: usize>(v: &[f64; R], w: &[f64; R]) -> [f64; R] {
    let mut all = *v;
    for row in 0..R {
        all[row] += w[row];
    }
    all
}

/// These numbers on the diagonal.
pub fn diagonal<const R: usize>(numbers: &[f64; R]) -> Matrix<R, R> {
    let mut all = zeros::<R, R>();
    for row in 0..R {
        all[row][row] = numbers[row];
    }
    all
}

/// Adds B to A.
pub fn add<const R: usize, const C: usize>(a: &mut Matrix<R, C>, b: &Matrix<R, C>) {
    for row in 0..R {
        for column in 0..C {
            a[row][column] += b[row][column];
        }
    }
}

/// Makes a matrix symmetric that is so but for rounding.
pub fn level<const R: usize>(a: &mut Matrix<R, R>) {
    for row in 0..R {
        for column in 0..row {
            let mean = f64::midpoint(a[row][column], a[column][row]);
            a[row][column] = mean;
            a[column][row] = mean;
        }
    }
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
