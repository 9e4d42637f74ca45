/** Reads scans as three.js shows them: plain ones, and those that are compressed by meshopt or Draco. */
import { documentOf } from '../model/gltf_document.js';
import { DRACOLoader, GLTFLoader, type Group, MeshoptDecoder } from '../vendor.js';

const DRACO = 'KHR_draco_mesh_compression';

/** The scene of a GLB, or of a glTF with data URIs. */
export async function loadScene(bytes: ArrayBuffer): Promise<Group> {
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  const { extensionsUsed = [] } = documentOf(bytes);
  if (!extensionsUsed.includes(DRACO)) {
    return (await loader.parseAsync(bytes, '')).scene;
  }
  // Large, and few scans need it.
  const { DECODER } = await import('../draco.js');
  const [js, wasm] = [DECODER.script, DECODER.wasm].map((part) => URL.createObjectURL(new Blob([part]))) as [
    string,
    string,
  ];
  const draco = new DRACOLoader().setDecoderPath({ js, wasm });
  try {
    return (await loader.setDRACOLoader(draco).parseAsync(bytes, '')).scene;
  } finally {
    draco.dispose();
    URL.revokeObjectURL(js);
    URL.revokeObjectURL(wasm);
  }
}
