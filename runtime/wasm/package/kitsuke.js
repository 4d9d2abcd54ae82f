// The runtime of kitsuke for the web: a thin shell over the C interface (runtime/ffi), which the module exports as it is.
// Metres, right-handed, Y up, front +Z (glTF, three.js); texture coordinates count v from the top (glTF, flipY = false).
//
// Handles live in the module's memory and are given back with free() (or `using`). Frames are views into that memory: take them anew
// after every call, because memory that grows moves.

const ABI_VERSION = 2;
const GLTF = 0;
const BONES = 55;
const POSE_FLOATS = 4 * BONES + 3;
const TEXT = { id: 0, name: 1, body: 2, texture: 3, part: 4, target: 5, path: 6, pathJa: 7 };
const VERDICTS = ["reachable", "strayed", "size-differs", "out-of-reach"];

/** What the runtime refuses, in its own words. */
export class KitsukeError extends Error {
  name = "KitsukeError";

  constructor(status, message) {
    super(message);
    this.status = status;
  }
}

/**
 * A runtime of its own, with memory of its own. `source` is the module's bytes, a WebAssembly.Module or a Response; without it
 * `kitsuke.wasm` beside this file is read.
 */
export async function instantiate(source) {
  const found = await (source ?? own());
  if (found instanceof WebAssembly.Module) return new Kitsuke(await WebAssembly.instantiate(found, {}));
  const bytes = typeof Response !== "undefined" && found instanceof Response ? await found.arrayBuffer() : found;
  return new Kitsuke((await WebAssembly.instantiate(bytes, {})).instance);
}

async function own() {
  const url = new URL("kitsuke.wasm", import.meta.url);
  if (url.protocol !== "file:") {
    const response = await fetch(url);
    if (!response.ok) throw new Error(`${url} cannot be read: ${response.status}`);
    return response;
  }
  const { readFile } = await import("node:fs/promises");
  return readFile(url);
}

let shared;

/** `await ready` gives a runtime that all who wait share; nothing is read before somebody does. */
export const ready = { then: (done, failed) => (shared ??= instantiate()).then(done, failed) };

/** A pose: rotations (x, y, z, w) by bone relative to the T-pose, then how far the hips have moved, metres. */
export class Pose {
  /** @param {Float32Array} [data] 223 numbers that the pose is to use */
  constructor(data) {
    this.data = data ?? new Float32Array(POSE_FLOATS);
    if (this.data.length !== POSE_FLOATS) throw new RangeError(`a pose has ${POSE_FLOATS} numbers, not ${this.data.length}`);
    if (!data) this.reset();
  }

  /** Back to the T-pose. */
  reset() {
    this.data.fill(0);
    for (let bone = 0; bone < BONES; bone++) this.data[4 * bone + 3] = 1;
    return this;
  }

  /** The rotation of a bone by its number, a view of four numbers. */
  rotation(bone) {
    return this.data.subarray(4 * bone, 4 * bone + 4);
  }

  /** How far the hips have moved, a view of three numbers. */
  get hips() {
    return this.data.subarray(4 * BONES);
  }
}

/** The runtime. */
export class Kitsuke {
  constructor(instance) {
    this.c = instance.exports;
    const version = this.c.kitsuke_abi_version();
    if (version !== ABI_VERSION) throw new Error(`kitsuke.wasm has interface ${version}, kitsuke.js knows ${ABI_VERSION}`);
    // Room for what calls hand back: a handle, a number, an attribute, a struct, a pose and confidences.
    this.scratch = this.bytes(4096);
    this.bones = this.names(this.c.kitsuke_bone_count(), this.c.kitsuke_bone_name);
    const measurements = this.c.kitsuke_measurement_count;
    this.measurements = measurements ? this.names(measurements(), this.c.kitsuke_measurement_name) : [];
    this.parents = this.bones.map((_, number) => this.c.kitsuke_bone_parent(number)).map((carrier) => (carrier < 0 ? null : this.bones[carrier]));
    this.boneNumbers = new Map(this.bones.map((name, number) => [name, number]));
  }

  /** Opens a pack (bytes, which may be a stranger's). */
  openPack(bytes) {
    const handle = this.withBytes(bytes, (at, length) => this.made((to) => this.c.kitsuke_pack_open(at, length, to)));
    return new Pack(this, handle);
  }

  /** The number of a bone by its VRM 1.0 name. */
  bone(name) {
    const number = this.boneNumbers.get(name);
    if (number === undefined) throw new RangeError(`there is no bone ${name}; bones have the names of VRM 1.0`);
    return number;
  }

  /** A pose with these bones turned: `{ leftUpperArm: [x, y, z, w] }`. */
  pose(rotations = {}) {
    const pose = new Pose();
    for (const [name, rotation] of Object.entries(rotations)) pose.rotation(this.bone(name)).set(rotation);
    return pose;
  }

  // What follows is for this file.

  /** Whether the module can do something; `kitsuke-core.wasm` has packs and frames alone. */
  need(name, what) {
    if (!(name in this.c)) throw new Error(`this module has no ${what}: use kitsuke.wasm`);
  }

  /** Views of the memory, made anew when it has grown. */
  get memory() {
    const { buffer } = this.c.memory;
    if (this.views?.buffer !== buffer) {
      const [u8, u32, f32, f64] = [Uint8Array, Uint32Array, Float32Array, Float64Array].map((View) => new View(buffer));
      this.views = { buffer, u8, u32, f32, f64 };
    }
    return this.views;
  }

  bytes(length) {
    const at = this.c.kitsuke_bytes_new(length);
    if (at === 0) throw new RangeError(`there is no memory for ${length} bytes`);
    return at >>> 0;
  }

  withBytes(bytes, use) {
    const from = ArrayBuffer.isView(bytes) ? new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength) : new Uint8Array(bytes);
    const at = this.bytes(from.length);
    try {
      this.memory.u8.set(from, at);
      return use(at, from.length);
    } finally {
      this.c.kitsuke_bytes_free(at, from.length);
    }
  }

  /** A text of the interface: `write(buffer, capacity)` returns its whole length. */
  text(write) {
    let room = 256;
    for (;;) {
      const at = this.bytes(room);
      const length = write(at, room) >>> 0;
      const text = length < room ? new TextDecoder().decode(this.memory.u8.subarray(at, at + length)) : null;
      this.c.kitsuke_bytes_free(at, room);
      if (text !== null) return text;
      room = length + 1;
    }
  }

  names(count, name) {
    return Array.from({ length: count }, (_, number) => this.text((at, room) => name(number, at, room)));
  }

  get message() {
    return this.text((at, room) => this.c.kitsuke_message(at, room));
  }

  ok(status) {
    if (status !== 0) throw new KitsukeError(status, this.message);
  }

  /** The handle that `make(place)` makes. */
  made(make) {
    this.ok(make(this.scratch));
    return this.memory.u32[this.scratch >> 2];
  }

  /** A struct whose first field is its size: that many bytes, as the interface fills them in. */
  struct(bytes, fill) {
    this.memory.u8.fill(0, this.scratch, this.scratch + bytes);
    this.memory.u32[this.scratch >> 2] = bytes;
    this.ok(fill(this.scratch));
    return this.scratch;
  }

  /** An attribute of `count` vectors of `floats` numbers that lie close together at `at`. */
  attribute(place, at, count, floats = 3) {
    this.memory.u32.set([at, 4 * floats * count, 0, 0], place >> 2);
    return place;
  }

  /** Copies a pose into the memory, hands its place on, and returns the place. */
  poseIn(pose) {
    this.memory.f32.set(pose.data, (this.scratch + 256) >> 2);
    return this.scratch + 256;
  }

  poseOut(pose = new Pose()) {
    const at = (this.scratch + 256) >> 2;
    pose.data.set(this.memory.f32.subarray(at, at + POSE_FLOATS));
    return pose;
  }
}

/** What is freed once. */
class Handle {
  constructor(kitsuke, handle, free) {
    this.kitsuke = kitsuke;
    this.handle = handle;
    this.release = free;
  }

  get c() {
    if (this.handle === 0) throw new Error("it was freed");
    return this.kitsuke.c;
  }

  free() {
    if (this.handle !== 0) this.release(this.handle);
    this.handle = 0;
  }

  [Symbol.dispose ?? Symbol.for("Symbol.dispose")]() {
    this.free();
  }
}

/** A kimono: from a pack, or fitted to a wearer. */
export class Pack extends Handle {
  constructor(kitsuke, handle) {
    super(kitsuke, handle, kitsuke.c.kitsuke_pack_free);
    const info = kitsuke.struct(64, (to) => kitsuke.c.kitsuke_pack_info(handle, to)) >> 2;
    const [, vertexCount, uniqueCount, triangleCount, parts, targets, correctiveCount, hasUv, hasSizes, obiVertices, obiTriangles, paths, width, height, png, jointCount] =
      kitsuke.memory.u32.slice(info, info + 16);
    Object.assign(this, { vertexCount, uniqueCount, triangleCount, correctiveCount, jointCount, hasUv: hasUv === 1, hasSizes: hasSizes === 1 });
    this.id = this.text(TEXT.id);
    this.name = this.text(TEXT.name);
    this.body = this.text(TEXT.body);
    this.parts = this.texts(TEXT.part, parts);
    this.targets = this.texts(TEXT.target, targets);
    this.obi = obiVertices > 0 ? { vertexCount: obiVertices, triangleCount: obiTriangles } : null;
    this.texture = width > 0 ? { name: this.text(TEXT.texture), width, height, byteLength: png } : null;
    const ja = this.texts(TEXT.pathJa, paths);
    this.paths = this.texts(TEXT.path, paths).map((name, index) => ({ name, ja: ja[index], length: this.pathLength(index) }));
  }

  text(which, index = 0) {
    const { kitsuke } = this;
    return kitsuke.text((at, room) => {
      kitsuke.ok(this.c.kitsuke_pack_text(this.handle, which, index, at, room, kitsuke.scratch));
      return kitsuke.memory.u32[kitsuke.scratch >> 2];
    });
  }

  texts(which, count) {
    return Array.from({ length: count }, (_, index) => this.text(which, index));
  }

  pathLength(index) {
    this.kitsuke.ok(this.c.kitsuke_pack_path_length(this.handle, index, this.kitsuke.scratch));
    return this.kitsuke.memory.f32[this.kitsuke.scratch >> 2];
  }

  /** Three vertex numbers per triangle, counter-clockwise from outside: a copy. */
  indices() {
    return this.copied(Uint32Array, 3 * this.triangleCount, (at, count) => this.c.kitsuke_pack_indices(this.handle, GLTF, at, count));
  }

  /** The same for the obi. */
  obiIndices() {
    const count = 3 * (this.obi?.triangleCount ?? 0);
    return this.copied(Uint32Array, count, (at) => this.c.kitsuke_pack_obi_indices(this.handle, GLTF, at, count));
  }

  /** Two texture coordinates per vertex, v from the top: a copy; empty where there are none. */
  uv() {
    const count = this.hasUv ? this.vertexCount : 0;
    const to = this.kitsuke.scratch;
    return this.copied(Float32Array, 2 * count, (at) =>
      this.c.kitsuke_pack_uv(this.handle, GLTF, this.kitsuke.attribute(to, at, count, 2)));
  }

  /** The texture's PNG: a copy; null where the pack has none. */
  texturePng() {
    const length = this.texture?.byteLength ?? 0;
    return length === 0 ? null : this.copied(Uint8Array, length, (at) => this.c.kitsuke_pack_texture(this.handle, at, length));
  }

  copied(View, length, write) {
    const { kitsuke } = this;
    const bytes = length * View.BYTES_PER_ELEMENT;
    const at = kitsuke.bytes(bytes);
    try {
      kitsuke.ok(write(at, length));
      return new View(kitsuke.memory.buffer, at, length).slice();
    } finally {
      kitsuke.c.kitsuke_bytes_free(at, bytes);
    }
  }

  /** Where a bone's joint rests, metres, and the bone that carries it (null: none); null where the skeleton lacks the bone. */
  joint(name) {
    const { kitsuke } = this;
    const [place, parent] = [kitsuke.scratch, kitsuke.scratch + 16];
    const status = this.c.kitsuke_pack_joint(this.handle, GLTF, kitsuke.bone(name), place, parent);
    if (status !== 0) return null;
    const rest = Array.from(kitsuke.memory.f32.subarray(place >> 2, (place >> 2) + 3));
    const carrier = kitsuke.memory.u32[parent >> 2] | 0;
    return { rest, parent: carrier < 0 ? null : kitsuke.bones[carrier] };
  }

  /** The pose of a target; the last `correctiveCount` targets have none. */
  targetPose(index) {
    this.kitsuke.ok(this.c.kitsuke_pack_target_pose(this.handle, GLTF, index, this.kitsuke.scratch + 256));
    return this.kitsuke.poseOut();
  }

  /** The pose as the kimono allows it, and how far a joint was turned back at most: show the wearer in this pose, too. */
  limit(pose, into) {
    const { kitsuke } = this;
    const at = kitsuke.poseIn(pose);
    kitsuke.ok(this.c.kitsuke_limit(this.handle, GLTF, at, at, kitsuke.scratch));
    const turnedRad = kitsuke.memory.f32[kitsuke.scratch >> 2];
    return { pose: kitsuke.poseOut(into), turnedRad };
  }

  /** What makes frames; each has buffers of its own. */
  evaluator() {
    return new Evaluator(this);
  }

  /** Reads a recorded motion (BVH, .vrma, VRM, MediaPipe, Kinect, DeepMimic, JSON Lines: told apart by content) on this wearer. */
  openMotion(bytes) {
    const { kitsuke } = this;
    kitsuke.need("kitsuke_motion_open", "recorded motion");
    const open = (at, length) => kitsuke.made((to) => this.c.kitsuke_motion_open(at, length, this.handle, to));
    return new Motion(kitsuke, kitsuke.withBytes(bytes, open));
  }

  /** What receives a live wearer in the VMC protocol; the datagrams are the app's to get. */
  receiver() {
    this.kitsuke.need("kitsuke_receiver_new", "live wearers");
    return new Receiver(this.kitsuke, this.kitsuke.made((to) => this.c.kitsuke_receiver_new(this.handle, to)));
  }

  /** What fits the kimono to wearers. Takes a while: keep it. */
  fitter() {
    this.kitsuke.need("kitsuke_fitter_new", "fits");
    return new Fitter(this.kitsuke, this.kitsuke.made((to) => this.c.kitsuke_fitter_new(this.handle, to)));
  }
}

/** Frames of one kimono. */
export class Evaluator extends Handle {
  constructor(pack) {
    const { kitsuke } = pack;
    super(kitsuke, kitsuke.made((to) => pack.c.kitsuke_evaluator_new(pack.handle, GLTF, to)), kitsuke.c.kitsuke_evaluator_free);
    this.counts = { cloth: pack.vertexCount, obi: pack.obi?.vertexCount ?? 0 };
    const { cloth, obi } = this.counts;
    this.room = 24 * (cloth + obi) + 64;
    this.at = kitsuke.bytes(this.room);
    this.places = { positions: this.at, normals: this.at + 12 * cloth, obi: this.at + 24 * cloth, obiNormals: this.at + 24 * cloth + 12 * obi };
    const attributes = this.at + 24 * (cloth + obi);
    this.attributes = {
      positions: kitsuke.attribute(attributes, this.places.positions, cloth),
      normals: kitsuke.attribute(attributes + 16, this.places.normals, cloth),
      obi: kitsuke.attribute(attributes + 32, this.places.obi, obi),
      obiNormals: kitsuke.attribute(attributes + 48, this.places.obiNormals, obi),
    };
  }

  /** Puts the kimono into a pose: then `positions` and, unless told otherwise, `normals` are its. */
  evaluate(pose, { normals = true } = {}) {
    const { c, kitsuke, attributes } = this;
    kitsuke.ok(c.kitsuke_evaluate(this.handle, kitsuke.poseIn(pose), attributes.positions, normals ? attributes.normals : 0));
  }

  /** Puts the obi into the pose of the kimono: then `obiPositions` and, unless told otherwise, `obiNormals` are its. */
  evaluateObi(pose, { normals = true } = {}) {
    const { c, kitsuke, attributes } = this;
    kitsuke.ok(c.kitsuke_evaluate_obi(this.handle, kitsuke.poseIn(pose), attributes.obi, normals ? attributes.obiNormals : 0));
  }

  /** Metres, three numbers per vertex: a view, to be taken anew after every call. */
  get positions() {
    return this.view(this.places.positions, this.counts.cloth);
  }

  /** Unit normals, likewise. */
  get normals() {
    return this.view(this.places.normals, this.counts.cloth);
  }

  /** The obi's positions, likewise. */
  get obiPositions() {
    return this.view(this.places.obi, this.counts.obi);
  }

  /** The obi's normals, likewise. */
  get obiNormals() {
    return this.view(this.places.obiNormals, this.counts.obi);
  }

  view(at, count) {
    return new Float32Array(this.kitsuke.memory.buffer, at, 3 * count);
  }

  free() {
    if (this.handle !== 0) this.kitsuke.c.kitsuke_bytes_free(this.at, this.room);
    super.free();
  }
}

/** A recorded motion. */
export class Motion extends Handle {
  constructor(kitsuke, handle) {
    super(kitsuke, handle, kitsuke.c.kitsuke_motion_free);
    const info = kitsuke.struct(24, (to) => kitsuke.c.kitsuke_motion_info(handle, to));
    this.frameCount = kitsuke.memory.u32[(info >> 2) + 1];
    this.length = kitsuke.memory.f64[(info >> 3) + 1];
    const notes = kitsuke.memory.u32[(info >> 2) + 4];
    this.notes = kitsuke.names(notes, (number, at, room) => kitsuke.c.kitsuke_motion_note(handle, number, at, room));
  }

  /** A frame's pose and a confidence from 0 to 1 per bone. */
  frame(number) {
    const { kitsuke } = this;
    const confidence = kitsuke.scratch + 2048;
    kitsuke.ok(this.c.kitsuke_motion_pose(this.handle, number, GLTF, kitsuke.scratch + 256, confidence));
    return { pose: kitsuke.poseOut(), confidence: kitsuke.memory.f32.slice(confidence >> 2, (confidence >> 2) + BONES) };
  }

  /** The pose at a time, seconds from the first frame. */
  poseAt(seconds, into) {
    this.kitsuke.ok(this.c.kitsuke_motion_pose_at(this.handle, seconds, GLTF, this.kitsuke.scratch + 256));
    return this.kitsuke.poseOut(into);
  }
}

/** A live wearer. */
export class Receiver extends Handle {
  constructor(kitsuke, handle) {
    super(kitsuke, handle, kitsuke.c.kitsuke_receiver_free);
  }

  /** Takes a datagram that came at a time, seconds; returns how many poses it completed. */
  datagram(bytes, seconds) {
    const { kitsuke } = this;
    kitsuke.withBytes(bytes, (at, length) =>
      kitsuke.ok(this.c.kitsuke_receiver_datagram(this.handle, at, length, seconds, kitsuke.scratch)));
    return kitsuke.memory.u32[kitsuke.scratch >> 2];
  }

  /** The last whole pose, how long ago it came, and a confidence per bone, 0 once it is older than `staleAfter` seconds. */
  pose(seconds, staleAfter = 0.5, into) {
    const { kitsuke } = this;
    const [age, confidence] = [kitsuke.scratch + 8, kitsuke.scratch + 2048];
    kitsuke.ok(this.c.kitsuke_receiver_pose(this.handle, seconds, staleAfter, GLTF, kitsuke.scratch + 256, confidence, age));
    const found = kitsuke.memory.f32.slice(confidence >> 2, (confidence >> 2) + BONES);
    return { pose: kitsuke.poseOut(into), confidence: found, age: kitsuke.memory.f64[age >> 3] };
  }

  /** Takes the last whole pose as the sender's T-pose. */
  calibrate() {
    this.kitsuke.ok(this.c.kitsuke_receiver_calibrate(this.handle));
  }
}

/** What fits one kimono to wearers. */
export class Fitter extends Handle {
  constructor(kitsuke, handle) {
    super(kitsuke, handle, kitsuke.c.kitsuke_fitter_free);
    const name = (dimension) => (number, at, room) => kitsuke.c.kitsuke_fitter_text(handle, dimension, number, at, room);
    this.ruleSets = kitsuke.names(kitsuke.c.kitsuke_fitter_rule_set_count(handle), name(0));
    this.dimensions = kitsuke.names(kitsuke.c.kitsuke_fitter_dimension_count(handle), name(1));
  }

  /**
   * Fits the kimono to a wearer: `{ body_height: 1.62, bust_girth: 0.88, hip_girth: 0.95 }`, metres. With `pack: true` the answer has
   * a kimono of its own, which is posed as any other.
   */
  fit(measurements, { rules = 0, pack = false } = {}) {
    const { kitsuke } = this;
    const known = new Float32Array(kitsuke.measurements.length).fill(NaN);
    for (const [name, metres] of Object.entries(measurements)) {
      const number = kitsuke.measurements.indexOf(name);
      if (number < 0) throw new RangeError(`there is no measurement ${name}; there are ${kitsuke.measurements.join(", ")}`);
      known[number] = metres;
    }
    const [info, to] = [kitsuke.scratch, pack ? kitsuke.scratch + 32 : 0];
    kitsuke.memory.u32.set([16, 0, 0, 0], info >> 2);
    kitsuke.withBytes(known, (at) => kitsuke.ok(this.c.kitsuke_fit(this.handle, at, known.length, rules, info, to)));
    const { u32, f32 } = kitsuke.memory;
    const fit = {
      verdict: VERDICTS[u32[(info >> 2) + 1]],
      moved: f32[(info >> 2) + 2],
      novelty: f32[(info >> 2) + 3],
      pack: null,
    };
    const fitted = u32[to >> 2];
    fit.words = kitsuke.message;
    fit.dimensions = this.dimensions.map((name, dimension) => ({ name, ...this.reach(dimension) }));
    if (pack) fit.pack = new Pack(kitsuke, fitted);
    return fit;
  }

  reach(dimension) {
    const at = this.kitsuke.struct(20, (to) => this.c.kitsuke_fitter_reach(this.handle, dimension, to)) >> 2;
    const [, wanted, reached, lowest, highest] = this.kitsuke.memory.f32.slice(at, at + 5);
    return { wanted, reached, lowest, highest };
  }
}
