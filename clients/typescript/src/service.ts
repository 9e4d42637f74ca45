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
import { partsOf } from './multipart.js';
import { ProblemError } from './problem.js';
import { type Answer, type Progress, jsonOf, send, sendForLines, upload } from './requests.js';

/** Patches as positions: `x, y, z` of every patch vertex, hole after hole, in order of id. */
export interface MendedPositions {
  readonly positions: Float32Array;
  readonly report: Report;
}

/** What a map is told of as it is computed. */
export interface MapEvents {
  /** Where the point belongs; before the map. */
  onFound(found: AnchorFound): void;
  /** The next cells. */
  onMap(piece: MapPiece): void;
}

/** What a service takes of its clients. */
export interface ServiceOptions {
  /** The key, where the service takes keys. */
  readonly key?: string | undefined;
  /**
   * Asked for a key when the service refuses the one that was sent, or that none was sent; the request is sent again with the answer. Requests
   * that are refused meanwhile wait for the same answer. `undefined`: there is none, and the request fails.
   */
  readonly askForKey?: (refusal: ProblemError) => Promise<string | undefined>;
}

/** A client of the service at one address. */
export class Service {
  private key: string | undefined;
  /** The key that is being asked for. */
  private asked: Promise<string | undefined> | undefined;

  /** @param base - The address below which the service's paths are. */
  constructor(
    readonly base: URL,
    private readonly options: ServiceOptions = {},
  ) {
    this.key = options.key;
  }

  /** Version and limits. */
  async info(): Promise<Info> {
    return jsonOf(await this.send('info', {}));
  }

  /** Every boundary loop of a scan. */
  async holes(scan: Blob, progress: Progress): Promise<HolesReport> {
    const form = new FormData();
    form.append('scan', scan, 'scan');
    return jsonOf(await this.upload('holes', form, progress));
  }

  /** Opens a session on some holes of a scan. */
  async openSession(scan: Blob, constraints: Constraints, progress: Progress): Promise<Session> {
    const form = new FormData();
    form.append('scan', scan, 'scan');
    form.append('constraints', new Blob([JSON.stringify(constraints)], { type: 'application/json' }), 'constraints');
    return jsonOf(await this.upload('sessions', form, progress));
  }

  /** The patches' positions under constraints, without a report: the fastest answer. */
  async positions(session: string, constraints: Constraints, progress: Progress): Promise<Float32Array> {
    const answer = await this.inpaint(session, constraints, 'application/octet-stream', progress);
    return new Float32Array(answer.body);
  }

  /** The patches as a drag shows them: the positions of all vertices, hole after hole in order of id, then their unit normals in the same order. */
  async draft(session: string, constraints: Constraints, progress: Progress): Promise<Float32Array> {
    const answer = await this.send(`sessions/${session}/inpaint?draft=true`, jsonBody(constraints), progress);
    return new Float32Array(answer.body);
  }

  /** The patches' positions under constraints, and the report. */
  async mend(session: string, constraints: Constraints, progress: Progress): Promise<MendedPositions> {
    const accept = 'multipart/mixed, application/octet-stream;q=0.9';
    const parts = await this.inpaint(session, constraints, accept, progress);
    const { report, patches } = reportAndPatches(parts);
    return { report, positions: new Float32Array(patches.buffer) };
  }

  /** The patches as a GLB, with texture coordinates, colours and normals. */
  async patches(session: string, constraints: Constraints, progress: Progress): Promise<ArrayBuffer> {
    return (await this.inpaint(session, constraints, 'model/gltf-binary', progress)).body;
  }

  /** Where on a hole's chart a point in space belongs. */
  async optimizeAnchor(session: string, query: AnchorQuery, progress: Progress): Promise<AnchorFound> {
    return jsonOf(await this.send(`sessions/${session}/optimize-anchor`, jsonBody(query), progress));
  }

  /**
   * The same search, and the loss of every cell of the hole as it is computed. The service lets edits of the session go first; aborting the signal ends
   * the map.
   */
  async anchorMap(session: string, query: AnchorQuery, events: MapEvents, progress: Progress): Promise<void> {
    const url = this.at(`sessions/${session}/optimize-anchor`);
    const request = jsonBody({ ...query, map: true });
    const onLine = ({ found, map, problem }: AnchorLine): void => {
      if (problem !== undefined) {
        throw new ProblemError(problem.status ?? 500, problem.code ?? '', problem.detail ?? '', undefined);
      }
      if (found !== undefined) {
        events.onFound(found);
      }
      if (map !== undefined) {
        events.onMap(map);
      }
    };
    await this.withKey((key) => {
      const headers = { ...request.headers, ...authorization(key), accept: 'application/x-ndjson' };
      return sendForLines(url, { ...request, headers }, onLine, progress);
    });
  }

  /** The whole scan, mended as the session was asked last. */
  async result(session: string, progress: Progress): Promise<Blob> {
    const answer = await this.send(`sessions/${session}/result`, {}, progress);
    return new Blob([answer.body], { type: answer.contentType });
  }

  /** Ends a session; nothing waits for it, and it may be gone already. */
  close(session: string): void {
    const request = { method: 'DELETE', keepalive: true, headers: authorization(this.key) };
    fetch(this.at(`sessions/${session}`), request).catch(() => undefined);
  }

  private inpaint(session: string, constraints: Constraints, accept: string, progress: Progress): Promise<Answer> {
    const request = jsonBody(constraints);
    request.headers = { ...request.headers, accept };
    return this.send(`sessions/${session}/inpaint`, request, progress);
  }

  private send(path: string, request: Request, progress: Progress = {}): Promise<Answer> {
    return this.withKey((key) => {
      const headers = { ...request.headers, ...authorization(key) };
      return send(this.at(path), { ...request, headers }, progress);
    });
  }

  private upload(path: string, body: FormData, progress: Progress): Promise<Answer> {
    return this.withKey((key) => upload({ url: this.at(path), headers: authorization(key), body }, progress));
  }

  /** Sends a request with the key, and again with another one as long as there is somebody who knows one. */
  private async withKey<T>(attempt: (key: string | undefined) => Promise<T>): Promise<T> {
    for (;;) {
      const sent = this.key;
      try {
        return await attempt(sent);
      } catch (error) {
        if (!(error instanceof ProblemError && error.keyIsRefused)) {
          throw error;
        }
        // Another request may have been given a key since this one was sent.
        if (this.key === sent) {
          const given = await this.ask(error);
          if (given === undefined) {
            throw error;
          }
          this.key = given;
        }
      }
    }
  }

  private ask(refusal: ProblemError): Promise<string | undefined> {
    this.asked ??= Promise.resolve(this.options.askForKey?.(refusal)).finally(() => (this.asked = undefined));
    return this.asked;
  }

  private at(path: string): URL {
    return new URL(path, this.base);
  }
}

/** A request by `fetch` whose headers can be added to. */
interface Request extends RequestInit {
  headers?: Record<string, string>;
}

/** The header of a key; nothing without one. It never goes into an address, which logs and histories keep. */
function authorization(key: string | undefined): Record<string, string> {
  return key === undefined ? {} : { authorization: `Bearer ${key}` };
}

function jsonBody(message: unknown): Request {
  return { method: 'POST', headers: { 'content-type': 'application/json' }, body: JSON.stringify(message) };
}

function reportAndPatches(answer: Answer): { report: Report; patches: Uint8Array<ArrayBuffer> } {
  const parts = partsOf(answer.contentType, answer.body);
  const [report, patches] = [parts.get('report'), parts.get('patches')];
  if (report === undefined || patches === undefined) {
    throw new Error('the answer has no report or no patches');
  }
  return { report: JSON.parse(new TextDecoder().decode(report.body)) as Report, patches: patches.body };
}
