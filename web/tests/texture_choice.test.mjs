// Where the colour of new cloth comes from, chosen in a real browser with a real darn.

import assert from 'node:assert/strict';
import axe from 'axe-core';
import { sheetInColours } from './fixtures.mjs';
import { TEXTURED, drop, editorTests, saved, stateless } from './shared.mjs';

const inEditor = editorTests();

inEditor('new cloth gets one colour, which is seen, saved, undone and loaded', async (editor, page, service) => {
  await drop(page, 'textured.glb', TEXTURED);
  await page.getByText('Holes (1)').waitFor();
  await editor.idle();
  const choice = page.getByLabel('Colour of the new cloth');
  assert.equal(await choice.count(), 0, 'nothing is mended');
  const opened = page.waitForResponse((answer) => answer.url().endsWith('/sessions') && answer.status() === 201);
  await editor.mend();
  const path = (await opened).headers().location;
  const report = page.locator('darn-report');
  await report.getByText(/^Its colour: images of its own, .*; the continued texture does not look like/).waitFor();
  const tint = page.getByLabel('New cloth in its own colour');
  await tint.uncheck();
  await editor.idle();
  const images = await editor.picture();
  await tint.check();

  await choice.selectOption('One colour');
  await page.getByRole('status').getByText('Colour of the new cloth: one colour.').waitFor();
  await editor.idle();
  assert.equal(await tint.isChecked(), false, 'the colour is seen');
  await report.getByText('Its colour: one, the mean of the cloth around the hole.').waitFor();
  const flat = await editor.picture();
  assert.ok((await editor.difference(images, flat)) > 0.01, 'the new cloth has other colours');
  await editor.keep('one_colour');
  await page.evaluate(axe.source);
  assert.deepEqual((await page.evaluate('axe.run()')).violations, []);
  const constraints = await editor.model((it) => it.constraintsText());
  assert.deepEqual(JSON.parse(constraints), { holes: [{ id: 1 }], texture: 'flat' });
  const file = await saved(editor, page);
  assert.ok(file.bytes.equals(await stateless(service, constraints, TEXTURED)), 'the bytes are those of POST /inpaint');

  await choice.selectOption('Grey');
  await editor.idle();
  assert.ok((await editor.difference(flat, await editor.picture())) > 0.01, 'grey is another colour');
  await editor.button('Undo').click();
  await editor.button('Undo').click();
  await editor.idle();
  assert.equal(await choice.inputValue(), '');
  assert.ok((await editor.difference(images, await editor.picture())) < 0.0005, 'undo shows what was before');
  const undone = await saved(editor, page);
  const plain = await stateless(service, '{"holes": [{"id": 1}]}', TEXTURED);
  assert.ok(undone.bytes.equals(plain), 'undo is saved, too');

  assert.equal((await fetch(new URL(path, service.url), { method: 'DELETE' })).status, 204);
  await page.getByText('Constraints as JSON', { exact: true }).click();
  await page.getByRole('textbox', { name: 'Constraints as JSON' }).fill(constraints);
  await editor.button('Load').click();
  await editor.idle();
  assert.equal(await choice.inputValue(), 'flat');
  assert.ok((await editor.difference(flat, await editor.picture())) < 0.0005, 'loading shows it again');
  assert.ok((await saved(editor, page)).bytes.equals(file.bytes), 'also in a session that was opened again');
});

inEditor('a scan without colours has nothing to choose from, and says why', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  assert.equal(await page.getByLabel('Colour of the new cloth').isDisabled(), true);
  await page.getByText(/neither images nor colours of vertices/).waitFor();
});

inEditor(
  'colours of vertices go on in the new cloth, are its mean or none, and come back after a heat map',
  async (editor, page) => {
    /** The colours of the patch's corners as text, each once. */
    const colours = () =>
      page.evaluate(() => {
        const stage = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
        const { array = [], itemSize } = stage.viewer.patches[0].mesh.geometry.attributes.color ?? {};
        const corners = Array.from({ length: array.length / itemSize || 0 }, (_, at) =>
          array.slice(itemSize * at, itemSize * (at + 1)).join(),
        );
        return [...new Set(corners)];
      });
    await drop(page, 'coloured.gltf', sheetInColours());
    await page.getByText('Holes (1)').waitFor();
    await editor.idle();
    await editor.mend();
    const own = await colours();
    assert.ok(own.length > 10, `${own.length} colours`);
    await page.getByLabel('Stretch').check();
    await page.waitForFunction((before) => {
      const stage = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
      return stage.viewer.patches[0].mesh.geometry.attributes.color.array.slice(0, 4).join() !== before;
    }, own[0]);
    await page.getByLabel('Textured').check();
    await editor.idle();
    assert.deepEqual(await colours(), own);
    for (const [name, count] of [
      ['One colour', 1],
      ['Grey', 0],
    ]) {
      await page.getByLabel('Colour of the new cloth').selectOption(name);
      await editor.idle();
      assert.equal((await colours()).length, count, name);
    }
  },
);
