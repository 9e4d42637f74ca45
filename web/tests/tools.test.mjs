// Cutting out and borders in a real browser with a real darn.

import assert from 'node:assert/strict';
import { sheetTornInTwo, sheetWithBite } from './fixtures.mjs';
import { complaints, constraintsOf, drop, editorTests, saved, stateless } from './shared.mjs';

const inEditor = editorTests();

inEditor('damaged cloth is cut out by dragging a ball, mended, undone and put back', async (editor, page, service) => {
  await editor.openExample();
  await editor.mend();
  await editor.tool('g');
  await editor.drag(await editor.onCloth(), { x: 30, y: -20 });
  const before = await editor.picture();
  const constraints = await constraintsOf(editor);

  await editor.tool('c');
  // New cloth is none of the scan's.
  const onCloth = await editor.onCloth();
  await page.mouse.click(onCloth.x, onCloth.y);
  await page
    .getByRole('status')
    .getByText(/Only cloth of the scan/)
    .waitFor();
  assert.equal(await editor.model((it) => it.draft), undefined);

  const damaged = await editor.onCloth(0.03, 0.17);
  await editor.drag(damaged, { x: 30, y: 0 });
  const dragged = await editor.model((it) => it.draft);
  assert.equal(dragged.kind, 'cut');
  assert.ok((await editor.difference(before, await editor.picture())) > 0.001, 'the ball is seen');
  await editor.keep('cut-ball');
  assert.deepEqual(await complaints(page), []);
  await page.mouse.move(damaged.x, damaged.y);
  await page.mouse.wheel(0, 100);
  await page.waitForFunction(
    (radius) => document.querySelector('darn-editor').editor.draft.radius < radius,
    dragged.radius,
  );

  await editor.button('Cut out and mend').click();
  await editor.idle();
  assert.equal(await page.getByRole('alert').count(), 0);
  const cut = await constraintsOf(editor);
  assert.equal(cut.holes.length, 2);
  assert.deepEqual(cut.holes[0], { id: 1 });
  assert.deepEqual(cut.holes[1].cut.center, dragged.center);
  assert.deepEqual(cut.edits, constraints.edits, 'the grab stays');
  assert.equal(await editor.model((it) => it.patches.length), 2);
  await page.getByText(/triangles of the scan were cut out first/).waitFor();
  await editor.keep('cut-mended');
  // The damaged cloth is gone from the picture wherever the new cloth is shown, and there where the scan is shown as it was.
  const taken = () =>
    page.evaluate(() => {
      const stage = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
      const { index } = stage.viewer.scan.meshes[0].geometry;
      let count = 0;
      for (let at = 0; at < index.count; at += 3) {
        count += index.getX(at) === index.getX(at + 1) ? 1 : 0;
      }
      return count;
    });
  const faces = await editor.model((it) => it.step.report.holes.reduce((sum, hole) => sum + (hole.cut?.faces ?? 0), 0));
  assert.equal(await taken(), faces);
  const file = await saved(editor, page);
  assert.ok(file.bytes.equals(await stateless(service, JSON.stringify(cut))), 'the bytes are those of POST /inpaint');

  await editor.button('Undo').click();
  await editor.idle();
  assert.equal(await taken(), 0);
  await editor.button('Redo').click();
  await editor.idle();
  assert.equal(await taken(), faces);
  await page.getByRole('button', { name: /Put back 1/ }).click();
  await editor.idle();
  assert.equal(await taken(), 0);
  assert.deepEqual(await constraintsOf(editor), constraints);
});

inEditor('a cut is typed, refused where it cannot be, and changed', async (editor, page) => {
  await editor.openExample();
  await page.getByRole('button', { name: 'Cut out', exact: true }).focus();
  await page.keyboard.press('Enter');
  await page.getByLabel('Radius').fill('0.000001');
  await page.getByLabel('Centre x').fill('50');
  await page.keyboard.press('Enter');
  await page.getByRole('alert').waitFor();
  await editor.idle();
  assert.match(await page.getByRole('alert').innerText(), /^Cut out: /);
  assert.equal(await editor.model((it) => it.draft.center[0]), 50, 'it can be changed');
  await editor.button('Cancel').focus();
  await page.keyboard.press('Enter');
  // The ball that is there at first lies around the hole.
  await editor.button('Cut out and mend').focus();
  await page.keyboard.press('Enter');
  await page
    .getByRole('status')
    .getByText(/Cut out: 1 filled/)
    .waitFor();
  await editor.idle();
  const { holes } = await constraintsOf(editor);
  assert.deepEqual(Object.keys(holes.at(-1).cut), ['center', 'radius']);
  await editor.button('Undo').click();
  await editor.button('Cut the edges of chosen holes back').click();
  await page
    .getByRole('status')
    .getByText(/Cut edges back: 1 filled/)
    .waitFor();
  assert.deepEqual((await constraintsOf(editor)).holes, [{ id: 1 }, { cut: { loops: [1] } }]);
});

inEditor(
  'damaged cloth is cut out under a polygon of clicks, mended, undone and loaded again',
  async (editor, page, service) => {
    await editor.openExample();
    const before = await editor.picture();
    await editor.tool('c');
    await page.getByRole('radio', { name: 'Polygon' }).check();
    assert.equal(await page.getByRole('button', { name: 'Cut out', exact: true }).getAttribute('aria-pressed'), 'true');
    assert.equal(await editor.button('Cut out and mend').isDisabled(), true, 'there are no corners');
    const clicks = [
      [0.02, 0.15],
      [0.06, 0.15],
      [0.06, 0.2],
      [0.02, 0.2],
    ];
    for (const [right, down] of clicks) {
      const { x, y } = await editor.onCloth(right, down);
      await page.mouse.click(x, y);
    }
    const draft = await editor.model((it) => it.draft);
    assert.deepEqual([draft.kind, draft.corners.length], ['polygon', 4]);
    await page
      .getByRole('status')
      .getByText(/4 corners/)
      .waitFor();
    await editor.idle();
    assert.ok((await editor.difference(before, await editor.picture())) > 0.001, 'the corners are seen');
    await editor.keep('cut-polygon');
    assert.deepEqual(await complaints(page), []);

    // Corners are taken back by key and by button, dragged, and typed.
    const corners = () => editor.model((it) => it.draft.corners);
    await page.keyboard.press('Backspace');
    assert.deepEqual(await corners(), draft.corners.slice(0, 3));
    await editor.button('Take the last corner back').click();
    await editor.button('Take the last corner back').click();
    assert.deepEqual(await corners(), draft.corners.slice(0, 1));
    // What is typed stays when a click takes the focus from its field, and a key in a field is for the field.
    const [x, y, z] = draft.corners[0];
    const typed = [x, Number((y + 0.001).toPrecision(6)), z];
    await page.getByLabel('Corner 1 y').fill(String(typed[1]));
    await page.keyboard.press('Home');
    await page.keyboard.press('Backspace');
    for (const [right, down] of clicks.slice(1)) {
      const corner = await editor.onCloth(right, down);
      await page.mouse.click(corner.x, corner.y);
    }
    await editor.drag(await editor.onCloth(...clicks[3]), { x: -12, y: 6 });
    const dragged = await corners();
    assert.deepEqual(dragged.slice(0, 3), [typed, ...draft.corners.slice(1, 3)]);
    assert.notDeepEqual(dragged[3], draft.corners[3]);
    const depth = page.getByLabel('Depth');
    const width = Math.max(
      ...dragged.flatMap((a) => dragged.map((b) => Math.hypot(...a.map((value, k) => value - b[k])))),
    );
    assert.ok(Math.abs(Number(await depth.inputValue()) - width / 10) < 1e-5 * width);
    await depth.fill('0.02');
    await page.keyboard.press('Tab');

    await editor.button('Cut out and mend').click();
    await editor.idle();
    assert.equal(await page.getByRole('alert').count(), 0);
    const cut = await constraintsOf(editor);
    assert.deepEqual(cut.holes, [{ cut: { polygon: dragged, depth: 0.02 } }]);
    await page.getByText(/triangles of the scan were cut out first/).waitFor();
    await page.getByText('Polygon of 4 corners ✓ mended').waitFor();
    await editor.keep('cut-polygon-mended');
    const { bytes } = await saved(editor, page);
    assert.ok(bytes.equals(await stateless(service, JSON.stringify(cut))), 'the bytes are those of POST /inpaint');

    await editor.button('Undo').click();
    await editor.idle();
    assert.equal(await editor.model((it) => it.step.made.length + it.step.cutFaces.length), 0);
    await page.evaluate(
      (text) => document.querySelector('darn-editor').editor.loadConstraints(text),
      JSON.stringify(cut),
    );
    await editor.idle();
    assert.deepEqual(await constraintsOf(editor), cut);
    assert.ok((await saved(editor, page)).bytes.equals(bytes));
  },
);

inEditor('cloth that is torn in two is shown, joined, and its edges can be typed', async (editor, page, service) => {
  const scan = sheetTornInTwo();
  await drop(page, 'torn.glb', scan);
  await page.getByText('Bites, rips and tears at the border (1)').waitFor();
  await editor.idle();
  const open = await editor.picture();
  await editor.button('Tear 1').click();
  await editor.idle();
  assert.ok((await editor.difference(open, await editor.picture())) > 0.0005, 'both edges are seen');
  await editor.keep('tear-shown');
  assert.deepEqual(await complaints(page), []);
  const { draft: told } = await editor.model((it) => ({ draft: it.draft }));
  await page.getByLabel('Facing from x').waitFor();
  await editor.button('Without the facing edge').click();
  assert.equal(await editor.model((it) => it.draft.facing), undefined);
  await editor.button('Join with a facing edge').click();
  for (const [end, name] of [
    ['from', 'Facing from'],
    ['to', 'Facing to'],
  ]) {
    for (const [axis, letter] of ['x', 'y', 'z'].entries()) {
      await page.getByLabel(`${name} ${letter}`).fill(String(told.facing[end][axis]));
      await page.keyboard.press('Tab');
    }
  }
  assert.deepEqual(await editor.model((it) => it.draft), told);
  await editor.button('Mend up to the new hem').click();
  await editor.idle();
  assert.equal(await page.getByRole('alert').count(), 0);
  await editor.keep('tear-mended');
  assert.ok((await editor.difference(open, await editor.picture())) > 0.005, 'new cloth is seen');
  await page.getByText('Tear ✓ mended').waitFor();
  const { holes } = await constraintsOf(editor);
  assert.equal(holes.length, 1);
  const bytes = (await saved(editor, page)).bytes;
  assert.ok(bytes.equals(await stateless(service, JSON.stringify({ holes }), scan)));
});

inEditor(
  'a bite at the border is shown, mended up to a new hem, and its hem is moved',
  async (editor, page, service) => {
    const scan = sheetWithBite();
    await drop(page, 'bite.glb', scan);
    await page.getByText('Bites, rips and tears at the border (1)').waitFor();
    await editor.idle();
    const open = await editor.picture();
    await editor.button('Bite or rip 1').click();
    await editor.idle();
    assert.ok((await editor.difference(open, await editor.picture())) > 0.0005, 'the stretch is seen');
    await editor.keep('border-stretch');
    assert.deepEqual(await complaints(page), []);
    await editor.button('Mend up to the new hem').click();
    await editor.idle();
    assert.equal(await page.getByRole('alert').count(), 0);
    await editor.keep('border-mended');
    assert.ok((await editor.difference(open, await editor.picture())) > 0.005, 'new cloth is seen');
    const { holes } = await constraintsOf(editor);
    assert.equal(holes.length, 1);
    assert.equal(holes[0].border.from.length, 3);
    const bytes = (await saved(editor, page)).bytes;
    assert.ok(bytes.equals(await stateless(service, JSON.stringify({ holes }), scan)));
    await editor.button('Undo').click();
    await editor.idle();

    // The same by hand: two clicks at the edge, and a point of the hem typed.
    const places = await page.evaluate(() => {
      const { shadowRoot } = document.querySelector('darn-editor');
      const { viewer } = shadowRoot.querySelector('darn-stage');
      const [{ border }] = document.querySelector('darn-editor').editor.scan.candidates;
      const { left, top, width, height } = viewer.canvas.getBoundingClientRect();
      const Vector = viewer.camera.position.constructor;
      return [border.from, border.to].map((point) => {
        const { x, y } = new Vector(...point).project(viewer.camera);
        return { x: left + ((x + 1) / 2) * width, y: top + ((1 - y) / 2) * height };
      });
    });
    await editor.tool('e');
    for (const { x, y } of places) {
      await page.mouse.click(x, y);
    }
    const draft = await editor.model((it) => it.draft);
    assert.equal(draft.kind, 'border');
    const near = (a, b) => a.every((value, axis) => Math.abs(value - b[axis]) < 0.06);
    assert.ok(near(draft.from, holes[0].border.from) && near(draft.to, holes[0].border.to));
    await editor.button('Add a point of the hem').click();
    await page.getByLabel('Hem 1 z').fill('0.05');
    await page.keyboard.press('Tab');
    assert.equal(await editor.model((it) => it.draft.along[0][2]), 0.05);
    // Its handle is dragged, too.
    const handle = { x: (places[0].x + places[1].x) / 2, y: (places[0].y + places[1].y) / 2 };
    const before = await editor.model((it) => it.draft.along[0]);
    const at = await page.evaluate(() => {
      const { viewer } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
      const { left, top, width, height } = viewer.canvas.getBoundingClientRect();
      const Vector = viewer.camera.position.constructor;
      const { x, y } = new Vector(...document.querySelector('darn-editor').editor.draft.along[0]).project(
        viewer.camera,
      );
      return { x: left + ((x + 1) / 2) * width, y: top + ((1 - y) / 2) * height };
    });
    assert.ok(Math.hypot(at.x - handle.x, at.y - handle.y) < 60);
    await editor.drag(at, { x: 0, y: 8 });
    assert.notDeepEqual(await editor.model((it) => it.draft.along[0]), before);
    await editor.keep('border-hem');
    await page.keyboard.press('Escape');
    assert.equal(await editor.model((it) => it.draft), undefined);
  },
);
