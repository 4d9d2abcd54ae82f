// Frames and opening in WebAssembly, timed as in frame.c: in node, and in Chromium where the module that drives it is there. Run by
// `cargo xtask bench`: FOLDER holds a pack and poses, PACKAGE the module, MODULES perhaps puppeteer-core.
import { existsSync, readFileSync } from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, packageFolder, modules] = process.argv.slice(2);

/** Also runs in a page, so it is given all that it uses. */
async function measured(kitsuke, Pose, bytes, floats) {
  const median = (values) => values.sort((a, b) => a - b)[(values.length - 1) >> 1];
  const passes = 9;
  const opens = [];
  let pack;
  for (let i = 0; i < 21; i++) {
    const begin = performance.now();
    pack?.free();
    pack = kitsuke.openPack(bytes);
    opens.push(performance.now() - begin);
  }
  const evaluator = pack.evaluator();
  const poses = Array.from({ length: floats.length / 223 }, (_, i) => new Pose(floats.slice(223 * i, 223 * (i + 1))));
  const times = poses.map(() => []);
  // Clocks of browsers are coarse: several frames at a time.
  const together = 8;
  for (let pass = 0; pass < passes; pass++) {
    poses.forEach((pose, i) => {
      const begin = performance.now();
      for (let again = 0; again < together; again++) evaluator.evaluate(pose);
      times[i].push((1000 * (performance.now() - begin)) / together);
    });
  }
  return { frame_us: median(times.map(median)), open_ms: median(opens) };
}

const bytes = readFileSync(join(folder, "garment.kitsuke"));
const floats = new Float32Array(readFileSync(join(folder, "poses.f32")).buffer.slice(0));
const { ready, Pose } = await import(pathToFileURL(join(packageFolder, "kitsuke.js")));
const node = await measured(await ready, Pose, bytes, floats);
console.log(`frame_us ${node.frame_us.toFixed(3)}\nopen_ms ${node.open_ms.toFixed(3)}`);

if (existsSync(join(modules, "puppeteer-core")) && existsSync("/usr/bin/chromium")) {
  const files = { "/": "<!doctype html>", "/kitsuke.js": readFileSync(join(packageFolder, "kitsuke.js")), "/kitsuke.wasm": readFileSync(join(packageFolder, "kitsuke.wasm")), "/pack": bytes, "/poses": Buffer.from(floats.buffer) };
  const types = { "/": "text/html", "/kitsuke.js": "text/javascript", "/kitsuke.wasm": "application/wasm" };
  const server = createServer((asked, answer) => answer.writeHead(asked.url in files ? 200 : 404, { "content-type": types[asked.url] ?? "application/octet-stream" }).end(files[asked.url])).listen(0, "127.0.0.1");
  const puppeteer = (await import(createRequire(join(modules, "x.js")).resolve("puppeteer-core"))).default;
  const browser = await puppeteer.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox"] });
  const page = await browser.newPage();
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  const found = await page.evaluate(`(async () => {
    const { ready, Pose } = await import("/kitsuke.js");
    const bytes = async (path) => (await fetch(path)).arrayBuffer();
    return (${measured})(await ready, Pose, await bytes("/pack"), new Float32Array(await bytes("/poses")));
  })()`);
  console.log(`chromium_frame_us ${found.frame_us.toFixed(3)}\nchromium_open_ms ${found.open_ms.toFixed(3)}`);
  await browser.close();
  server.close();
}
