// Compares what darn reads from compressed streams with what the reference decoders make of them: Google's draco3d and meshoptimizer, which
// also write the streams, by several methods.
//
//   node decoders.mjs DECODED
//
// DECODED is the example `decoded` of darn-gltf-scan, built. Exit 1 if a number differs by more than a filter may round. Exit 64 on wrong usage.
import { execFile } from "node:child_process";
import { mkdtemp, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { promisify } from "node:util";
import draco3d from "draco3d";
import { MeshoptDecoder } from "meshoptimizer/decoder";
import { MeshoptEncoder } from "meshoptimizer/encoder";

const [decoded] = process.argv.slice(2);
if (!decoded || process.argv.length !== 3) {
  console.error("usage: node decoders.mjs DECODED");
  process.exit(64);
}
await Promise.all([MeshoptDecoder.ready, MeshoptEncoder.ready]);
const [encoders, decoders] = await Promise.all([draco3d.createEncoderModule(), draco3d.createDecoderModule()]);

/** Numbers in [0, 1) that are the same each time (Park and Miller). */
function numbers(seed) {
  let state = seed;
  return () => (state = (state * 48271) % 2147483647) / 2147483647;
}

/** Waved cloth of n × n vertices with a hole and a seam of texture coordinates; every vertex has a triangle. */
function cloth(n) {
  const random = numbers(7);
  const points = [];
  for (let y = 0; y < n; y += 1) for (let x = 0; x < n; x += 1) points.push([x / (n - 1), y / (n - 1)]);
  const there = points.map(([u, v]) => Math.hypot(u - 0.5, v - 0.5) > 0.15);
  const faces = [];
  for (let y = 0; y + 1 < n; y += 1) {
    for (let x = 0; x + 1 < n; x += 1) {
      const k = y * n + x;
      for (const face of [[k, k + 1, k + n + 1], [k, k + n + 1, k + n]]) if (face.every((v) => there[v])) faces.push(face);
    }
  }
  // On the seam there is a vertex for each side, in one place.
  const sides = faces.map((face) => (face.every((vertex) => points[vertex][0] >= 0.7) ? "right" : "left"));
  const corners = faces.flatMap((face, k) => face.map((vertex) => `${vertex} ${sides[k]}`));
  const used = [...new Set(corners)];
  const number = new Map(used.map((corner, index) => [corner, index]));
  const rows = (row) => Float32Array.from(used.flatMap((corner) => {
    const [vertex, side] = corner.split(" ");
    return row(...points[vertex], side);
  }));
  return {
    count: used.length,
    faces: Uint32Array.from(corners.map((corner) => number.get(corner))),
    positions: rows((u, v) => [u, v, 0.1 * Math.sin(6 * u) + 0.002 * Math.sin(97 * u + 61 * v)]),
    normals: rows((u) => {
      const slope = 0.6 * Math.cos(6 * u);
      return [-slope / Math.hypot(slope, 1), 0, 1 / Math.hypot(slope, 1)];
    }),
    texcoords: rows((u, v, side) => [side === "right" ? u + 3 : u, 1 - v]),
    colors: Uint8Array.from(used.flatMap(() => [255 * random(), 255 * random(), 255 * random(), 255])),
  };
}

const bytesOf = (array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength);

/** A GLB under construction. */
class Glb {
  json = { asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }], bufferViews: [], accessors: [] };
  pieces = [];
  length = 0;

  /** Appends bytes; returns where they are. */
  place(bytes) {
    const at = this.length;
    const padding = (4 - (bytes.length % 4)) % 4;
    this.pieces.push(Buffer.from(bytes), Buffer.alloc(padding));
    this.length += bytes.length + padding;
    return { buffer: 0, byteOffset: at, byteLength: bytes.length };
  }

  view(view) {
    return this.json.bufferViews.push(view) - 1;
  }

  accessor(accessor) {
    return this.json.accessors.push(accessor) - 1;
  }

  finished(primitive, extensions) {
    const { json } = this;
    json.meshes = [{ primitives: [primitive] }];
    json.extensionsUsed = extensions;
    json.extensionsRequired = extensions;
    json.buffers = [{ byteLength: this.length }, ...(this.fallback ? [this.fallback] : [])];
    let text = Buffer.from(JSON.stringify(json));
    text = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, " ")]);
    const head = Buffer.alloc(20);
    const bin = Buffer.alloc(8);
    head.write("glTF");
    head.writeUInt32LE(2, 4);
    head.writeUInt32LE(28 + text.length + this.length, 8);
    head.writeUInt32LE(text.length, 12);
    head.write("JSON", 16);
    bin.writeUInt32LE(this.length);
    bin.write("BIN\0", 4);
    return Buffer.concat([head, text, bin, ...this.pieces]);
  }
}

/** A Draco stream of the cloth. `bits` are those of positions, normals and texture coordinates; 0 keeps floats as they are. */
function dracoStream(mesh, { method, speed, bits }) {
  const encoder = new encoders.Encoder();
  const builder = new encoders.MeshBuilder();
  const target = new encoders.Mesh();
  builder.AddFacesToMesh(target, mesh.faces.length / 3, mesh.faces);
  const ids = {
    POSITION: builder.AddFloatAttributeToMesh(target, encoders.POSITION, mesh.count, 3, mesh.positions),
    NORMAL: builder.AddFloatAttributeToMesh(target, encoders.NORMAL, mesh.count, 3, mesh.normals),
    TEXCOORD_0: builder.AddFloatAttributeToMesh(target, encoders.TEX_COORD, mesh.count, 2, mesh.texcoords),
    COLOR_0: builder.AddUInt8Attribute(target, encoders.COLOR, mesh.count, 4, mesh.colors),
  };
  encoder.SetEncodingMethod(method);
  encoder.SetSpeedOptions(speed, speed);
  if (bits > 0) {
    encoder.SetAttributeQuantization(encoders.POSITION, bits);
    encoder.SetAttributeQuantization(encoders.NORMAL, Math.min(bits, 10));
    encoder.SetAttributeQuantization(encoders.TEX_COORD, bits);
  }
  const out = new encoders.DracoInt8Array();
  const length = encoder.EncodeMeshToDracoBuffer(target, out);
  if (length === 0) throw new Error("draco3d encodes nothing");
  const stream = Uint8Array.from({ length }, (_, k) => out.GetValue(k) & 255);
  for (const made of [out, target, builder, encoder]) encoders.destroy(made);
  return { stream, ids };
}

/** What draco3d decodes a stream to. */
function dracoReference({ stream, ids }) {
  const decoder = new decoders.Decoder();
  const mesh = new decoders.Mesh();
  const status = decoder.DecodeArrayToMesh(new Int8Array(stream), stream.length, mesh);
  if (!status.ok()) throw new Error(status.error_msg());
  const attribute = (id, width) => {
    const values = new decoders.DracoFloat32Array();
    decoder.GetAttributeFloatForAllPoints(mesh, decoder.GetAttributeByUniqueId(mesh, id), values);
    return Array.from({ length: values.size() }, (_, k) => values.GetValue(k)).reduce(rowsOf(width), []);
  };
  const face = new decoders.DracoInt32Array();
  const faces = Array.from({ length: mesh.num_faces() }, (_, k) => {
    decoder.GetFaceFromMesh(mesh, k, face);
    return [0, 1, 2].map((corner) => face.GetValue(corner));
  });
  return {
    points: mesh.num_points(),
    positions: attribute(ids.POSITION, 3),
    normals: attribute(ids.NORMAL, 3),
    texcoords: [attribute(ids.TEXCOORD_0, 2)],
    // As integers: the attribute is not normalized, nor is its accessor.
    colors: [attribute(ids.COLOR_0, 4)],
    faces,
  };
}

/** Collects numbers in rows. */
function rowsOf(width) {
  return (rows, x, k) => {
    if (k % width === 0) rows.push([]);
    rows.at(-1).push(x);
    return rows;
  };
}

function dracoCases(mesh) {
  const cases = [];
  for (const [name, method] of [["edgebreaker", encoders.MESH_EDGEBREAKER_ENCODING], ["sequential", encoders.MESH_SEQUENTIAL_ENCODING]]) {
    for (const speed of [0, 2, 4, 5, 6, 8, 10]) {
      for (const bits of [0, 8, 11, 14, 20]) {
        const made = dracoStream(mesh, { method, speed, bits });
        const expected = dracoReference(made);
        const glb = new Glb();
        const accessor = (componentType, type, count) => glb.accessor({ componentType, type, count });
        const { points } = expected;
        const attributes = {
          POSITION: accessor(5126, "VEC3", points),
          NORMAL: accessor(5126, "VEC3", points),
          TEXCOORD_0: accessor(5126, "VEC2", points),
          COLOR_0: accessor(5121, "VEC4", points),
        };
        const indices = accessor(5125, "SCALAR", 3 * expected.faces.length);
        const draco = { bufferView: glb.view(glb.place(made.stream)), attributes: made.ids };
        const primitive = { attributes, indices, extensions: { KHR_draco_mesh_compression: draco } };
        const bytes = glb.finished(primitive, ["KHR_draco_mesh_compression"]);
        cases.push({ name: `draco ${name}, speed ${speed}, ${bits} bits`, bytes, expected });
      }
    }
  }
  return cases;
}

/** The views of vertices that are compressed: their elements or the filtered floats. */
function meshoptViews(mesh) {
  const random = numbers(11);
  const { count } = mesh;
  const rows = (width, row) => Float32Array.from({ length: width * count }, row);
  const unit = (k) => (k % 4 === 3 ? 1 : mesh.normals[3 * Math.floor(k / 4) + (k % 4)]);
  const turns = Array.from({ length: count }, () => {
    const turn = [0, 0, 0, 0].map(() => random() - 0.5);
    const length = Math.hypot(...turn);
    return turn.map((x) => x / length);
  }).flat();
  const E = MeshoptEncoder;
  const views = [
    ["NONE", 12, bytesOf(mesh.positions)],
    ["NONE", 8, bytesOf(mesh.texcoords)],
    ["NONE", 4, mesh.colors],
    ["NONE", 32, Uint8Array.from({ length: 32 * count }, (_, k) => (k % 7 === 0 ? 256 * random() : k % 32))],
    ["OCTAHEDRAL", 4, E.encodeFilterOct(rows(4, (_, k) => unit(k)), count, 4, 8)],
    ["OCTAHEDRAL", 8, E.encodeFilterOct(rows(4, (_, k) => unit(k)), count, 8, 12)],
    ["OCTAHEDRAL", 8, E.encodeFilterOct(rows(4, (_, k) => unit(k)), count, 8, 16)],
    ["QUATERNION", 8, E.encodeFilterQuat(Float32Array.from(turns), count, 8, 16)],
    ["QUATERNION", 8, E.encodeFilterQuat(Float32Array.from(turns), count, 8, 11)],
    ["COLOR", 4, E.encodeFilterColor(rows(4, () => random()), count, 4, 8)],
    ["COLOR", 8, E.encodeFilterColor(rows(4, () => random()), count, 8, 12)],
  ];
  for (const mode of ["Separate", "SharedVector", "SharedComponent", "Clamped"]) {
    for (const bits of [1, 12, 24]) views.push(["EXPONENTIAL", 12, E.encodeFilterExp(mesh.positions, count, 12, bits, mode)]);
  }
  return views;
}

/** A case whose compressed view is read byte by byte, as texture coordinates, and whose triangles are compressed or not. */
function meshoptCase(mesh, extension, vertices, triangles) {
  const { count } = mesh;
  const { filter, stride } = vertices;
  const bytes = new Uint8Array(count * stride);
  MeshoptDecoder.decodeGltfBuffer(bytes, count, stride, vertices.stream, "ATTRIBUTES", filter);
  const corners = new Uint8Array(mesh.faces.length * triangles.size);
  MeshoptDecoder.decodeGltfBuffer(corners, mesh.faces.length, triangles.size, triangles.stream, triangles.mode);
  const glb = new Glb();
  let fallback = 0;
  const view = (stream, elements, size, more) => {
    const place = glb.place(stream);
    const at = fallback;
    fallback += 4 * Math.ceil((elements * size) / 4);
    const compression = { ...place, byteStride: size, count: elements, ...more };
    return { buffer: 1, byteOffset: at, byteLength: elements * size, extensions: { [extension]: compression } };
  };
  const compressed = glb.view({ ...view(vertices.stream, count, stride, { mode: "ATTRIBUTES", filter }), byteStride: stride });
  const indexView = glb.view(view(triangles.stream, mesh.faces.length, triangles.size, { mode: triangles.mode }));
  const positionView = glb.view(glb.place(bytesOf(mesh.positions)));
  const attributes = { POSITION: glb.accessor({ bufferView: positionView, componentType: 5126, type: "VEC3", count }) };
  const texcoords = [];
  for (let set = 0; 2 * set < stride; set += 1) {
    const place = { bufferView: compressed, byteOffset: 2 * set, componentType: 5121, type: "VEC2", count };
    attributes[`TEXCOORD_${set}`] = glb.accessor(place);
    texcoords.push(Array.from({ length: count }, (_, k) => [...bytes.subarray(k * stride + 2 * set, k * stride + 2 * set + 2)]));
  }
  const componentType = triangles.size === 2 ? 5123 : 5125;
  const indices = glb.accessor({ bufferView: indexView, componentType, type: "SCALAR", count: mesh.faces.length });
  glb.fallback = { byteLength: fallback, extensions: { [extension]: { fallback: true } } };
  const typed = triangles.size === 2 ? new Uint16Array(corners.buffer) : new Uint32Array(corners.buffer);
  const expected = {
    positions: [...mesh.positions].reduce(rowsOf(3), []),
    texcoords,
    faces: [...typed].reduce(rowsOf(3), []),
  };
  return { bytes: glb.finished({ attributes, indices }, ["KHR_mesh_quantization", extension]), expected };
}

function meshoptCases(mesh) {
  const E = MeshoptEncoder;
  const triangles = [];
  for (const size of [2, 4]) {
    const indices = bytesOf(size === 2 ? Uint16Array.from(mesh.faces) : mesh.faces);
    triangles.push({ size, mode: "TRIANGLES", stream: E.encodeIndexBuffer(indices, mesh.faces.length, size) });
    triangles.push({ size, mode: "INDICES", stream: E.encodeIndexSequence(indices, mesh.faces.length, size) });
  }
  const cases = [];
  for (const [filter, stride, bytes] of meshoptViews(mesh)) {
    for (const version of [0, 1]) {
      for (const level of [0, 1, 2, 3]) {
        const stream = E.encodeVertexBufferLevel(bytes, mesh.count, stride, level, version);
        const indices = triangles[cases.length % triangles.length];
        // The older extension has neither the codec's version 1 nor the filter COLOR.
        const old = version === 0 && filter !== "COLOR" && cases.length % 3 !== 0;
        const extension = old ? "EXT_meshopt_compression" : "KHR_meshopt_compression";
        const name = `${extension}, ${filter} of ${stride} bytes, version ${version}, level ${level}; ${indices.mode} of ${indices.size} bytes`;
        cases.push({ name, ...meshoptCase(mesh, extension, { filter, stride, stream }, indices) });
      }
    }
  }
  return cases;
}

/** Filters that compute with floats: a number of 16 bits may be rounded to either side. */
const ROUNDED = /(QUATERNION|COLOR) of 8 bytes/;

/** Whether sets of two bytes hold the same little-endian numbers, or such beside them. */
function isRoundedAlike(expected, found) {
  const number = ([low, high]) => low + 256 * high;
  const alike = (set, other) => set.length === other?.length && set.every((row, k) => Math.abs(number(row) - number(other[k])) <= 1);
  return expected.length === found?.length && expected.every((set, k) => alike(set, found[k]));
}

/** Where two values differ first; undefined if they are the same. */
function difference(expected, found, path = "") {
  if (typeof expected === "number") return Object.is(Math.fround(expected), Math.fround(found)) || expected === found ? undefined : `${path}: ${found}, not ${expected}`;
  if (!Array.isArray(found) || found.length !== expected.length) return `${path}: ${found?.length} elements, not ${expected.length}`;
  for (const [k, value] of expected.entries()) {
    const differs = difference(value, found[k], `${path}/${k}`);
    if (differs) return differs;
  }
  return undefined;
}

/** Draco's triangles by their corners; darn leaves out those that name a vertex twice. */
const proper = (faces) => faces.filter(([a, b, c]) => a !== b && b !== c && c !== a);

const folder = await mkdtemp(join(tmpdir(), "darn-decoders-"));
let failed = 0;
try {
  const mesh = cloth(40);
  const cases = [...dracoCases(mesh), ...meshoptCases(mesh)];
  const paths = cases.map((_, k) => join(folder, `${k}.glb`));
  await Promise.all(cases.map(({ bytes }, k) => writeFile(paths[k], bytes)));
  const { stdout } = await promisify(execFile)(decoded, paths, { maxBuffer: 1 << 30 });
  const lines = stdout.trim().split("\n");
  for (const [k, { name, expected }] of cases.entries()) {
    const found = JSON.parse(lines[k]);
    const all = { ...expected, faces: proper(expected.faces) };
    for (const what of ["faces", "positions", "normals", "texcoords", "colors"]) {
      const differs = all[what] && difference(all[what], found[what], `/${what}`);
      if (!differs || (what === "texcoords" && ROUNDED.test(name) && isRoundedAlike(all[what], found[what]))) continue;
      failed += 1;
      console.error(`${name}: ${differs}`);
      break;
    }
  }
  console.log(`decoders: ${cases.length} streams, ${failed} of them read otherwise than by draco3d and meshoptimizer`);
} finally {
  await rm(folder, { recursive: true });
}
process.exit(failed === 0 ? 0 : 1);
