/** What is drawn for the gesture that is being made. */
import type { Uv, Vec3 } from '../client.js';
import { type ClothPoint, locate, normalOf, positionOf } from '../model/cloth.js';
import { type BorderDraft, type ClothDraft, type MakingDraft, handlesOf, isMaking } from '../model/draft.js';
import type { Editor } from '../model/editor.js';
import type { Patch } from '../model/scan_session.js';
import { Vector3 } from '../vendor.js';
import type { BorderLines } from './border_stretch.js';
import { type Marked, circle } from './marks.js';

/** Cells of a grid's side. */
const GRID = 64;

/** A disk of new cloth. */
export interface Disk {
  readonly point: ClothPoint;
  /** On the chart. */
  readonly radius: number;
}

/** What marks need of the picture. */
export interface Waiting {
  /** The first point of a pinch. */
  readonly cloth: ClothPoint | undefined;
  /** The first end of a stretch of border. */
  readonly border: Vector3 | undefined;
  /** The disk that a twist would turn. */
  readonly disk: Disk | undefined;
  /** What a stretch of border will be mended as. */
  lines(draft: BorderDraft): BorderLines;
}

/**
 * The handle where the hand is, the tether from there to where the cloth is now, the disk of a twist and the ring around it.
 */
export function marksOf(editor: Editor, gesture: Waiting): Marked {
  const { draft } = editor;
  const { cloth: waiting, border, disk } = gesture;
  if (draft !== undefined && isMaking(draft)) {
    return makingMarks(draft, gesture);
  }
  if (border !== undefined) {
    return { handles: [border] };
  }
  const hole = draft?.hole ?? waiting?.hole ?? disk?.point.hole;
  const before = editor.step.patches.find((patch) => patch.hole.id === hole);
  const now = editor.patches.find((patch) => patch.hole.id === hole);
  if (before === undefined || now === undefined) {
    return {};
  }
  const spacing = editor.reportOf(now.hole.id ?? 0)?.grid?.spacingMean ?? 0;
  if (draft === undefined) {
    return waiting ? { handles: [at(now, waiting)] } : disk ? diskMarks(disk, now, spacing) : {};
  }
  return draftMarks(draft, before, now, spacing);
}

function diskMarks({ point, radius }: Disk, now: Patch, spacing: number): Marked {
  const center = at(now, point);
  const ring = circle(center, new Vector3(...normalOf(now, point)), radius * GRID * spacing);
  return { handles: [center], ring, disk: { center, ring } };
}

function makingMarks(draft: MakingDraft, { lines }: Waiting): Marked {
  switch (draft.kind) {
    case 'cut': {
      const center = new Vector3(...draft.center);
      return { handles: [center], ball: { center, radius: draft.radius } };
    }
    case 'polygon': {
      const corners = draft.corners.map((corner) => new Vector3(...corner));
      return { handles: corners, stretches: [corners.length < 3 ? corners : [...corners, ...corners.slice(0, 1)]] };
    }
    case 'border': {
      const handles = handlesOf(draft).map((point) => new Vector3(...point));
      const { stretches, hems } = lines(draft);
      return { handles, stretches: stretches.map(drawn), dashes: hems.map(drawn) };
    }
  }
}

function drawn(line: readonly Vec3[]): Vector3[] {
  return line.map((point) => new Vector3(...point));
}

function draftMarks(draft: ClothDraft, before: Patch, now: Patch, spacing: number): Marked {
  switch (draft.kind) {
    case 'grab': {
      const point = locate(before, draft.uv);
      const handle = point && at(before, point).add(new Vector3(...draft.offset));
      return point && handle ? { handles: [handle], tethers: [[at(now, point), handle]] } : {};
    }
    case 'twist': {
      const point = locate(now, draft.uv);
      return point ? diskMarks({ point, radius: draft.radius }, now, spacing) : {};
    }
    case 'pinch': {
      const ends = draft.uvs.map((uv: Uv) => locate(now, uv)).filter((point) => point !== undefined);
      const handles = ends.map((point) => at(now, point));
      const [first, second] = handles;
      return { handles, tethers: first && second ? [[first, second]] : [] };
    }
    case 'anchor':
      return { handles: [new Vector3(...draft.position)] };
  }
}

function at(patch: Patch, point: ClothPoint): Vector3 {
  return new Vector3(...positionOf(patch, point));
}
