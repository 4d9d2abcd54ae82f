/** What the runtime refuses, in its own words. */
export class KitsukeError extends Error {
  readonly status: number;
}

type Source = BufferSource | WebAssembly.Module | Response;

/** A runtime of its own, with memory of its own; without `source`, `kitsuke.wasm` beside this file is read. */
export function instantiate(source?: Source | Promise<Source>): Promise<Kitsuke>;

/** `await ready` gives a runtime that all who wait share; nothing is read before somebody does. */
export const ready: PromiseLike<Kitsuke>;

export type Quaternion = [x: number, y: number, z: number, w: number];

/** A pose: rotations (x, y, z, w) by bone relative to the T-pose, then how far the hips have moved, metres. */
export class Pose {
  constructor(data?: Float32Array);
  readonly data: Float32Array;
  /** How far the hips have moved, a view of three numbers. */
  readonly hips: Float32Array;
  /** Back to the T-pose. */
  reset(): this;
  /** The rotation of a bone by its number, a view of four numbers. */
  rotation(bone: number): Float32Array;
}

export class Kitsuke {
  /** VRM 1.0 names by number. */
  readonly bones: readonly string[];
  /** The bone that carries each of `bones`, null for the hips. */
  readonly parents: readonly (string | null)[];
  /** Names of measurements by number. */
  readonly measurements: readonly string[];
  /** Opens a pack, which may be a stranger's. */
  openPack(bytes: BufferSource): Pack;
  /** The number of a bone by its VRM 1.0 name. */
  bone(name: string): number;
  /** A pose with these bones turned. */
  pose(rotations?: Record<string, Quaternion>): Pose;
}

declare class Handle {
  /** Gives the memory back; nothing of it may be used afterwards. */
  free(): void;
  [Symbol.dispose](): void;
}

export interface Path {
  readonly name: string;
  readonly ja: string;
  /** In the T-pose, metres. */
  readonly length: number;
}

/** A kimono: from a pack, or fitted to a wearer. */
export class Pack extends Handle {
  private constructor();
  readonly id: string;
  readonly name: string;
  /** The body on which it was made. */
  readonly body: string;
  readonly vertexCount: number;
  /** Vertices that are no seam twins; they come first. */
  readonly uniqueCount: number;
  readonly triangleCount: number;
  readonly jointCount: number;
  /** How many of the last targets belong to no pose. */
  readonly correctiveCount: number;
  readonly hasUv: boolean;
  readonly hasSizes: boolean;
  readonly parts: readonly string[];
  readonly targets: readonly string[];
  readonly paths: readonly Path[];
  readonly obi: { readonly vertexCount: number; readonly triangleCount: number } | null;
  /** `byteLength` is 0 where the pack only names the texture. */
  readonly texture: { readonly name: string; readonly width: number; readonly height: number; readonly byteLength: number } | null;
  indices(): Uint32Array;
  obiIndices(): Uint32Array;
  /** Two texture coordinates per vertex, v from the top; empty where there are none. */
  uv(): Float32Array;
  texturePng(): Uint8Array | null;
  joint(bone: string): { rest: [number, number, number]; parent: string | null } | null;
  targetPose(index: number): Pose;
  /** The pose as the kimono allows it. */
  limit(pose: Pose, into?: Pose): { pose: Pose; turnedRad: number };
  evaluator(): Evaluator;
  /** BVH, .vrma, VRM, MediaPipe, Kinect, DeepMimic or JSON Lines, told apart by content. */
  openMotion(bytes: BufferSource): Motion;
  receiver(): Receiver;
  fitter(): Fitter;
}

/** Frames of one kimono, in buffers of its own. */
export class Evaluator extends Handle {
  private constructor();
  /** Metres, three numbers per vertex: a view, to be taken anew after every call. */
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly obiPositions: Float32Array;
  readonly obiNormals: Float32Array;
  evaluate(pose: Pose, options?: { normals?: boolean }): void;
  evaluateObi(pose: Pose, options?: { normals?: boolean }): void;
}

export class Motion extends Handle {
  private constructor();
  readonly frameCount: number;
  /** Seconds. */
  readonly length: number;
  /** How the file was understood where it left that open. */
  readonly notes: readonly string[];
  frame(number: number): { pose: Pose; confidence: Float32Array };
  poseAt(seconds: number, into?: Pose): Pose;
}

export class Receiver extends Handle {
  private constructor();
  /** Takes a datagram that came at a time, seconds; returns how many poses it completed. */
  datagram(bytes: BufferSource, seconds: number): number;
  pose(seconds: number, staleAfter?: number, into?: Pose): { pose: Pose; confidence: Float32Array; age: number };
  calibrate(): void;
}

export interface Fit {
  readonly verdict: "reachable" | "strayed" | "size-differs" | "out-of-reach";
  /** The verdict in words. */
  readonly words: string;
  /** How far the cloth is from what wearers of the nearest sizes have, metres. */
  readonly moved: number;
  /** How little the sizes' bodies say of this wearer, 0 to 1. */
  readonly novelty: number;
  /** Metres along the surface. */
  readonly dimensions: readonly { name: string; wanted: number; reached: number; lowest: number; highest: number }[];
  readonly pack: Pack | null;
}

export class Fitter extends Handle {
  private constructor();
  readonly ruleSets: readonly string[];
  readonly dimensions: readonly string[];
  /** Metres by name, for example `{ body_height: 1.62, bust_girth: 0.88, hip_girth: 0.95 }`. */
  fit(measurements: Record<string, number>, options?: { rules?: number; pack?: boolean }): Fit;
}
