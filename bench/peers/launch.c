// FIGURES COMMAND...: runs the command and writes its CPU seconds, wall seconds and peak KiB to the file FIGURES.
// A child's peak begins at that of the process which starts it, and this one is small.
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec + time.tv_nsec * 1e-9;
}

int main(int count, char** arguments) {
    if (count < 3) return 125;
    const double start = now();
    const pid_t child = fork();
    if (child == 0) {
        execvp(arguments[2], arguments + 2);
        fprintf(stderr, "error: does not start: %s\n", strerror(errno));
        _exit(127);
    }
    int status;
    struct rusage usage;
    if (child < 0 || wait4(child, &status, 0, &usage) < 0) return 125;
    const double wall = now() - start;
    FILE* file = fopen(arguments[1], "w");
    if (!file) return 125;
    const double cpu = usage.ru_utime.tv_sec + usage.ru_stime.tv_sec + (usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) * 1e-6;
    fprintf(file, "{\"cpu_seconds\": %f, \"wall_seconds\": %f, \"peak_kib\": %ld}\n", cpu, wall, usage.ru_maxrss);
    if (fclose(file) != 0) return 125;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}
