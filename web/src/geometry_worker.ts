/** Runs beside the page: what takes long on a large scan. Built into worker.js, with its own copy of what it needs of the libraries. */
import { BufferAttribute, BufferGeometry } from 'three';
import { MeshBVH } from 'three-mesh-bvh';
import { boundaryLines, weld } from './scene/boundary.js';
import { vertexNumbers } from './scene/curvature.js';
import type { WorkerAnswer, WorkerRequest } from './scene/geometry_jobs.js';
import { stretchAt } from './scene/stretch.js';

/** The part of a worker's own scope that is used here; the page's types have another `self`. */
interface WorkerScope {
  onmessage: ((event: MessageEvent<WorkerRequest>) => void) | null;
  postMessage(message: WorkerAnswer, transfer: Transferable[]): void;
}
const scope = self as unknown as WorkerScope;

scope.onmessage = ({ data }) => {
  const { id, positions, triangles } = data;
  try {
    if (data.job === 'boundary') {
      const lines = boundaryLines(positions, triangles);
      const buffers = lines.flatMap(({ points, angles }) => [points.buffer, angles.buffer]);
      scope.postMessage({ id, lines }, buffers as ArrayBuffer[]);
    } else if (data.job === 'numbers') {
      const numbers = vertexNumbers(positions, triangles, weld(positions));
      scope.postMessage({ id, numbers }, [numbers.curvature.buffer, numbers.shade.buffer]);
    } else if (data.job === 'stretch') {
      const stretch = stretchAt(positions, data.cells);
      scope.postMessage({ id, stretch }, [stretch.buffer]);
    } else {
      const geometry = new BufferGeometry();
      geometry.setAttribute('position', new BufferAttribute(positions, 3));
      geometry.setIndex(new BufferAttribute(triangles, 1));
      const tree = MeshBVH.serialize(new MeshBVH(geometry), { cloneBuffers: false });
      scope.postMessage({ id, tree }, [...tree.roots, (tree.index as Uint32Array<ArrayBuffer>).buffer]);
    }
  } catch (error) {
    scope.postMessage({ id, error: String(error) }, []);
  }
};
