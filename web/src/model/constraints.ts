/** What a person asks of the new cloth, as the constraints of the contract. Values never change; edits make new ones. */
import type { Anchor, Constraints, Edit, Loop } from '../client.js';
import { isHole } from './loops.js';

/** Constraints without the choice of holes, which belongs to the session. */
export interface ClothConstraints {
  readonly anchors: readonly Anchor[];
  readonly edits: readonly Edit[];
}

/** The loops to fill. */
export interface Choice {
  /** By id, in order. */
  readonly holes: readonly number[];
  /** Whether patches that are no plausible cloth are applied, too. */
  readonly acceptDoubtful: boolean;
}

export const NO_CONSTRAINTS: ClothConstraints = { anchors: [], edits: [] };

/** The constraints that concern some holes; those that name no hole are kept. */
export function onHoles(constraints: ClothConstraints, holes: ReadonlySet<number>): ClothConstraints {
  const kept = (item: { hole?: number }): boolean => item.hole === undefined || holes.has(item.hole);
  return { anchors: constraints.anchors.filter(kept), edits: constraints.edits.filter(kept) };
}

/** The message for `POST /sessions/{id}/inpaint`. */
export function messageOf(constraints: ClothConstraints): Constraints {
  return {
    ...(constraints.anchors.length > 0 && { anchors: [...constraints.anchors] }),
    ...(constraints.edits.length > 0 && { edits: [...constraints.edits] }),
  };
}

/**
 * The choice of loops for `POST /sessions`. Holes are chosen by leaving the others out, so that one that cannot be filled is skipped; a loop
 * of another kind must be named, and the service then refuses it where it cannot be filled.
 */
export function selectionOf(loops: readonly Loop[], { holes: chosen, acceptDoubtful }: Choice): Constraints {
  const id = (loop: Loop): number => loop.id ?? 0;
  const holes = loops.filter(isHole).map(id);
  const named = loops.filter((loop) => !isHole(loop) && chosen.includes(id(loop))).map((loop) => ({ id: id(loop) }));
  const except = holes.filter((hole) => !chosen.includes(hole));
  return {
    ...(named.length > 0 && { holes: named }),
    // Where some are named, the holes are filled only if that is said, too.
    ...(named.length > 0 && except.length < holes.length && { fill: 'holes' }),
    ...(except.length > 0 && { except }),
    ...(acceptDoubtful && { acceptDoubtful }),
  };
}

/** The message for `POST /inpaint`, which does in one request what the editor shows. */
export function statelessMessageOf({ holes, acceptDoubtful }: Choice, constraints: ClothConstraints): Constraints {
  return {
    holes: holes.map((id) => ({ id })),
    ...(acceptDoubtful && { acceptDoubtful }),
    ...messageOf(constraints),
  };
}

/** A constraints file: the holes that it chooses by id, if any, and the rest. */
export interface ConstraintsFile {
  readonly holes: readonly number[] | undefined;
  readonly acceptDoubtful: boolean;
  readonly constraints: ClothConstraints;
}

/**
 * Reads constraints as JSON. The service checks the values; here only what the editor itself needs is checked.
 *
 * @throws When the text is not JSON, or has parts that the editor cannot show.
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
  const { holes, acceptDoubtful = false, anchors = [], edits = [], ...others } = value as Record<string, unknown>;
  const unknown = Object.keys(others);
  if (unknown.length > 0) {
    throw new Error(`The editor does not use: ${unknown.join(', ')}.`);
  }
  if (!isObjects(anchors) || !isObjects(edits)) {
    throw new Error('`anchors` and `edits` must be lists of objects.');
  }
  if (typeof acceptDoubtful !== 'boolean') {
    throw new Error('`acceptDoubtful` must be true or false.');
  }
  return { holes: holes === undefined ? undefined : holeIds(holes), acceptDoubtful, constraints: { anchors, edits } };
}

function holeIds(holes: unknown): number[] {
  if (!isObjects(holes)) {
    throw new Error('`holes` must be a list of objects.');
  }
  return holes.map((hole) => {
    const id = (hole as { id?: unknown }).id;
    if (typeof id !== 'number' || !Number.isInteger(id)) {
      throw new Error('The editor reads holes by `id` alone.');
    }
    return id;
  });
}

function isObjects(value: unknown): value is object[] {
  return Array.isArray(value) && value.every((item) => typeof item === 'object' && item !== null);
}
