// Where three.js shows the vertices of a file's first mesh at times of its animation: node three.mjs MODULES FILE OUT TIME…
// Pictures and materials are taken out before, since node draws none.
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [modules, file, out, ...times] = process.argv.slice(2);
const from = (path) => import(pathToFileURL(join(modules, "three", path)));
globalThis.self = globalThis;
const THREE = await from("build/three.module.js");
const { GLTFLoader } = await from("examples/jsm/loaders/GLTFLoader.js");
const { MeshoptDecoder } = await from("examples/jsm/libs/meshopt_decoder.module.js");

function withoutPictures(glb) {
  const length = glb.readUInt32LE(12);
  const json = JSON.parse(glb.subarray(20, 20 + length));
  for (const part of ["images", "textures", "samplers", "materials"]) delete json[part];
  for (const mesh of json.meshes) for (const primitive of mesh.primitives) delete primitive.material;
  let text = JSON.stringify(json);
  text += " ".repeat((4 - (Buffer.byteLength(text) % 4)) % 4);
  const head = Buffer.alloc(20);
  const data = glb.subarray(20 + length);
  head.write("glTF");
  [2, 20 + Buffer.byteLength(text) + data.length, Buffer.byteLength(text), 0x4e4f534a].forEach((word, i) => head.writeUInt32LE(word, 4 + 4 * i));
  return Buffer.concat([head, Buffer.from(text), data]);
}

const loader = new GLTFLoader();
loader.setMeshoptDecoder(MeshoptDecoder);
const bytes = withoutPictures(readFileSync(file));
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
const gltf = await loader.parseAsync(buffer, "");
let kimono;
gltf.scene.traverse((object) => {
  if (object.isSkinnedMesh && !kimono) kimono = object;
});
const mixer = new THREE.AnimationMixer(gltf.scene);
mixer.clipAction(gltf.animations[0]).setLoop(THREE.LoopOnce).play();
mixer.clipAction(gltf.animations[0]).clampWhenFinished = true;
const count = kimono.geometry.attributes.position.count;
const found = new Float32Array(3 * count * times.length);
const place = new THREE.Vector3();
times.forEach((time, frame) => {
  mixer.setTime(Number(time));
  gltf.scene.updateMatrixWorld(true);
  for (let v = 0; v < count; v++) {
    kimono.getVertexPosition(v, place);
    place.applyMatrix4(kimono.matrixWorld).toArray(found, 3 * (frame * count + v));
  }
});
writeFileSync(out, found);
