/** A scan's session at the service, opened when it is needed, and again when other holes are chosen. */
import {
  type AnchorFound,
  type AnchorQuery,
  type HolePositions,
  type MapEvents,
  type Progress,
  type Report,
  type Service,
  type SessionHole,
  type Skipped,
  type TextureReport,
  ClothSession,
} from '../client.js';
import { type Choice, type ClothConstraints, NO_CONSTRAINTS, messageOf, selectionOf } from './constraints.js';
import type { OpenScan } from './editor_state.js';
import { type PlainColour, documentOf, hasColours, plainColours } from './gltf_document.js';
import type { Texture } from './textures.js';

/** What the patches of a session look like: texture coordinates, colours and materials, which of all constraints `texture` alone changes. */
export interface Dressing {
  /** The patches under no constraints, one mesh a hole. Their vertices are the corners of the surface: more than patch vertices at seams. */
  readonly glb: ArrayBuffer;
  /** The positions of the patch vertices in the same state, by hole id. */
  readonly positions: ReadonlyMap<number, Float32Array>;
  /** Where the colours come from, by hole id; empty where the scan has none. */
  readonly textures: ReadonlyMap<number, TextureReport>;
  /** The colours of patches without images, by hole id. */
  readonly colours: ReadonlyMap<number, PlainColour>;
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
  /** Those that were shown. */
  readonly dressings: Map<Texture, Dressing>;
}

/** What a session needs of a scan. */
type Scanned = Pick<OpenScan, 'file' | 'loops' | 'document'>;

/** A scan at the service. Every method names the holes that must be filled: a session is opened on them unless the last one was. */
export class ScanSession {
  private opened: Opened | undefined;

  constructor(
    private readonly service: Service,
    private readonly scan: Scanned,
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
    constraints: ClothConstraints,
    progress: Progress,
  ): Promise<{ patches: Patch[]; report: Report }> {
    const opened = await this.open(choice, progress);
    const dressing = await this.dress(opened, constraints.texture, progress);
    const { patches, report } = await opened.cloth.mend(messageOf(constraints), progress);
    return { patches: dressed(patches, dressing), report: withTextures(report, dressing) };
  }

  /** The patches under constraints, as fast as the service can. */
  async preview(choice: Choice, constraints: ClothConstraints): Promise<Patch[]> {
    const opened = await this.open(choice, {});
    const dressing = await this.dress(opened, constraints.texture, {});
    return dressed(await opened.cloth.draft(messageOf(constraints)), dressing);
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
  async result(choice: Choice, constraints: ClothConstraints, progress: Progress): Promise<Blob> {
    return (await this.open(choice, progress)).cloth.result(messageOf(constraints), progress);
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
    const { file, loops } = this.scan;
    const cloth = await ClothSession.open(this.service, file, selectionOf(loops, choice), progress);
    this.close();
    const filled = keyOf({ ...choice, holes: cloth.holes.map(({ id = 0 }) => id) });
    this.opened = { asked, filled, cloth, dressings: new Map() };
    return this.opened;
  }

  /** What the patches look like by where their colours come from, asked once for each session. */
  private async dress({ cloth, dressings }: Opened, texture: Texture, progress: Progress): Promise<Dressing> {
    const kept = dressings.get(texture);
    if (kept !== undefined) {
      return kept;
    }
    const constraints = messageOf({ ...NO_CONSTRAINTS, texture });
    const unconstrained = await cloth.positions(constraints, progress);
    const { glb, report } = await cloth.patches(constraints, progress);
    const holes = report.holes ?? [];
    // Of plain cloth there is nothing to say.
    const told = hasColours(this.scan.document) ? holes : [];
    const dressing = {
      glb,
      positions: new Map(unconstrained.map((patch) => [patch.hole.id ?? 0, patch.positions])),
      textures: new Map(told.flatMap(({ id = 0, texture: said }) => (said === undefined ? [] : [[id, said] as const]))),
      colours: plainColours(
        documentOf(glb),
        holes.map(({ id = 0 }) => id),
      ),
    };
    dressings.set(texture, dressing);
    return dressing;
  }
}

/** A choice as a text to compare. */
function keyOf({ holes, made, acceptDoubtful, selection, more }: Choice): string {
  return JSON.stringify([holes, made, acceptDoubtful, selection, more]);
}

function dressed(patches: readonly HolePositions[], dressing: Dressing): Patch[] {
  return patches.map((patch) => ({ ...patch, dressing }));
}

/** A report of positions alone, which says nothing of colours, with them. */
function withTextures(report: Report, { textures }: Dressing): Report {
  const holes = (report.holes ?? []).map((hole) => {
    const texture = textures.get(hole.id ?? 0);
    return texture === undefined ? hole : { ...hole, texture };
  });
  return { ...report, holes };
}
