// What the panels and keys of the editor do beside the tools, in a real browser with a real darn.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { sheetWithThreeHoles } from './fixtures.mjs';
import { drop, editorTests, saved, stateless } from './shared.mjs';

const inEditor = editorTests();

/** What can be clicked or dragged and is smaller than 24 CSS pixels on a side. */
function smallTargets() {
  const within = (root) =>
    [...root.querySelectorAll('*')].flatMap((it) => [it, ...(it.shadowRoot ? within(it.shadowRoot) : [])]);
  return within(document)
    .filter((it) => it.matches('a, button, input, select, textarea, summary, [role=slider], [tabindex]'))
    .filter((it) => it.checkVisibility())
    .map((it) => ({ it, box: it.getBoundingClientRect() }))
    .filter(({ box }) => box.width < 24 || box.height < 24)
    .map(({ it, box }) => `${it.localName} ${it.textContent.trim()} ${box.width} x ${box.height}`);
}

inEditor('every target is at least 24 pixels wide and high', async (editor, page) => {
  assert.deepEqual(await page.evaluate(smallTargets), []);
  await editor.openExample();
  await editor.mend();
  await editor.tool('a');
  await editor.drag(await editor.onCloth(), { x: 20, y: -15 });
  for (const summary of await page.locator('summary').all()) {
    await summary.click();
  }
  assert.ok((await page.locator('summary').count()) >= 1);
  for (const key of ['l', 'g', 't', 'p', 'a', 'c', 'e']) {
    await editor.tool(key);
    await editor.idle();
    assert.deepEqual(await page.evaluate(smallTargets), [], key);
  }
});

inEditor(
  'constraints are saved as a file and loaded from one, with members that have no control',
  async (editor, page, service) => {
    const sheet = sheetWithThreeHoles();
    await drop(page, 'sheet.glb', sheet);
    await page.getByText('Holes (3)').waitFor();
    await editor.idle();
    const ids = await editor.model((it) => [...it.chosen]);
    const shared = { except: [ids[1]], minDiameter: 0.1, weights: 'standard', texture: 'none' };
    await page.getByText('Constraints as JSON', { exact: true }).click();
    const load = async (constraints) => {
      const buffer = Buffer.from(JSON.stringify(constraints));
      const chooser = page.waitForEvent('filechooser');
      await editor.button('Load a file').click();
      await (await chooser).setFiles({ name: 'sheet.constraints.json', mimeType: 'application/json', buffer });
      await editor.idle();
    };
    await load(shared);
    assert.deepEqual(await page.getByRole('alert').allTextContents(), []);
    assert.equal(await page.getByText('✓ mended').count(), 2);
    assert.deepEqual(await editor.model((it) => [...it.step.holes]), [ids[0], ids[2]]);

    const [download] = await Promise.all([page.waitForEvent('download'), editor.button('Save as a file').click()]);
    assert.equal(download.suggestedFilename(), 'sheet.constraints.json');
    const text = readFileSync(await download.path(), 'utf8');
    assert.deepEqual(JSON.parse(text), shared);
    assert.ok((await saved(editor, page)).bytes.equals(await stateless(service, text, sheet)));

    // The service checks what the editor does not know.
    await load({ ...shared, weights: 'silk' });
    await page.getByRole('alert').getByText(/silk/).waitFor();

    await page.getByRole('checkbox', { name: `Choose Hole ${ids[0]}`, exact: true }).uncheck();
    await editor.button('Mend 1 hole').click();
    await editor.idle();
    const { holes, weights, minDiameter } = JSON.parse(await editor.model((it) => it.constraintsText()));
    assert.deepEqual([holes, weights, minDiameter], [[{ id: ids[2] }], 'standard', undefined]);
  },
);

/** A GLB as the text of its JSON and the chunks behind it. */
function chunksOf(glb) {
  assert.equal(glb.readUInt32LE(8), glb.length);
  const end = 20 + glb.readUInt32LE(12);
  return { json: JSON.parse(glb.subarray(20, end)), rest: glb.subarray(end) };
}

inEditor('the new cloth of a saved scan is marked or blended, and a picture is saved', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  const blended = chunksOf((await saved(editor, page)).bytes);
  await page.getByRole('radio', { name: 'Marked by glowing stripes' }).check();
  await page.getByText(/“Reconstruction blended” and “Reconstruction marked”/).waitFor();
  const file = (await saved(editor, page)).bytes;
  const marked = chunksOf(file);
  assert.ok(marked.rest.equals(blended.rest));
  const variants = marked.json.extensions.KHR_materials_variants.variants.map(({ name }) => name);
  const primitives = ({ json }) => json.meshes.flatMap((mesh) => mesh.primitives);
  const changed = primitives(blended).filter((it, at) => it.material !== primitives(marked)[at].material);
  assert.equal(changed.length, 1);
  for (const [at, primitive] of primitives(marked).entries()) {
    const mappings = primitive.extensions?.KHR_materials_variants?.mappings ?? [];
    const look = mappings.find((it) => it.variants.includes(variants.indexOf('Reconstruction marked')));
    assert.equal(primitive.material, look?.material ?? primitives(blended)[at].material);
    primitive.material = primitives(blended)[at].material;
  }
  assert.deepEqual(marked.json, blended.json, 'nothing else has changed');

  const [download] = await Promise.all([page.waitForEvent('download'), editor.button('Save a picture').click()]);
  assert.equal(download.suggestedFilename(), 'scarf_hole.png');
  const png = readFileSync(await download.path()).toString('base64');
  const { share, width } = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    return {
      width: image.width,
      share: data.filter((value, at) => at % 4 === 3 && value > 0).length / (data.length / 4),
    };
  }, png);
  const stage = await page.locator('darn-stage').boundingBox();
  assert.equal(width, stage.width);
  assert.ok(share > 0.1 && share < 0.95, `${share} of the picture is drawn, the rest is transparent`);

  // The file that was saved shows its stripes without a choice.
  const before = await editor.picture();
  await drop(page, 'marked.glb', file);
  await page
    .getByRole('status')
    .getByText(/marked\.glb is open/)
    .waitFor();
  await editor.idle();
  await page.getByRole('checkbox', { name: /Outlines/ }).uncheck();
  await editor.idle();
  await editor.keep('saved-marked');
  assert.ok((await editor.difference(before, await editor.picture())) > 0.01);
});

/** What is marked in the scene: of the ring its radius, and whether there is a disk. */
function twistMarks() {
  const { marks } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage').viewer;
  const ring = marks.group.children.find((it) => it.type === 'LineLoop');
  const disk = marks.group.children.find((it) => it.name === 'twist');
  ring?.geometry.computeBoundingSphere();
  return { radius: ring?.geometry.boundingSphere.radius ?? 0, hasDisk: disk !== undefined };
}

inEditor(
  'the disk of a twist is seen under the pointer, before and while the wheel changes it',
  async (editor, page) => {
    await editor.openExample();
    await editor.mend();
    const middle = await editor.onCloth();
    await page.mouse.move(middle.x + 1, middle.y);
    await editor.idle();
    assert.deepEqual(await page.evaluate(twistMarks), { radius: 0, hasDisk: false }, 'only for the twist');
    const plain = await editor.picture();
    await editor.tool('t');
    await page.mouse.move(middle.x, middle.y);
    await editor.idle();
    const hovered = await page.evaluate(twistMarks);
    assert.ok(hovered.radius > 0 && hovered.hasDisk);
    assert.ok((await editor.difference(plain, await editor.picture())) > 0.005, 'the disk is seen');
    await editor.keep('twist-disk');
    await page.mouse.wheel(0, -100);
    await editor.idle();
    const wider = await page.evaluate(twistMarks);
    assert.ok(Math.abs(wider.radius / hovered.radius - 1.1) < 1e-3, 'the wheel changes it before a drag');
    const field = page.getByLabel('Radius');
    assert.equal(await field.inputValue(), '0.1375', 'the field shows it');
    await page.mouse.down();
    await editor.idle();
    const pressed = await page.evaluate(twistMarks);
    assert.ok(Math.abs(pressed.radius / wider.radius - 1) < 1e-5 && pressed.hasDisk, 'a press keeps it');
    assert.equal(await editor.model((it) => it.draft), undefined);
    await page.mouse.up();
    const aside = await page.locator('aside').boundingBox();
    await page.mouse.move(aside.x + 20, aside.y + 20);
    await editor.idle();
    assert.equal((await page.evaluate(twistMarks)).radius, 0, 'away from the cloth there is none');
    await field.fill('0.25');
    await page.keyboard.press('Tab');
    await editor.idle();
    assert.ok(
      Math.abs((await page.evaluate(twistMarks)).radius / hovered.radius - 2) < 1e-3,
      'the disk shows the field',
    );
    await page.mouse.move(middle.x, middle.y);
    await page.mouse.wheel(0, 100);
    await editor.idle();
    assert.equal(await field.inputValue(), '0.227273', 'the wheel goes on from there');
  },
);

inEditor('what was done and what can be done next is seen on the picture', async (editor, page) => {
  const said = page.getByRole('status');
  const isSeen = async () => {
    const [words, stage] = [await said.boundingBox(), await page.locator('darn-stage').boundingBox()];
    return words.height > 15 && words.y > stage.y && words.y + words.height < stage.y + stage.height;
  };
  assert.equal(await isSeen(), false, 'there is nothing to say');
  await editor.openExample();
  await said.getByText('scarf_hole.glb is open: 1 hole').waitFor();
  assert.equal(await isSeen(), true);
  const main = page.locator('#mend.main');
  assert.equal(await main.count(), 1);
  await editor.mend();
  assert.equal(await main.count(), 0, 'it is done');
  await editor.tool('p');
  const { x, y } = await editor.onCloth();
  await page.mouse.click(x, y);
  await said.getByText('Pinch: click the second point.').waitFor();
  assert.equal(await isSeen(), true);
  await editor.button('None').click();
  assert.equal(await main.count(), 1, 'another mend would change something');
});

/** Where the camera is and what it turns about. */
function cameraNow() {
  const { camera, controls } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage').viewer;
  const distance = camera.position.distanceTo(controls.target);
  return { position: [...camera.position], target: [...controls.target], distance };
}

inEditor('the camera turns, moves and zooms by keys on the picture, whatever the tool', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  await editor.tool('g');
  const start = await page.evaluate(cameraNow);
  const after = async (...keys) => {
    for (const key of keys) {
      await page.keyboard.press(key);
    }
    return page.evaluate(cameraNow);
  };
  const apart = (a, b) => Math.hypot(...a.map((value, axis) => value - b[axis]));

  const still = await editor.picture();
  const turned = await after('ArrowLeft', 'ArrowUp');
  await editor.idle();
  assert.ok((await editor.difference(still, await editor.picture())) > 0.01, 'the picture follows');
  assert.ok(apart(turned.target, start.target) < 1e-9 * start.distance);
  assert.ok(apart(turned.position, start.position) > 0.05 * start.distance);
  assert.ok(Math.abs(turned.distance / start.distance - 1) < 1e-9);
  const back = await after('ArrowRight', 'ArrowDown');
  assert.ok(apart(back.position, start.position) < 1e-6 * start.distance, 'the other arrows turn it back');

  const moved = await after('Shift+ArrowRight', 'Shift+ArrowDown');
  assert.ok(apart(moved.target, back.target) > 0.01 * start.distance);
  assert.ok(Math.abs(moved.distance / start.distance - 1) < 1e-9);
  const near = await after('+', '+');
  assert.ok(Math.abs(near.distance / start.distance - 0.81) < 1e-6);
  assert.ok(Math.abs((await after('-', '-')).distance / start.distance - 1) < 1e-6);
  assert.equal(await editor.model((it) => it.tool), 'grab');
  assert.equal(await editor.model((it) => it.draft), undefined);

  // In a field the keys belong to the field.
  await page.getByLabel('Move y').focus();
  const before = await page.evaluate(cameraNow);
  assert.deepEqual(await after('ArrowUp', '-'), before);
});
