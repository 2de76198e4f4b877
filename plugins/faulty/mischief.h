/* What a faulty plugin does to its process, to the machine and to others, and how it
 * tries to get out of its sandbox. A part of faulty.c, not a header for others.
 *
 * Three sorts: faults that do not return; faults that take something without end and
 * stop where they are refused; and attempts, which say in the metric `reached` whether
 * they got what they tried, 1 or 0, and why not in the log. After both of the latter
 * the planner goes on and is honest.
 *
 * A fixture has to be survived by hosts that do not contain it yet: what is left
 * behind ends by itself after LIFETIME_S, bombs stop growing at `count`, nothing is
 * written over, and no attempt has an effect that lasts.
 */

#define LIFETIME_S 120
#define MIB (UINT64_C(1) << 20)
#define GIB (UINT64_C(1) << 30)

/* Of nothing but these; the rest of the names stands in faulty.c. */
#define MISCHIEF(F)                                                                    \
  /* time and ends */                                                                  \
  F("never", never) F("spin", spin) F("ignore-sigterm", ignore_sigterm)                \
  F("ignore-signals", ignore_signals) F("crash", crash) F("abort", abort_now)          \
  F("exit-0", exit_0) F("exit-3", exit_3) F("stack-overflow", stack_overflow)          \
  /* processes and threads */                                                          \
  F("grandchild", leave_grandchild) F("daemon", leave_daemon) F("comet", comet)        \
  F("fork-bomb", fork_bomb) F("thread-bomb", thread_bomb)                              \
  F("double-fork-bomb", double_fork_bomb) F("spin-processes", spin_processes)          \
  F("autoreaped-children", autoreaped_children) F("no-child-wait", no_child_wait)      \
  /* memory */                                                                         \
  F("hog", hog) F("allocate", allocate) F("allocate-many", allocate_many)              \
  F("shared-memory", shared_memory) F("memfd", memfd) F("posix-shm", posix_shm)        \
  F("sysv-shm", sysv_shm) F("leaves-shm", leaves_shm)                                  \
  F("shared-anonymous", shared_anonymous) F("page-tables", page_tables)                \
  F("socket-buffers", socket_buffers) F("pipe-buffers", pipe_buffers)                  \
  F("headless", headless)                                                              \
  /* output */                                                                         \
  F("garbage", garbage) F("flood", flood) F("flood-stderr", flood_stderr)              \
  F("log-flood", log_flood) F("nan", nan_metric) F("partial", partial)                 \
  F("negative-expansions", negative_expansions) F("half-node", half_node)              \
  F("nan-bound", nan_bound) F("annotation-flood", annotation_flood)                    \
  F("annotation-outside", annotation_outside) F("annotation-shape", annotation_shape)  \
  F("annotation-nan", annotation_nan) F("annotation-offsets", annotation_offsets)      \
  F("annotation-count", annotation_count)                                              \
  F("wrong-id", wrong_id) F("closes-stdio", closes_stdio)                              \
  F("closes-everything", closes_everything)                                            \
  /* files */                                                                          \
  F("huge-file", huge_file) F("unlinked-file", unlinked_file)                          \
  F("many-files", many_files) F("closed-folders", closed_folders)                      \
  F("write-outside", write_outside)                                                    \
  F("remove-outside", remove_outside) F("read-file", read_file)                        \
  F("list-folder", list_folder) F("kernel-files", kernel_files)                        \
  F("inherited", inherited) F("getenv", own_environment)                               \
  F("read-environment", other_environments)                                            \
  /* network */                                                                        \
  F("connect-tcp", connect_tcp) F("connect-udp", connect_udp)                          \
  F("connect-unix", connect_unix) F("connect-abstract", connect_abstract)              \
  F("socketpair-netlink", socketpair_netlink)                                          \
  F("socketpair-datagram", socketpair_datagram)                                        \
  /* other processes */                                                                \
  F("kill-parent", kill_parent) F("kill-group", kill_group) F("kill-pid", kill_pid)    \
  F("see-process", see_process) F("ptrace", attach) F("read-memory", read_memory)      \
  F("write-memory", write_memory) F("steal-descriptor", steal_descriptor)              \
  F("limit-supervisor", limit_supervisor) F("limit-host", limit_host)                  \
  F("priority-of-others", priority_of_others) F("signal-by-file", signal_by_file)      \
  F("lease", lease) F("kill-all", kill_all)                                            \
  /* the kernel */                                                                     \
  F("unshare", unshare_user) F("mount", mount_tmpfs) F("io-uring", io_uring)           \
  F("inotify", watch_files) F("locks-granted", lock_granted)                           \
  F("bpf", bpf) F("perf-event", perf_event) F("userfaultfd", user_fault)               \
  F("keyctl", keyctl) F("x32", x32) F("int80", int80) F("repin", repin)                \
  F("realtime", realtime) F("raise-limits", raise_limits) F("aio", aio)                \
  F("personality", old_personality) F("memory-policy", memory_policy)                  \
  F("seccomp-listener", seccomp_listener) F("new-calls", new_calls)                    \
  F("undumpable", undumpable) F("oom-score", oom_score) F("proc-files", proc_files)\
  /* its process */                                                                    \
  F("leaves-ftz", leaves_ftz) F("leaves-rounding", leaves_rounding)                    \
  F("leaves-traps", leaves_traps) F("leaves-umask", leaves_umask)                      \
  F("leaves-cwd", leaves_cwd) F("leaves-signals", leaves_signals)                      \
  F("leaves-locale", leaves_locale) F("leaves-limits", leaves_limits)                  \
  F("leaves-environment", leaves_environment) F("leaves-timer", leaves_timer)          \
  F("leaves-streams", leaves_streams) F("leaves-thread", leaves_thread)

/* ---- Help for the faults --------------------------------------------------- */

static void say(const FleetyardSink *sink, const char *text) {
  sink->log(sink->context, FLEETYARD_LOG_INFO,
            (FleetyardStr){text, strlen(text)});
}

static void metric(const FleetyardSink *sink, const char *name, double value) {
  sink->metric(sink->context, (FleetyardStr){name, strlen(name)}, value);
}

/* The outcome of an attempt at `what`; when it failed, errno says why. */
static void report(const FleetyardSink *sink, bool reached, const char *what) {
  char text[256];
  snprintf(text, sizeof text, "%.160s: %s", what, reached ? "reached" : strerror(errno));
  say(sink, text);
  metric(sink, "reached", reached);
}

static uint64_t or_else(uint64_t value, uint64_t otherwise) {
  return value ? value : otherwise;
}

static double now_s(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

static void sleep_s(double seconds) {
  struct timespec length = {(time_t)seconds, (long)((seconds - (double)(time_t)seconds) * 1e9)};
  while (nanosleep(&length, &length) != 0)
    continue;
}

static void sleep_for_ever(void) {
  for (;;)
    sleep_s(3600);
}

/* What something that was left behind does. */
static void linger(void) {
  sleep_s(LIFETIME_S);
  _exit(0);
}

/* Tests look for what is left behind by this name. */
static void take_name(void) { prctl(PR_SET_NAME, "fy-orphan"); }

/* Writes to every page. */
static void touch(char *memory, uint64_t size) {
  for (uint64_t at = 0; at < size; at += 4096)
    ((volatile char *)memory)[at] = 1;
}

static char *anonymous(uint64_t size, int sharing) {
  char *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, sharing | MAP_ANONYMOUS, -1, 0);
  return memory == MAP_FAILED ? NULL : memory;
}

/* A counter that processes share. */
static _Atomic uint32_t *shared_counter(void) {
  return (_Atomic uint32_t *)(void *)anonymous(4096, MAP_SHARED);
}

static const char *scratch(void) {
  const char *folder = getenv("TMPDIR");
  return folder && *folder ? folder : "/tmp";
}

/* Writes until `size` or until refused; how much it was. */
static uint64_t fill(int descriptor, uint64_t size) {
  static char block[1 << 20];
  memset(block, 'x', sizeof block);
  uint64_t written = 0;
  while (written < size) {
    ssize_t done = write(descriptor, block, sizeof block);
    if (done < 0 && errno == EINTR)
      continue;
    if (done <= 0)
      break;
    written += (uint64_t)done;
  }
  return written;
}

/* The outcome of taking `wanted` of something. */
static void took(const FleetyardSink *sink, uint64_t got, uint64_t wanted, const char *what) {
  int reason = errno;
  metric(sink, "obtained", (double)got);
  errno = reason;
  report(sink, got >= wanted, what);
}

/* Lets a child try something and returns what it returns, 0 for success, or an errno:
 * for what would change this process or could end it. */
static int in_child(int (*attempt)(void)) {
  pid_t child = fork();
  if (child < 0)
    return errno;
  if (child == 0)
    _exit(attempt());
  int status;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR)
      return errno;
  /* Killed for it, by a filter of system calls, say. */
  return WIFEXITED(status) ? WEXITSTATUS(status) : ENOSYS;
}

static void report_child(const FleetyardSink *sink, int code, const char *what) {
  errno = code;
  report(sink, code == 0, what);
}

/* ---- Time and ends --------------------------------------------------------- */

static void never(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  sleep_for_ever();
}

static void spin(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  for (volatile uint64_t turns = 0;; turns++)
    continue;
}

static void ignore_sigterm(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  signal(SIGTERM, SIG_IGN);
  signal(SIGINT, SIG_IGN);
  signal(SIGHUP, SIG_IGN);
  sleep_for_ever();
}

static void ignore_signals(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  for (int number = 1; number <= 64; number++)
    signal(number, SIG_IGN);
  sigset_t all;
  sigfillset(&all);
  sigprocmask(SIG_BLOCK, &all, NULL);
  sleep_for_ever();
}

static void crash(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  volatile int *volatile nowhere = NULL; /* so that no compiler sees it coming */
  *nowhere = 1;
}

static void abort_now(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  abort();
}

static void exit_0(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  _exit(0);
}

static void exit_3(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  exit(3);
}

static uint64_t deeper(uint64_t depth) {
  volatile char room[4096];
  room[depth % sizeof room] = (char)depth;
  /* Both calls, so that none is the last thing it does. */
  return depth == UINT64_MAX ? 0 : deeper(depth + 1) + (uint64_t)room[0];
}

static void stack_overflow(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  metric(sink, "depth", (double)deeper(0));
}

/* ---- Processes and threads ------------------------------------------------- */

/* Leaves a process behind that is in another session, has another parent, ignores
 * polite signals and keeps the pipes open. */
static void leave_grandchild(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  pid_t child = fork();
  if (child == 0) {
    setsid();
    if (fork() != 0)
      _exit(0);
    take_name();
    signal(SIGTERM, SIG_IGN);
    signal(SIGHUP, SIG_IGN);
    signal(SIGPIPE, SIG_IGN);
    linger();
  }
  say(sink, child > 0 ? "left a grandchild behind" : "could not fork");
}

/* As daemons do it: another session, another folder, no descriptor of the host's. */
static void leave_daemon(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  pid_t child = fork();
  if (child == 0) {
    setsid();
    if (fork() != 0)
      _exit(0);
    take_name();
    if (chdir("/") != 0)
      errno = 0;
    for (int descriptor = 0; descriptor < 1024; descriptor++)
      close(descriptor);
    linger();
  }
  if (child > 0)
    while (waitpid(child, NULL, 0) < 0 && errno == EINTR)
      continue;
  say(sink, child > 0 ? "left a daemon behind" : "could not fork");
}

/* A process that is never the same one for long: each forks the next and ends. Whoever
 * lists processes and then kills them comes too late. */
static void comet(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  pid_t child = fork();
  if (child == 0) {
    setsid();
    take_name();
    double end = now_s() + LIFETIME_S;
    while (now_s() < end) {
      if (fork() > 0)
        _exit(0);
      usleep(100);
    }
    _exit(0);
  }
  say(sink, child > 0 ? "sent a comet" : "could not fork");
}

/* Everybody forks until there are `count`, and goes on trying where that is refused.
 * `twice` goes by children that end at once and that nobody waits for: what is left is
 * somebody else's child, or dead and still counted by the kernel. */
static void bomb(const Faulty *faulty, bool twice) {
  uint32_t most = (uint32_t)or_else(faulty->count, 1000);
  _Atomic uint32_t *counter = shared_counter();
  double end = now_s() + LIFETIME_S;
  pid_t first = getpid();
  while (counter && now_s() < end) {
    if (*counter >= most) {
      usleep(10000);
      continue;
    }
    pid_t child = fork();
    if (child == 0) {
      if (twice && fork() != 0)
        _exit(0);
      ++*counter;
      take_name();
    }
    if (child < 0)
      usleep(1000);
  }
  if (getpid() != first)
    _exit(0);
  sleep_for_ever();
}

static void fork_bomb(const Faulty *faulty, const FleetyardSink *sink) {
  (void)sink;
  bomb(faulty, false);
}

static void double_fork_bomb(const Faulty *faulty, const FleetyardSink *sink) {
  (void)sink;
  bomb(faulty, true);
}

static void *lingering_thread(void *unused) {
  (void)unused;
  sleep_for_ever();
  return NULL;
}

static void thread_bomb(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t most = or_else(faulty->count, 5000), threads = 0;
  bool refused = false;
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, 1 << 16);
  for (;;) {
    pthread_t thread;
    if (threads < most && pthread_create(&thread, &attributes, lingering_thread, NULL) == 0) {
      pthread_detach(thread);
      threads++;
    } else {
      if (!refused)
        metric(sink, "obtained", (double)threads);
      refused = true;
      usleep(1000);
    }
  }
}

/* As much CPU time as there are cores, none of it in this process. */
static void spin_processes(const Faulty *faulty, const FleetyardSink *sink) {
  (void)sink;
  uint64_t wanted = or_else(faulty->count, 16);
  for (uint64_t number = 0; number < wanted; number++)
    if (fork() == 0) {
      take_name();
      signal(SIGALRM, SIG_DFL);
      alarm(LIFETIME_S);
      spin(faulty, sink);
    }
  sleep_for_ever();
}

static double processor_time_s(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

/* Children of 15 ms of CPU time each, `count` one after the other, whose end nobody is
 * told: the kernel forgets what they used. */
static void forgotten_children(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t wanted = or_else(faulty->count, 200), made = 0;
  for (; made < wanted; made++) {
    pid_t child = fork();
    if (child < 0)
      break;
    if (child == 0) {
      take_name();
      while (processor_time_s() < 0.015)
        continue;
      _exit(0);
    }
    while (waitpid(child, NULL, 0) < 0 && errno == EINTR)
      continue;
  }
  took(sink, made, wanted, "children that nobody is told of");
}

static void autoreaped_children(const Faulty *faulty, const FleetyardSink *sink) {
  signal(SIGCHLD, SIG_IGN);
  forgotten_children(faulty, sink);
}

static void do_nothing(int number) { (void)number; }

static void no_child_wait(const Faulty *faulty, const FleetyardSink *sink) {
  struct sigaction action = {.sa_handler = do_nothing, .sa_flags = SA_NOCLDWAIT | SA_RESTART};
  sigaction(SIGCHLD, &action, NULL);
  forgotten_children(faulty, sink);
}

/* ---- Memory ---------------------------------------------------------------- */

static void hog(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  for (;;) {
    char *memory = malloc(64 * MIB);
    if (!memory)
      abort();
    memset(memory, 1, 64 * MIB);
  }
}

static void allocate(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t size = or_else(faulty->size, 8 * GIB);
  char *memory = anonymous(size, MAP_PRIVATE);
  if (memory) {
    touch(memory, size);
    took(sink, size, size, "memory");
    munmap(memory, size);
  } else {
    took(sink, 0, size, "memory");
  }
}

/* Sixteen children that each touch `each` bytes, of `shared` or of their own, and hold
 * them for half a second together. */
static void sixteen(const FleetyardSink *sink, char *shared, uint64_t each, uint64_t total) {
  enum { CHILDREN = 16 };
  _Atomic uint32_t *done = shared_counter();
  pid_t children[CHILDREN];
  for (int child = 0; child < CHILDREN; child++) {
    children[child] = done ? fork() : -1;
    if (children[child] == 0) {
      take_name();
      char *memory = shared ? shared : anonymous(each, MAP_PRIVATE);
      if (!memory)
        _exit(1);
      touch(memory, each);
      ++*done;
      linger();
    }
  }
  for (double end = now_s() + 20; done && *done < CHILDREN && now_s() < end;)
    sleep_s(0.01);
  sleep_s(0.5);
  uint32_t holding = done ? *done : 0;
  for (int child = 0; child < CHILDREN; child++)
    if (children[child] > 0) {
      kill(children[child], SIGKILL);
      waitpid(children[child], NULL, 0);
    }
  errno = ENOMEM;
  took(sink, total / CHILDREN * holding, total / CHILDREN * CHILDREN, "memory of sixteen processes");
}

/* Too much together, not too much each. */
static void allocate_many(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t size = or_else(faulty->size, 8 * GIB);
  sixteen(sink, NULL, size / 16, size);
}

/* The same memory sixteen times: it counts once. */
static void shared_memory(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t size = or_else(faulty->size, 256 * MIB);
  char *memory = anonymous(size, MAP_SHARED);
  if (!memory) {
    took(sink, 0, size, "shared memory");
    return;
  }
  sixteen(sink, memory, size, size);
  munmap(memory, size);
}

static void memfd(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t size = or_else(faulty->size, 8 * GIB);
  int descriptor = memfd_create("faulty", MFD_CLOEXEC);
  took(sink, descriptor < 0 ? 0 : fill(descriptor, size), size, "memfd");
  if (descriptor >= 0)
    close(descriptor);
}

static void posix_shm(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t size = or_else(faulty->size, 8 * GIB);
  char path[64];
  snprintf(path, sizeof path, "/dev/shm/fy-hog-%ld", (long)getpid());
  int descriptor = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (descriptor >= 0)
    unlink(path);
  took(sink, descriptor < 0 ? 0 : fill(descriptor, size), size, "/dev/shm");
  if (descriptor >= 0)
    close(descriptor);
}

static void sysv_shm(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t size = or_else(faulty->size, 8 * GIB);
  int segment = shmget(IPC_PRIVATE, size, IPC_CREAT | 0600);
  char *memory = segment < 0 ? (char *)-1 : shmat(segment, NULL, 0);
  int reason = errno;
  if (segment >= 0)
    shmctl(segment, IPC_RMID, NULL); /* once nobody uses it */
  errno = reason;
  if (memory == (char *)-1) {
    took(sink, 0, size, "System V shared memory");
    return;
  }
  touch(memory, size);
  took(sink, size, size, "System V shared memory");
  shmdt(memory);
}

/* Long enough to be seen by whoever looks now and then. */
static void hold(void) { sleep_s(0.5); }

/* Shared memory whose pages the process gives back: they stay in the memory. */
static void shared_anonymous(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t size = or_else(faulty->size, 8 * GIB), got = 0;
  while (got < size) {
    char *memory = anonymous(16 * MIB, MAP_SHARED);
    if (!memory)
      break;
    touch(memory, 16 * MIB);
    madvise(memory, 16 * MIB, MADV_DONTNEED);
    got += 16 * MIB;
  }
  hold();
  took(sink, got, size, "shared memory without pages of a process");
}

/* Reads one byte of every table's worth of addresses: the page of zeros is nobody's, and
 * the tables are in no resident set. */
static void page_tables(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t size = or_else(faulty->size, GIB), tables = size / 4096;
  uint64_t reach = 2 * MIB; /* what a table of 4096 bytes maps */
  char *memory = mmap(NULL, tables * reach, PROT_READ,
                      MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) {
    took(sink, 0, size, "page tables");
    return;
  }
  madvise(memory, tables * reach, MADV_NOHUGEPAGE);
  for (uint64_t table = 0; table < tables; table++)
    (void)((volatile char *)memory)[table * reach];
  hold();
  took(sink, size, size, "page tables");
  munmap(memory, tables * reach);
}

/* Fills sockets or pipes, as many as processes may have, in as many processes as it
 * takes: what is in them is in no process. */
static void fill_buffers(const Faulty *faulty, const FleetyardSink *sink, bool sockets) {
  enum { CHILDREN = 48 };
  uint64_t size = or_else(faulty->size, GIB);
  _Atomic uint64_t *got = (_Atomic uint64_t *)(void *)anonymous(4096, MAP_SHARED);
  pid_t children[CHILDREN];
  int count = 0;
  for (; got && count < CHILDREN && got[0] < size; count++) {
    children[count] = fork();
    if (children[count] < 0)
      break;
    if (children[count] == 0) {
      take_name();
      int ends[2], most = 64 * (int)MIB;
      while (got[0] < size) {
        int made = sockets ? socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends)
                           : pipe2(ends, O_NONBLOCK);
        if (made != 0)
          break;
        for (int end = sockets ? 0 : 1; end < 2; end++) {
          if (sockets)
            setsockopt(ends[end], SOL_SOCKET, SO_SNDBUF, &most, sizeof most);
          got[0] += fill(ends[end], UINT64_MAX);
        }
      }
      ++got[1];
      linger();
    }
    for (double end = now_s() + 20; got[1] <= (uint64_t)count && now_s() < end;)
      sleep_s(0.005);
  }
  hold();
  uint64_t held = got ? got[0] : 0;
  while (count-- > 0) {
    kill(children[count], SIGKILL);
    waitpid(children[count], NULL, 0);
  }
  errno = EMFILE;
  took(sink, held, size, sockets ? "buffers of sockets" : "buffers of pipes");
}

static void socket_buffers(const Faulty *faulty, const FleetyardSink *sink) {
  fill_buffers(faulty, sink, true);
}

static void pipe_buffers(const Faulty *faulty, const FleetyardSink *sink) {
  fill_buffers(faulty, sink, false);
}

/* What the thread of a process has whose first thread has ended. */
static struct {
  uint64_t size;
  _Atomic uint32_t *done;
} left_alone;

static void *take_memory(void *unused) {
  (void)unused;
  char *memory = anonymous(left_alone.size, MAP_PRIVATE);
  if (!memory)
    _exit(1);
  touch(memory, left_alone.size);
  ++*left_alone.done;
  linger();
  return NULL;
}

/* Memory of a process whose first thread has ended: it looks dead, and without any. */
static void headless(const Faulty *faulty, const FleetyardSink *sink) {
  left_alone.size = or_else(faulty->size, 8 * GIB);
  left_alone.done = shared_counter();
  pid_t child = left_alone.done ? fork() : -1;
  if (child == 0) {
    take_name();
    pthread_t thread;
    if (pthread_create(&thread, NULL, take_memory, NULL) != 0)
      _exit(1);
    syscall(SYS_exit, 0);
  }
  for (double end = now_s() + 20; child > 0 && *left_alone.done == 0 && now_s() < end;)
    sleep_s(0.01);
  hold();
  bool done = child > 0 && *left_alone.done > 0;
  if (child > 0) {
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
  }
  errno = ENOMEM;
  took(sink, done ? left_alone.size : 0, left_alone.size, "memory without a first thread");
}

/* What outlives every process: it has to go with the namespace, or not to come about. */
static void leaves_shm(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t key = faulty->size ? faulty->size : 0x66796c64; /* "fyld" */
  bool segment = shmget((key_t)key, 4096, IPC_CREAT | 0600) >= 0;
  int descriptor = open("/dev/shm/fy-left", O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  bool file = descriptor >= 0 && write(descriptor, "left\n", 5) == 5;
  if (descriptor >= 0)
    close(descriptor);
  metric(sink, "segment", segment);
  report(sink, segment || file, "memory that stays");
}

/* ---- Output ---------------------------------------------------------------- */

static void garbage(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  static const char lines[] = "solving...\n{\"jsonrpc\":\"2.0\",\n\xff\xfe\n[1,2\n";
  if (write(1, lines, sizeof lines - 1) < 0 || write(2, lines, sizeof lines - 1) < 0)
    say(sink, "could not write garbage");
}

static void flood_of(int descriptor, uint64_t size) {
  static char lines[1 << 16];
  for (size_t i = 0; i < sizeof lines; i++)
    lines[i] = i % 128 == 127 ? '\n' : 'x';
  for (uint64_t written = 0; written < size; written += sizeof lines)
    if (write(descriptor, lines, sizeof lines) < 0)
      break;
}

static void flood(const Faulty *faulty, const FleetyardSink *sink) {
  (void)sink;
  flood_of(1, or_else(faulty->size, GIB));
}

static void flood_stderr(const Faulty *faulty, const FleetyardSink *sink) {
  (void)sink;
  flood_of(2, or_else(faulty->size, GIB));
}

static void log_flood(const Faulty *faulty, const FleetyardSink *sink) {
  char line[1025];
  memset(line, 'x', sizeof line - 1);
  line[sizeof line - 1] = 0;
  for (uint64_t written = 0; written < or_else(faulty->size, GIB); written += sizeof line - 1)
    say(sink, line);
}

static void nan_metric(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  volatile double zero = 0;
  metric(sink, "not-a-number", zero / zero);
  metric(sink, "infinity", 1 / zero);
}

/* Figures that the contract gives a meaning, and that cannot have this value. */
static void negative_expansions(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  metric(sink, "expansions", -5);
}

static void half_node(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  metric(sink, "nodes", 0.5);
}

static void nan_bound(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  volatile double zero = 0;
  metric(sink, "lower_bound", zero / zero);
}

/* Hands over an annotation of four places, or of what it was made into, so often. */
static void annotate(const FleetyardSink *sink, FleetyardAnnotation *annotation, uint64_t times) {
  static const uint64_t offsets[] = {0, 2, 4};
  static const uint32_t places[] = {0, 1, 2, 3};
  static const double numbers[] = {0, 1, 2, 3};
  const FleetyardStr id = {FLEETYARD_ANNOTATIONS_ID, sizeof FLEETYARD_ANNOTATIONS_ID - 1};
  const FleetyardAnnotations *annotations = sink->get_extension(sink->context, id);
  annotation->struct_size = sizeof *annotation;
  annotation->layer = (FleetyardStr){"mischief", 8};
  annotation->agent = FLEETYARD_NONE;
  annotation->to_s = HUGE_VAL;
  if (!annotation->shape)
    annotation->shape = FLEETYARD_SHAPE_PLACES;
  if (!annotation->count)
    annotation->count = 2;
  if (!annotation->offsets)
    annotation->offsets = offsets;
  if (!annotation->places)
    annotation->places = places;
  if (!annotation->x_m)
    annotation->x_m = annotation->y_m = numbers;
  for (uint64_t i = 0; annotations && i < times; i++)
    annotations->annotate(sink->context, annotation);
}

/* More than anybody can look at, each in order. */
static void annotation_flood(const Faulty *faulty, const FleetyardSink *sink) {
  FleetyardAnnotation annotation = {0};
  annotate(sink, &annotation, or_else(faulty->count, 50000));
}

static void annotation_outside(const Faulty *faulty, const FleetyardSink *sink) {
  static const uint32_t places[] = {0, 1, 2, 1 << 30};
  FleetyardAnnotation annotation = {.places = places};
  (void)faulty;
  annotate(sink, &annotation, 1);
}

static void annotation_shape(const Faulty *faulty, const FleetyardSink *sink) {
  FleetyardAnnotation annotation = {.shape = 99};
  (void)faulty;
  annotate(sink, &annotation, 1);
}

static void annotation_nan(const Faulty *faulty, const FleetyardSink *sink) {
  volatile double zero = 0;
  const double numbers[] = {0, 1, zero / zero, 3};
  FleetyardAnnotation annotation = {
      .shape = FLEETYARD_SHAPE_LINES, .x_m = numbers, .y_m = numbers};
  (void)faulty;
  annotate(sink, &annotation, 1);
}

static void annotation_offsets(const Faulty *faulty, const FleetyardSink *sink) {
  static const uint64_t offsets[] = {0, 1u << 30, 4};
  FleetyardAnnotation annotation = {.offsets = offsets};
  (void)faulty;
  annotate(sink, &annotation, 1);
}

static void annotation_count(const Faulty *faulty, const FleetyardSink *sink) {
  FleetyardAnnotation annotation = {.count = UINT32_MAX};
  (void)faulty;
  annotate(sink, &annotation, 1);
}

/* Writes to every pipe and socket that the plugin was not given: the worker's way to
 * the host is one of them. */
static void forge(const char *text) {
  for (int descriptor = 3; descriptor < 256; descriptor++) {
    struct stat about;
    if (fstat(descriptor, &about) == 0 && (S_ISFIFO(about.st_mode) || S_ISSOCK(about.st_mode)))
      if (write(descriptor, text, strlen(text)) < 0)
        continue; /* the end that reads */
  }
}

static void partial(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  forge("{\"jsonrpc\":\"2.0\",\"id\":3,\"resu");
  sleep_for_ever();
}

static void wrong_id(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  forge("{\"jsonrpc\":\"2.0\",\"id\":1003,\"result\":{\"status\":\"solved\"}}\n");
  sleep_for_ever();
}

static void closes_stdio(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  for (int descriptor = 0; descriptor < 3; descriptor++)
    close(descriptor);
  sleep_for_ever();
}

static void closes_everything(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  for (int descriptor = 0; descriptor < 1024; descriptor++)
    close(descriptor);
  sleep_for_ever();
}

/* ---- Files ----------------------------------------------------------------- */

static void fill_file(const Faulty *faulty, const FleetyardSink *sink, bool unlinked) {
  uint64_t size = or_else(faulty->size, GIB);
  char path[4200];
  snprintf(path, sizeof path, "%.4096s/fy-huge-%ld", scratch(), (long)getpid());
  int descriptor = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (descriptor >= 0 && unlinked)
    unlink(path);
  took(sink, descriptor < 0 ? 0 : fill(descriptor, size), size, path);
  if (unlinked)
    sleep_s(0.5); /* it takes room as long as it is open */
  if (descriptor >= 0)
    close(descriptor);
}

static void huge_file(const Faulty *faulty, const FleetyardSink *sink) {
  fill_file(faulty, sink, false);
}

/* No folder lists it. */
static void unlinked_file(const Faulty *faulty, const FleetyardSink *sink) {
  fill_file(faulty, sink, true);
}

static void many_files(const Faulty *faulty, const FleetyardSink *sink) {
  uint64_t wanted = or_else(faulty->count, 100000), made = 0;
  char folder[4200], path[4300];
  snprintf(folder, sizeof folder, "%.4096s/fy-many-%ld", scratch(), (long)getpid());
  for (bool going = mkdir(folder, 0700) == 0; going && made < wanted; made += going) {
    snprintf(path, sizeof path, "%s/%" PRIu64, folder, made);
    int descriptor = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    going = descriptor >= 0 && write(descriptor, "x", 1) == 1;
    int reason = errno;
    if (descriptor >= 0)
      close(descriptor);
    errno = reason;
  }
  took(sink, made, wanted, folder);
}

/* Folders in each other, deeper than a path can be long, that let nobody in. */
static void closed_folders(const Faulty *faulty, const FleetyardSink *sink) {
  char name[101];
  int at = open(scratch(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  (void)faulty;
  memset(name, 'd', sizeof name - 1);
  name[sizeof name - 1] = 0;
  bool reached = at >= 0;
  for (int depth = 0; depth < 200 && reached; depth++) {
    int file = openat(at, "fy-file", O_WRONLY | O_CREAT | O_CLOEXEC, 0);
    int inner = -1;
    if (mkdirat(at, name, 0700) == 0)
      inner = openat(at, name, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    reached = inner >= 0 && fchmod(at, 0) == 0;
    if (file >= 0)
      close(file);
    close(at);
    at = inner;
  }
  report(sink, reached, "closed folders");
  if (at >= 0)
    close(at);
}

static const char *target_or(const Faulty *faulty, const char *otherwise) {
  return *faulty->target ? faulty->target : otherwise;
}

/* Appends, so that a file of somebody's is not lost when nothing stops it. */
static void write_outside(const Faulty *faulty, const FleetyardSink *sink) {
  const char *path = target_or(faulty, "/var/tmp/fy-outside");
  int descriptor = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  bool reached = descriptor >= 0 && write(descriptor, "faulty was here\n", 16) == 16;
  report(sink, reached, path);
  if (descriptor >= 0)
    close(descriptor);
}

static void remove_outside(const Faulty *faulty, const FleetyardSink *sink) {
  const char *path = target_or(faulty, "/var/tmp/fy-outside");
  report(sink, unlink(path) == 0, path);
}

static void read_file(const Faulty *faulty, const FleetyardSink *sink) {
  const char *path = target_or(faulty, "/etc/shadow");
  char byte;
  int descriptor = open(path, O_RDONLY | O_CLOEXEC);
  report(sink, descriptor >= 0 && read(descriptor, &byte, 1) == 1, path);
  if (descriptor >= 0)
    close(descriptor);
}

static void list_folder(const Faulty *faulty, const FleetyardSink *sink) {
  const struct passwd *user = *faulty->target ? NULL : getpwuid(getuid());
  const char *path = target_or(faulty, user && user->pw_dir ? user->pw_dir : "/root");
  uint64_t entries = 0;
  DIR *folder = opendir(path);
  while (folder && readdir(folder))
    entries++;
  entries -= folder ? 2 : 0; /* . and .. */
  metric(sink, "entries", (double)entries);
  if (folder && entries == 0)
    errno = ENOENT; /* an empty one was put in its place */
  report(sink, entries > 0, path);
  if (folder)
    closedir(folder);
}

/* Opens what only the owner of the machine may write to, and writes nothing. */
static void kernel_files(const Faulty *faulty, const FleetyardSink *sink) {
  static const char *const paths[] = {
      "/proc/sysrq-trigger", "/proc/sys/kernel/core_pattern", "/proc/sys/kernel/hostname",
      "/dev/mem",            "/dev/kmsg",                     "/proc/1/oom_score_adj",
      "/dev/vda",            "/dev/sda",                      "/dev/nvme0n1",
      "/sys/power/state",    "/sys/fs/cgroup/cgroup.procs",
  };
  (void)faulty;
  for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
    int descriptor = open(paths[i], O_WRONLY | O_CLOEXEC);
    if (descriptor >= 0) {
      close(descriptor);
      report(sink, true, paths[i]);
      return;
    }
  }
  report(sink, false, "files of the kernel");
}

/* Whether a descriptor of the file `target` came with the process. */
static void inherited(const Faulty *faulty, const FleetyardSink *sink) {
  for (int descriptor = 0; descriptor < 1024; descriptor++) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0)
      continue;
    path[length] = 0;
    if (strcmp(path, faulty->target) == 0) {
      report(sink, true, path);
      return;
    }
  }
  errno = ENOENT;
  report(sink, false, "an inherited descriptor");
}

static void own_environment(const Faulty *faulty, const FleetyardSink *sink) {
  const char *name = target_or(faulty, "HOST_SECRET");
  errno = ENOENT;
  report(sink, getenv(name) != NULL, name);
}

/* Whether `name=` begins a variable in this file. */
static bool has_variable(const char *path, const char *name) {
  FILE *file = fopen(path, "r");
  size_t at = 0, length = strlen(name);
  bool matches = true, found = false;
  for (int letter; file && !found && (letter = fgetc(file)) != EOF;) {
    found = matches && at == length && letter == '=';
    matches = letter == 0 || (matches && at < length && letter == name[at]);
    at = letter == 0 ? 0 : at + 1;
  }
  if (file)
    fclose(file);
  return found;
}

/* Looks for a variable in the environments of all processes that can be seen. */
static void other_environments(const Faulty *faulty, const FleetyardSink *sink) {
  const char *name = target_or(faulty, "HOST_SECRET");
  DIR *processes = opendir("/proc");
  uint64_t readable = 0;
  bool found = false;
  const struct dirent *entry;
  while (processes && (entry = readdir(processes))) {
    char path[300];
    if (entry->d_name[0] < '1' || entry->d_name[0] > '9')
      continue;
    snprintf(path, sizeof path, "/proc/%s/environ", entry->d_name);
    readable += access(path, R_OK) == 0;
    found = found || has_variable(path, name);
  }
  if (processes)
    closedir(processes);
  metric(sink, "readable", (double)readable);
  errno = ENOENT;
  report(sink, found, name);
}

/* ---- Network --------------------------------------------------------------- */

static void connect_inet(const Faulty *faulty, const FleetyardSink *sink, int type) {
  const char *target = target_or(faulty, "127.0.0.1:9");
  const char *colon = strrchr(target, ':');
  char host[64] = "";
  struct sockaddr_in address = {.sin_family = AF_INET};
  if (colon && (size_t)(colon - target) < sizeof host) {
    memcpy(host, target, (size_t)(colon - target));
    address.sin_port = htons((uint16_t)strtoul(colon + 1, NULL, 10));
  }
  errno = EINVAL;
  bool reached = inet_pton(AF_INET, host, &address.sin_addr) == 1;
  int connection = reached ? socket(AF_INET, type | SOCK_CLOEXEC, 0) : -1;
  struct timeval patience = {1, 0};
  if (connection >= 0)
    setsockopt(connection, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  reached = connection >= 0 &&
            connect(connection, (struct sockaddr *)&address, sizeof address) == 0 &&
            send(connection, "faulty\n", 7, MSG_NOSIGNAL) == 7;
  report(sink, reached, target);
  if (connection >= 0)
    close(connection);
}

static void connect_tcp(const Faulty *faulty, const FleetyardSink *sink) {
  connect_inet(faulty, sink, SOCK_STREAM);
}

static void connect_udp(const Faulty *faulty, const FleetyardSink *sink) {
  connect_inet(faulty, sink, SOCK_DGRAM);
}

/* `lead` 1 leaves the zero byte of the abstract namespace in front. */
static void connect_local(const Faulty *faulty, const FleetyardSink *sink, size_t lead) {
  const char *target = target_or(faulty, lead ? "fy-nobody" : "/run/fy-nobody");
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  size_t length = strlen(target);
  if (length + lead >= sizeof address.sun_path)
    length = sizeof address.sun_path - lead - 1;
  memcpy(address.sun_path + lead, target, length);
  socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + lead + length);
  int connection = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  bool reached = connection >= 0 && connect(connection, (struct sockaddr *)&address, size) == 0 &&
                 send(connection, "faulty\n", 7, MSG_NOSIGNAL) == 7;
  report(sink, reached, target);
  if (connection >= 0)
    close(connection);
}

static void connect_unix(const Faulty *faulty, const FleetyardSink *sink) {
  connect_local(faulty, sink, 0);
}

static void connect_abstract(const Faulty *faulty, const FleetyardSink *sink) {
  connect_local(faulty, sink, 1);
}

/* Whether the kernel looked at a call, whatever it said to it. */
static bool looked_at(long result) {
  return result >= 0 || (errno != EPERM && errno != ENOSYS);
}

/* No pair of this family is ever made, but asking for one loads parts of the kernel. */
static void socketpair_netlink(const Faulty *faulty, const FleetyardSink *sink) {
  int pair[2];
  (void)faulty;
  report(sink, looked_at(socketpair(AF_NETLINK, SOCK_RAW, 0, pair)), "a pair of netlink sockets");
}

/* Datagrams need no connection: one end of a pair may send to anybody. */
static void socketpair_datagram(const Faulty *faulty, const FleetyardSink *sink) {
  const char *target = target_or(faulty, "/run/fy-nobody");
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  snprintf(address.sun_path, sizeof address.sun_path, "%.100s", target);
  int pair[2];
  bool made = socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, pair) == 0;
  bool reached = made && sendto(pair[0], "faulty\n", 7, MSG_NOSIGNAL, (struct sockaddr *)&address,
                                sizeof address) == 7;
  report(sink, reached, target);
  if (made) {
    close(pair[0]);
    close(pair[1]);
  }
}

/* ---- Other processes ------------------------------------------------------- */

static pid_t victim(const Faulty *faulty) {
  return faulty->pid > 0 ? (pid_t)faulty->pid : getppid();
}

static void kill_parent(const Faulty *faulty, const FleetyardSink *sink) {
  pid_t parent = getppid();
  (void)faulty;
  errno = ESRCH;
  bool sent = parent > 0 && kill(parent, SIGKILL) == 0;
  int reason = errno;
  /* The first process of a namespace can be sent it, and does not mind. */
  for (int turn = 0; sent && turn < 20 && getppid() == parent; turn++)
    sleep_s(0.01);
  errno = sent ? EPERM : reason;
  report(sink, sent && getppid() != parent, "the parent");
}

/* The plugin's own group; the host had better not be in it. */
static void kill_group(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  kill(0, SIGKILL);
}

static void kill_pid(const Faulty *faulty, const FleetyardSink *sink) {
  report(sink, kill(victim(faulty), SIGKILL) == 0, "another process");
}

static void see_process(const Faulty *faulty, const FleetyardSink *sink) {
  char path[64];
  snprintf(path, sizeof path, "/proc/%ld/stat", (long)victim(faulty));
  bool seen = access(path, F_OK) == 0;
  report(sink, seen || kill(victim(faulty), 0) == 0 || errno == EPERM, "another process");
}

static void attach(const Faulty *faulty, const FleetyardSink *sink) {
  pid_t pid = victim(faulty);
  bool reached = ptrace(PTRACE_ATTACH, pid, NULL, NULL) == 0;
  report(sink, reached, "attaching to another process");
  if (reached) {
    waitpid(pid, NULL, __WALL);
    ptrace(PTRACE_DETACH, pid, NULL, NULL);
  }
}

/* Where to read or write: `target`, or where a process has something for certain. */
static uint64_t address_in(const Faulty *faulty, pid_t pid) {
  char path[64];
  unsigned long long address = strtoull(faulty->target, NULL, 0);
  snprintf(path, sizeof path, "/proc/%ld/maps", (long)pid);
  FILE *maps = address ? NULL : fopen(path, "r");
  if (maps) {
    if (fscanf(maps, "%llx", &address) != 1)
      address = 0;
    fclose(maps);
  }
  return address;
}

static void read_memory(const Faulty *faulty, const FleetyardSink *sink) {
  pid_t pid = victim(faulty);
  char bytes[8];
  struct iovec here = {bytes, sizeof bytes};
  /* A null pointer where the map cannot be read; who may read it may not do this either. */
  struct iovec there = {(void *)(uintptr_t)address_in(faulty, pid), sizeof bytes};
  report(sink, process_vm_readv(pid, &here, 1, &there, 1, 0) > 0, "memory of another process");
}

/* Needs a `target`; without one it opens the memory and leaves it as it is. */
static void write_memory(const Faulty *faulty, const FleetyardSink *sink) {
  pid_t pid = victim(faulty);
  char path[64];
  snprintf(path, sizeof path, "/proc/%ld/mem", (long)pid);
  int memory = open(path, O_RDWR | O_CLOEXEC);
  bool reached = memory >= 0;
  if (reached && *faulty->target)
    reached = pwrite(memory, "faulty!", 8, (off_t)address_in(faulty, pid)) == 8;
  report(sink, reached, path);
  if (memory >= 0)
    close(memory);
}

static void steal_descriptor(const Faulty *faulty, const FleetyardSink *sink) {
  enum { PIDFD_OPEN = 434, PIDFD_GETFD = 438 };
  long process = syscall(PIDFD_OPEN, (long)victim(faulty), 0L);
  long stolen = process < 0 ? -1 : syscall(PIDFD_GETFD, process, 0L, 0L);
  report(sink, stolen >= 0, "a descriptor of another process");
  if (stolen >= 0)
    close((int)stolen);
  if (process >= 0)
    close((int)process);
}

/* Lets a process have nothing of a resource: `target`, or of each in turn. */
static bool take_limit(const Faulty *faulty, pid_t pid) {
  static const struct {
    const char *name;
    int resource;
  } resources[] = {{"cpu", RLIMIT_CPU}, {"nofile", RLIMIT_NOFILE}, {"fsize", RLIMIT_FSIZE}};
  const struct rlimit nothing = {0, 0};
  bool reached = false;
  for (size_t i = 0; i < sizeof resources / sizeof *resources; i++)
    if (!*faulty->target || strcmp(faulty->target, resources[i].name) == 0)
      reached |= syscall(SYS_prlimit64, (long)pid, (long)resources[i].resource, &nothing, NULL) == 0;
  return reached;
}

/* The parent's parent, or the parent itself where nobody says who that is. */
static pid_t supervisor(void) {
  char path[64], line[256];
  long found = 0;
  snprintf(path, sizeof path, "/proc/%ld/status", (long)getppid());
  FILE *status = fopen(path, "r");
  while (status && found == 0 && fgets(line, sizeof line, status))
    if (sscanf(line, "PPid: %ld", &found) != 1)
      found = 0;
  if (status)
    fclose(status);
  return found > 0 ? (pid_t)found : getppid();
}

static void limit_supervisor(const Faulty *faulty, const FleetyardSink *sink) {
  report(sink, take_limit(faulty, supervisor()), "a limit of the supervisor");
  sleep_s(0.2); /* so that it is noticed during the call */
}

static void limit_host(const Faulty *faulty, const FleetyardSink *sink) {
  report(sink, take_limit(faulty, victim(faulty)), "a limit of the host");
}

/* Sets what is set, so that nothing changes. */
static void priority_of_others(const Faulty *faulty, const FleetyardSink *sink) {
  enum { WHO_PROCESS = 1 };
  pid_t pid = victim(faulty);
  struct sched_param ordinary = {.sched_priority = 0};
  errno = 0;
  int nice_value = getpriority(PRIO_PROCESS, (id_t)pid);
  bool reached = errno == 0 && setpriority(PRIO_PROCESS, (id_t)pid, nice_value) == 0;
  reached |= sched_setscheduler(pid, SCHED_OTHER, &ordinary) == 0;
  reached |= sched_setparam(pid, &ordinary) == 0;
  long urgency = syscall(SYS_ioprio_get, (long)WHO_PROCESS, (long)pid);
  reached |= urgency >= 0 && syscall(SYS_ioprio_set, (long)WHO_PROCESS, (long)pid, urgency) == 0;
  report(sink, reached, "the priority of another process");
}

/* Whoever owns a file is sent a signal about it, which may be any; none is sent here. */
static void signal_by_file(const Faulty *faulty, const FleetyardSink *sink) {
  enum { SET_OWNER = 8, SET_OWNER_BY_IOCTL = 0x8901 };
  int ends[2], pid = (int)victim(faulty);
  bool made = pipe(ends) == 0;
  bool reached = made && (fcntl(ends[0], SET_OWNER, pid) == 0 ||
                          ioctl(ends[0], SET_OWNER_BY_IOCTL, &pid) == 0);
  report(sink, reached, "signals by way of a file");
  if (made) {
    close(ends[0]);
    close(ends[1]);
  }
}

/* Whoever opens a leased file for writing waits, up to a minute. */
static void lease(const Faulty *faulty, const FleetyardSink *sink) {
  enum { SET_LEASE = 1024 };
  char path[4200];
  (void)faulty;
  snprintf(path, sizeof path, "%.4096s/fy-lease-XXXXXX", scratch());
  int writer = mkstemp(path);
  int descriptor = writer >= 0 && close(writer) == 0 ? open(path, O_RDONLY | O_CLOEXEC) : -1;
  report(sink, descriptor >= 0 && fcntl(descriptor, SET_LEASE, F_RDLCK) == 0, "a lease");
  if (descriptor >= 0)
    close(descriptor);
  if (writer >= 0)
    unlink(path);
}

/* No signal at all, which asks whether one could be sent. Where nobody else is, a child
 * is. */
static void kill_all(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  pid_t child = fork();
  if (child == 0)
    linger();
  report(sink, kill(-1, 0) == 0, "everybody");
  if (child > 0) {
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
  }
}

/* ---- The kernel ------------------------------------------------------------ */

static int try_unshare(void) { return unshare(CLONE_NEWUSER) == 0 ? 0 : errno; }

static void unshare_user(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  report_child(sink, in_child(try_unshare), "a user namespace");
}

/* On a folder of its own, and only for a moment. */
static int try_mount(void) {
  char folder[4200];
  snprintf(folder, sizeof folder, "%.4096s/fy-mount-XXXXXX", scratch());
  if (!mkdtemp(folder))
    return errno;
  int code = mount("faulty", folder, "tmpfs", 0, "size=4k") == 0 ? 0 : errno;
  if (code == 0)
    umount2(folder, MNT_DETACH);
  rmdir(folder);
  return code;
}

static int try_mount_in_namespace(void) {
  return unshare(CLONE_NEWUSER | CLONE_NEWNS) == 0 ? try_mount() : errno;
}

static void mount_tmpfs(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  int code = in_child(try_mount);
  report_child(sink, code == 0 ? 0 : in_child(try_mount_in_namespace), "mounting");
}

/* The outcome of a system call that gives a descriptor. */
static void report_descriptor(const FleetyardSink *sink, long descriptor, const char *what) {
  report(sink, descriptor >= 0, what);
  if (descriptor >= 0)
    close((int)descriptor);
}

/* Hears who reads the system's programs, and uses up what all programs of the user share. */
static void watch_files(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  int descriptor = inotify_init1(IN_CLOEXEC);
  int watch = descriptor < 0 ? -1 : inotify_add_watch(descriptor, "/usr", IN_ALL_EVENTS);
  report(sink, watch >= 0, "inotify");
  if (descriptor >= 0)
    close(descriptor);
}

/* Advice between programs that agree on it: whoever may read a file may hold it. */
static void lock_granted(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  int descriptor = open("/etc/passwd", O_RDONLY | O_CLOEXEC);
  report(sink, descriptor >= 0 && flock(descriptor, LOCK_EX | LOCK_NB) == 0, "a lock");
  if (descriptor >= 0)
    close(descriptor);
}

static void io_uring(const Faulty *faulty, const FleetyardSink *sink) {
  enum { IO_URING_SETUP = 425 };
  uint64_t parameters[15] = {0};
  (void)faulty;
  report_descriptor(sink, syscall(IO_URING_SETUP, 4L, parameters), "io_uring");
}

static void bpf(const Faulty *faulty, const FleetyardSink *sink) {
  /* BPF_MAP_CREATE: an array of one entry of four bytes. */
  uint32_t map[18] = {2, 4, 4, 1};
  (void)faulty;
  report_descriptor(sink, syscall(SYS_bpf, 0L, map, sizeof map), "bpf");
}

static void perf_event(const Faulty *faulty, const FleetyardSink *sink) {
  struct perf_event_attr event = {.type = PERF_TYPE_SOFTWARE, .size = sizeof event};
  (void)faulty;
  event.config = PERF_COUNT_SW_CPU_CLOCK;
  event.exclude_kernel = 1;
  report_descriptor(sink, syscall(SYS_perf_event_open, &event, 0L, -1L, -1L, 0L), "perf events");
}

static void user_fault(const Faulty *faulty, const FleetyardSink *sink) {
  enum { UFFD_USER_MODE_ONLY = 1 };
  (void)faulty;
  report_descriptor(sink, syscall(SYS_userfaultfd, (long)O_CLOEXEC | UFFD_USER_MODE_ONLY),
                    "userfaultfd");
}

static void keyctl(const Faulty *faulty, const FleetyardSink *sink) {
  enum { KEYCTL_GET_KEYRING_ID = 0 };
  (void)faulty;
  report(sink, syscall(SYS_keyctl, (long)KEYCTL_GET_KEYRING_ID, -3L, 0L) >= 0,
         "the session's keyring");
}

/* Other numbers, other ways in: a filter of system calls has to know them all. */
static int try_x32(void) {
#if defined(__x86_64__)
  return syscall(0x40000000L + SYS_getpid) > 0 ? 0 : errno;
#else
  return ENOSYS;
#endif
}

static void x32(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  report_child(sink, in_child(try_x32), "a system call of x32");
}

static int try_int80(void) {
#if defined(__x86_64__)
  long result = 20; /* getpid of i386 */
  __asm__ volatile("int $0x80" : "+a"(result) : : "memory", "r8", "r9", "r10", "r11");
  return result > 0 ? 0 : (int)-result;
#else
  return ENOSYS;
#endif
}

static void int80(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  report_child(sink, in_child(try_int80), "a system call of i386");
}

/* Reached when it may run on more cores than before. */
static void repin(const Faulty *faulty, const FleetyardSink *sink) {
  cpu_set_t before, wanted, after;
  (void)faulty;
  CPU_ZERO(&before);
  CPU_ZERO(&after);
  sched_getaffinity(0, sizeof before, &before);
  memset(&wanted, 0xFF, sizeof wanted);
  int code = sched_setaffinity(0, sizeof wanted, &wanted);
  int reason = code == 0 ? EEXIST : errno; /* it had them all */
  sched_getaffinity(0, sizeof after, &after);
  metric(sink, "cores-before", CPU_COUNT(&before));
  metric(sink, "cores-after", CPU_COUNT(&after));
  errno = reason;
  report(sink, CPU_COUNT(&after) > CPU_COUNT(&before), "more cores");
}

static void realtime(const Faulty *faulty, const FleetyardSink *sink) {
  struct sched_param priority = {.sched_priority = 1}, ordinary = {.sched_priority = 0};
  (void)faulty;
  bool reached = sched_setscheduler(0, SCHED_FIFO, &priority) == 0;
  if (reached)
    sched_setscheduler(0, SCHED_OTHER, &ordinary);
  else if (setpriority(PRIO_PROCESS, 0, -1) == 0)
    reached = true;
  report(sink, reached, "a better priority");
}

/* Reached when a limit that binds can be raised. */
static void raise_limits(const Faulty *faulty, const FleetyardSink *sink) {
  const int limits[] = {RLIMIT_AS,    RLIMIT_CPU,    RLIMIT_FSIZE, RLIMIT_NPROC,
                        RLIMIT_STACK, RLIMIT_NOFILE, RLIMIT_CORE,  RLIMIT_MEMLOCK};
  (void)faulty;
  int reason = ENOENT; /* nothing is limited */
  bool reached = false;
  for (size_t i = 0; i < sizeof limits / sizeof *limits; i++) {
    struct rlimit limit;
    /* As numbers: gcc's library takes an enumeration, others an integer. */
    if (syscall(SYS_prlimit64, 0L, (long)limits[i], NULL, &limit) != 0 ||
        limit.rlim_max == RLIM_INFINITY)
      continue;
    limit.rlim_max++;
    if (syscall(SYS_prlimit64, 0L, (long)limits[i], &limit, NULL) == 0)
      reached = true;
    else
      reason = errno;
  }
  errno = reason;
  report(sink, reached, "a higher limit");
}

static void aio(const Faulty *faulty, const FleetyardSink *sink) {
  unsigned long context = 0;
  (void)faulty;
  bool reached = syscall(SYS_io_setup, 8L, &context) == 0;
  report(sink, reached, "asynchronous input and output");
  if (reached)
    syscall(SYS_io_destroy, context);
}

static int try_personality(void) {
  enum { MAP_PAGE_ZERO = 0x0100000 };
  return personality(MAP_PAGE_ZERO) >= 0 ? 0 : errno;
}

static void old_personality(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  report_child(sink, in_child(try_personality), "an old personality");
}

static void memory_policy(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  report(sink, looked_at(syscall(SYS_set_mempolicy, 0L, NULL, 0L)), "where its memory is");
}

static int try_listener(void) {
  enum { SET_MODE_FILTER = 1, NEW_LISTENER = 8 };
  struct sock_filter allow = {0x06, 0, 0, 0x7fff0000};
  struct sock_fprog program = {1, &allow};
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  return syscall(SYS_seccomp, (long)SET_MODE_FILTER, (long)NEW_LISTENER, &program) >= 0 ? 0 : errno;
}

static void seccomp_listener(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  report_child(sink, in_child(try_listener), "a filter that asks a process");
}

/* Without arguments: a kernel that has them complains about those. */
static void new_calls(const Faulty *faulty, const FleetyardSink *sink) {
  enum { CACHESTAT = 451, STATMOUNT = 457, LISTMOUNT, LSM_GET, LSM_SET, LSM_LIST };
  enum { OPEN_TREE_ATTR = 467, FILE_GETATTR, FILE_SETATTR, AFTER_ALL = 470 };
  static const long calls[] = {CACHESTAT, STATMOUNT,      LISTMOUNT,    LSM_GET,      LSM_SET,
                               LSM_LIST,  OPEN_TREE_ATTR, FILE_GETATTR, FILE_SETATTR, AFTER_ALL};
  (void)faulty;
  for (size_t i = 0; i < sizeof calls / sizeof *calls; i++)
    if (looked_at(syscall(calls[i], -1L, NULL, NULL, 0L, 0L))) {
      char what[64];
      snprintf(what, sizeof what, "system call %ld", calls[i]);
      report(sink, true, what);
      return;
    }
  report(sink, false, "calls of new kernels");
}

/* Who cannot be dumped cannot be looked into either. */
static void undumpable(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  bool reached = prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) == 0;
  report(sink, reached, "hiding its memory");
  if (reached)
    prctl(PR_SET_DUMPABLE, 1, 0, 0, 0);
}

/* Reached when it does not go first, where memory runs out, or can change that. */
static void oom_score(const Faulty *faulty, const FleetyardSink *sink) {
  static const char path[] = "/proc/self/oom_score_adj";
  char text[16] = "";
  (void)faulty;
  int readable = open(path, O_RDONLY | O_CLOEXEC);
  bool known = readable >= 0 && read(readable, text, sizeof text - 1) > 0;
  int writable = open(path, O_WRONLY | O_CLOEXEC);
  bool reached = (known && atoi(text) != 1000) || (writable >= 0 && write(writable, "0", 1) == 1);
  metric(sink, "oom-score", known ? atoi(text) : -1);
  report(sink, reached, path);
  if (readable >= 0)
    close(readable);
  if (writable >= 0)
    close(writable);
}

/* What the kernel tells about the machine and about everybody on it. */
static void proc_files(const Faulty *faulty, const FleetyardSink *sink) {
  static const char *const names[] = {
      "cmdline",   "kallsyms",  "keys",         "key-users",   "diskstats",    "interrupts",
      "softirqs",  "kcore",     "kmsg",         "timer_list",  "sched_debug",  "vmallocinfo",
      "slabinfo",  "partitions", "modules",     "iomem",       "ioports",      "buddyinfo",
      "zoneinfo",  "vmstat",    "pagetypeinfo", "locks",       "swaps",        "devices",
      "config.gz", "consoles",  "cgroups",      "sysvipc/shm", "pressure/cpu", "irq/0/spurious",
      "fs/ext4",   "bus/pci/devices", "sys/kernel/hostname", "sys/kernel/random/boot_id",
      "sys/fs/file-nr", "sys/kernel/core_pattern",
  };
  (void)faulty;
  int reason = ENOENT;
  for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
    char path[64], byte;
    snprintf(path, sizeof path, "/proc/%s", names[i]);
    int descriptor = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    bool told = descriptor >= 0 && read(descriptor, &byte, 1) == 1;
    reason = descriptor < 0 ? errno : reason;
    if (descriptor >= 0)
      close(descriptor);
    if (told) {
      report(sink, true, path);
      return;
    }
  }
  errno = reason;
  report(sink, false, "files of the kernel in /proc");
}

/* ---- What is its process's ------------------------------------------------- */

/* The bits are those of the register that says how numbers are computed. */
static void compute_with(uint32_t on, uint32_t off) {
#if defined(__x86_64__)
  __builtin_ia32_ldmxcsr((__builtin_ia32_stmxcsr() | on) & ~off);
#elif defined(__aarch64__)
  uint64_t bits;
  __asm__ volatile("mrs %0, fpcr" : "=r"(bits));
  __asm__ volatile("msr fpcr, %0" : : "r"((bits | on) & ~(uint64_t)off));
#endif
}

#if defined(__aarch64__)
enum { FLUSHED = 1 << 24, UPWARDS = 1 << 22, MASKED = 0, TRAPPED = 0x9F00 };
#else
enum { FLUSHED = 0x8040, UPWARDS = 2 << 13, MASKED = 0x1F80, TRAPPED = 0 };
#endif

/* As a library does on being loaded when it was linked with -ffast-math. */
static void leaves_ftz(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  compute_with(FLUSHED, 0);
}

static void leaves_rounding(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  compute_with(UPWARDS, 0);
}

/* Every result that is not exact is a signal from here on. */
static void leaves_traps(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  compute_with(TRAPPED, MASKED);
}

static void leaves_umask(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  (void)sink;
  umask(0777);
}

static void leaves_cwd(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  report(sink, chdir("/") == 0, "another working directory");
}

static void leaves_signals(const Faulty *faulty, const FleetyardSink *sink) {
  sigset_t all;
  (void)faulty;
  (void)sink;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, NULL);
  signal(SIGINT, SIG_IGN);
  signal(SIGTERM, SIG_IGN);
}

static void leaves_locale(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  bool process = setlocale(LC_ALL, "C.UTF-8") != NULL;
  locale_t own = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  bool thread = own && uselocale(own) != (locale_t)0;
  report(sink, process || thread, "another locale");
}

static void leaves_limits(const Faulty *faulty, const FleetyardSink *sink) {
  const int limits[] = {RLIMIT_FSIZE, RLIMIT_NOFILE};
  bool reached = true;
  (void)faulty;
  for (size_t i = 0; i < sizeof limits / sizeof *limits; i++) {
    struct rlimit limit;
    long which = limits[i];
    reached = syscall(SYS_prlimit64, 0L, which, NULL, &limit) == 0 && reached;
    limit.rlim_cur = 0;
    reached = syscall(SYS_prlimit64, 0L, which, &limit, NULL) == 0 && reached;
  }
  report(sink, reached, "lower limits");
}

static void leaves_environment(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  report(sink, setenv("FY_LEFT", "left", 1) == 0 && unsetenv("PATH") == 0, "another environment");
}

/* The signal ends whoever has no handler for it. */
static void leaves_timer(const Faulty *faulty, const FleetyardSink *sink) {
  const struct itimerval soon = {{0, 0}, {0, 100000}};
  (void)faulty;
  report(sink, setitimer(ITIMER_REAL, &soon, NULL) == 0, "a timer");
}

static void leaves_streams(const Faulty *faulty, const FleetyardSink *sink) {
  (void)faulty;
  int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  report(sink, nothing >= 0 && dup2(nothing, 1) == 1, "another standard output");
}

static void leaves_thread(const Faulty *faulty, const FleetyardSink *sink) {
  cpu_set_t cpus, one;
  (void)faulty;
  CPU_ZERO(&one);
  sched_getaffinity(0, sizeof cpus, &cpus);
  for (int cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(&one) == 0; cpu++)
    if (CPU_ISSET(cpu, &cpus))
      CPU_SET(cpu, &one);
  prctl(PR_SET_NAME, "left");
  report(sink, sched_setaffinity(0, sizeof one, &one) == 0, "one processor alone");
}

/* ---- The table ------------------------------------------------------------- */

#define ENTRY(name, function) {name, function},

static const struct {
  const char *name;
  void (*run)(const Faulty *, const FleetyardSink *);
} mischief[] = {MISCHIEF(ENTRY)};

/* Does what was asked for in this call, if it is one of the above. */
static void misbehave(const Faulty *faulty, const char *call, const FleetyardSink *sink) {
  if (strcmp(faulty->during, call) != 0)
    return;
  for (size_t i = 0; i < sizeof mischief / sizeof *mischief; i++)
    if (strcmp(faulty->fault, mischief[i].name) == 0)
      mischief[i].run(faulty, sink);
}
