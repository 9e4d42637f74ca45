// Loads patched scans as programs do: by glTF Transform and by three.js, in every material variant; compressed ones with the reference decoders.
//
//   node load.mjs SCAN [SCAN ...]
//
// glTF Transform 4.5 reads EXT_meshopt_compression, but not KHR_meshopt_compression; scans that require that one are loaded by three.js alone.
// Exit 1 if one cannot be loaded, if a variant chooses a material that cannot be made, if a patch's material has a texture whose texture coordinates
// are not there, or if it has a normal map and the patch has no tangents. Exit 64 on wrong usage.
import { readFile } from "node:fs/promises";
import { NodeIO } from "@gltf-transform/core";
import { ALL_EXTENSIONS } from "@gltf-transform/extensions";
import draco3d from "draco3d";
import { MeshoptDecoder } from "meshoptimizer/decoder";
import { MeshoptDecoder as ThreeMeshoptDecoder } from "three/examples/jsm/libs/meshopt_decoder.module.js";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { nodeDracoLoader } from "./draco_loader.mjs";

const VARIANTS = "KHR_materials_variants";
const UNKNOWN_TO_TRANSFORM = "KHR_meshopt_compression";

// What three.js wants of a browser: its images are not looked at here.
globalThis.self = globalThis;
globalThis.createImageBitmap = async (blob) => {
  if (blob.size === 0) throw new Error("an image without bytes");
  return { width: 1, height: 1, close() {} };
};

function expect(condition, what) {
  if (!condition) throw new Error(what);
}

const transform = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({
  "draco3d.decoder": await draco3d.createDecoderModule(),
  "meshopt.decoder": MeshoptDecoder,
});
const dracoLoader = nodeDracoLoader();

/** Counts the patches that glTF Transform finds, and looks at their attributes. */
async function byTransform(path) {
  const document = await transform.read(path);
  let patches = 0;
  for (const mesh of document.getRoot().listMeshes()) {
    for (const primitive of mesh.listPrimitives()) {
      if (!primitive.getExtras().darn?.reconstructed) continue;
      patches += 1;
      const mapped = primitive.getExtension(VARIANTS)?.listMappings() ?? [];
      const materials = [primitive.getMaterial(), ...mapped.map((it) => it.getMaterial())];
      for (const material of materials) {
        const infos = [material.getBaseColorTextureInfo(), material.getNormalTextureInfo(), material.getEmissiveTextureInfo()];
        for (const info of infos.filter((it) => it)) {
          const set = `TEXCOORD_${info.getTexCoord()}`;
          expect(primitive.getAttribute(set), `${material.getName()} reads ${set}, which is not there`);
        }
        const isMapped = material.getNormalTexture() !== null;
        expect(!isMapped || primitive.getAttribute("TANGENT"), `${material.getName()} has a normal map, the patch no tangents`);
      }
    }
  }
  return patches;
}

/** Loads the scan with three.js, makes every material that a variant chooses, and looks for the tangents of patches with normal maps. */
async function byThree(path) {
  const bytes = await readFile(path);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  const loader = new GLTFLoader().setMeshoptDecoder(ThreeMeshoptDecoder).setDRACOLoader(dracoLoader);
  const gltf = await loader.parseAsync(buffer, "");
  const names = (gltf.parser.json.extensions?.[VARIANTS]?.variants ?? []).map((it) => it.name);
  let switched = 0;
  let tangents = 0;
  const meshes = [];
  gltf.scene.traverse((object) => object.isMesh && meshes.push(object));
  let patches = 0;
  for (const mesh of meshes) {
    const isPatch = mesh.geometry.userData.darn?.reconstructed === true;
    const { tangent, position } = mesh.geometry.attributes;
    const inside = mesh.geometry.index.array.every((vertex) => vertex < position.count);
    expect(inside, `${mesh.name} has a triangle past its vertices`);
    if (isPatch) patches += 1;
    const made = [mesh.material];
    for (const { material, variants } of mesh.userData.gltfExtensions?.[VARIANTS]?.mappings ?? []) {
      const own = await gltf.parser.getDependency("material", material);
      expect(own?.isMaterial, `material ${material} cannot be made`);
      if (own.map) expect(own.map.image, `material ${material} has a texture without an image`);
      made.push(own);
      expect(variants.every((it) => it < names.length), `variant ${variants} is not there`);
      switched += variants.length;
    }
    if (isPatch && made.some((it) => it.normalMap)) {
      expect(tangent?.itemSize === 4 && tangent.count === position.count, `${mesh.name}: a patch with a normal map has no tangents`);
      tangents += 1;
    }
  }
  return { meshes: meshes.length, switched, patches, tangents, required: gltf.parser.json.extensionsRequired ?? [] };
}

const paths = process.argv.slice(2);
if (paths.length === 0) {
  console.error("usage: node load.mjs SCAN [SCAN ...]");
  process.exit(64);
}
let failed = 0;
for (const path of paths) {
  try {
    const { meshes, switched, patches, tangents, required } = await byThree(path);
    expect(patches > 0 && switched > 0, "no patch, or no variant of it");
    if (!required.includes(UNKNOWN_TO_TRANSFORM)) {
      const found = await byTransform(path);
      expect(found === patches, `glTF Transform finds ${found} patches, three.js ${patches}`);
    }
    console.log(`${path}: ${meshes} meshes, ${patches} patches, ${tangents} with tangents, ${switched} choices of variants`);
  } catch (error) {
    failed += 1;
    // Workers of three.js reject with their message.
    console.error(`${path}: ${error.message ?? error.error}`);
  }
}
dracoLoader.dispose();
process.exit(failed === 0 ? 0 : 1);
