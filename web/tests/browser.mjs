// A darn and a browser for the tests, and what they do over and over.

import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdirSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';

/** Draws without a graphics card, and asks nobody else anything. */
const FLAGS = [
  '--no-sandbox',
  '--enable-unsafe-swiftshader',
  '--disable-quic',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-sync',
];

/** Where pictures are kept for a person to look at. */
const PICTURES = process.env.DARN_EDITOR_PICTURES ?? '';

export const repository = join(dirname(fileURLToPath(import.meta.url)), '../..');

/** Milliseconds that the machine, however busy, may take for anything. */
export const PATIENCE = 120_000;

/** Starts darn on a port that the system chooses; its address, and how to end it. */
export async function startService(settings = []) {
  if (process.env.DARN_URL) {
    return { url: process.env.DARN_URL, stop: () => {} };
  }
  const binary = process.env.DARN_BINARY ?? join(repository, 'target/release/darn');
  const child = spawn(binary, ['serve', '--listen', '127.0.0.1:0', '--log-format', 'json', ...settings]);
  child.stdout.resume();
  let log = '';
  const address = await new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error(`darn is not ready:\n${log}`)), PATIENCE);
    child.stderr.on('data', (data) => {
      log += data;
      if (/"ready"/.test(log)) {
        clearTimeout(timer);
        resolve(/127\.0\.0\.1:\d+/.exec(log)[0]);
      }
    });
    child.on('exit', (code) => reject(new Error(`darn ended with ${code}:\n${log}`)));
  });
  return { url: `http://${address}/`, stop: () => child.kill('SIGTERM') };
}

/** Times that a browser may crash before its first page. */
const CRASHES = 2;

export async function startBrowser() {
  const executablePath = process.env.DARN_CHROMIUM ?? '/usr/bin/chromium';
  for (let crashes = 0; ; crashes += 1) {
    try {
      return await chromium.launch({ executablePath, args: FLAGS });
    } catch (error) {
      // Chromium crashed once in some fifty launches here (SIGSEGV), which says nothing about the editor.
      if (crashes === CRASHES) throw error;
    }
  }
}

/** A page with the editor, and everything that must not happen on it. */
export async function openEditor(browser, service, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1200, height: 800 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  const faults = [];
  page.on('pageerror', (error) => faults.push(error.stack));
  page.on('console', (message) => {
    if (message.type() === 'error' && !/status of (4|5)\d\d/.test(message.text())) {
      faults.push(message.text());
    }
  });
  page.on('request', (request) => {
    if (!request.url().startsWith(service.url) && !/^(blob|data):/.test(request.url())) {
      faults.push(`a request to ${request.url()}`);
    }
  });
  await page.goto(service.url);
  return new EditorPage(context, page, faults);
}

/** The editor in a page. */
class EditorPage {
  constructor(context, page, faults) {
    this.context = context;
    this.page = page;
    this.faults = faults;
  }

  /** A value of the editor's model, by a function of it. */
  model(read) {
    return this.page.evaluate(`(${read})(document.querySelector('darn-editor').editor)`);
  }

  button(name) {
    return this.page.getByRole('button', { name, exact: true });
  }

  /** Presses keys on a control. */
  async press(role, name, ...keys) {
    await this.page.getByRole(role, { name, exact: true }).focus();
    for (const key of keys) {
      await this.page.keyboard.press(key);
    }
    await this.idle();
  }

  /** Waits until nothing is under way and the picture is drawn with all pixels. */
  async idle() {
    await this.still();
    await this.page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    await this.page.waitForTimeout(100);
    await this.still();
  }

  async still() {
    await this.page.waitForFunction(() => {
      const element = document.querySelector('darn-editor');
      const { viewer } = element.shadowRoot.querySelector('darn-stage');
      return element.editor.work === undefined && !element.editor.isAsking && (viewer?.isStill ?? true);
    });
  }

  async openExample() {
    await this.button('Try the example').click();
    await this.page.getByText('Holes (1)').waitFor();
    await this.idle();
  }

  async mend() {
    await this.button('Mend 1 hole').click();
    await this.page.getByText('✓ mended').waitFor();
    await this.idle();
  }

  /** A point of the window where new cloth is, right of and below the patch's middle by a share of the picture. */
  async onCloth(right = 0, down = 0) {
    const box = await this.page.locator('darn-stage').boundingBox();
    return { x: box.x + box.width * (0.53 + right), y: box.y + box.height * (0.54 + down) };
  }

  /** Drags by real pointer events, and waits for what comes of it. `held` runs before the pointer goes up. */
  async drag(from, by, { steps = 8, held = async () => {} } = {}) {
    const { mouse } = this.page;
    await mouse.move(from.x, from.y);
    await mouse.down();
    for (let step = 1; step <= steps; step += 1) {
      await mouse.move(from.x + (by.x * step) / steps, from.y + (by.y * step) / steps);
      await this.page.waitForTimeout(30);
    }
    await held();
    await mouse.up();
    await this.idle();
  }

  /** Chooses a tool by its key. */
  async tool(key) {
    await this.page.locator('darn-stage canvas').focus();
    await this.page.keyboard.press(key);
  }

  /** The picture of the scan as PNG bytes, without the words on it. */
  async picture() {
    const show = (visibility) =>
      this.page.evaluate((value) => {
        const said = document.querySelector('darn-editor').shadowRoot.querySelector('[role=status]');
        said.style.visibility = value;
      }, visibility);
    await show('hidden');
    const picture = await this.page.locator('darn-stage').screenshot();
    await show('');
    return picture;
  }

  /** The share of the picture's points whose colour differs from that of another picture. */
  async difference(before, after) {
    return this.page.evaluate(
      async ([first, second]) => {
        const points = async (base64) => {
          const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
          const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
          const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
          context.drawImage(image, 0, 0);
          return context.getImageData(0, 0, image.width, image.height).data;
        };
        const [a, b] = [await points(first), await points(second)];
        let differing = 0;
        for (let at = 0; at < a.length; at += 4) {
          differing += [0, 1, 2].some((channel) => Math.abs(a[at + channel] - b[at + channel]) > 24) ? 1 : 0;
        }
        return differing / (a.length / 4);
      },
      [before.toString('base64'), after.toString('base64')],
    );
  }

  /** Keeps a screenshot where DARN_EDITOR_PICTURES says. */
  async keep(name) {
    if (PICTURES !== '') {
      mkdirSync(PICTURES, { recursive: true });
      await this.page.screenshot({ path: join(PICTURES, `${name}.png`) });
    }
  }

  async close() {
    await this.context.close();
    assert.deepEqual(this.faults, []);
  }
}
