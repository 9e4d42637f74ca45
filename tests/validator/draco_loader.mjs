// three.js's DRACOLoader in Node: its decoder's files come from the package, and its worker runs in this thread.
import { resolveObjectURL } from "node:buffer";
import { readFile } from "node:fs/promises";
import { DRACOLoader } from "three/examples/jsm/loaders/DRACOLoader.js";

/** A Worker that runs its script here, without what would tell it that this is Node. */
class WorkerHere {
  constructor(url) {
    this.begun = this.begin(url);
  }

  async begin(url) {
    const script = await resolveObjectURL(url).text();
    const self = Object.assign(Object.create(globalThis), {
      postMessage: (data) => queueMicrotask(() => this.onmessage({ data })),
    });
    const begin = new Function("self", "process", `let onmessage;\n${script}\nreturn (event) => onmessage(event);`);
    return begin(self, undefined);
  }

  postMessage(data) {
    this.begun.then((answer) => answer({ data }));
  }

  terminate() {}
}

class NodeDracoLoader extends DRACOLoader {
  async _loadLibrary(url, responseType) {
    const bytes = await readFile(new URL(url));
    return responseType === "text" ? bytes.toString() : bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  }
}

/** A DRACOLoader for GLTFLoader. */
export function nodeDracoLoader() {
  globalThis.Worker = WorkerHere;
  return new NodeDracoLoader();
}
