//! Numbers as text, alike in tables, Markdown and the page (`page/numbers.js`).

/// The text for an absent value.
pub(super) const NONE: &str = "–";

/// Three significant digits, but all of those before the point.
pub(super) fn digits(value: Option<f64>) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else {
        return NONE.to_owned();
    };
    if value == 0.0 {
        return "0".to_owned();
    }
    let size = value.abs();
    if !(1e-6..1e9).contains(&size) {
        return scientific(value);
    }
    let decimals = (2.0 - size.log10().floor()).clamp(0.0, 9.0);
    fixed(Some(value), decimals as usize)
}

/// With this many decimals, ties away from zero.
pub(super) fn fixed(value: Option<f64>, decimals: usize) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else {
        return NONE.to_owned();
    };
    // What lies exactly in the middle is a multiple of a power of two.
    let scaled = value * 10f64.powi(decimals as i32);
    let exact = (value * 2f64.powi(decimals as i32 + 1)).fract().abs() <= 0.0;
    let middle = exact && (scaled.fract().abs() - 0.5).abs() <= 0.0;
    let value = if middle {
        scaled.round() / 10f64.powi(decimals as i32)
    } else {
        value
    };
    minus(&format!("{value:.decimals$}"))
}

fn minus(text: &str) -> String {
    text.replace('-', "−")
}

/// A share as per cent.
pub(super) fn percent(share: Option<f64>) -> String {
    match share {
        Some(share) => format!("{} %", fixed(Some(100.0 * share), 1)),
        None => NONE.to_owned(),
    }
}

/// `1.95×10⁻¹⁴`
pub(super) fn scientific(value: f64) -> String {
    let text = format!("{value:.2e}");
    let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
    let raised: String = power
        .chars()
        .map(|c| match c.to_digit(10) {
            Some(digit) => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize],
            None => '⁻',
        })
        .collect();
    format!("{}×10{raised}", minus(mantissa))
}

/// A p-value.
pub(super) fn probability(p: f64) -> String {
    if p < 1e-300 {
        return "<10⁻³⁰⁰".to_owned();
    }
    if p < 1e-3 {
        scientific(p)
    } else {
        fixed(Some(p), 3)
    }
}

/// A mark of an axis.
pub(super) fn tick(percent: bool, value: f64) -> String {
    if percent {
        return format!("{} %", plain(100.0 * value));
    }
    match value.abs() {
        size if size >= 1e6 || (size < 1e-4 && size > 0.0) => {
            let text = scientific(value).replace(".00", "");
            text.strip_prefix("1×").map(str::to_owned).unwrap_or(text)
        }
        size if size >= 1e4 => format!("{}k", plain(value / 1000.0)),
        _ => plain(value),
    }
}

/// The shortest text of a number that was rounded to three significant digits.
fn plain(value: f64) -> String {
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    minus(&rounded.to_string())
}

/// With a capital at the beginning.
pub(super) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => first.to_uppercase().chain(letters).collect(),
        None => String::new(),
    }
}

/// A number with its digits in groups of three.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        let cases = [
            (0.347_222, "0.347"),
            (142.72, "143"),
            (7061.34, "7061"),
            (22.56, "22.6"),
            (-0.068_12, "−0.0681"),
            (0.0, "0"),
            (1234.5, "1235"),
            (2.5e9, "2.50×10⁹"),
            (1.95e-14, "1.95×10⁻¹⁴"),
        ];
        for (value, expected) in cases {
            assert_eq!(digits(Some(value)), expected, "{value}");
        }
        assert_eq!(digits(None), NONE);
        assert_eq!(digits(Some(f64::NAN)), NONE);
        assert_eq!(fixed(Some(0.125), 2), "0.13");
        assert_eq!(fixed(Some(0.045), 2), "0.04");
        assert_eq!(percent(Some(0.9)), "90.0 %");
        assert_eq!(probability(0.0216), "0.022");
        assert_eq!(grouped(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(grouped(100), "100");
        let ticks = [0.05, 2.5, 20_000.0, 1e7, 2e-5, -3.0].map(|value| tick(false, value));
        assert_eq!(ticks, ["0.05", "2.5", "20k", "10⁷", "2×10⁻⁵", "−3"]);
    }
}
