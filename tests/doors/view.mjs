// The viewer as people use it, in Chromium: run by the suite `doors_view` with the server's address, the folder of assets it watches and a
// folder for pictures. Prints what it sees.
import { readFileSync, writeFileSync, copyFileSync, renameSync } from "node:fs";
import { join } from "node:path";
import { createRequire } from "node:module";
import { request } from "node:http";

const [address, assets, pictures, modules, chromium, hostile] = process.argv.slice(2);
const puppeteer = (await import(createRequire(join(modules, "x.js")).resolve("puppeteer-core"))).default;
const browser = await puppeteer.launch({
  executablePath: chromium,
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--enable-precise-memory-info", "--js-flags=--expose-gc"],
  defaultViewport: { width: 1280, height: 800 },
});
const page = await browser.newPage();
const errors = [];
page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
page.on("pageerror", (error) => errors.push(error.message));
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const picture = async (name) => {
  await sleep(700);
  await page.screenshot({ path: join(pictures, `${name}.png`) });
};
const until = (what, ...given) => page.waitForFunction(what, { timeout: 120000, polling: 50 }, ...given);
const positions = () => page.evaluate(() => Array.from(kitsukeView.shown.a.evaluator.positions));
const farthest = (a, b) => a.reduce((most, x, i) => Math.max(most, Math.abs(x - b[i])), 0);

await page.goto(address);
await until(() => window.kitsukeView?.shown?.a);
await until(() => document.querySelector("#status").textContent === "built");
await picture("t_pose");
const rest = await positions();
console.log("loads: yes");

// A slider.
await page.evaluate(() => {
  const input = document.querySelector('input[type="range"][data-name="leftUpperArm_rz_deg"]');
  input.value = -60;
  input.dispatchEvent(new Event("input", { bubbles: true }));
});
console.log(`a slider moves the cloth: ${farthest(rest, await positions()) > 0.1}`);
await picture("arm_down");

// Every control by keyboard.
const reached = await page.evaluate(async () => {
  const wanted = [...document.querySelectorAll("button, select, input, summary, #picture")].filter((e) => e.checkVisibility());
  return { wanted: wanted.length, unnamed: wanted.filter((e) => !(e.ariaLabel || e.labels?.length || e.textContent.trim())).map((e) => e.id) };
});
await page.focus("#picture");
const seen = new Set();
for (let i = 0; i < reached.wanted + 20; i++) {
  seen.add(await page.evaluate(() => [...document.querySelectorAll("*")].indexOf(document.activeElement)));
  await page.keyboard.press("Tab");
}
console.log(`reached by keyboard: ${seen.size >= reached.wanted}, without a name: ${reached.unnamed.length}`);

// A recording.
await page.select("#motion", "two_arms.bvh");
await until(() => document.querySelector("#notes").children.length > 0);
await page.click("#play");
await sleep(3000);
const frameMs = await page.evaluate(() => {
  const { a } = kitsukeView.shown;
  const pose = kitsukeView.pose;
  const times = [];
  for (let i = 0; i < 300; i++) {
    const from = performance.now();
    a.pack.limit(pose);
    a.evaluator.evaluate(pose);
    a.evaluator.evaluateObi(pose);
    times.push(performance.now() - from);
  }
  return times.sort((x, y) => x - y)[150];
});
console.log(`plays: ${(await page.evaluate(() => Number(document.querySelector("#time").value))) > 0}`);
console.error(`script and module, ms per frame: ${frameMs.toFixed(2)}`);
await picture("walking");
await page.click("#play");

// Memory over 10,000 frames and 20 reloads of a pack.
const grown = await page.evaluate(async () => {
  const { a } = kitsukeView.shown;
  const memory = () => [a.pack.kitsuke.memory.buffer.byteLength, performance.memory.usedJSHeapSize];
  const pose = kitsukeView.pose;
  const bytes = await (await fetch(`/garments/${kitsukeView.shown.id}/pack`)).arrayBuffer();
  const again = () => {
    const pack = a.pack.kitsuke.openPack(bytes);
    const evaluator = pack.evaluator();
    evaluator.evaluate(pose);
    evaluator.free();
    pack.free();
  };
  again();
  gc();
  const before = memory();
  for (let i = 0; i < 10000; i++) a.evaluator.evaluate(pose);
  for (let i = 0; i < 20; i++) again();
  gc();
  const after = memory();
  return after.map((bytes, i) => bytes - before[i]);
});
console.log(`memory: module ${grown[0]} bytes, page ${grown[1] < 1e6 ? "flat" : grown[1]}`);

// Strangers' files.
for (const [name, bytes] of [["broken.kitsuke", Buffer.concat([Buffer.from("\x89kitsuke", "latin1"), Buffer.alloc(500, 7)])], ["broken.bvh", Buffer.from("HIERARCHY\nROOT Hips\n{ OFFSET 0 0 nothing")], ["nothing", Buffer.alloc(0)]]) {
  const file = join(hostile, name);
  writeFileSync(file, bytes);
  await (await page.$("#file")).uploadFile(file);
  await sleep(400);
  console.log(`${name}: ${await page.evaluate(() => document.querySelector("#caption").textContent)}`);
}

// Back by hand, then a file changes on disk.
await page.select("#motion", "");
const folder = join(assets, "komon");
const target = join(folder, "poses/04_right_45.obj");
const sample = "right_45";
await page.select("#sample", sample);
await until(() => document.querySelector("#status").textContent === "built");
const before = await positions();
const text = readFileSync(target, "utf8");
const lower = text.replace(/^v (\S+) (\S+) (\S+)$/gm, (line, x, y, z) => (Number(x) < -0.3 ? `v ${x} ${(Number(y) + 0.25 * (Number(x) + 0.3)).toFixed(5)} ${z}` : line));
const camera = await page.evaluate(() => document.querySelector("#sample").value);
const saved = performance.now();
writeFileSync(`${target}.part`, lower);
renameSync(`${target}.part`, target);
await until((version) => kitsukeView.shown.version > version, await page.evaluate(() => kitsukeView.shown.version));
const shownMs = performance.now() - saved;
console.log(`a saved shape is shown: ${farthest(before, await positions()) > 0.03}, the pose stays: ${(await page.evaluate(() => document.querySelector("#sample").value)) === camera}`);
console.error(`shown ${(shownMs / 1000).toFixed(2)} s after it was saved`);
await picture("saved");
await until(() => document.querySelector("#status").textContent.startsWith("built"));
console.error(`built ${((performance.now() - saved) / 1000).toFixed(1)} s after it was saved`);

// A mistake.
writeFileSync(target, text.replace(/^f .*\n/m, ""));
await until(() => document.querySelector("#status").textContent.includes("mistake"));
console.log(`a mistake: ${await page.evaluate(() => document.querySelector("#said").textContent.split("\n")[0])}`);
await picture("mistake");
writeFileSync(target, text);
await until(() => document.querySelector("#status").textContent === "built");

// The same pose as the software rasteriser draws it: the suite compares the pictures.
await page.select("#sample", "left_45");
await page.evaluate(() => {
  for (const id of ["wearer", "hold"]) document.querySelector(`#${id}`).checked && document.querySelector(`#${id}`).click();
  kitsukeView.stage.look("front");
});
await sleep(500);
const still = await page.evaluate(async () => {
  const { stage, pose } = kitsukeView;
  const { camera, controls } = stage;
  const bytes = new Uint8Array(await (await stage.png()).arrayBuffer());
  return { eye: camera.position.toArray(), target: controls.target.toArray(), heightDeg: camera.fov, pose: Array.from(pose.data), png: btoa(bytes.reduce((text, byte) => text + String.fromCharCode(byte), "")) };
});
writeFileSync(join(pictures, "still.png"), Buffer.from(still.png, "base64"));
writeFileSync(join(pictures, "still.json"), JSON.stringify({ ...still, png: undefined }));
await page.evaluate(() => ["wearer", "hold"].forEach((id) => document.querySelector(`#${id}`).click()));

// Colours, and the shape before against the one that was saved.
await page.select("#sample", "left_45");
console.log(await page.evaluate(() => document.querySelector("#nearest").textContent));
for (const kind of ["strain", "regions", "checker", "inside"]) {
  await page.select("#colours", kind);
  await picture(kind);
}
await until(() => document.querySelector("#scale").textContent.includes("in the body"));
await picture("inside");
copyFileSync(join(assets, "../catalog/packs/komon.kitsuke"), join(hostile, "b.kitsuke"));
await (await page.$("#second")).uploadFile(join(hostile, "b.kitsuke"));
await until(() => document.querySelector("#caption").textContent.startsWith("pack B"));
await page.select("#colours", "moved");
await sleep(300);
console.log(`A against B: ${await page.evaluate(() => document.querySelector("#scale").textContent)}`);
await page.click("#beside");
await picture("beside");

// A fit.
await page.evaluate(() => {
  document.querySelectorAll("details").forEach((details) => (details.open = true));
  const input = document.querySelector('input[type="range"][data-name="body_height"]');
  input.value = 162;
  input.dispatchEvent(new Event("input", { bubbles: true }));
});
await until(() => kitsukeView.shown.fitted);
console.log(`fitted: ${await page.evaluate(() => document.querySelector("#verdict").textContent !== "")}`);
await page.setViewport({ width: 800, height: 700 });
await picture("narrow");
console.log(`fits 800 px: ${await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth)}`);

// The server answers for its own machine, and its own files.
const ask = (path, host) =>
  new Promise((done) => request(new URL(path, address), { headers: host ? { host } : {}, path }, (answer) => done(answer.resume().statusCode)).end());
console.log(`foreign host: ${await ask("/", "example.org")}; outside: ${await ask("/motions/..%2Fkomon%2Fgarment.toml")} ${await ask("/garments/..%2F..%2Fcatalog/pack")} ${await ask("/vendor/../main.rs")}`);
console.log(`errors in the console: ${errors.length}${errors.map((error) => `\n  ${error}`)}`);
await browser.close();
