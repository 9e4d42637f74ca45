/** A scan's session at the service, opened when it is needed and opened again when it has ended. */
import type {
  AnchorFound,
  AnchorQuery,
  Constraints,
  Loop,
  Report,
  Session,
  SessionHole,
  Skipped,
} from '../contract.js';
import { ProblemError } from '../service/problem.js';
import type { Progress } from '../service/requests.js';
import type { Service } from '../service/service.js';
import { type Choice, selectionOf } from './constraints.js';

/** What the patches of a session look like: texture coordinates, colours and materials, which no constraints change. */
export interface Dressing {
  /** The patches under no constraints, one mesh a hole. Their vertices are the corners of the surface: more than patch vertices at seams. */
  readonly glb: ArrayBuffer;
  /** The positions of the patch vertices in the same state, by hole id. */
  readonly positions: ReadonlyMap<number, Float32Array>;
}

/** A hole's new cloth. */
export interface Patch {
  /** What stays the same whatever the constraints. */
  readonly hole: SessionHole;
  readonly dressing: Dressing;
  /** `x, y, z` of every patch vertex, the rim's first. */
  readonly positions: Float32Array;
}

/** A session and the holes that it was opened on. */
interface Opened {
  readonly id: string;
  /** The holes that were asked for, and those of them that it fills, as texts to compare. */
  readonly asked: string;
  readonly filled: string;
  readonly session: Session;
  readonly dressing: Dressing;
  /** The constraints that it met last, as JSON. */
  met: string | undefined;
}

/**
 * A scan at the service. Every method names the holes that must be filled: a session is opened on them unless the last one was. The scan
 * is kept here, so that a session that the service has ended (410) is opened again without asking anybody.
 */
export class ScanSession {
  private opened: Opened | undefined;

  constructor(
    private readonly service: Service,
    private readonly scan: Blob,
    private readonly loops: readonly Loop[],
  ) {}

  /** The loops that are left as they are. */
  get skipped(): readonly Skipped[] {
    return this.opened?.session.skipped ?? [];
  }

  /** The patches under constraints, and the report. */
  mend(choice: Choice, constraints: Constraints, progress: Progress): Promise<{ patches: Patch[]; report: Report }> {
    return this.within(choice, progress, async (opened) => {
      const { positions, report } = await this.service.mend(opened.id, constraints, progress);
      opened.met = JSON.stringify(constraints);
      return { patches: patchesOf(opened, positions), report };
    });
  }

  /** The patches under constraints, as fast as the service can. */
  preview(choice: Choice, constraints: Constraints): Promise<Patch[]> {
    return this.within(choice, {}, async (opened) => {
      const positions = await this.service.positions(opened.id, constraints, {});
      opened.met = JSON.stringify(constraints);
      return patchesOf(opened, positions);
    });
  }

  /** Where on a hole's chart a point belongs. */
  optimizeAnchor(choice: Choice, query: AnchorQuery, progress: Progress): Promise<AnchorFound> {
    return this.within(choice, progress, ({ id }) => this.service.optimizeAnchor(id, query, progress));
  }

  /** The whole scan under constraints. */
  result(choice: Choice, constraints: Constraints, progress: Progress): Promise<Blob> {
    return this.within(choice, progress, async (opened) => {
      // After undo, the session may have met others since.
      if (opened.met !== JSON.stringify(constraints)) {
        await this.service.mend(opened.id, constraints, progress);
        opened.met = JSON.stringify(constraints);
      }
      return this.service.result(opened.id, progress);
    });
  }

  /** Ends the session. */
  close(): void {
    if (this.opened !== undefined) {
      this.service.close(this.opened.id);
      this.opened = undefined;
    }
  }

  private async within<T>(choice: Choice, progress: Progress, task: (opened: Opened) => Promise<T>): Promise<T> {
    try {
      return await task(await this.open(choice, progress));
    } catch (error) {
      if (!(error instanceof ProblemError && error.sessionIsGone)) {
        throw error;
      }
      this.opened = undefined;
      return task(await this.open(choice, progress));
    }
  }

  private async open(choice: Choice, progress: Progress): Promise<Opened> {
    const asked = keyOf(choice);
    if (this.opened !== undefined && [this.opened.asked, this.opened.filled].includes(asked)) {
      return this.opened;
    }
    const selection = selectionOf(this.loops, choice);
    const session = await this.service.openSession(this.scan, selection, progress);
    const id = session.id ?? '';
    const unconstrained = await this.service.positions(id, {}, progress);
    const glb = await this.service.patches(id, {}, progress);
    const patches = byHole(session, unconstrained);
    const positions = new Map(patches.map((patch) => [patch.hole.id ?? 0, patch.positions]));
    this.close();
    const filled = keyOf({ ...choice, holes: [...positions.keys()] });
    this.opened = { id, asked, filled, session, dressing: { glb, positions }, met: undefined };
    return this.opened;
  }
}

/** A choice as a text to compare. */
function keyOf({ holes, acceptDoubtful }: Choice): string {
  return `${holes.join()} ${acceptDoubtful}`;
}

function patchesOf({ session, dressing }: Opened, positions: Float32Array): Patch[] {
  return byHole(session, positions).map((patch) => ({ ...patch, dressing }));
}

/** Divides the positions of all patches among the holes. */
function byHole(session: Session, all: Float32Array): { hole: SessionHole; positions: Float32Array }[] {
  let start = 0;
  return (session.holes ?? []).map((hole) => {
    const end = start + 3 * vertexCount(hole);
    const positions = all.subarray(start, end);
    start = end;
    return { hole, positions };
  });
}

/** Vertices of a patch. Without a chart it has no uvs to count, but each vertex belongs to a triangle. */
function vertexCount({ patchUvs = [], patchFaces = [] }: SessionHole): number {
  return patchUvs.length > 0 ? patchUvs.length / 2 : patchFaces.reduce((most, vertex) => Math.max(most, vertex + 1), 0);
}
