// The editor in a real browser, with a real darn.

import assert from 'node:assert/strict';
import { sheetWithThreeHoles } from './fixtures.mjs';
import { EXAMPLE, complaints, drop, editorTests, saved, stateless } from './shared.mjs';

const inEditor = editorTests();

inEditor('the example is opened, mended, grabbed, undone, redone and saved', async (editor, page, service) => {
  await editor.openExample();
  await editor.keep('open');
  const renderer = await page.evaluate(() => {
    const stage = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
    return stage.viewer.rendererName;
  });
  assert.match(renderer, /\S/);
  console.log(`# drawn by ${renderer}`);
  const open = await editor.picture();
  await editor.mend();
  await editor.keep('mended');
  const mended = await editor.picture();
  assert.ok((await editor.difference(open, mended)) > 0.01, 'new cloth is seen');

  await editor.tool('g');
  const answered = page.waitForResponse((answer) => answer.url().includes('/inpaint'));
  await editor.drag(
    await editor.onCloth(),
    { x: 40, y: -40 },
    {
      held: async () => {
        await answered;
        await editor.idle();
        const held = await editor.picture();
        assert.ok((await editor.difference(mended, held)) > 0.002, 'the cloth follows while it is held');
        await editor.keep('grab');
      },
    },
  );
  const grabbed = await editor.picture();
  assert.ok((await editor.difference(mended, grabbed)) > 0.002, 'the cloth follows');
  const constraints = await editor.model((it) => it.constraintsText());
  const [edit] = JSON.parse(constraints).edits;
  assert.ok(edit.grab.uv.every((value) => value > 0.2 && value < 0.8));
  const file = await saved(editor, page);
  assert.equal(file.name, 'scarf_hole.mended.glb');
  assert.ok(file.bytes.equals(await stateless(service, constraints)), 'the bytes are those of POST /inpaint');

  await editor.button('Undo').click();
  await editor.idle();
  assert.ok((await editor.difference(mended, await editor.picture())) < 0.0005, 'undo shows what was before');
  const undone = await saved(editor, page);
  assert.ok(undone.bytes.equals(await stateless(service, '{"holes": [{"id": 1}]}')), 'undo is saved, too');
  await page.keyboard.press('Control+Shift+Z');
  await editor.idle();
  assert.equal(await editor.model((it) => it.constraintsText()), constraints);
});

inEditor('other fills are stepped through by keyboard, undone and saved', async (editor, page, service) => {
  const fills = page.getByRole('group', { name: 'Fills' });
  const next = editor.button('Next fill');
  // As they are drawn: on the example the fills lie closer together than a picture shows.
  const positions = () =>
    page.evaluate(() => {
      const stage = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
      return [...stage.viewer.patches[0].mesh.geometry.getAttribute('position').array];
    });
  await editor.openExample();
  assert.equal(await next.count(), 0, 'nothing is mended');
  await editor.mend();
  const first = await positions();
  await editor.press('button', 'Previous fill', 'Enter');
  assert.equal(await editor.model((it) => it.alternative), 0, 'there is none before the first');

  await editor.press('button', 'Next fill', 'Enter', 'Enter');
  await page.getByRole('status').getByText('Fill 3 of 8, beside the likeliest.').waitFor();
  await editor.idle();
  await fills.getByText('Fill 3 of 8').waitFor();
  await page.locator('darn-report').getByText('Fill 3 of 8, beside the likeliest.').waitFor();
  const third = await positions();
  assert.equal(third.length, first.length);
  assert.ok(
    third.some((value, at) => value !== first[at]),
    'the new cloth lies elsewhere',
  );
  await editor.keep('fill');
  assert.deepEqual(await complaints(page), []);
  const constraints = await editor.model((it) => it.constraintsText());
  assert.deepEqual(JSON.parse(constraints), { holes: [{ id: 1 }], alternative: 2 });
  const file = await saved(editor, page);
  assert.ok(file.bytes.equals(await stateless(service, constraints)), 'the bytes are those of POST /inpaint');

  while ((await editor.model((it) => it.step.label)) !== 'Mend 1 hole') {
    await editor.button('Undo').click();
    await editor.idle();
  }
  await fills.getByText('Fill 1 of 8').waitFor();
  assert.deepEqual(await positions(), first);
  const undone = await saved(editor, page);
  assert.ok(undone.bytes.equals(await stateless(service, '{"holes": [{"id": 1}]}')), 'undo is saved, too');

  await page.getByText('Constraints as JSON', { exact: true }).click();
  await page.getByRole('textbox', { name: 'Constraints as JSON' }).fill(constraints);
  await editor.button('Load').click();
  await editor.idle();
  await fills.getByText('Fill 3 of 8').waitFor();
  assert.deepEqual(await positions(), third);
});

inEditor('while dragging, one request is in flight', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  let [inFlight, most, sent] = [0, 0, 0];
  await page.route('**/inpaint*', async (route) => {
    inFlight += 1;
    sent += 1;
    most = Math.max(most, inFlight);
    await new Promise((resolve) => setTimeout(resolve, 50));
    inFlight -= 1;
    await route.continue();
  });
  await editor.tool('g');
  await editor.drag(await editor.onCloth(), { x: 60, y: 0 }, { steps: 30 });
  assert.equal(most, 1);
  assert.ok(sent > 1 && sent <= 31, `${sent} requests`);
  await page.unrouteAll({ behavior: 'wait' });
});

inEditor('twist, pinch and anchor are steps, and undo goes back to the start', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  await editor.tool('t');
  const middle = await editor.onCloth();
  await page.mouse.move(middle.x, middle.y);
  await page.mouse.wheel(0, -100);
  await editor.drag(middle, { x: 60, y: 0 });
  await editor.keep('twist');

  await editor.tool('p');
  for (const point of [await editor.onCloth(-0.02, -0.01), await editor.onCloth(0.02, 0.03)]) {
    await page.mouse.click(point.x, point.y);
  }
  await page.getByRole('slider', { name: /Share of their distance/ }).fill('0.7');
  await editor.button('Apply').click();
  await editor.idle();

  await editor.tool('a');
  await editor.drag(middle, { x: 20, y: -15 });
  await page.getByText(/The point belongs at u/).waitFor();
  await editor.button('Draw the map').click();
  await page.getByRole('status').getByText('The map is complete.').waitFor();
  await page.getByText(/The point belongs at u/).scrollIntoViewIfNeeded();
  const cells = await editor.model((it) => it.map.losses.filter((loss) => loss !== null).length);
  assert.ok(cells > 100);
  assert.equal(await page.locator('darn-chart rect').count(), cells);
  await editor.keep('map');

  const { edits, anchors } = JSON.parse(await editor.model((it) => it.constraintsText()));
  assert.ok(edits[0].twist.radius > 0.13 && Math.abs(edits[0].twist.angle + 0.942) < 0.01);
  assert.equal(edits[1].pinch.amount, 0.7);
  assert.equal(anchors.length, 1);
  assert.equal(anchors[0].uv.length, 2);
  for (let step = 0; step < 4; step += 1) {
    await editor.button('Undo').click();
  }
  assert.equal(await editor.model((it) => it.step.label), 'Open');
  assert.equal(await editor.button('Undo').isDisabled(), true);
});

inEditor('everything can be done by keyboard', async (editor, page) => {
  await editor.press('button', 'Try the example', 'Enter');
  await page.getByText('Holes (1)').waitFor();
  await editor.press('checkbox', 'Choose Hole 1', 'Space');
  assert.equal(await editor.button('Mend 0 holes').isDisabled(), true);
  await editor.press('checkbox', 'Choose Hole 1', 'Space');
  await editor.press('button', 'Mend 1 hole', 'Enter');
  await editor.press('button', 'Grab', 'Enter');
  await page.getByLabel('Move y').fill('0.03');
  await page.keyboard.press('Enter');
  await editor.idle();
  const { edits } = JSON.parse(await editor.model((it) => it.constraintsText()));
  assert.deepEqual(edits[0].grab.offset, [0, 0.03, 0]);
  assert.match(await page.getByRole('status').textContent(), /Grab: 1 filled/);
  await editor.press('button', 'Anchor', 'Enter');
  await page.getByLabel('Point y').fill('5');
  await page.getByLabel(/Hard/).focus();
  await page.keyboard.press('Space');
  await editor.press('button', 'Find its place', 'Enter');
  await page.getByRole('alert').waitFor();
  const refusal = await page.getByRole('alert').locator('p').textContent();
  assert.match(refusal, /^Anchor 1: the cloth stays .* can reach.*\nMove the point nearer .*$/);
  assert.equal(refusal.split('the cloth stays').length, 2, 'it is said once');
  assert.doesNotMatch(refusal, /\/anchors/);
  assert.equal(await page.getByLabel('Point y').inputValue(), '5', 'what was refused can be changed');
  assert.equal(await page.getByLabel(/Hard/).isChecked(), true);
});

inEditor(
  'a session that has ended is opened again, and the fill and the edits are there',
  async (editor, page, service) => {
    await editor.openExample();
    const opened = page.waitForResponse((answer) => answer.url().endsWith('/sessions') && answer.status() === 201);
    await editor.mend();
    const path = (await opened).headers().location;
    await editor.tool('g');
    await editor.drag(await editor.onCloth(), { x: 30, y: -20 });
    await editor.button('Next fill').click();
    await editor.idle();
    assert.equal((await fetch(new URL(path, service.url), { method: 'DELETE' })).status, 204);
    await editor.drag(await editor.onCloth(0.01, 0.02), { x: -20, y: 10 });
    const constraints = await editor.model((it) => it.constraintsText());
    const { edits, alternative } = JSON.parse(constraints);
    assert.deepEqual([edits.length, alternative], [2, 1]);
    assert.ok((await saved(editor, page)).bytes.equals(await stateless(service, constraints)));
  },
);

inEditor('a busy service is waited for as long as it says', async (editor, page) => {
  await editor.openExample();
  let refusals = 0;
  await page.route('**/sessions', (route) => {
    refusals += 1;
    if (refusals > 1) {
      return route.continue();
    }
    const problem = { status: 503, code: 'queue_full', detail: 'full' };
    return route.fulfill({ status: 503, headers: { 'retry-after': '1' }, json: problem });
  });
  await editor.button('Mend 1 hole').click();
  await page.locator('.notice').getByText('The service is busy; waiting 1 s').waitFor();
  const share = await page.locator('.notice progress').evaluate((it) => it.position);
  assert.equal(share, -1, 'nobody knows how long it takes: the bar moves to and fro');
  await page.getByText('✓ mended').waitFor();
  assert.equal(refusals, 2);
});

inEditor('the chosen holes are filled, one after another, with the edits kept', async (editor, page) => {
  await drop(page, 'sheet.glb', sheetWithThreeHoles());
  await page.getByText('Holes (3)').waitFor();
  await editor.idle();
  await editor.button('None').click();
  const boxes = page.getByRole('checkbox', { name: /Choose Hole/ });
  await boxes.nth(0).check();
  await editor.button('Mend 1 hole').click();
  await page.getByText('✓ mended').waitFor();
  await editor.idle();
  await editor.button('Grab').click();
  await page.getByLabel('Move y').fill('0.02');
  await page.keyboard.press('Enter');
  await editor.idle();
  await boxes.nth(2).click({ modifiers: ['Shift'] });
  await editor.button('Mend 3 holes').click();
  await editor.idle();
  assert.equal(await page.getByText('✓ mended').count(), 3);
  const { holes, edits } = JSON.parse(await editor.model((it) => it.constraintsText()));
  assert.equal(holes.length, 3);
  assert.equal(edits.length, 1);
  await editor.button('Undo').click();
  await editor.idle();
  assert.equal(await page.getByText('✓ mended').count(), 1);
});

inEditor(
  'a hole that cannot be filled is left open, with the reason, and the others are filled',
  async (editor, page) => {
    await drop(page, 'sheet.glb', sheetWithThreeHoles());
    await page.getByText('Holes (3)').waitFor();
    await editor.idle();
    const ids = await editor.model((it) => [...it.chosen]);
    const reason = 'its rim crosses itself';
    await page.route('**/sessions', async (route) => {
      // As if the service could not fill one.
      const body = route.request().postDataBuffer().toString('latin1');
      assert.ok(body.includes('\r\n\r\n{}\r\n'), 'no hole is named, so that the others are filled');
      const except = `\r\n\r\n{"except":[${ids[1]}]}\r\n`;
      const answer = await route.fetch({ postData: Buffer.from(body.replace('\r\n\r\n{}\r\n', except), 'latin1') });
      const skipped = { id: ids[1], kind: 'HOLE', code: 'rim_crosses_itself', reason };
      return route.fulfill({ response: answer, json: { ...(await answer.json()), skipped: [skipped] } });
    });
    await editor.button('Mend 3 holes').click();
    await editor.idle();
    assert.equal(await page.getByRole('alert').count(), 0);
    assert.equal(await page.getByText('✓ mended').count(), 2);
    await page.getByText(`Left open: ${reason}.`).waitFor();
  },
);

inEditor('an error says what is wrong, and the next drop clears it', async (editor, page) => {
  await drop(page, 'broken.glb', Buffer.from('not a scan'));
  await page.getByRole('alert').waitFor();
  assert.match(await page.getByRole('alert').textContent(), /glTF/i);
  await drop(page, 'scarf.glb', EXAMPLE);
  await page.getByText('Holes (1)').waitFor();
  assert.equal(await page.getByRole('alert').count(), 0);
  assert.equal(await editor.model((it) => it.scan.name), 'scarf.glb');
});

inEditor('a scan that is too large is not sent', async (editor, page) => {
  let sent = 0;
  page.on('request', (request) => (sent += request.method() === 'POST' ? 1 : 0));
  await page.evaluate(() => {
    const file = new Blob(['x']);
    Object.defineProperty(file, 'size', { value: 1e12 });
    return document.querySelector('darn-editor').editor.open(file, 'huge.glb');
  });
  assert.match(await page.getByRole('alert').textContent(), /at most 536870912/);
  assert.equal(sent, 0);
});

inEditor('B and the slider show the scan as it was', async (editor, page) => {
  await editor.openExample();
  const open = await editor.picture();
  await editor.mend();
  const mended = await editor.picture();
  await page.locator('darn-stage canvas').focus();
  const before = await editor.picture();
  await page.keyboard.down('b');
  await editor.idle();
  const held = await editor.picture();
  assert.ok((await editor.difference(before, held)) > 0.01);
  await page.keyboard.up('b');
  await page.getByRole('slider', { name: /Before and after/ }).fill('1');
  await editor.idle();
  assert.ok((await editor.difference(open, await editor.picture())) < 0.002);
  await page.getByRole('slider', { name: /Before and after/ }).fill('0');
  await editor.idle();
  assert.ok((await editor.difference(mended, await editor.picture())) < 0.002);
  await page.getByRole('slider', { name: /Before and after/ }).fill('0.5');
  await drop(page, 'scarf.glb', EXAMPLE);
  await page
    .getByRole('status')
    .getByText(/scarf\.glb is open/)
    .waitFor();
  assert.equal(await page.getByRole('slider', { name: /Before and after/ }).inputValue(), '0', 'of another scan all');
});

inEditor('the address of a scan in #scan= is opened', async (editor, page, service) => {
  await page.goto(`${service.url}#scan=${encodeURIComponent(`${service.url}editor/scarf_hole.glb`)}`);
  await page.getByText('Holes (1)').waitFor();
});

inEditor('a lost WebGL context comes back', async (editor, page) => {
  await editor.openExample();
  const shown = await editor.picture();
  await page.evaluate(async () => {
    const canvas = document
      .querySelector('darn-editor')
      .shadowRoot.querySelector('darn-stage')
      .shadowRoot.querySelector('canvas');
    const lose = canvas.getContext('webgl2').getExtension('WEBGL_lose_context');
    const restored = new Promise((done) => canvas.addEventListener('webglcontextrestored', done));
    lose.loseContext();
    await new Promise((done) => setTimeout(done, 200));
    lose.restoreContext();
    await restored;
  });
  await editor.idle();
  assert.ok((await editor.difference(shown, await editor.picture())) < 0.002);
});

for (const colorScheme of ['light', 'dark']) {
  inEditor(
    `axe finds nothing, ${colorScheme}`,
    async (editor, page) => {
      await editor.openExample();
      await editor.mend();
      await editor.tool('g');
      await editor.keep(`axe-${colorScheme}`);
      assert.deepEqual(await complaints(page), []);
    },
    { colorScheme },
  );
}

inEditor(
  'on a narrow touch screen, one finger on cloth is the tool',
  async (editor, page) => {
    await editor.openExample();
    await editor.mend();
    const width = await page.evaluate(() => document.documentElement.scrollWidth);
    assert.ok(width <= 400, `${width} px wide`);
    await page.getByRole('button', { name: 'Grab', exact: true }).tap();
    const { x, y } = await editor.onCloth();
    const session = await editor.context.newCDPSession(page);
    const touch = (type, points) => session.send('Input.dispatchTouchEvent', { type, touchPoints: points });
    await touch('touchStart', [{ x, y }]);
    for (let step = 1; step <= 5; step += 1) {
      await touch('touchMove', [{ x: x + 4 * step, y: y - 3 * step }]);
    }
    await touch('touchEnd', []);
    await editor.idle();
    assert.equal(JSON.parse(await editor.model((it) => it.constraintsText())).edits.length, 1);
    await editor.keep('narrow');

    // Two fingers, the first of which is on new cloth and has pulled it: the camera comes nearer, and nothing else happens.
    const distance = () =>
      page.evaluate(() => {
        const { viewer } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
        return viewer.camera.position.distanceTo(viewer.controls.target);
      });
    const constraints = await editor.model((it) => it.constraintsText());
    for (const tool of ['Grab', 'Cut out']) {
      await page.getByRole('button', { name: tool, exact: true }).tap();
      const from = tool === 'Grab' ? await editor.onCloth() : await editor.onCloth(0.03, 0.17);
      const before = await distance();
      const fingers = (spread) => [
        { x: from.x - 30 - spread, y: from.y, id: 0 },
        { x: from.x + 40 + spread, y: from.y + 20, id: 1 },
      ];
      await touch('touchStart', [{ x: from.x, y: from.y, id: 0 }]);
      // Far enough that the browser takes it for no tap.
      await touch('touchMove', fingers(0).slice(0, 1));
      await page.waitForFunction(() => document.querySelector('darn-editor').editor.draft !== undefined);
      await touch('touchStart', fingers(0));
      assert.equal(await editor.model((it) => it.draft), undefined, `${tool}: what was begun is taken back`);
      for (let step = 1; step <= 5; step += 1) {
        await touch('touchMove', fingers(6 * step));
      }
      await touch('touchEnd', []);
      await editor.idle();
      assert.ok((await distance()) < 0.8 * before, `${tool}: the camera comes nearer`);
      assert.equal(await editor.model((it) => it.constraintsText()), constraints);
      assert.equal(await editor.model((it) => it.draft), undefined);
      await page.evaluate(() =>
        document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage').viewer.frame(),
      );
      await editor.idle();
    }
  },
  { viewport: { width: 400, height: 800 }, hasTouch: true, isMobile: true },
);
