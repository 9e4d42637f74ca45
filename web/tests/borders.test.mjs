// Borders: that what is drawn is what is mended, in Node, then in a real browser with a real darn.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { repository } from './browser.mjs';
import { sheetWithBittenNeck } from './fixtures.mjs';
import { complaints, constraintsOf, drop, editorTests, saved, stateless } from './shared.mjs';
import { load } from './sources.mjs';

const { boundaryLines, linesOfLoops } = await load('scene/boundary.ts');
const { borderLines } = await load('scene/border_stretch.ts');
const { ClothEdge } = await load('scene/cloth_edge.ts');

/** Written by the service's own code: crates/mend/src/border_tests.rs. */
const MENDED = JSON.parse(readFileSync(join(repository, 'web/tests/borders.json')));

/** The loops of a scan, as the picture has them. */
function edgesOf({ positions, triangles, loops }) {
  const lines = linesOfLoops(loops, boundaryLines(new Float32Array(positions), new Uint32Array(triangles)));
  assert.equal(lines.size, loops.length);
  return loops.map((loop) => new ClothEdge(lines.get(loop.id), loop));
}

/** The largest distance between the points of two lists of lines, which must have as many points. */
function apart(lines, others) {
  assert.deepEqual(
    lines.map((line) => line.length),
    others.map((line) => line.length),
  );
  const differences = lines.flat().map((point, at) => {
    const other = others.flat()[at];
    return Math.hypot(...point.map((value, axis) => value - other[axis]));
  });
  return Math.max(0, ...differences);
}

for (const { name, border, stretches, hems, ...scan } of MENDED) {
  test(`what is drawn of a border is what is mended: ${name}`, () => {
    const drawn = borderLines(edgesOf(scan), border);
    assert.ok(apart(drawn.hems, hems) < 1e-4);
    // Where it is refused, what was asked is drawn.
    if (hems.length > 0) {
      assert.ok(stretches.length > 0);
      assert.ok(apart(drawn.stretches, stretches) < 1e-4);
    } else {
      assert.equal(drawn.stretches.length, 2);
    }
  });
}

test('nothing is drawn between one vertex and itself, nor without an edge', () => {
  const [scan] = MENDED;
  const nothing = { stretches: [], hems: [] };
  const here = { from: [0, 0, 0], to: [0, 0, 0], along: [] };
  assert.deepEqual(borderLines(edgesOf(scan), here), nothing);
  assert.deepEqual(borderLines([], { ...here, to: [1, 0, 0] }), nothing);
});

const inEditor = editorTests();

/** Where points of the scene are in the window. */
function onScreen(page, points) {
  return page.evaluate((places) => {
    const { viewer } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
    const { left, top, width, height } = viewer.canvas.getBoundingClientRect();
    const Vector = viewer.camera.position.constructor;
    return places.map((place) => {
      const { x, y } = new Vector(...place).project(viewer.camera);
      return { x: left + ((x + 1) / 2) * width, y: top + ((1 - y) / 2) * height };
    });
  }, points);
}

/** The broad lines that are drawn: the colour and the points of each. */
function drawnLines(page) {
  return page.evaluate(() => {
    const { viewer } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
    return viewer.marks.group.children
      .filter((mark) => mark.isLine2)
      .map(({ geometry, material }) => {
        const { instanceStart: start, instanceEnd: end } = geometry.attributes;
        const point = (of, at) => [of.getX(at), of.getY(at), of.getZ(at)];
        const points = Array.from({ length: start.count }, (_, at) => point(start, at));
        return { dashed: material.dashed, width: material.linewidth, points: [...points, point(end, end.count - 1)] };
      });
  });
}

inEditor(
  'the line that is drawn follows the bite of a neck, the longer way, and that is mended',
  async (editor, page, service) => {
    const scan = sheetWithBittenNeck();
    await drop(page, 'neck.glb', scan);
    await page.getByText('Holes (1)').waitFor();
    await editor.idle();
    await editor.tool('e');
    // The corners of the bite at the neck, which the service takes for one hole with it.
    const corner = (i, j) => [0.05 * i, 0.05 * Math.sin(0.4 * i), 0.05 * j];
    for (const { x, y } of await onScreen(page, [corner(18, 12), corner(22, 12)])) {
      await page.mouse.click(x, y);
    }
    await editor.idle();
    const lines = await drawnLines(page);
    const [stretch] = lines.filter(({ dashed, width }) => !dashed && width === 6);
    const [hem] = lines.filter(({ dashed }) => dashed);
    const z = ({ points }) => points.map(([, , depth]) => depth);
    assert.ok(Math.max(...z(stretch)) > 1.69, 'into the cloth');
    assert.ok(Math.min(...z(stretch)) > 0.59, 'and not around the neck');
    assert.ok(Math.max(...z(hem)) < 0.8, 'the hem goes on where the neck was');
    assert.deepEqual(await complaints(page), []);
    await editor.keep('border-neck');
    await editor.button('Mend up to the new hem').click();
    await editor.idle();
    assert.equal(await page.getByRole('alert').count(), 0);
    await editor.keep('border-neck-mended');
    const [patch] = await editor.model((it) => it.patches.map(({ hole }) => hole.rimPositions));
    const rim = Array.from({ length: patch.length / 3 }, (_, at) => patch.slice(3 * at, 3 * at + 3));
    const near = (point) => Math.min(...rim.map((place) => Math.hypot(...place.map((v, k) => v - point[k]))));
    for (const line of [stretch, hem]) {
      assert.ok(Math.max(...line.points.map(near)) < 1e-3, 'the patch lies within what was drawn');
    }
    const { holes } = await constraintsOf(editor);
    const { bytes } = await saved(editor, page);
    assert.ok(bytes.equals(await stateless(service, JSON.stringify({ holes }), scan)));
  },
);
