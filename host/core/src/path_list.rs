//! The key `paths` of plan files: a list with one path per agent.

use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, SeqAccess};

use crate::json::{Listed, ReadList};

/// Most agents a plan file may have.
pub(crate) const PLAN_MAX_AGENTS: usize = 1 << 22;

/// A plan that is read path by path.
pub(crate) trait ReadPaths: Default {
    /// Reads the path of the next agent, if the list has one more.
    fn read_path<'de, A: SeqAccess<'de>>(&mut self, list: &mut A) -> Result<Option<()>, A::Error>;
    /// Number of paths that were read.
    fn agents(&self) -> usize;
}

/// The value of `paths`.
pub(crate) struct Paths<P>(pub P);

impl<'de, P: ReadPaths> Deserialize<'de> for Paths<P> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct All<P>(PhantomData<P>);

        impl<'de, P: ReadPaths> ReadList<'de> for All<P> {
            const EXPECTED: &'static str = "a list with one path per agent";
            type Value = Paths<P>;

            fn read<A: SeqAccess<'de>>(self, mut list: A) -> Result<Paths<P>, A::Error> {
                let mut plan = P::default();
                while plan.read_path(&mut list)?.is_some() {
                    if plan.agents() > PLAN_MAX_AGENTS {
                        let reason = format!("more than {PLAN_MAX_AGENTS} paths");
                        return Err(A::Error::custom(reason));
                    }
                }
                Ok(Paths(plan))
            }
        }

        Listed(All(PhantomData)).deserialize(deserializer)
    }
}

/// A plan in the plane, each of whose paths is a list of stops: lists of numbers.
///
/// A stop is judged where it is read, so that an error has its place.
pub(crate) trait ReadStops: Default {
    /// A path in the words of an error.
    const PATH: &'static str;
    /// A stop in the words of an error.
    const STOP: &'static str;
    /// Stops in the words of an error.
    const STOPS: &'static str;
    /// Most stops of all paths together.
    const MOST: usize;
    /// A path of which more stops may come.
    type Begun: Default;

    /// Reads the next stop of a path from its numbers.
    fn read_stop<'de, A: SeqAccess<'de>>(
        &mut self,
        path: &mut Self::Begun,
        numbers: A,
    ) -> Result<(), A::Error>;
    /// Makes what was read the path of the next agent.
    fn finish<E: Error>(&mut self, path: &Self::Begun) -> Result<(), E>;
    /// Number of stops that the plan has.
    fn stops(&self) -> usize;
    /// Number of paths that the plan has.
    fn agents(&self) -> usize;
}

impl<P: ReadStops> ReadPaths for P {
    fn read_path<'de, A: SeqAccess<'de>>(&mut self, list: &mut A) -> Result<Option<()>, A::Error> {
        list.next_element_seed(Listed(Path(self)))
    }

    fn agents(&self) -> usize {
        ReadStops::agents(self)
    }
}

struct Path<'a, P>(&'a mut P);

impl<'de, P: ReadStops> ReadList<'de> for Path<'_, P> {
    const EXPECTED: &'static str = P::PATH;
    type Value = ();

    fn read<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let plan = self.0;
        let mut path = P::Begun::default();
        while let Some(()) = list.next_element_seed(Listed(Stop(plan, &mut path)))? {
            if plan.stops() > P::MOST {
                let reason = format!("the paths have more than {} {}", P::MOST, P::STOPS);
                return Err(A::Error::custom(reason));
            }
        }
        plan.finish(&path)
    }
}

struct Stop<'a, P: ReadStops>(&'a mut P, &'a mut P::Begun);

impl<'de, P: ReadStops> ReadList<'de> for Stop<'_, P> {
    const EXPECTED: &'static str = P::STOP;
    type Value = ();

    fn read<A: SeqAccess<'de>>(self, numbers: A) -> Result<(), A::Error> {
        self.0.read_stop(self.1, numbers)
    }
}
