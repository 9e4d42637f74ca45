/** A gesture, an anchor, a cut or a stretch of border while it is made, before it is a step. */
import type { Anchor, BorderCandidate, Edit, Loop, Uv, Vec3 } from '../client.js';
import { locate, middleOf, normalOf, positionOf } from './cloth.js';
import type { ClothConstraints, MadeHole } from './constraints.js';
import { byKind } from './loops.js';
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
  /** Where on the chart a hand has put it; otherwise its place is searched. */
  readonly uv?: Uv;
  /** The index of the anchor that it takes the place of. */
  readonly replaces?: number;
}

/** A ball: the scan's cloth that reaches into it is cut out, and mended. */
export interface CutDraft {
  readonly kind: 'cut';
  readonly center: Vec3;
  readonly radius: number;
}

/** Corners on the scan's cloth: what lies under their polygon is cut out, and mended. */
export interface PolygonDraft {
  readonly kind: 'polygon';
  readonly corners: readonly Vec3[];
  /** How far it reaches to either side of its mean plane; otherwise as `depthOf` says. */
  readonly depth?: number;
}

/** A stretch of the cloth's own edge by its ends. */
export interface EdgeEnds {
  readonly from: Vec3;
  readonly to: Vec3;
}

/** A stretch of the cloth's own edge to mend up to a new hem. */
export interface BorderDraft extends EdgeEnds {
  readonly kind: 'border';
  /** Points that the new hem goes through; without any it continues the hem on both sides. */
  readonly along: readonly Vec3[];
  /** The torn edge that faces the stretch: the cloth between the two is made. Without `along`. */
  readonly facing?: EdgeEnds;
}

/** What changes new cloth. */
export type ClothDraft = GrabDraft | TwistDraft | PinchDraft | AnchorDraft;
export type GestureDraft = Exclude<ClothDraft, AnchorDraft>;
/** What makes a hole that is mended. */
export type MakingDraft = CutDraft | PolygonDraft | BorderDraft;
export type Draft = ClothDraft | MakingDraft;
export type ClothKind = ClothDraft['kind'];
export type DraftKind = Draft['kind'];

/** Whether a draft makes a hole, and does not change new cloth. */
export function isMaking(draft: Draft): draft is MakingDraft {
  return draft.kind === 'cut' || draft.kind === 'polygon' || draft.kind === 'border';
}

/** Whether a draft has all that it needs to become a step: a polygon needs three corners. */
export function isWhole(draft: Draft): boolean {
  return draft.kind !== 'polygon' || draft.corners.length >= 3;
}

/** What a step is called that was made of a draft. */
export const NAMES: Readonly<Record<DraftKind, string>> = {
  grab: 'Grab',
  twist: 'Twist',
  pinch: 'Pinch',
  anchor: 'Anchor',
  cut: 'Cut out',
  polygon: 'Cut out',
  border: 'Border',
};

/** The radius of a twist on the chart, while nobody has chosen another. */
export const FIRST_RADIUS = 0.125;

/** A draft that changes nothing yet, in the middle of a patch. */
export function firstDraft(kind: ClothKind, patch: Patch): ClothDraft {
  const hole = patch.hole.id ?? 0;
  const uv = middleOf(patch);
  const point = locate(patch, uv);
  switch (kind) {
    case 'grab':
      return { kind, hole, uv, offset: [0, 0, 0] };
    case 'twist':
      return { kind, hole, uv, radius: FIRST_RADIUS, axis: point ? normalOf(patch, point) : [0, 1, 0], angle: 0 };
    case 'pinch':
      return { kind, hole, uvs: [uv, [uv[0] + 0.1, uv[1]]], amount: 0.5 };
    case 'anchor':
      return { kind, hole, position: point ? positionOf(patch, point) : [0, 0, 0], hard: false };
  }
}

/** Where cuts and borders of a scan begin for who types them. */
export interface MakingStart {
  readonly loops: readonly Loop[];
  readonly candidates: readonly BorderCandidate[];
}

/** A bite, a rip, a torn corner or a tear that was found. */
export function bordering({ border }: BorderCandidate): BorderDraft {
  const ends = ({ from, to }: { from?: number[]; to?: number[] }): EdgeEnds => ({
    from: pointOf(from),
    to: pointOf(to),
  });
  const { facing, along = [] } = border ?? {};
  return { kind: 'border', ...ends(border ?? {}), along: along.map(pointOf), ...(facing && { facing: ends(facing) }) };
}

/** The bites, rips and tears of a scan that are not among what is made. */
export function unmade(candidates: readonly BorderCandidate[], made: readonly MadeHole[]): BorderCandidate[] {
  return candidates.filter((candidate) => !isMade(candidate, made));
}

/** Whether a bite, a rip or a tear is mended by something that is made. */
export function isMade(candidate: BorderCandidate, made: readonly MadeHole[]): boolean {
  const own = JSON.stringify(madeBy(bordering(candidate)));
  const isTear = candidate.border?.facing !== undefined;
  return made.some((entry) => ('border' in entry && entry.border.auto ? !isTear : JSON.stringify(entry) === own));
}

/** A ball around the edge of the largest hole, a polygon without corners, or the first place at the border that was found. */
export function firstMaking(kind: MakingDraft['kind'], { loops, candidates }: MakingStart): MakingDraft {
  const first = firstLoop(loops);
  const centroid = pointOf(first?.centroid);
  switch (kind) {
    case 'cut': {
      const radius = (first?.diameter ?? 1) * (first?.kind === 'HOLE' ? 0.55 : 0.05);
      return { kind, center: centroid, radius };
    }
    case 'polygon':
      return { kind, corners: [] };
    case 'border': {
      const [found] = candidates;
      return found ? bordering(found) : { kind, from: centroid, to: centroid, along: [] };
    }
  }
}

/** The largest hole, or the largest other loop of a scan without any. */
function firstLoop(loops: readonly Loop[]): Loop | undefined {
  return byKind(loops)[0]?.[1][0];
}

/** A polygon with one more corner for who types it: where its last one is, or at the largest hole. */
export function withTypedCorner(draft: PolygonDraft, loops: readonly Loop[]): PolygonDraft {
  const { corners } = draft;
  return { ...draft, corners: [...corners, corners.at(-1) ?? pointOf(firstLoop(loops)?.centroid)] };
}

/** A polygon with one of its corners elsewhere. */
export function withCorner(draft: PolygonDraft, corner: number, point: Vec3): PolygonDraft {
  return { ...draft, corners: draft.corners.map((it, at) => (at === corner ? point : it)) };
}

/** A polygon without its last corner. */
export function withoutLastCorner(draft: PolygonDraft): PolygonDraft {
  return { ...draft, corners: draft.corners.slice(0, -1) };
}

/** How deep a polygon cuts, in the scene's unit: where nobody has said it, a tenth of the largest distance between two of its corners. */
export function depthOf({ corners, depth }: PolygonDraft): number {
  const farthest = (a: Vec3): number => Math.max(...corners.map((b) => distance(a, b)));
  return depth ?? Math.max(0, ...corners.map(farthest)) / 10;
}

function pointOf([x = 0, y = 0, z = 0]: readonly number[] = []): Vec3 {
  return [x, y, z];
}

/** The points of a stretch of border that a hand can hold: its ends, then those of the edge that faces it, or those that the new hem goes through. */
export function handlesOf({ from, to, along, facing }: BorderDraft): readonly Vec3[] {
  return facing ? [from, to, facing.from, facing.to] : [from, to, ...along];
}

/** How many of its handles lie at the cloth's own edge. */
export function endsOf({ facing }: BorderDraft): number {
  return facing ? 4 : 2;
}

/** A stretch with one of its handles elsewhere. */
export function withHandle(draft: BorderDraft, handle: number, point: Vec3): BorderDraft {
  const moved = handlesOf(draft).with(handle, point);
  if (draft.facing === undefined) {
    const [from, to, ...along] = moved as [Vec3, Vec3, ...Vec3[]];
    return { ...draft, from, to, along };
  }
  const [from, to, facingFrom, facingTo] = moved as [Vec3, Vec3, Vec3, Vec3];
  return { ...draft, from, to, facing: { from: facingFrom, to: facingTo } };
}

/** The stretch with an edge that faces it, whose ends lie at the stretch's until somebody moves them. */
export function withFacing({ from, to }: BorderDraft): BorderDraft {
  return { kind: 'border', from, to, along: [], facing: { from, to } };
}

/** The stretch without an edge that faces it. */
export function withoutFacing({ from, to }: BorderDraft): BorderDraft {
  return { kind: 'border', from, to, along: [] };
}

function distance(a: Vec3, b: Vec3): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/** The entry of `holes` that a draft stands for. */
export function madeBy(draft: MakingDraft): MadeHole {
  switch (draft.kind) {
    case 'cut':
      return { cut: { center: [...draft.center], radius: draft.radius } };
    case 'polygon':
      return { cut: { polygon: draft.corners.map((corner) => [...corner]), depth: depthOf(draft) } };
    case 'border': {
      const along = draft.along.map((point) => [...point]);
      const facing = draft.facing && { from: [...draft.facing.from], to: [...draft.facing.to] };
      const ends = { from: [...draft.from], to: [...draft.to] };
      return { border: { ...ends, ...(along.length > 0 && { along }), ...(facing && { facing }) } };
    }
  }
}

/** The constraints with a gesture at the end. Anchors get their place first: see `Editor.placeAnchor`. */
export function withGesture(constraints: ClothConstraints, draft: GestureDraft): ClothConstraints {
  return { ...constraints, edits: [...constraints.edits, editOf(draft)] };
}

/** The constraints with an anchor at a place of the chart: at the end, or in place of the one that it replaces. */
export function withAnchor(
  constraints: ClothConstraints,
  { hole, position, hard, replaces }: AnchorDraft,
  uv: Uv,
): ClothConstraints {
  const anchor: Anchor = { hole, uv: [...uv], position: [...position], ...(hard && { hard }) };
  const { anchors } = constraints;
  const isNew = replaces === undefined || replaces >= anchors.length;
  return { ...constraints, anchors: isNew ? [...anchors, anchor] : anchors.with(replaces, anchor) };
}

/** The constraints under which a draft is shown while it is made; undefined for one that changes no cloth yet. */
export function previewed(constraints: ClothConstraints, draft: Draft): ClothConstraints | undefined {
  if (isMaking(draft)) {
    return undefined;
  }
  if (draft.kind === 'anchor') {
    return draft.uv && withAnchor(constraints, draft, draft.uv);
  }
  return withGesture(constraints, draft);
}

function editOf(draft: GestureDraft): Edit {
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
