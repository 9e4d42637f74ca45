// Laws of the modules that need no browser.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { load } from './sources.mjs';

const { Latest, Service, describeError, partsOf, problemOf } = await load('client.ts');
const { History } = await load('model/history.ts');
const { boundaryLines, linesOfLoops } = await load('scene/boundary.ts');
const { fillInWords, onlyFillInWords } = await load('model/fills.ts');
const { Editor } = await load('model/editor.ts');
const { locate, positionOf, normalOf } = await load('model/cloth.ts');
const { scanOf } = await load('model/scan_files.ts');
const { withLook } = await load('model/saved_look.ts');

/** A promise and what settles it. */
function deferred() {
  let resolve;
  const promise = new Promise((it) => (resolve = it));
  return { promise, resolve };
}

test('one task runs, and of those that come meanwhile the newest alone', async () => {
  const latest = new Latest();
  const ran = [];
  const first = deferred();
  latest.offer(async () => {
    ran.push(0);
    await first.promise;
  });
  for (const number of [1, 2, 3]) {
    latest.offer(async () => ran.push(number));
  }
  assert.deepEqual(ran, [0]);
  first.resolve();
  await new Promise((resolve) => setTimeout(resolve, 5));
  assert.deepEqual(ran, [0, 3]);
});

test('after `settled` nothing that waited runs', async () => {
  const latest = new Latest();
  const ran = [];
  const first = deferred();
  latest.offer(() => first.promise);
  latest.offer(async () => ran.push('waited'));
  const settled = latest.settled();
  first.resolve();
  await settled;
  assert.deepEqual(ran, []);
  latest.offer(async () => ran.push('next'));
  assert.deepEqual(ran, ['next']);
});

test('undo and redo go through all states, and a new one forgets those undone', () => {
  const history = new History('a');
  history.push('b');
  history.push('c');
  history.undo();
  history.undo();
  history.undo();
  assert.equal(history.present, 'a');
  assert.equal(history.next, 'b');
  history.redo();
  assert.equal(history.present, 'b');
  history.push('d');
  assert.equal(history.canRedo, false);
  history.undo();
  assert.equal(history.present, 'b');
});

/** A flat sheet of squares, without those in `missing`; every triangle with vertices of its own, as at texture seams. */
function sheet(side, missing) {
  const positions = [];
  for (let y = 0; y < side; y += 1) {
    for (let x = 0; x < side; x += 1) {
      if (!missing.some(([i, j]) => i === x && j === y)) {
        positions.push(x, y, 0, x + 1, y, 0, x + 1, y + 1, 0);
        positions.push(x, y, 0, x + 1, y + 1, 0, x, y + 1, 0);
      }
    }
  }
  const triangles = Uint32Array.from({ length: positions.length / 3 }, (_, i) => i);
  return { positions: new Float32Array(positions), triangles };
}

test('boundary loops are found across seams, with length and centroid', () => {
  const { positions, triangles } = sheet(7, [
    [2, 2],
    [5, 4],
  ]);
  const lines = boundaryLines(positions, triangles);
  assert.deepEqual(
    lines.map((line) => line.length).sort((a, b) => a - b),
    [4, 4, 28],
  );
  const loops = [
    { id: 7, length: 4, centroid: [5.5, 4.5, 0] },
    { id: 8, length: 28, centroid: [3.5, 3.5, 0] },
    { id: 9, length: 4, centroid: [2.5, 2.5, 0] },
    { id: 10, length: 4, centroid: [30, 0, 0] },
  ];
  const found = linesOfLoops(loops, lines);
  assert.deepEqual([...found.keys()].sort(), [7, 8, 9]);
  assert.deepEqual(found.get(7).centroid, [5.5, 4.5, 0]);
});

test('closed surfaces and triangles without area have no boundary loop', () => {
  const positions = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]);
  const closed = new Uint32Array([0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3, 0, 0, 1]);
  assert.deepEqual(boundaryLines(positions, closed), []);
});

test('parts of an answer are cut by their length, whatever their bytes', () => {
  const report = '{"a":1}';
  const patches = Buffer.from('--x\r\n\r\n--x--');
  const text = (name, type, length) =>
    `--x\r\ncontent-disposition: attachment; name="${name}"\r\ncontent-type: ${type}\r\ncontent-length: ${length}\r\n\r\n`;
  const body = Buffer.concat([
    Buffer.from(text('report', 'application/json', report.length) + report + '\r\n'),
    Buffer.from(text('patches', 'application/octet-stream', patches.length)),
    patches,
    Buffer.from('\r\n--x--\r\n'),
  ]);
  const bytes = body.buffer.slice(body.byteOffset, body.byteOffset + body.length);
  const parts = partsOf('multipart/mixed; boundary=x', bytes);
  assert.equal(Buffer.from(parts.get('report').body).toString(), report);
  assert.deepEqual(Buffer.from(parts.get('patches').body), patches);
  assert.throws(() => partsOf('model/gltf-binary', bytes));
  assert.throws(() => partsOf('multipart/mixed; boundary=x', bytes.slice(0, 150)));
});

test('a fill is told in words, and why it is none other where holes have one only', () => {
  const report = (...alternatives) => ({ holes: alternatives.map((alternative) => ({ patch: { alternative } })) });
  assert.equal(fillInWords(0, report(0)), 'Fill 1 of 8, the likeliest.');
  assert.equal(fillInWords(2, report(2)), 'Fill 3 of 8, beside the likeliest.');
  assert.match(fillInWords(2, report(0)), /^Fill 3 of 8\. .*this hole: it has one fill only/);
  assert.match(onlyFillInWords(2, report(0, undefined)), /these holes: each has one fill only/);
  for (const [alternative, ...reported] of [[0, 0], [2, 0, 2], [2]]) {
    assert.equal(onlyFillInWords(alternative, report(...reported)), undefined);
  }
});

/** A service of one hole whose mends are answered by the test, one after another. */
function serviceOfFills() {
  const asked = [];
  const hole = { id: 1, patchFaces: [0, 1, 2], patchUvs: [0, 0, 1, 0, 0, 1] };
  const service = {
    info: async () => ({ limits: {} }),
    holes: async () => ({ loops: [{ id: 1, kind: 'HOLE' }] }),
    openSession: async () => ({ id: 's', holes: [hole] }),
    positions: async () => new Float32Array(9),
    patches: async () => ({ glb: new ArrayBuffer(0), report: {} }),
    mend: (_, { alternative = 0 }, { signal }) =>
      new Promise((resolve, reject) => {
        signal.addEventListener('abort', () => reject(signal.reason));
        const report = { holes: [{ id: 1, patch: { alternative } }] };
        const answer = () => resolve({ positions: new Float32Array(9).fill(alternative), report });
        asked.push({ alternative, answer, refuse: reject });
      }),
    close: () => {},
  };
  return { service, asked };
}

/** Until everything that needs no answer has happened. */
const settled = () => new Promise((resolve) => setTimeout(resolve, 5));

test('one fill is asked for at a time, the newest waits, and each that came is a step', async () => {
  const { service, asked } = serviceOfFills();
  const editor = new Editor(service);
  await editor.open(new Blob(['scan']), 'scan.glb');
  await editor.chooseFill(1);
  assert.equal(editor.canVary, false, 'nothing is mended');
  const mended = editor.mend();
  await settled();
  assert.equal(editor.canVary, false, 'a session is being opened');
  asked[0].answer();
  await mended;

  const chosen = editor.chooseFill(1);
  await settled();
  for (const fill of [2, 3]) {
    await editor.chooseFill(editor.alternative + 1);
    assert.equal(editor.alternative, fill);
  }
  assert.deepEqual(
    asked.map(({ alternative }) => alternative),
    [0, 1],
  );
  asked[1].answer();
  await settled();
  assert.equal(editor.step.constraints.alternative, 1);
  asked[2].answer();
  await chosen;
  assert.equal(editor.message, 'Fill 4 of 8, beside the likeliest.');
  assert.deepEqual([...editor.patches[0].positions], Array(9).fill(3));
  editor.undo();
  assert.equal(editor.alternative, 1);
  editor.undo();
  assert.deepEqual([editor.alternative, editor.step.label], [0, 'Mend 1 hole']);
  editor.redo();
  assert.deepEqual([editor.alternative, editor.step.label], [1, 'Fill 2 of 8']);
});

test('a fill that is refused or stopped is none, and what waited for it is forgotten', async () => {
  const { service, asked } = serviceOfFills();
  const editor = new Editor(service);
  await editor.open(new Blob(['scan']), 'scan.glb');
  const mended = editor.mend();
  await settled();
  asked[0].answer();
  await mended;
  for (const end of [() => asked.at(-1).refuse(new Error('full')), () => editor.work.stop.abort()]) {
    const chosen = editor.chooseFill(1);
    await settled();
    await editor.chooseFill(2);
    end();
    await chosen;
    assert.deepEqual([editor.alternative, editor.step.label, editor.canVary], [0, 'Mend 1 hole', true]);
  }
  // A gesture that ends meanwhile goes first.
  const chosen = editor.chooseFill(1);
  await settled();
  editor.preview({ kind: 'grab', hole: 1, uv: [0.2, 0.2], offset: [0, 1, 0] });
  const grabbed = editor.commit();
  await chosen;
  await settled();
  assert.deepEqual([asked.at(-1).alternative, editor.alternative], [0, 0]);
  asked.at(-1).answer();
  await grabbed;
  assert.equal(editor.step.label, 'Grab');
});

test('a gesture that is refused can be changed, one that is applied is over', async () => {
  const { service, asked } = serviceOfFills();
  const editor = new Editor(service);
  await editor.open(new Blob(['scan']), 'scan.glb');
  const mended = editor.mend();
  await settled();
  asked[0].answer();
  await mended;
  const draft = { kind: 'grab', hole: 1, uv: [0.2, 0.2], offset: [0, 1, 0] };
  editor.preview(draft);
  const refused = editor.commit();
  await settled();
  asked.at(-1).refuse(new Error('too far'));
  await refused;
  assert.equal(editor.problem, 'Too far.');
  assert.equal(editor.draft, draft);
  const applied = editor.commit();
  await settled();
  asked.at(-1).answer();
  await applied;
  assert.deepEqual([editor.step.label, editor.draft], ['Grab', undefined]);
});

test('a place on cloth keeps its uv and follows the positions', () => {
  const hole = { id: 3, patchFaces: [0, 1, 2, 2, 1, 3], patchUvs: [0, 0, 1, 0, 0, 1, 1, 1] };
  const flat = { hole, positions: new Float32Array([0, 0, 0, 2, 0, 0, 0, 2, 0, 2, 2, 0]) };
  const lifted = { hole, positions: flat.positions.map((value, i) => (i % 3 === 2 ? 5 : value)) };
  for (const uv of [
    [0.25, 0.25],
    [0.75, 0.5],
    [0.5, 0.5],
    [1, 1],
  ]) {
    const point = locate(flat, uv);
    assert.equal(point.hole, 3);
    const [x, y, z] = positionOf(flat, point);
    assert.ok(Math.hypot(x - 2 * uv[0], y - 2 * uv[1], z) < 1e-6, String(uv));
    assert.equal(positionOf(lifted, point)[2].toFixed(6), '5.000000');
    assert.equal(normalOf(flat, point)[2], 1);
  }
  assert.equal(locate(flat, [1.2, 0]), undefined);
});

test('a problem document is read, and an answer of a proxy is named by its status', () => {
  const problem = problemOf(503, '7', JSON.stringify({ code: 'queue_full', detail: '3 jobs wait' }));
  assert.deepEqual([problem.code, problem.message, problem.retryAfter], ['queue_full', '3 jobs wait', 7]);
  assert.equal(problemOf(410, null, JSON.stringify({ code: 'session_expired', detail: 'gone' })).sessionIsGone, true);
  const other = problemOf(502, null, '<html>');
  assert.match(other.message, /502/);
  assert.equal(other.retryAfter, undefined);
});

test('every fault of a refused request is told once, with its place in words', () => {
  const told = (code, detail, ...errors) =>
    describeError(problemOf(422, null, JSON.stringify({ code, detail, errors })));
  const far = { pointer: '/anchors/1', detail: 'the cloth stays 4.2 away from it' };
  assert.equal(
    told('anchor_out_of_reach', '1 anchor(s) cannot be met: /anchors/1: the cloth stays 4.2 away from it', far),
    'Anchor 2: the cloth stays 4.2 away from it.\nMove the point nearer to the cloth, or make the anchor soft.',
  );
  const twist = { pointer: '/edits/0/twist/radius', detail: '2 is above 1' };
  assert.equal(
    told('invalid_constraints', '/edits/0/twist/radius: 2 is above 1', twist),
    'Gesture 1, twist radius: 2 is above 1.',
  );
  assert.equal(
    told('invalid_constraints', 'a field is wrong', twist),
    'A field is wrong.\nGesture 1, twist radius: 2 is above 1.',
  );
  const border = { pointer: '/holes/1/border', detail: '`from` lies 9 from the edge' };
  const cut = { pointer: '/holes/0/cut/radius', detail: 'is 0' };
  assert.equal(
    told(
      'constraints_misfit',
      '2 constraint(s) do not fit this scan: /holes/1/border: `from` lies 9 from the edge; /holes/0/cut/radius: is 0',
      border,
      cut,
    ),
    'Border: `from` lies 9 from the edge.\nCut out, radius: is 0.',
  );
  assert.equal(told('invalid_constraints', 'wrong', { detail: 'no JSON' }), 'Wrong.\nThe request: no JSON.');
  assert.equal(describeError(problemOf(400, null, '{}')), 'The service answered with status 400.');
});

test('a glTF takes the files in that it refers to, and says which one is missing', async () => {
  const file = (name, ...content) => Object.assign(new Blob(content), { name });
  const json = JSON.stringify({
    buffers: [{ uri: 'my%20cloth.bin', byteLength: 3 }, { uri: 'data:,x' }],
    images: [{ uri: 'textures/plaid.png' }],
  });
  const files = [file('plaid.png', 'P'), file('scan.gltf', json), file('my cloth.bin', new Uint8Array([1, 2, 255]))];
  const packed = await scanOf(files);
  assert.equal(packed.name, 'scan.gltf');
  const { buffers, images } = JSON.parse(await packed.file.text());
  assert.equal(buffers[0].uri, 'data:application/octet-stream;base64,AQL/');
  assert.equal(buffers[1].uri, 'data:,x');
  assert.equal(images[0].uri, 'data:image/png;base64,UA==');
  await assert.rejects(scanOf(files.slice(1)), /plaid\.png/);
  const glb = file('scan.glb', 'x');
  assert.deepEqual(await scanOf([file('notes.txt', ''), glb]), { file: glb, name: 'scan.glb' });
  assert.equal(await scanOf([]), undefined);
});

/** A service that takes one key, in place of the network; what it was sent. */
async function withService(key, body) {
  const seen = [];
  const real = globalThis.fetch;
  globalThis.fetch = async (url, { headers }) => {
    seen.push(headers.authorization);
    const status = headers.authorization === `Bearer ${key}` ? 200 : 401;
    const document = status === 200 ? { version: '1' } : { code: 'key_unknown', detail: 'unknown' };
    return new Response(JSON.stringify(document), { status });
  };
  try {
    await body(seen);
  } finally {
    globalThis.fetch = real;
  }
}

const SOMEWHERE = new URL('https://darn.example/');

test('a key is asked for once, however many requests are refused, and until one is taken', async () => {
  await withService('right', async (seen) => {
    const answers = ['wrong', 'right'];
    const service = new Service(SOMEWHERE, { askForKey: async () => answers.shift() });
    const infos = await Promise.all([service.info(), service.info()]);
    assert.deepEqual(infos, [{ version: '1' }, { version: '1' }]);
    assert.deepEqual(answers, []);
    await service.info();
    assert.equal(seen.at(-1), 'Bearer right');
  });
});

test('without a key, or with a wrong one and nobody to ask, a request is refused', async () => {
  await withService('right', async (seen) => {
    await assert.rejects(new Service(SOMEWHERE).info(), { code: 'key_unknown', keyIsRefused: true });
    await assert.rejects(new Service(SOMEWHERE, { key: 'wrong' }).info(), { status: 401 });
    await assert.rejects(new Service(SOMEWHERE, { askForKey: async () => undefined }).info(), { status: 401 });
    assert.deepEqual(seen, [undefined, 'Bearer wrong', undefined]);
    await new Service(SOMEWHERE, { key: 'right' }).info();
  });
});

test('lines of an answer are handed on as they come, however they are cut', async () => {
  const real = globalThis.fetch;
  const text = '{"found":{"uv":[0.5,0.5]}}\n{"map":{"cells":[1],"losses":[2],"total":2}}\n';
  const bytes = new TextEncoder().encode(text);
  const answer = (...tail) =>
    new ReadableStream({
      start(controller) {
        for (let at = 0; at < bytes.length; at += 7) {
          controller.enqueue(bytes.slice(at, at + 7));
        }
        tail.forEach((line) => controller.enqueue(new TextEncoder().encode(line)));
        controller.close();
      },
    });
  const told = [];
  const events = { onFound: (found) => told.push(found), onMap: (piece) => told.push(piece) };
  try {
    globalThis.fetch = async (_, { headers }) => {
      assert.equal(headers.accept, 'application/x-ndjson');
      return new Response(answer());
    };
    await new Service(SOMEWHERE).anchorMap('1', { target: [0, 0, 0] }, events, {});
    assert.deepEqual(told, [{ uv: [0.5, 0.5] }, { cells: [1], losses: [2], total: 2 }]);
    globalThis.fetch = async () => new Response(answer('{"problem":{"status":422,"code":"bad","detail":"no"}}'));
    await assert.rejects(new Service(SOMEWHERE).anchorMap('1', { target: [0, 0, 0] }, events, {}), { code: 'bad' });
  } finally {
    globalThis.fetch = real;
  }
});

test('a look is given to all new cloth, also to that of an earlier mend, and to nothing else', async () => {
  const KEY = 'KHR_materials_variants';
  const patch = (material) => ({
    material,
    extensions: {
      [KEY]: {
        mappings: [
          { material: 1, variants: [0, 1] },
          { material: 2, variants: [2] },
        ],
      },
    },
  });
  const document = (...materials) => ({
    extensions: {
      [KEY]: { variants: ['red', 'Reconstruction blended', 'Reconstruction marked'].map((name) => ({ name })) },
    },
    meshes: [{ primitives: [{ material: 0 }] }, { primitives: materials.map(patch) }],
  });
  const blob = (json) => new Blob([JSON.stringify(json)], { type: 'model/gltf+json' });
  const looks = async (json, look) => JSON.parse(await (await withLook(blob(json), look)).text());
  assert.deepEqual(await looks(document(1, 2), 'marked'), document(2, 2));
  assert.deepEqual(await looks(document(1, 2), 'blended'), document(1, 1));
  const [blended, mesh] = [blob(document(1, 1)), new Blob(['ply'], { type: 'model/ply' })];
  assert.equal(await withLook(blended, 'blended'), blended, 'what has the look stays as it is');
  assert.equal(await withLook(mesh, 'marked'), mesh);
});
