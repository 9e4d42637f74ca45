/** A scan's session at the service, opened when it is needed and opened again when it has ended. */
import type { AnchorFound, AnchorQuery, Constraints, Report, Session, SessionHole, Skipped } from '../contract.js';
import { ProblemError } from '../service/problem.js';
import type { Progress } from '../service/requests.js';
import type { Service } from '../service/service.js';

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
  /** `x, y, z` of every patch vertex, in the order of `hole.patchUvs`. */
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
  /** Holes that cannot be filled, by id. */
  private readonly unfillable = new Map<number, Skipped>();

  constructor(
    private readonly service: Service,
    private readonly scan: Blob,
  ) {}

  /** The loops that are left as they are. */
  get skipped(): readonly Skipped[] {
    const unfillable = [...this.unfillable.values()];
    const others = (this.opened?.session.skipped ?? []).filter(({ id }) => !this.unfillable.has(id ?? 0));
    return [...unfillable, ...others];
  }

  /** The patches under constraints, and the report. */
  mend(
    holes: readonly number[],
    constraints: Constraints,
    progress: Progress,
  ): Promise<{ patches: Patch[]; report: Report }> {
    return this.within(holes, progress, async (opened) => {
      const { positions, report } = await this.service.mend(opened.id, constraints, progress);
      opened.met = JSON.stringify(constraints);
      return { patches: patchesOf(opened, positions), report };
    });
  }

  /** The patches under constraints, as fast as the service can. */
  preview(holes: readonly number[], constraints: Constraints): Promise<Patch[]> {
    return this.within(holes, {}, async (opened) => {
      const positions = await this.service.positions(opened.id, constraints, {});
      opened.met = JSON.stringify(constraints);
      return patchesOf(opened, positions);
    });
  }

  /** Where on a hole's chart a point belongs. */
  optimizeAnchor(holes: readonly number[], query: AnchorQuery, progress: Progress): Promise<AnchorFound> {
    return this.within(holes, progress, ({ id }) => this.service.optimizeAnchor(id, query, progress));
  }

  /** The whole scan under constraints. */
  result(holes: readonly number[], constraints: Constraints, progress: Progress): Promise<Blob> {
    return this.within(holes, progress, async (opened) => {
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

  private async within<T>(
    holes: readonly number[],
    progress: Progress,
    task: (opened: Opened) => Promise<T>,
  ): Promise<T> {
    try {
      return await task(await this.open(holes, progress));
    } catch (error) {
      if (!(error instanceof ProblemError && error.sessionIsGone)) {
        throw error;
      }
      this.opened = undefined;
      return task(await this.open(holes, progress));
    }
  }

  private async open(holes: readonly number[], progress: Progress): Promise<Opened> {
    const asked = holes.join();
    if (this.opened !== undefined && [this.opened.asked, this.opened.filled].includes(asked)) {
      return this.opened;
    }
    const session = await this.openOnFillable(holes, progress);
    const id = session.id ?? '';
    const unconstrained = await this.service.positions(id, {}, progress);
    const glb = await this.service.patches(id, {}, progress);
    const patches = byHole(session, unconstrained);
    const positions = new Map(patches.map((patch) => [patch.hole.id ?? 0, patch.positions]));
    this.close();
    const filled = [...positions.keys()].join();
    this.opened = { id, asked, filled, session, dressing: { glb, positions }, met: undefined };
    return this.opened;
  }

  /**
   * Opens a session on those of the holes that can be filled. The service refuses a choice with a hole that it cannot fill; asked for all
   * holes, it leaves such holes open and says why.
   */
  private async openOnFillable(holes: readonly number[], progress: Progress): Promise<Session> {
    const fillable = (): number[] => holes.filter((id) => !this.unfillable.has(id));
    const openOn = (ids: readonly number[]): Promise<Session> =>
      this.service.openSession(this.scan, { holes: ids.map((id) => ({ id })) }, progress);
    const first = fillable();
    try {
      return await openOn(first.length > 0 ? first : holes);
    } catch (error) {
      if (!(error instanceof ProblemError && error.status === 422) || holes.length < 2) {
        throw error;
      }
      const all = await this.service.openSession(this.scan, {}, progress);
      this.service.close(all.id ?? '');
      for (const loop of all.skipped ?? []) {
        if (holes.includes(loop.id ?? 0)) {
          this.unfillable.set(loop.id ?? 0, loop);
        }
      }
      const rest = fillable();
      if (rest.length === 0 || rest.length === first.length) {
        throw error;
      }
      return openOn(rest);
    }
  }
}

function patchesOf({ session, dressing }: Opened, positions: Float32Array): Patch[] {
  return byHole(session, positions).map((patch) => ({ ...patch, dressing }));
}

/** Divides the positions of all patches among the holes. */
function byHole(session: Session, all: Float32Array): { hole: SessionHole; positions: Float32Array }[] {
  let start = 0;
  return (session.holes ?? []).map((hole) => {
    const end = start + ((hole.patchUvs?.length ?? 0) / 2) * 3;
    const positions = all.subarray(start, end);
    start = end;
    return { hole, positions };
  });
}
