/* What a C program does with kitsuke, and what it must not get away with. Prints what it sees; the suite `doors` compares. */
#include "kitsuke.h"
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void fail(const char *what) {
    char message[512];
    kitsuke_message((uint8_t *)message, sizeof message);
    fprintf(stderr, "%s: %s\n", what, message);
    exit(1);
}

static void ok(kitsuke_status status, const char *what) {
    if (status != KITSUKE_STATUS_OK) fail(what);
}

/* A call that must be refused: with what status and message. */
static void refused(kitsuke_status status, const char *what) {
    char message[512];
    kitsuke_message((uint8_t *)message, sizeof message);
    if (status == KITSUKE_STATUS_OK) fail(what);
    printf("%s: status %d, %s\n", what, (int)status, message);
}

static uint8_t *file(const char *folder, const char *name, size_t *length) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *from = fopen(path, "rb");
    if (!from) { perror(path); exit(1); }
    fseek(from, 0, SEEK_END);
    *length = (size_t)ftell(from);
    rewind(from);
    uint8_t *bytes = malloc(*length ? *length : 1);
    if (fread(bytes, 1, *length, from) != *length) { perror(path); exit(1); }
    fclose(from);
    return bytes;
}

static kitsuke_attribute planar(float *data, size_t vertices) {
    kitsuke_attribute attribute = {data, vertices * 12, 0, 0};
    return attribute;
}

struct thread { const kitsuke_pack *pack; const kitsuke_pose *poses; size_t count, vertices; double sum; };

/* Every thread has an evaluator of its own; the pack is shared. */
static void *evaluate_all(void *given) {
    struct thread *own = given;
    kitsuke_evaluator *evaluator;
    ok(kitsuke_evaluator_new(own->pack, KITSUKE_AXES_GLTF, &evaluator), "evaluator of a thread");
    float *positions = malloc(own->vertices * 12);
    kitsuke_attribute attribute = planar(positions, own->vertices);
    own->sum = 0;
    for (size_t i = 0; i < own->count; i++) {
        ok(kitsuke_evaluate(evaluator, &own->poses[i], &attribute, NULL), "frame of a thread");
        for (size_t f = 0; f < 3 * own->vertices; f++) own->sum += positions[f];
    }
    free(positions);
    kitsuke_evaluator_free(evaluator);
    return NULL;
}

int main(int count, char **arguments) {
    if (count != 2) { fprintf(stderr, "usage: client FOLDER\n"); return 2; }
    const char *folder = arguments[1];
    if (kitsuke_abi_version() != KITSUKE_ABI_VERSION) { fprintf(stderr, "another library\n"); return 1; }

    size_t length;
    uint8_t *bytes = file(folder, "garment.kitsuke", &length);
    kitsuke_pack *pack;
    ok(kitsuke_pack_open(bytes, length, &pack), "open");
    kitsuke_pack_information info = {.struct_size = sizeof info};
    ok(kitsuke_pack_info(pack, &info), "info");
    char name[64], body[64];
    ok(kitsuke_pack_text(pack, KITSUKE_TEXT_NAME, 0, (uint8_t *)name, sizeof name, NULL), "name");
    ok(kitsuke_pack_text(pack, KITSUKE_TEXT_BODY, 0, (uint8_t *)body, sizeof body, NULL), "body");
    printf("%s on %s: %u vertices, %u triangles, %u targets, obi of %u, %u paths, texture %u x %u in %u bytes\n", name, body,
           info.vertex_count, info.triangle_count, info.target_count, info.obi_vertex_count, info.path_count,
           info.texture_width, info.texture_height, info.texture_bytes);
    char cut[4];
    size_t whole;
    ok(kitsuke_pack_text(pack, KITSUKE_TEXT_NAME, 0, (uint8_t *)cut, sizeof cut, &whole), "name cut off");
    printf("cut off at a character: %s of %zu bytes\n", cut, whole);
    float path_m;
    ok(kitsuke_pack_path_length(pack, 0, &path_m), "path");
    printf("path: %.4f m\n", (double)path_m);

    /* Frames, as they go to a GPU: positions, then normals, each in a buffer of its own. */
    size_t n = info.vertex_count, pose_bytes;
    kitsuke_pose *poses = (kitsuke_pose *)(void *)file(folder, "poses.f32", &pose_bytes);
    size_t pose_count = pose_bytes / sizeof *poses;
    kitsuke_evaluator *evaluator;
    ok(kitsuke_evaluator_new(pack, KITSUKE_AXES_GLTF, &evaluator), "evaluator");
    float *positions = malloc(n * 12), *normals = malloc(n * 12);
    kitsuke_attribute to_positions = planar(positions, n), to_normals = planar(normals, n);
    char out_path[4096];
    snprintf(out_path, sizeof out_path, "%s/frames.f32", folder);
    FILE *out = fopen(out_path, "wb");
    for (size_t i = 0; i < pose_count; i++) {
        ok(kitsuke_evaluate(evaluator, &poses[i], &to_positions, &to_normals), "frame");
        fwrite(positions, 12, n, out);
        fwrite(normals, 12, n, out);
    }
    fclose(out);

    /* The same interleaved: position, normal, texture coordinates, 32 bytes a vertex. */
    float *mixed = malloc(n * 32);
    kitsuke_attribute mixed_positions = {mixed, n * 32, 0, 32}, mixed_normals = {mixed, n * 32, 12, 32},
                      mixed_uv = {mixed, n * 32, 24, 32};
    ok(kitsuke_evaluate(evaluator, &poses[0], &to_positions, &to_normals), "frame");
    ok(kitsuke_evaluate(evaluator, &poses[0], &mixed_positions, &mixed_normals), "interleaved frame");
    ok(kitsuke_pack_uv(pack, KITSUKE_AXES_GLTF, mixed_uv), "interleaved texture coordinates");
    size_t others = 0;
    for (size_t v = 0; v < n; v++) {
        others += memcmp(&mixed[8 * v], &positions[3 * v], 12) != 0;
        others += memcmp(&mixed[8 * v + 3], &normals[3 * v], 12) != 0;
    }
    printf("interleaved: %zu differ\n", others);

    /* Unity and Unreal: poses go in and places come out in their axes, and the outside stays outside. */
    size_t indices = kitsuke_pack_index_count(pack);
    uint32_t *corners = malloc(indices * 4), *own_corners = malloc(indices * 4);
    ok(kitsuke_pack_indices(pack, KITSUKE_AXES_GLTF, corners, indices), "indices");
    for (int32_t axes = KITSUKE_AXES_UNITY; axes <= KITSUKE_AXES_UNREAL; axes++) {
        kitsuke_evaluator *other;
        ok(kitsuke_evaluator_new(pack, axes, &other), "evaluator in other axes");
        kitsuke_pose pose = poses[0];
        for (size_t b = 0; b < 55; b++) {
            float *q = pose.rotations[b];
            float x = q[0], y = q[1], z = q[2];
            if (axes == KITSUKE_AXES_UNITY) { q[1] = -y; q[2] = -z; }
            else { q[0] = -x; q[1] = -z; q[2] = -y; }
        }
        float *h = pose.hips_translation, y = h[1];
        if (axes == KITSUKE_AXES_UNITY) h[0] = -h[0];
        else { h[0] *= 100; h[1] = h[2] * 100; h[2] = y * 100; }
        float *there = malloc(n * 12), *there_normals = malloc(n * 12);
        kitsuke_attribute to_there = planar(there, n), to_there_normals = planar(there_normals, n);
        ok(kitsuke_evaluate(other, &pose, &to_there, &to_there_normals), "frame in other axes");
        double farthest = 0;
        for (size_t v = 0; v < n; v++) {
            float *p = &positions[3 * v], *q = &there[3 * v];
            double back[3] = {q[0], q[1], q[2]};
            if (axes == KITSUKE_AXES_UNITY) back[0] = -q[0];
            else { back[0] = q[0] / 100.0; back[1] = q[2] / 100.0; back[2] = q[1] / 100.0; }
            for (int c = 0; c < 3; c++) if (fabs(back[c] - p[c]) > farthest) farthest = fabs(back[c] - p[c]);
        }
        ok(kitsuke_pack_indices(pack, axes, own_corners, indices), "indices in other axes");
        printf("axes %d: %s, first triangle %u %u %u for %u %u %u\n", (int)axes, farthest < 1e-5 ? "the same places" : "OTHER PLACES",
               own_corners[0], own_corners[1], own_corners[2], corners[0], corners[1], corners[2]);
        free(there);
        free(there_normals);
        kitsuke_evaluator_free(other);
    }

    /* The obi, the pose as the kimono allows it, a bone by name. */
    float *obi = malloc(info.obi_vertex_count * 12);
    kitsuke_attribute to_obi = planar(obi, info.obi_vertex_count);
    float *obi_normals = malloc(info.obi_vertex_count * 12);
    kitsuke_attribute to_obi_normals = planar(obi_normals, info.obi_vertex_count);
    ok(kitsuke_evaluate_obi(evaluator, &poses[0], &to_obi, &to_obi_normals), "obi");
    ok(kitsuke_evaluate_obi(evaluator, &poses[0], &to_obi, NULL), "obi without normals");
    double longest = 0;
    for (uint32_t v = 0; v < info.obi_vertex_count; v++) {
        const float *n = obi_normals + 3 * v;
        longest = fmax(longest, fabs(sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) - 1));
    }
    printf("normals of the obi are of length 1: %s; leftHand hangs on %d, hips on %d, 99 on %d\n", longest < 1e-5 ? "yes" : "no",
           (int)kitsuke_bone_parent(20), (int)kitsuke_bone_parent(0), (int)kitsuke_bone_parent(99));
    kitsuke_pose limited;
    float turned;
    ok(kitsuke_limit(pack, KITSUKE_AXES_GLTF, &poses[0], &limited, &turned), "limit");
    printf("limited: turned back by more than nothing: %s; bones: %u, leftUpperArm is %d, noBone %d\n", turned > 0 ? "yes" : "no",
           kitsuke_bone_count(), (int)kitsuke_bone_from_name((const uint8_t *)"leftUpperArm", 12),
           (int)kitsuke_bone_from_name((const uint8_t *)"noBone", 6));

    /* A recorded motion. */
    size_t motion_bytes;
    uint8_t *bvh = file(folder, "motion.bvh", &motion_bytes);
    kitsuke_motion *motion;
    ok(kitsuke_motion_open(bvh, motion_bytes, pack, &motion), "motion");
    kitsuke_motion_information motion_info = {.struct_size = sizeof motion_info};
    ok(kitsuke_motion_info(motion, &motion_info), "motion info");
    kitsuke_pose at;
    ok(kitsuke_motion_pose_at(motion, motion_info.length_s / 2, KITSUKE_AXES_GLTF, &at), "pose at a time");
    ok(kitsuke_evaluate(evaluator, &at, &to_positions, &to_normals), "frame of a motion");
    printf("motion: %u frames, %.2f s\n", motion_info.frame_count, motion_info.length_s);
    refused(kitsuke_motion_pose(motion, motion_info.frame_count, KITSUKE_AXES_GLTF, &at, NULL), "frame beyond the end");
    kitsuke_motion_free(motion);

    /* A fit, and the fitted kimono posed. */
    kitsuke_fitter *fitter;
    ok(kitsuke_fitter_new(pack, &fitter), "fitter");
    float *measurements = malloc(kitsuke_measurement_count() * sizeof *measurements);
    for (uint32_t m = 0; m < kitsuke_measurement_count(); m++) measurements[m] = NAN;
    measurements[kitsuke_measurement_from_name((const uint8_t *)"body_height", 11)] = 1.62f;
    measurements[kitsuke_measurement_from_name((const uint8_t *)"bust_girth", 10)] = 0.9f;
    measurements[kitsuke_measurement_from_name((const uint8_t *)"hip_girth", 9)] = 0.95f;
    kitsuke_fit_information fit = {.struct_size = sizeof fit};
    kitsuke_pack *fitted = NULL;
    kitsuke_status status = kitsuke_fit(fitter, measurements, kitsuke_measurement_count(), 0, &fit, &fitted);
    char said[512];
    kitsuke_message((uint8_t *)said, sizeof said);
    printf("fit: status %d, verdict %d, %s\n", (int)status, (int)fit.verdict, said);
    if (fitted) {
        kitsuke_evaluator *worn;
        ok(kitsuke_evaluator_new(fitted, KITSUKE_AXES_GLTF, &worn), "evaluator of the fitted kimono");
        kitsuke_pack_free(fitted);
        ok(kitsuke_evaluate(worn, &poses[1], &to_positions, &to_normals), "frame of the fitted kimono");
        kitsuke_evaluator_free(worn);
    }
    refused(kitsuke_fit(fitter, measurements, 0, 9, NULL, NULL), "rule set that there is not");
    kitsuke_fitter_free(fitter);

    /* What must be refused. */
    refused(kitsuke_pack_open(bytes, length / 2, &(kitsuke_pack *){NULL}), "half a pack");
    refused(kitsuke_pack_open(NULL, 9, &(kitsuke_pack *){NULL}), "no bytes");
    refused(kitsuke_pack_open(bytes, length, NULL), "no place for the handle");
    refused(kitsuke_pack_info(NULL, &info), "no pack");
    refused(kitsuke_pack_info(pack, &(kitsuke_pack_information){.struct_size = 0}), "struct_size left out");
    refused(kitsuke_evaluator_new(pack, 7, &(kitsuke_evaluator *){NULL}), "axes that there are not");
    refused(kitsuke_pack_text(pack, KITSUKE_TEXT_TARGET, 99, NULL, 0, NULL), "target that there is not");
    refused(kitsuke_pack_indices(pack, KITSUKE_AXES_GLTF, corners, indices - 1), "short buffer of indices");
    refused(kitsuke_evaluate(NULL, &poses[0], &to_positions, NULL), "no evaluator");
    refused(kitsuke_evaluate(evaluator, NULL, &to_positions, NULL), "no pose");
    refused(kitsuke_evaluate(evaluator, &poses[0], NULL, NULL), "no attribute");
    kitsuke_attribute bad = to_positions;
    bad.bytes -= 1;
    refused(kitsuke_evaluate(evaluator, &poses[0], &bad, NULL), "buffer short by a byte");
    bad = to_positions;
    bad.stride = 10;
    refused(kitsuke_evaluate(evaluator, &poses[0], &bad, NULL), "stride of 10");
    bad.stride = SIZE_MAX - 3;
    refused(kitsuke_evaluate(evaluator, &poses[0], &bad, NULL), "stride beyond memory");
    bad = to_positions;
    bad.data = NULL;
    refused(kitsuke_evaluate(evaluator, &poses[0], &bad, NULL), "buffer that is null");
    kitsuke_pose nonsense = poses[0];
    for (size_t b = 0; b < 55; b++) for (int c = 0; c < 4; c++) nonsense.rotations[b][c] = NAN;
    ok(kitsuke_evaluate(evaluator, &nonsense, &to_positions, &to_normals), "a pose that is none counts as the T-pose");

    /* Hostile packs: a changed byte at every place. */
    size_t opened = 0;
    for (size_t i = 0; i < length; i++) {
        kitsuke_pack *damaged;
        bytes[i] ^= 0x40;
        if (kitsuke_pack_open(bytes, length, &damaged) == KITSUKE_STATUS_OK) opened++;
        kitsuke_pack_free(damaged);
        bytes[i] ^= 0x40;
    }
    printf("damaged packs opened: %zu\n", opened);

    /* Four threads, one pack. */
    struct thread threads[4];
    pthread_t running[4];
    for (int t = 0; t < 4; t++) {
        threads[t] = (struct thread){pack, poses, pose_count, n, 0};
        pthread_create(&running[t], NULL, evaluate_all, &threads[t]);
    }
    for (int t = 0; t < 4; t++) pthread_join(running[t], NULL);
    printf("threads: %s\n", threads[0].sum == threads[1].sum && threads[1].sum == threads[2].sum && threads[2].sum == threads[3].sum ? "the same" : "DIFFERENT");

    kitsuke_evaluator_free(evaluator);
    kitsuke_pack_free(pack);
    kitsuke_pack_free(NULL);
    free(bytes); free(poses); free(positions); free(normals); free(mixed); free(corners); free(own_corners); free(obi); free(obi_normals);
    free(bvh); free(measurements);
    return 0;
}
