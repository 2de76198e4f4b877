//! Still pictures as PNG.

use resvg::{tiny_skia, usvg};

use crate::ViewError;

/// The largest picture in pixels, along either side.
const MAX_SIDE: u32 = 16_384;

/// Draws an SVG document, such as [`Picture::svg`](crate::Picture::svg) writes, as a
/// PNG file. `width` is in pixels; without it the document's own size is used.
/// No fonts are loaded: text in other documents is left out.
pub fn png(svg: &str, width: Option<u32>) -> Result<Vec<u8>, ViewError> {
    let failed = |reason: String| ViewError::new(reason, "write the picture as SVG instead");
    let options = usvg::Options::default();
    let tree = usvg::Tree::from_str(svg, &options)
        .map_err(|error| failed(format!("the picture cannot be drawn: {error}")))?;
    let size = tree.size();
    let scale = width.map_or(1.0, |width| width as f32 / size.width());
    let pixels = |side: f32| f64::from(side * scale).round().clamp(1.0, 1e9) as u32;
    let (width, height) = (pixels(size.width()), pixels(size.height()));
    if width > MAX_SIDE || height > MAX_SIDE {
        return Err(ViewError::new(
            format!("a picture of {width} x {height} pixels is too large"),
            "ask for a smaller width; either side may have 16384 pixels",
        ));
    }
    let mut pixmap = tiny_skia::Pixmap::new(width, height)
        .ok_or_else(|| failed(format!("no memory for {width} x {height} pixels")))?;
    let transform = tiny_skia::Transform::from_scale(scale, scale);
    resvg::render(&tree, transform, &mut pixmap.as_mut());
    pixmap
        .encode_png()
        .map_err(|error| failed(format!("the picture cannot be encoded: {error}")))
}

/// Differences of two pictures.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Pixels of another colour.
    pub pixels: u64,
    /// All pixels of either picture.
    pub of: u64,
    /// A PNG file: the second picture faded, with these pixels in a strong colour.
    pub png: Vec<u8>,
}

/// Compares two PNG files pixel by pixel. It is an error if one is no PNG file, or if
/// they are not of one size.
pub fn difference(expected: &[u8], found: &[u8]) -> Result<Difference, ViewError> {
    let hint = "compare two pictures that were drawn with one width";
    let read = |which: &str, file: &[u8]| {
        tiny_skia::Pixmap::decode_png(file)
            .map_err(|error| ViewError::new(format!("the {which} picture: {error}"), hint))
    };
    let (expected, mut found) = (read("expected", expected)?, read("other", found)?);
    if (expected.width(), expected.height()) != (found.width(), found.height()) {
        let reason = format!(
            "the expected picture has {} x {} pixels, the other {} x {}",
            expected.width(),
            expected.height(),
            found.width(),
            found.height()
        );
        return Err(ViewError::new(reason, hint));
    }
    let mut pixels = 0;
    for (a, b) in expected
        .data()
        .chunks_exact(4)
        .zip(found.data_mut().chunks_exact_mut(4))
    {
        if a == &*b {
            // A quarter of the ink on white.
            for channel in &mut b[..3] {
                *channel = 255 - (255 - *channel) / 4;
            }
            b[3] = 255;
        } else {
            pixels += 1;
            b.copy_from_slice(&[0xd5, 0x5e, 0x00, 0xff]);
        }
    }
    let png = found
        .encode_png()
        .map_err(|error| ViewError::new(format!("it cannot be encoded: {error}"), hint))?;
    let of = u64::from(expected.width()) * u64::from(expected.height());
    Ok(Difference { pixels, of, png })
}
