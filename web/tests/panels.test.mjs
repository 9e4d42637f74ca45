// What the panels and keys of the editor do beside the tools, in a real browser with a real darn.

import assert from 'node:assert/strict';
import { editorTests } from './shared.mjs';

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
