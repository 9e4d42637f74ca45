// Shows mended scans in Google's model-viewer, in a real browser, and switches their variants.
//
//   node viewer.mjs SCAN [SCAN ...]
//
// Exit 1 if one is not shown, if a variant of the file is not offered, if `Reconstruction blended` is drawn otherwise than no variant, or if another
// variant changes nothing. Exit 64 on wrong usage. DARN_CHROMIUM is the browser; pictures are kept in DARN_VIEWER_PICTURES.
import { mkdirSync, writeFileSync } from "node:fs";
import { readFile } from "node:fs/promises";
import { basename, join } from "node:path";
import { chromium } from "playwright-core";

const ORIGIN = "http://viewer.test";
const BLENDED = "Reconstruction blended";
const MARKED = "Reconstruction marked";
/** Milliseconds that a busy machine may take. */
const PATIENCE = 120_000;
/** Shares of the pixels: fewer are the noise of drawing, more are a patch that changed. */
const [SAME, CHANGED] = [0.0005, 0.005];

const PAGE = `<!doctype html>
<style>model-viewer { width: 480px; height: 480px; background: #fff }</style>
<script type="module" src="/model-viewer.js"></script>
<model-viewer src="/scan.glb" loading="eager" interaction-prompt="none" shadow-intensity="0">
  <div slot="progress-bar"></div>
</model-viewer>`;

/** Where the scan is seen from: the hole may be at its back. */
const ORBITS = ["0deg 75deg 105%", "180deg 75deg 105%"];

const program = new URL("node_modules/@google/model-viewer/dist/model-viewer.min.js", import.meta.url);
const folder = process.env.DARN_VIEWER_PICTURES ?? "";

function expect(condition, what) {
  if (!condition) throw new Error(what);
}

/** What the viewer draws from an orbit when it draws the same twice in a row. */
async function still(viewer, orbit) {
  await viewer.evaluate((it, place) => {
    it.cameraOrbit = place;
    it.jumpCameraToGoal();
  }, orbit);
  let last;
  for (;;) {
    const next = await viewer.screenshot();
    if (last?.equals(next)) return next;
    last = next;
    await new Promise((resolve) => setTimeout(resolve, 250));
  }
}

/** Pictures from all orbits. */
async function pictured(viewer) {
  const all = [];
  for (const orbit of ORBITS) all.push(await still(viewer, orbit));
  return all;
}

/** The share of the pixels of two PNGs that differ, by the page's own decoder. */
function changed(page, pictures) {
  const encoded = pictures.map((picture) => picture.toString("base64"));
  return page.evaluate(async (all) => {
    const [one, two] = await Promise.all(
      all.map(async (text) => {
        const picture = await createImageBitmap(await (await fetch(`data:image/png;base64,${text}`)).blob());
        const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
        context.drawImage(picture, 0, 0);
        return context.getImageData(0, 0, picture.width, picture.height).data;
      }),
    );
    let count = 0;
    for (let k = 0; k < one.length; k += 4) {
      count += [0, 1, 2].some((channel) => Math.abs(one[k + channel] - two[k + channel]) > 24);
    }
    return count / (one.length / 4);
  }, encoded);
}

/**
 * Shows a scan; the variants that are offered, and for each and for none its pictures and the
 * largest share of one that is not as without a variant.
 */
async function shown(browser, scan) {
  const page = await browser.newPage();
  page.setDefaultTimeout(PATIENCE);
  const faults = [];
  page.on("pageerror", (error) => faults.push(error.message));
  const files = {
    "/": [PAGE, "text/html"],
    "/model-viewer.js": [await readFile(program), "text/javascript"],
    "/scan.glb": [scan, "model/gltf-binary"],
  };
  // Nothing is asked of the network.
  await page.route(`${ORIGIN}/**`, (route) => {
    const file = files[new URL(route.request().url()).pathname];
    return file ? route.fulfill({ body: file[0], contentType: file[1] }) : route.abort();
  });
  await page.goto(`${ORIGIN}/`);
  await page.waitForFunction(() => document.querySelector("model-viewer").loaded === true);
  const viewer = page.locator("model-viewer");
  const choose = (name) =>
    viewer.evaluate((it, variant) => {
      const applied = new Promise((resolve) => it.addEventListener("variant-applied", resolve, { once: true }));
      it.variantName = variant;
      return applied;
    }, name);
  const names = await viewer.evaluate((it) => it.availableVariants);
  // After a choice model-viewer lights normal maps of triangles without tangents otherwise than before the first: none is compared that was not chosen.
  await choose(names[0]);
  await choose(null);
  const first = await pictured(viewer);
  const all = [];
  for (const name of [...names, null]) {
    await choose(name);
    const seen = await pictured(viewer);
    const shares = [];
    for (const [k, picture] of seen.entries()) shares.push(await changed(page, [first[k], picture]));
    all.push({ name, pictures: seen, share: Math.max(...shares) });
  }
  await page.close();
  expect(faults.length === 0, faults.join("; "));
  return { names, all };
}

const paths = process.argv.slice(2);
if (paths.length === 0) {
  console.error("usage: node viewer.mjs SCAN [SCAN ...]");
  process.exit(64);
}
const browser = await chromium.launch({
  executablePath: process.env.DARN_CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking"],
});
let failed = 0;
for (const path of paths) {
  try {
    const scan = await readFile(path);
    const json = JSON.parse(scan.subarray(20, 20 + scan.readUInt32LE(12)));
    const known = json.extensions.KHR_materials_variants.variants.map((it) => it.name);
    const { names, all } = await shown(browser, scan);
    expect(JSON.stringify(names) === JSON.stringify(known), `offers ${names}, the file has ${known}`);
    expect(names.includes(BLENDED) && names.includes(MARKED), `offers ${names}`);
    for (const { name, share, pictures } of all) {
      if (folder) {
        mkdirSync(folder, { recursive: true });
        pictures.forEach((picture, k) => writeFileSync(join(folder, `${basename(path, ".glb")}-${name ?? "default"}-${k}.png`), picture));
      }
      const isPlain = name === null || name === BLENDED;
      expect(isPlain ? share <= SAME : share >= CHANGED, `${name ?? "no variant"} changes ${(100 * share).toFixed(2)} % of the picture`);
    }
    const told = all.map(({ name, share }) => `${name ?? "none"} ${(100 * share).toFixed(1)} %`);
    console.log(`${path}: changed pixels: ${told.join(", ")}`);
  } catch (error) {
    failed += 1;
    console.error(`${path}: ${error.message}`);
  }
}
await browser.close();
process.exit(failed === 0 ? 0 : 1);
