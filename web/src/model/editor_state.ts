/** What the editor's state is made of. */
import type { AnchorFound, BorderCandidate, Loop, Report } from '../client.js';
import { type Choice, type ClothConstraints, NO_CONSTRAINTS } from './constraints.js';
import type { DraftKind } from './draft.js';
import type { GltfDocument } from './gltf_document.js';
import type { Patch } from './scan_session.js';

/** A state that undo can return to: what is filled, and how. It has the positions, so that it is shown at once. */
export interface Step extends Choice {
  /** What was done, for the buttons of undo and redo. */
  readonly label: string;
  readonly constraints: ClothConstraints;
  readonly patches: readonly Patch[];
  /** The middles of the scan's triangles that are cut out, `x, y, z` of each. */
  readonly cutFaces: readonly number[];
  readonly report: Report | undefined;
}

/** What a pointer on the new cloth does. */
export type Tool = 'look' | DraftKind;

/** The scan that is open. */
export interface OpenScan {
  readonly file: Blob;
  readonly name: string;
  readonly bytes: ArrayBuffer;
  readonly loops: readonly Loop[];
  /** Bites and rips at the cloth's own edge. */
  readonly candidates: readonly BorderCandidate[];
  readonly notes: readonly string[];
  /** The JSON of its glTF. */
  readonly document: GltfDocument;
}

/** Something that takes time, as shown to the person. */
export interface Work {
  readonly label: string;
  /** From 0 to 1; undefined while it is not known. */
  readonly share: number | undefined;
  readonly stop: AbortController;
}

/** Where the anchor search found a point's place. */
export interface FoundAnchor {
  readonly hole: number;
  readonly found: AnchorFound;
}

/** The state of a scan that was just opened. */
export const START: Step = {
  label: 'Open',
  holes: [],
  made: [],
  acceptDoubtful: false,
  selection: undefined,
  more: {},
  constraints: NO_CONSTRAINTS,
  patches: [],
  cutFaces: [],
  report: undefined,
};
