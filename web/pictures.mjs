// Draws the pictures of the editor in docs/: node web/pictures.mjs, with DARN_BINARY or DARN_URL as for scripts/editor-test.

import { join } from 'node:path';
import { openEditor, repository, startBrowser, startService } from './tests/browser.mjs';

const [browser, service] = await Promise.all([startBrowser(), startService()]);
const editor = await openEditor(browser, service, { viewport: { width: 1000, height: 640 } });
const { page } = editor;

async function picture(name) {
  const path = join(repository, 'docs', `editor_${name}.jpg`);
  await page.mouse.move(5, 5);
  await page.screenshot({ path, type: 'jpeg', quality: 82 });
  console.log(path);
}

await editor.openExample();
await picture('open');
await editor.mend();
await page.getByRole('button', { name: /Show Hole 1/ }).click();
await page.getByLabel('Outlines').uncheck();
await page.getByRole('slider', { name: /Before and after/ }).fill('0.38');
await editor.idle();
await picture('compare');
await page.getByRole('heading', { name: 'Holes', exact: true }).scrollIntoViewIfNeeded();
await page.getByRole('slider', { name: /Before and after/ }).fill('0');
await editor.tool('g');
const from = await editor.onCloth();
await page.getByRole('heading', { name: 'Tools' }).scrollIntoViewIfNeeded();
await page.mouse.move(from.x, from.y);
await page.mouse.down();
await page.keyboard.down('Shift');
const answered = page.waitForResponse((answer) => answer.url().includes('/inpaint'));
await page.mouse.move(from.x + 10, from.y - 15);
await answered;
await page.mouse.move(from.x + 40, from.y - 60);
await page.waitForTimeout(3000);
const path = join(repository, 'docs', 'editor_grab.jpg');
await page.screenshot({ path, type: 'jpeg', quality: 82 });
console.log(path);
await page.keyboard.up('Shift');
await page.mouse.up();
await editor.idle();
await editor.tool('a');
await editor.drag(from, { x: -60, y: -40 });
await page.getByText(/The point belongs at u/).waitFor();
await editor.button('Draw the map').click();
await page.getByRole('status').getByText('The map is complete.').waitFor();
await page.getByRole('heading', { name: /Chart of hole/ }).evaluate((heading) => heading.scrollIntoView());
await picture('map');
await page.getByLabel('Outlines').check();
await page.getByRole('button', { name: /Show Hole 1/ }).click();
await page.keyboard.press('f');
await editor.tool('c');
await editor.drag(await editor.onCloth(0.03, 0.17), { x: 25, y: 0 });
await picture('cut');
await page.keyboard.press('Escape');
await page.getByRole('radio', { name: 'Curvature' }).check();
await page.getByRole('group', { name: 'Legend: Curvature' }).waitFor();
await editor.idle();
await picture('curvature');
await editor.close();
await browser.close();
service.stop();
