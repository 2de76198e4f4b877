//! Lists in flat arrays: what they hold, what they refuse, and how they are written.

use fleetyard_abi::{GridPlan, Lists, moves::OFF_MAP};

#[test]
fn offsets_must_fit_the_items() {
    let fits = |offsets: &[u64]| Lists::from_flat(offsets.to_vec(), vec!['a', 'b', 'c']).is_some();
    assert!(fits(&[0, 3]) && fits(&[0, 0, 1, 3, 3]));
    for wrong in [&[][..], &[0], &[1, 3], &[0, 2], &[0, 4], &[0, 2, 1, 3]] {
        assert!(!fits(wrong), "{wrong:?}");
    }
    assert!(Lists::<u8>::from_flat(vec![0], vec![]).is_some_and(|lists| lists.is_empty()));
}

#[test]
fn a_list_that_has_not_ended_belongs_to_none() {
    let mut lists = Lists::single(vec![1, 2]);
    lists.push_item(3);
    lists.push_item(4);
    assert_eq!((lists.len(), lists.items()), (2, &[1, 2][..]));
    lists.open_list()[0] = 5;
    lists.end_list();
    assert_eq!(lists.get(2), Some(&[5, 4][..]));
    assert_eq!(lists.get(3), None);
    lists.push_item(6);
    lists.drop_open_list();
    lists.end_list();
    let all: Vec<&[i32]> = lists.iter().collect();
    assert_eq!(all, [&[1][..], &[2], &[5, 4], &[]]);
}

#[test]
fn the_wire_has_lists_of_lists() {
    let lists: Lists<u32> = [vec![3, 1], vec![], vec![2]].into_iter().collect();
    let text = serde_json::to_string(&lists).unwrap();
    assert_eq!(text, "[[3,1],[],[2]]");
    assert_eq!(serde_json::from_str::<Lists<u32>>(&text).unwrap(), lists);
    assert!(serde_json::from_str::<Lists<u32>>("[1]").is_err());
}

#[test]
fn an_agent_stays_where_its_path_ends() {
    let plan = GridPlan::from_paths([&[4, 4, 5, 5, 5][..], &[7], &[]]);
    let at = |time| [0, 1, 2].map(|agent| plan.at(agent, time));
    assert_eq!(
        [at(0), at(2), at(9)],
        [[4, 7, OFF_MAP], [5, 7, OFF_MAP], [5, 7, OFF_MAP]]
    );
    assert_eq!((plan.horizon(), plan.sum_of_costs()), (4, 2));
    assert_eq!(
        plan.trimmed(),
        GridPlan::from_paths([&[4, 4, 5][..], &[7], &[]])
    );
}
