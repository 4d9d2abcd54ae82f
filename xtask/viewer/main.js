// The page: what is chosen, posed and fitted, and what the server says of files that change. Pose, camera and time stay as they are when a
// new pack comes.

import { ready } from "/kitsuke.js";
import { apart, diverging, directions, edges, heat, moved, strain } from "/colours.js";
import { options, quaternion, save, slider, turns } from "/controls.js";
import { Band, Cloth, Stage, Wearer, texture } from "/stage.js";

const STRAIN_FULL = 0.1;
const MOVED_FULL_M = 0.01;
const DEPTH_FULL_M = 0.01;
const ANGLE = { min: -180, max: 180, step: 1, unit: "degrees" };
const SIDES = [["rx", "X"], ["ry", "Y"], ["rz", "Z"]];

const $ = (id) => document.getElementById(id);
const kitsuke = await ready;
const stage = new Stage($("picture"));
const bone = (name) => kitsuke.bone(name);

/** The pose by hand, by recording, and as it is shown. */
const byHand = kitsuke.pose();
const recorded = kitsuke.pose();
const shownPose = kitsuke.pose();
const angles = new Map();
const joints = new Map();
/** What is shown of the chosen garment. */
const shown = { id: null, version: 0, a: null, b: null, wearer: null, facts: null, fitted: null, fitter: null, colours: new Map() };
const play = { motion: null, name: "", bytes: null, time: 0, running: false, last: 0 };
const measurements = new Map();

// ---- kimonos

/** A kimono on the stage. */
async function dress(pack) {
  const png = pack.texturePng();
  const cloth = stage.add(new Cloth(pack, png && (await texture(png))));
  const band = pack.obi && stage.add(new Band(pack));
  const evaluator = pack.evaluator();
  evaluator.evaluate(kitsuke.pose());
  return { pack, cloth, band, evaluator, edges: null, rest: evaluator.positions.slice() };
}

function undress(kimono) {
  if (!kimono) return;
  stage.remove(kimono.cloth);
  stage.remove(kimono.band);
  kimono.evaluator.free();
  kimono.pack.free();
}

async function bytesOf(path) {
  const response = await fetch(path);
  if (!response.ok) throw new Error(`${path}: ${await response.text()}`);
  return response.arrayBuffer();
}

/** Shows a garment's pack, the one that the server has now. */
async function load({ id, pack: version }) {
  const isOther = shown.id !== id;
  const [bytes, facts] = await Promise.all([bytesOf(`/garments/${id}/pack`), bytesOf(`/garments/${id}/facts`)]);
  const dressed = await dress(kitsuke.openPack(bytes));
  undress(shown.a);
  shown.fitter?.free();
  Object.assign(shown, { id, version, a: dressed, fitter: null, facts: JSON.parse(new TextDecoder().decode(facts)) });
  shown.colours.clear();
  stage.remove(shown.wearer);
  shown.wearer = await bytesOf(`/garments/${id}/wearer`).then((buffer) => stage.add(new Wearer(buffer)), () => null);
  leaveOut(shown.wearer, id);
  const samples = dressed.pack.targets.slice(0, dressed.pack.targets.length - dressed.pack.correctiveCount);
  shown.samples = [["the T-pose", kitsuke.pose()], ...samples.map((name, i) => [name, dressed.pack.targetPose(i)])];
  options($("sample"), samples, [["", "by hand"]]);
  if (isOther) {
    makeJoints();
    makeMeasurements();
  }
  tellFacts();
  if (play.bytes) openMotion(play.bytes, play.name);
  undress(shown.fitted);
  shown.fitted = null;
  if (measurements.size > 0 && dressed.pack.hasSizes) await fit();
  await recolour();
}

/** Skin that the cloth always covers is left out as soon as it is known, which takes seconds. */
async function leaveOut(wearer, id) {
  if (!wearer) return;
  const covered = await bytesOf(`/garments/${id}/covered`).catch(() => null);
  if (covered && shown.wearer === wearer) {
    wearer.without(new Uint8Array(covered));
    stage.draw();
  }
}

// ---- the frame

function currentPose() {
  if (play.motion) return play.motion.poseAt(play.time, recorded);
  return byHand;
}

/** Poses everything and draws it. */
function frame() {
  const kimono = shown.fitted ?? shown.a;
  if (!kimono) return;
  let pose = currentPose();
  if ($("hold").checked) {
    const { turnedRad } = shown.a.pack.limit(pose, shownPose);
    pose = shownPose;
    const degrees = (turnedRad * 180) / Math.PI;
    $("held").textContent = degrees > 0.5 ? `the kimono holds a joint back by ${degrees.toFixed(0)} degrees` : "";
  } else {
    $("held").textContent = "";
  }
  tellNearest(pose);
  const beside = shown.b && $("beside").checked;
  for (const each of [shown.a, shown.fitted, shown.b]) {
    if (!each) continue;
    const visible = each === kimono || (each === shown.b && beside);
    each.cloth.object.visible = visible;
    if (each.band) each.band.object.visible = visible && $("obi").checked;
  }
  show(kimono, pose, beside ? -0.75 : 0);
  if (beside) show(shown.b, pose, 0.75);
  if (shown.wearer) {
    shown.wearer.object.visible = $("wearer").checked && !shown.fitted;
    shown.wearer.object.position.x = beside ? -0.75 : 0;
    shown.wearer.show(pose, bone);
  }
  tint(kimono, pose);
  stage.draw();
}

function show(kimono, pose, aside) {
  const { evaluator, cloth, band } = kimono;
  evaluator.evaluate(pose);
  cloth.show(evaluator.positions, evaluator.normals);
  cloth.object.position.x = aside;
  cloth.wireframe($("wire").checked);
  if (band) {
    evaluator.evaluateObi(pose);
    band.show(evaluator.obiPositions, evaluator.obiNormals);
    band.object.position.x = aside;
  }
}

/** The sample whose pose is nearest, over all joints of the pose table. */
function tellNearest(pose) {
  const bones = shown.facts.bones.map(bone);
  let [nearest, least] = ["", Infinity];
  for (const [name, sample] of shown.samples) {
    const degrees = apart(pose, sample, bones);
    if (degrees < least) [nearest, least] = [name, degrees];
  }
  $("nearest").textContent = `nearest sample: ${nearest}, ${least.toFixed(0)} degrees away`;
}

/** How deep the cloth lies in the wearer, as the server measures it; asked again when the pose rests. */
function askDepths(kimono, pose) {
  const asked = pose.data.slice();
  clearTimeout(askDepths.soon);
  askDepths.soon = setTimeout(async () => {
    const response = await fetch(`/garments/${shown.id}/depths`, { method: "POST", body: asked });
    if (!response.ok || $("colours").value !== "inside" || kimono !== shown.a) return;
    const found = new Float32Array(await response.arrayBuffer());
    kimono.cloth.paint(heat(found, DEPTH_FULL_M));
    const most = found.reduce((most, metres) => Math.max(most, metres), 0);
    $("scale").textContent = `red is ${1000 * DEPTH_FULL_M} mm in the body and more; at most ${(1000 * most).toFixed(1)} mm`;
    stage.draw();
  }, 200);
}

/** Colours that depend on the pose. */
function tint(kimono, pose) {
  const { evaluator, cloth } = kimono;
  const kind = $("colours").value;
  if (kind === "inside" && kimono === shown.a) askDepths(kimono, pose);
  if (kind === "normals") cloth.paint(directions(evaluator.normals));
  if (kind === "strain") {
    kimono.edges ??= edges(kimono.pack.indices(), kimono.rest);
    const found = strain(kimono.edges, evaluator.positions);
    cloth.paint(diverging(found, STRAIN_FULL));
    const mean = found.reduce((sum, share) => sum + Math.abs(share), 0) / found.length;
    $("scale").textContent = `blue is ${100 * STRAIN_FULL} % shorter than at rest, red as much longer; mean ${(100 * mean).toFixed(2)} %`;
  }
  if (kind === "moved") {
    const comparable = shown.b && shown.b.pack.vertexCount === kimono.pack.vertexCount;
    $("scale").textContent = "choose a pack B of the same kimono";
    cloth.paint("cloth");
    if (!comparable) return;
    shown.b.evaluator.evaluate(pose);
    const found = moved(evaluator.positions, shown.b.evaluator.positions);
    cloth.paint(heat(found, MOVED_FULL_M));
    const most = found.reduce((most, metres) => Math.max(most, metres), 0);
    $("scale").textContent = `red is ${1000 * MOVED_FULL_M} mm and more; at most ${(1000 * most).toFixed(2)} mm`;
  }
}

/** Colours that do not. */
async function recolour() {
  const kind = $("colours").value;
  const kimono = shown.fitted ?? shown.a;
  if (!kimono) return;
  $("scale").textContent = "";
  if (kind === "cloth" || kind === "checker") kimono.cloth.paint(kind);
  if (kind === "regions" || kind === "joints") {
    if (!shown.colours.has(kind)) shown.colours.set(kind, new Uint8Array(await bytesOf(`/garments/${shown.id}/colours/${kind}`)));
    kimono.cloth.paint(shown.colours.get(kind));
  }
  frame();
}

// ---- joints

function makeJoints() {
  joints.clear();
  const limited = new Set(shown.facts.limited);
  $("joints").replaceChildren(
    ...shown.facts.bones.map((name) => {
      const box = document.createElement("fieldset");
      box.className = "joint";
      const legend = document.createElement("legend");
      legend.textContent = limited.has(name) ? `${name} (held back)` : name;
      const now = angles.get(name) ?? [0, 0, 0];
      angles.set(name, now);
      const sliders = SIDES.map(([column, label], axis) =>
        slider({ ...ANGLE, name: `${name}_${column}_deg`, label, value: now[axis] }, (value) => {
          now[axis] = value;
          byHand.rotation(bone(name)).set(quaternion(now));
          stop();
          frame();
        }));
      box.append(legend, ...sliders.map(({ row }) => row));
      joints.set(name, { now, sliders });
      return box;
    }));
}

/** Puts the sliders where a pose is. */
function takePose(pose) {
  say("");
  byHand.data.set(pose.data);
  for (const [name, { now, sliders }] of joints) {
    now.splice(0, 3, ...turns(pose.rotation(bone(name))));
    sliders.forEach(({ set }, axis) => set(now[axis]));
  }
  stop();
  frame();
}

$("sample").addEventListener("change", () => {
  const { value, selectedIndex } = $("sample");
  takePose(value === "" ? kitsuke.pose() : shown.a.pack.targetPose(selectedIndex - 1));
});

// ---- motion

function stop() {
  play.motion?.free();
  Object.assign(play, { motion: null, running: false, bytes: null });
  $("motion").value = "";
  $("play").setAttribute("aria-pressed", "false");
  $("play").textContent = "Play";
  $("notes").replaceChildren();
}

function openMotion(bytes, name) {
  const motion = shown.a.pack.openMotion(bytes);
  play.motion?.free();
  Object.assign(play, { motion, bytes, name, time: Math.min(play.time, motion.length) });
  Object.assign($("time"), { max: motion.length, value: play.time });
  $("notes").replaceChildren(...motion.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
  frame();
}

$("motion").addEventListener("change", async () => {
  const name = $("motion").value;
  if (name === "") return takePose(currentPose());
  play.time = 0;
  attempt(async () => openMotion(await bytesOf(`/motions/${encodeURIComponent(name)}`), name));
});

$("play").addEventListener("click", () => {
  if (!play.motion) return say("choose a recording first, or drop one on the picture");
  play.running = !play.running;
  $("play").setAttribute("aria-pressed", String(play.running));
  $("play").textContent = play.running ? "Pause" : "Play";
  play.last = performance.now();
  if (play.running) requestAnimationFrame(tick);
});

$("time").addEventListener("input", () => {
  play.time = Number($("time").value);
  frame();
});

function tick(now) {
  if (!play.running || !play.motion) return;
  play.time = (play.time + ((now - play.last) / 1000) * Number($("speed").value)) % Math.max(play.motion.length, 1e-6);
  play.last = now;
  $("time").value = play.time;
  const before = performance.now();
  frame();
  tick.ms = performance.now() - before;
  requestAnimationFrame(tick);
}

// ---- measurements

function makeMeasurements() {
  const { wearer } = shown.facts;
  measurements.clear();
  $("measurements").replaceChildren();
  $("verdict").textContent = wearer ? "as the base is" : "this kimono has no sizes";
  if (!wearer) return;
  const own = wearer.bodies[0].measurements;
  $("measurements").append(
    ...Object.entries(own).map(([name, metres]) => {
      const [low, high] = wearer.plausible[name];
      const range = { min: Math.round(100 * low), max: Math.round(100 * high), step: 0.5 };
      return slider({ ...range, name, label: name.replaceAll("_", " "), value: (100 * metres).toFixed(1), unit: "cm", wide: true }, (value) => {
        measurements.set(name, value / 100);
        clearTimeout(fit.soon);
        fit.soon = setTimeout(() => attempt(fit), 150);
      }).row;
    }));
}

async function fit() {
  const { a, facts } = shown;
  shown.fitter ??= a.pack.fitter();
  options($("rules"), shown.fitter.ruleSets);
  const wanted = { ...facts.wearer.bodies[0].measurements, ...Object.fromEntries(measurements) };
  const found = shown.fitter.fit(wanted, { rules: Math.max($("rules").selectedIndex, 0), pack: true });
  $("verdict").textContent = found.words;
  const dressed = await dress(found.pack);
  undress(shown.fitted);
  shown.fitted = dressed;
  await recolour();
}

$("rules").addEventListener("change", () => attempt(fit));

// ---- files

async function take(file) {
  const bytes = await file.arrayBuffer();
  const magic = new TextDecoder("latin1").decode(new Uint8Array(bytes).subarray(1, 8));
  if (magic === "kitsuke") {
    const dressed = await dress(kitsuke.openPack(bytes));
    undress(shown.b);
    shown.b = dressed;
    say(`pack B: ${dressed.pack.name}`);
    return recolour();
  }
  play.time = 0;
  openMotion(bytes, file.name);
  say(file.name);
}

for (const id of ["file", "second"]) {
  $(id).addEventListener("change", () => $(id).files[0] && attempt(() => take($(id).files[0])));
}
addEventListener("dragover", (event) => {
  event.preventDefault();
  $("drop").hidden = false;
});
addEventListener("dragleave", (event) => event.relatedTarget === null && ($("drop").hidden = true));
addEventListener("drop", (event) => {
  event.preventDefault();
  $("drop").hidden = true;
  const file = event.dataTransfer.files[0];
  if (file) attempt(() => take(file));
});

// ---- look

for (const button of document.querySelectorAll("[data-view]")) {
  button.addEventListener("click", () => stage.look(button.dataset.view));
}
for (const id of ["wearer", "obi", "wire", "hold", "beside"]) $(id).addEventListener("change", frame);
$("colours").addEventListener("change", () => attempt(recolour));
$("screenshot").addEventListener("click", async () => save(await stage.png(), `${shown.id}.png`));
$("turntable").addEventListener("click", async () => save(await stage.turntable(), `${shown.id}_turntable.png`));
$("garment").addEventListener("change", () => attempt(() => choose($("garment").value)));

// ---- what is said

function say(text) {
  $("caption").textContent = text;
}

/** Does something that may be refused, and says why. */
async function attempt(what) {
  try {
    await what();
  } catch (error) {
    say(error.message);
  }
}

function tellFacts() {
  const { pack } = shown.a;
  const { bytes, certificate } = shown.facts;
  const rows = [
    ["made on", pack.body || "?"],
    ["mesh", `${pack.vertexCount} vertices, ${pack.triangleCount} triangles`],
    ["targets", `${pack.targets.length}, ${pack.correctiveCount} of them correctives`],
    ["pack", `${(bytes / 1e6).toFixed(2)} MB`],
    ...pack.paths.map(({ name, ja, length }) => [`${name} ${ja}`, `${(100 * length).toFixed(1)} cm`]),
  ];
  if (certificate) {
    rows.push(
      ["fastest", `${certificate.speed_mm_per_deg.toFixed(1)} mm per degree of ${certificate.fastest_joint}, near ${certificate.fastest_rows.join(" and ")}`],
      ["steps", `${certificate.step_mm.toFixed(3)} mm per 0.01 degrees`],
      ["nearest poses", `${certificate.nearest.rows.join(" and ")}, ${certificate.nearest.apart_deg.toFixed(1)} degrees apart`]);
    const worst = [...certificate.left_out].sort((a, b) => b.mean_mm - a.mean_mm).slice(0, 5);
    rows.push(...worst.map((e) => [`left out: ${e.target}`, `mean ${e.mean_mm.toFixed(1)} mm, at most ${e.max_mm.toFixed(0)} mm`]));
  }
  $("facts").replaceChildren(
    ...rows.flatMap(([term, text]) => [
      Object.assign(document.createElement("dt"), { textContent: term }),
      Object.assign(document.createElement("dd"), { textContent: text }),
    ]));
}

// ---- the server

let garments = [];

async function choose(id) {
  const garment = garments.find((garment) => garment.id === id) ?? garments[0];
  if (!garment) return;
  const { status, errors, warnings, said, draft } = garment;
  const words = { scans: "laying the base onto scans …", building: draft ? "shown as saved, building …" : "building …", built: "built", failed: "not built" }[status];
  const counts = [[errors, "mistake"], [warnings, "warning"]].filter(([count]) => count > 0);
  $("status").textContent = [words, ...counts.map(([count, what]) => `${count} ${what}${count === 1 ? "" : "s"}`)].join(", ");
  $("status").className = errors > 0 || status === "failed" ? "failed" : warnings > 0 ? "warned" : "";
  $("said").textContent = said;
  $("said").hidden = said === "" || (errors === 0 && warnings === 0 && status !== "failed");
  const isNew = shown.id !== garment.id || shown.version !== garment.pack;
  if (garment.pack > 0 && isNew) await load(garment);
}

/** Learns of every change until the page is closed. */
async function follow() {
  let version = 0;
  for (;;) {
    try {
      const response = await fetch(`/state?after=${version}`);
      const state = await response.json();
      version = state.version;
      garments = state.garments;
      options($("garment"), garments.map(({ id }) => id));
      await choose($("garment").value);
    } catch (error) {
      $("status").textContent = `the server does not answer: ${error.message}`;
      $("status").className = "failed";
      await new Promise((again) => setTimeout(again, 1000));
    }
  }
}

options($("motion"), await (await fetch("/motions")).json().then((names) => names.filter((name) => !name.endsWith(".md"))), [["", "none: pose by hand"]]);
follow();
// For tests: what is shown, without a way to change it.
window.kitsukeView = { get shown() { return shown; }, get frameMs() { return tick.ms; }, get pose() { return currentPose(); }, stage };
