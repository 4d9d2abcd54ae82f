/* Frames through the C interface, timed: FOLDER holds a pack and poses; prints microseconds, the median over all poses of the median over
   passes. Run by `cargo xtask bench`. */
#define _POSIX_C_SOURCE 199309L
#include "kitsuke.h"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { PASSES = 9 };

static double now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, size_t count) {
    qsort(values, count, sizeof *values, ascending);
    return values[(count - 1) / 2];
}

static void *file(const char *folder, const char *name, size_t *length) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *from = fopen(path, "rb");
    if (!from) { perror(path); exit(1); }
    fseek(from, 0, SEEK_END);
    *length = (size_t)ftell(from);
    rewind(from);
    void *bytes = malloc(*length);
    if (fread(bytes, 1, *length, from) != *length) { perror(path); exit(1); }
    fclose(from);
    return bytes;
}

int main(int count, char **arguments) {
    if (count != 2) return 2;
    size_t length, pose_bytes;
    void *bytes = file(arguments[1], "garment.kitsuke", &length);
    kitsuke_pose *poses = file(arguments[1], "poses.f32", &pose_bytes);
    size_t pose_count = pose_bytes / sizeof *poses;
    kitsuke_pack *pack;
    kitsuke_evaluator *evaluator;
    kitsuke_pack_information info = {.struct_size = sizeof info};
    if (kitsuke_pack_open(bytes, length, &pack) || kitsuke_pack_info(pack, &info) ||
        kitsuke_evaluator_new(pack, KITSUKE_AXES_GLTF, &evaluator)) return 1;
    size_t room = 12 * (size_t)info.vertex_count;
    kitsuke_attribute positions = {malloc(room), room, 0, 0}, normals = {malloc(room), room, 0, 0};
    double *times = malloc(PASSES * pose_count * sizeof *times), *medians = malloc(pose_count * sizeof *medians);
    for (size_t pass = 0; pass < PASSES; pass++)
        for (size_t i = 0; i < pose_count; i++) {
            double begin = now_us();
            if (kitsuke_evaluate(evaluator, &poses[i], &positions, &normals)) return 1;
            times[i * PASSES + pass] = now_us() - begin;
        }
    for (size_t i = 0; i < pose_count; i++) medians[i] = median(&times[i * PASSES], PASSES);
    printf("frame_us %.3f\n", median(medians, pose_count));
    return 0;
}
