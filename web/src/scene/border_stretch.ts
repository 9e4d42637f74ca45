/**
 * What a stretch of the cloth's own edge will be mended as: which way it goes, and where the new hem lies. The law is the service's
 * (crates/mend/src: border.rs, stretch.rs); `web/tests/borders.json` has what both must give.
 */
import type { Vec3 } from '../client.js';
import type { BorderDraft, EdgeEnds } from '../model/draft.js';
import { type ClothEdge, Stretch, intoCloth } from './cloth_edge.js';
import { type HemEnd, hemLine, placeOf } from './new_hem.js';
import { distanceOf, distanceToLine } from './vectors.js';

/** A part of a loop between two torn edges is the end of a rip when it is at most this many times as long as its ends are apart. */
const END_OF_A_RIP = 2;

/** What is drawn of a stretch of border. */
export interface BorderLines {
  /** The parts of the cloth's edge that the new cloth is joined to. */
  readonly stretches: readonly (readonly Vec3[])[];
  /** The new hems; none where the service refuses what is asked. */
  readonly hems: readonly (readonly Vec3[])[];
}

/** The stretches and new hems of a draft. Nothing where there is no edge between its ends. */
export function borderLines(edges: readonly ClothEdge[], draft: Omit<BorderDraft, 'kind'>): BorderLines {
  const { facing } = draft;
  if (facing !== undefined) {
    const [own, other] = [facingWay(edges, draft, facing), facingWay(edges, facing, draft)];
    return own && other ? tearLines(own, other) : { stretches: places(own, other), hems: [] };
  }
  const ways = waysBetween(edges, draft);
  const stretch = ways && intoCloth(ways);
  // Points of the hem are in order from `from` to `to`, the stretch is in the loop's.
  return stretch ? stretchLines(stretch, stretch === ways[0] ? draft.along : draft.along.toReversed()) : NOTHING;
}

const NOTHING: BorderLines = { stretches: [], hems: [] };

function places(...stretches: readonly (Stretch | undefined)[]): Vec3[][] {
  return stretches.flatMap((stretch) => (stretch === undefined ? [] : [stretch.places]));
}

/** The two ways between the vertices nearest to two points, on the loop that is nearest to both: on from the first point, and on from the second. */
function waysBetween(edges: readonly ClothEdge[], { from, to }: EdgeEnds): readonly [Stretch, Stretch] | undefined {
  const near = edges.map((edge) => ({ edge, ends: [edge.nearest(from), edge.nearest(to)] as const }));
  const sum = ({ ends }: (typeof near)[number]): number => ends[0].distance + ends[1].distance;
  const [first, ...others] = near;
  if (first === undefined) {
    return undefined;
  }
  const { edge, ends } = others.reduce((best, each) => (sum(each) < sum(best) ? each : best), first);
  const [start, end] = [ends[0].vertex, ends[1].vertex];
  if (start === end) {
    return undefined;
  }
  return [new Stretch(edge, start, edge.ahead(start, end)), new Stretch(edge, end, edge.ahead(end, start))];
}

/** Of the two ways along a torn edge that which lies along the edge that faces it. */
function facingWay(edges: readonly ClothEdge[], own: EdgeEnds, { from, to }: EdgeEnds): Stretch | undefined {
  const ways = waysBetween(edges, own);
  const away = (stretch: Stretch): number =>
    stretch.places.reduce((sum, place) => sum + distanceToLine(place, from, to), 0) / (stretch.edges + 1);
  return ways && (away(ways[0]) <= away(ways[1]) ? ways[0] : ways[1]);
}

/** The hems that leave the first and the last vertex of a stretch. */
function hemsOf({ edge, from, to }: Stretch, edges: number): readonly [HemEnd, HemEnd] {
  return [
    { edge, vertex: from, step: -1, edges },
    { edge, vertex: to, step: 1, edges },
  ];
}

function stretchLines(stretch: Stretch, along: readonly Vec3[]): BorderLines {
  const [before, after] = hemsOf(stretch, stretch.rest);
  return { stretches: [stretch.places], hems: [hemLine(before, after, along)] };
}

/** The lips of one rip are mended as the rip, other torn edges by two hems from the one to the other. */
function tearLines(first: Stretch, second: Stretch): BorderLines {
  const stretches = [first.places, second.places];
  const isOneLoop = first.edge === second.edge;
  const rip = isOneLoop ? (ripBetween(first, second) ?? ripBetween(second, first)) : undefined;
  if (rip !== undefined) {
    return stretchLines(rip, []);
  }
  if (first.overlaps(second) || (!isOneLoop && first.edge.goesRound && second.edge.goesRound)) {
    return { stretches, hems: [] };
  }
  const between = (a: Stretch, b: Stretch): number => a.edge.ahead(a.to, b.from);
  // On one loop, the hem from one edge to the other belongs to both.
  const room = (stretch: Stretch): number =>
    isOneLoop ? Math.min(between(first, second), between(second, first)) : stretch.rest;
  const [before, after] = hemsOf(first, room(first));
  const [otherBefore, otherAfter] = hemsOf(second, room(second));
  const apart = (a: HemEnd, b: HemEnd): number => distanceOf(placeOf(a, 0), placeOf(b, 0));
  // A loop has the cloth on its left. Where both pieces show the same side, one loop runs along the gap against the other.
  const sameSide = apart(before, otherAfter) + apart(otherBefore, after);
  const otherSide = apart(before, otherBefore) + apart(otherAfter, after);
  const [next, last] = sameSide <= otherSide ? [otherAfter, otherBefore] : [otherBefore, otherAfter];
  return { stretches, hems: [hemLine(before, next), hemLine(last, after)] };
}

/** The rip whose lips are two stretches of one loop: what lies between them is its end. */
function ripBetween(from: Stretch, to: Stretch): Stretch | undefined {
  const { edge } = from;
  const end = new Stretch(edge, from.to, edge.ahead(from.to, to.from));
  const isShort = end.length <= END_OF_A_RIP * distanceOf(edge.place(end.from), edge.place(end.to));
  const rip = new Stretch(edge, from.from, from.edges + end.edges + to.edges);
  return isShort && rip.edges < edge.count && rip.isBite ? rip : undefined;
}
