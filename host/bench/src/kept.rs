//! Plans that a store keeps: plan files of this project, compressed.

use std::io::{Read, Write};

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use fleetyard_abi::Plan;
use fleetyard_core::formats::own_format;
use fleetyard_core::plan_file::PLAN_FILE_LIMIT;
use fleetyard_core::{
    Digest, GridInstance, GridPlan, InputError, PlanFile, RoadmapPlanFile, TrajectoryFile,
    read_plan, read_roadmap_plan, read_trajectories, write_plan, write_roadmap_plan,
    write_trajectories,
};
use fleetyard_views::{View, visits_of};

use crate::suite::Question;

/// The largest plan that is kept, in bytes as it is stored.
const LARGEST: usize = 64 << 20;

/// The plan file of a plan, compressed; `None` for one that is too large to be kept, or is none of what
/// was asked. It names neither planner nor instance: equal plans are equal files.
pub(crate) fn packed(question: &Question, plan: &Plan) -> Option<Vec<u8>> {
    let asked = match question {
        Question::Grid(_) => None,
        Question::View(asked) => Some(asked),
    };
    let file = match (asked.map(|asked| (&asked.view, &asked.problem)), plan) {
        (_, Plan::Cells(plan)) => cells(question.cells()?, plan),
        (Some((View::Roadmap(view), _)), Plan::Visits(visits)) => {
            let plan = visits_of(visits).ok()?;
            write_roadmap_plan(&RoadmapPlanFile {
                roadmap_digest: None,
                ..RoadmapPlanFile::new(&view.roadmap, None, plan)
            })
        }
        (Some((View::Continuous, problem)), Plan::Trajectories(motions)) => {
            write_trajectories(&TrajectoryFile::new(problem.motions(motions).ok()?))
        }
        _ => return None,
    };
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(&file).ok()?;
    let packed = encoder.finish().ok()?;
    (packed.len() <= LARGEST).then_some(packed)
}

fn cells(instance: &GridInstance, plan: &GridPlan) -> Vec<u8> {
    write_plan(&PlanFile {
        instance_digest: None,
        map: None,
        ..PlanFile::new(instance, plan.clone())
    })
}

/// The plan file that was kept; `None` if the bytes are none.
pub(crate) fn unpacked(packed: &[u8]) -> Option<Vec<u8>> {
    let mut text = Vec::new();
    let decoder = ZlibDecoder::new(packed);
    decoder
        .take(PLAN_FILE_LIMIT + 1)
        .read_to_end(&mut text)
        .ok()?;
    (text.len() as u64 <= PLAN_FILE_LIMIT).then_some(text)
}

/// Digest of the plan in a file that was kept.
pub(crate) fn digest_of(source: &str, file: &[u8]) -> Result<Digest, InputError> {
    Ok(match own_format(file) {
        Some(b"plan") => Digest::of_plan(&read_plan(source, file)?.plan),
        Some(b"roadmap-plan") => read_roadmap_plan(source, file)?.plan.digest(),
        _ => read_trajectories(source, file)?.plan.digest(),
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use fleetyard_core::{Connectivity, Grid};

    use super::*;

    #[test]
    fn a_plan_comes_back_as_a_file_that_names_nobody() {
        let grid = Arc::new(Grid::new("hall", 2, 3, vec![b'.'; 6]).unwrap());
        let instance = GridInstance::new(grid, Connectivity::Four, vec![0], vec![5]).unwrap();
        let plan = GridPlan::from_paths([[0, 1, 2, 5]]);
        let question = Question::Grid(instance);
        let packed = packed(&question, &Plan::Cells(plan.clone())).unwrap();
        let text = unpacked(&packed).unwrap();
        let file = read_plan("p.json", &text).unwrap();
        assert_eq!(file.plan, plan);
        assert_eq!(file.plan_digest, Some(Digest::of_plan(&plan)));
        assert_eq!(digest_of("p.json", &text).unwrap(), Digest::of_plan(&plan));
        assert_eq!((file.rows, file.cols), (2, 3));
        assert_eq!(
            (file.planner, file.map, file.instance_digest),
            (None, None, None)
        );
        assert_eq!(unpacked(&packed[..packed.len() / 2]), None);
        assert_eq!(unpacked(b"plan"), None);
    }
}
