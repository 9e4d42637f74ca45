// Where the colour of new cloth comes from, as the modules know it.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { TEXTURED } from './shared.mjs';
import { load } from './sources.mjs';

const { Editor } = await load('model/editor.ts');
const { documentOf, hasColours, plainColours } = await load('model/gltf_document.ts');
const { colourInWords, textureInWords } = await load('model/textures.ts');

test('a scan has colours by its images or by its vertices', () => {
  const primitive = (attributes) => ({ meshes: [{ primitives: [{ attributes }] }] });
  assert.equal(hasColours(primitive({ POSITION: 0, TEXCOORD_0: 1 })), false);
  assert.equal(hasColours(primitive({ POSITION: 0, COLOR_0: 1 })), true);
  const bytes = TEXTURED.buffer.slice(TEXTURED.byteOffset, TEXTURED.byteOffset + TEXTURED.length);
  assert.equal(hasColours(documentOf(bytes)), true);
  assert.equal(hasColours(documentOf(new ArrayBuffer(0))), false);
});

test('colours of patches are those of their own materials without images', () => {
  const own = (look) => ({ name: 'darn reconstruction', pbrMetallicRoughness: look });
  const materials = [
    { name: 'cloth', pbrMetallicRoughness: { baseColorFactor: [0.1, 0.1, 0.1, 1] } },
    own({ baseColorTexture: { index: 0 } }),
    own({ baseColorFactor: [0.5, 0.2, 0.3, 1], metallicFactor: 0 }),
  ];
  const meshes = [0, 1, 2].map((material) => ({ primitives: [{ material }] }));
  const colours = plainColours({ materials, meshes }, [3, 5, 8, 9]);
  assert.deepEqual([...colours], [[8, { color: [0.5, 0.2, 0.3], roughness: 1, metalness: 0 }]]);
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
    patches: async () => ({ glb: new ArrayBuffer(0), report: { holes: [{ id: 1, texture: { method: 'flat' } }] } }),
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

test('a request that was stopped may have come: the result is asked for anew', async () => {
  const { ClothSession } = await load('client.ts');
  const met = [];
  const service = {
    openSession: async () => ({ id: 's', holes: [] }),
    mend: async (_, constraints, { signal } = {}) => {
      met.push(constraints.texture);
      signal?.throwIfAborted();
      return { positions: new Float32Array(0), report: {} };
    },
    result: async () => met.at(-1),
  };
  const cloth = await ClothSession.open(service, new Blob(['scan']), {}, {});
  await cloth.mend({ texture: 'flat' });
  const stopped = AbortSignal.abort(new Error('stopped'));
  await assert.rejects(cloth.mend({ texture: 'none' }, { signal: stopped }), /stopped/);
  assert.equal(await cloth.result({ texture: 'flat' }), 'flat');
  assert.deepEqual(met, ['flat', 'none', 'flat']);
});
