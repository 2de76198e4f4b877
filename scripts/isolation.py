#!/usr/bin/env python3
"""What the sandbox contains, what it costs, and whether it changes what it measures.

    scripts/isolation.py [--only NAME ...] [--repeats N] [--as CONDITION ...]

Runs every behaviour of plugins/faulty through `fleetyard run` on a small instance, on
each of its plugins and under each of these conditions that this user can have:

    root           as root
    user           as an ordinary user (made for it and removed again, or --user NAME)
    root-refused   as root in a container: capabilities of Docker's default, namespaces
                   and mounts refused by a filter of system calls
    user-refused   as an ordinary user with the same filter

After each run it looks for itself, not in the record: is the host alive, are victims
(a process, its memory, files, listeners) as they were, and is any process left that
carries the run's mark or the name of what faulty plugins leave behind? Attempts also
report whether they succeeded, and the record has to name the right limit.

Then it measures the time from spawn to ready with all layers and with none in turns,
and one honest trial with and without the sandbox.

Writes the tables between the marker comments of docs/results/isolation.md and leaves the
rest of that file alone, and the kill times of every behaviour to isolation-limits.csv beside
it; with --only or --print it prints the tables instead. --raw keeps every single run. Takes
about half an hour on two cores. Standard library only.
"""

import argparse
import csv
import ctypes
import dataclasses
import json
import os
import pathlib
import platform
import pwd
import re
import resource
import secrets
import shutil
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
MAP = ROOT / "maps" / "random-32-32-20"
MARK = "FLEETYARD_ISOLATION_MARK"
FOREIGN = b"FLEETYARD_TEST_MARK="
SECRET = "HOST_SECRET"
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
HANGING_S = 120
MIB, GIB = 1 << 20, 1 << 30

# ---- What is tried -----------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Behaviour:
    """A fault, who has it, and what the host should make of it.

    `limits` are those that the record may name, "" standing for none. `sort` says what
    the metric `reached` has to be when the planner was not stopped: an `attempt` and
    what is `taken` beyond a limit have to be 0, what is `given` 1, `any` is neither. What
    is `hidden` is taken where nobody but the kernel may see it: it has to be 0, or the
    record has to say that the limit was only watched.
    """

    fault: str
    by: str
    options: str = ""
    flags: str = ""
    budget: str = "30s"
    limits: str = ""
    sort: str = "any"


def stopped(fault, by, limits="wall", **more):
    return Behaviour(fault, by, limits=limits, **{"budget": "300ms", **more})


def attempt(fault, by, options=""):
    return Behaviour(fault, by, options=options, sort="attempt")


# `by` names plugins by a letter: c, python, rust, and x for C++. {words} are victims.
GROUPS = {
    "Time and ends": [
        stopped("never", "cpr"),
        stopped("spin", "cpr"),
        stopped("spin", "cpr", "cpu", flags="--cpu 300ms", budget="30s"),
        stopped("deadlock", "r"),
        stopped("ignore-sigterm", "cp"),
        stopped("ignore-signals", "cp"),
        Behaviour("crash", "cp"),
        Behaviour("abort", "cpr"),
        Behaviour("stack-overflow", "cpr"),
        Behaviour("exit-0", "cpr"),
        Behaviour("exit-after-plan", "cpr"),
        Behaviour("crash-after", "cpr"),
        Behaviour("crash", "c", "during=deinit"),
        Behaviour("never", "c", "during=deinit"),
        Behaviour("longjmp-callback", "c", limits=" wall", budget="2s"),
        Behaviour("longjmp-stale", "c", limits=" wall", budget="2s"),
        Behaviour("panic", "r"),
        Behaviour("panic-thread", "r"),
        Behaviour("panic-twice", "r"),
        Behaviour("raises", "p"),
        Behaviour("throw-plan", "x"),
        Behaviour("throw-thread", "x"),
        Behaviour("throw-destroy", "x"),
    ],
    "Processes and threads": [
        stopped("fork-bomb", "cp", "processes", flags="--processes 64", budget="10s"),
        stopped("double-fork-bomb", "cp", "processes", flags="--processes 64", budget="10s"),
        stopped("thread-bomb", "cpr", "processes", flags="--processes 64", budget="10s"),
        stopped("spin-processes", "cp", "cpu", flags="--cpu 500ms", budget="30s"),
        stopped("spin-threads", "r", "cpu", flags="--cpu 500ms", budget="30s"),
        *(
            Behaviour(fault, by, "", "--cpu 300ms", limits="cpu", sort="hidden")
            for fault, by in [("autoreaped-children", "cp"), ("no-child-wait", "c")]
        ),
        Behaviour("short-children", "p"),
        Behaviour("re-rolls", "p"),
        Behaviour("works-between-calls", "p"),
        Behaviour("grandchild", "cpr"),
        Behaviour("daemon", "cp"),
        Behaviour("comet", "cp"),
    ],
    "Memory": [
        stopped("hog", "cpr", "memory", flags="--memory 256MiB", budget="30s"),
        *(
            Behaviour(
                fault,
                by,
                "size={hoard}",
                "--memory 256MiB",
                limits="memory",
                sort="taken",
            )
            for fault, by in [
                ("allocate", "cpr"),
                ("leak", "r"),
                ("allocate-many", "cp"),
                ("memfd", "cp"),
                ("posix-shm", "cp"),
                ("sysv-shm", "cp"),
            ]
        ),
        *(
            Behaviour(fault, by, f"size={size}", flags, limits="memory", sort="hidden")
            for fault, by, size, flags in [
                ("shared-anonymous", "cp", GIB, "--memory 256MiB"),
                ("page-tables", "c", GIB, "--memory 256MiB"),
                ("socket-buffers", "c", GIB, "--memory 256MiB"),
                ("pipe-buffers", "c", 128 * MIB, "--memory 64MiB"),
                ("headless", "c", GIB, "--memory 256MiB"),
            ]
        ),
        Behaviour("shared-memory", "cp", "size=134217728", "--memory 512MiB", sort="given"),
        Behaviour("leaves-shm", "cp", "size={key}"),
    ],
    "Output": [
        stopped(
            "flood-stderr",
            "cpr",
            "output",
            options="size=268435456",
            flags="--output-limit 1MiB",
            budget="30s",
        ),
        stopped(
            "flood",
            "cpr",
            "output",
            options="size=268435456",
            flags="--output-limit 1MiB",
            budget="30s",
        ),
        Behaviour("log-flood", "cpr", "size=67108864", limits=" output"),
        Behaviour("huge-answer", "p", "size=251658240"),
        stopped("late-huge-answer", "p", options="size=1"),
        Behaviour("incumbent-flood", "p", "size=41943040"),
        stopped("partial", "cp"),
        Behaviour("wrong-id", "cp"),
        Behaviour("answers-early", "p"),
        Behaviour("closes-stdio", "cp", limits=" wall", budget="300ms"),
        Behaviour("closes-everything", "cp"),
    ],
    "Disk": [
        *(
            Behaviour(fault, by, options, flags, limits="disk", sort="taken")
            for fault, by, options, flags in [
                ("huge-file", "cpr", "size=268435456", "--disk 16MiB"),
                ("unlinked-file", "cpr", "size=268435456", "--disk 16MiB"),
                ("many-files", "cpr", "count=100000", "--disk 16MiB"),
            ]
        ),
        Behaviour("closed-folders", "c"),
    ],
    "Files": [
        attempt("write-outside", "cpr", "target={precious}"),
        attempt("remove-outside", "cpr", "target={precious}"),
        attempt("read-file", "cpr", "target={secret}"),
        attempt("read-file", "cpr", "target=/etc/shadow"),
        attempt("read-file", "cpr", "target={neighbour}"),
        attempt("read-file", "cpr", "target={scenario}"),
        attempt("list-folder", "cpr", "target={folder}"),
        attempt("list-folder", "cpr", "target={home}"),
        attempt("kernel-files", "cp"),
        attempt("inherited", "cp", "target={secret}"),
        attempt("getenv", "cpr", f"target={SECRET}"),
        attempt("read-environment", "cpr", f"target={SECRET}"),
    ],
    "Network": [
        attempt("connect-tcp", "cpr", "target={tcp}"),
        attempt("connect-udp", "cpr", "target={udp}"),
        attempt("connect-unix", "cpr", "target={unix}"),
        attempt("connect-abstract", "cpr", "target={abstract}"),
        attempt("socketpair-netlink", "c"),
        attempt("socketpair-datagram", "c", "target={datagram}"),
    ],
    "Other processes": [
        attempt("kill-parent", "cp"),
        Behaviour("kill-group", "cp"),
        attempt("kill-pid", "cp", "pid={victim}"),
        attempt("kill-pid", "cp", "pid={host}"),
        attempt("see-process", "cp", "pid={victim}"),
        attempt("ptrace", "cp", "pid={victim}"),
        attempt("ptrace", "cp", "pid={host}"),
        attempt("read-memory", "cp", "pid={victim} target={address}"),
        attempt("write-memory", "cp", "pid={victim} target={address}"),
        attempt("steal-descriptor", "cp", "pid={victim}"),
        *(attempt("limit-supervisor", "c", f"target={what}") for what in ("cpu", "nofile", "fsize")),
        *(
            attempt("limit-host", "c", f"pid={{host}} target={what}")
            for what in ("cpu", "nofile", "fsize")
        ),
        attempt("priority-of-others", "c", "pid={victim}"),
        attempt("priority-of-others", "c", "pid={host}"),
        attempt("signal-by-file", "c", "pid={victim}"),
        attempt("lease", "c"),
        attempt("kill-all", "c"),
    ],
    "The kernel": [
        attempt("unshare", "cp"),
        attempt("mount", "cp"),
        attempt("io-uring", "cp"),
        attempt("inotify", "cp"),
        Behaviour("locks-granted", "cp"),  # refused by nothing
        attempt("bpf", "cp"),
        attempt("perf-event", "cp"),
        attempt("userfaultfd", "cp"),
        attempt("keyctl", "cp"),
        attempt("x32", "cp"),
        attempt("int80", "c"),
        attempt("repin", "cp"),
        attempt("realtime", "cp"),
        attempt("raise-limits", "cp"),
        attempt("aio", "c"),
        attempt("personality", "c"),
        attempt("memory-policy", "c"),
        attempt("seccomp-listener", "c"),
        attempt("new-calls", "c"),
        attempt("undumpable", "c"),
        attempt("oom-score", "c"),
        attempt("proc-files", "c"),
    ],
    "Memory of a plan": [
        Behaviour("changes-plan-after", "c"),
        Behaviour("changes-plan-during", "c"),
        Behaviour("shrinks-plan", "c"),
    ],
    "Its process": [
        # None of it is anybody else's; traps may end the worker, and so may the timer.
        Behaviour("leaves-ftz", "c"),
        Behaviour("leaves-rounding", "c"),
        Behaviour("leaves-traps", "c"),
        Behaviour("leaves-umask", "c"),
        Behaviour("leaves-cwd", "c"),
        Behaviour("leaves-signals", "c"),
        Behaviour("leaves-locale", "c"),
        Behaviour("leaves-limits", "c"),
        Behaviour("leaves-environment", "c"),
        Behaviour("leaves-timer", "c"),
        Behaviour("leaves-streams", "c"),
        Behaviour("leaves-thread", "c"),
    ],
    "While being loaded": [
        # The fault comes by the environment, so that it happens in a constructor.
        Behaviour("kill-parent", "l"),
        Behaviour("daemon", "l"),
        Behaviour("write-outside", "l", "target={precious}"),
        Behaviour("connect-abstract", "l", "target={abstract}"),
    ],
}

LETTERS = {"c": "C", "p": "Python", "r": "Rust", "x": "C++", "l": "C"}
CONDITIONS = ["root", "user", "root-refused", "user-refused"]
TITLES = {
    "root": "root",
    "user": "user",
    "root-refused": "root, namespaces refused",
    "user-refused": "user, namespaces refused",
}

# ---- A machine that refuses namespaces ---------------------------------------------

SYSTEM_CALLS = {  # clone, unshare, mount, umount2, pivot_root, setns
    "x86_64": (0xC000003E, 56, [272, 165, 166, 155, 308]),
    "aarch64": (0xC00000B7, 220, [97, 40, 39, 41, 268]),
}
NEW_CALLS = [428, 429, 430, 431, 432, 433, 442]  # open_tree to mount_setattr
CLONE3 = 435
CLONE_NEW = 0x7E020080  # every CLONE_NEW*, that of time included
DOCKER = "chown dac_override fowner fsetid kill setgid setuid setpcap net_bind_service net_raw \
sys_chroot mknod audit_write setfcap"
CAPABILITIES = "chown dac_override dac_read_search fowner fsetid kill setgid setuid setpcap \
linux_immutable net_bind_service net_broadcast net_admin net_raw ipc_lock ipc_owner sys_module \
sys_rawio sys_chroot sys_ptrace sys_pacct sys_admin sys_boot sys_nice sys_resource sys_time \
sys_tty_config mknod lease audit_write audit_control setfcap mac_override mac_admin syslog \
wake_alarm block_suspend audit_read perfmon bpf checkpoint_restore".split()


def refusing_filter():
    """As Docker's default profile: namespaces and mounts EPERM, clone3 ENOSYS."""
    machine, clone, calls = SYSTEM_CALLS[platform.machine()]
    load = lambda at: (0x20, 0, 0, at)  # noqa: E731
    refuse = lambda code: (0x06, 0, 0, 0x00050000 | code)  # noqa: E731
    allow = (0x06, 0, 0, 0x7FFF0000)
    program = [load(4), (0x15, 1, 0, machine), allow, load(0)]
    program += [(0x15, 0, 1, CLONE3), refuse(38)]
    for call in [*calls, *NEW_CALLS]:
        program += [(0x15, 0, 1, call), refuse(1)]
    program += [(0x15, 0, 3, clone), load(16), (0x45, 0, 1, CLONE_NEW), refuse(1), allow]
    return program


def become(wanted):
    """Runs in the launcher, before the host: filter, capabilities, user."""
    libc = ctypes.CDLL(None, use_errno=True)

    def checked(result, what):
        if result != 0:
            code = ctypes.get_errno()
            sys.exit(f"launcher: {what}: {os.strerror(code)}")

    refused = wanted["refused"]
    if refused:
        if os.geteuid() != 0:
            checked(libc.prctl(38, 1, 0, 0, 0), "no_new_privs")
        code = b"".join(struct.pack("HBBI", *line) for line in refusing_filter())
        room = ctypes.create_string_buffer(code, len(code))
        program = struct.pack("H6xQ", len(code) // 8, ctypes.addressof(room))
        keep = ctypes.create_string_buffer(program, len(program))
        checked(libc.prctl(22, 2, keep, 0, 0), "seccomp")
    if os.geteuid() == 0:
        if refused:
            bits = 0
            for number, name in enumerate(CAPABILITIES):
                if name in DOCKER.split():
                    bits |= 1 << number
                else:
                    libc.prctl(24, number, 0, 0, 0)  # from the bounding set
            header = struct.pack("Ii", 0x20080522, 0)
            low, high = bits & 0xFFFFFFFF, bits >> 32
            data = struct.pack("6I", low, low, 0, high, high, 0)
            checked(libc.capset(header, data), "capset")
        if wanted["uid"] != 0:
            os.setgroups([])
            os.setgid(wanted["gid"])
            os.setuid(wanted["uid"])
    # As a session that is not root's would have been set up.
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def launch(arguments):
    """`--launch WANTED COMMAND ...`: becomes somebody else, then the command."""
    become(json.loads(arguments[0]))
    command = [word.replace("{host}", str(os.getpid())) for word in arguments[1:]]
    os.execvpe(command[0], command, os.environ)


# ---- Victims -----------------------------------------------------------------------

VICTIM = """
import ctypes, sys
room = ctypes.create_string_buffer(b"as it was", 64)
print(ctypes.addressof(room), flush=True)
for line in sys.stdin:
    print(room.value == b"as it was", flush=True)
"""


class Listener(threading.Thread):
    """Counts who comes by."""

    def __init__(self, family, kind, address):
        super().__init__(daemon=True)
        self.socket = socket.socket(family, kind)
        self.socket.bind(address)
        self.kind, self.heard = kind, 0
        if kind == socket.SOCK_STREAM:
            self.socket.listen()
        self.start()

    def run(self):
        while True:
            try:
                if self.kind == socket.SOCK_STREAM:
                    self.socket.accept()[0].close()
                else:
                    self.socket.recv(64)
            except OSError:
                return
            self.heard += 1


class Victims:
    """A process, files and listeners that belong to the user of the condition."""

    def __init__(self, yard, user):
        self.user, self.number = user, 0
        self.folder = yard / f"victims-{user.pw_name}"
        self.folder.mkdir()
        os.chown(self.folder, user.pw_uid, user.pw_gid)
        self.listeners = {}
        local, letters = str(self.folder / "socket"), str(self.folder / "letters")
        self.abstract = f"fy-{secrets.token_hex(6)}"
        stream, datagram = socket.SOCK_STREAM, socket.SOCK_DGRAM
        for name, family, kind, address in [
            ("tcp", socket.AF_INET, stream, ("127.0.0.1", 0)),
            ("udp", socket.AF_INET, datagram, ("127.0.0.1", 0)),
            ("unix", socket.AF_UNIX, stream, local),
            ("datagram", socket.AF_UNIX, datagram, letters),
            ("abstract", socket.AF_UNIX, stream, "\0" + self.abstract),
        ]:
            self.listeners[name] = Listener(family, kind, address)
        os.chmod(local, 0o777)
        os.chmod(letters, 0o777)
        self.secret, self.precious = self.folder / "secret", self.folder / "precious"
        self.process = None

    def write(self, path, text):
        path.write_text(text)
        os.chown(path, self.user.pw_uid, self.user.pw_gid)
        os.chmod(path, 0o600)

    def renew(self):
        """Makes everything as it was."""
        self.number += 1
        self.write(self.secret, "nobody may read this\n")
        self.write(self.precious, "nobody may write here\n")
        if self.process is None or self.process.poll() is not None:
            own = {} if os.geteuid() != 0 else {"user": self.user.pw_uid, "group": self.user.pw_gid}
            own |= {"extra_groups": []} if own else {}
            self.process = subprocess.Popen(
                [sys.executable if os.geteuid() == self.user.pw_uid else "python3", "-c", VICTIM],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env={"PATH": PATH, SECRET: "of the victim"},
                cwd="/",
                start_new_session=True,
                **own,
            )
            self.address = int(self.process.stdout.readline())
        self.heard = {name: listener.heard for name, listener in self.listeners.items()}
        self.key = 0x66790000 | secrets.randbelow(1 << 16)

    def words(self):
        port = lambda name: self.listeners[name].socket.getsockname()[1]  # noqa: E731
        return {
            "secret": self.secret,
            "precious": self.precious,
            "folder": self.folder,
            "home": self.user.pw_dir,
            "tcp": f"127.0.0.1:{port('tcp')}",
            "udp": f"127.0.0.1:{port('udp')}",
            "unix": self.folder / "socket",
            "datagram": self.folder / "letters",
            "abstract": self.abstract,
            "victim": self.process.pid,
            "address": self.address,
            "key": self.key,
            "hoard": min(8 * GIB, available_memory() // 2),
            "host": "{host}",
        }

    def harm(self):
        """What is not as it was."""
        found = []
        if self.precious.exists():
            if self.precious.read_text() != "nobody may write here\n":
                found.append("the file was written to")
        else:
            found.append("the file was removed")
        for name, listener in self.listeners.items():
            if listener.heard != self.heard[name]:
                found.append(f"the {name} listener was reached")
        if self.process.poll() is not None:
            found.append("the victim was killed")
        else:
            status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
            if not re.search(r"TracerPid:\s*0\b", status):
                found.append("the victim is traced")
            elif re.search(r"State:\s*[tT]", status):
                found.append("the victim was stopped")
            else:
                self.process.stdin.write("well?\n")
                self.process.stdin.flush()
                if self.process.stdout.readline().strip() != "True":
                    found.append("the victim's memory was changed")
                    self.process.kill()
                    self.process.wait()
        segments = pathlib.Path("/proc/sysvipc/shm").read_text().splitlines()[1:]
        for line in segments:
            key, segment = line.split()[:2]
            if int(key) == self.key:
                found.append("shared memory was left behind")
                ctypes.CDLL(None).shmctl(int(segment), 0, None)
        left = pathlib.Path("/dev/shm/fy-left")
        if left.exists():
            found.append("a file was left in /dev/shm")
            left.unlink()
        return found

    def end(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()
        for listener in self.listeners.values():
            listener.socket.close()


def available_memory():
    for line in pathlib.Path("/proc/meminfo").read_text().splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    return GIB


def survivors(mark, began):
    """Living processes that carry the mark, or the name of what faulty plugins leave.

    The name alone counts when the process began during the run and carries no mark of
    somebody else's: tests may run on the same machine.
    """
    found = []
    wanted = f"{MARK}={mark}".encode()
    tick = os.sysconf("SC_CLK_TCK")
    for entry in filter(str.isdigit, os.listdir("/proc")):
        process = pathlib.Path("/proc", entry)
        try:
            name = (process / "comm").read_text().strip()
            state, *fields = (process / "stat").read_text().rsplit(")", 1)[1].split()
            try:
                variables = (process / "environ").read_bytes().split(b"\0")
            except PermissionError:
                variables = []  # somebody else's
        except OSError:
            continue  # it has just ended
        if state in "ZX":
            continue
        marked = any(one.startswith((f"{MARK}=".encode(), FOREIGN)) for one in variables)
        young = int(fields[18]) / tick >= began - 0.1
        if wanted in variables or (name == "fy-orphan" and young and not marked):
            found.append((int(entry), name))
    return found


# ---- One run -----------------------------------------------------------------------


class Yard:
    """A folder that everybody may enter, with the host and the plugins."""

    def __init__(self, fleetyard, libraries):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="fy-isolation-", dir="/var/tmp"))
        # A plugin may read its folder: nothing that it must not read is in there, but for
        # the instance. Another one's files are in the same project.
        host, plugins = self.folder / "host", self.folder / "plugins"
        host.mkdir()
        plugins.mkdir()
        self.fleetyard, self.launcher = host / "fleetyard", host / "launcher.py"
        shutil.copy(fleetyard, self.fleetyard)
        shutil.copy(__file__, self.launcher)
        self.plugins = {}
        for letter, files in libraries.items():
            for file in files:
                shutil.copy(file, plugins)
            self.plugins[letter] = plugins / files[0].name
        self.instance = []
        for flag, suffix in (("--map", ".map"), ("--scen", "-random-1.scen")):
            copy = shutil.copy(f"{MAP}{suffix}", plugins)
            self.instance += [flag, copy]
        self.neighbour = self.folder / "other" / "planner.py"
        self.neighbour.parent.mkdir()
        self.neighbour.write_text("the work of another team\n")
        (self.folder / "pyproject.toml").touch()
        for path in [self.folder, *self.folder.rglob("*")]:
            os.chmod(path, 0o755)
        shown = [str(self.fleetyard), "run", "--help"]
        self.help = subprocess.run(shown, capture_output=True, text=True, check=True).stdout

    def words(self):
        return {"neighbour": self.neighbour, "scenario": self.instance[-1]}

    def knows(self, flag):
        return f"{flag} " in self.help or f"{flag}\n" in self.help

    def flags(self, text):
        """Flags of this host; an older one does without."""
        words, known = text.split(), []
        for at in range(0, len(words), 2):
            if self.knows(words[at]):
                known += words[at : at + 2]
        return known

    def remove(self):
        shutil.rmtree(self.folder, ignore_errors=True)


@dataclasses.dataclass
class Condition:
    name: str
    user: pwd.struct_passwd
    refused: bool

    def command(self, yard, words):
        wanted = {"refused": self.refused, "uid": self.user.pw_uid, "gid": self.user.pw_gid}
        return ["python3", str(yard.launcher), "--launch", json.dumps(wanted), *map(str, words)]


def run(yard, condition, words, env=None, descriptors=()):
    """Runs the host; its record, what it printed, seconds, and who survived."""
    mark = secrets.token_hex(8)
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="scratch-", dir=yard.folder))
    os.chown(scratch, condition.user.pw_uid, condition.user.pw_gid)
    variables = {
        "PATH": PATH,
        "HOME": str(scratch),
        "TMPDIR": str(scratch),
        "LANG": "C.UTF-8",
        "PYTHONDONTWRITEBYTECODE": "1",
        SECRET: "of the host",
        MARK: mark,
        **(env or {}),
    }
    if yard.knows("--env"):
        words = [*words, "--env", MARK]
    command = condition.command(yard, words)
    began, started = time.clock_gettime(time.CLOCK_BOOTTIME), time.monotonic()
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=scratch,
        env=variables,
        start_new_session=True,
        pass_fds=descriptors,
    )
    try:
        stdout, stderr = process.communicate(timeout=HANGING_S)
        code = process.returncode
    except subprocess.TimeoutExpired:
        code = None
    seconds = time.monotonic() - started
    left = survivors(mark, began)
    for pid, _ in left:
        try:
            os.kill(pid, signal.SIGKILL)
        except OSError:
            pass
    if code is None:
        process.kill()
        stdout, stderr = process.communicate()
    files = sorted(path.name for path in scratch.rglob("*"))
    shutil.rmtree(scratch, ignore_errors=True)
    try:
        record = json.loads(stdout)
    except ValueError:
        record = None
    return {
        "code": code,
        "record": record,
        "stderr": stderr.decode(errors="replace")[-4096:],
        "seconds": seconds,
        "left": [name for _, name in left],
        "files": files,
    }


def trial(yard, condition, victims, behaviour, letter):
    """One behaviour, once: what was done wrong, and what the record says."""
    victims.renew()
    words = victims.words() | yard.words()
    options = [option.format(**words) for option in behaviour.options.split()]
    command = [yard.fleetyard, "run", *yard.instance, "--agents", "4"]
    command += ["--planner", yard.plugins[letter], "--format", "json"]
    command += ["--budget", behaviour.budget, *yard.flags(behaviour.flags)]
    env = {}
    if letter == "l":
        env["FLEETYARD_FAULT"] = behaviour.fault
        for option in options:
            name, value = option.split("=", 1)
            env[f"FLEETYARD_{name.upper()}"] = value
    else:
        for option in [f"fault={behaviour.fault}", *options]:
            command += ["--option", option]
    if yard.knows("--sandbox"):
        command += ["--sandbox", "auto"]
    descriptor = os.open(victims.secret, os.O_RDONLY)
    os.set_inheritable(descriptor, True)
    try:
        ended = run(yard, condition, command, env, [descriptor])
    finally:
        os.close(descriptor)
    return judge(behaviour, letter, ended, victims.harm())


def only_watched(record, limit):
    """Whether the record says that a limit was not enforced, and so, of processor time,
    that the result may not be compared."""
    states = (record.get("sandbox") or {}).get("limits", [])
    watched = any(state["limit"] == limit and not state["enforced"] for state in states)
    return watched and (limit != "cpu" or not record["planner"]["ranked"])


def judge(behaviour, letter, ended, harm):
    record = ended["record"] or {}
    wrong = list(harm)
    if ended["code"] is None:
        wrong.append("the host hangs")
    elif ended["code"] < 0:
        wrong.append(f"the host died of signal {-ended['code']}")
    elif ended["record"] is None and not (letter == "l" and ended["code"] == 5):
        # A plugin that dies while being loaded is refused, without a record.
        said = [line for line in ended["stderr"].splitlines() if line.startswith("error: ")]
        wrong.append(f"no record (exit code {ended['code']}) {said[0] if said else ''}".strip())
    if ended["left"]:
        wrong.append(f"left running: {', '.join(sorted(set(ended['left'])))}")
    if any(name.startswith("fy-") for name in ended["files"]):
        wrong.append("files were left behind")
    limit = record.get("limit") or ""
    reached = record.get("claimed_metrics", {}).get("reached")
    termination = record.get("termination")
    went_on = termination == "completed"
    if behaviour.sort == "attempt" and went_on and reached != 0:
        wrong.append("it got what it tried" if reached else "it did not say whether it reached it")
    allowed = [name if name != "none" else "" for name in behaviour.limits.split(" ")]
    right = limit in allowed
    if behaviour.sort in ("taken", "hidden"):
        named = behaviour.sort == "hidden" and only_watched(record, behaviour.limits)
        if went_on and reached != 0 and not limit and not named:
            wrong.append("it got more than it was given")
        right = right or named
        # Refused is as good as stopped, and then there is nothing to name.
        right = right or (not limit and (reached == 0 or termination in ("crashed", "exited")))
    if behaviour.sort == "given" and not (went_on and reached == 1):
        wrong.append(f"it did not get what is its own ({termination}, limit {limit or 'none'})")
    if behaviour.fault == "hog":
        right = right or termination in ("crashed", "exited")
    if right and limit and not record.get("stopped", True) and termination != "completed":
        right = False
    return {
        "contained": not wrong,
        "wrong": wrong,
        "right": right,
        "limit": limit,
        "termination": termination,
        "kill_ms": record.get("kill_latency_ms"),
        "reached": reached,
        "seconds": ended["seconds"],
        "sandbox": record.get("sandbox"),
        "fault": record.get("fault"),
    }


# ---- Tables ------------------------------------------------------------------------


def table(head, rows, left=1):
    """Markdown; the first `left` columns are text, the others figures."""
    rule = ["---"] * left + ["---:"] * (len(head) - left)
    lines = [head, rule, *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def title(behaviour):
    shown = re.sub(r"\{(\w+)\}", r"\1", behaviour.options)
    for noise in ("size=hoard", "size=key", f"target={SECRET}"):
        shown = shown.replace(noise, "")
    shown = re.sub(r"\b(size|count|target|pid)=", "", shown)
    shown = re.sub(r"\b\d{6,}\b", lambda found: amount(int(found[0])), shown)
    shown = " ".join([*shown.split(), behaviour.flags]).strip()
    return f"`{behaviour.fault}`{f' ({shown})' if shown else ''}"


def amount(number):
    return f"{number // MIB} MiB" if number % MIB == 0 else str(number)


def milliseconds(values):
    """Median and largest as text."""
    if not values:
        return "", ""
    middle, most = statistics.median(values), max(values)
    digits = 1 if most < 100 else 0
    return f"{middle:.{digits}f}", f"{most:.{digits}f}"


def of(results, behaviour, condition=None):
    return [
        one
        for one in results
        if one["behaviour"] == behaviour and condition in (None, one["condition"])
    ]


def containment_tables(results, conditions):
    names = [condition.name for condition in conditions]
    rows = []
    for group, behaviours in GROUPS.items():
        tried = [b for b in behaviours if of(results, b)]
        held = [one["contained"] for b in tried for one in of(results, b)]
        if tried:
            rows.append([group, len(tried), f"{sum(held)} of {len(held)}"])
    contained = [
        table(["group", "behaviours", "runs that were contained"], rows),
        summary(results, names),
    ]
    return {
        "contained": "\n\n".join(contained),
        "limits": limits_table(results, names),
        "exceptions": exceptions(results, names),
    }


def limited(results):
    """Behaviours that a limit may end, by that limit, with their runs."""
    found = {}
    for behaviour in (one for group in GROUPS.values() for one in group):
        everything = of(results, behaviour)
        if any(one["limit"] for one in everything) or (everything and behaviour.limits.strip()):
            found.setdefault(behaviour.limits.strip() or "none", []).append((behaviour, everything))
    return found


def kill_times(runs, name):
    of_condition = [one["kill_ms"] for one in runs if one["condition"] == name]
    return [time for time in of_condition if time is not None]


def limits_table(results, names):
    rows = []
    for limit, behaviours in limited(results).items():
        runs = [one for _, ones in behaviours for one in ones]
        right = sum(one["right"] for one in runs)
        most = [max(kill_times(runs, name), default=None) for name in names]
        shown = ["" if time is None else f"{time:.0f}" for time in most]
        rows.append([limit, len(behaviours), f"{right} of {len(runs)}", *shown])
    head = ["limit", "behaviours", "right", *(TITLES[name] for name in names)]
    return table(head, rows)


def write_limits(path, results, conditions):
    """Every behaviour that a limit may end: the limits that were named, and its kill times."""
    names = [condition.name for condition in conditions]
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        times = [f"{name}_{figure}_ms" for name in names for figure in ("median", "largest")]
        writer.writerow(["behaviour", "limits_named", "right", "runs", *times])
        for behaviour, runs in (pair for pairs in limited(results).values() for pair in pairs):
            named = sorted({one["limit"] or "none" for one in runs})
            right = sum(one["right"] for one in runs)
            cells = [milliseconds(kill_times(runs, name)) for name in names]
            flat = [figure for cell in cells for figure in cell]
            writer.writerow([title(behaviour).replace("`", ""), " ".join(named), right, len(runs), *flat])


def summary(results, names):
    lines = []
    for name in names:
        ones = [one for one in results if one["condition"] == name]
        good = sum(one["contained"] for one in ones)
        right = sum(one["right"] for one in ones)
        count = len(ones)
        lines.append(
            f"- {TITLES[name]}: {good} of {count} runs contained, "
            f"the right limit (or none) named in {right} of {count}"
        )
    return "\n".join(lines)


def exceptions(results, names):
    counted = {}
    for one in results:
        shown = [reason.replace(str(one["folder"]), "…") for reason in one["wrong"]]
        if not one["right"]:
            limit = one["limit"] or "none"
            shown.append(f"the record names the limit {limit} ({one['termination']})")
        for reason in shown:
            what = (names.index(one["condition"]), title(one["behaviour"]), reason)
            letters, count = counted.get(what, (set(), 0))
            counted[what] = (letters | {LETTERS[one["letter"]]}, count + 1)
    if not counted:
        return "None."
    rows = [
        [TITLES[names[at]], behaviour, ", ".join(sorted(letters)), reason.replace("|", "/"), count]
        for (at, behaviour, reason), (letters, count) in sorted(counted.items())
    ]
    return table(["condition", "behaviour", "plugins", "what", "runs"], rows, 4)


def layers_table(results, conditions):
    """The layers that records report, and why one is missing; and who enforces limits."""
    seen, order = {}, []

    def saw(row, one, cell):
        if row not in order:
            order.append(row)
        cells = seen.setdefault((row, one["condition"]), {})
        cells[cell] = cells.get(cell, 0) + 1

    for one in results:
        sandbox = one["sandbox"] or {}
        for state in sandbox.get("layers", []):
            cell = "✓" if state["active"] else (state["errno"] or state["reason"] or "no")
            saw(state["layer"], one, cell)
        for state in sandbox.get("limits", []):
            held = f"by the {state['by']}" if state["enforced"] else "watched"
            saw(f"limit `{state['limit']}`", one, held)
    order.sort(key=lambda row: row.startswith("limit"))
    rows = []
    for layer in order:
        row = []
        for condition in conditions:
            cells = seen.get((layer, condition.name), {})
            row.append("; ".join(sorted(cells, key=cells.get, reverse=True)) or "")
        # What is alike is one row.
        if rows and rows[-1][1:] == row:
            rows[-1][0] += f", {layer}"
        else:
            rows.append([layer, *row])
    head = ["layer, limit", *(TITLES[condition.name] for condition in conditions)]
    return table(head, rows) if rows else "The records name no layers."


# ---- What it costs -----------------------------------------------------------------


def spread(values):
    quarters = statistics.quantiles(values, n=4)
    return quarters[0], quarters[2]


def honest(yard, level, planner, more=()):
    flags = ["--sandbox", level] if yard.knows("--sandbox") else []
    return [yard.fleetyard, "run", *yard.instance, "--format", "json", "--budget", "60s"] + [
        *["--planner", planner],
        *flags,
        *more,
    ]


def overhead(yard, conditions, repeats):
    """From spawn to ready, all layers and none in turns."""
    rows = []
    for condition in conditions:
        times = {"auto": [], "none": []}
        walls = {"auto": [], "none": []}
        for turn in range(repeats + 5):
            levels = ["none", "auto"] if turn % 2 else ["auto", "none"]
            for level in levels:
                command = honest(yard, level, yard.plugins["c"], ["--agents", "1"])
                ended = run(yard, condition, command)
                measured = (ended["record"] or {}).get("measurement", {}).get("startup_ms")
                if turn >= 5:  # the first are for the caches
                    walls[level].append(ended["seconds"] * 1000)
                    if measured is not None:
                        times[level].append(measured)
            progress(f"spawn to ready, {condition.name}: {turn + 1}/{repeats + 5}")
        if not times["auto"]:
            times = walls  # a host that does not say: the command as a whole
        pairs = [all_ - none for all_, none in zip(times["auto"], times["none"])]
        cells = []
        for values in (times["none"], times["auto"], pairs):
            low, high = spread(values)
            cells.append(f"{statistics.median(values):.2f} ({low:.2f}–{high:.2f})")
        whole = statistics.median(walls["auto"]) - statistics.median(walls["none"])
        rows.append([TITLES[condition.name], len(pairs), *cells, f"{whole:.2f}"])
    head = ["condition", "pairs", "level none", "all layers", "difference", "whole command"]
    return table(head, rows)


WORK = ["--agents", "200", "--option", "anytime=true", "--nodes", "20000", "--seed", "1"]


def fidelity(yard, conditions, repeats):
    """The same work with and without the sandbox: CPU time as the host reports it."""
    rows = []
    for condition in conditions:
        times = {"none": [], "auto": []}
        digests = set()
        for turn in range(repeats + 1):
            for level in ["none", "auto"] if turn % 2 else ["auto", "none"]:
                ended = run(yard, condition, honest(yard, level, "lacam", WORK))
                record = ended["record"]
                if record is None:
                    sys.exit(f"the trial failed: {ended['stderr']}")
                used = record["resources"]
                if turn > 0:  # the first is for the caches
                    times[level].append((used["user_us"] + used["system_us"]) / 1000)
                    digests.add(record["plan_digest"])
            progress(f"the same trial, {condition.name}: {turn + 1}/{repeats + 1}")
        cells, middles = [], {}
        for level in ("none", "auto"):
            low, high = spread(times[level])
            middles[level] = statistics.median(times[level])
            cells.append(f"{middles[level]:.1f} ({low:.1f}–{high:.1f})")
        low, high = spread(times["none"])
        change = middles["auto"] - middles["none"]
        percent = 100 * change / middles["none"]
        noise = high - low
        within = "yes" if abs(change) <= noise else "no"
        same = "yes" if len(digests) == 1 else f"no, {len(digests)}"
        row = [TITLES[condition.name], repeats, *cells, f"{change:+.1f} ({percent:+.1f} %)"]
        rows.append([*row, f"{noise:.1f}", within, same])
    head = ["condition", "runs each", "outside, ms CPU", "sandbox, ms CPU", "difference"]
    return table([*head, "spread outside", "within it", "one plan"], rows)


# ---- The document ------------------------------------------------------------------

SKELETON = """# Results: isolation

{}
"""


def markers(name):
    return f"<!-- begin {name}: written by scripts/isolation.py -->", f"<!-- end {name} -->"


def write_tables(path, tables):
    """Puts each table between its markers; a missing pair goes to the end."""
    text = path.read_text() if path.exists() else SKELETON.format("").rstrip() + "\n"
    for name, content in tables.items():
        begin, end = markers(name)
        block = f"{begin}\n{content}\n{end}"
        if begin in text and end in text:
            head, rest = text.split(begin, 1)
            text = head + block + rest.split(end, 1)[1]
        else:
            text = f"{text.rstrip()}\n\n{block}\n"
    path.write_text(text)


told = [0.0]


def progress(text):
    """One line that changes; into a file a line every half minute."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
    elif text and time.monotonic() - told[0] > 30:
        told[0] = time.monotonic()
        print(text, file=sys.stderr, flush=True)


def machine(yard):
    """The line above the tables."""
    names = re.findall(r"model name\s*:\s*(.+)", pathlib.Path("/proc/cpuinfo").read_text())
    commit = subprocess.run(
        ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"],
        capture_output=True,
        text=True,
        check=False,
    ).stdout.strip()
    version = [str(yard.fleetyard), "--version"]
    version = subprocess.run(version, capture_output=True, text=True, check=True).stdout.strip()
    load = " ".join(f"{value:.1f}" for value in os.getloadavg())
    return (
        f"{version} ({commit}), {platform.system()} {platform.release()}, "
        f"{os.cpu_count()} × {names[0] if names else platform.machine()}; "
        f"load at the end {load}."
    )


# ---- Setting up --------------------------------------------------------------------


def build(fleetyard, letters):
    """The host, unless one is given, and every faulty plugin that can be built."""
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    cargo = ["cargo", "build", "--release", "--quiet"]
    if fleetyard is None:
        fleetyard = target / "release" / "fleetyard"
        subprocess.run([*cargo, "--package", "fleetyard"], cwd=ROOT, check=True)
    folder = ROOT / "plugins" / "faulty"
    out = target / "faulty"
    subprocess.run(["make", "-s", "-C", folder, f"OUT={out}"], check=True)
    libraries = {
        "c": [out / "faulty.so"],
        "l": [out / "constructor_fault.so"],
        "p": [folder / "faulty.py", folder / "mischief.py"],
    }
    if (out / "faulty_cpp.so").exists():
        libraries["x"] = [out / "faulty_cpp.so"]
    if "r" not in letters:
        return fleetyard, libraries
    if subprocess.run([*cargo, "--package", "fleetyard-faulty"], cwd=ROOT, check=False).returncode:
        print("the plugin in Rust could not be built and is left out", file=sys.stderr)
    else:
        libraries["r"] = [target / "release" / "libfleetyard_faulty.so"]
    return fleetyard, libraries


def ordinary_user(name):
    """An ordinary user, and whether it was made for this."""
    if os.geteuid() != 0:
        return pwd.getpwuid(os.geteuid()), False
    if name:
        return pwd.getpwnam(name), False
    name = "fleetyard-trial"
    try:
        return pwd.getpwnam(name), False
    except KeyError:
        subprocess.run(["useradd", "--create-home", "--shell", "/bin/sh", name], check=True)
        return pwd.getpwnam(name), True


def chosen_conditions(wanted, user):
    me = pwd.getpwuid(os.geteuid())
    chosen = []
    for name in CONDITIONS:
        who = me if name.startswith("root") else user
        possible = os.geteuid() == 0 or not name.startswith("root")
        if possible and (not wanted or name in wanted):
            chosen.append(Condition(name, who, name.endswith("refused")))
    return chosen


def parse():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--fleetyard", type=pathlib.Path, help="the host [default: builds it]")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="these faults")
    parser.add_argument("--plugins", default="cprxl", help="letters of %(default)s")
    parser.add_argument("--repeats", type=int, default=10, help="of each [default: 10]")
    parser.add_argument("--as", nargs="+", dest="conditions", choices=CONDITIONS, metavar="WHO")
    parser.add_argument("--user", help="an ordinary user [default: makes one]")
    parser.add_argument("--pairs", type=int, default=200, help="for the overhead [default: 200]")
    parser.add_argument("--trials", type=int, default=20, help="in and outside [default: 20]")
    parser.add_argument(
        "--parts",
        nargs="+",
        choices=["containment", "overhead", "fidelity"],
        help="[default: all, with --only the first]",
    )
    parser.add_argument("--raw", type=pathlib.Path, help="write every run to this file, as JSON")
    docs = ROOT / "docs" / "results" / "isolation.md"
    parser.add_argument("--docs", type=pathlib.Path, default=docs)
    parser.add_argument("--print", action="store_true", help="print the tables, write nothing")
    arguments = parser.parse_args()
    every = ["containment", "overhead", "fidelity"]
    arguments.parts = arguments.parts or every[: 1 if arguments.only else 3]
    return arguments


def containment(yard, conditions, arguments):
    every = [behaviour for behaviours in GROUPS.values() for behaviour in behaviours]
    chosen = [b for b in every if not arguments.only or b.fault in arguments.only]
    if not chosen:
        sys.exit(f"no such behaviour; known: {', '.join(sorted({b.fault for b in every}))}")
    letters = [letter for letter in arguments.plugins if letter in yard.plugins]
    results, begun = [], time.monotonic()
    victims = {}
    for condition in conditions:
        if condition.user.pw_name not in victims:
            victims[condition.user.pw_name] = Victims(yard.folder, condition.user)
    work = [(b, letter) for b in chosen for letter in b.by if letter in letters]
    total = len(work) * len(conditions) * arguments.repeats
    try:
        for behaviour, letter in work:
            for condition in conditions:
                ones = []
                for _ in range(arguments.repeats):
                    one = trial(yard, condition, victims[condition.user.pw_name], behaviour, letter)
                    one.update(behaviour=behaviour, letter=letter, condition=condition.name)
                    one["folder"] = yard.folder
                    ones.append(one)
                    progress(
                        f"{len(results) + len(ones)}/{total} {time.monotonic() - begun:.0f} s: "
                        f"{behaviour.fault} ({LETTERS[letter]}, {condition.name})"
                    )
                results += ones
                bad = [one for one in ones if not (one["contained"] and one["right"])]
                if bad:
                    why = bad[0]["wrong"] or [f"limit {bad[0]['limit'] or 'none'}"]
                    progress("")
                    print(
                        f"{title(behaviour)} in {LETTERS[letter]} as {condition.name}: "
                        f"{len(bad)} of {len(ones)} not as they should be: "
                        f"{'; '.join(why)} ({bad[0]['termination']}, {bad[0]['fault']})",
                        file=sys.stderr,
                    )
    finally:
        for one in victims.values():
            one.end()
    progress("")
    return results


def main():
    if sys.argv[1:2] == ["--launch"]:
        launch(sys.argv[2:])
    arguments = parse()
    fleetyard, libraries = build(arguments.fleetyard, arguments.plugins)
    user, made = ordinary_user(arguments.user)
    conditions = chosen_conditions(arguments.conditions, user)
    yard = Yard(fleetyard, libraries)
    tables, results = {}, []
    try:
        if "containment" in arguments.parts:
            results = containment(yard, conditions, arguments)
            tables["layers"] = layers_table(results, conditions)
            tables.update(containment_tables(results, conditions))
        # Namespaces that are refused make no difference to what it costs.
        plain = [c for c in conditions if not c.refused] or conditions
        if "overhead" in arguments.parts:
            tables["overhead"] = overhead(yard, plain, arguments.pairs)
        if "fidelity" in arguments.parts:
            tables["fidelity"] = fidelity(yard, plain, arguments.trials)
        tables["machine"] = machine(yard)
    finally:
        progress("")
        yard.remove()
        if made:
            subprocess.run(["userdel", "--remove", user.pw_name], check=False, capture_output=True)
    if arguments.raw:
        kept = [{**one, "behaviour": title(one["behaviour"])} for one in results]
        arguments.raw.write_text(json.dumps(kept, indent=1, default=str))
    if arguments.print or arguments.only or arguments.plugins != "cprxl":
        for name, content in tables.items():
            print(f"## {name}\n\n{content}\n")
    else:
        write_tables(arguments.docs, tables)
        if results:
            write_limits(arguments.docs.with_name("isolation-limits.csv"), results, conditions)
        print(f"{arguments.docs}: {', '.join(tables)}")


if __name__ == "__main__":
    main()
