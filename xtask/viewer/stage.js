// The picture: camera, light, kimonos, obi and wearer as three.js draws them. Knows nothing of controls, files or motion.

import * as THREE from "three";
import { OrbitControls } from "/vendor/OrbitControls.js";

const VIEWS = { front: [0, 0, 1], back: [0, 0, -1], left: [1, 0, 0], right: [-1, 0, 0] };
const LINING = 0xded8cc;

/** The stage on a canvas; `draw()` is called whenever something has changed. */
export class Stage {
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.setClearColor(0xe9e8e6);
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x9a948c, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(0.6, 1.4, 1.2);
    this.scene.add(sun);
    this.camera = new THREE.PerspectiveCamera(28, 1, 0.05, 50);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(0, 0.8, 0);
    this.camera.position.set(0, 0.8, 4.2);
    this.controls.addEventListener("change", () => this.draw());
    this.look("front");
    new ResizeObserver(() => this.resize()).observe(canvas);
  }

  resize() {
    const { clientWidth, clientHeight } = this.renderer.domElement;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /** From the front, the back, or the wearer's left or right. */
  look(view) {
    const { target } = this.controls;
    const distance = this.camera.position.distanceTo(target);
    this.camera.position.set(...VIEWS[view]).multiplyScalar(distance).add(target);
    this.controls.update();
    this.draw();
  }

  /** Draws soon, once. */
  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.renderer.render(this.scene, this.camera);
    });
  }

  add(thing) {
    this.scene.add(thing.object);
    this.draw();
    return thing;
  }

  /** Takes a thing off the stage and frees what it has on the graphics card. */
  remove(thing) {
    if (!thing) return;
    this.scene.remove(thing.object);
    thing.dispose();
    this.draw();
  }

  /** A PNG of the picture as it is. */
  async png() {
    this.renderer.render(this.scene, this.camera);
    return new Promise((done) => this.renderer.domElement.toBlob(done, "image/png"));
  }

  /** A strip of PNG pictures from all sides. */
  async turntable(count = 8) {
    const { domElement } = this.renderer;
    const strip = document.createElement("canvas");
    [strip.width, strip.height] = [domElement.width * count, domElement.height];
    const { target } = this.controls;
    const [from, up] = [this.camera.position.clone(), new THREE.Vector3(0, 1, 0)];
    for (let i = 0; i < count; i++) {
      this.camera.position.copy(from).sub(target).applyAxisAngle(up, (2 * Math.PI * i) / count).add(target);
      this.camera.lookAt(target);
      this.renderer.render(this.scene, this.camera);
      strip.getContext("2d").drawImage(domElement, domElement.width * i, 0);
    }
    this.camera.position.copy(from);
    this.controls.update();
    this.draw();
    return new Promise((done) => strip.toBlob(done, "image/png"));
  }
}

/** A kimono: its pack's mesh, with room for colours. */
export class Cloth {
  constructor(pack, texture) {
    this.geometry = new THREE.BufferGeometry();
    this.positions = attribute(this.geometry, "position", pack.vertexCount);
    this.normals = attribute(this.geometry, "normal", pack.vertexCount);
    this.tints = attribute(this.geometry, "color", pack.vertexCount);
    this.geometry.setIndex(new THREE.BufferAttribute(pack.indices(), 1));
    if (pack.hasUv) this.geometry.setAttribute("uv", new THREE.BufferAttribute(pack.uv(), 2));
    // What is never right is never culled.
    this.geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(0, 1, 0), 100);
    this.texture = texture;
    this.outside = new THREE.MeshStandardMaterial({ roughness: 0.85, side: THREE.FrontSide });
    this.inside = new THREE.MeshStandardMaterial({ roughness: 0.95, side: THREE.BackSide, color: LINING });
    this.object = new THREE.Group();
    for (const material of [this.outside, this.inside]) this.object.add(new THREE.Mesh(this.geometry, material));
    this.paint("cloth");
  }

  /** `cloth`, `checker`, or colours of its own per vertex: three bytes each. */
  paint(with_) {
    const { outside } = this;
    const tinted = with_ instanceof Uint8Array;
    if (tinted) {
      this.tints.array.set(Float32Array.from(with_, toLinear));
      this.tints.needsUpdate = true;
    }
    outside.map = tinted ? null : with_ === "checker" ? checker() : this.texture;
    outside.vertexColors = tinted;
    outside.color.set(tinted || outside.map ? 0xffffff : 0xb0b2b8);
    outside.needsUpdate = true;
  }

  /** The shape of a frame. */
  show(positions, normals) {
    this.positions.array.set(positions);
    this.normals.array.set(normals);
    this.positions.needsUpdate = true;
    this.normals.needsUpdate = true;
  }

  wireframe(is) {
    this.outside.wireframe = is;
    this.inside.visible = !is;
  }

  dispose() {
    this.geometry.dispose();
    this.outside.dispose();
    this.inside.dispose();
    this.texture?.dispose();
  }
}

/** The obi in one colour. */
export class Band {
  constructor(pack) {
    this.geometry = new THREE.BufferGeometry();
    this.positions = attribute(this.geometry, "position", pack.obi.vertexCount);
    this.normals = attribute(this.geometry, "normal", pack.obi.vertexCount);
    this.geometry.setIndex(new THREE.BufferAttribute(pack.obiIndices(), 1));
    this.geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(0, 1, 0), 100);
    this.material = new THREE.MeshStandardMaterial({ color: 0xc4a040, roughness: 0.6, side: THREE.DoubleSide });
    this.object = new THREE.Mesh(this.geometry, this.material);
  }

  show(positions, normals) {
    this.positions.array.set(positions);
    this.normals.array.set(normals);
    this.positions.needsUpdate = true;
    this.normals.needsUpdate = true;
  }

  dispose() {
    this.geometry.dispose();
    this.material.dispose();
  }
}

/** The wearer as the server sends her (xtask/src/view/wearer.rs): a skinned mesh whose joints rest unturned. */
export class Wearer {
  constructor(buffer) {
    const length = new Uint32Array(buffer, 0, 1)[0];
    const { vertices, triangles, joints } = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    let at = 4 + length;
    const take = (View, count) => {
      const view = new View(buffer, at, count);
      at += 4 * count;
      return view;
    };
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(take(Float32Array, 3 * vertices), 3));
    geometry.setAttribute("skinIndex", new THREE.BufferAttribute(Uint16Array.from(take(Float32Array, 4 * vertices)), 4));
    geometry.setAttribute("skinWeight", new THREE.BufferAttribute(take(Float32Array, 4 * vertices), 4));
    geometry.setIndex(new THREE.BufferAttribute(take(Uint32Array, 3 * triangles), 1));
    geometry.computeVertexNormals();
    geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(0, 1, 0), 100);
    this.joints = joints;
    this.bones = joints.map(() => new THREE.Bone());
    joints.forEach(({ parent, rest }, i) => {
      const from = parent === null ? [0, 0, 0] : joints[parent].rest;
      this.bones[i].position.set(rest[0] - from[0], rest[1] - from[1], rest[2] - from[2]);
      if (parent !== null) this.bones[parent].add(this.bones[i]);
    });
    this.root = this.bones[0].position.clone();
    const material = new THREE.MeshStandardMaterial({ color: 0xe4ccb6, roughness: 0.8 });
    this.object = new THREE.SkinnedMesh(geometry, material);
    this.object.add(this.bones[0]);
    this.object.updateMatrixWorld(true);
    this.object.bind(new THREE.Skeleton(this.bones));
    this.object.frustumCulled = false;
  }

  /** Leaves out the triangles whose corners are all covered (1 per vertex, else 0): skin that the cloth hides need not be drawn. */
  without(covered) {
    const { geometry } = this.object;
    this.whole ??= geometry.index.array;
    const kept = [];
    for (let t = 0; t < this.whole.length; t += 3) {
      const corners = this.whole.subarray(t, t + 3);
      if (!corners.every((v) => covered[v] === 1)) kept.push(...corners);
    }
    geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(kept), 1));
  }

  /** Takes a pose; `bone` gives a bone's number by its name. */
  show(pose, bone) {
    this.joints.forEach((joint, i) => this.bones[i].quaternion.fromArray(pose.rotation(bone(joint.bone))));
    this.bones[0].position.copy(this.root).add(new THREE.Vector3(...pose.hips));
  }

  dispose() {
    this.object.geometry.dispose();
    this.object.material.dispose();
    this.object.skeleton.dispose();
  }
}

/** A texture of an image's bytes, v from the top. */
export async function texture(png) {
  const image = await createImageBitmap(new Blob([png], { type: "image/png" }));
  const texture = new THREE.Texture(image);
  texture.flipY = false;
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.anisotropy = 8;
  texture.needsUpdate = true;
  return texture;
}

let squares;

function checker() {
  if (squares) return squares;
  const cells = 64;
  const data = new Uint8Array(4 * cells * cells);
  for (let i = 0; i < cells * cells; i++) {
    const [x, y] = [i % cells, Math.floor(i / cells)];
    const light = (x + y) % 2 === 0 ? 235 : 90;
    data.set([light, Math.round(light * (0.6 + (0.4 * x) / cells)), Math.round(light * (0.6 + (0.4 * y) / cells)), 255], 4 * i);
  }
  squares = new THREE.DataTexture(data, cells, cells);
  squares.colorSpace = THREE.SRGBColorSpace;
  squares.wrapS = squares.wrapT = THREE.RepeatWrapping;
  squares.needsUpdate = true;
  return squares;
}

function attribute(geometry, name, count) {
  const made = new THREE.BufferAttribute(new Float32Array(3 * count), 3).setUsage(THREE.DynamicDrawUsage);
  geometry.setAttribute(name, made);
  return made;
}

/** An sRGB byte as three.js wants colours of vertices. */
function toLinear(byte) {
  const c = byte / 255;
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
}
