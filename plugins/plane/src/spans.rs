//! Sets of open intervals of time.

use crate::motion::Span;

/// Open intervals, in order; what overlaps or touches is one. Times between them are safe, their ends included.
///
/// Two intervals that touch are joined, though their common end is in neither: a robot has no use for a moment.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Spans(Vec<Span>);

impl Spans {
    /// None.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// The intervals, in order.
    pub fn as_slice(&self) -> &[Span] {
        &self.0
    }

    /// Adds an interval; an empty one changes nothing.
    pub fn insert(&mut self, span: Span) {
        if span.low.partial_cmp(&span.high) != Some(std::cmp::Ordering::Less) {
            return;
        }
        let first = self.0.partition_point(|known| known.high < span.low);
        let end = self.0.partition_point(|known| known.low <= span.high);
        if first == end {
            self.0.insert(first, span);
            return;
        }
        let joined = Span {
            low: span.low.min(self.0[first].low),
            high: span.high.max(self.0[end - 1].high),
        };
        self.0[first] = joined;
        self.0.drain(first + 1..end);
    }

    /// The first time from `time` on that is in none of the intervals.
    pub fn first_outside(&self, time: f64) -> f64 {
        let at = self.0.partition_point(|span| span.high <= time);
        match self.0.get(at) {
            Some(span) if span.low < time => span.high,
            _ => time,
        }
    }

    /// The same for times that grow from call to call: `at` is 0 at first, and says where the last one was.
    pub fn first_outside_after(&self, time: f64, at: &mut usize) -> f64 {
        // The next one is most often near.
        let near = (*at + 4).min(self.0.len());
        while *at < near && self.0[*at].high <= time {
            *at += 1;
        }
        if *at == near {
            *at += self.0[near..].partition_point(|span| span.high <= time);
        }
        match self.0.get(*at) {
            Some(span) if span.low < time => span.high,
            _ => time,
        }
    }

    /// Number of intervals that end before or at a time: the number of the safe interval that
    /// begins there or holds it.
    pub fn ended(&self, time: f64) -> usize {
        self.0.partition_point(|span| span.high <= time)
    }

    /// The closed safe interval number `n`: what is between intervals `n − 1` and `n`.
    pub fn safe(&self, n: usize) -> Span {
        let before = n.checked_sub(1).and_then(|before| self.0.get(before));
        Span {
            low: before.map_or(f64::NEG_INFINITY, |span| span.high),
            high: self.0.get(n).map_or(f64::INFINITY, |span| span.low),
        }
    }

    /// Removes all intervals, and keeps their room.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

impl FromIterator<Span> for Spans {
    fn from_iter<T: IntoIterator<Item = Span>>(spans: T) -> Self {
        let mut all: Vec<Span> = spans
            .into_iter()
            .filter(|span| span.low < span.high)
            .collect();
        all.sort_unstable_by(|one, other| one.low.total_cmp(&other.low));
        all.dedup_by(|next, last| {
            let joins = next.low <= last.high;
            if joins {
                last.high = last.high.max(next.high);
            }
            joins
        });
        Self(all)
    }
}
