use super::*;
use crate::measure::fixture::{Fixture, laptop, server};
use crate::measure::{pin, pin_this_process};
use crate::user_folder;
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::process::{Child, Command, Stdio};

fn cpus(text: &str) -> Cpus {
    text.parse().unwrap()
}

fn folder(at: &tempfile::TempDir) -> Folder {
    user_folder::below(at.path(), "fleetyard", "cores", true)
        .unwrap()
        .into()
}

fn topology(fixture: &Fixture, allowed: &str) -> Topology {
    Topology::read(&fixture.source(), &cpus(allowed)).unwrap()
}

/// Reservations of these sizes as text, one after the other and all held.
fn reserve_all(topology: &Topology, threads: &[u32]) -> Vec<String> {
    let place = tempfile::tempdir().unwrap();
    let folder = folder(&place);
    let held: Vec<_> = threads
        .iter()
        .map(|threads| topology.reserve_in(&folder, *threads))
        .collect();
    let show = |held: &Result<Reservation, NoCores>| match held {
        Ok(held) => {
            let Reservation {
                mask,
                siblings,
                host,
                nodes,
                ..
            } = held;
            format!("{mask} idle {siblings} host {host} nodes {nodes:?}")
        }
        Err(reason) => reason.to_string(),
    };
    held.iter().map(show).collect()
}

#[test]
fn a_trial_gets_whole_cores_and_the_host_keeps_one() {
    assert_eq!(
        reserve_all(&topology(&laptop(), "0-7"), &[2, 1, 1]),
        [
            "1-2 idle 5-6 host 0,4 nodes [0]",
            "3 idle 7 host 0,4 nodes [0]",
            "needs 1 physical core beside the host's, 0 are free and 3 are reserved by others",
        ]
    );
    assert_eq!(
        reserve_all(&topology(&laptop(), "0-7"), &[4]),
        ["needs 4 physical cores beside the host's, 3 are free"]
    );
}

#[test]
fn a_trial_stays_on_one_node_if_it_fits() {
    let topology = topology(&server(), "0-7");
    // The host has core 0, so node 1 has three cores as well as node 0.
    assert_eq!(
        reserve_all(&topology, &[1, 3, 2]),
        [
            "1 idle  host 0 nodes [0]",
            "4-6 idle  host 0 nodes [1]",
            "2-3 idle  host 0 nodes [0]",
        ]
    );
    assert_eq!(
        reserve_all(&topology, &[4]),
        ["1,4-6 idle  host 0 nodes [0, 1]"]
    );
}

#[test]
fn only_allowed_cpus_are_used_and_broken_cores_last() {
    // Of core 2 and core 3 one thread each is not ours.
    let topology = topology(&laptop(), "0-5,7");
    assert_eq!(topology.cpus(), cpus("0-5,7"));
    assert_eq!(
        reserve_all(&topology, &[1, 1, 1]),
        [
            // The host takes the broken one, of which nobody can have the rest.
            "0 idle 4 host 2 nodes [0]",
            "1 idle 5 host 2 nodes [0]",
            "3 idle 7 host 2 nodes [0]",
        ]
    );
}

#[test]
fn trials_run_on_fast_cores_and_the_host_on_a_slow_one() {
    let hybrid = laptop();
    hybrid.write("sys/devices/cpu_core/cpus", "0-1,4-5");
    hybrid.write("sys/devices/cpu_atom/cpus", "2-3,6-7");
    let big_little = laptop();
    for cpu in 0..8 {
        let capacity = if cpu % 4 < 2 { 1024 - cpu } else { 446 };
        let file = format!("sys/devices/system/cpu/cpu{cpu}/cpu_capacity");
        big_little.write(&file, &capacity.to_string());
    }
    for fixture in [hybrid, big_little] {
        assert_eq!(
            reserve_all(&topology(&fixture, "0-7"), &[2, 1]),
            [
                "0-1 idle 4-5 host 2,6 nodes [0]",
                "needs 1 physical core beside the host's, 0 are free and 2 are reserved by others",
            ]
        );
    }
}

#[test]
fn cores_are_known_by_their_numbers_where_siblings_are_not_listed() {
    let block = |cpu: u32, core: u32| {
        format!("processor\t: {cpu}\nphysical id\t: 0\ncore id\t\t: {core}\n\n")
    };
    let cpuinfo: String = (0..4).map(|cpu| block(cpu, cpu / 2)).collect();
    let fixture = Fixture::new(&[("proc/cpuinfo", &cpuinfo)]);
    let cores = layout(&fixture.source()).unwrap();
    let cores: Vec<_> = cores.iter().map(|core| core.cpus.to_string()).collect();
    assert_eq!(cores, ["0-1", "2-3"]);
    let silent = Fixture::new(&[("proc/cpuinfo", "processor : 0\n")]);
    assert_eq!(
        Topology::read(&silent.source(), &cpus("0")),
        Err(NoCores::UnknownTopology)
    );
}

#[test]
fn hosts_with_other_cpus_keep_off_each_others_trials() {
    let place = tempfile::tempdir().unwrap();
    let folder = folder(&place);
    let (all, last) = (topology(&laptop(), "0-7"), topology(&laptop(), "2-3,6-7"));
    let first = last.reserve_in(&folder, 1).unwrap();
    assert_eq!(
        (first.host.clone(), first.mask.clone()),
        (cpus("2,6"), cpus("3"))
    );
    let second = all.reserve_in(&folder, 1).unwrap();
    assert_eq!(
        (second.host.clone(), second.mask.clone()),
        (cpus("0,4"), cpus("1"))
    );
    // What is left is the core of the first one's host.
    assert!(all.reserve_in(&folder, 1).is_err());
    drop(first);
    let third = all.reserve_in(&folder, 2).unwrap();
    assert_eq!(third.mask, cpus("2-3"));
    // And now the other host has nowhere to be.
    let refused = last.reserve_in(&folder, 1).unwrap_err();
    assert!(
        matches!(refused, NoCores::TooFew { free: 0, .. }),
        "{refused}"
    );
}

#[test]
fn folders_of_others_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let real = place.path().join("real");
    std::fs::create_dir(&real).unwrap();
    let open = |name: &str| user_folder::below(place.path(), name, "cores", false).map(|_| ());
    symlink(&real, place.path().join("link")).unwrap();
    assert!(open("link").is_err());
    assert!(real.read_dir().unwrap().next().is_none());
    let wide = place.path().join("wide");
    std::fs::create_dir(&wide).unwrap();
    std::fs::set_permissions(&wide, std::fs::Permissions::from_mode(0o777)).unwrap();
    let refused = open("wide").unwrap_err();
    assert!(
        refused.to_string().ends_with("others may write to it"),
        "{refused}"
    );
    std::fs::write(place.path().join("file"), "").unwrap();
    assert!(open("file").is_err());
    assert!(user_folder::below(&place.path().join("none"), "x", "cores", true).is_err());
    // Nobody else's files are locked, even if they are put there.
    let folder = folder(&place);
    symlink(&real, folder.path.join("core-0")).unwrap();
    assert!(folder.try_lock("core-0", true).is_err());
    let made = place.path().join("fleetyard").metadata().unwrap();
    assert_eq!(made.permissions().mode() & 0o777, 0o711);
}

#[test]
fn a_lock_survives_the_cleaning_of_the_folder() {
    let place = tempfile::tempdir().unwrap();
    let folder = folder(&place);
    let lock = folder.try_lock("core-0", true).unwrap();
    assert!(lock.is_some() && folder.try_lock("core-0", false).unwrap().is_none());
    drop(lock);
    assert!(folder.try_lock("core-0", true).unwrap().is_some());
}

/// A machine of nodes, caches, cores and threads, numbered at random.
#[derive(Debug, Clone)]
struct Shape {
    cores: Vec<Core>,
    allowed: Cpus,
}

fn shape() -> impl Strategy<Value = Shape> {
    let core = (1..=3usize, any::<bool>(), 0..3u32, 0..3u32);
    let cores = prop::collection::vec(core, 1..10);
    let numbers = Just((0..64u32).collect::<Vec<_>>()).prop_shuffle();
    let allowed = prop::collection::vec(prop::bool::weighted(0.8), 64);
    (cores, numbers, allowed, any::<bool>()).prop_map(|(cores, numbers, allowed, uniform)| {
        let mut numbers = numbers.into_iter();
        let cores = cores.into_iter().map(|(threads, slow, node, cache)| Core {
            cpus: numbers.by_ref().take(threads).collect(),
            package: Some(node),
            node: Some(node),
            cache: Some(node * 3 + cache),
            slow: slow && !uniform,
        });
        let allowed = (0..64).filter(|cpu| allowed[*cpu as usize]).collect();
        Shape {
            cores: cores.collect(),
            allowed,
        }
    })
}

impl Shape {
    fn topology(&self) -> Topology {
        let own = |core: &Core| -> Cpus {
            let cpus = core.cpus.iter().copied();
            cpus.filter(|cpu| self.allowed.has(*cpu)).collect()
        };
        let cores = self.cores.iter().map(|core| Usable {
            own: own(core),
            core: core.clone(),
        });
        let mut cores: Vec<_> = cores.filter(|core| !core.own.is_empty()).collect();
        cores.sort_by_key(Usable::name);
        Topology { cores }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn reservations_never_overlap(
        shape in shape(),
        steps in prop::collection::vec((1..5u32, any::<bool>(), 0..8usize), 1..20),
    ) {
        let place = tempfile::tempdir().unwrap();
        let folder = folder(&place);
        let topology = shape.topology();
        let mut held: Vec<Reservation> = Vec::new();
        for (threads, drop_one, which) in steps {
            if drop_one && !held.is_empty() {
                held.remove(which % held.len());
                continue;
            }
            match topology.reserve_in(&folder, threads) {
                Ok(reservation) => held.push(reservation),
                Err(NoCores::TooFew { needed, free, .. }) => {
                    prop_assert_eq!(needed, threads);
                    prop_assert!(free < needed);
                }
                Err(other) => prop_assert!(false, "{}", other),
            }
            let mut taken = BTreeSet::new();
            for reservation in &held {
                let watched = reservation.watched();
                for cpu in watched.iter() {
                    prop_assert!(taken.insert(*cpu), "CPU {} twice", cpu);
                }
                let on = |cpu: &u32| shape.cores.iter().find(|core| core.cpus.has(*cpu));
                let cores: BTreeSet<_> = reservation
                    .mask
                    .iter()
                    .map(|cpu| on(cpu).unwrap().cpus.clone())
                    .collect();
                // One thread a core, and all its siblings idle.
                prop_assert_eq!(cores.len(), reservation.mask.len());
                let all: Cpus = cores.iter().flat_map(|core| core.iter()).copied().collect();
                prop_assert_eq!(&all, &watched);
                for cpu in reservation.mask.iter().chain(reservation.host.iter()) {
                    prop_assert!(shape.allowed.has(*cpu));
                }
                prop_assert!(reservation.mask.iter().all(|cpu| !on(cpu).unwrap().slow));
                prop_assert!(!reservation.host.is_empty());
            }
            // No trial runs on any host's core.
            for reservation in &held {
                prop_assert!(reservation.host.iter().all(|cpu| !taken.contains(cpu)));
            }
        }
        // All of it is free again.
        drop(held);
        let fast = topology.cores.iter().filter(|core| !core.core.slow).count();
        let slow = topology.cores.len() - fast;
        let most = if slow > 0 { fast } else { fast.saturating_sub(1) };
        if most > 0 {
            let all = topology.reserve_in(&folder, most as u32);
            prop_assert_eq!(all.unwrap().mask.len(), most);
        }
    }

    #[test]
    fn a_choice_that_fits_into_one_node_or_cache_is_made_there(
        shape in shape(),
        count in 1..6u32,
    ) {
        let topology = shape.topology();
        let free: Vec<&Usable> = topology.cores.iter().filter(|core| core.is_whole()).collect();
        let Some(names) = choose(&free, count) else {
            prop_assert!(free.len() < count as usize);
            return Ok(());
        };
        prop_assert_eq!(names.len(), count as usize);
        let chosen: Vec<_> = free.iter().filter(|core| names.contains(&core.name())).collect();
        prop_assert_eq!(chosen.len(), names.len());
        for key in [|core: &Usable| core.core.node, |core: &Usable| core.core.cache] {
            let mut sizes = BTreeMap::new();
            for core in &free {
                *sizes.entry(key(core)).or_insert(0) += 1;
            }
            let groups: BTreeSet<_> = chosen.iter().map(|core| key(core)).collect();
            let node = |core: &Usable| core.core.node;
            let nodes: BTreeSet<_> = chosen.iter().map(|core| node(core)).collect();
            // A cache counts only within the node that was chosen.
            let near: Vec<_> = free.iter().filter(|core| nodes.contains(&node(core))).collect();
            let fits = near.iter().any(|core| sizes[&key(core)] >= count);
            prop_assert!(!fits || groups.len() == 1 || nodes.len() > 1);
        }
    }

    #[test]
    fn whatever_the_files_say_every_cpu_is_in_one_core(
        lists in prop::collection::vec("[0-9]{0,1}(-[0-9])?(,[0-9]){0,2}", 1..8),
    ) {
        let fixture = Fixture::new(&[]);
        let last = lists.len() - 1;
        fixture.write("sys/devices/system/cpu/online", &format!("0-{last}"));
        for (cpu, list) in lists.iter().enumerate() {
            fixture.cpu(cpu as u32, list, 0, cpu as u32 / 2);
        }
        let cores = layout(&fixture.source()).unwrap();
        let mut all: Vec<u32> = cores.iter().flat_map(|core| core.cpus.iter()).copied().collect();
        all.sort_unstable();
        prop_assert_eq!(all, (0..=last as u32).collect::<Vec<_>>());
    }
}

#[test]
fn threads_never_share_a_core() {
    let place = tempfile::tempdir().unwrap();
    let topology = topology(&laptop(), "0-7");
    let taken = std::sync::Mutex::new(BTreeSet::new());
    std::thread::scope(|scope| {
        for thread in 0..6u32 {
            let (topology, taken, place) = (&topology, &taken, &place);
            scope.spawn(move || {
                let folder = folder(place);
                for _ in 0..30 {
                    match topology.reserve_in(&folder, 1 + thread % 2) {
                        Ok(reservation) => {
                            let watched = reservation.watched();
                            let mut all = taken.lock().unwrap();
                            assert!(watched.iter().all(|cpu| all.insert(*cpu)));
                            drop(all);
                            std::thread::yield_now();
                            let mut all = taken.lock().unwrap();
                            assert!(watched.iter().all(|cpu| all.remove(cpu)));
                        }
                        Err(NoCores::TooFew { .. }) => std::thread::yield_now(),
                        Err(other) => panic!("{other}"),
                    }
                }
            });
        }
    });
}

/// The process that the next tests start; alone it does nothing. Stays until its input is closed.
#[test]
fn a_process_of_its_own() {
    let Some(place) = std::env::var_os("FLEETYARD_TEST_CORES") else {
        return;
    };
    let folder: Folder =
        user_folder::below(std::path::Path::new(&place), "fleetyard", "cores", true)
            .unwrap()
            .into();
    let topology = topology(&laptop(), "0-7");
    let held = topology.reserve_in(&folder, 1);
    let text = held
        .as_ref()
        .map_or("none".into(), |held| held.mask.to_string());
    println!("\nreserved {text}");
    std::io::stdout().flush().unwrap();
    let _ = std::io::stdin().lines().next();
    let own = Topology::of_this_process().unwrap().cpus();
    let one: Cpus = own.iter().take(1).copied().collect();
    let (send, receive) = std::sync::mpsc::channel::<()>();
    let (tell, told) = std::sync::mpsc::channel();
    let other = std::thread::spawn(move || {
        let _ = receive.recv();
        tell.send(affinity(None).unwrap()).unwrap();
    });
    pin_this_process(&one).unwrap();
    send.send(()).unwrap();
    assert_eq!(told.recv().unwrap(), one);
    other.join().unwrap();
    assert_eq!(affinity(None).unwrap(), one);
    // What there is besides is not forgotten, and can be had again.
    assert_eq!(Topology::of_this_process().unwrap().cpus(), own);
    pin_this_process(&own).unwrap();
    assert_eq!(affinity(None).unwrap(), own);
}

fn process(place: &tempfile::TempDir) -> (Child, String) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([
            "--exact",
            "--nocapture",
            "measure::cores::tests::a_process_of_its_own",
        ])
        .env("FLEETYARD_TEST_CORES", place.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut output = BufReader::new(child.stdout.take().unwrap()).lines();
    let said = output.find_map(|line| Some(line.unwrap().strip_prefix("reserved ")?.to_owned()));
    // Whatever else it prints must have somewhere to go.
    std::thread::spawn(move || output.for_each(drop));
    (child, said.unwrap())
}

#[test]
fn processes_never_share_a_core_and_free_it_when_they_are_killed() {
    let place = tempfile::tempdir().unwrap();
    let mut processes: Vec<_> = (0..4).map(|_| process(&place)).collect();
    let mut said: Vec<_> = processes.iter().map(|(_, said)| said.as_str()).collect();
    said.sort_unstable();
    assert_eq!(said, ["1", "2", "3", "none"]);
    let at = processes.iter().position(|(_, said)| said == "2").unwrap();
    let (mut child, _) = processes.remove(at);
    child.kill().unwrap();
    child.wait().unwrap();
    let topology = topology(&laptop(), "0-7");
    let reservation = topology.reserve_in(&folder(&place), 1).unwrap();
    assert_eq!(reservation.mask, cpus("2"));
    for (mut child, _) in processes {
        drop(child.stdin.take());
        assert!(child.wait().unwrap().success());
    }
}

#[test]
fn a_thread_is_pinned_or_told_that_it_is_not() {
    std::thread::spawn(|| {
        let own = affinity(None).unwrap();
        let one: Cpus = own.iter().rev().take(1).copied().collect();
        pin(None, &one).unwrap();
        assert_eq!(affinity(None).unwrap(), one);
        for refused in [Cpus::default(), cpus("8191"), one.union(&cpus("8191"))] {
            let error = pin(None, &refused).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidInput, "{refused}");
        }
    })
    .join()
    .unwrap();
}

/// The cores of this machine have all CPUs that this process may use, and no others.
#[test]
fn the_topology_of_this_machine_has_its_cpus() {
    let allowed = affinity(None).unwrap();
    match Topology::read(&Source::system(), &allowed) {
        Ok(topology) => {
            assert_eq!(topology.cpus(), allowed);
            assert!((1..=topology.cpus().len()).contains(&(topology.cores() as usize)));
        }
        Err(reason) => assert_eq!(reason, NoCores::UnknownTopology),
    }
}

#[test]
fn reasons_are_data() {
    let reason = NoCores::TooFew {
        needed: 4,
        free: 1,
        reserved: 0,
    };
    assert_eq!(
        serde_json::to_string(&reason).unwrap(),
        r#"{"reason":"too-few","needed":4,"free":1,"reserved":0}"#
    );
    assert_eq!(
        reason.to_string(),
        "needs 4 physical cores beside the host's, 1 is free"
    );
    assert!(reason.hint().is_some());
}
