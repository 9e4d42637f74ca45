// Writes the page that `darn serve` embeds: dist/index.html is served at `/`, dist/editor/* below `/editor/`.
//
//   node build.mjs                    writes dist/
//   node build.mjs DIRECTORY          writes there instead, for a comparison of bytes
//   node build.mjs example DIRECTORY  writes the example of clients/typescript there
//
// The libraries go into a file of their own, vendor.js, so that a change of our own code leaves it as it is. The worker has what it needs itself:
// Lit does not run there. Draco's decoder is in draco.js, which is loaded when a scan needs it.

import { cpSync, mkdirSync, readFileSync, rmSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const isExample = process.argv[2] === 'example';
const out = resolve(process.argv[isExample ? 3 : 2] ?? join(here, 'dist'));

/** Imports of a file of the bundle stay imports. */
const apart = (name) => ({
  name: `${name}-apart`,
  setup(bundle) {
    bundle.onResolve({ filter: new RegExp(`/${name}\\.js$`) }, () => ({ path: `./${name}.js`, external: true }));
  },
});

/** A script that is handed on as it is, not run here. */
const asText = (file) => ({
  name: 'as-text',
  setup(bundle) {
    bundle.onLoad({ filter: file }, ({ path }) => ({ contents: readFileSync(path, 'utf8'), loader: 'text' }));
  },
});

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

if (isExample) {
  const example = join(here, '../clients/typescript/example');
  mkdirSync(out, { recursive: true });
  const nodePaths = [join(here, 'node_modules')];
  await build({ ...shared, nodePaths, entryPoints: [join(example, 'example.ts')], outfile: join(out, 'example.js') });
  cpSync(join(example, 'index.html'), join(out, 'index.html'));
} else {
  rmSync(out, { recursive: true, force: true });
  mkdirSync(join(out, 'editor'), { recursive: true });
  await build({ ...shared, entryPoints: ['src/vendor.ts'], outfile: join(out, 'editor/vendor.js') });
  await build({
    ...shared,
    entryPoints: ['src/main.ts'],
    outfile: join(out, 'editor/main.js'),
    plugins: [apart('vendor'), apart('draco')],
  });
  await build({
    ...shared,
    entryPoints: ['src/draco.ts'],
    outfile: join(out, 'editor/draco.js'),
    loader: { '.wasm': 'binary' },
    plugins: [asText(/draco_wasm_wrapper\.js$/)],
    banner: { js: `/*! ${readFileSync(join(here, 'licences/draco.txt'), 'utf8').trim()} */` },
  });
  await build({
    ...shared,
    entryPoints: ['src/page.ts'],
    outfile: join(out, 'editor/page.js'),
    plugins: [apart('main')],
  });
  await build({ ...shared, entryPoints: ['src/geometry_worker.ts'], outfile: join(out, 'editor/worker.js') });
  cpSync(join(here, 'static/index.html'), join(out, 'index.html'));
  for (const file of ['page.css', 'icon.svg']) {
    cpSync(join(here, 'static', file), join(out, 'editor', file));
  }
}
