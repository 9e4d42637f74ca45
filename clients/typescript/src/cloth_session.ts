/** A scan's session at the service: the holes that it fills, dragged and mended by constraints. */
import type { AnchorFound, AnchorQuery, Constraints, Report, Session, SessionHole, Skipped } from './contract.js';
import { Latest } from './latest.js';
import { ProblemError } from './problem.js';
import type { Progress } from './requests.js';
import type { MendedPatches, MapEvents, Service } from './service.js';

/** The new cloth of a hole at one moment. */
export interface HolePositions {
  /** What stays the same whatever the constraints: triangles, uvs, rim. */
  readonly hole: SessionHole;
  /** `x, y, z` of every patch vertex, scene units; the rim's come first. */
  readonly positions: Float32Array;
  /** Unit normals of the vertices in the same order, those at the rim as the scan's; only while it is dragged. */
  readonly normals?: Float32Array;
}

/** What a drag is told. */
export interface DragEvents {
  /** The cloth as it was asked for last, or a moment before. */
  onPatches(patches: HolePositions[]): void;
  onError(error: unknown): void;
}

/**
 * A session. The scan is kept here, so that a session that the service has ended (410) is opened again without asking anybody. Every
 * request carries all constraints, so nothing else has to be restored.
 */
export class ClothSession {
  private readonly live = new Latest();
  /** The constraints that the service met last, as JSON. */
  private met: string | undefined;

  private constructor(
    private readonly service: Service,
    private readonly scan: Blob,
    private readonly selection: Constraints,
    private opened: Session,
  ) {}

  /** Opens a session on the holes of a scan that `selection` chooses: all holes when it is empty. */
  static async open(
    service: Service,
    scan: Blob,
    selection: Constraints = {},
    progress: Progress = {},
  ): Promise<ClothSession> {
    return new ClothSession(service, scan, selection, await service.openSession(scan, selection, progress));
  }

  /** The holes that are filled, in order of id. */
  get holes(): readonly SessionHole[] {
    return this.opened.holes ?? [];
  }

  /** The loops that are left as they are, with why. */
  get skipped(): readonly Skipped[] {
    return this.opened.skipped ?? [];
  }

  /** The middle of every triangle that was cut out, `x, y, z` of each. */
  get cutFaces(): readonly number[] {
    return this.opened.cutFaces ?? [];
  }

  /**
   * Shows the cloth under constraints while a hand drags. One request is in flight; of those that come meanwhile the newest waits, so that
   * every answer is used.
   */
  drag(constraints: Constraints, { onPatches, onError }: DragEvents): void {
    this.live.offer(async () => {
      try {
        onPatches(await this.draft(constraints));
      } catch (error) {
        onError(error);
      }
    });
  }

  /** Ends a drag: what waits is forgotten, and the cloth is mended under its last constraints, with a report. */
  async release(
    constraints: Constraints,
    progress: Progress = {},
  ): Promise<{ patches: HolePositions[]; report: Report }> {
    await this.live.settled();
    return this.mend(constraints, progress);
  }

  /** The new cloth under constraints while it is dragged, as fast as the service can; `result` takes no note of it. */
  draft(constraints: Constraints, progress: Progress = {}): Promise<HolePositions[]> {
    return this.within(progress, async (id) => {
      const both = await this.service.draft(id, constraints, progress);
      const half = both.length / 2;
      const normals = this.byHole(both.subarray(half));
      return this.byHole(both.subarray(0, half)).map((patch, at) => ({
        ...patch,
        normals: (normals[at] as HolePositions).positions,
      }));
    });
  }

  /** The new cloth under constraints, without a report. */
  positions(constraints: Constraints, progress: Progress = {}): Promise<HolePositions[]> {
    return this.within(progress, async (id) => {
      const positions = await this.meeting(constraints, () => this.service.positions(id, constraints, progress));
      return this.byHole(positions);
    });
  }

  /** The new cloth under constraints, and the report. */
  mend(constraints: Constraints, progress: Progress = {}): Promise<{ patches: HolePositions[]; report: Report }> {
    return this.within(progress, async (id) => {
      const { positions, report } = await this.meeting(constraints, () => this.service.mend(id, constraints, progress));
      return { patches: this.byHole(positions), report };
    });
  }

  /**
   * The new cloth as a GLB, one mesh a hole, with texture coordinates, normals and its own colours, and the report, which unlike others says
   * where the colours of each hole come from.
   */
  patches(constraints: Constraints, progress: Progress = {}): Promise<MendedPatches> {
    return this.within(progress, (id) =>
      this.meeting(constraints, () => this.service.patches(id, constraints, progress)),
    );
  }

  /** Where on a hole's chart a point in space belongs. */
  optimizeAnchor(query: AnchorQuery, progress: Progress = {}): Promise<AnchorFound> {
    return this.within(progress, (id) => this.service.optimizeAnchor(id, query, progress));
  }

  /** The same, and the loss of every cell as it is computed, until the signal is aborted. A drag goes first. */
  anchorMap(query: AnchorQuery, events: MapEvents, progress: Progress = {}): Promise<void> {
    return this.within(progress, (id) => this.service.anchorMap(id, query, events, progress));
  }

  /** The whole scan under constraints. */
  result(constraints: Constraints, progress: Progress = {}): Promise<Blob> {
    return this.within(progress, async (id) => {
      await this.meet(id, constraints, progress);
      return this.service.result(id, progress);
    });
  }

  /** Ends the session. */
  close(): void {
    this.service.close(this.id);
  }

  private get id(): string {
    return this.opened.id ?? '';
  }

  /** Sees to it that the service met these constraints last: after undo it may have met others since. */
  private async meet(id: string, constraints: Constraints, progress: Progress): Promise<void> {
    if (this.met !== JSON.stringify(constraints)) {
      await this.meeting(constraints, () => this.service.mend(id, constraints, progress));
    }
  }

  /** Asks what has the service meet constraints. Until it answers, nobody knows which it met: a request that is stopped may have come. */
  private async meeting<T>(constraints: Constraints, ask: () => Promise<T>): Promise<T> {
    this.met = undefined;
    const answer = await ask();
    this.met = JSON.stringify(constraints);
    return answer;
  }

  private async within<T>(progress: Progress, task: (id: string) => Promise<T>): Promise<T> {
    try {
      return await task(this.id);
    } catch (error) {
      if (!(error instanceof ProblemError && error.sessionIsGone)) {
        throw error;
      }
      this.met = undefined;
      this.opened = await this.service.openSession(this.scan, this.selection, progress);
      return task(this.id);
    }
  }

  /** Divides the positions of all patches among the holes. */
  private byHole(all: Float32Array): HolePositions[] {
    let start = 0;
    return this.holes.map((hole) => {
      const end = start + 3 * vertexCount(hole);
      const positions = all.subarray(start, end);
      start = end;
      return { hole, positions };
    });
  }
}

/** Vertices of a patch. Without a chart it has no uvs to count, but each vertex belongs to a triangle. */
function vertexCount({ patchUvs = [], patchFaces = [] }: SessionHole): number {
  return patchUvs.length > 0 ? patchUvs.length / 2 : patchFaces.reduce((most, vertex) => Math.max(most, vertex + 1), 0);
}
