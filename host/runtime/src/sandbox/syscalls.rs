//! The system calls that a plugin is refused, and why.
//!
//! A list of what is denied, not of what is allowed: planners are any program in
//! any language, and a list of what is allowed would have to be mended for every
//! runtime. What is listed either reaches outside of the sandbox, is a part of the
//! kernel with a record of holes that no planner needs, or hides memory from the
//! accounting. The answer is an error, never a signal: runtimes that merely try a
//! call fall back as they do on an old kernel.

use std::collections::BTreeMap;

use rustix::io::Errno;
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
    SeccompRule, TargetArch, sock_filter,
};

/// A group of system calls with one reason.
struct Refused {
    /// What the caller is told.
    errno: i32,
    /// Why; for people who read this table.
    #[allow(dead_code, reason = "the table is its own documentation")]
    reason: &'static str,
    calls: &'static [i64],
}

/// Refused always.
const ALWAYS: &[Refused] = &[
    Refused {
        errno: libc::EPERM,
        reason: "reads, writes or steers another process",
        calls: &[
            libc::SYS_ptrace,
            libc::SYS_process_vm_readv,
            libc::SYS_process_vm_writev,
            libc::SYS_process_madvise,
            libc::SYS_process_mrelease,
            libc::SYS_kcmp,
            libc::SYS_pidfd_getfd,
        ],
    },
    Refused {
        errno: libc::EPERM,
        reason: "changes what is mounted where; new mounts could hide or uncover files",
        calls: &[
            libc::SYS_mount,
            libc::SYS_umount2,
            libc::SYS_move_mount,
            libc::SYS_open_tree,
            libc::SYS_fsopen,
            libc::SYS_fsconfig,
            libc::SYS_fsmount,
            libc::SYS_fspick,
            libc::SYS_mount_setattr,
            libc::SYS_pivot_root,
            libc::SYS_chroot,
        ],
    },
    Refused {
        errno: libc::EPERM,
        reason: "a namespace of its own would give the plugin capabilities in it",
        calls: &[libc::SYS_unshare, libc::SYS_setns],
    },
    Refused {
        // Its flags are behind a pointer, where a filter cannot look; C libraries
        // fall back to `clone`, where it can.
        errno: libc::ENOSYS,
        reason: "could make namespaces unseen",
        calls: &[libc::SYS_clone3],
    },
    Refused {
        errno: libc::EPERM,
        reason: "changes the machine: needs rights that nobody here has, refused early",
        calls: &[
            libc::SYS_reboot,
            libc::SYS_kexec_load,
            libc::SYS_kexec_file_load,
            libc::SYS_init_module,
            libc::SYS_finit_module,
            libc::SYS_delete_module,
            libc::SYS_swapon,
            libc::SYS_swapoff,
            libc::SYS_acct,
            libc::SYS_quotactl,
            libc::SYS_quotactl_fd,
            libc::SYS_sethostname,
            libc::SYS_setdomainname,
            libc::SYS_settimeofday,
            libc::SYS_clock_settime,
            libc::SYS_adjtimex,
            libc::SYS_clock_adjtime,
            libc::SYS_vhangup,
            libc::SYS_syslog,
        ],
    },
    Refused {
        errno: libc::EPERM,
        reason: "large parts of the kernel with a record of holes, of no use to a planner",
        calls: &[
            libc::SYS_bpf,
            libc::SYS_perf_event_open,
            libc::SYS_userfaultfd,
            libc::SYS_fanotify_init,
            libc::SYS_name_to_handle_at,
            libc::SYS_open_by_handle_at,
            libc::SYS_lookup_dcookie,
            libc::SYS_nfsservctl,
            libc::SYS_vmsplice,
        ],
    },
    Refused {
        errno: libc::ENOSYS,
        reason: "does what other refused calls do, past every filter; runtimes fall back",
        calls: &[
            libc::SYS_io_uring_setup,
            libc::SYS_io_uring_enter,
            libc::SYS_io_uring_register,
        ],
    },
    Refused {
        errno: libc::EPERM,
        reason: "the kernel's keys are of the user, not of the sandbox",
        calls: &[libc::SYS_add_key, libc::SYS_request_key, libc::SYS_keyctl],
    },
    Refused {
        errno: libc::EPERM,
        reason: "lives on without a process and is not of the sandbox where it has no \
                 namespace of its own",
        calls: &[
            libc::SYS_shmget,
            libc::SYS_shmat,
            libc::SYS_shmctl,
            libc::SYS_semget,
            libc::SYS_semctl,
            libc::SYS_semop,
            libc::SYS_semtimedop,
            libc::SYS_msgget,
            libc::SYS_msgsnd,
            libc::SYS_msgrcv,
            libc::SYS_msgctl,
            libc::SYS_mq_open,
            libc::SYS_mq_unlink,
        ],
    },
    Refused {
        // Nobody maps it, so nobody is charged for it. Refused as on an old kernel.
        errno: libc::ENOSYS,
        reason: "memory that the accounting does not see",
        calls: &[libc::SYS_memfd_create, libc::SYS_memfd_secret],
    },
    Refused {
        errno: libc::EPERM,
        reason: "the host chose the processors; a plugin may not take the others",
        calls: &[
            libc::SYS_sched_setaffinity,
            libc::SYS_set_mempolicy_home_node,
        ],
    },
    #[cfg(target_arch = "x86_64")]
    Refused {
        errno: libc::EPERM,
        reason: "access to ports and to segments, for emulators of old systems",
        calls: &[
            libc::SYS_iopl,
            libc::SYS_ioperm,
            libc::SYS_modify_ldt,
            libc::SYS_uselib,
            libc::SYS_ustat,
            libc::SYS_sysfs,
        ],
    },
];

/// Refused unless the network was granted. `socketpair` stays: it reaches nobody.
const WITHOUT_NETWORK: &[i64] = &[libc::SYS_socket];

/// Namespace flags of `clone`.
const NAMESPACES: u64 = (libc::CLONE_NEWNS
    | libc::CLONE_NEWCGROUP
    | libc::CLONE_NEWUTS
    | libc::CLONE_NEWIPC
    | libc::CLONE_NEWUSER
    | libc::CLONE_NEWPID
    | libc::CLONE_NEWNET) as u64;

/// The programs that are to be installed, one after the other: the strictest
/// answer wins.
fn programs(network: bool) -> Result<Vec<BpfProgram>, String> {
    let arch = TargetArch::try_from(std::env::consts::ARCH).map_err(|error| error.to_string())?;
    let mut programs = Vec::new();
    if let Some(program) = foreign_calls() {
        programs.push(program);
    }
    for errno in [libc::EPERM, libc::ENOSYS] {
        let mut rules: BTreeMap<i64, Vec<SeccompRule>> = BTreeMap::new();
        for group in ALWAYS.iter().filter(|group| group.errno == errno) {
            rules.extend(group.calls.iter().map(|call| (*call, Vec::new())));
        }
        if errno == libc::EPERM {
            if !network {
                rules.extend(WITHOUT_NETWORK.iter().map(|call| (*call, Vec::new())));
            }
            rules.insert(libc::SYS_clone, any_flag(0, NAMESPACES)?);
            // Typing into the terminal of somebody else.
            let typing = [libc::TIOCSTI, libc::TIOCLINUX].map(|request| equals(1, request));
            // What is in pipes and sockets is in no process: it counts by their usual sizes.
            let larger = equals(1, libc::F_SETPIPE_SZ as u64)?;
            rules.insert(libc::SYS_fcntl, vec![larger]);
            if !network {
                let larger =
                    all_equal(&[(1, libc::SOL_SOCKET as u64), (2, libc::SO_SNDBUF as u64)])?;
                rules.insert(libc::SYS_setsockopt, vec![larger]);
            }
            rules.insert(
                libc::SYS_ioctl,
                typing.into_iter().collect::<Result<_, _>>()?,
            );
        }
        let filter = SeccompFilter::new(
            rules,
            SeccompAction::Allow,
            SeccompAction::Errno(errno as u32),
            arch,
        );
        let program = filter.and_then(BpfProgram::try_from);
        programs.push(program.map_err(|error| error.to_string())?);
    }
    Ok(programs)
}

/// Rules that match when any of the flags is set.
fn any_flag(argument: u8, flags: u64) -> Result<Vec<SeccompRule>, String> {
    let bits = (0..64).map(|bit| 1u64 << bit);
    bits.filter(|bit| flags & bit != 0)
        .map(|bit| rule(argument, SeccompCmpOp::MaskedEq(bit), bit))
        .collect()
}

fn equals(argument: u8, value: u64) -> Result<SeccompRule, String> {
    all_equal(&[(argument, value)])
}

/// A rule that matches when each of the arguments has its value.
fn all_equal(arguments: &[(u8, u64)]) -> Result<SeccompRule, String> {
    let conditions = arguments.iter().map(|(argument, value)| {
        SeccompCondition::new(*argument, SeccompCmpArgLen::Dword, SeccompCmpOp::Eq, *value)
    });
    let conditions = conditions.collect::<Result<_, _>>();
    conditions
        .and_then(SeccompRule::new)
        .map_err(|error| error.to_string())
}

fn rule(argument: u8, operator: SeccompCmpOp, value: u64) -> Result<SeccompRule, String> {
    SeccompCondition::new(argument, SeccompCmpArgLen::Dword, operator, value)
        .and_then(|condition| SeccompRule::new(vec![condition]))
        .map_err(|error| error.to_string())
}

/// Refuses the x32 numbers: the same calls by other names, which rules by number
/// do not match.
fn foreign_calls() -> Option<BpfProgram> {
    const X32: u32 = 0x4000_0000;
    let instruction = |code: u32, jt, jf, k| sock_filter {
        code: code as u16,
        jt,
        jf,
        k,
    };
    cfg!(target_arch = "x86_64").then(|| {
        vec![
            // The number is the first word of what a filter sees.
            instruction(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS, 0, 0, 0),
            instruction(libc::BPF_JMP | libc::BPF_JGE | libc::BPF_K, 0, 1, X32),
            instruction(
                libc::BPF_RET | libc::BPF_K,
                0,
                0,
                libc::SECCOMP_RET_ERRNO | libc::ENOSYS as u32,
            ),
            instruction(libc::BPF_RET | libc::BPF_K, 0, 0, libc::SECCOMP_RET_ALLOW),
        ]
    })
}

/// Installs the filters in this thread, which must be the only one. It needs "no
/// new privileges" or a capability.
pub(super) fn install(network: bool) -> Result<(), (Errno, String)> {
    let programs = programs(network).map_err(|reason| (Errno::NOSYS, reason))?;
    for program in programs {
        let filter = libc::sock_fprog {
            len: program.len() as u16,
            filter: program.as_ptr().cast_mut().cast(),
        };
        let call = |flags: libc::c_ulong| {
            // SAFETY: `filter` points to a program that outlives the call.
            let result = unsafe {
                libc::syscall(
                    libc::SYS_seccomp,
                    libc::SECCOMP_SET_MODE_FILTER,
                    flags,
                    &raw const filter,
                )
            };
            if result == 0 {
                Ok(())
            } else {
                Err(Errno::from_io_error(&std::io::Error::last_os_error()).unwrap_or(Errno::IO))
            }
        };
        // Without the flag, kernels before 5.16 slow down whoever is filtered.
        let installed = match call(libc::SECCOMP_FILTER_FLAG_SPEC_ALLOW) {
            Err(Errno::INVAL) => call(0),
            other => other,
        };
        installed.map_err(|errno| (errno, "installing a filter".to_owned()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filters_compile() {
        for network in [false, true] {
            let programs = programs(network).unwrap();
            assert!(programs.len() >= 2);
            assert!(programs.iter().all(|program| program.len() < 4096));
        }
    }
}
