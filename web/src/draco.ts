/** three's own Draco decoder. Built into draco.js, which is loaded when a scan needs it; licence: licences/draco.txt. */
import wrapper from 'three/examples/jsm/libs/draco/gltf/draco_wasm_wrapper.js';
import wasm from 'three/examples/jsm/libs/draco/gltf/draco_decoder.wasm';

/** The two files of the decoder: the script of a worker, and the WebAssembly that it runs. */
export const DECODER: { readonly script: string; readonly wasm: Uint8Array<ArrayBuffer> } = { script: wrapper, wasm };
