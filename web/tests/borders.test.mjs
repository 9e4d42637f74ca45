// Borders, openings and doubts: that what is drawn and said is what is mended, in Node, then in a real browser with a real darn.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { repository } from './browser.mjs';
import { sheetAndFrame, sheetGlb, sheetWithBite, sheetWithBittenNeck } from './fixtures.mjs';
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

inEditor('a bite is mended where it is listed, and not offered again until it is undone', async (editor, page) => {
  await drop(page, 'bite.glb', sheetWithBite());
  await page
    .getByText('bite.glb is open: 0 holes in 1 boundary loop, and 1 bite, rip or tear at the border.')
    .waitFor();
  await page.getByText('What is bitten or torn at its border is listed below.').waitFor();
  await editor.idle();
  const mend = editor.button('Mend Bite or rip 1');
  await mend.click();
  await page.getByText('Bite or rip 1 ✓ mended').waitFor();
  await editor.idle();
  assert.equal(await mend.count(), 0);
  // No stretch is drawn that the button of the tool would mend.
  await editor.tool('e');
  assert.equal(await editor.button('Mend up to the new hem').isDisabled(), true);
  assert.equal(await editor.model((it) => it.draft), undefined);
  assert.deepEqual(await complaints(page), []);
  // By hand it is refused in words of the page.
  await page.evaluate(() => {
    const { editor: it } = document.querySelector('darn-editor');
    const [{ border }] = it.scan.candidates;
    it.preview({ kind: 'border', from: border.from, to: border.to, along: [] });
  });
  await editor.button('Mend up to the new hem').click();
  await editor.idle();
  assert.match(await page.getByRole('alert').innerText(), /^Border: overlaps what/);
  await editor.button('Undo').click();
  await editor.idle();
  assert.equal(await mend.isEnabled(), true);
});

inEditor('a torn corner is shown and mended up to where it was', async (editor, page) => {
  await drop(
    page,
    'corner.glb',
    sheetGlb(30, (i, j) => i + j < 9),
  );
  await page.getByRole('button', { name: 'Torn corner 1', exact: true }).click();
  await editor.idle();
  const { along } = await editor.model((it) => it.draft);
  assert.equal(along.length, 1);
  await editor.keep('torn-corner');
  await editor.button('Mend Torn corner 1').click();
  await page.getByText('Torn corner 1 ✓ mended').waitFor();
  await editor.idle();
  const places = await editor.model((it) => [...it.patches[0].positions]);
  const off = Array.from({ length: places.length / 3 }, (_, k) =>
    Math.hypot(...along[0].map((value, axis) => value - places[3 * k + axis])),
  );
  assert.ok(Math.min(...off) < 0.03, `${Math.min(...off)}`);
  assert.deepEqual(await complaints(page), []);
});

inEditor('cloth that is no plausible one is left open with its reason, and accepted', async (editor, page) => {
  await drop(page, 'frame.glb', sheetAndFrame());
  await page.getByText('Holes (2)').waitFor();
  await editor.idle();
  const [left] = await editor.model((it) => it.scan.loops.filter(({ kind, length }) => kind === 'HOLE' && length > 3));
  await editor.button('Mend 2 holes').click();
  await editor.idle();
  await page.getByText('1 filled', { exact: false }).first().waitFor();
  await page.getByText('1 hole left open; the list says why.').waitFor();
  const why = page.locator('darn-holes li', { hasText: `Hole ${left.id}` }).locator('.why', { hasText: 'Left open' });
  const text = await why.innerText();
  assert.match(text, /^Left open: its patch is no plausible cloth: .* as much cloth as the piece/);
  assert.match(text, /“Mend with doubtful cloth, too” applies it all the same\.$/);
  assert.doesNotMatch(text, /acceptDoubtful|hole \d/);
  await editor.keep('doubtful-left');
  await page.getByLabel('Mend with doubtful cloth, too').check();
  await editor.button('Mend 2 holes').click();
  await editor.idle();
  await page.getByText('1 with doubtful cloth.').waitFor();
  assert.equal(await page.getByText('✓ mended').count(), 2);
  await page.locator('darn-holes').getByText('Doubtful: it would have', { exact: false }).waitFor();
  assert.equal((await constraintsOf(editor)).acceptDoubtful, true);
  assert.deepEqual(await complaints(page), []);
  await editor.keep('doubtful-accepted');
  await editor.button('Undo').click();
  await editor.idle();
  assert.equal(await page.getByText('✓ mended').count(), 1);
});

inEditor(
  'it is said of what kind a loop is, how sure that is, what speaks for it and what against',
  async (editor, page) => {
    await drop(
      page,
      'sheet.glb',
      sheetGlb(30, (i, j) => Math.hypot(i - 14.5, j - 14.5) < 4.3),
    );
    await page.getByText('Holes (1)').waitFor();
    await page.getByText(/^\d+ % sure that it is a hole$/).click();
    const reasons = await page.locator('darn-holes details p').allInnerTexts();
    const { evidence } = await editor.model((it) => it.scan.loops.find(({ kind }) => kind === 'HOLE'));
    assert.equal(reasons.length, evidence.length);
    assert.ok(evidence.some(({ weight }) => weight > 0) && evidence.some(({ weight }) => weight < 0));
    for (const { weight, reason } of evidence) {
      assert.ok(reasons.includes(`${weight > 0 ? 'But' : 'As'} ${reason}`), `${weight} ${reason}`);
    }
  },
);

inEditor('where all that is chosen is refused as doubtful, it can be accepted, too', async (editor, page) => {
  await drop(page, 'frame.glb', sheetAndFrame());
  await page.getByText('Holes (2)').waitFor();
  await editor.idle();
  const accept = page.getByLabel('Mend with doubtful cloth, too');
  await page.getByLabel('Choose Hole 3').uncheck();
  assert.equal(await accept.count(), 0);
  await editor.button('Mend 1 hole').click();
  await editor.idle();
  assert.match(await page.getByRole('alert').innerText(), /“Mend with doubtful cloth, too” applies it all the same\./);
  await accept.check();
  await editor.button('Mend 1 hole').click();
  await editor.idle();
  assert.equal(await page.getByRole('alert').count(), 0);
  assert.equal(await page.getByText('Hole 2 ✓ mended').count(), 1);
  // What is made by hand is accepted by the same control.
  await page.evaluate(() => document.querySelector('darn-editor').editor.undo());
  await accept.check();
  await page.evaluate(() => {
    const { editor: it } = document.querySelector('darn-editor');
    return it.make('Cut out', { cut: { center: [0.2, 0, 0.2], radius: 0.12 } });
  });
  await editor.idle();
  const { acceptDoubtful, holes } = await constraintsOf(editor);
  assert.equal(acceptDoubtful, true);
  assert.equal(holes.length, 1);
});
