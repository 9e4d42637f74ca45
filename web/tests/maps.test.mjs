// Heat maps, and the dots and maps of anchors, in a real browser with a real darn.

import assert from 'node:assert/strict';
import { complaints, constraintsOf, editorTests } from './shared.mjs';

const inEditor = editorTests();

inEditor(
  'stretch and curvature are shown as colours with a legend, by keyboard, and follow the cloth',
  async (editor, page) => {
    await editor.openExample();
    const textured = await editor.picture();
    await editor.press('radio', 'Textured', 'ArrowDown', 'ArrowDown', 'ArrowDown', 'ArrowDown');
    assert.equal(await page.getByRole('radio', { name: 'Curvature' }).isChecked(), true);
    const legend = page.getByRole('group', { name: 'Legend: Curvature' });
    await legend.waitFor();
    assert.match(await legend.textContent(), /saddle, −\d.*dome, \d/s);
    await editor.idle();
    assert.ok((await editor.difference(textured, await editor.picture())) > 0.02);
    await editor.mend();
    await editor.idle();
    await editor.keep('heat-curvature');
    const mended = await editor.picture();
    await editor.tool('g');
    await editor.drag(await editor.onCloth(), { x: 40, y: -40 });
    await editor.keep('heat-curvature-grab');
    assert.ok((await editor.difference(mended, await editor.picture())) > 0.002, 'the colours follow the cloth');
    const curvature = await editor.picture();

    await page.getByRole('radio', { name: 'Stretch' }).check();
    await page.getByRole('group', { name: 'Legend: Stretch' }).waitFor();
    await editor.idle();
    assert.ok((await editor.difference(curvature, await editor.picture())) > 0.02);
    await editor.keep('heat-stretch');
    assert.deepEqual(await complaints(page), []);
    // The numbers behind the colours are those of the report.
    const stretch = await page.evaluate(() => {
      const { viewer } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
      const values = viewer.patches[0].heatValues('stretch');
      return values.reduce((sum, value) => sum + value, 0) / values.length;
    });
    const said = await editor.model((it) => it.step.report.holes[0].patch.stretchMean);
    assert.ok(Math.abs(stretch - said) < 0.03, `${stretch} and ${said}`);

    await editor.button('Undo').click();
    await page.getByRole('radio', { name: 'Textured' }).check();
    await page.getByLabel('New cloth in its own colour').check();
    await editor.button('Undo').click();
    await editor.idle();
    assert.equal(await page.getByRole('group', { name: /Legend/ }).count(), 0);
    assert.ok((await editor.difference(textured, await editor.picture())) < 0.002, 'the scan looks as it did');
  },
);

inEditor('confidence is shown as colours with a legend, which stay with their vertices', async (editor, page) => {
  await editor.openExample();
  await page.getByRole('radio', { name: 'Confidence' }).check();
  const legend = page.getByRole('group', { name: 'Legend: Confidence' });
  await legend.getByText(/Nothing is known/).waitFor();
  await editor.mend();
  await legend.getByText(/uncertain, 0\.\d/).waitFor();
  assert.match(await legend.textContent(), /certain, 0.*nine of ten vertices lie within 1\.6 times this.*scan's unit/s);
  await editor.idle();
  await editor.keep('heat-confidence');
  assert.deepEqual(await complaints(page), []);
  await page.getByText(/of the new vertices have nine chances in ten/).waitFor();

  // The middle of the patch, with and without the map.
  const { x, y } = await editor.onCloth();
  const clip = { x: x - 20, y: y - 20, width: 40, height: 40 };
  const confidence = await page.screenshot({ clip });
  await page.getByRole('radio', { name: 'Shaded' }).check();
  await page.getByLabel('New cloth in its own colour').uncheck();
  await editor.idle();
  assert.ok((await editor.difference(confidence, await page.screenshot({ clip }))) > 0.9);

  await page.getByRole('radio', { name: 'Confidence' }).check();
  await editor.idle();
  const shown = () =>
    page.evaluate(() => {
      const { viewer } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
      const [patch] = viewer.patches;
      return { values: [...patch.heatValues('confidence')], positions: [...patch.shown.positions] };
    });
  const before = await shown();
  const deviations = await editor.model((it) => it.patches[0].hole.patchDeviations);
  assert.ok(deviations.length > 0);
  assert.deepEqual(before.values, Array.from(Float32Array.from(deviations)));
  const still = await editor.picture();
  await editor.tool('g');
  await editor.drag(await editor.onCloth(), { x: 40, y: -40 });
  await editor.keep('heat-confidence-grab');
  const after = await shown();
  assert.notDeepEqual(after.positions, before.positions);
  assert.deepEqual(after.values, before.values);
  assert.ok((await editor.difference(still, await editor.picture())) > 0.002, 'the colours follow the cloth');
  await page.getByText(/Before anchors and gestures, half/).waitFor();
});

inEditor(
  'the dot of an anchor is dragged on the chart, the cloth follows, and arrow keys move it',
  async (editor, page) => {
    await editor.openExample();
    await editor.mend();
    await editor.tool('a');
    await editor.drag(await editor.onCloth(), { x: 20, y: -25 });
    await page.getByText(/The point belongs at u/).waitFor();
    const [placed] = (await constraintsOf(editor)).anchors;
    const dot = page.getByRole('slider', { name: 'Anchor 1 on the chart' });
    await dot.scrollIntoViewIfNeeded();
    const box = await dot.boundingBox();
    assert.ok(box.width >= 24 && box.height >= 24);
    const before = await editor.picture();

    let [inFlight, most, sent] = [0, 0, 0];
    await page.route('**/inpaint*', async (route) => {
      inFlight += 1;
      sent += 1;
      most = Math.max(most, inFlight);
      await new Promise((resolve) => setTimeout(resolve, 50));
      inFlight -= 1;
      await route.continue();
    });
    const from = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
    await editor.drag(
      from,
      { x: 25, y: 10 },
      {
        steps: 20,
        held: async () => {
          await page.waitForFunction(() => document.querySelector('darn-editor').editor.draftPatches !== undefined);
          await editor.idle();
          assert.ok((await editor.difference(before, await editor.picture())) > 0.0005, 'the cloth follows the dot');
          await editor.keep('dot-held');
        },
      },
    );
    assert.equal(most, 1, 'one request at a time');
    assert.ok(sent > 1 && sent <= 22, `${sent} requests`);
    await page.unrouteAll({ behavior: 'wait' });
    const [moved] = (await constraintsOf(editor)).anchors;
    assert.deepEqual(moved.position, placed.position);
    assert.ok(moved.uv[0] > placed.uv[0] + 0.03 && moved.uv[1] < placed.uv[1]);
    assert.equal(await editor.model((it) => it.step.label), 'Move anchor');

    await editor.press('slider', 'Anchor 1 on the chart', 'ArrowLeft', 'Shift+ArrowUp');
    assert.match(await dot.getAttribute('aria-valuetext'), /^u 0\.\d+, v 0\.\d+$/);
    await page.keyboard.press('Enter');
    await editor.idle();
    const [typed] = (await constraintsOf(editor)).anchors;
    assert.ok(
      Math.abs(typed.uv[0] - moved.uv[0] + 1 / 64) < 1e-9 && Math.abs(typed.uv[1] - moved.uv[1] - 1 / 256) < 1e-9,
    );
    assert.deepEqual(await complaints(page), []);
    await editor.button('Undo').click();
    await editor.button('Undo').click();
    assert.deepEqual((await constraintsOf(editor)).anchors, [placed]);
  },
);

inEditor('a map is drawn while its cells come, does not hold up a drag, and can be stopped', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  await editor.tool('a');
  // The cloth is dragged while the map comes, over and over: no cell may come between.
  await page.getByLabel('Point y').fill('-0.1');
  await page.keyboard.press('Tab');
  // Stopped in the page, with the first cells: on a fast machine the map is complete before a click comes from here, or before the page is asked again.
  await page.evaluate(() => {
    const element = document.querySelector('darn-editor');
    const within = (root) =>
      [...root.querySelectorAll('*')].flatMap((it) => (it.shadowRoot ? [it, ...within(it.shadowRoot)] : [it]));
    const stop = () => {
      const buttons = within(element.shadowRoot).filter((it) => it.localName === 'button');
      const button = buttons.find((it) => it.textContent.trim() === 'Stop the map');
      if (element.editor.map?.share > 0 && button !== undefined) {
        element.editor.removeEventListener('change', stop);
        button.click();
      }
    };
    element.editor.addEventListener('change', stop);
  });
  await editor.button('Draw the map').click();
  await page.waitForFunction(() => document.querySelector('darn-editor').editor.map?.share > 0);
  const rects = page.locator('darn-chart rect');
  const share = await editor.model((it) => it.map.share);
  assert.ok(share > 0 && share < 1, `${share}`);
  await page.waitForTimeout(300);
  assert.equal(await editor.model((it) => it.map.share), share, 'no more cells come');
  assert.equal(await page.getByRole('alert').count(), 0);
  assert.equal(await rects.count(), await editor.model((it) => it.map.losses.filter((loss) => loss !== null).length));
  await editor.keep('map-stopped');

  await editor.button('Draw the map').click();
  await page.waitForFunction(() => document.querySelector('darn-editor').editor.map?.share > 0);
  await editor.tool('g');
  await editor.drag(await editor.onCloth(), { x: 40, y: -20 }, { steps: 20 });
  assert.equal((await constraintsOf(editor)).edits.length, 1);
  await editor.tool('a');
  await page.waitForFunction(() => document.querySelector('darn-editor').editor.map.share === 1);
  const cells = await editor.model((it) => it.map.losses.filter((loss) => loss !== null).length);
  assert.equal(await rects.count(), cells);
  await editor.button('Undo').click();
  assert.equal(await rects.count(), 0);
});
