// The pieces in pages of another origin: the custom element, and the client with plain three.js.

import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { after, before, test } from 'node:test';
import { PATIENCE, repository, startBrowser, startService } from './browser.mjs';

const EXAMPLE = join(repository, 'examples/scarf_hole.glb');

let browser;
let service;
let pages;

/** A server of a few files on a port of its own: another origin than darn's. */
async function serve(files) {
  const types = { '.html': 'text/html', '.js': 'text/javascript', '.glb': 'model/gltf-binary' };
  const server = createServer((request, response) => {
    const body = files.get(new URL(request.url, 'http://any').pathname);
    const type = types[extname(request.url.split('?')[0])] ?? 'text/html';
    // Browsers ask for an icon that nobody named.
    const missing = request.url === '/favicon.ico' ? 204 : 404;
    response.writeHead(body === undefined ? missing : 200, { 'content-type': type });
    response.end(body);
  });
  await new Promise((listening) => server.listen(0, '127.0.0.1', listening));
  return { server, origin: `http://127.0.0.1:${server.address().port}` };
}

before(async () => {
  const files = new Map();
  const built = mkdtempSync(join(tmpdir(), 'darn-example-'));
  execFileSync('node', [join(repository, 'web/build.mjs'), 'example', built]);
  files.set('/example.js', readFileSync(join(built, 'example.js')));
  files.set('/example.html', readFileSync(join(built, 'index.html')));
  rmSync(built, { recursive: true });
  files.set('/scan.glb', readFileSync(EXAMPLE));
  pages = await serve(files);
  [browser, service] = await Promise.all([startBrowser(), startService(['--allow-origin', pages.origin])]);
  files.set(
    '/stranger.html',
    `<!doctype html><script type="module" src="${service.url}editor/main.js"></script>
     <label>Name <input id="name"></label>
     <darn-editor src="scan.glb" style="display: block; height: 600px"></darn-editor>`,
  );
});

after(async () => {
  await browser?.close();
  service?.stop();
  pages?.server.close();
});

/** A page of the other origin, and what went wrong on it. */
async function open(path) {
  const page = await browser.newPage();
  page.setDefaultTimeout(PATIENCE);
  const faults = [];
  page.on('pageerror', (error) => faults.push(error.stack));
  page.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
  await page.goto(pages.origin + path);
  return { page, faults };
}

test("the custom element works in a stranger's page and tells what happens", { timeout: 3 * PATIENCE }, async () => {
  const { page, faults } = await open('/stranger.html');
  await page.evaluate(() => {
    window.heard = [];
    for (const name of ['opened', 'mended', 'edited', 'saved']) {
      document.addEventListener(name, (event) => {
        event.preventDefault();
        window.heard.push({ name, detail: event.detail, size: event.detail.file?.size });
      });
    }
  });
  await page.getByText('Holes (1)').waitFor();
  await page.getByRole('button', { name: 'Mend 1 hole' }).click();
  await page.getByText('✓ mended').waitFor();
  // What is typed elsewhere in the page is no key of the editor.
  await page.locator('#name').fill('');
  await page.locator('#name').press('g');
  assert.equal(await page.evaluate(() => document.querySelector('darn-editor').editor.tool), 'look');
  await page.getByRole('button', { name: 'Save the scan' }).click();
  await page.waitForFunction(() => window.heard.some(({ name }) => name === 'saved'));
  const heard = await page.evaluate(() => window.heard);
  assert.ok(heard.find(({ name }) => name === 'mended').detail.report.holes.length === 1);
  assert.ok(heard.find(({ name }) => name === 'saved').size > readFileSync(EXAMPLE).length);
  // The tree that picking uses comes from a worker, which another origin may not start directly.
  assert.equal(await page.evaluate(() => document.querySelector('darn-editor').editor.problem), undefined);
  assert.deepEqual(faults, []);
  await page.close();
});

test('the example with plain three.js mends and pulls', { timeout: 3 * PATIENCE }, async () => {
  const { page, faults } = await open(`/example.html?service=${encodeURIComponent(service.url)}`);
  await page.locator('#scan').setInputFiles(EXAMPLE);
  await page.getByText('1 filled').waitFor();
  const picture = () => page.locator('canvas').screenshot();
  const first = await picture();
  const answers = [];
  page.on('response', (response) => response.url().includes('/inpaint') && answers.push(response.status()));
  for (const value of ['0.2', '0.5', '0.9']) {
    await page.locator('#pull').fill(value);
  }
  while (answers.length === 0 || first.equals(await picture())) {
    await page.waitForTimeout(50);
  }
  assert.ok(answers.every((status) => status === 200));
  assert.deepEqual(faults, []);
  await page.close();
});
