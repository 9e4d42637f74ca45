// How many pixels are drawn, and when, in a real browser with a real darn.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { editorTests } from './shared.mjs';
import { load } from './sources.mjs';

const { Pace } = await load('scene/pace.ts');

const inEditor = editorTests();

test('slow frames are drawn in faster ways, quick ones in better ways again, and single ones change nothing', () => {
  const pace = new Pace(4);
  const frames = (count, time) => Array.from({ length: count }, () => pace.took(time));
  frames(100, 16);
  assert.equal(pace.way, 0, 'as fast as a screen shows them');
  for (let turn = 0; turn < 20; turn += 1) {
    frames(4, 16);
    frames(1, 500);
  }
  assert.equal(pace.way, 0, 'a busy moment');
  frames(10, 60);
  assert.ok(pace.way > 0);
  frames(100, 60);
  assert.equal(pace.way, 3, 'there is none beyond the last');
  frames(100, 14);
  assert.equal(pace.way, 3, 'twice as many pixels would be too slow');
  frames(100, 4);
  assert.equal(pace.way, 0);
});

/** Has every frame take so many milliseconds from now on, as far as the picture knows; notes how many pixels each has. */
function watchFrames(milliseconds) {
  const { screen } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage').viewer;
  globalThis.darnFrames = { widths: [], most: 0 };
  let inFlight = 0;
  const whenDrawn = Object.getPrototypeOf(screen).whenDrawn.bind(screen);
  screen.whenDrawn = (told) => {
    inFlight += 1;
    globalThis.darnFrames.widths.push(screen.canvas.width);
    globalThis.darnFrames.most = Math.max(globalThis.darnFrames.most, inFlight);
    whenDrawn(() => {
      inFlight -= 1;
      told(milliseconds);
    });
  };
}

/** What was noted of the frames since this was asked last. */
function framesSince() {
  const { widths } = globalThis.darnFrames;
  globalThis.darnFrames.widths = [];
  return widths;
}

inEditor('slow frames have fewer pixels while cloth or camera move, and all when they rest', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  const canvas = page.locator('darn-stage canvas');
  const { width, height } = await canvas.boundingBox();
  const rest = await editor.picture();
  await page.evaluate(watchFrames, 40);
  // Over a part without cloth, where the camera turns.
  const corner = { x: 30, y: (await canvas.boundingBox()).y + 30 };
  await editor.drag(corner, { x: 80, y: 0 }, { steps: 40 });
  const turning = await page.evaluate(framesSince);
  assert.ok(Math.min(...turning) < 0.6 * width, `${turning}`);
  assert.equal(turning.at(-1), width);
  await editor.drag({ x: corner.x + 80, y: corner.y }, { x: -80, y: 0 }, { steps: 40 });
  assert.ok((await editor.difference(rest, await editor.picture())) < 0.001, 'the picture at rest is as it was');

  await editor.tool('g');
  await page.evaluate(framesSince);
  await editor.drag(await editor.onCloth(), { x: 60, y: -30 }, { steps: 60 });
  const dragging = await page.evaluate(framesSince);
  assert.ok(Math.min(...dragging) < 0.8 * width, `${dragging}`);
  assert.equal(dragging.at(-1), width);
  const box = await canvas.boundingBox();
  assert.deepEqual([box.width, box.height], [width, height], 'its size on the page stays');
  assert.ok((await page.evaluate(() => globalThis.darnFrames.most)) <= 2, 'frames do not queue up');

  await page.evaluate(watchFrames, 1);
  for (let turn = 0; turn < 4; turn += 1) {
    await editor.drag(corner, { x: 40, y: 0 }, { steps: 20 });
  }
  await page.evaluate(framesSince);
  await editor.drag(corner, { x: 40, y: 0 }, { steps: 20 });
  const fast = await page.evaluate(framesSince);
  assert.ok(
    fast.every((it) => it === width),
    `${fast}`,
  );
});

inEditor('a still picture costs nothing', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  await page.evaluate(watchFrames, 1);
  await editor.model((it) => it.say('Nothing of the picture has changed.'));
  await editor.tool('t');
  await editor.tool('l');
  await editor.idle();
  assert.deepEqual(await page.evaluate(framesSince), []);
});

inEditor('what is drawn once looks as if it was drawn with every frame', async (editor, page) => {
  await editor.openExample();
  await editor.mend();
  await editor.tool('g');
  await editor.drag(
    await editor.onCloth(),
    { x: 40, y: -40 },
    {
      held: async () => {
        await page.waitForFunction(() => document.querySelector('darn-editor').editor.draftPatches !== undefined);
        await editor.idle();
        const [whole, layered] = await page.evaluate(() => {
          const { screen } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage').viewer;
          const png = () => screen.canvas.toDataURL().split(',')[1];
          screen.drawNow();
          const first = png();
          screen.stays.draw(screen.renderer, screen.camera);
          screen.stays.draw(screen.renderer, screen.camera);
          return [first, png()];
        });
        const difference = await editor.difference(Buffer.from(whole, 'base64'), Buffer.from(layered, 'base64'));
        assert.ok(difference < 0.002, `${difference}`);
      },
    },
  );
});
