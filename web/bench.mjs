// Measures the editor in a real browser with a built darn, and prints a table: how fast it answers a hand, what its first load costs, and what a frame of
// a large scan costs. `scripts/editor-bench` runs it; figures are in benches/README.md.

import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { cpus, loadavg, tmpdir } from 'node:os';
import { join } from 'node:path';
import { openEditor, startBrowser, startService } from './tests/browser.mjs';
import { sheetGlb } from './tests/fixtures.mjs';

/** Seconds that new cloth is dragged, and milliseconds between two moves of the pointer. */
const DRAG = { seconds: 10, pause: 8 };
/** Squares of a side of the large scan, two triangles each, and frames that are drawn of it. */
const LARGE = { side: 1000, frames: 10 };

const load = loadavg()[0];
const [browser, service] = await Promise.all([startBrowser(), startService()]);
try {
  const rows = [...(await firstLoad()), ...(await dragging()), ...(await frameCosts()), ...(await largeScan())];
  console.log(
    `${cpus()[0].model}, ${cpus().length} processors, load ${load.toFixed(2)} before, ${new Date().toISOString()}\n`,
  );
  console.log('| what | value |\n|---|---|');
  for (const [what, value] of rows) {
    console.log(`| ${what} | ${value} |`);
  }
} finally {
  await browser.close();
  service.stop();
}

/** What a browser without anything of the page loads, and when it paints first. */
async function firstLoad() {
  const context = await browser.newContext({ viewport: { width: 1200, height: 800 } });
  const page = await context.newPage();
  const network = await context.newCDPSession(page);
  await network.send('Network.enable');
  const bytes = new Map();
  network.on('Network.loadingFinished', ({ requestId, encodedDataLength }) => bytes.set(requestId, encodedDataLength));
  await page.goto(service.url, { waitUntil: 'networkidle' });
  const paint = await page.evaluate(
    () => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? Number.NaN,
  );
  await context.close();
  const sum = [...bytes.values()].reduce((total, size) => total + size, 0);
  return [
    ['first load, compressed, with headers', `${(sum / 1000).toFixed(0)} kB in ${bytes.size} requests`],
    ['first contentful paint on loopback', milliseconds(paint)],
  ];
}

/** Drags new cloth of the example by real pointer events. */
async function dragging() {
  const editor = await openEditor(browser, service);
  const { page } = editor;
  await editor.openExample();
  await editor.mend();
  await editor.tool('g');
  await page.evaluate(watchDrag);
  const from = await editor.onCloth();
  const place = (share) => [from.x + 60 * Math.sin(9 * share), from.y - 40 * Math.sin(13 * share)];
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  // The first answers wait for what every drag of a session needs once.
  for (let step = 0; step < 20; step += 1) {
    await page.mouse.move(...place(step / 200));
    await page.waitForTimeout(30);
  }
  await page.evaluate(() => globalThis.darnWatch.start());
  const start = performance.now();
  while (performance.now() - start < 1000 * DRAG.seconds) {
    const began = performance.now();
    await page.mouse.move(...place((began - start) / (1000 * DRAG.seconds)));
    await page.waitForTimeout(Math.max(0, DRAG.pause - (performance.now() - began)));
  }
  const { pictures, frames, requests, seconds } = await page.evaluate(() => globalThis.darnWatch.end());
  await page.mouse.up();
  await editor.idle();
  await editor.close();
  const server = requests.flatMap((request) => request.server);
  return [
    ['answers a second while dragging', (requests.length / seconds).toFixed(0)],
    ['an answer at the server (`Server-Timing`)', server.length === 0 ? 'not told' : spread(server)],
    ["an answer's way there and back", spread(requests.map(({ whole }) => whole))],
    ['from a move of the pointer to the picture of its cloth', spread(pictures)],
    ['frames a second while dragging', (frames.length / seconds).toFixed(0)],
    ["pixels of a frame's side, of those of the window", `${Math.min(...frames)} to ${Math.max(...frames)}`],
  ];
}

/** What a frame of the example costs: everything, and new cloth over what is drawn once. */
async function frameCosts() {
  const editor = await openEditor(browser, service);
  await editor.openExample();
  await editor.mend();
  const costs = await editor.page.evaluate(async () => {
    const { screen } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage').viewer;
    const gl = screen.renderer.getContext();
    const pixel = new Uint8Array(4);
    const ways = {
      everything: () => screen.drawNow(),
      'new cloth alone': () => screen.stays.draw(screen.renderer, screen.camera),
    };
    const all = [];
    for (const [name, draw] of Object.entries(ways)) {
      for (const share of [1, 0.7, 0.5, 0.35]) {
        screen.setShare(share);
        const times = [];
        for (let frame = 0; frame < 15; frame += 1) {
          await new Promise((done) => requestAnimationFrame(done));
          const start = performance.now();
          draw();
          gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
          times.push(performance.now() - start);
        }
        all.push([name, share, times]);
      }
    }
    return all;
  });
  await editor.close();
  return costs.map(([name, share, times]) => [`a frame of ${name}, ${share} of a side's pixels`, spread(times)]);
}

/** Runs in the page: notes when a pointer moved, and when the cloth of that move was drawn. */
function watchDrag() {
  const element = document.querySelector('darn-editor');
  const { editor } = element;
  const { viewer } = element.shadowRoot.querySelector('darn-stage');
  const sumOf = (timings) => (timings.length === 0 ? [] : [timings.reduce((sum, it) => sum + it.duration, 0)]);
  // Of a draft the move that made it, of an answer its draft's.
  const moves = new WeakMap();
  let [pictures, frames, began, lastMove, newest] = [[], [], 0, 0, undefined];
  addEventListener('pointermove', (event) => (lastMove = event.timeStamp), { capture: true });

  const preview = editor.preview.bind(editor);
  editor.preview = (draft) => {
    moves.set(draft, lastMove);
    preview(draft);
  };
  const ask = editor.session.preview.bind(editor.session);
  editor.session.preview = async (...request) => {
    const moved = moves.get(editor.draft);
    const patches = await ask(...request);
    moves.set(patches, moved);
    return patches;
  };
  const { screen } = viewer;
  const drawFrame = screen.drawFrame.bind(screen);
  screen.drawFrame = () => {
    drawFrame();
    frames.push(screen.renderer.getPixelRatio());
    const { draftPatches } = editor;
    if (draftPatches !== undefined && draftPatches !== newest && viewer.wanted === draftPatches) {
      newest = draftPatches;
      whenDrawn(() => pictures.push(performance.now() - moves.get(draftPatches)));
    }
  };
  /** Tells when the frame is drawn, within some milliseconds, without holding the page up. */
  const whenDrawn = (told) => {
    const gl = screen.renderer.getContext();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const look = () => (gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED ? setTimeout(look, 1) : told());
    setTimeout(look, 1);
  };
  performance.setResourceTimingBufferSize(100_000);
  globalThis.darnWatch = {
    start() {
      [pictures, frames, began] = [[], [], performance.now()];
    },
    end() {
      const drafts = performance.getEntriesByType('resource').filter((it) => it.name.includes('draft=true'));
      const requests = drafts
        .filter((it) => it.startTime >= began)
        .map(({ duration, serverTiming }) => ({ whole: duration, server: sumOf(serverTiming) }));
      return { pictures, frames, requests, seconds: (performance.now() - began) / 1000 };
    },
  };
}

/** Turns the camera about a scan of two million triangles. */
async function largeScan() {
  const { side, frames } = LARGE;
  const folder = mkdtempSync(join(tmpdir(), 'darn-bench-'));
  const file = join(folder, 'large.glb');
  const half = side / 2;
  writeFileSync(
    file,
    sheetGlb(side, (i, j) => Math.hypot(i - half, j - half) < 12.3),
  );
  const editor = await openEditor(browser, service);
  const { page } = editor;
  await page.locator('#file').setInputFiles(file);
  await page.getByText('Holes (1)').waitFor();
  await editor.idle();
  await page.waitForFunction(() => {
    const { viewer } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
    return viewer.scan?.meshes.every((mesh) => mesh.geometry.boundsTree !== undefined);
  });
  rmSync(folder, { recursive: true });
  const { times, calls, triangles } = await page.evaluate(async (count) => {
    const { viewer } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage');
    const { screen } = viewer;
    const all = [];
    const gl = screen.renderer.getContext();
    const pixel = new Uint8Array(4);
    for (let frame = 0; frame < count; frame += 1) {
      await new Promise((done) => requestAnimationFrame(done));
      const start = performance.now();
      viewer.controls.rotateLeft(0.02);
      screen.drawNow();
      all.push(performance.now() - start);
      // Frames that a processor draws take longer than their script: they must not pile up.
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    }
    const { render } = screen.renderer.info;
    return { times: all, calls: render.calls, triangles: render.triangles };
  }, frames);
  await editor.close();
  return [
    ['draw calls of a frame of the large scan', `${calls}, ${(triangles / 1e6).toFixed(2)} M triangles`],
    ['JavaScript of that frame', spread(times)],
  ];
}

/** Median and 95th percentile, in milliseconds. */
function spread(values) {
  const sorted = [...values].sort((a, b) => a - b);
  const at = (share) => sorted[Math.min(Math.floor(share * sorted.length), sorted.length - 1)];
  return `median ${milliseconds(at(0.5))}, 95 % ${milliseconds(at(0.95))} (${values.length})`;
}

function milliseconds(value) {
  return `${value.toFixed(1)} ms`;
}
