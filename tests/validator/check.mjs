// Holds patched scans against their inputs with Khronos's glTF validator.
//
//   node check.mjs INPUT OUTPUT [INPUT OUTPUT ...]
//
// Exit 1 if an output has an error or a warning (code and JSON pointer) that its input had not; a patched scan keeps every index, so
// the pointers of old ones stay the same. Exit 64 on wrong usage. Nothing outside the given files is read.
import { readFile } from "node:fs/promises";
import validator from "gltf-validator";

const WARNING = 1;

async function issues(path) {
  const bytes = new Uint8Array(await readFile(path));
  const options = {
    maxIssues: 0, // all of them
    externalResourceFunction: () => Promise.reject(new Error("external resources are not read")),
  };
  const report = await validator.validateBytes(bytes, options);
  return report.issues.messages.filter((issue) => issue.severity <= WARNING);
}

const key = (issue) => `${issue.code} ${issue.pointer ?? `@${issue.offset ?? ""}`}`;

const paths = process.argv.slice(2);
if (paths.length === 0 || paths.length % 2 !== 0) {
  console.error("usage: node check.mjs INPUT OUTPUT [INPUT OUTPUT ...]");
  process.exit(64);
}
let fresh = 0;
for (let i = 0; i < paths.length; i += 2) {
  const [input, output] = paths.slice(i, i + 2);
  const known = new Set((await issues(input)).map(key));
  for (const issue of await issues(output)) {
    if (known.has(key(issue))) continue;
    fresh += 1;
    console.error(`${output}: ${issue.code} at ${issue.pointer ?? `byte ${issue.offset}`}: ${issue.message}`);
  }
}
console.log(`${paths.length / 2} pairs, ${fresh} new errors and warnings`);
process.exit(fresh === 0 ? 0 : 1);
