// What a page does with kitsuke, run by node: frames to the bit, and everything else that the module can do. Prints what it sees; the suite
// `doors_web` compares.
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, packageFolder] = process.argv.slice(2);
const file = (name) => readFileSync(join(folder, name));
const { instantiate, ready, Pose, KitsukeError } = await import(pathToFileURL(join(packageFolder, "kitsuke.js")));
const refused = (what, call) => {
  try {
    call();
    console.log(`${what}: NOT REFUSED`);
  } catch (error) {
    console.log(`${what}: ${error.name}, ${error.message}`);
  }
};

const kitsuke = await ready;
const bytes = file("garment.kitsuke");
const pack = kitsuke.openPack(bytes);
console.log(`${pack.name} on ${pack.body}: ${pack.vertexCount} vertices, ${pack.triangleCount} triangles, parts ${pack.parts}, targets ${pack.targets}`);
console.log(`texture ${pack.texture.name}, ${pack.texturePng().length} bytes; obi of ${pack.obi.vertexCount}; sizes: ${pack.hasSizes}`);
console.log(pack.paths.map(({ name, ja, length }) => `${name} ${ja} ${length.toFixed(4)}`).join("; "));
console.log(`indices ${pack.indices().length}, uv ${pack.uv().length}, obi ${pack.obiIndices().length}, leftUpperArm under ${pack.joint("leftUpperArm").parent}, jaw ${pack.joint("jaw")}`);

// Frames to the bit.
const floats = new Float32Array(file("poses.f32").buffer.slice(0));
const poses = Array.from({ length: floats.length / 223 }, (_, i) => new Pose(floats.slice(223 * i, 223 * (i + 1))));
const evaluator = pack.evaluator();
const frames = poses.flatMap((pose) => {
  evaluator.evaluate(pose);
  return [evaluator.positions.slice(), evaluator.normals.slice()];
});
writeFileSync(join(folder, "frames.f32"), Buffer.concat(frames.map((f) => Buffer.from(f.buffer, f.byteOffset, f.byteLength))));
evaluator.evaluateObi(poses[0]);
console.log(`obi: ${evaluator.obiPositions.every(Number.isFinite)}, normals of length 1: ${[...evaluator.obiNormals].reduce((sum, x) => sum + x * x, 0).toFixed(3)} of ${pack.obi.vertexCount}; leftHand hangs on ${kitsuke.parents[kitsuke.bone("leftHand")]}`);
const limited = pack.limit(poses[0]);
console.log(`limited: ${limited.turnedRad > 0}`);

// A pose by names, a target's pose, a motion, a live wearer, a fit.
evaluator.evaluate(kitsuke.pose({ leftUpperArm: [0, 0, -0.38268343, 0.92387953] }), { normals: false });
console.log(`pose of ${pack.targets[0]}: ${Array.from(pack.targetPose(0).rotation(kitsuke.bone("leftUpperArm")), (c) => c.toFixed(4))}`);
const motion = pack.openMotion(file("motion.bvh"));
const half = motion.poseAt(motion.length / 2);
console.log(`motion: ${motion.frameCount} frames, ${motion.length.toFixed(2)} s, notes ${motion.notes.length}, halfway ${half.data.every(Number.isFinite)}`);
console.log(`frame 3: confidence ${motion.frame(3).confidence[0]}`);
const receiver = pack.receiver();
console.log(`datagram of nonsense: ${receiver.datagram(new Uint8Array([1, 2, 3]), 0)} poses; age ${receiver.pose(1).age}`);
const fitter = pack.fitter();
const fit = fitter.fit({ body_height: 1.62, bust_girth: 0.9, hip_girth: 0.95 }, { pack: true });
console.log(`fit by ${fitter.ruleSets}: ${fit.verdict}, ${fit.words}; ${fit.dimensions.map((d) => `${d.name} ${d.wanted.toFixed(3)} ${d.reached.toFixed(3)}`)}`);
const worn = fit.pack.evaluator();
worn.evaluate(poses[1]);
console.log(`fitted: ${worn.positions.every(Number.isFinite)}, obi of ${fit.pack.obi.vertexCount}`);
worn.free();

refused("half a pack", () => kitsuke.openPack(bytes.subarray(0, bytes.length / 2)));
refused("no recording", () => pack.openMotion(new TextEncoder().encode("HIERARCHY\nnothing")));
refused("frame beyond the end", () => motion.frame(motion.frameCount));
refused("bone that there is not", () => kitsuke.pose({ tail: [0, 0, 0, 1] }));
refused("measurement that there is not", () => fitter.fit({ tail_length: 1 }));
refused("fit without measurements", () => fitter.fit({}));
refused("pose of another length", () => new Pose(new Float32Array(9)));

// Damaged packs are refused or opened, never more.
let [opened, others] = [0, 0];
for (let i = 0; i < bytes.length; i += 3) {
  const damaged = Uint8Array.from(bytes);
  damaged[i] ^= 0x40;
  try {
    kitsuke.openPack(damaged).free();
    opened += 1;
  } catch (error) {
    if (!(error instanceof KitsukeError)) others += 1;
  }
}
console.log(`damaged packs: ${opened} opened, ${others} other than refused`);

// Memory does not grow: what is freed serves again.
const before = kitsuke.memory.buffer.byteLength;
for (let i = 0; i < 10000; i++) evaluator.evaluate(poses[i % poses.length]);
for (let i = 0; i < 200; i++) {
  const again = kitsuke.openPack(bytes);
  again.evaluator().free();
  again.free();
}
console.log(`memory grown by ${kitsuke.memory.buffer.byteLength - before} bytes`);
evaluator.free();
pack.free();
refused("freed pack", () => pack.indices());

// Frames alone, in the small module.
const core = await instantiate(readFileSync(join(packageFolder, "kitsuke-core.wasm")));
const small = core.openPack(bytes);
const own = small.evaluator();
own.evaluate(poses[0]);
console.log(`core: ${own.positions.every((x, i) => Object.is(x, frames[0][i])) ? "the same bits" : "OTHER BITS"}`);
refused("motion in the core", () => small.openMotion(file("motion.bvh")));
