// Reads raw float64 positions, and tells the figures of a part of the process.
#pragma once
#include <sys/resource.h>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

inline std::vector<double> positions(const char* path) {
    FILE* file = std::fopen(path, "rb");
    if (!file) { std::perror(path); std::exit(1); }
    std::fseek(file, 0, SEEK_END);
    std::vector<double> values(std::ftell(file) / sizeof(double));
    std::rewind(file);
    if (std::fread(values.data(), sizeof(double), values.size(), file) != values.size()) std::exit(1);
    std::fclose(file);
    return values;
}

inline double cpu() {
    rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_utime.tv_sec + usage.ru_stime.tv_sec + (usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) * 1e-6;
}

inline double wall() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

inline void tell(double cpu_before, double wall_before) {
    std::printf("{\"cpu_seconds\": %f, \"wall_seconds\": %f}\n", cpu() - cpu_before, wall() - wall_before);
}
