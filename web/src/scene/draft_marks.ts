/** What is drawn for the gesture that is being made. */
import type { Uv } from '../client.js';
import { type ClothPoint, locate, normalOf, positionOf } from '../model/cloth.js';
import type { Draft } from '../model/draft.js';
import type { Editor } from '../model/editor.js';
import type { Patch } from '../model/scan_session.js';
import { Vector3 } from '../vendor.js';
import { type Marked, circle } from './marks.js';

/** Cells of a grid's side. */
const GRID = 64;

/**
 * The handle where the hand is, the tether from there to where the cloth is now, the ring of a twist.
 *
 * @param waiting - The first point of a pinch.
 */
export function marksOf(editor: Editor, waiting: ClothPoint | undefined): Marked {
  const { draft } = editor;
  const hole = draft?.hole ?? waiting?.hole;
  const before = editor.step.patches.find((patch) => patch.hole.id === hole);
  const now = editor.patches.find((patch) => patch.hole.id === hole);
  if (before === undefined || now === undefined) {
    return {};
  }
  if (draft === undefined) {
    return waiting ? { handles: [at(now, waiting)] } : {};
  }
  return draftMarks(draft, before, now, editor.reportOf(draft.hole)?.grid?.spacingMean ?? 0);
}

function draftMarks(draft: Draft, before: Patch, now: Patch, spacing: number): Marked {
  switch (draft.kind) {
    case 'grab': {
      const point = locate(before, draft.uv);
      const handle = point && at(before, point).add(new Vector3(...draft.offset));
      return point && handle ? { handles: [handle], tethers: [[at(now, point), handle]] } : {};
    }
    case 'twist': {
      const point = locate(now, draft.uv);
      if (point === undefined) {
        return {};
      }
      const center = at(now, point);
      const ring = circle(center, new Vector3(...normalOf(now, point)), draft.radius * GRID * spacing);
      return { handles: [center], ring };
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
