// Scans that are compressed, quantized or in several files, in a real browser with a real darn.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { repository } from './browser.mjs';
import { sheetInFiles } from './fixtures.mjs';
import { drop, editorTests } from './shared.mjs';

const inEditor = editorTests();

/** One sheet with a hole in every coding that the service reads; a test of the service writes the file. */
const CODINGS = JSON.parse(readFileSync(join(repository, 'web/tests/compressed.json'), 'utf8'));

/** Waits until a dropped scan with one hole is drawn, mends it, and looks whether both are seen. */
async function openAndMend(editor, page, empty) {
  await page.getByText('Holes (1)').waitFor();
  await editor.idle();
  const loaded = () => document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage').viewer.scan;
  await page.waitForFunction(loaded);
  await page.waitForTimeout(100);
  assert.deepEqual(await page.getByRole('alert').allTextContents(), []);
  const open = await editor.picture();
  assert.ok((await editor.difference(empty, open)) > 0.02, 'the scan is seen');
  await editor.mend();
  assert.ok((await editor.difference(open, await editor.picture())) > 0.005, 'the new cloth is seen');
  assert.deepEqual(await page.getByRole('alert').allTextContents(), []);
  return page.evaluate(() => {
    const { bounds } = document.querySelector('darn-editor').shadowRoot.querySelector('darn-stage').viewer.scan;
    return [...bounds.min, ...bounds.max];
  });
}

for (const [coding, base64] of Object.entries(CODINGS)) {
  inEditor(`a scan in the coding ${coding} is drawn and mended`, async (editor, page) => {
    let decoders = 0;
    page.on('request', (request) => (decoders += request.url().endsWith('/draco.js') ? 1 : 0));
    const empty = await editor.picture();
    await drop(page, 'sheet.glb', Buffer.from(base64, 'base64'));
    const bounds = await openAndMend(editor, page, empty);
    await editor.keep(`coding-${coding}`);
    // As the service reads it: the sheet is about one unit wide.
    const [width, , depth] = [0, 1, 2].map((axis) => bounds[3 + axis] - bounds[axis]);
    assert.ok(width > 0.5 && width < 2.5 && depth > 0, `${bounds}`);
    assert.equal(decoders, coding.startsWith('Draco') ? 1 : 0, 'the decoder is loaded only where it is needed');
  });
}

inEditor('a glTF is opened together with the file that it refers to', async (editor, page) => {
  const { gltf, bin } = sheetInFiles();
  const empty = await editor.picture();
  await drop(page, 'sheet.gltf', gltf);
  await page.getByRole('alert').waitFor();
  assert.match(await page.getByRole('alert').textContent(), /refers to the file sheet\.bin; drop both together/);
  await drop(page, 'sheet.bin', bin, [['sheet.gltf', gltf]]);
  await openAndMend(editor, page, empty);
});
