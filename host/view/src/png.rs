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
