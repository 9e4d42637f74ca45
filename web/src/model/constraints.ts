/** What a person asks of the new cloth, as the constraints of the contract. Values never change; edits make new ones. */
import type { Anchor, Border, Constraints, Cut, Edit, Loop, SessionHole } from '../client.js';
import { FILLS, isFill } from './fills.js';
import { isHole } from './loops.js';
import { TEXTURES, type Texture, isTexture } from './textures.js';

/** Constraints without the choice of holes, which belongs to the session. */
export interface ClothConstraints {
  readonly anchors: readonly Anchor[];
  readonly edits: readonly Edit[];
  /** Which of the plausible fills of each hole is applied, 0 the likeliest. */
  readonly alternative: number;
  /** Where the patches' colours come from. */
  readonly texture: Texture;
}

/** Cloth to cut out first, or a stretch of the cloth's own edge: an entry of `holes` that makes the hole that it fills. */
export type MadeHole = { readonly cut: Cut } | { readonly border: Border };

/** What to fill. */
export interface Choice {
  /** Loops by id, in order; those of made holes may be among them. */
  readonly holes: readonly number[];
  readonly made: readonly MadeHole[];
  /** Whether patches that are no plausible cloth are applied, too. */
  readonly acceptDoubtful: boolean;
  /** What a constraints file chooses in a way that has no control here, such as by size: then the service finds the holes, and this is kept for them. */
  readonly selection: Selection | undefined;
  /** Other members of a constraints file without a control, such as `weights` and `up`; the service checks them. */
  readonly more: Readonly<Record<string, unknown>>;
}

/** The members of constraints that choose holes, as a file has them. */
export type Selection = Readonly<Record<string, unknown>>;

/** Those beside `holes`. */
const SELECTING = ['fill', 'except', 'maxDiameter', 'minDiameter'] as const;

export const NO_CONSTRAINTS: ClothConstraints = { anchors: [], edits: [], alternative: 0, texture: undefined };

/**
 * Constraints on other holes than those they were made on: each goes with its hole, which is known by its rim, as a cut may change numbers. Those of
 * holes that are gone, or have another rim, are left out; those that name no hole are kept.
 */
export function carried(
  { anchors, edits, ...others }: ClothConstraints,
  before: readonly SessionHole[],
  after: readonly SessionHole[],
): ClothConstraints {
  const rimOf = ({ rimPositions = [] }: SessionHole): string => rimPositions.join();
  const byRim = new Map(after.map((hole) => [rimOf(hole), hole.id ?? 0]));
  const renamed = new Map(before.map((hole) => [hole.id ?? 0, byRim.get(rimOf(hole))]));
  const moved = <T extends { hole?: number }>(item: T): T[] => {
    const hole = item.hole === undefined ? undefined : renamed.get(item.hole);
    return item.hole === undefined ? [item] : hole === undefined ? [] : [{ ...item, hole }];
  };
  return { anchors: anchors.flatMap(moved), edits: edits.flatMap(moved), ...others };
}

/** The message for `POST /sessions/{id}/inpaint`. */
export function messageOf(constraints: ClothConstraints): Constraints {
  return {
    ...(constraints.anchors.length > 0 && { anchors: [...constraints.anchors] }),
    ...(constraints.edits.length > 0 && { edits: [...constraints.edits] }),
    ...(constraints.alternative > 0 && { alternative: constraints.alternative }),
    ...(constraints.texture !== undefined && { texture: constraints.texture }),
  };
}

/**
 * The choice of loops for `POST /sessions`. Holes are chosen by leaving the others out, so that one that cannot be filled is skipped; a loop
 * of another kind must be named, and the service then refuses it where it cannot be filled.
 */
export function selectionOf(
  loops: readonly Loop[],
  { holes: chosen, made, acceptDoubtful, selection, more }: Choice,
): Constraints {
  if (selection !== undefined) {
    return { ...selection, ...more, ...(acceptDoubtful && { acceptDoubtful }) };
  }
  const id = (loop: Loop): number => loop.id ?? 0;
  const holes = loops.filter(isHole).map(id);
  const others = loops.filter((loop) => !isHole(loop) && chosen.includes(id(loop))).map((loop) => ({ id: id(loop) }));
  const named = [...others, ...made];
  const except = holes.filter((hole) => !chosen.includes(hole));
  return {
    ...(named.length > 0 && { holes: named }),
    // Where some are named, the holes are filled only if that is said, too.
    ...(named.length > 0 && except.length < holes.length && { fill: 'holes' }),
    ...(except.length > 0 && { except }),
    ...more,
    ...(acceptDoubtful && { acceptDoubtful }),
  };
}

/** The message for `POST /inpaint`, which does in one request what the editor shows. */
export function statelessMessageOf(
  loops: readonly Loop[],
  { holes, made, acceptDoubtful, selection, more }: Choice,
  constraints: ClothConstraints,
): Constraints {
  // Of made holes the entries that make them are enough.
  const ofScan = holes.filter((id) => loops.some((loop) => (loop.id ?? 0) === id));
  return {
    ...(selection ?? { holes: [...ofScan.map((id) => ({ id })), ...made] }),
    ...more,
    ...(acceptDoubtful && { acceptDoubtful }),
    ...messageOf(constraints),
  };
}

/** A constraints file: the holes that it chooses by id, if it chooses any so, those that it makes, and the rest. */
export interface ConstraintsFile extends Omit<Choice, 'holes'> {
  readonly holes: readonly number[] | undefined;
  readonly constraints: ClothConstraints;
}

/**
 * Reads constraints as JSON. The service checks the values; here only what the editor itself needs is checked.
 *
 * @throws When the text is not JSON, or has parts of another form than the editor shows.
 */
export function readConstraints(text: string): ConstraintsFile {
  let value: unknown;
  try {
    value = JSON.parse(text);
  } catch (error) {
    throw new Error(`The constraints are not JSON: ${error instanceof Error ? error.message : String(error)}`);
  }
  if (typeof value !== 'object' || value === null || Array.isArray(value)) {
    throw new Error('The constraints must be a JSON object.');
  }
  const {
    holes,
    acceptDoubtful = false,
    anchors = [],
    edits = [],
    alternative = 0,
    texture,
    ...others
  } = value as Record<string, unknown>;
  if (!isObjects(anchors) || !isObjects(edits)) {
    throw new Error('`anchors` and `edits` must be lists of objects.');
  }
  if (typeof acceptDoubtful !== 'boolean') {
    throw new Error('`acceptDoubtful` must be true or false.');
  }
  if (!isFill(alternative)) {
    throw new Error(`\`alternative\` must be a whole number from 0 to ${FILLS - 1}.`);
  }
  if (!isTexture(texture)) {
    throw new Error(`\`texture\` must be one of ${TEXTURES.map(([name]) => name).join(', ')}.`);
  }
  const isSelecting = (name: string): boolean => (SELECTING as readonly string[]).includes(name);
  const entries = Object.entries(others);
  const selecting = Object.fromEntries(entries.filter(([name]) => isSelecting(name)));
  const more = Object.fromEntries(entries.filter(([name]) => !isSelecting(name)));
  const { isOwn, ...chosen } = chosenHoles(holes);
  const selection =
    isOwn && Object.keys(selecting).length === 0 ? undefined : { ...(holes !== undefined && { holes }), ...selecting };
  return { ...chosen, acceptDoubtful, selection, more, constraints: { anchors, edits, alternative, texture } };
}

/** What a file fills: where it chooses no holes those that are filled now, if any, otherwise all. */
export function choiceOf(
  { holes, made, acceptDoubtful, selection, more }: ConstraintsFile,
  step: Choice,
  loops: readonly Loop[],
): Choice {
  const all = loops.filter(isHole).map((loop) => loop.id ?? 0);
  const chosen = holes ?? (step.holes.length > 0 ? step.holes : all);
  return { holes: [...chosen].sort((a, b) => a - b), made, acceptDoubtful, selection, more };
}

/** The holes that a file names, and whether all are named in ways that the editor has itself. */
function chosenHoles(holes: unknown): Pick<ConstraintsFile, 'holes' | 'made'> & { readonly isOwn: boolean } {
  if (holes === undefined) {
    return { holes: undefined, made: [], isOwn: true };
  }
  if (!isObjects(holes)) {
    throw new Error('`holes` must be a list of objects.');
  }
  const ids: number[] = [];
  const made: MadeHole[] = [];
  let isOwn = true;
  for (const hole of holes as { id?: unknown; cut?: Cut; border?: Border | 'auto' }[]) {
    if (typeof hole.id === 'number' && Number.isInteger(hole.id)) {
      ids.push(hole.id);
    } else if (typeof hole.cut === 'object') {
      made.push({ cut: hole.cut });
    } else if (hole.border === 'auto') {
      made.push({ border: { auto: true } });
    } else if (typeof hole.border === 'object') {
      made.push({ border: hole.border });
    } else {
      // Such as `near`: the service says which hole that is.
      isOwn = false;
    }
  }
  return { holes: ids, made, isOwn };
}

function isObjects(value: unknown): value is object[] {
  return Array.isArray(value) && value.every((item) => typeof item === 'object' && item !== null);
}
