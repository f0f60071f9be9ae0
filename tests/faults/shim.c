/* A machine that fails: preloaded into the program, it makes chosen system calls fail, fall short, be
   interrupted, kill the process, or bring back other bytes than were stored.

   Calls are caught by a seccomp filter and not by wrappers of C functions, so that none goes by it,
   whichever library makes it: the kernel sends SIGSYS instead of doing the call, and the handler does
   it, or what it was asked to do instead, through the one instruction that the filter lets pass.
   Only calls on files in one folder count. The environment says what to do:

   FAULT_FOLDER  the folder, an absolute path
   FAULT_COUNTS  a file of 24 zeroes; becomes the number of calls, of those that were changed, and the
                 bytes that were written, while the program runs
   FAULT_CALL    read, pread, write, pwrite, sync, rename, open, mkdir, unlink, lock or output (both
                 write and pwrite)
   FAULT_PATH    only calls on paths that contain this
   FAULT_NTH     the call to change, from 1 on;  FAULT_EVERY  or each one whose number it divides
   FAULT_DOES    kill, short, flip, full (no space after FAULT_NTH bytes), or the number of an error */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

/* A system call whose instruction is known by its address. */
extern char call_returns[];
long call(long number, long a, long b, long c, long d, long e, long f);

#if defined(__x86_64__)
#define ARCHITECTURE AUDIT_ARCH_X86_64
__asm__(".text\n.globl call\n.hidden call\n.globl call_returns\n.hidden call_returns\n"
        "call:\n mov %rdi, %rax\n mov %rsi, %rdi\n mov %rdx, %rsi\n mov %rcx, %rdx\n mov %r8, %r10\n"
        " mov %r9, %r8\n mov 8(%rsp), %r9\n syscall\ncall_returns:\n ret\n");
#define ARGUMENTS(c)                                                                                    \
    {(c)->gregs[REG_RDI], (c)->gregs[REG_RSI], (c)->gregs[REG_RDX],                                     \
     (c)->gregs[REG_R10], (c)->gregs[REG_R8],  (c)->gregs[REG_R9]}
#define RESULT(c) (c)->gregs[REG_RAX]
#elif defined(__aarch64__)
#define ARCHITECTURE AUDIT_ARCH_AARCH64
__asm__(".text\n.globl call\n.hidden call\n.globl call_returns\n.hidden call_returns\n"
        "call:\n mov x8, x0\n mov x0, x1\n mov x1, x2\n mov x2, x3\n mov x3, x4\n mov x4, x5\n"
        " mov x5, x6\n svc #0\ncall_returns:\n ret\n");
#define ARGUMENTS(c)                                                                                    \
    {(c)->regs[0], (c)->regs[1], (c)->regs[2], (c)->regs[3], (c)->regs[4], (c)->regs[5]}
#define RESULT(c) (c)->regs[0]
#else
#error "the shim knows x86-64 and AArch64"
#endif

/* The calls of each kind, and which argument is the path (-1: the first is a descriptor). */
static const struct {
    long number;
    const char *kind;
    int path;
} CALLS[] = {
    {SYS_read, "read", -1},          {SYS_pread64, "pread", -1},    {SYS_write, "write", -1},
    {SYS_pwrite64, "pwrite", -1},    {SYS_fsync, "sync", -1},       {SYS_fdatasync, "sync", -1},
    {SYS_flock, "lock", -1},         {SYS_openat, "open", 1},       {SYS_mkdirat, "mkdir", 1},
    {SYS_unlinkat, "unlink", 1},     {SYS_renameat2, "rename", 3},
#ifdef SYS_renameat
    {SYS_renameat, "rename", 3},
#endif
#ifdef SYS_open
    {SYS_open, "open", 0},           {SYS_mkdir, "mkdir", 0},       {SYS_unlink, "unlink", 0},
    {SYS_rmdir, "unlink", 0},        {SYS_rename, "rename", 1},
#endif
};
enum { KINDS = sizeof CALLS / sizeof CALLS[0] };

static struct {
    const char *folder, *kind, *path, *does;
    long nth, every;
    struct {
        _Atomic long calls, changed, written;
    } *counts;
} fault;

static int is_wanted(const char *kind) {
    int writes = !strcmp(kind, "write") || !strcmp(kind, "pwrite");
    return !strcmp(fault.kind, kind) || (writes && !strcmp(fault.kind, "output"));
}

/* True if the call is on a file in the folder, of a name that is meant. */
static int is_meant(int argument, const long *arguments) {
    char name[4096], link[64];
    const char *path = argument < 0 ? name : (const char *)arguments[argument];
    if (argument < 0) {
        snprintf(link, sizeof link, "/proc/self/fd/%d", (int)arguments[0]);
        long length = call(SYS_readlinkat, AT_FDCWD, (long)link, (long)name, sizeof name - 1, 0, 0);
        name[length < 0 ? 0 : length] = 0;
    }
    /* A relative path is one in the folder: the program runs there. */
    int inside = !strncmp(path, fault.folder, strlen(fault.folder)) || (argument >= 0 && path[0] != '/');
    return inside && (!fault.path || strstr(path, fault.path));
}

static int is_this_one(void) {
    long number = atomic_fetch_add(&fault.counts->calls, 1) + 1;
    return fault.every ? number % fault.every == 0 : number == fault.nth;
}

/* A call of which no more than so many bytes are done. */
static long partly(long number, const long *a, long bytes) {
    return call(number, a[0], a[1], bytes < a[2] ? bytes : a[2], a[3], a[4], a[5]);
}

static long changed(long number, const long *a) {
    atomic_fetch_add(&fault.counts->changed, 1);
    if (!strcmp(fault.does, "kill")) {
        call(SYS_kill, getpid(), SIGKILL, 0, 0, 0, 0);
    } else if (!strcmp(fault.does, "short")) {
        return partly(number, a, a[2] > 1 ? a[2] / 2 : a[2]);
    } else if (!strcmp(fault.does, "flip")) {
        long got = partly(number, a, a[2]);
        if (got > 0) {
            ((unsigned char *)a[1])[fault.nth * 7919 % got] ^= 1 << fault.nth % 8;
        }
        return got;
    }
    return -atol(fault.does);
}

/* A write to a disk that has so much room and no more. */
static long until_full(long number, const long *a) {
    long room = fault.nth - atomic_load(&fault.counts->written);
    if (room <= 0) {
        atomic_fetch_add(&fault.counts->changed, 1);
        return -ENOSPC;
    }
    return partly(number, a, room);
}

static long done(long number, const long *a) {
    for (int i = 0; i < KINDS; i++) {
        if (CALLS[i].number != number) {
            continue;
        }
        int wanted = is_wanted(CALLS[i].kind) && is_meant(CALLS[i].path, a);
        int full = !strcmp(fault.does, "full");
        int this_one = wanted && is_this_one();
        long result = wanted && full ? until_full(number, a)
                      : this_one     ? changed(number, a)
                                     : partly(number, a, a[2]);
        if (wanted && result > 0 && (number == SYS_write || number == SYS_pwrite64)) {
            atomic_fetch_add(&fault.counts->written, result);
        }
        return result;
    }
    return -ENOSYS;
}

static void handle(int signal, siginfo_t *info, void *context) {
    (void)signal;
    mcontext_t *machine = &((ucontext_t *)context)->uc_mcontext;
    long arguments[] = ARGUMENTS(machine);
    int before = errno;
    RESULT(machine) = done(info->si_syscall, arguments);
    errno = before;
}

/* Sends every call of the kinds to the handler, but for those of `call`. */
static void filter(void) {
    struct sock_filter code[KINDS + 12];
    int n = 0;
    unsigned long passes = (unsigned long)call_returns;
    const struct sock_filter head[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, instruction_pointer)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (unsigned)passes, 0, 3),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, instruction_pointer) + 4),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (unsigned)(passes >> 32), 0, 1),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, arch)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ARCHITECTURE, 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
    };
    memcpy(code, head, sizeof head);
    n = sizeof head / sizeof head[0];
    for (int i = 0; i < KINDS; i++) {
        struct sock_filter test =
            BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (unsigned)CALLS[i].number, KINDS - i, 0);
        code[n++] = test;
    }
    struct sock_filter allow = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
    struct sock_filter trap = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP);
    code[n++] = allow;
    code[n++] = trap;
    struct sock_fprog program = {n, code};
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program)) {
        perror("shim: seccomp");
        _exit(99);
    }
}

static long number_of(const char *name) {
    const char *text = getenv(name);
    return text ? atol(text) : 0;
}

__attribute__((constructor)) static void begin(void) {
    fault.folder = getenv("FAULT_FOLDER");
    fault.kind = getenv("FAULT_CALL");
    fault.path = getenv("FAULT_PATH");
    fault.does = getenv("FAULT_DOES");
    fault.nth = number_of("FAULT_NTH");
    fault.every = number_of("FAULT_EVERY");
    int counts = open(getenv("FAULT_COUNTS"), O_RDWR);
    fault.counts = mmap(0, sizeof *fault.counts, PROT_READ | PROT_WRITE, MAP_SHARED, counts, 0);
    struct sigaction action = {.sa_sigaction = handle, .sa_flags = SA_SIGINFO | SA_NODEFER};
    if (fault.counts == MAP_FAILED || sigaction(SIGSYS, &action, 0)) {
        perror("shim");
        _exit(99);
    }
    filter();
}
