// Laws of the heat maps and of cuts, which need no browser.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { load } from './sources.mjs';

const { weld } = await load('scene/boundary.ts');
const { vertexNumbers } = await load('scene/curvature.ts');
const { patchStretch, stretchAt, stretchCells } = await load('scene/stretch.ts');
const { patchDeviations } = await load('scene/deviations.ts');
const { heatColors, ownColors, scaleOf } = await load('scene/heat_colors.ts');
const { holeInWords } = await load('model/report.ts');
const { Middles, indexWithout } = await load('scene/cut_faces.ts');
const { AnchorMap } = await load('model/anchor_map.ts');

/** A sheet of squares bent to a surface; every triangle with vertices of its own, as at texture seams. */
function bent(side, place) {
  const positions = [];
  const at = (i, j) => place((2 * i) / side - 1, (2 * j) / side - 1);
  for (let j = 0; j < side; j += 1) {
    for (let i = 0; i < side; i += 1) {
      positions.push(...at(i, j), ...at(i + 1, j), ...at(i + 1, j + 1));
      positions.push(...at(i, j), ...at(i + 1, j + 1), ...at(i, j + 1));
    }
  }
  const triangles = Uint32Array.from({ length: positions.length / 3 }, (_, i) => i);
  return { positions: new Float32Array(positions), triangles };
}

const middleOf = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];

test('curvature is that of the surface: of a dome, a saddle, a fold', () => {
  const radius = 2;
  for (const [place, expected] of [
    [(x, y) => [x, y, Math.sqrt(radius ** 2 - x ** 2 - y ** 2)], 1 / radius ** 2],
    [(x, y) => [Math.sin(x), y, Math.cos(x)], 0],
    [(x, y) => [x, y, 0], 0],
  ]) {
    const { positions, triangles } = bent(40, place);
    const { curvature } = vertexNumbers(positions, triangles, weld(positions));
    assert.ok(Math.abs(middleOf(curvature) - expected) < 0.02, `${middleOf(curvature)} and not ${expected}`);
    // Also at the border, which has no angles of its own; at a corner no inner vertex is near.
    assert.ok(curvature.every((value) => !(Math.abs(value - expected) >= 0.1)));
  }
  const saddle = bent(40, (x, y) => [x, y, (x ** 2 - y ** 2) / 4]);
  const { curvature } = vertexNumbers(saddle.positions, saddle.triangles, weld(saddle.positions));
  assert.ok(Math.min(...curvature.filter(Number.isFinite)) < -0.2);
});

test('cloth that is stored once for each side has the same curvature', () => {
  const { positions, triangles } = bent(20, (x, y) => [x, y, Math.sqrt(4 - x ** 2 - y ** 2)]);
  const back = triangles.map((vertex, at) => triangles[at % 3 === 0 ? at : at % 3 === 1 ? at + 1 : at - 1]);
  const both = new Uint32Array([...triangles, ...back]);
  const once = vertexNumbers(positions, triangles, weld(positions)).curvature;
  const twice = vertexNumbers(positions, both, weld(positions)).curvature;
  assert.ok(Math.abs(middleOf(twice) - middleOf(once)) < 0.02);
});

test('stretch is length over flat length, in the patch and around it', () => {
  const grid = Array.from({ length: 4096 }, (_, k) => [1.2 * (k % 64), 1.2 * Math.floor(k / 64), 0]);
  const hole = {
    chartSide: 64,
    gridPositions: grid.flat(),
    knownCells: Array.from({ length: 2048 }, (_, k) => k),
    patchFaces: [0, 1, 2],
    patchUvs: [0, 0, 1 / 64, 0, 0, 1 / 64],
  };
  const patch = { hole, positions: new Float32Array([0, 0, 0, 0.9, 0, 0, 0, 0.9, 0]) };
  assert.ok(patchStretch(patch).every((value) => Math.abs(value - 0.9) < 1e-6));
  const around = stretchAt(new Float32Array([12.3, 24.1, 0.1, 12, 70, 0, 12, 24, 9]), stretchCells([patch]));
  assert.ok(Math.abs(around[0] - 1.2) < 1e-6);
  assert.ok(Number.isNaN(around[1]) && Number.isNaN(around[2]), 'not known elsewhere');
  const noChart = { hole: { patchFaces: [0, 1, 2] }, positions: patch.positions };
  assert.ok(patchStretch(noChart).every(Number.isNaN));
  assert.equal(stretchCells([noChart]).stretch.length, 0);
});

test('a scale is round and leaves only extremes out; the middle is light, unknown places are grey', () => {
  const values = Float32Array.from({ length: 1000 }, (_, k) => (k < 20 ? 1e6 : (k - 500) / 150));
  const scale = scaleOf('curvature', [values]);
  assert.equal(scale.most, 5);
  assert.deepEqual(scaleOf('stretch', [new Float32Array([1, 1.04, 1 / 1.04])]), { heat: 'stretch', most: 0.05 });
  const shown = new Float32Array([-5, 0, 5, Number.NaN]);
  const colors = heatColors(shown, new Float32Array(4).fill(1), scale);
  const [low, middle, high, unknown] = [0, 1, 2, 3].map((at) => colors.slice(3 * at, 3 * at + 3));
  assert.ok(low[2] > low[0] && high[0] > high[2]);
  assert.ok(Math.min(...middle) > 0.9 && Math.max(...unknown) < 0.3);
});

test('deviations belong to vertices, wherever these are; those of other patches are not known', () => {
  const hole = { patchDeviations: [0, 0.25, 0.5] };
  const moved = new Float32Array([0, 0, 0, 5, 0, 0, 0, 7, 0]);
  for (const positions of [new Float32Array(9), moved]) {
    assert.deepEqual([...patchDeviations({ hole, positions })], [0, 0.25, 0.5]);
  }
  for (const other of [{}, { patchDeviations: [] }, { patchDeviations: [0, 1] }]) {
    assert.ok(patchDeviations({ hole: other, positions: moved }).every(Number.isNaN));
  }
});

test('the less certain the darker, from 0 to the largest deviation; nothing known is grey', () => {
  const extreme = Float32Array.from({ length: 1000 }, (_, k) => (k === 7 ? 4 : 0.001));
  const unknown = new Float32Array(3).fill(Number.NaN);
  const scale = scaleOf('confidence', [extreme, unknown]);
  assert.equal(scale.most, 4);
  const values = Float32Array.from({ length: 41 }, (_, k) => k / 10);
  const colors = heatColors(values, new Float32Array(41).fill(1), scale);
  const each = Array.from({ length: 41 }, (_, k) => [...colors.subarray(3 * k, 3 * k + 3)]);
  const luminance = ([red, green, blue]) => 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  each.slice(1).forEach((color, k) => assert.ok(luminance(color) < luminance(each[k]), `step ${k + 1}`));
  // The scale is yellow to everybody who sees yellow and blue apart, the greys are not.
  assert.ok(each.every(([red, , blue]) => blue < 0.7 * red));
  const greys = [heatColors(unknown, new Float32Array(3).fill(1), scale), ownColors(new Float32Array(1).fill(1))];
  assert.ok(greys.every(([red, , blue]) => blue > red));
  assert.ok(luminance(greys[1]) > 2 * luminance(greys[0]));
  assert.ok(Number.isNaN(scaleOf('confidence', [unknown]).most) && Number.isNaN(scaleOf('confidence', []).most));
  // Flat cloth is known to be certain.
  const flat = scaleOf('confidence', [new Float32Array(3)]);
  assert.equal(flat.most, 0);
  assert.deepEqual([...heatColors(new Float32Array(1), new Float32Array(1).fill(1), flat)], each[0]);
});

test('the report says the confidence in words: as the interval of half of the vertices, and by grades', () => {
  const confidence = { median: 0.02, p90: 0.05, veryHigh: 0.123, high: 0.5, medium: 0.374, low: 0.003, veryLow: 0 };
  const said = (hole) => holeInWords(hole).filter((line) => /confidence/.test(line));
  assert.deepEqual(said({ id: 1, patch: { confidence } }), [
    'Half of the new vertices have nine chances in ten to lie within 0.0329 of the cloth that was there; confidence is very high at 12 %, high at 50 %, medium at 37 % of the vertices.',
  ]);
  for (const made of [{ anchors: [{ distance: 0 }] }, { edits: [{ distance: 0 }] }]) {
    assert.match(said({ id: 1, patch: { confidence }, ...made })[0], /^Before anchors and gestures, half of/);
  }
  assert.deepEqual(said({ id: 1, patch: {} }), []);
});

test('triangles are taken out by their middles, and no others', () => {
  const { positions, triangles } = bent(10, (x, y) => [x, y, x * y]);
  const corners = (face) => [0, 1, 2].map((k) => positions.slice(9 * face + 3 * k, 9 * face + 3 * k + 3));
  const middle = (face) => [0, 1, 2].map((axis) => corners(face).reduce((sum, p) => sum + p[axis], 0) / 3);
  const gone = [3, 77, 120];
  const middles = new Middles(
    gone.flatMap((face) => middle(face).map((x) => x + 1e-8)),
    1e-6,
  );
  const left = indexWithout(Float64Array.from(positions), triangles, middles);
  const missing = [];
  for (let face = 0; face < left.length / 3; face += 1) {
    if (left[3 * face] === left[3 * face + 1]) {
      missing.push(face);
    }
  }
  assert.deepEqual(missing, gone);
  assert.equal(indexWithout(Float64Array.from(positions), triangles, new Middles([9, 9, 9], 1e-6)), undefined);
});

test('a map grows by its pieces until it has every cell', () => {
  const map = new AnchorMap(1, [0, 0, 0]);
  assert.equal(map.share, 0);
  map.add({ cells: [5, 9], losses: [0.5, 2], total: 4 });
  assert.deepEqual([map.losses[5], map.losses[9], map.losses[6], map.share], [0.5, 2, null, 0.5]);
  assert.equal(map.isComing, true);
  map.add({ cells: [1, 2], losses: [1, 1], total: 4 });
  assert.equal(map.isComing, false);
});
