// Where the colour of new cloth comes from, as the modules know it.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { TEXTURED } from './shared.mjs';
import { load } from './sources.mjs';

const { headOfResult } = await load('client.ts');
const { Editor } = await load('model/editor.ts');
const { documentOf, hasColours, plainColours } = await load('model/gltf_document.ts');
const { colourInWords, textureInWords } = await load('model/textures.ts');

/** A GLB of a document and some bytes behind it. */
function glbOf(document, rest) {
  const json = Buffer.from(JSON.stringify(document));
  const header = Buffer.alloc(20);
  header.write('glTF');
  header.writeUInt32LE(json.length, 12);
  return Buffer.concat([header, json, rest]);
}

/** An answer of two parts in pieces of so many bytes; how many were taken. */
function answerInPieces(report, scan, size) {
  const part = (name, body) =>
    Buffer.concat([Buffer.from(`--x\r\ncontent-disposition: attachment; name="${name}"\r\n`), lengthOf(body), body]);
  const lengthOf = (body) => Buffer.from(`Content-Length: ${body.length}\r\n\r\n`);
  const parts = [part('report', Buffer.from(JSON.stringify(report))), part('scan', scan), Buffer.from('--x--')];
  const bytes = Buffer.concat(parts.flatMap((it) => [it, Buffer.from('\r\n')]));
  const taken = { count: 0, all: bytes.length };
  const pull = (controller) => {
    controller.enqueue(new Uint8Array(bytes.subarray(taken.count, taken.count + size)));
    taken.count += size;
    if (taken.count >= bytes.length) {
      controller.close();
    }
  };
  return { answer: new Response(new ReadableStream({ pull }, { highWaterMark: 0 })), taken };
}

test('the head of a mended scan is read however it is cut, and the buffers are not fetched', async () => {
  const report = { holes: [{ id: 1, texture: { method: 'flat' } }] };
  const document = { materials: [{ name: 'é' }] };
  for (const size of [1, 7, 4096]) {
    const { answer, taken } = answerInPieces(report, glbOf(document, Buffer.alloc(100_000)), size);
    assert.deepEqual(await headOfResult(answer), { report, document });
    assert.ok(taken.count < 10_000, `${taken.count} of ${taken.all} bytes`);
    const text = answerInPieces(report, Buffer.from(JSON.stringify(document)), size);
    assert.deepEqual(await headOfResult(text.answer), { report, document });
  }
  const cut = new Response('--x\r\ncontent-length: 9\r\n\r\n{}');
  await assert.rejects(headOfResult(cut), /ends before/);
});

test('a scan has colours by its images or by its vertices', () => {
  const primitive = (attributes) => ({ meshes: [{ primitives: [{ attributes }] }] });
  assert.equal(hasColours(primitive({ POSITION: 0, TEXCOORD_0: 1 })), false);
  assert.equal(hasColours(primitive({ POSITION: 0, COLOR_0: 1 })), true);
  const bytes = TEXTURED.buffer.slice(TEXTURED.byteOffset, TEXTURED.byteOffset + TEXTURED.length);
  assert.equal(hasColours(documentOf(bytes)), true);
  assert.equal(hasColours(documentOf(new ArrayBuffer(0))), false);
});

test('colours without images are those of the new patches, not of patches that the scan had', () => {
  const patch = (id, material, attributes = {}) => ({
    material,
    attributes,
    extras: { darn: { holes: [{ id }] } },
  });
  const material = (red) => ({ pbrMetallicRoughness: { baseColorFactor: [red, 0.2, 0.3, 1], metallicFactor: 0 } });
  const materials = [material(0.1), material(0.5)];
  const old = { primitives: [{}, patch(1, 0)] };
  const scan = { materials, meshes: [{ primitives: [{}] }, old] };
  const added = { primitives: [{}, patch(1, 1), patch(2, 1, { COLOR_0: 0 }), patch(3, 1)] };
  const colours = plainColours({ materials, meshes: [added, old] }, scan, new Set([1, 2]));
  assert.deepEqual([...colours], [[1, { color: [0.5, 0.2, 0.3], roughness: 1, metalness: 0 }]]);
});

test('a colour is told in words, with the reason, and where it is none that was asked for', () => {
  assert.equal(
    colourInWords({ method: 'synthesized', reason: 'it differs', width: 84, height: 81 }),
    'Its colour: images of its own, 84 × 81 texels; it differs.',
  );
  assert.equal(colourInWords({ method: 'none', reason: '' }), 'Its colour: grey.');
  const report = {
    holes: [
      { id: 1, texture: { method: 'continued' } },
      { id: 2, texture: { method: 'synthesized' } },
    ],
  };
  assert.equal(textureInWords(undefined, report), 'Colour of the new cloth: as darn decides.');
  assert.match(textureInWords('synthesize', report), /images of its own\. Not in hole 1: see the report\.$/);
});

test('one colour or fill is asked for at a time, the newest of each waits, and each that came is a step', async () => {
  const asked = [];
  const service = {
    info: async () => ({ limits: {} }),
    holes: async () => ({ loops: [{ id: 1, kind: 'HOLE' }] }),
    openSession: async () => ({ id: 's', holes: [{ id: 1, patchFaces: [0, 1, 2], patchUvs: [0, 0, 1, 0, 0, 1] }] }),
    positions: async () => new Float32Array(9),
    patches: async () => new ArrayBuffer(0),
    resultHead: async () => ({ report: { holes: [{ id: 1, texture: { method: 'flat' } }] }, document: {} }),
    mend: (_, constraints) =>
      new Promise((resolve) => {
        const answer = () => resolve({ positions: new Float32Array(9), report: { holes: [{ id: 1 }] } });
        asked.push({ constraints, answer });
      }),
    close: () => {},
  };
  const settled = () => new Promise((resolve) => setTimeout(resolve, 5));
  const answered = async () => {
    await settled();
    asked.at(-1).answer();
    await settled();
  };
  const editor = new Editor(service);
  await editor.open(new Blob(['{"images": [{}]}']), 'scan.gltf');
  await editor.vary({ texture: 'flat' });
  assert.equal(editor.texture, undefined, 'nothing is mended');
  void editor.mend();
  await answered();
  const chosen = editor.vary({ texture: 'none' });
  await settled();
  await editor.vary({ texture: 'flat' });
  await editor.chooseFill(2);
  assert.deepEqual([editor.texture, editor.alternative], ['flat', 2]);
  await answered();
  await answered();
  await answered();
  await chosen;
  assert.deepEqual(
    asked.map(({ constraints }) => constraints),
    [{}, { texture: 'none' }, { texture: 'none', alternative: 2 }, { texture: 'flat', alternative: 2 }],
  );
  assert.equal(editor.message, 'Colour of the new cloth: one colour.');
  assert.equal(editor.reportOf(1).texture.method, 'flat');
  editor.undo();
  assert.deepEqual([editor.texture, editor.alternative], ['none', 2]);
  editor.undo();
  editor.undo();
  assert.deepEqual([editor.texture, editor.step.label], [undefined, 'Mend 1 hole']);
  editor.redo();
  assert.deepEqual([editor.texture, JSON.parse(editor.constraintsText()).texture], ['none', 'none']);
});
