/** Files that `build.mjs` puts into draco.js as they are. */
declare module 'three/examples/jsm/libs/draco/gltf/draco_wasm_wrapper.js' {
  const text: string;
  export default text;
}
declare module 'three/examples/jsm/libs/draco/gltf/draco_decoder.wasm' {
  const bytes: Uint8Array<ArrayBuffer>;
  export default bytes;
}
