// What the validator of Khronos says of files, a line of JSON each: node validate.mjs MODULES FILE…
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
const [modules, ...files] = process.argv.slice(2);
const validator = createRequire(join(modules, "x.js"))("gltf-validator");
for (const file of files) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), { maxIssues: 200 });
  console.log(JSON.stringify({ file, ...report.issues, messages: report.issues.messages.slice(0, 20) }));
}
