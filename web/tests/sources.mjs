// Our TypeScript modules in Node, for tests of what needs no browser.

import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const src = join(dirname(fileURLToPath(import.meta.url)), '../src');

/** The module at a path below src/. */
export async function load(path) {
  const { outputFiles } = await build({
    entryPoints: [join(src, path)],
    bundle: true,
    format: 'esm',
    platform: 'neutral',
    write: false,
  });
  return import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString('base64')}`);
}
