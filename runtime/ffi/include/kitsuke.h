#ifndef KITSUKE_H
#define KITSUKE_H

/* Written by the suite `doors` from runtime/ffi; change it there. */

#include <stddef.h>
#include <stdint.h>

// Grows whenever a function or struct of the interface changes.
#define KITSUKE_ABI_VERSION 2

// What became of a call.
enum kitsuke_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // All went well.
  KITSUKE_STATUS_OK = 0,
  // A pointer is null that must not be.
  KITSUKE_STATUS_NULL = 1,
  // A buffer is too short, or its offset or stride is no multiple of 4.
  KITSUKE_STATUS_BUFFER = 2,
  // A number names nothing: a vertex, frame, bone, text …
  KITSUKE_STATUS_RANGE = 3,
  // A pack cannot be opened.
  KITSUKE_STATUS_PACK = 4,
  // A recorded motion cannot be read.
  KITSUKE_STATUS_MOTION = 5,
  // A kimono cannot be fitted.
  KITSUKE_STATUS_FIT = 6,
  // A bug of kitsuke; the handle that was used is to be freed.
  KITSUKE_STATUS_PANIC = 7,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum kitsuke_status kitsuke_status;
#else
typedef int32_t kitsuke_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// In which axes places and poses go in and come out.
enum kitsuke_axes
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // glTF, VRM, three.js, Godot: right-handed, metres, Y up, front +Z, the wearer's left +X; outside is counter-clockwise.
  KITSUKE_AXES_GLTF = 0,
  // Unity, as UniVRM for VRM 1.0 and glTFast import: left-handed, metres, Y up, front +Z, left -X; outside is clockwise.
  KITSUKE_AXES_UNITY = 1,
  // Unreal, as its glTF importer: left-handed, centimetres, Z up, front +Y, left +X; outside is clockwise.
  KITSUKE_AXES_UNREAL = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum kitsuke_axes kitsuke_axes;
#else
typedef int32_t kitsuke_axes;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Texts of a kimono.
enum kitsuke_text
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The catalog's name.
  KITSUKE_TEXT_ID = 0,
  // The name people read.
  KITSUKE_TEXT_NAME = 1,
  // The body on which it was made.
  KITSUKE_TEXT_BODY = 2,
  // The texture's file name.
  KITSUKE_TEXT_TEXTURE = 3,
  // The name of a part.
  KITSUKE_TEXT_PART = 4,
  // The name of a target.
  KITSUKE_TEXT_TARGET = 5,
  // The name of a measured path.
  KITSUKE_TEXT_PATH = 6,
  // Its kanji.
  KITSUKE_TEXT_PATH_JA = 7,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum kitsuke_text kitsuke_text;
#else
typedef int32_t kitsuke_text;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What became of a fit.
enum kitsuke_verdict
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Every dimension is as wanted.
  KITSUKE_VERDICT_REACHABLE = 0,
  // Every dimension is as wanted, in a shape that no size vouches for.
  KITSUKE_VERDICT_STRAYED = 1,
  // A size was made for such a body and is worn as it is.
  KITSUKE_VERDICT_SIZE_DIFFERS = 2,
  // Some dimension cannot be reached.
  KITSUKE_VERDICT_OUT_OF_REACH = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum kitsuke_verdict kitsuke_verdict;
#else
typedef int32_t kitsuke_verdict;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A kimono with the working memory of one thread.
typedef struct kitsuke_evaluator kitsuke_evaluator;

// What fits one kimono to wearers, with the working memory of one thread and its last fit.
typedef struct kitsuke_fitter kitsuke_fitter;

// A recorded motion of any format that is read, on the wearer of one kimono.
typedef struct kitsuke_motion kitsuke_motion;

// A kimono: from a pack, or fitted to a wearer.
typedef struct kitsuke_pack kitsuke_pack;

// Receives a live wearer in the VMC protocol; the socket is the app's.
typedef struct kitsuke_receiver kitsuke_receiver;

// A pose: for every bone of VRM 1.0 the rotation relative to the T-pose in its parent's axes, which in the T-pose are the world's, and
// how far the hips have moved. What is no rotation counts as the T-pose.
typedef struct kitsuke_pose {
  // Quaternions x, y, z, w by the bones' numbers.
  float rotations[55][4];
  // From where they rest, in the axes' unit.
  float hips_translation[3];
} kitsuke_pose;

// Where the vectors of a vertex attribute go, 32-bit floats: alone in a buffer (`offset` 0, `stride` 12) or between other attributes.
typedef struct kitsuke_attribute {
  // The buffer, aligned to 4 bytes.
  float *data;
  // Its length, bytes.
  size_t bytes;
  // Where the first vector begins, bytes; a multiple of 4.
  size_t offset;
  // Bytes from vector to vector, a multiple of 4; 0 means that they lie close together.
  size_t stride;
} kitsuke_attribute;

// What a fit says as a whole.
typedef struct kitsuke_fit_information {
  // To be set by the caller: `sizeof` of this struct.
  uint32_t struct_size;
  // A [`VerdictKind`].
  int32_t verdict;
  // How far the cloth is from what wearers of the nearest sizes have, root mean square, metres.
  float moved_m;
  // How little the sizes' bodies say of this wearer: 0 for one of them, 1 far from all.
  float novelty;
} kitsuke_fit_information;

// What became of a dimension, metres along the surface.
typedef struct kitsuke_reach {
  // To be set by the caller: `sizeof` of this struct.
  uint32_t struct_size;
  // By the rules.
  float wanted_m;
  // On the fitted kimono.
  float reached_m;
  // The shortest that the sizes can give.
  float lowest_m;
  // The longest.
  float highest_m;
} kitsuke_reach;

// What there is of a motion.
typedef struct kitsuke_motion_information {
  // To be set by the caller: `sizeof` of this struct.
  uint32_t struct_size;
  // Frames, at least 1.
  uint32_t frame_count;
  // Time of the last frame, seconds.
  double length_s;
  // Sentences that say how the file was understood where it left that open.
  uint32_t note_count;
  // Unused.
  uint32_t reserved;
} kitsuke_motion_information;

// Counts of a kimono.
typedef struct kitsuke_pack_information {
  // To be set by the caller: `sizeof` of this struct.
  uint32_t struct_size;
  // Vertices of a frame, seam twins included.
  uint32_t vertex_count;
  // Of them those that are no seam twins; they come first.
  uint32_t unique_count;
  // Triangles.
  uint32_t triangle_count;
  // Named pieces of cloth, in triangle order.
  uint32_t part_count;
  // Target shapes.
  uint32_t target_count;
  // How many of the last targets belong to no pose.
  uint32_t corrective_count;
  // 1 if every vertex has texture coordinates.
  uint32_t has_uv;
  // 1 if it can be fitted to wearers.
  uint32_t has_sizes;
  // Vertices of the obi, 0 without one.
  uint32_t obi_vertex_count;
  // Triangles of the obi.
  uint32_t obi_triangle_count;
  // Measured paths.
  uint32_t path_count;
  // Width of the texture, pixels; 0 without one.
  uint32_t texture_width;
  // Height of the texture, pixels.
  uint32_t texture_height;
  // Bytes of the texture's PNG; 0 where the pack only names it.
  uint32_t texture_bytes;
  // Joints of the skeleton.
  uint32_t joint_count;
} kitsuke_pack_information;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of the interface that the library has; compare it with `KITSUKE_ABI_VERSION` of the header.
uint32_t kitsuke_abi_version(void);

// Memory for hosts that have no allocator of their own (WebAssembly): `length` bytes, aligned to 16, all 0; null when there is none.
uint8_t *kitsuke_bytes_new(size_t length);

// Frees memory of [`kitsuke_bytes_new`].
//
// # Safety
// `bytes` must be null or come from [`kitsuke_bytes_new`] with this `length`, and not have been freed.
void kitsuke_bytes_free(uint8_t *bytes, size_t length);

// Makes an evaluator of a kimono, one per thread; all its frames are in these axes.
//
// # Safety
// `pack` must be null or a handle, `evaluator` a place for a handle.
kitsuke_status kitsuke_evaluator_new(const struct kitsuke_pack *pack,
                                     int32_t axes,
                                     struct kitsuke_evaluator **evaluator);

// Frees an evaluator.
//
// # Safety
// `evaluator` must be null or a handle that has not been freed.
void kitsuke_evaluator_free(struct kitsuke_evaluator *evaluator);

// Writes the kimono in this pose: positions, and unit normals unless `normals` is null. In glTF's axes, where both lie close together in
// buffers of their own, nothing is copied. Does not allocate.
//
// # Safety
// `evaluator` must be null or a handle that no other thread uses, `pose` null or a pose; `positions` and `normals` null or attributes
// whose buffers are as long as they say. Both may lie in one buffer, side by side.
kitsuke_status kitsuke_evaluate(struct kitsuke_evaluator *evaluator,
                                const struct kitsuke_pose *pose,
                                const struct kitsuke_attribute *positions,
                                const struct kitsuke_attribute *normals);

// Writes the obi in this pose, which must be that of the kimono: positions, and unit normals unless `normals` is null. Does not allocate;
// writes nothing where there is no obi.
//
// # Safety
// As [`kitsuke_evaluate`].
kitsuke_status kitsuke_evaluate_obi(struct kitsuke_evaluator *evaluator,
                                    const struct kitsuke_pose *pose,
                                    const struct kitsuke_attribute *positions,
                                    const struct kitsuke_attribute *normals);

// How many measurements of bodies there are.
uint32_t kitsuke_measurement_count(void);

// Copies a measurement's name, for example `bust_girth`, as [`kitsuke_message`](crate::kitsuke_message) does; returns its length, 0
// when there is no such measurement.
//
// # Safety
// `buffer` must be null or have room for `capacity` bytes.
size_t kitsuke_measurement_name(uint32_t measurement,
                                uint8_t *buffer,
                                size_t capacity);

// The number of a measurement by its name, or -1.
//
// # Safety
// `name` must point to `length` bytes.
int32_t kitsuke_measurement_from_name(const uint8_t *name, size_t length);

// Makes a fitter; [`Status::Fit`] when the kimono has no sizes. Takes a fraction of a second.
//
// # Safety
// `pack` must be null or a handle, `fitter` a place for a handle.
kitsuke_status kitsuke_fitter_new(const struct kitsuke_pack *pack, struct kitsuke_fitter **fitter);

// Frees a fitter.
//
// # Safety
// `fitter` must be null or a handle that has not been freed.
void kitsuke_fitter_free(struct kitsuke_fitter *fitter);

// How many rule sets the kimono can be ordered by; the first is its own.
//
// # Safety
// `fitter` must be null or a handle.
uint32_t kitsuke_fitter_rule_set_count(const struct kitsuke_fitter *fitter);

// How many dimensions a fit has.
//
// # Safety
// `fitter` must be null or a handle.
uint32_t kitsuke_fitter_dimension_count(const struct kitsuke_fitter *fitter);

// Copies the name of a rule set (`dimension` 0) or of a dimension (`dimension` 1) as [`kitsuke_message`](crate::kitsuke_message) does;
// returns its whole length, 0 when there is none.
//
// # Safety
// `fitter` must be null or a handle, `buffer` null or have room for `capacity` bytes.
size_t kitsuke_fitter_text(const struct kitsuke_fitter *fitter,
                           uint32_t dimension,
                           uint32_t index,
                           uint8_t *buffer,
                           size_t capacity);

// Fits the kimono to a wearer: `measurements_m` has a number per measurement, metres, NaN where it is not known; `rules` counts rule
// sets from 0. `info`, if not null, gets the verdict, and [`kitsuke_message`](crate::kitsuke_message) then says it in words. `fitted`, if
// not null, gets a kimono of its own, which is posed and drawn as any other; without it a fit takes a fraction of a millisecond.
//
// # Safety
// `fitter` must be null or a handle that no other thread uses, `measurements_m` point to `count` numbers, `info` be null or a struct of
// as many bytes as its first field says, `fitted` null or a place for a handle.
kitsuke_status kitsuke_fit(struct kitsuke_fitter *fitter,
                           const float *measurements_m,
                           size_t count,
                           uint32_t rules,
                           struct kitsuke_fit_information *info,
                           struct kitsuke_pack **fitted);

// What became of a dimension in the last fit; [`Status::Fit`] before the first.
//
// # Safety
// `fitter` must be null or a handle, `reach` null or a struct of as many bytes as its first field says.
kitsuke_status kitsuke_fitter_reach(const struct kitsuke_fitter *fitter,
                                    uint32_t dimension,
                                    struct kitsuke_reach *reach);

// Makes a receiver for the wearer of a kimono.
//
// # Safety
// `pack` must be null or a handle, `receiver` a place for a handle.
kitsuke_status kitsuke_receiver_new(const struct kitsuke_pack *pack, struct kitsuke_receiver **receiver);

// Frees a receiver.
//
// # Safety
// `receiver` must be null or a handle that has not been freed.
void kitsuke_receiver_free(struct kitsuke_receiver *receiver);

// Takes a datagram that came at `now_s`, seconds on any clock that does not go back. `completed`, if not null, gets the number of poses
// that it completed. Datagrams that are wrong are passed over.
//
// # Safety
// `receiver` must be null or a handle that no other thread uses, `bytes` must point to `length` bytes, `completed` be null or a place
// for a number.
kitsuke_status kitsuke_receiver_datagram(struct kitsuke_receiver *receiver,
                                         const uint8_t *bytes,
                                         size_t length,
                                         double now_s,
                                         uint32_t *completed);

// The last whole pose, held and without confidence when it is older than `stale_after_s`. `confidence` as for recorded motion;
// `age_s`, if not null, gets the seconds since it came, infinite before the first.
//
// # Safety
// `receiver` must be null or a handle, `pose` null or a place for a pose, `confidence` null or have room for as many numbers as there
// are bones, `age_s` null or a place for a number.
kitsuke_status kitsuke_receiver_pose(const struct kitsuke_receiver *receiver,
                                     double now_s,
                                     double stale_after_s,
                                     int32_t axes,
                                     struct kitsuke_pose *pose,
                                     float (*confidence)[55],
                                     double *age_s);

// Takes the last whole pose as the sender's T-pose; [`Status::Range`] when there was none.
//
// # Safety
// `receiver` must be null or a handle that no other thread uses.
kitsuke_status kitsuke_receiver_calibrate(struct kitsuke_receiver *receiver);

// Reads a recorded motion: BVH, .vrma, VRM, MediaPipe, Kinect, DeepMimic or JSON Lines, told apart by content.
//
// # Safety
// `bytes` must point to `length` bytes, `pack` must be null or a handle, `motion` a place for a handle.
kitsuke_status kitsuke_motion_open(const uint8_t *bytes,
                                   size_t length,
                                   const struct kitsuke_pack *pack,
                                   struct kitsuke_motion **motion);

// Frees a motion.
//
// # Safety
// `motion` must be null or a handle that has not been freed.
void kitsuke_motion_free(struct kitsuke_motion *motion);

// Fills in what there is, as far as `struct_size` reaches.
//
// # Safety
// `motion` must be null or a handle, `info` null or a struct of as many bytes as its first field says.
kitsuke_status kitsuke_motion_info(const struct kitsuke_motion *motion, struct kitsuke_motion_information *info);

// Copies a note as [`kitsuke_message`](crate::kitsuke_message) does and returns its whole length, 0 when there is no such note.
//
// # Safety
// `motion` must be null or a handle, `buffer` null or have room for `capacity` bytes.
size_t kitsuke_motion_note(const struct kitsuke_motion *motion,
                           uint32_t index,
                           uint8_t *buffer,
                           size_t capacity);

// A frame's pose. `confidence`, if not null, gets a number from 0 to 1 per bone.
//
// # Safety
// `motion` must be null or a handle, `pose` null or a place for a pose, `confidence` null or have room for as many numbers as there are
// bones.
kitsuke_status kitsuke_motion_pose(const struct kitsuke_motion *motion,
                                   uint32_t frame,
                                   int32_t axes,
                                   struct kitsuke_pose *pose,
                                   float (*confidence)[55]);

// The pose at a time (seconds from the first frame; before it and after the last one these): between frames rotations go the shorter
// way.
//
// # Safety
// As [`kitsuke_motion_pose`].
kitsuke_status kitsuke_motion_pose_at(const struct kitsuke_motion *motion,
                                      double time_s,
                                      int32_t axes,
                                      struct kitsuke_pose *pose);

// Opens a pack. The bytes are not needed afterwards; they may be a stranger's.
//
// # Safety
// `bytes` must point to `length` bytes, `pack` to a place for a handle.
kitsuke_status kitsuke_pack_open(const uint8_t *bytes, size_t length, struct kitsuke_pack **pack);

// Frees a pack; evaluators, motions, receivers and fitters made from it stay as they are.
//
// # Safety
// `pack` must be null or a handle that has not been freed.
void kitsuke_pack_free(struct kitsuke_pack *pack);

// Fills in the counts, as far as `struct_size` reaches.
//
// # Safety
// `pack` must be null or a handle, `info` null or a struct of as many bytes as its first field says.
kitsuke_status kitsuke_pack_info(const struct kitsuke_pack *pack, struct kitsuke_pack_information *info);

// Copies a text as [`kitsuke_message`](crate::kitsuke_message) does; `length`, if not null, gets its whole length. `index` counts parts,
// targets or paths from 0 and is passed over elsewhere.
//
// # Safety
// `pack` must be null or a handle, `buffer` null or have room for `capacity` bytes, `length` null or a place for a number.
kitsuke_status kitsuke_pack_text(const struct kitsuke_pack *pack,
                                 int32_t text,
                                 uint32_t index,
                                 uint8_t *buffer,
                                 size_t capacity,
                                 size_t *length);

// How many indices [`kitsuke_pack_indices`] writes: three per triangle.
//
// # Safety
// `pack` must be null or a handle.
size_t kitsuke_pack_index_count(const struct kitsuke_pack *pack);

// Writes the corners of the triangles, wound as these axes want.
//
// # Safety
// `pack` must be null or a handle, `indices` null or have room for `count` numbers.
kitsuke_status kitsuke_pack_indices(const struct kitsuke_pack *pack, int32_t axes, uint32_t *indices, size_t count);

// The same for the obi.
//
// # Safety
// As [`kitsuke_pack_indices`].
kitsuke_status kitsuke_pack_obi_indices(const struct kitsuke_pack *pack, int32_t axes, uint32_t *indices, size_t count);

// Writes the texture coordinates of all vertices: v from the top in glTF and Unreal, from the bottom in Unity. Writes nothing
// where there are none.
//
// # Safety
// `pack` must be null or a handle, the attribute's buffer null or as long as it says.
kitsuke_status kitsuke_pack_uv(const struct kitsuke_pack *pack,
                               int32_t axes,
                               struct kitsuke_attribute uv);

// Copies the texture's PNG, as long as [`PackInfo`] says.
//
// # Safety
// `pack` must be null or a handle, `buffer` null or have room for `capacity` bytes.
kitsuke_status kitsuke_pack_texture(const struct kitsuke_pack *pack, uint8_t *buffer, size_t capacity);

// The length of a measured path in the T-pose, metres.
//
// # Safety
// `pack` must be null or a handle, `length_m` null or a place for a number.
kitsuke_status kitsuke_pack_path_length(const struct kitsuke_pack *pack, uint32_t index, float *length_m);

// Where a bone's joint rests in the T-pose, and the bone that carries it (-1: none), which may be null.
//
// # Safety
// `pack` must be null or a handle, `place` null or have room for three numbers, `parent` null or a place for a number.
kitsuke_status kitsuke_pack_joint(const struct kitsuke_pack *pack,
                                  int32_t axes,
                                  uint32_t bone,
                                  float *place,
                                  int32_t *parent);

// The pose of a target that belongs to one (all but the last [`PackInfo::corrective_count`]).
//
// # Safety
// `pack` must be null or a handle, `pose` null or a place for a pose.
kitsuke_status kitsuke_pack_target_pose(const struct kitsuke_pack *pack,
                                        int32_t axes,
                                        uint32_t target,
                                        struct kitsuke_pose *pose);

// How many bones there are: as many as [`PoseData`] has rotations.
uint32_t kitsuke_bone_count(void);

// Copies a bone's VRM 1.0 name, for example `leftUpperArm`, as [`kitsuke_message`](crate::kitsuke_message) does; returns its length,
// 0 when there is no such bone.
//
// # Safety
// `buffer` must be null or have room for `capacity` bytes.
size_t kitsuke_bone_name(uint32_t bone,
                         uint8_t *buffer,
                         size_t capacity);

// The bone that carries a bone in VRM 1.0, whose number is lower, or -1: none, or there is no such bone. A skeleton may lack bones; what
// carries a joint of a kimono's says [`kitsuke_pack_joint`](crate::kitsuke_pack_joint).
int32_t kitsuke_bone_parent(uint32_t bone);

// The number of a bone by its VRM 1.0 name, or -1.
//
// # Safety
// `name` must point to `length` bytes.
int32_t kitsuke_bone_from_name(const uint8_t *name, size_t length);

// The pose as the kimono allows it: show the wearer in this pose, too. `turned_rad`, if not null, gets the farthest that a joint was
// turned back.
//
// # Safety
// Pointers must be null or valid; `pose` and `limited` may be the same.
kitsuke_status kitsuke_limit(const struct kitsuke_pack *pack,
                             int32_t axes,
                             const struct kitsuke_pose *pose,
                             struct kitsuke_pose *limited,
                             float *turned_rad);

// Copies what the last call of this thread had to say, NUL-terminated and cut off after `capacity - 1` bytes, and returns its whole
// length in bytes without the NUL. Empty after a call without anything to say. `buffer` may be null when `capacity` is 0.
//
// # Safety
// `buffer` must have room for `capacity` bytes.
size_t kitsuke_message(uint8_t *buffer,
                       size_t capacity);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* KITSUKE_H */
