// Writes the page that `darn serve` embeds: dist/index.html is served at `/`, dist/editor/* below `/editor/`.
//
//   node build.mjs            writes dist/
//   node build.mjs DIRECTORY  writes there instead, for a comparison of bytes
//
// The libraries go into a file of their own, vendor.js, so that a change of our own code leaves it as it is. The worker has what it needs itself:
// Lit does not run there.

import { cpSync, mkdirSync, rmSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const out = resolve(process.argv[2] ?? join(here, 'dist'));

/** Imports of vendor.js stay imports. */
const vendorApart = {
  name: 'vendor-apart',
  setup(bundle) {
    bundle.onResolve({ filter: /\/vendor\.js$/ }, () => ({ path: './vendor.js', external: true }));
  },
};

const shared = {
  absWorkingDir: here,
  bundle: true,
  format: 'esm',
  target: 'es2022',
  minify: true,
  charset: 'ascii',
  legalComments: 'eof',
  logLevel: 'warning',
};

rmSync(out, { recursive: true, force: true });
mkdirSync(join(out, 'editor'), { recursive: true });
await build({ ...shared, entryPoints: ['src/vendor.ts'], outfile: join(out, 'editor/vendor.js') });
await build({ ...shared, entryPoints: ['src/main.ts'], outfile: join(out, 'editor/main.js'), plugins: [vendorApart] });
await build({ ...shared, entryPoints: ['src/geometry_worker.ts'], outfile: join(out, 'editor/worker.js') });
cpSync(join(here, 'static/index.html'), join(out, 'index.html'));
for (const file of ['page.css', 'icon.svg']) {
  cpSync(join(here, 'static', file), join(out, 'editor', file));
}
