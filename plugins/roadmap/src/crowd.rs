//! The paths of a team, whom each of them meets, and the times that some of them take from a disc.
//!
//! Unlike [`Reservations`](crate::reservation::Reservations) it knows whose every time is: paths can be exchanged, and a search
//! can keep out of the way of some discs only. What a search needs is put together for the edges and vertices that it comes to.

use std::cell::{OnceCell, RefCell};

use fleetyard_plugin_plane::motion::Span;
use fleetyard_plugin_plane::spans::Spans;

use crate::closeness::Closeness;
use crate::plan::{Path, Visit, cost, position};
use crate::reservation::{Held, Listener, tell};
use crate::roadmap::{Edge, NONE, Vertex};
use crate::sipp::Taken;

/// A time that the path of a disc takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Claim {
    /// The time.
    pub span: Span,
    /// The disc.
    pub disc: u32,
}

/// The claims to a vertex or an edge.
#[derive(Debug, Default)]
struct Claimed {
    /// All of them, in no order.
    claims: Vec<Claim>,
    /// The times of all of them, once somebody has asked.
    times: OnceCell<Spans>,
}

impl Claimed {
    fn times(&self) -> &Spans {
        let all = || self.claims.iter().map(|claim| claim.span).collect();
        self.times.get_or_init(all)
    }

    fn add(&mut self, span: Span, disc: u32) {
        self.claims.push(Claim { span, disc });
        if let Some(times) = self.times.get_mut() {
            times.insert(span);
        }
    }

    fn remove(&mut self, disc: u32) {
        if let Some(at) = self.claims.iter().position(|claim| claim.disc == disc) {
            self.claims.swap_remove(at);
            self.times.take();
        }
    }
}

/// All claims.
#[derive(Debug)]
struct Claims {
    vertices: Vec<Claimed>,
    edges: Vec<Claimed>,
    count: usize,
}

/// Adds the claims of a path.
struct Adding<'c>(&'c mut Claims, u32);

impl Listener for Adding<'_> {
    fn vertex(&mut self, vertex: Vertex, span: Span) {
        let Self(claims, disc) = self;
        if span.low < span.high {
            claims.vertices[vertex as usize].add(span, *disc);
            claims.count += 1;
        }
    }

    fn edge(&mut self, edge: Edge, span: Span) {
        let Self(claims, disc) = self;
        if span.low < span.high {
            claims.edges[edge as usize].add(span, *disc);
            claims.count += 1;
        }
    }
}

/// Takes the claims of a path out.
struct Removing<'c>(&'c mut Claims, u32);

impl Listener for Removing<'_> {
    fn vertex(&mut self, vertex: Vertex, span: Span) {
        let Self(claims, disc) = self;
        if span.low < span.high {
            claims.vertices[vertex as usize].remove(*disc);
            claims.count -= 1;
        }
    }

    fn edge(&mut self, edge: Edge, span: Span) {
        let Self(claims, disc) = self;
        if span.low < span.high {
            claims.edges[edge as usize].remove(*disc);
            claims.count -= 1;
        }
    }
}

/// A disc that another one meets, and the first time at which it does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meeting {
    /// The other disc.
    pub disc: u32,
    /// Seconds.
    pub time: f64,
}

/// The paths of a team.
#[derive(Debug)]
pub struct Crowd<'c> {
    closeness: &'c Closeness,
    /// Seconds after which nobody is in anybody's way.
    until: f64,
    paths: Vec<Path>,
    claims: Claims,
    /// Per disc those that it meets, by their numbers.
    meetings: Vec<Vec<Meeting>>,
    /// Twice the number of pairs that meet.
    met: usize,
    held: Held,
}

impl<'c> Crowd<'c> {
    /// Of so many discs, none of which has a path.
    pub fn new(closeness: &'c Closeness, discs: usize, until: f64) -> Self {
        let none = |count| {
            std::iter::repeat_with(Claimed::default)
                .take(count)
                .collect()
        };
        Self {
            until,
            paths: vec![Path::new(); discs],
            claims: Claims {
                vertices: none(closeness.roadmap().vertices()),
                edges: none(closeness.roadmap().edges()),
                count: 0,
            },
            meetings: vec![Vec::new(); discs],
            met: 0,
            held: Held::new(closeness),
            closeness,
        }
    }

    /// Lets a disc hold its start until a time, whatever its path is: others would come while it cannot be gone.
    pub fn hold(&mut self, disc: usize, start: Vertex, until: f64) {
        self.held.hold(self.closeness, disc, (start, until));
    }

    /// The path of a disc, empty for none.
    pub fn path(&self, disc: u32) -> &Path {
        &self.paths[disc as usize]
    }

    /// All paths.
    pub fn paths(&self) -> &[Path] {
        &self.paths
    }

    /// All paths, to keep.
    pub fn into_paths(self) -> Vec<Path> {
        self.paths
    }

    /// Sum of the times at which paths arrive.
    pub fn cost(&self) -> f64 {
        self.paths.iter().map(|path| cost(path)).sum()
    }

    /// Those that a disc meets, by their numbers.
    pub fn meetings(&self, disc: u32) -> &[Meeting] {
        &self.meetings[disc as usize]
    }

    /// Number of pairs that meet.
    pub fn pairs(&self) -> usize {
        self.met / 2
    }

    /// The pair that meets first.
    pub fn first_pair(&self) -> Option<(u32, u32)> {
        let all = self.meetings.iter().zip(0..);
        let all = all.flat_map(|(list, disc)| list.iter().map(move |meeting| (meeting, disc)));
        let first = all.min_by(|(one, _), (other, _)| one.time.total_cmp(&other.time));
        first.map(|(meeting, disc)| (disc, meeting.disc))
    }

    /// About how many bytes it holds.
    pub fn bytes(&self) -> u64 {
        (self.claims.count * size_of::<Claim>()) as u64
    }

    /// Gives a disc another path, and takes the one that it had. An empty path is none.
    pub fn exchange(&mut self, disc: u32, path: Path) -> Path {
        let old = std::mem::take(&mut self.paths[disc as usize]);
        tell(
            self.closeness,
            &old,
            self.until,
            &mut Removing(&mut self.claims, disc),
        );
        for meeting in std::mem::take(&mut self.meetings[disc as usize]) {
            self.meetings[meeting.disc as usize].retain(|back| back.disc != disc);
            self.met -= 2;
        }
        let meetings = self.met_on(&path);
        for Meeting { disc: other, time } in &meetings {
            let list = &mut self.meetings[*other as usize];
            let at = list.partition_point(|known| known.disc < disc);
            list.insert(at, Meeting { disc, time: *time });
            self.met += 2;
        }
        self.meetings[disc as usize] = meetings;
        tell(
            self.closeness,
            &path,
            self.until,
            &mut Adding(&mut self.claims, disc),
        );
        self.paths[disc as usize] = path;
        old
    }

    /// The discs that a path meets, by their numbers.
    fn met_on(&self, path: &[Visit]) -> Vec<Meeting> {
        let mut all: Vec<(Meeting, f64)> = Vec::new();
        for visit in path.iter().take_while(|visit| visit.arrival < self.until) {
            let stay = Span {
                low: visit.arrival,
                high: visit.departure.min(self.until),
            };
            for Claim { span, disc } in self.claims_to(visit.vertex) {
                let time = span.low.max(stay.low);
                let depth = span.high.min(stay.high) - time;
                if depth > 0.0 {
                    all.push((Meeting { disc: *disc, time }, depth));
                }
            }
            if visit.onward == NONE || visit.departure >= self.until {
                continue;
            }
            let time = visit.departure;
            for Claim { span, disc } in self.claims_to_edge(visit.onward) {
                let depth = (time - span.low).min(span.high - time);
                if depth > 0.0 {
                    all.push((Meeting { disc: *disc, time }, depth));
                }
            }
        }
        all.sort_unstable_by(|(one, _), (other, _)| {
            (one.disc.cmp(&other.disc)).then(one.time.total_cmp(&other.time))
        });
        all.dedup_by(|(next, depth), (first, deepest)| {
            let same = next.disc == first.disc;
            if same {
                *deepest = deepest.max(*depth);
            }
            same
        });
        // Who keeps out of another one's spans may seem to be in its own by rounding: then places decide.
        let doubt = 10.0 * self.closeness.rounding();
        let real = |(meeting, depth): &(Meeting, f64)| {
            *depth > doubt || self.are_too_close(path, self.path(meeting.disc))
        };
        all.retain(real);
        all.into_iter().map(|(meeting, _)| meeting).collect()
    }

    /// True if the centres of two discs are closer than the separation at some time.
    fn are_too_close(&self, one: &[Visit], other: &[Visit]) -> bool {
        let (roadmap, [first, second]) =
            (self.closeness.roadmap(), [one[0].vertex, other[0].vertex]);
        let separation = roadmap.separation(first, second);
        let mut times: Vec<f64> = one.iter().chain(other).flat_map(Visit::times).collect();
        times.retain(|time| *time <= self.until);
        times.sort_unstable_by(f64::total_cmp);
        // Between two of these times the displacement is linear in time.
        times.windows(2).any(|pair| {
            let offset = |time| position(roadmap, one, time) - position(roadmap, other, time);
            let (from, drift) = (offset(pair[0]), offset(pair[1]) - offset(pair[0]));
            let square = drift.norm_squared();
            let at = if square > 0.0 {
                (-from.dot(&drift) / square).clamp(0.0, 1.0)
            } else {
                0.0
            };
            (from + drift * at).norm() < separation
        })
    }

    /// The claims to a vertex, in no order.
    pub fn claims_to(&self, vertex: Vertex) -> &[Claim] {
        &self.claims.vertices[vertex as usize].claims
    }

    /// The claims to an edge, in no order.
    pub fn claims_to_edge(&self, edge: Edge) -> &[Claim] {
        &self.claims.edges[edge as usize].claims
    }
}

/// The times that all paths take from a disc that has none.
impl Taken for Crowd<'_> {
    fn vertex(&self, vertex: Vertex) -> &Spans {
        self.claims.vertices[vertex as usize].times()
    }

    fn first_free(&self, edge: Edge, time: f64) -> f64 {
        self.claims.edges[edge as usize].times().first_outside(time)
    }

    fn first_free_after(&self, edge: Edge, time: f64, at: &mut usize) -> f64 {
        let times = self.claims.edges[edge as usize].times();
        times.first_outside_after(time, at)
    }
}

/// The times that some discs take from one, for the vertices and edges that they come to. Belongs to one search at a time.
#[derive(Debug)]
pub struct Scratch {
    vertices: Vec<OnceCell<Spans>>,
    edges: Vec<OnceCell<Spans>>,
    used: RefCell<(Vec<Vertex>, Vec<Edge>)>,
}

impl Scratch {
    /// For searches on a roadmap.
    pub fn new(closeness: &Closeness) -> Self {
        Self {
            vertices: vec![OnceCell::new(); closeness.roadmap().vertices()],
            edges: vec![OnceCell::new(); closeness.roadmap().edges()],
            used: RefCell::default(),
        }
    }

    fn clear(&mut self) {
        let (vertices, edges) = self.used.get_mut();
        for vertex in vertices.drain(..) {
            self.vertices[vertex as usize].take();
        }
        for edge in edges.drain(..) {
            self.edges[edge as usize].take();
        }
    }
}

/// The times that some discs take from one.
pub struct Others<'a, 'c, F> {
    crowd: &'a Crowd<'c>,
    scratch: &'a Scratch,
    disc: u32,
    counts: F,
}

impl<'a, 'c, F: Fn(u32) -> bool> Others<'a, 'c, F> {
    /// The times that the discs which count take from `disc`.
    pub fn new(crowd: &'a Crowd<'c>, scratch: &'a mut Scratch, disc: u32, counts: F) -> Self {
        scratch.clear();
        Self {
            crowd,
            scratch,
            disc,
            counts,
        }
    }

    fn joined(&self, claims: &[Claim]) -> Spans {
        let others = claims.iter();
        let others = others.filter(|claim| claim.disc != self.disc && (self.counts)(claim.disc));
        others.map(|claim| claim.span).collect()
    }
}

impl<F: Fn(u32) -> bool> Taken for Others<'_, '_, F> {
    fn vertex(&self, vertex: Vertex) -> &Spans {
        self.scratch.vertices[vertex as usize].get_or_init(|| {
            self.scratch.used.borrow_mut().0.push(vertex);
            self.joined(self.crowd.claims_to(vertex))
        })
    }

    fn first_free(&self, edge: Edge, time: f64) -> f64 {
        let spans = self.scratch.edges[edge as usize].get_or_init(|| {
            self.scratch.used.borrow_mut().1.push(edge);
            self.joined(self.crowd.claims_to_edge(edge))
        });
        let held = &self.crowd.held;
        let time = held.first_free(edge, time, |disc| disc != self.disc);
        spans.first_outside(time)
    }
}
