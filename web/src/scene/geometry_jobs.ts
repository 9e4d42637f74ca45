/** Gives long work on a mesh to the worker, and its results back as promises. */
import type { MeshBVH } from '../vendor.js';
import type { BoundaryLine } from './boundary.js';
import type { VertexNumbers } from './curvature.js';
import type { StretchCells } from './stretch.js';

/** A mesh: `x, y, z` of each vertex, three vertices of each triangle. */
export interface PlainMesh {
  readonly positions: Float32Array<ArrayBuffer>;
  readonly triangles: Uint32Array<ArrayBuffer>;
}

/** A tree of bounding boxes in a form that a worker can send. */
export type SerializedTree = ReturnType<typeof MeshBVH.serialize>;

/** What can be asked of a mesh. */
type Job =
  { readonly job: 'boundary' | 'tree' | 'numbers' } | { readonly job: 'stretch'; readonly cells: StretchCells };
export type WorkerRequest = PlainMesh & { readonly id: number } & Job;
export type WorkerAnswer = { readonly id: number } & (
  | { readonly lines: BoundaryLine[] }
  | { readonly tree: SerializedTree }
  | { readonly numbers: VertexNumbers }
  | { readonly stretch: Float32Array<ArrayBuffer> }
  | { readonly error: string }
);

/** The worker, started at the first job. */
export class GeometryJobs {
  private worker: Worker | undefined;
  private readonly waiting = new Map<number, (answer: WorkerAnswer) => void>();
  private nextId = 0;

  /** The boundary loops of a mesh. Takes the mesh's arrays. */
  async boundary(mesh: PlainMesh): Promise<BoundaryLine[]> {
    const answer = await this.ask({ ...mesh, job: 'boundary' });
    return 'lines' in answer ? answer.lines : failed(answer);
  }

  /** A tree to pick a mesh's triangles by, which it puts into another order. Takes the mesh's arrays. */
  async tree(mesh: PlainMesh): Promise<SerializedTree> {
    const answer = await this.ask({ ...mesh, job: 'tree' });
    return 'tree' in answer ? answer.tree : failed(answer);
  }

  /** The curvature of a mesh. Takes the mesh's arrays. */
  async numbers(mesh: PlainMesh): Promise<VertexNumbers> {
    const answer = await this.ask({ ...mesh, job: 'numbers' });
    return 'numbers' in answer ? answer.numbers : failed(answer);
  }

  /** The stretch of the vertices of a mesh that lie near cells. Takes the mesh's arrays. */
  async stretch(mesh: PlainMesh, cells: StretchCells): Promise<Float32Array<ArrayBuffer>> {
    const answer = await this.ask({ ...mesh, job: 'stretch', cells });
    return 'stretch' in answer ? answer.stretch : failed(answer);
  }

  /** Stops the work that is under way. */
  stop(): void {
    this.worker?.terminate();
    this.worker = undefined;
    for (const [id, settle] of this.waiting) {
      settle({ id, error: 'stopped' });
    }
    this.waiting.clear();
  }

  private ask(request: PlainMesh & Job): Promise<WorkerAnswer> {
    this.worker ??= this.start();
    const id = this.nextId;
    this.nextId += 1;
    const answer = new Promise<WorkerAnswer>((resolve) => this.waiting.set(id, resolve));
    this.worker.postMessage({ ...request, id }, [request.positions.buffer, request.triangles.buffer]);
    return answer;
  }

  private start(): Worker {
    const worker = new Worker(workerAddress(), { type: 'module' });
    worker.onmessage = ({ data }: MessageEvent<WorkerAnswer>) => {
      this.waiting.get(data.id)?.(data);
      this.waiting.delete(data.id);
    };
    worker.onerror = () => this.stop();
    return worker;
  }
}

/** A page may start no worker from another origin, but one of its own may import from there. */
function workerAddress(): URL | string {
  const address = new URL('./worker.js', import.meta.url);
  if (address.origin === location.origin) {
    return address;
  }
  const source = `import ${JSON.stringify(address.href)};`;
  return URL.createObjectURL(new Blob([source], { type: 'text/javascript' }));
}

function failed(answer: WorkerAnswer): never {
  throw new Error('error' in answer ? answer.error : 'the worker answered something else');
}
