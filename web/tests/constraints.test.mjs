// Laws of constraints as they are written, read and sent; these need no browser.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { load } from './sources.mjs';

const { readConstraints, carried, choiceOf, selectionOf, statelessMessageOf } = await load('model/constraints.ts');
const { depthOf, firstMaking, isWhole, madeBy, withCorner, withTypedCorner, withoutLastCorner } =
  await load('model/draft.ts');

test('constraints come back as they were written, and others are refused with what is wrong', () => {
  const constraints = {
    anchors: [{ hole: 1, position: [0, 0, 0] }],
    edits: [{ hole: 2, grab: { uv: [0.5, 0.5], offset: [0, 1, 0] } }],
    alternative: 3,
    texture: 'flat',
  };
  const made = [{ cut: { center: [0, 0, 0], radius: 1 } }, { border: { auto: true } }];
  const loops = [{ id: 1 }, { id: 2 }];
  // Hole 3 is that of the cut.
  const choice = { holes: [1, 2, 3], made, acceptDoubtful: false };
  const text = JSON.stringify(statelessMessageOf(loops, choice, constraints));
  assert.deepEqual(readConstraints(text), {
    holes: [1, 2],
    made,
    acceptDoubtful: false,
    selection: undefined,
    more: {},
    constraints,
  });
  assert.deepEqual(readConstraints('{"holes": [{"border": "auto"}]}').made, [made[1]]);
  // The first fill and the service's own decision are not named.
  const first = statelessMessageOf(loops, choice, { ...constraints, alternative: 0, texture: undefined });
  assert.equal('alternative' in first || 'texture' in first, false);
  const { alternative, texture } = readConstraints(JSON.stringify(first)).constraints;
  assert.deepEqual([alternative, texture], [0, undefined]);
  const others = ['{"alternative": 8}', '{"alternative": -1}', '{"alternative": 0.5}', '{"alternative": "1"}'];
  others.push('{"texture": "plaid"}', '{"texture": null}');
  for (const bad of ['', '[]', '{"holes": 1}', '{"edits": [1]}', ...others]) {
    assert.throws(() => readConstraints(bad), bad);
  }
});

test('members of constraints without a control are kept, those that choose holes as long as nobody chooses others', () => {
  const loops = [
    { id: 1, kind: 'HOLE' },
    { id: 2, kind: 'HOLE' },
  ];
  const cut = { cut: { loops: [1] } };
  const file = {
    holes: [{ id: 2 }, { near: [0, 0, 0] }, cut],
    fill: 'all',
    except: [4],
    maxDiameter: 3,
    minDiameter: 1,
  };
  const others = { weights: 'gravity', up: [0, 1, 0], later: true };
  const read = readConstraints(JSON.stringify({ ...file, ...others, alternative: 2 }));
  const choice = choiceOf(read, { holes: [] }, loops);
  assert.deepEqual(choice.made, [cut]);
  assert.deepEqual(selectionOf(loops, choice), { ...file, ...others });
  assert.deepEqual(statelessMessageOf(loops, choice, read.constraints), { ...file, ...others, alternative: 2 });
  // A choice by hand takes the place of what the file chose.
  const chosen = { ...choice, holes: [2], made: [], selection: undefined };
  assert.deepEqual(selectionOf(loops, chosen), { except: [1], ...others });
  assert.deepEqual(statelessMessageOf(loops, chosen, read.constraints), {
    holes: [{ id: 2 }],
    ...others,
    alternative: 2,
  });
  // Without such members the file's own holes are chosen as by hand.
  assert.equal(readConstraints(JSON.stringify({ holes: [{ id: 2 }], ...others })).selection, undefined);
});

test('a polygon gets corners one by one, is deep as a tenth of its width unless that is said, and comes back from JSON', () => {
  const loops = [
    { id: 0, kind: 'OUTER_BOUNDARY', centroid: [9, 9, 9] },
    { id: 1, kind: 'HOLE', centroid: [1, 2, 3] },
  ];
  let draft = firstMaking('polygon', { loops, candidates: [] });
  assert.deepEqual([draft.corners, depthOf(draft)], [[], 0]);
  // Where nothing was clicked, at the hole; then where the last one is.
  draft = withTypedCorner(draft, loops);
  assert.deepEqual(draft.corners, [[1, 2, 3]]);
  draft = withCorner(withTypedCorner(draft, loops), 1, [1, 2, 7]);
  assert.equal(isWhole(draft), false);
  draft = withCorner(withTypedCorner(draft, loops), 2, [4, 2, 3]);
  assert.equal(isWhole(draft), true);
  const corners = [
    [1, 2, 3],
    [1, 2, 7],
    [4, 2, 3],
  ];
  assert.deepEqual(madeBy(draft), { cut: { polygon: corners, depth: 0.5 } });
  assert.equal(depthOf(withoutLastCorner(draft)), 0.4);
  assert.deepEqual(withoutLastCorner(draft).corners, corners.slice(0, 2));
  assert.deepEqual(withoutLastCorner(firstMaking('polygon', { loops, candidates: [] })).corners, []);
  const entry = madeBy({ ...draft, depth: 2 });
  assert.equal(entry.cut.depth, 2);
  const choice = { holes: [1], made: [entry], acceptDoubtful: false };
  const message = statelessMessageOf(loops, choice, { anchors: [], edits: [], alternative: 0 });
  assert.deepEqual(readConstraints(JSON.stringify(message)).made, [entry]);
});

test('constraints go with the hole that has the same rim, whatever its number', () => {
  const hole = (id, ...rimPositions) => ({ id, rimPositions });
  const before = [hole(1, 0, 0, 0), hole(2, 1, 1, 1), hole(3, 2, 2, 2)];
  const after = [hole(1, 0, 0, 0), hole(4, 1, 1, 1), hole(3, 9, 9, 9)];
  const anchors = [1, 2, 3].map((id) => ({ hole: id, position: [0, 0, id] }));
  const edits = [{ grab: { uv: [0, 0], offset: [0, 0, 0] } }];
  assert.deepEqual(carried({ anchors, edits, alternative: 2, texture: 'none' }, before, after), {
    anchors: [anchors[0], { ...anchors[1], hole: 4 }],
    edits,
    alternative: 2,
    texture: 'none',
  });
});

test('holes are chosen by leaving others out, other loops by name', () => {
  const kinds = ['OUTER_BOUNDARY', 'HOLE', 'HOLE', 'OPENING'];
  const loops = kinds.map((kind, id) => ({ id, kind }));
  const choice = (...ids) => selectionOf(loops, { holes: ids, made: [], acceptDoubtful: false });
  assert.deepEqual(choice(1, 2), {});
  assert.deepEqual(choice(2), { except: [1] });
  assert.deepEqual(choice(1, 2, 3), { holes: [{ id: 3 }], fill: 'holes' });
  assert.deepEqual(choice(1, 3), { holes: [{ id: 3 }], fill: 'holes', except: [2] });
  assert.deepEqual(choice(3), { holes: [{ id: 3 }], except: [1, 2] });
  const cut = { cut: { center: [0, 0, 0], radius: 1 } };
  assert.deepEqual(selectionOf(loops, { holes: [1, 2, 7], made: [cut], acceptDoubtful: true }), {
    holes: [cut],
    fill: 'holes',
    acceptDoubtful: true,
  });
  assert.deepEqual(selectionOf(loops, { holes: [], made: [cut], acceptDoubtful: false }), {
    holes: [cut],
    except: [1, 2],
  });
});
