//! The system calls that a plugin may make, and why not the others.
//!
//! One table, read in two ways. The *deny list* refuses what is refused below and lets
//! the rest pass: planners are any program in any language. The *allow list* lets pass
//! what is called needed below, and nothing that is not listed. What is refused either
//! reaches outside of the sandbox, is a part of the kernel with a record of holes that
//! no planner needs, or hides something from the accounting.
//!
//! The answer is an error, never a signal: runtimes that merely try a call fall back as
//! they do on an old kernel. Calls that are newer than this table are "not implemented"
//! in both readings, and so is what the allow list does not know.

use std::collections::BTreeMap;

use rustix::io::Errno;
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
    SeccompRule, TargetArch, sock_filter,
};

use super::Profile;

/// A group of system calls with one reason.
struct Group {
    verdict: Verdict,
    /// The reason, for people who read this table.
    #[allow(dead_code, reason = "the table is its own documentation")]
    reason: &'static str,
    calls: &'static [i64],
}

/// The fate of a call.
enum Verdict {
    /// Nothing: runtimes need it.
    Needed,
    /// It is answered by this error.
    Refused(i32),
    /// It is answered by "not permitted" when all of one of these lines is so.
    RefusedIf(&'static [&'static [If]]),
}

/// Something about an argument, which is seen as 32 bits: all that matter here are
/// shorter.
#[derive(Clone, Copy)]
enum If {
    Is(u8, u64),
    IsNot(u8, u64),
    /// The bits of the first number are those of the second.
    Bits(u8, u64, u64),
}

use If::{Bits, Is, IsNot};
use Verdict::{Needed, Refused, RefusedIf};

/// Not permitted.
const EPERM: i32 = libc::EPERM;
/// As on a kernel that does not have it, for which there is another way.
const ENOSYS: i32 = libc::ENOSYS;

/// Calls that are newer than the library with their names. These numbers are the same
/// on all machines.
mod newer {
    pub(super) const CACHESTAT: i64 = 451;
    pub(super) const FCHMODAT2: i64 = 452;
    pub(super) const MAP_SHADOW_STACK: i64 = 453;
    pub(super) const FUTEX_WAKE: i64 = 454;
    pub(super) const FUTEX_WAIT: i64 = 455;
    pub(super) const FUTEX_REQUEUE: i64 = 456;
    pub(super) const STATMOUNT: i64 = 457;
    pub(super) const LISTMOUNT: i64 = 458;
    pub(super) const LSM_GET_SELF_ATTR: i64 = 459;
    pub(super) const LSM_SET_SELF_ATTR: i64 = 460;
    pub(super) const LSM_LIST_MODULES: i64 = 461;
    pub(super) const MSEAL: i64 = 462;
    pub(super) const SETXATTRAT: i64 = 463;
    pub(super) const GETXATTRAT: i64 = 464;
    pub(super) const LISTXATTRAT: i64 = 465;
    pub(super) const REMOVEXATTRAT: i64 = 466;
    pub(super) const OPEN_TREE_ATTR: i64 = 467;
    pub(super) const FILE_GETATTR: i64 = 468;
    pub(super) const FILE_SETATTR: i64 = 469;
    /// Nobody has judged this one and what comes after it. The numbers of x32, the same
    /// calls by other names, are among them.
    pub(super) const UNJUDGED: u32 = 470;
}

/// Calls that the library has names for on some machines alone.
mod unnamed {
    #[cfg(target_arch = "x86_64")]
    const NUMBERS: [i64; 4] = [
        libc::SYS_renameat,
        libc::SYS_sync_file_range,
        libc::SYS_getrlimit,
        libc::SYS_setrlimit,
    ];
    // The numbers of all machines that came after x86.
    #[cfg(not(target_arch = "x86_64"))]
    const NUMBERS: [i64; 4] = [38, 84, 163, 164];

    pub(super) const RENAMEAT: i64 = NUMBERS[0];
    pub(super) const SYNC_FILE_RANGE: i64 = NUMBERS[1];
    pub(super) const GETRLIMIT: i64 = NUMBERS[2];
    pub(super) const SETRLIMIT: i64 = NUMBERS[3];
}

/// Namespace flags of `clone`, a line for each.
const NAMESPACES: &[&[If]] = &[
    &[flag(0, libc::CLONE_NEWNS)],
    &[flag(0, libc::CLONE_NEWCGROUP)],
    &[flag(0, libc::CLONE_NEWUTS)],
    &[flag(0, libc::CLONE_NEWIPC)],
    &[flag(0, libc::CLONE_NEWUSER)],
    &[flag(0, libc::CLONE_NEWPID)],
    &[flag(0, libc::CLONE_NEWNET)],
];

const fn flag(argument: u8, flag: libc::c_int) -> If {
    Bits(argument, flag as u64, flag as u64)
}

/// The bits of a socket's type that are no flags.
const TYPE: u64 = 0xf;

// Options and requests that the library has no names for.
const F_SETSIG: u64 = 10;
const F_SETOWN_EX: u64 = 15;
const PR_SCHED_CORE: u64 = 62;
const FIOSETOWN: u64 = 0x8901;
const SIOCSPGRP: u64 = 0x8902;
const IOPRIO_WHO_PROCESS: u64 = 1;

/// Groups that hold for everybody.
const TABLE: &[Group] = &[
    // ---- Other processes ------------------------------------------------------------
    Group {
        verdict: Refused(EPERM),
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
    Group {
        // Its first argument is a process, and 0 is the one that calls. Who is of the same
        // user may else set the limits of the supervisor and of the host.
        verdict: RefusedIf(&[&[IsNot(0, 0)]]),
        reason: "of another process: limits, scheduling, and where its locks are",
        calls: &[
            libc::SYS_prlimit64,
            libc::SYS_sched_setparam,
            libc::SYS_sched_setscheduler,
            libc::SYS_get_robust_list,
        ],
    },
    Group {
        verdict: Refused(EPERM),
        reason: "may ask for a frequency of the processor or for deadlines, behind a pointer, \
                 where a filter cannot look",
        calls: &[libc::SYS_sched_setattr],
    },
    Group {
        verdict: RefusedIf(&[&[IsNot(0, libc::PRIO_PROCESS as u64)], &[IsNot(1, 0)]]),
        reason: "the priority of another process, group or user",
        calls: &[libc::SYS_setpriority],
    },
    Group {
        verdict: RefusedIf(&[&[IsNot(0, IOPRIO_WHO_PROCESS)], &[IsNot(1, 0)]]),
        reason: "how urgent reading and writing is for another process, group or user",
        calls: &[libc::SYS_ioprio_set],
    },
    Group {
        // The number is compared as the kernel takes it, as 32 bits.
        verdict: RefusedIf(&[&[Is(0, u32::MAX as u64)]]),
        reason: "a signal to everybody",
        calls: &[libc::SYS_kill, libc::SYS_rt_sigqueueinfo],
    },
    Group {
        verdict: RefusedIf(&[
            // A signal of one's choice to a process of one's choice, sent by the kernel.
            &[Is(1, libc::F_SETOWN as u64)],
            &[Is(1, F_SETOWN_EX)],
            &[Is(1, F_SETSIG)],
            // Whoever opens the file waits for up to a minute.
            &[Is(1, libc::F_SETLEASE as u64)],
            &[Is(1, libc::F_NOTIFY as u64)],
            // What is in pipes is in no process: it counts by their usual size.
            &[Is(1, libc::F_SETPIPE_SZ as u64)],
        ]),
        reason: "signals about files, and leases that hold up others",
        calls: &[libc::SYS_fcntl],
    },
    Group {
        verdict: RefusedIf(&[
            // Typing into the terminal of somebody else.
            &[Is(1, libc::TIOCSTI)],
            &[Is(1, libc::TIOCLINUX)],
            // As F_SETOWN.
            &[Is(1, FIOSETOWN)],
            &[Is(1, SIOCSPGRP)],
        ]),
        reason: "requests to devices that reach somebody else",
        calls: &[libc::SYS_ioctl],
    },
    Group {
        verdict: RefusedIf(&[
            // Who cannot be read cannot be measured, and not be found by its mark.
            &[Is(0, libc::PR_SET_DUMPABLE as u64)],
            // A core that nobody else may share.
            &[Is(0, PR_SCHED_CORE)],
        ]),
        reason: "hides from the accounting, or takes more than was given",
        calls: &[libc::SYS_prctl],
    },
    // ---- Files and mounts -----------------------------------------------------------
    Group {
        verdict: Refused(EPERM),
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
    Group {
        verdict: Refused(ENOSYS),
        reason: "newer calls about mounts, security modules, the cache of files and their \
                 attributes: they tell about the machine or change it, and programs do without",
        calls: &[
            newer::CACHESTAT,
            newer::STATMOUNT,
            newer::LISTMOUNT,
            newer::LSM_GET_SELF_ATTR,
            newer::LSM_SET_SELF_ATTR,
            newer::LSM_LIST_MODULES,
            newer::SETXATTRAT,
            newer::GETXATTRAT,
            newer::LISTXATTRAT,
            newer::REMOVEXATTRAT,
            newer::OPEN_TREE_ATTR,
            newer::FILE_GETATTR,
            newer::FILE_SETATTR,
        ],
    },
    Group {
        // As on a kernel without it: what watches files looks at them now and then instead.
        verdict: Refused(ENOSYS),
        reason: "tells what other processes do with granted files, and takes from a number that \
                 the user has for all programs",
        calls: &[
            libc::SYS_inotify_init1,
            libc::SYS_inotify_add_watch,
            libc::SYS_inotify_rm_watch,
        ],
    },
    #[cfg(target_arch = "x86_64")]
    Group {
        verdict: Refused(ENOSYS),
        reason: "as above, by its older name",
        calls: &[libc::SYS_inotify_init],
    },
    Group {
        verdict: Refused(EPERM),
        reason: "writes everybody's files to the disk and holds everybody up; `fsync` is for \
                 one's own",
        calls: &[libc::SYS_sync, libc::SYS_syncfs],
    },
    // ---- Namespaces and rights ------------------------------------------------------
    Group {
        verdict: Refused(EPERM),
        reason: "a namespace of its own would give the plugin capabilities in it",
        calls: &[libc::SYS_unshare, libc::SYS_setns],
    },
    Group {
        verdict: RefusedIf(NAMESPACES),
        reason: "as above",
        calls: &[libc::SYS_clone],
    },
    Group {
        // Its flags are behind a pointer, where a filter cannot look; C libraries
        // fall back to `clone`, where it can.
        verdict: Refused(ENOSYS),
        reason: "could make namespaces unseen",
        calls: &[libc::SYS_clone3],
    },
    Group {
        // Asking, the usual one, and addresses that are the same every time, which some
        // Lisps start themselves again for. Others map page zero or let data be executed.
        verdict: RefusedIf(&[&[
            IsNot(0, u32::MAX as u64),
            IsNot(0, 0),
            IsNot(0, libc::ADDR_NO_RANDOMIZE as u64),
        ]]),
        reason: "old systems' ways, which take protections away",
        calls: &[libc::SYS_personality],
    },
    Group {
        verdict: RefusedIf(&[&[Bits(
            1,
            libc::SECCOMP_FILTER_FLAG_NEW_LISTENER,
            libc::SECCOMP_FILTER_FLAG_NEW_LISTENER,
        )]]),
        reason: "a filter of one's own is welcome; one that asks another process each time is \
                 a part of the kernel that no planner needs",
        calls: &[libc::SYS_seccomp],
    },
    // ---- The machine ----------------------------------------------------------------
    Group {
        verdict: Refused(EPERM),
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
    Group {
        verdict: Refused(EPERM),
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
    Group {
        verdict: Refused(ENOSYS),
        reason: "does what other refused calls do, past every filter; runtimes fall back",
        calls: &[
            libc::SYS_io_uring_setup,
            libc::SYS_io_uring_enter,
            libc::SYS_io_uring_register,
        ],
    },
    Group {
        verdict: Refused(ENOSYS),
        reason: "the older way to read and write later: its requests are of the machine, which \
                 has a fixed number for all, and its memory is locked",
        calls: &[
            libc::SYS_io_setup,
            libc::SYS_io_destroy,
            libc::SYS_io_submit,
            libc::SYS_io_cancel,
            libc::SYS_io_getevents,
        ],
    },
    Group {
        verdict: Refused(EPERM),
        reason: "the kernel's keys are of the user, not of the sandbox",
        calls: &[libc::SYS_add_key, libc::SYS_request_key, libc::SYS_keyctl],
    },
    Group {
        verdict: Refused(EPERM),
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
    Group {
        // Nobody maps it, so nobody is charged for it. Refused as on an old kernel.
        verdict: Refused(ENOSYS),
        reason: "memory that the accounting does not see",
        calls: &[libc::SYS_memfd_create, libc::SYS_memfd_secret],
    },
    Group {
        verdict: Refused(EPERM),
        reason: "the host chose the processors; a plugin may not take the others",
        calls: &[libc::SYS_sched_setaffinity],
    },
    Group {
        // All of them, so that libraries find a machine without such policies rather than
        // one that breaks its word.
        verdict: Refused(ENOSYS),
        reason: "the host chose the processors, and memory is to be near them",
        calls: &[
            libc::SYS_mbind,
            libc::SYS_get_mempolicy,
            libc::SYS_set_mempolicy,
            libc::SYS_set_mempolicy_home_node,
            libc::SYS_migrate_pages,
            libc::SYS_move_pages,
        ],
    },
    #[cfg(target_arch = "x86_64")]
    Group {
        verdict: Refused(EPERM),
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
    // ---- Sockets --------------------------------------------------------------------
    Group {
        // Other families load parts of the kernel. Datagrams may be sent to any address,
        // also from a pair.
        verdict: RefusedIf(&[
            &[IsNot(0, libc::AF_UNIX as u64)],
            &[Bits(1, TYPE, libc::SOCK_DGRAM as u64)],
            &[Bits(1, TYPE, libc::SOCK_RAW as u64)],
        ]),
        reason: "a pair of streams reaches nobody else",
        calls: &[libc::SYS_socketpair],
    },
    Group {
        verdict: Needed,
        reason: "to speak through sockets that are there",
        calls: &[
            libc::SYS_sendto,
            libc::SYS_recvfrom,
            libc::SYS_sendmsg,
            libc::SYS_recvmsg,
            libc::SYS_sendmmsg,
            libc::SYS_recvmmsg,
            libc::SYS_shutdown,
            libc::SYS_getsockname,
            libc::SYS_getpeername,
            libc::SYS_getsockopt,
        ],
    },
    // ---- What runtimes need ---------------------------------------------------------
    Group {
        verdict: Needed,
        reason: "files, as far as they are granted",
        calls: &[
            libc::SYS_read,
            libc::SYS_write,
            libc::SYS_readv,
            libc::SYS_writev,
            libc::SYS_pread64,
            libc::SYS_pwrite64,
            libc::SYS_preadv,
            libc::SYS_pwritev,
            libc::SYS_preadv2,
            libc::SYS_pwritev2,
            libc::SYS_lseek,
            libc::SYS_openat,
            libc::SYS_openat2,
            libc::SYS_close,
            libc::SYS_close_range,
            libc::SYS_dup,
            libc::SYS_dup3,
            libc::SYS_pipe2,
            libc::SYS_fstat,
            libc::SYS_newfstatat,
            libc::SYS_statx,
            libc::SYS_statfs,
            libc::SYS_fstatfs,
            libc::SYS_faccessat,
            libc::SYS_faccessat2,
            libc::SYS_readlinkat,
            libc::SYS_getdents64,
            libc::SYS_getcwd,
            libc::SYS_chdir,
            libc::SYS_fchdir,
            libc::SYS_mkdirat,
            libc::SYS_mknodat,
            libc::SYS_unlinkat,
            unnamed::RENAMEAT,
            libc::SYS_renameat2,
            libc::SYS_linkat,
            libc::SYS_symlinkat,
            libc::SYS_fchmod,
            libc::SYS_fchmodat,
            newer::FCHMODAT2,
            libc::SYS_fchown,
            libc::SYS_fchownat,
            libc::SYS_utimensat,
            libc::SYS_umask,
            libc::SYS_truncate,
            libc::SYS_ftruncate,
            libc::SYS_fallocate,
            libc::SYS_fsync,
            libc::SYS_fdatasync,
            unnamed::SYNC_FILE_RANGE,
            libc::SYS_flock,
            libc::SYS_splice,
            libc::SYS_tee,
            libc::SYS_sendfile,
            libc::SYS_copy_file_range,
            libc::SYS_fadvise64,
            libc::SYS_readahead,
            libc::SYS_getxattr,
            libc::SYS_lgetxattr,
            libc::SYS_fgetxattr,
            libc::SYS_listxattr,
            libc::SYS_llistxattr,
            libc::SYS_flistxattr,
        ],
    },
    Group {
        verdict: Needed,
        reason: "memory of its own",
        calls: &[
            libc::SYS_brk,
            libc::SYS_mmap,
            libc::SYS_munmap,
            libc::SYS_mremap,
            libc::SYS_mprotect,
            libc::SYS_madvise,
            libc::SYS_msync,
            libc::SYS_mincore,
            libc::SYS_mlock,
            libc::SYS_mlock2,
            libc::SYS_munlock,
            libc::SYS_mlockall,
            libc::SYS_munlockall,
            libc::SYS_membarrier,
            libc::SYS_pkey_alloc,
            libc::SYS_pkey_free,
            libc::SYS_pkey_mprotect,
            newer::MAP_SHADOW_STACK,
            newer::MSEAL,
        ],
    },
    Group {
        verdict: Needed,
        reason: "processes and threads of its own",
        calls: &[
            libc::SYS_execve,
            libc::SYS_execveat,
            libc::SYS_exit,
            libc::SYS_exit_group,
            libc::SYS_wait4,
            libc::SYS_waitid,
            libc::SYS_pidfd_open,
            libc::SYS_set_tid_address,
            libc::SYS_set_robust_list,
            libc::SYS_rseq,
            libc::SYS_futex,
            libc::SYS_futex_waitv,
            newer::FUTEX_WAKE,
            newer::FUTEX_WAIT,
            newer::FUTEX_REQUEUE,
            libc::SYS_sched_yield,
            libc::SYS_sched_getaffinity,
            libc::SYS_sched_getattr,
            libc::SYS_sched_getparam,
            libc::SYS_sched_getscheduler,
            libc::SYS_sched_get_priority_max,
            libc::SYS_sched_get_priority_min,
            libc::SYS_sched_rr_get_interval,
            libc::SYS_getpriority,
            libc::SYS_ioprio_get,
            libc::SYS_getcpu,
            libc::SYS_getpid,
            libc::SYS_getppid,
            libc::SYS_gettid,
            libc::SYS_getpgid,
            libc::SYS_setpgid,
            libc::SYS_getsid,
            libc::SYS_setsid,
            libc::SYS_getuid,
            libc::SYS_geteuid,
            libc::SYS_getgid,
            libc::SYS_getegid,
            libc::SYS_getresuid,
            libc::SYS_getresgid,
            libc::SYS_getgroups,
            libc::SYS_capget,
            unnamed::GETRLIMIT,
            unnamed::SETRLIMIT,
            libc::SYS_getrusage,
            libc::SYS_times,
            libc::SYS_sysinfo,
            libc::SYS_uname,
        ],
    },
    Group {
        verdict: Needed,
        reason: "signals, as far as Landlock and the namespace let them",
        calls: &[
            libc::SYS_rt_sigaction,
            libc::SYS_rt_sigprocmask,
            libc::SYS_rt_sigreturn,
            libc::SYS_rt_sigpending,
            libc::SYS_rt_sigsuspend,
            libc::SYS_rt_sigtimedwait,
            libc::SYS_rt_tgsigqueueinfo,
            libc::SYS_sigaltstack,
            libc::SYS_signalfd4,
            libc::SYS_tkill,
            libc::SYS_tgkill,
            libc::SYS_pidfd_send_signal,
        ],
    },
    Group {
        verdict: Needed,
        reason: "time, waiting and chance",
        calls: &[
            libc::SYS_ppoll,
            libc::SYS_pselect6,
            libc::SYS_epoll_create1,
            libc::SYS_epoll_ctl,
            libc::SYS_epoll_pwait,
            libc::SYS_epoll_pwait2,
            libc::SYS_eventfd2,
            libc::SYS_nanosleep,
            libc::SYS_clock_nanosleep,
            libc::SYS_clock_gettime,
            libc::SYS_clock_getres,
            libc::SYS_gettimeofday,
            libc::SYS_getitimer,
            libc::SYS_setitimer,
            libc::SYS_timer_create,
            libc::SYS_timer_settime,
            libc::SYS_timer_gettime,
            libc::SYS_timer_getoverrun,
            libc::SYS_timer_delete,
            libc::SYS_timerfd_create,
            libc::SYS_timerfd_settime,
            libc::SYS_timerfd_gettime,
            libc::SYS_restart_syscall,
            libc::SYS_getrandom,
        ],
    },
    #[cfg(target_arch = "x86_64")]
    Group {
        verdict: Needed,
        reason: "older names of the above, which other machines never had",
        calls: &[
            libc::SYS_open,
            libc::SYS_creat,
            libc::SYS_stat,
            libc::SYS_lstat,
            libc::SYS_access,
            libc::SYS_readlink,
            libc::SYS_getdents,
            libc::SYS_dup2,
            libc::SYS_pipe,
            libc::SYS_mkdir,
            libc::SYS_mknod,
            libc::SYS_rmdir,
            libc::SYS_unlink,
            libc::SYS_rename,
            libc::SYS_link,
            libc::SYS_symlink,
            libc::SYS_chmod,
            libc::SYS_chown,
            libc::SYS_lchown,
            libc::SYS_utime,
            libc::SYS_utimes,
            libc::SYS_futimesat,
            libc::SYS_fork,
            libc::SYS_vfork,
            libc::SYS_getpgrp,
            libc::SYS_arch_prctl,
            libc::SYS_poll,
            libc::SYS_select,
            libc::SYS_epoll_create,
            libc::SYS_epoll_wait,
            libc::SYS_eventfd,
            libc::SYS_signalfd,
            libc::SYS_pause,
            libc::SYS_alarm,
            libc::SYS_time,
        ],
    },
];

/// For those who were not granted the network. A pair of sockets has no use for the
/// last of these either.
const WITHOUT_NETWORK: &[Group] = &[
    Group {
        verdict: Refused(EPERM),
        reason: "reaches others",
        calls: &[
            libc::SYS_socket,
            libc::SYS_connect,
            libc::SYS_bind,
            libc::SYS_listen,
            libc::SYS_accept,
            libc::SYS_accept4,
        ],
    },
    Group {
        verdict: RefusedIf(&[&[
            Is(1, libc::SOL_SOCKET as u64),
            Is(2, libc::SO_SNDBUF as u64),
        ]]),
        reason: "what is in sockets is in no process: it counts by their usual size",
        calls: &[libc::SYS_setsockopt],
    },
];

/// For those who were.
const WITH_NETWORK: &[Group] = &[
    Group {
        verdict: RefusedIf(&[
            &[
                IsNot(0, libc::AF_UNIX as u64),
                IsNot(0, libc::AF_INET as u64),
                IsNot(0, libc::AF_INET6 as u64),
                IsNot(0, libc::AF_NETLINK as u64),
            ],
            &[
                Is(0, libc::AF_NETLINK as u64),
                IsNot(2, libc::NETLINK_ROUTE as u64),
            ],
        ]),
        reason: "other families load parts of the kernel; names are looked up with what there is \
                 of addresses",
        calls: &[libc::SYS_socket],
    },
    Group {
        verdict: Needed,
        reason: "the network",
        calls: &[
            libc::SYS_connect,
            libc::SYS_bind,
            libc::SYS_listen,
            libc::SYS_accept,
            libc::SYS_accept4,
            libc::SYS_setsockopt,
        ],
    },
];

/// All groups that hold.
fn table(network: bool) -> impl Iterator<Item = &'static Group> {
    let sockets = if network {
        WITH_NETWORK
    } else {
        WITHOUT_NETWORK
    };
    TABLE.iter().chain(sockets)
}

/// The programs that are to be installed, one after the other: the strictest answer
/// wins, and of two errors the later program's.
fn programs(network: bool, profile: Profile) -> Result<Vec<BpfProgram>, String> {
    let mut programs = vec![unjudged_calls()];
    if profile == Profile::AllowList {
        let known = table(network).filter(|group| !matches!(group.verdict, Refused(_)));
        let rules = known.flat_map(|group| group.calls.iter().map(|call| (*call, Vec::new())));
        let refused = SeccompAction::Errno(ENOSYS as u32);
        programs.push(program(rules.collect(), refused, SeccompAction::Allow)?);
    }
    for errno in [ENOSYS, EPERM] {
        let mut rules: BTreeMap<i64, Vec<SeccompRule>> = BTreeMap::new();
        for group in table(network) {
            let when = match group.verdict {
                Refused(with) if with == errno => Vec::new(),
                RefusedIf(lines) if errno == EPERM => compile(lines)?,
                _ => continue,
            };
            rules.extend(group.calls.iter().map(|call| (*call, when.clone())));
        }
        let refused = SeccompAction::Errno(errno as u32);
        programs.push(program(rules, SeccompAction::Allow, refused)?);
    }
    Ok(programs)
}

fn program(
    rules: BTreeMap<i64, Vec<SeccompRule>>,
    otherwise: SeccompAction,
    matched: SeccompAction,
) -> Result<BpfProgram, String> {
    let arch = TargetArch::try_from(std::env::consts::ARCH).map_err(|error| error.to_string())?;
    SeccompFilter::new(rules, otherwise, matched, arch)
        .and_then(BpfProgram::try_from)
        .map_err(|error| error.to_string())
}

fn compile(lines: &[&[If]]) -> Result<Vec<SeccompRule>, String> {
    let condition = |condition: &If| {
        let (argument, operator, value) = match *condition {
            Is(argument, value) => (argument, SeccompCmpOp::Eq, value),
            IsNot(argument, value) => (argument, SeccompCmpOp::Ne, value),
            Bits(argument, mask, value) => (argument, SeccompCmpOp::MaskedEq(mask), value),
        };
        SeccompCondition::new(argument, SeccompCmpArgLen::Dword, operator, value)
    };
    lines
        .iter()
        .map(|line| {
            let conditions = line.iter().map(condition).collect::<Result<_, _>>();
            conditions.and_then(SeccompRule::new)
        })
        .collect::<Result<_, _>>()
        .map_err(|error| error.to_string())
}

/// Refuses numbers that the table does not know yet, as an older kernel would.
fn unjudged_calls() -> BpfProgram {
    let instruction = |code: u32, jt, jf, k| sock_filter {
        code: code as u16,
        jt,
        jf,
        k,
    };
    vec![
        // The number is the first word of what a filter sees.
        instruction(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS, 0, 0, 0),
        instruction(
            libc::BPF_JMP | libc::BPF_JGE | libc::BPF_K,
            0,
            1,
            newer::UNJUDGED,
        ),
        instruction(
            libc::BPF_RET | libc::BPF_K,
            0,
            0,
            libc::SECCOMP_RET_ERRNO | ENOSYS as u32,
        ),
        instruction(libc::BPF_RET | libc::BPF_K, 0, 0, libc::SECCOMP_RET_ALLOW),
    ]
}

/// Installs the filters in this thread, which must be the only one. It needs "no
/// new privileges" or a capability.
pub(super) fn install(network: bool, profile: Profile) -> Result<(), (Errno, String)> {
    let programs = programs(network, profile).map_err(|reason| (Errno::NOSYS, reason))?;
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
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_filters_compile() {
        for network in [false, true] {
            for profile in [Profile::DenyList, Profile::AllowList] {
                let programs = programs(network, profile).unwrap();
                assert!(programs.len() >= 3);
                assert!(programs.iter().all(|program| program.len() < 4096));
            }
        }
    }

    #[test]
    fn a_call_has_one_verdict() {
        for network in [false, true] {
            let mut seen = BTreeSet::new();
            for call in table(network).flat_map(|group| group.calls) {
                assert!(seen.insert(*call), "call {call} is judged twice");
                assert!(*call < i64::from(newer::UNJUDGED), "call {call}");
            }
        }
    }
}
