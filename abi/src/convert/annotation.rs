//! Annotations in both directions.

use std::ptr;

use super::{code, copied, invalid, lists, offsets_of, size_of, string, whole};
use crate::annotation::{Annotation, MOST_LAYER_BYTES, MOST_POINTS, MOST_TEXT_BYTES, Shape};
use crate::c;
use crate::lists::Lists;
use crate::sdk::Failure;

/// Reads a text that may have so many bytes.
///
/// # Safety
/// As [`string`].
unsafe fn text(name: &str, text: c::Str, most: usize) -> Result<String, Failure> {
    if text.len > most {
        let bytes = text.len;
        return Err(invalid(format!(
            "{name} has {bytes} bytes, at most {most} may be"
        )));
    }
    // SAFETY: by the caller's promise.
    Ok(unsafe { string(text) })
}

impl Annotation {
    /// Calls `give` with the C form, which is valid as long as the call; `None` when its lists
    /// contradict its shape or each other, of which there is no C form.
    pub fn with_c<T>(&self, give: impl FnOnce(*const c::Annotation) -> T) -> Option<T> {
        let is_places = self.shape == Shape::Places;
        let (offsets, no_lists) = if is_places {
            (self.places.offsets(), self.xy_m.is_empty())
        } else {
            (self.xy_m.offsets(), self.places.is_empty())
        };
        let count = offsets.len() - 1;
        if !no_lists || !self.values.is_empty() && self.values.len() != count {
            return None;
        }
        let axis = |axis: usize| -> Vec<f64> {
            let points = self.xy_m.items().iter();
            points.map(|point| point[axis]).collect()
        };
        let (x_m, y_m) = (axis(0), axis(1));
        let or_null = |some: bool, pointer: *const f64| if some { pointer } else { ptr::null() };
        let raw = c::Annotation {
            struct_size: size_of::<c::Annotation>(),
            shape: self.shape.code(),
            layer: c::Str::new(&self.layer),
            text: c::Str::new(&self.text),
            agent: self.agent.unwrap_or(c::NONE),
            count: u32::try_from(count).ok()?,
            from_s: self.from_s,
            to_s: self.to_s.unwrap_or(f64::INFINITY),
            offsets: offsets.as_ptr(),
            x_m: or_null(!is_places, x_m.as_ptr()),
            y_m: or_null(!is_places, y_m.as_ptr()),
            places: if is_places {
                self.places.items().as_ptr()
            } else {
                ptr::null()
            },
            values: or_null(!self.values.is_empty(), self.values.as_ptr()),
        };
        Some(give(&raw const raw))
    }

    /// Copies from the C form and checks the copy, as [`Annotation::check`].
    ///
    /// # Safety
    /// As [`checked`](super::checked), and the arrays are as long as the header says.
    pub unsafe fn from_c(
        pointer: *const c::Annotation,
        agents: usize,
        places: usize,
    ) -> Result<Self, Failure> {
        // SAFETY: by the caller's promise, here and below.
        let raw = unsafe { ptr::read(whole("annotation", pointer)?) };
        let shape = code("annotation.shape", raw.shape, Shape::from_code)?;
        let count = raw.count as usize;
        if count > MOST_POINTS {
            return Err(invalid(format!(
                "annotation.count is {count}, at most {MOST_POINTS} may be"
            )));
        }
        let mut annotation = Self {
            layer: unsafe { text("annotation.layer", raw.layer, MOST_LAYER_BYTES)? },
            shape,
            agent: (raw.agent != c::NONE).then_some(raw.agent),
            from_s: raw.from_s,
            to_s: (raw.to_s != f64::INFINITY).then_some(raw.to_s),
            text: unsafe { text("annotation.text", raw.text, MOST_TEXT_BYTES)? },
            xy_m: Lists::default(),
            places: Lists::default(),
            values: Vec::new(),
        };
        if shape == Shape::Places {
            let names = ["annotation.offsets", "annotation.places"];
            annotation.places =
                unsafe { lists(names, raw.offsets, raw.places, count, MOST_POINTS)? };
        } else {
            let names = ["annotation.offsets", "annotation.x_m"];
            let (offsets, points) = unsafe { offsets_of(names, raw.offsets, count, MOST_POINTS)? };
            let x_m = unsafe { copied("annotation.x_m", raw.x_m, points)? };
            let y_m = unsafe { copied("annotation.y_m", raw.y_m, points)? };
            let points = x_m.into_iter().zip(y_m).map(|(x, y)| [x, y]).collect();
            annotation.xy_m = Lists::from_flat(offsets, points).unwrap_or_default();
        }
        if !raw.values.is_null() {
            annotation.values = unsafe { copied("annotation.values", raw.values, count)? };
        }
        annotation.check(agents, places).map_err(invalid)?;
        Ok(annotation)
    }
}
