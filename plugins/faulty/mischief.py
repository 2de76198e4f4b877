"""What a faulty plugin does to its process, to the machine and to others, and how it
tries to get out of its sandbox: mischief.h in Python, with raw system calls by ctypes.
A part of faulty.py; `FAULTS` maps names to functions of a `Call`.

What is left behind ends by itself after LIFETIME_S, bombs stop growing at `count`,
nothing is written over, and no attempt has an effect that lasts.
"""

import contextlib
import ctypes
import errno
import fcntl
import mmap
import os
import platform
import pwd
import resource
import signal
import socket
import struct
import sys
import tempfile
import threading
import time

LIFETIME_S = 120
MIB, GIB = 1 << 20, 1 << 30
PAGE = 4096

LIBC = ctypes.CDLL(None, use_errno=True)
LIBC.syscall.restype = ctypes.c_long
LIBC.shmat.restype = ctypes.c_void_p
LIBC.ptrace.restype = ctypes.c_long

# Numbers of system calls that Python has no function for.
NUMBERS = {
    "x86_64": {"bpf": 321, "perf_event_open": 298, "userfaultfd": 323, "keyctl": 250},
    "aarch64": {"bpf": 280, "perf_event_open": 241, "userfaultfd": 282, "keyctl": 219},
}.get(platform.machine(), {})
NUMBERS.update(io_uring_setup=425, pidfd_open=434, pidfd_getfd=438)

FAULTS = {}


def fault(function):
    FAULTS[function.__name__.strip("_").replace("_", "-")] = function
    return function


class Call:
    """What a fault needs to know, and to whom it reports."""

    def __init__(self, options, request, write, notify):
        self.request, self.write, self.notify = request, write, notify
        self.target = options.get("target", "")
        self.pid = options.get("pid") or os.getppid()
        self._size, self._count = options.get("size"), options.get("count")

    def size(self, usual):
        return self._size or usual

    def count(self, usual):
        return self._count or usual

    def log(self, text):
        self.notify("log", level="info", text=text)

    def metric(self, name, value):
        self.notify("metric", name=name, value=value)

    def report(self, reached, what):
        """Says whether an attempt succeeded; `reached` is True, or why not."""
        self.log(f"{what}: {'reached' if reached is True else reached}")
        self.metric("reached", 1 if reached is True else 0)

    def attempt(self, what, action):
        """Tries something that raises OSError, or returns why it failed."""
        try:
            reached = action()
        except OSError as error:
            reached = error
        self.report(True if reached is None else reached, what)

    def took(self, got, wanted, what, why="refused"):
        self.metric("obtained", got)
        self.report(True if got >= wanted else why, what)


def number_of(name):
    if name not in NUMBERS:
        raise OSError(errno.ENOSYS, "not on this machine")
    return NUMBERS[name]


def system_call(number, *arguments):
    wide = [ctypes.c_long(a) if isinstance(a, int) else a for a in arguments]
    result = LIBC.syscall(ctypes.c_long(number), *wide)
    if result < 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))
    return result


def checked(result):
    """Raises what a function of the C library left in errno."""
    if result in (-1, None, ctypes.c_void_p(-1).value):
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))
    return result


def sleep_for_ever():
    while True:
        time.sleep(3600)


def linger():
    time.sleep(LIFETIME_S)
    os._exit(0)


def take_name():
    LIBC.prctl(15, b"fy-orphan", 0, 0, 0)  # needs no /proc


def leave(child):
    """Runs `child` in a process of another session that has another parent."""
    first = os.fork()
    if first == 0:
        try:  # whatever happens, this process must not go on as the planner
            os.setsid()
            if os.fork() == 0:
                take_name()
                child()
        finally:
            os._exit(0)
    os.waitpid(first, 0)


def in_child(action):
    """Tries something in a child; None, or why it failed."""
    child = os.fork()
    if child == 0:
        try:
            action()
            os._exit(0)
        except OSError as error:
            os._exit(error.errno or errno.EIO)
        finally:
            os._exit(errno.EIO)
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        return f"killed by signal {os.WTERMSIG(status)}"
    code = os.WEXITSTATUS(status)
    return os.strerror(code) if code else None


def touch(memory, size):
    for at in range(0, size, PAGE):
        memory[at] = 1


def scratch():
    return os.environ.get("TMPDIR") or "/tmp"


def fill(descriptor, size):
    """Writes until `size` or until refused; how much it was, and why no more."""
    block, written = b"x" * MIB, 0
    try:
        while written < size:
            written += os.write(descriptor, block)
    except OSError as error:
        return written, error
    return written, None


# ---- Time and ends ---------------------------------------------------------


@fault
def never(_):
    sleep_for_ever()


@fault
def spin(_):
    while True:
        pass


@fault
def ignore_sigterm(_):
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    sleep_for_ever()


@fault
def ignore_signals(_):
    for number in signal.valid_signals():
        try:
            signal.signal(number, signal.SIG_IGN)
        except OSError:
            pass  # SIGKILL and SIGSTOP
    signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    sleep_for_ever()


@fault
def crash(_):
    os.kill(os.getpid(), signal.SIGSEGV)


@fault
def abort(_):
    os.abort()


@fault
def exit_0(_):
    os._exit(0)


@fault
def exit_3(_):
    sys.exit(3)


@fault
def raises(_):
    raise RuntimeError("raised as asked")


@fault
def stack_overflow(_):
    sys.setrecursionlimit(1 << 30)

    class Deep:  # by way of C, where newer versions do not count
        def __repr__(self):
            return repr(self)

    repr(Deep())


# ---- Processes and threads -------------------------------------------------


@fault
def grandchild(call):
    def stay():
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
            signal.signal(number, signal.SIG_IGN)
        linger()

    leave(stay)
    call.log("left a grandchild behind")


@fault
def daemon(call):
    def stay():
        os.chdir("/")
        os.closerange(0, 1024)
        linger()

    leave(stay)
    call.log("left a daemon behind")


@fault
def comet(call):
    def fly():
        end = time.monotonic() + LIFETIME_S
        while time.monotonic() < end:
            if os.fork() > 0:
                os._exit(0)
        os._exit(0)

    leave(fly)
    call.log("sent a comet")


@fault
def fork_bomb(call):
    # Counting is not exact between processes, and need not be.
    counter = mmap.mmap(-1, PAGE)
    most, first = call.count(1000), os.getpid()
    end = time.monotonic() + LIFETIME_S
    while time.monotonic() < end:
        made = struct.unpack_from("I", counter)[0]
        if made >= most:
            time.sleep(0.01)
            continue
        try:
            if os.fork() == 0:
                take_name()
            else:
                struct.pack_into("I", counter, 0, struct.unpack_from("I", counter)[0] + 1)
        except OSError:
            time.sleep(0.001)
    if os.getpid() != first:
        os._exit(0)
    sleep_for_ever()


@fault
def double_fork_bomb(call):
    counter = mmap.mmap(-1, PAGE)
    most, first = call.count(1000), os.getpid()
    end = time.monotonic() + LIFETIME_S
    while time.monotonic() < end:
        if struct.unpack_from("I", counter)[0] >= most:
            time.sleep(0.01)
            continue
        try:
            if os.fork() == 0:
                try:
                    if os.fork() != 0:
                        os._exit(0)
                except OSError:
                    os._exit(1)
                take_name()
                struct.pack_into("I", counter, 0, struct.unpack_from("I", counter)[0] + 1)
        except OSError:
            time.sleep(0.001)
    if os.getpid() != first:
        os._exit(0)
    sleep_for_ever()


@fault
def thread_bomb(call):
    threading.stack_size(1 << 16)
    most, made = call.count(5000), 0
    try:
        while made < most:
            threading.Thread(target=sleep_for_ever, daemon=True).start()
            made += 1
    except (RuntimeError, MemoryError):
        pass
    call.metric("obtained", made)
    while True:
        time.sleep(0.001)
        try:
            if made < most:
                threading.Thread(target=sleep_for_ever, daemon=True).start()
                made += 1
        except (RuntimeError, MemoryError):
            pass


@fault
def spin_processes(call):
    for _ in range(call.count(16)):
        if os.fork() == 0:
            take_name()
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(LIFETIME_S)
            while True:
                pass
    sleep_for_ever()


@fault
def short_children(call):
    """Children that end before anybody looks, and whose end nobody is told."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    for _ in range(call.count(100)):
        child = os.fork()
        if child == 0:
            begin = time.process_time()
            while time.process_time() < begin + 0.003:
                pass
            os._exit(0)
        with contextlib.suppress(ChildProcessError):
            os.waitpid(child, 0)
        time.sleep(0.001)


@fault
def works_between_calls(_):
    """A child goes on when nobody asks."""
    if os.fork() == 0:
        take_name()
        end = time.monotonic() + LIFETIME_S
        while time.monotonic() < end:
            pass
        os._exit(0)


@fault
def re_rolls(_):
    """Four children want the core at a time, and then nobody does: it waited, as it seems."""
    for _ in range(4):
        if os.fork() == 0:
            take_name()
            while time.process_time() < 0.03:
                pass
            linger()
    time.sleep(0.3)


@fault
def autoreaped_children(call):
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    wanted, made = call.count(200), 0
    try:
        while made < wanted:
            child = os.fork()
            if child == 0:
                take_name()
                while time.process_time() < 0.015:
                    pass
                os._exit(0)
            made += 1
            with contextlib.suppress(ChildProcessError):
                os.waitpid(child, 0)
    except OSError as error:
        return call.took(made, wanted, "children that nobody is told of", error)
    return call.took(made, wanted, "children that nobody is told of")


# ---- Memory ----------------------------------------------------------------


@fault
def hog(_):
    memory = []
    while True:
        memory.append(bytearray(b"x") * (64 * MIB))


@fault
def allocate(call):
    size = call.size(8 * GIB)
    try:
        with mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS) as memory:
            touch(memory, size)
    except OSError as error:
        return call.took(0, size, "memory", error)
    return call.took(size, size, "memory")


def sixteen(call, shared, each, total):
    """Sixteen children touch `each` bytes, and hold them for half a second together."""
    done = mmap.mmap(-1, PAGE)
    children = []
    try:
        for index in range(16):
            child = os.fork()
            if child == 0:
                try:
                    take_name()
                    private = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
                    memory = shared or mmap.mmap(-1, each, flags=private)
                    touch(memory, each)
                    done[index] = 1
                    linger()
                finally:
                    os._exit(1)
            children.append(child)
    except OSError:
        pass  # as many as may be
    end = time.monotonic() + 20
    while sum(done[:16]) < 16 and time.monotonic() < end:
        time.sleep(0.01)
    time.sleep(0.5)
    holding = sum(done[:16])
    for child in children:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    call.took(total // 16 * holding, total // 16 * 16, "memory of sixteen processes")


@fault
def allocate_many(call):
    size = call.size(8 * GIB)
    sixteen(call, None, size // 16, size)


@fault
def shared_memory(call):
    size = call.size(256 * MIB)
    try:
        memory = mmap.mmap(-1, size)
    except OSError as error:
        return call.took(0, size, "shared memory", error)
    return sixteen(call, memory, size, size)


@fault
def shared_anonymous(call):
    size, pieces = call.size(8 * GIB), []
    try:
        while len(pieces) * 16 * MIB < size:
            pieces.append(mmap.mmap(-1, 16 * MIB))
            touch(pieces[-1], 16 * MIB)
            pieces[-1].madvise(mmap.MADV_DONTNEED)
    except OSError as error:
        return call.took(len(pieces) * 16 * MIB, size, "shared memory", error)
    time.sleep(0.5)
    return call.took(size, size, "shared memory without pages of a process")


@fault
def memfd(call):
    size = call.size(8 * GIB)
    try:
        descriptor = os.memfd_create("faulty")
    except OSError as error:
        return call.took(0, size, "memfd", error)
    got, why = fill(descriptor, size)
    os.close(descriptor)
    return call.took(got, size, "memfd", why)


@fault
def posix_shm(call):
    size, path = call.size(8 * GIB), f"/dev/shm/fy-hog-{os.getpid()}"
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        return call.took(0, size, "/dev/shm", error)
    os.unlink(path)
    got, why = fill(descriptor, size)
    os.close(descriptor)
    return call.took(got, size, "/dev/shm", why)


IPC_CREAT, IPC_PRIVATE, IPC_RMID = 0o1000, 0, 0


@fault
def sysv_shm(call):
    size = call.size(8 * GIB)
    try:
        segment = checked(LIBC.shmget(IPC_PRIVATE, ctypes.c_size_t(size), IPC_CREAT | 0o600))
        memory = LIBC.shmat(segment, None, 0)
        code = ctypes.get_errno()
        LIBC.shmctl(segment, IPC_RMID, None)  # once nobody uses it
        ctypes.set_errno(code)
        checked(memory)
    except OSError as error:
        return call.took(0, size, "System V shared memory", error)
    touch((ctypes.c_ubyte * size).from_address(memory), size)
    LIBC.shmdt(ctypes.c_void_p(memory))
    return call.took(size, size, "System V shared memory")


@fault
def leaves_shm(call):
    key = call.size(0x66796C64)
    segment = LIBC.shmget(key, ctypes.c_size_t(PAGE), IPC_CREAT | 0o600) >= 0
    call.metric("segment", int(segment))
    reached = segment or "refused"
    try:
        with open("/dev/shm/fy-left", "w", encoding="ascii") as file:
            file.write("left\n")
        reached = True
    except OSError:
        pass  # the segment may be there
    call.report(reached, "memory that stays")


# ---- Output ----------------------------------------------------------------


@fault
def garbage(call):
    call.write(b"solving...\n\xff\xfe\n\n  3 agents left\n[1,2\n")
    os.write(2, b"\xff\xfe on standard error\n")


LINES = (b"x" * 127 + b"\n") * 512


@fault
def flood(call):
    for _ in range(0, call.size(GIB), len(LINES)):
        call.write(LINES)


@fault
def flood_stderr(call):
    for _ in range(0, call.size(GIB), len(LINES)):
        os.write(2, LINES)


@fault
def log_flood(call):
    for _ in range(0, call.size(GIB), 1024):
        call.log("x" * 1024)


@fault
def nan(call):
    call.write(b'{"jsonrpc":"2.0","method":"metric","params":{"name":"x","value":NaN}}\n')


@fault
def negative_expansions(call):
    call.notify("metric", name="expansions", value=-5)


@fault
def half_node(call):
    call.notify("metric", name="nodes", value=0.5)


def annotate(call, **about):
    call.notify("annotation", **{"layer": "mischief", "shape": "places", "places": [[0, 1]], **about})


@fault
def annotation_flood(call):
    for _ in range(call.count(50000)):
        annotate(call)


@fault
def annotation_outside(call):
    annotate(call, places=[[0], [1 << 30]])


@fault
def annotation_shape(call):
    annotate(call, shape="cube")


@fault
def malformed(call):
    call.write(b'{"jsonrpc":"2.0","id":,"result"}\n')
    sleep_for_ever()


@fault
def no_version(call):
    call.write(b'{"id":%d,"result":{"status":"solved"}}\n' % call.request)
    sleep_for_ever()


@fault
def batch(call):
    call.write(b'[{"jsonrpc":"2.0","id":%d,"result":{"status":"solved"}}]\n' % call.request)
    sleep_for_ever()


@fault
def not_utf8(call):
    text = b'{"jsonrpc":"2.0","method":"log","params":{"level":"info","text":"\xff\xfe"}}\n'
    call.write(text)
    sleep_for_ever()


@fault
def deep(call):
    call.write(b'{"jsonrpc":"2.0","id":%d,"result":' % call.request)
    call.write(b"[" * 10**6 + b"]" * 10**6 + b"}\n")
    sleep_for_ever()


@fault
def wrong_id(call):
    answer = b'{"jsonrpc":"2.0","id":%d,"result":{"status":"solved"}}\n'
    call.write(answer % (call.request + 1000))
    sleep_for_ever()


@fault
def partial(call):
    call.write(b'{"jsonrpc":"2.0","id":%d,"resu' % call.request)
    sleep_for_ever()


@fault
def long_line(call):
    call.write(b'{"jsonrpc":"2.0","id":%d,"result":"' % call.request)
    for _ in range(0, 2 * call.size(GIB), MIB):
        call.write(b"x" * MIB)
    sleep_for_ever()


@fault
def request(call):
    call.write(b'{"jsonrpc":"2.0","id":1,"method":"plan","params":{}}\n')
    sleep_for_ever()


@fault
def no_message(call):
    call.write(b'{"jsonrpc":"2.0"}\n')
    sleep_for_ever()


@fault
def closes_stdout(_):
    os.close(1)
    sleep_for_ever()


@fault
def closes_stdin(_):
    os.close(0)


@fault
def closes_stdio(_):
    os.closerange(0, 3)
    sleep_for_ever()


@fault
def closes_everything(_):
    os.closerange(0, 1024)
    sleep_for_ever()


# ---- Files -----------------------------------------------------------------


def fill_file(call, unlinked):
    size, path = call.size(GIB), f"{scratch()}/fy-huge-{os.getpid()}"
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    except OSError as error:
        return call.took(0, size, path, error)
    if unlinked:
        os.unlink(path)
    got, why = fill(descriptor, size)
    call.took(got, size, path, why)
    if unlinked:
        time.sleep(0.5)  # it takes room as long as it is open
    return os.close(descriptor)


@fault
def huge_file(call):
    fill_file(call, unlinked=False)


@fault
def unlinked_file(call):
    fill_file(call, unlinked=True)


@fault
def many_files(call):
    wanted, made, why = call.count(100000), 0, None
    folder = f"{scratch()}/fy-many-{os.getpid()}"
    try:
        os.mkdir(folder, 0o700)
        while made < wanted:
            with open(f"{folder}/{made}", "wb") as file:
                file.write(b"x")
            made += 1
    except OSError as error:
        why = error
    call.took(made, wanted, folder, why)


@fault
def write_outside(call):
    def append(path):
        with open(path, "ab") as file:
            file.write(b"faulty was here\n")

    path = call.target or "/var/tmp/fy-outside"
    call.attempt(path, lambda: append(path))


@fault
def remove_outside(call):
    path = call.target or "/var/tmp/fy-outside"
    call.attempt(path, lambda: os.unlink(path))


@fault
def read_file(call):
    def read(path):
        with open(path, "rb") as file:
            return None if file.read(1) else "it is empty"

    path = call.target or "/etc/shadow"
    call.attempt(path, lambda: read(path))


@fault
def list_folder(call):
    def entries(path):
        found = len(os.listdir(path))
        call.metric("entries", found)
        return None if found else "it is empty"  # put in its place

    try:
        home = pwd.getpwuid(os.getuid()).pw_dir
    except KeyError:
        home = "/root"
    path = call.target or home
    call.attempt(path, lambda: entries(path))


@fault
def kernel_files(call):
    paths = """/proc/sysrq-trigger /proc/sys/kernel/core_pattern /proc/sys/kernel/hostname
        /dev/mem /dev/kmsg /proc/1/oom_score_adj /dev/vda /dev/sda /dev/nvme0n1
        /sys/power/state /sys/fs/cgroup/cgroup.procs""".split()
    for path in paths:
        try:
            os.close(os.open(path, os.O_WRONLY))  # and writes nothing
        except OSError:
            continue
        return call.report(True, path)
    return call.report("refused", "files of the kernel")


@fault
def inherited(call):
    for descriptor in range(1024):
        try:
            if os.readlink(f"/proc/self/fd/{descriptor}") == call.target:
                return call.report(True, call.target)
        except OSError:
            continue
    return call.report("there is none", "an inherited descriptor")


@fault
def getenv(call):
    name = call.target or "HOST_SECRET"
    call.report(name in os.environ or "not set", name)


@fault
def read_environment(call):
    name = call.target or "HOST_SECRET"
    readable, found = 0, False
    for process in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{process}/environ", "rb") as file:
                variables = file.read().split(b"\0")
        except OSError:
            continue
        readable += 1
        found = found or any(v.startswith(name.encode() + b"=") for v in variables)
    call.metric("readable", readable)
    call.report(found or "not found", name)


# ---- Network ---------------------------------------------------------------


def connect(call, family, kind, address, what):
    def send():
        with socket.socket(family, kind) as connection:
            connection.settimeout(1)
            connection.connect(address)
            connection.send(b"faulty\n")

    call.attempt(what, send)


def connect_inet(call, kind):
    target = call.target or "127.0.0.1:9"
    host, _, port = target.rpartition(":")
    connect(call, socket.AF_INET, kind, (host, int(port)), target)


@fault
def connect_tcp(call):
    connect_inet(call, socket.SOCK_STREAM)


@fault
def connect_udp(call):
    connect_inet(call, socket.SOCK_DGRAM)


@fault
def connect_unix(call):
    path = call.target or "/run/fy-nobody"
    connect(call, socket.AF_UNIX, socket.SOCK_STREAM, path, path)


@fault
def connect_abstract(call):
    name = call.target or "fy-nobody"
    connect(call, socket.AF_UNIX, socket.SOCK_STREAM, "\0" + name, name)


# ---- Other processes -------------------------------------------------------


@fault
def kill_parent(call):
    def shoot():
        parent = os.getppid()
        if parent == 0:
            raise OSError(errno.ESRCH, "there is none")
        os.kill(parent, signal.SIGKILL)
        # The first process of a namespace can be sent it, and does not mind.
        for _ in range(20):
            if os.getppid() != parent:
                return None
            time.sleep(0.01)
        return "it is still there"

    call.attempt("the parent", shoot)


@fault
def kill_group(_):
    os.kill(0, signal.SIGKILL)


@fault
def kill_pid(call):
    call.attempt("another process", lambda: os.kill(call.pid, signal.SIGKILL))


@fault
def see_process(call):
    def look():
        if not os.path.exists(f"/proc/{call.pid}/stat"):
            try:
                os.kill(call.pid, 0)
            except PermissionError:
                pass  # it is there

    call.attempt("another process", look)


PTRACE_ATTACH, PTRACE_DETACH = 16, 17
WALL = 0x40000000


@fault
def ptrace(call):
    def attach():
        zero = ctypes.c_void_p(0)
        checked(LIBC.ptrace(PTRACE_ATTACH, call.pid, zero, zero))
        os.waitpid(call.pid, WALL)
        LIBC.ptrace(PTRACE_DETACH, call.pid, zero, zero)

    call.attempt("attaching to another process", attach)


def address_in(call):
    """`target`, or where a process has something for certain."""
    if call.target:
        return int(call.target, 0)
    with open(f"/proc/{call.pid}/maps", encoding="ascii") as maps:
        return int(maps.readline().split("-")[0], 16)


class Vector(ctypes.Structure):
    _fields_ = [("base", ctypes.c_void_p), ("length", ctypes.c_size_t)]


@fault
def read_memory(call):
    def read():
        room = ctypes.create_string_buffer(8)
        here = Vector(ctypes.addressof(room), 8)
        there = Vector(address_in(call), 8)
        one, no_flags = ctypes.c_ulong(1), ctypes.c_ulong(0)
        references = ctypes.byref(here), one, ctypes.byref(there), one
        checked(LIBC.process_vm_readv(call.pid, *references, no_flags))

    call.attempt("memory of another process", read)


@fault
def write_memory(call):
    path = f"/proc/{call.pid}/mem"

    def write():
        memory = os.open(path, os.O_RDWR)
        try:
            if call.target:
                os.pwrite(memory, b"faulty!\0", address_in(call))
        finally:
            os.close(memory)

    call.attempt(path, write)


@fault
def steal_descriptor(call):
    def steal():
        process = system_call(number_of("pidfd_open"), call.pid, 0)
        try:
            os.close(system_call(number_of("pidfd_getfd"), process, 0, 0))
        finally:
            os.close(process)

    call.attempt("a descriptor of another process", steal)


# ---- The kernel ------------------------------------------------------------

CLONE_NEWUSER, CLONE_NEWNS, MNT_DETACH = 0x10000000, 0x20000, 2


@fault
def unshare(call):
    why = in_child(lambda: checked(LIBC.unshare(CLONE_NEWUSER)))
    call.report(why or True, "a user namespace")


def try_mount():
    folder = tempfile.mkdtemp(prefix="fy-mount-", dir=scratch())
    try:
        path = folder.encode()
        checked(LIBC.mount(b"faulty", path, b"tmpfs", ctypes.c_ulong(0), b"size=4k"))
        LIBC.umount2(path, MNT_DETACH)
    finally:
        os.rmdir(folder)


@fault
def mount(call):
    def in_namespace():
        checked(LIBC.unshare(CLONE_NEWUSER | CLONE_NEWNS))
        try_mount()

    call.report((in_child(try_mount) and in_child(in_namespace)) or True, "mounting")


def descriptor_of(name, *arguments):
    os.close(system_call(number_of(name), *arguments))


@fault
def io_uring(call):
    parameters = ctypes.create_string_buffer(120)
    call.attempt("io_uring", lambda: descriptor_of("io_uring_setup", 4, parameters))


@fault
def inotify(call):
    """Hears who reads the system's programs, and uses up what all programs of the user share."""

    def watch():
        descriptor = checked(LIBC.inotify_init1(os.O_CLOEXEC))
        try:
            checked(LIBC.inotify_add_watch(descriptor, b"/usr", 0xFFF))
        finally:
            os.close(descriptor)

    call.attempt("inotify", watch)


@fault
def locks_granted(call):
    """Advice between programs that agree on it: whoever may read a file may hold it."""

    def lock():
        with open("/etc/passwd") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)

    call.attempt("a lock", lock)


@fault
def bpf(call):
    # BPF_MAP_CREATE: an array of one entry of four bytes.
    array = ctypes.create_string_buffer(struct.pack("4I", 2, 4, 4, 1), 72)
    call.attempt("bpf", lambda: descriptor_of("bpf", 0, array, 72))


@fault
def perf_event(call):
    # Software event, 64 bytes, the clock of the CPU, outside of the kernel only.
    fields = struct.pack("IIQQQQQ", 1, 64, 0, 0, 0, 0, 1 << 5)
    event = ctypes.create_string_buffer(fields, 64)
    action = lambda: descriptor_of("perf_event_open", event, 0, -1, -1, 0)  # noqa: E731
    call.attempt("perf events", action)


@fault
def userfaultfd(call):
    flags = os.O_CLOEXEC | 1  # for user mode only
    call.attempt("userfaultfd", lambda: descriptor_of("userfaultfd", flags))


@fault
def keyctl(call):
    def keyring():
        system_call(number_of("keyctl"), 0, -3, 0)

    call.attempt("the session's keyring", keyring)


@fault
def x32(call):
    def get_pid():
        if platform.machine() != "x86_64":
            raise OSError(errno.ENOSYS, "not on this machine")
        system_call(0x40000000 + 39)

    call.report(in_child(get_pid) or True, "a system call of x32")


@fault
def repin(call):
    before = os.sched_getaffinity(0)

    def spread():
        os.sched_setaffinity(0, range(1024))
        after = os.sched_getaffinity(0)
        call.metric("cores-after", len(after))
        return None if len(after) > len(before) else "it had them all"

    call.metric("cores-before", len(before))
    call.attempt("more cores", spread)


@fault
def realtime(call):
    def better():
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        except OSError:
            os.setpriority(os.PRIO_PROCESS, 0, -1)

    call.attempt("a better priority", better)


@fault
def raise_limits(call):
    names = "AS CPU FSIZE NPROC STACK NOFILE CORE MEMLOCK".split()
    reached = "nothing is limited"
    for name in names:
        which = getattr(resource, f"RLIMIT_{name}")
        soft, hard = resource.getrlimit(which)
        if hard == resource.RLIM_INFINITY:
            continue
        try:
            resource.setrlimit(which, (soft, hard + 1))
            reached = True
        except (OSError, ValueError) as error:
            reached = True if reached is True else error
    call.report(reached, "a higher limit")


# ---- After the answer ------------------------------------------------------


def crash_later():
    def later():
        time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGSEGV)

    threading.Thread(target=later, daemon=True).start()


def thread_raises():
    """An exception in a thread: Python prints it, and nothing else comes of it."""

    def work():
        raise RuntimeError("raised in a thread, as asked")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
