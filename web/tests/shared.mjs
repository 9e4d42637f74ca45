// What several tests of the editor do.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import axe from 'axe-core';
import { PATIENCE, openEditor, repository, startBrowser, startService } from './browser.mjs';

export const EXAMPLE = readFileSync(join(repository, 'examples/scarf_hole.glb'));
export const TEXTURED = readFileSync(join(repository, 'tests/textured.glb'));

/** Starts a darn and a browser for the tests of a file; gives what makes a test with a page of its own. */
export function editorTests() {
  let browser;
  let service;
  before(async () => {
    service = await startService();
    browser = await startBrowser();
  });
  after(async () => {
    await browser?.close();
    service?.stop();
  });
  return (name, body, options) =>
    test(name, { timeout: 3 * PATIENCE }, async () => {
      const editor = await openEditor(browser, service, options);
      await body(editor, editor.page, service);
      await editor.close();
    });
}

/** The constraints of the present step. */
export async function constraintsOf(editor) {
  return JSON.parse(await editor.model((it) => it.constraintsText()));
}

/** Axe's complaints. */
export async function complaints(page) {
  // Evaluated by the debugger, which the content security policy does not concern.
  await page.evaluate(axe.source);
  const { violations } = await page.evaluate('axe.run()');
  return violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(' ')}`);
}

/** What one `POST /inpaint` of the same constraints answers. */
export async function stateless(service, constraints, scan = EXAMPLE) {
  const form = new FormData();
  form.append('scan', new Blob([scan], { type: 'model/gltf-binary' }));
  form.append('constraints', new Blob([constraints], { type: 'application/json' }));
  const answer = await fetch(new URL('inpaint', service.url), { method: 'POST', body: form });
  assert.equal(answer.status, 200);
  return Buffer.from(await answer.arrayBuffer());
}

/** The file that "Save the scan" gives. */
export async function saved(editor, page) {
  const [download] = await Promise.all([page.waitForEvent('download'), editor.button('Save the scan').click()]);
  return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
}

/** Drops a file on the page, or several: then each is a name and bytes. */
export async function drop(page, name, bytes, others = []) {
  const transfer = await page.evaluateHandle(
    (files) => {
      const dropped = new DataTransfer();
      for (const [fileName, base64] of files) {
        const content = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
        dropped.items.add(new File([content], fileName));
      }
      return dropped;
    },
    [[name, bytes], ...others].map(([fileName, content]) => [fileName, content.toString('base64')]),
  );
  await page.dispatchEvent('darn-editor', 'drop', { dataTransfer: transfer });
}
