//! The few characters that pictures need, as strokes: PNG is drawn without
//! fonts, and a path looks the same everywhere.

/// Strokes of a character on a grid 4 wide and 6 high, y down, with descenders below; `;`
/// lifts the pen between strokes, each a list of column and row.
fn strokes(character: char) -> Option<&'static str> {
    Some(match character {
        '0' => "00 40 46 06 00",
        '1' => "11 20 26;06 46",
        '2' => "00 40 43 03 06 46",
        '3' => "00 40 46 06;03 43",
        '4' => "00 03 43;40 46",
        '5' => "40 00 03 43 46 06",
        '6' => "40 00 06 46 43 03",
        '7' => "00 40 26",
        '8' => "00 40 46 06 00;03 43",
        '9' => "43 03 00 40 46 06",
        '-' => "04 44",
        '_' => "07 47",
        '.' => "25 26",
        '=' => "02 42;04 44",
        '/' => "06 40",
        'a' => "02 42 46 06 04 44",
        'b' => "00 06 46 42 02",
        'c' => "42 02 06 46",
        'd' => "40 46 06 02 42",
        'e' => "04 44 42 02 06 46",
        'f' => "40 20 26;03 43",
        'g' => "48 18;48 42 02 06 46",
        'h' => "00 06;02 42 46",
        'i' => "22 26;20 21",
        'j' => "22 28 08;20 21",
        'k' => "00 06;42 04 46",
        'l' => "10 16 36",
        'm' => "06 02 22 26;22 42 46",
        'n' => "06 02 42 46",
        'o' => "02 42 46 06 02",
        'p' => "08 02 42 46 06",
        'q' => "48 42 02 06 46",
        'r' => "06 02;04 22 42",
        's' => "42 02 04 44 46 06",
        't' => "10 16 46;02 42",
        'u' => "02 06 46 42",
        'v' => "02 26 42",
        'w' => "02 06 26 46 42;23 26",
        'x' => "02 46;42 06",
        'y' => "02 06 46;42 48 18",
        'z' => "02 42 06 46",
        _ => return None,
    })
}

/// Width of a text of the given height, without the blank after it.
pub(crate) fn width(text: &str, height: f64) -> f64 {
    (text.chars().count() as f64 * 5.5 - 1.5).max(0.0) * height / 6.0
}

/// The strokes of a text of the given height: lists of points. The first
/// character's upper left corner is at (`x`, `y`), y down. Characters
/// without strokes are blanks.
pub(crate) fn lines(text: &str, x: f64, y: f64, height: f64) -> Vec<Vec<[f64; 2]>> {
    let unit = height / 6.0;
    let mut out = Vec::new();
    for (at, character) in text.chars().enumerate() {
        let left = x + at as f64 * 5.5 * unit;
        for stroke in strokes(character).unwrap_or("").split(';') {
            let points = stroke.split_whitespace().map(|point| {
                let mut digits = point.bytes().map(|digit| f64::from(digit - b'0'));
                let mut next = || digits.next().unwrap_or(0.0) * unit;
                [left + next(), y + next()]
            });
            out.push(points.collect());
        }
    }
    out.retain(|line: &Vec<_>| !line.is_empty());
    out
}
