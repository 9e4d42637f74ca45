// Holds provenance (`darn inpaint --provenance`) against its JSON Schema, and shows that the schema refuses what it should.
//
//   node provenance.mjs DOCUMENT [DOCUMENT ...]
//
// Exit 1 if a document does not keep to docs/provenance.schema.json, names a node that is not there, or stays valid with a wrong literal. Exit 64 on wrong
// usage.
import { readFile } from "node:fs/promises";
import Ajv from "ajv/dist/2020.js";
import formats from "ajv-formats";

const schema = JSON.parse(await readFile(new URL("../../docs/provenance.schema.json", import.meta.url)));
const ajv = new Ajv({ allErrors: true, strictTuples: false });
formats(ajv);
const validate = ajv.compile(schema);

/** What is wrong with a document. */
function faults(document) {
  if (!validate(document)) return validate.errors.map((error) => `${error.instancePath}: ${error.message}`);
  const names = new Set(document["@graph"].map((node) => node["@id"]));
  if (names.size !== document["@graph"].length) return ["two nodes have one name"];
  const missing = [];
  const walk = (value) => {
    if (value === null || typeof value !== "object") return;
    const id = value["@id"];
    if (id && Object.keys(value).length === 1 && !id.startsWith("http") && !names.has(id)) missing.push(`${id} is not there`);
    Object.values(value).forEach(walk);
  };
  walk(document["@graph"]);
  return missing;
}

/** Documents that are wrong: each has one value replaced. */
function spoiled(document) {
  const replace = (pattern, by) => {
    const text = JSON.stringify(document);
    const other = text.replace(pattern, by);
    return other === text ? [] : [JSON.parse(other)];
  };
  return [
    ...replace(/"@type":"xsd:dateTime"/g, '"@type":"xsd:date"'),
    ...replace(/"@type":"xsd:date"/g, '"@type":"xsd:dateTime"'),
    ...replace(/2026-11-28/g, "2026-99-99"),
    ...replace(/"rdf:value":"[0-9a-f]{8}/, '"rdf:value":"'),
    ...replace(/urn:sha256:[0-9a-f]{8}/, "urn:sha256:"),
    ...replace(/"crmdig:L10_had_input"/, '"crmdig:L10_has_input"'),
    ...replace(/"premis:Event"/, '"premis:Events"'),
  ];
}

const paths = process.argv.slice(2);
if (paths.length === 0) {
  console.error("usage: node provenance.mjs DOCUMENT [DOCUMENT ...]");
  process.exit(64);
}
let failed = 0;
for (const path of paths) {
  const document = JSON.parse(await readFile(path));
  const found = faults(document);
  spoiled(document).forEach((other, k) => faults(other).length === 0 && found.push(`stays valid when it is spoiled (${k})`));
  failed += found.length;
  found.forEach((fault) => console.error(`${path}: ${fault}`));
}
console.log(`${paths.length} documents of provenance, ${failed} faults`);
process.exit(failed === 0 ? 0 : 1);
