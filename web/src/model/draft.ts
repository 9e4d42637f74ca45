/** A gesture or an anchor while it is made, before it is a step. */
import type { Anchor, Edit, Uv, Vec3 } from '../client.js';
import { locate, middleOf, normalOf, positionOf } from './cloth.js';
import type { ClothConstraints } from './constraints.js';
import type { Patch } from './scan_session.js';

/** Pulls the cloth at a point. */
export interface GrabDraft {
  readonly kind: 'grab';
  readonly hole: number;
  readonly uv: Uv;
  readonly offset: Vec3;
}

/** Turns a disk of cloth. */
export interface TwistDraft {
  readonly kind: 'twist';
  readonly hole: number;
  readonly uv: Uv;
  /** On the chart. */
  readonly radius: number;
  readonly axis: Vec3;
  /** In radians. */
  readonly angle: number;
}

/** Draws two points together. */
export interface PinchDraft {
  readonly kind: 'pinch';
  readonly hole: number;
  readonly uvs: readonly [Uv, Uv];
  /** Share of their distance that is taken away. */
  readonly amount: number;
}

/** A point in space that the cloth should reach. */
export interface AnchorDraft {
  readonly kind: 'anchor';
  readonly hole: number;
  readonly position: Vec3;
  readonly hard: boolean;
}

export type Draft = GrabDraft | TwistDraft | PinchDraft | AnchorDraft;
export type DraftKind = Draft['kind'];

/** What a step is called that was made of a draft. */
export const NAMES: Readonly<Record<DraftKind, string>> = {
  grab: 'Grab',
  twist: 'Twist',
  pinch: 'Pinch',
  anchor: 'Anchor',
};

/** A draft that changes nothing yet, in the middle of a patch. */
export function firstDraft(kind: DraftKind, patch: Patch): Draft {
  const hole = patch.hole.id ?? 0;
  const uv = middleOf(patch);
  const point = locate(patch, uv);
  switch (kind) {
    case 'grab':
      return { kind, hole, uv, offset: [0, 0, 0] };
    case 'twist':
      return { kind, hole, uv, radius: 0.125, axis: point ? normalOf(patch, point) : [0, 1, 0], angle: 0 };
    case 'pinch':
      return { kind, hole, uvs: [uv, [uv[0] + 0.1, uv[1]]], amount: 0.5 };
    case 'anchor':
      return { kind, hole, position: point ? positionOf(patch, point) : [0, 0, 0], hard: false };
  }
}

/** The constraints with a gesture at the end. Anchors get their place first: see `Editor.placeAnchor`. */
export function withGesture(constraints: ClothConstraints, draft: Exclude<Draft, AnchorDraft>): ClothConstraints {
  return { ...constraints, edits: [...constraints.edits, editOf(draft)] };
}

/** The constraints with an anchor at the end. */
export function withAnchor(
  constraints: ClothConstraints,
  { hole, position, hard }: AnchorDraft,
  uv: Uv,
): ClothConstraints {
  const anchor: Anchor = { hole, uv: [...uv], position: [...position], ...(hard && { hard }) };
  return { ...constraints, anchors: [...constraints.anchors, anchor] };
}

function editOf(draft: Exclude<Draft, AnchorDraft>): Edit {
  const { hole } = draft;
  switch (draft.kind) {
    case 'grab':
      return { hole, grab: { uv: [...draft.uv], offset: [...draft.offset] } };
    case 'twist':
      return {
        hole,
        twist: { uv: [...draft.uv], radius: draft.radius, axis: [...draft.axis], angle: draft.angle },
      };
    case 'pinch':
      return { hole, pinch: { uvs: draft.uvs.map((uv) => [...uv]), amount: draft.amount } };
  }
}
