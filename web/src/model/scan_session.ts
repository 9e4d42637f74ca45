/** A scan's session at the service, opened when it is needed, and again when other holes are chosen. */
import {
  type AnchorFound,
  type AnchorQuery,
  type Constraints,
  type HolePositions,
  type Loop,
  type MapEvents,
  type Progress,
  type Report,
  type Service,
  type SessionHole,
  type Skipped,
  ClothSession,
} from '../client.js';
import { type Choice, selectionOf } from './constraints.js';

/** What the patches of a session look like: texture coordinates, colours and materials, which no constraints change. */
export interface Dressing {
  /** The patches under no constraints, one mesh a hole. Their vertices are the corners of the surface: more than patch vertices at seams. */
  readonly glb: ArrayBuffer;
  /** The positions of the patch vertices in the same state, by hole id. */
  readonly positions: ReadonlyMap<number, Float32Array>;
}

/** A hole's new cloth. */
export interface Patch extends HolePositions {
  readonly dressing: Dressing;
}

/** A session and the holes that it was opened on. */
interface Opened {
  /** The holes that were asked for, and those of them that it fills, as texts to compare. */
  readonly asked: string;
  readonly filled: string;
  readonly cloth: ClothSession;
  readonly dressing: Dressing;
}

/** A scan at the service. Every method names the holes that must be filled: a session is opened on them unless the last one was. */
export class ScanSession {
  private opened: Opened | undefined;

  constructor(
    private readonly service: Service,
    private readonly scan: Blob,
    private readonly loops: readonly Loop[],
  ) {}

  /** The loops that are left as they are. */
  get skipped(): readonly Skipped[] {
    return this.opened?.cloth.skipped ?? [];
  }

  /** The middles of the triangles that are cut out, `x, y, z` of each. */
  get cutFaces(): readonly number[] {
    return this.opened?.cloth.cutFaces ?? [];
  }

  /** The holes that a choice fills. */
  async holes(choice: Choice, progress: Progress): Promise<readonly SessionHole[]> {
    return (await this.open(choice, progress)).cloth.holes;
  }

  /** The patches under constraints, and the report. */
  async mend(
    choice: Choice,
    constraints: Constraints,
    progress: Progress,
  ): Promise<{ patches: Patch[]; report: Report }> {
    const opened = await this.open(choice, progress);
    const { patches, report } = await opened.cloth.mend(constraints, progress);
    return { patches: dressed(patches, opened), report };
  }

  /** The patches under constraints, as fast as the service can. */
  async preview(choice: Choice, constraints: Constraints): Promise<Patch[]> {
    const opened = await this.open(choice, {});
    return dressed(await opened.cloth.draft(constraints), opened);
  }

  /** Where on a hole's chart a point belongs. */
  async optimizeAnchor(choice: Choice, query: AnchorQuery, progress: Progress): Promise<AnchorFound> {
    return (await this.open(choice, progress)).cloth.optimizeAnchor(query, progress);
  }

  /** The same, and the map as it is computed. */
  async anchorMap(choice: Choice, query: AnchorQuery, events: MapEvents, progress: Progress): Promise<void> {
    await (await this.open(choice, progress)).cloth.anchorMap(query, events, progress);
  }

  /** The whole scan under constraints. */
  async result(choice: Choice, constraints: Constraints, progress: Progress): Promise<Blob> {
    return (await this.open(choice, progress)).cloth.result(constraints, progress);
  }

  /** Ends the session. */
  close(): void {
    this.opened?.cloth.close();
    this.opened = undefined;
  }

  private async open(choice: Choice, progress: Progress): Promise<Opened> {
    const asked = keyOf(choice);
    if (this.opened !== undefined && [this.opened.asked, this.opened.filled].includes(asked)) {
      return this.opened;
    }
    const cloth = await ClothSession.open(this.service, this.scan, selectionOf(this.loops, choice), progress);
    const unconstrained = await cloth.positions({}, progress);
    const glb = await cloth.patches({}, progress);
    const positions = new Map(unconstrained.map((patch) => [patch.hole.id ?? 0, patch.positions]));
    this.close();
    const filled = keyOf({ ...choice, holes: [...positions.keys()] });
    this.opened = { asked, filled, cloth, dressing: { glb, positions } };
    return this.opened;
  }
}

/** A choice as a text to compare. */
function keyOf({ holes, made, acceptDoubtful }: Choice): string {
  return JSON.stringify([holes, made, acceptDoubtful]);
}

function dressed(patches: readonly HolePositions[], { dressing }: Opened): Patch[] {
  return patches.map((patch) => ({ ...patch, dressing }));
}
