/** The service's requests that the editor makes, as functions of a typed client. */
import type {
  AnchorFound,
  AnchorLine,
  AnchorQuery,
  Constraints,
  HolesReport,
  Info,
  MapPiece,
  Report,
  Session,
} from './contract.js';
import { Jobs } from './jobs.js';
import { partsOf } from './multipart.js';
import { ProblemError } from './problem.js';
import { type Answer, type Progress, jsonOf, linesOf } from './requests.js';
import { type ServiceOptions, Transport, jsonBody } from './transport.js';

/** Patches as positions: `x, y, z` of every patch vertex, hole after hole, in order of id. */
export interface MendedPositions {
  readonly positions: Float32Array;
  readonly report: Report;
}

/** Patches as a GLB, and the report. */
export interface MendedPatches {
  readonly report: Report;
  readonly glb: ArrayBuffer;
}

/** What a map is told of as it is computed. */
export interface MapEvents {
  /** Where the point belongs; before the map. */
  onFound(found: AnchorFound): void;
  /** The next cells. */
  onMap(piece: MapPiece): void;
}

/** A client of the service at one address. */
export class Service {
  /** Scans that are mended later. */
  readonly jobs: Jobs;
  private readonly transport: Transport;

  /** @param base - The address below which the service's paths are. */
  constructor(
    readonly base: URL,
    options: ServiceOptions = {},
  ) {
    this.transport = new Transport(base, options);
    this.jobs = new Jobs(this.transport);
  }

  /** Version and limits. */
  async info(): Promise<Info> {
    return jsonOf(await this.transport.send('info', {}));
  }

  /** Every boundary loop of a scan. */
  async holes(scan: Blob, progress: Progress): Promise<HolesReport> {
    const form = new FormData();
    form.append('scan', scan, 'scan');
    return jsonOf(await this.transport.upload('holes', form, progress));
  }

  /** Opens a session on some holes of a scan. */
  async openSession(scan: Blob, constraints: Constraints, progress: Progress): Promise<Session> {
    const form = new FormData();
    form.append('scan', scan, 'scan');
    form.append('constraints', new Blob([JSON.stringify(constraints)], { type: 'application/json' }), 'constraints');
    return jsonOf(await this.transport.upload('sessions', form, progress));
  }

  /** The patches' positions under constraints, without a report: the fastest answer. */
  async positions(session: string, constraints: Constraints, progress: Progress): Promise<Float32Array> {
    const answer = await this.inpaint(session, constraints, 'application/octet-stream', progress);
    return new Float32Array(answer.body);
  }

  /** The patches as a drag shows them: the positions of all vertices, hole after hole in order of id, then their unit normals in the same order. */
  async draft(session: string, constraints: Constraints, progress: Progress): Promise<Float32Array> {
    const answer = await this.transport.send(`sessions/${session}/inpaint?draft=true`, jsonBody(constraints), progress);
    return new Float32Array(answer.body);
  }

  /** The patches' positions under constraints, and the report. */
  async mend(session: string, constraints: Constraints, progress: Progress): Promise<MendedPositions> {
    const accept = 'multipart/mixed, application/octet-stream;q=0.9';
    const parts = await this.inpaint(session, constraints, accept, progress);
    const { report, patches } = reportAndPatches(parts);
    return { report, positions: new Float32Array(patches.buffer) };
  }

  /** The patches as a GLB, with texture coordinates, normals and their own colours, and the report, which unlike others says where the colours come from. */
  async patches(session: string, constraints: Constraints, progress: Progress): Promise<MendedPatches> {
    const accept = 'multipart/mixed, model/gltf-binary;q=0.9';
    const { report, patches } = reportAndPatches(await this.inpaint(session, constraints, accept, progress));
    return { report, glb: patches.buffer };
  }

  /** Where on a hole's chart a point in space belongs. */
  async optimizeAnchor(session: string, query: AnchorQuery, progress: Progress): Promise<AnchorFound> {
    return jsonOf(await this.transport.send(`sessions/${session}/optimize-anchor`, jsonBody(query), progress));
  }

  /**
   * The same search, and the loss of every cell of the hole as it is computed. The service lets edits of the session go first; aborting the signal ends
   * the map.
   */
  async anchorMap(session: string, query: AnchorQuery, events: MapEvents, progress: Progress): Promise<void> {
    const request = jsonBody({ ...query, map: true });
    request.headers = { ...request.headers, accept: 'application/x-ndjson' };
    request.signal = progress.signal ?? null;
    const onLine = ({ found, map, problem }: AnchorLine): void => {
      if (problem !== undefined) {
        const { status = 500, code = '', detail = '', errors = [] } = problem;
        throw new ProblemError(status, code, detail, undefined, errors);
      }
      if (found !== undefined) {
        events.onFound(found);
      }
      if (map !== undefined) {
        events.onMap(map);
      }
    };
    await linesOf(await this.transport.openPatiently(`sessions/${session}/optimize-anchor`, request, progress), onLine);
  }

  /** The whole scan, mended as the session was asked last. */
  async result(session: string, progress: Progress): Promise<Blob> {
    const answer = await this.transport.send(`sessions/${session}/result`, {}, progress);
    return new Blob([answer.body], { type: answer.contentType });
  }

  /** Ends a session; nothing waits for it, and it may be gone already. */
  close(session: string): void {
    this.transport.forget(`sessions/${session}`, 'DELETE');
  }

  private inpaint(session: string, constraints: Constraints, accept: string, progress: Progress): Promise<Answer> {
    const request = jsonBody(constraints);
    request.headers = { ...request.headers, accept };
    return this.transport.send(`sessions/${session}/inpaint`, request, progress);
  }
}

function reportAndPatches(answer: Answer): { report: Report; patches: Uint8Array<ArrayBuffer> } {
  const parts = partsOf(answer.contentType, answer.body);
  const [report, patches] = [parts.get('report'), parts.get('patches')];
  if (report === undefined || patches === undefined) {
    throw new Error('the answer has no report or no patches');
  }
  return { report: JSON.parse(new TextDecoder().decode(report.body)) as Report, patches: patches.body };
}
