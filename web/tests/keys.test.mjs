// The editor in front of a darn that takes keys, in a real browser.

import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { PATIENCE, openEditor, startBrowser, startService } from './browser.mjs';

/** A darn that runs elsewhere takes keys of its own. */
const skip = process.env.DARN_URL !== undefined;

const random = Buffer.alloc(32, 7);
const SECRET = `darn_${random.toString('base64url')}`;
const sha256 = createHash('sha256').update(random).digest('hex');

let browser;
let service;
let folder;

before(async () => {
  if (skip) {
    return;
  }
  folder = mkdtempSync(join(tmpdir(), 'darn-keys-'));
  const file = join(folder, 'keys.json');
  writeFileSync(file, JSON.stringify({ keys: [{ id: 'person', sha256, scopes: ['mend'] }] }));
  [browser, service] = await Promise.all([startBrowser(), startService(['--keys', file])]);
});

after(async () => {
  await browser?.close();
  service?.stop();
  if (folder !== undefined) {
    rmSync(folder, { recursive: true });
  }
});

test(
  'a key is asked for once, kept in the tab, and never part of an address',
  { timeout: 3 * PATIENCE, skip },
  async () => {
    const editor = await openEditor(browser, service);
    const { page } = editor;
    const urls = [];
    page.on('request', (request) => urls.push(request.url()));
    const field = page.getByRole('textbox', { name: 'Key' });
    await field.waitFor();
    await editor.keep('key');
    await field.fill('darn_wrong');
    await page.keyboard.press('Enter');
    // Refused: it is asked for again.
    await page.waitForFunction(() => {
      const dialog = document.querySelector('darn-editor').shadowRoot.querySelector('darn-key').shadowRoot;
      return dialog.querySelector('dialog').open && dialog.querySelector('input').value === '';
    });
    await field.fill(SECRET);
    await editor.button('Use this key').click();
    await editor.openExample();
    await editor.mend();
    await page.reload();
    await editor.openExample();
    assert.equal(await field.isVisible(), false);
    assert.ok(urls.every((url) => !url.includes(SECRET)));
    await editor.close();
  },
);

test('who has no key goes on without and is told what is missing', { timeout: 3 * PATIENCE, skip }, async () => {
  const editor = await openEditor(browser, service);
  const { page } = editor;
  await editor.button('Go on without').click();
  await editor.button('Try the example').click();
  await editor.button('Go on without').click();
  await page.getByText('This service takes a key: send').waitFor();
  await editor.close();
});
