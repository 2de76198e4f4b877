//! Where the discs are: flat arrays, one entry per agent.

/// Positions at the two ends of a span of time, in metres. Within a span every
/// body moves uniformly from one to the other.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bodies {
    pub(crate) x0: Vec<f64>,
    pub(crate) y0: Vec<f64>,
    pub(crate) x1: Vec<f64>,
    pub(crate) y1: Vec<f64>,
}

impl Bodies {
    pub(crate) fn at_rest(x: Vec<f64>, y: Vec<f64>) -> Self {
        let (x1, y1) = (x.clone(), y.clone());
        Self {
            x0: x,
            y0: y,
            x1,
            y1,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.x0.len()
    }

    /// The end of this span becomes the start of the next. The new end is
    /// whatever was there; the caller fills it.
    pub(crate) fn turn_over(&mut self) {
        std::mem::swap(&mut self.x0, &mut self.x1);
        std::mem::swap(&mut self.y0, &mut self.y1);
    }
}

/// A stretch of time in which every body moves uniformly, in substeps since the
/// start of the execution; the ends need not be whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    pub(crate) start: f64,
    pub(crate) end: f64,
}

impl Span {
    pub(crate) fn length(self) -> f64 {
        self.end - self.start
    }

    /// The moment at a fraction of the span.
    pub(crate) fn at(self, fraction: f64) -> f64 {
        self.start + fraction * self.length()
    }
}
