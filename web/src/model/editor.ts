/** What the editor knows and does, without a page: the scan, its holes, the session, every step and what was chosen. */
import {
  type AnchorFound,
  type HoleReport,
  type Info,
  type Loop,
  type Progress,
  type Report,
  type Service,
  type Skipped,
  type Uv,
  Latest,
  describeError,
  isAbort,
} from '../client.js';
import { hasChart } from './cloth.js';
import {
  type Choice,
  type ClothConstraints,
  NO_CONSTRAINTS,
  messageOf,
  onHoles,
  readConstraints,
  statelessMessageOf,
} from './constraints.js';
import { type AnchorDraft, type Draft, type DraftKind, NAMES, withAnchor, withGesture } from './draft.js';
import { History } from './history.js';
import { isHole } from './loops.js';
import { type Patch, ScanSession } from './scan_session.js';

/** A state that undo can return to: what is filled, and how. It has the positions, so that it is shown at once. */
export interface Step extends Choice {
  /** What was done, for the buttons of undo and redo. */
  readonly label: string;
  readonly constraints: ClothConstraints;
  readonly patches: readonly Patch[];
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
  readonly notes: readonly string[];
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

const START: Step = {
  label: 'Open',
  holes: [],
  acceptDoubtful: false,
  constraints: NO_CONSTRAINTS,
  patches: [],
  report: undefined,
};

/**
 * The editor's state. It emits `change` whenever something shown has changed, `opened` after another scan was opened, `mended` after holes
 * were filled, and `edited` after the new cloth was changed.
 */
export class Editor extends EventTarget {
  scan: OpenScan | undefined;
  /** The loops chosen in the panel, by id. */
  chosen: ReadonlySet<number> = new Set();
  /** Whether the next mend applies patches that are no plausible cloth. */
  acceptDoubtful = false;
  /** The loops that the service left as they were at the last mend, with why. */
  skipped: readonly Skipped[] = [];
  tool: Tool = 'look';
  /** The gesture that is being made, and the cloth as the service answered it last. */
  draft: Draft | undefined;
  draftPatches: readonly Patch[] | undefined;
  /** Of the last anchor search. */
  found: FoundAnchor | undefined;
  work: Work | undefined;
  /** The last error, until the next action. */
  problem: string | undefined;
  /** The last result in words, for everybody and for screen readers. */
  message = '';

  private history = new History<Step>(START);
  private session: ScanSession | undefined;
  private readonly live = new Latest();
  private readonly limits: Promise<Info | undefined>;

  constructor(private readonly service: Service) {
    super();
    this.limits = service.info().catch(() => undefined);
  }

  get step(): Step {
    return this.history.present;
  }

  /** The patches that take gestures and anchors: those with a chart. */
  get editable(): readonly Patch[] {
    return this.step.patches.filter(hasChart);
  }

  /** The patches to show: those of the draft while there is one. */
  get patches(): readonly Patch[] {
    return this.draftPatches ?? this.step.patches;
  }

  get undoLabel(): string | undefined {
    return this.history.canUndo ? this.history.present.label : undefined;
  }

  get redoLabel(): string | undefined {
    return this.history.next?.label;
  }

  /** What was done to fill a hole of the present step. */
  reportOf(hole: number): HoleReport | undefined {
    return this.step.report?.holes?.find((report) => report.id === hole);
  }

  /** Opens a scan in place of the one before. */
  async open(file: Blob, name: string): Promise<void> {
    await this.working(`Sending ${name}`, async (progress) => {
      const limit = (await this.limits)?.limits.bodyBytes;
      // The form's own lines around the scan count, too.
      if (limit !== undefined && file.size + 4096 > limit) {
        throw new Error(`${name} has ${file.size} bytes; this service takes at most ${limit}.`);
      }
      const bytes = await file.arrayBuffer();
      const { loops = [], notes = [] } = await this.service.holes(file, progress);
      this.session?.close();
      this.session = new ScanSession(this.service, file, loops);
      this.scan = { file, name, bytes, loops, notes };
      this.history = new History<Step>(START);
      this.chosen = new Set(loops.filter(isHole).map((loop) => loop.id ?? 0));
      this.skipped = [];
      this.acceptDoubtful = false;
      this.found = undefined;
      this.dropDraft();
      const holes = this.chosen.size;
      this.message = `${name} is open: ${holes} ${holes === 1 ? 'hole' : 'holes'} in ${loops.length} boundary loops.`;
      this.dispatchEvent(new Event('opened'));
    });
  }

  /** Opens a scan from an address that the person named. */
  async openAddress(address: URL): Promise<void> {
    const name = decodeURIComponent(address.pathname.split('/').pop() ?? '') || address.host;
    let file: Blob | undefined;
    await this.working(`Loading ${name}`, async ({ signal }) => {
      const response = await fetch(address, { signal: signal ?? null });
      if (!response.ok) {
        throw new Error(`${address.href} answered with status ${response.status}.`);
      }
      file = new Blob([await response.arrayBuffer()], { type: 'model/gltf-binary' });
    });
    if (file !== undefined) {
      await this.open(file, name);
    }
  }

  /** Chooses loops in the panel. */
  choose(loops: ReadonlySet<number>): void {
    this.chosen = loops;
    this.changed();
  }

  /** Chooses whether the next mend applies patches that are no plausible cloth. */
  setAcceptDoubtful(accept: boolean): void {
    this.acceptDoubtful = accept;
    this.changed();
  }

  /** Fills the chosen holes, and keeps those already filled that are still chosen. */
  async mend(): Promise<void> {
    const holes = [...this.chosen].sort((a, b) => a - b);
    const count = `${holes.length} ${holes.length === 1 ? 'hole' : 'holes'}`;
    const { acceptDoubtful } = this;
    const constraints = onHoles(this.step.constraints, this.chosen);
    await this.apply(`Mend ${count}`, { holes, acceptDoubtful }, constraints, 'mended');
  }

  /** Shows a gesture while it is made: sends it when the answer to the one before has come. An anchor's place is found only at its commit. */
  preview(draft: Draft): void {
    this.draft = draft;
    this.changed();
    if (draft.kind === 'anchor') {
      return;
    }
    this.live.offer(async () => {
      const { step, session } = this;
      if (this.draft !== draft || session === undefined) {
        return;
      }
      try {
        const patches = await session.preview(step, messageOf(withGesture(step.constraints, draft)));
        if (this.draft !== undefined && this.step === step) {
          this.draftPatches = patches;
          this.changed();
        }
      } catch (error) {
        this.report(error);
      }
    });
  }

  /** Makes the draft a step. */
  async commit(): Promise<void> {
    const { draft } = this;
    if (draft === undefined) {
      return;
    }
    if (draft.kind === 'anchor') {
      await this.placeAnchor(draft);
    } else {
      const constraints = withGesture(this.step.constraints, draft);
      await this.apply(NAMES[draft.kind], this.step, constraints);
    }
  }

  /** Forgets the draft. */
  dropDraft(): void {
    this.draft = undefined;
    this.draftPatches = undefined;
    this.changed();
  }

  /**
   * Finds where on a hole's chart a point in space belongs.
   *
   * @param map - Whether the loss of every cell is asked for, which takes longer.
   */
  async findAnchor({ hole, position }: AnchorDraft, map: boolean): Promise<FoundAnchor | undefined> {
    let result: FoundAnchor | undefined;
    await this.working(map ? 'Drawing the map' : 'Searching', async (progress) => {
      const query = { hole, target: [...position], map };
      const found = await this.session?.optimizeAnchor(this.step, query, progress);
      if (found !== undefined) {
        result = { hole, found };
        this.found = result;
        this.message = `Found after ${found.evaluations} evaluations of the network.`;
      }
    });
    return result;
  }

  /** Searches the place of an anchor and adds it as a step. */
  private async placeAnchor(draft: AnchorDraft): Promise<void> {
    const uv = (await this.findAnchor(draft, false))?.found.uv;
    if (uv !== undefined) {
      const constraints = withAnchor(this.step.constraints, draft, uv as Uv);
      await this.apply(draft.hard ? 'Hard anchor' : NAMES.anchor, this.step, constraints);
    }
  }

  undo(): void {
    this.travel(() => this.history.undo(), 'Undone');
  }

  redo(): void {
    this.travel(() => this.history.redo(), 'Redone');
  }

  setTool(tool: Tool): void {
    this.tool = tool;
    this.dropDraft();
  }

  /** The constraints of the present step, as `POST /inpaint` takes them. */
  constraintsText(): string {
    return JSON.stringify(statelessMessageOf(this.step, this.step.constraints), undefined, 2);
  }

  /** Applies constraints that were copied or saved before. */
  async loadConstraints(text: string): Promise<void> {
    let file;
    try {
      file = readConstraints(text);
    } catch (error) {
      this.report(error);
      return;
    }
    const { scan, step } = this;
    const all = (scan?.loops ?? []).filter(isHole).map((loop) => loop.id ?? 0);
    const holes = [...(file.holes ?? (step.holes.length > 0 ? step.holes : all))].sort((a, b) => a - b);
    this.acceptDoubtful = file.acceptDoubtful;
    await this.apply('Load constraints', { holes, acceptDoubtful: file.acceptDoubtful }, file.constraints);
    this.choose(new Set(this.step.holes));
  }

  /** The whole scan as shown: the bytes of one `POST /inpaint` of the same constraints. */
  async result(): Promise<Blob | undefined> {
    let result: Blob | undefined;
    await this.working('Saving', async (progress) => {
      const { holes, constraints } = this.step;
      result = await this.session?.result(this.step, messageOf(constraints), progress);
      this.message = `Saved with ${holes.length} filled ${holes.length === 1 ? 'hole' : 'holes'}.`;
    });
    return result;
  }

  /** Tells the person something. */
  say(message: string): void {
    this.message = message;
    this.changed();
  }

  /** Shows an error to the person. */
  report(error: unknown): void {
    if (!isAbort(error)) {
      this.problem = describeError(error);
      this.changed();
    }
  }

  /** Clears the last error. */
  clearProblem(): void {
    this.problem = undefined;
    this.changed();
  }

  /** Asks the service for a state and makes it a step. */
  private async apply(
    label: string,
    choice: Choice,
    constraints: ClothConstraints,
    event: 'mended' | 'edited' = 'edited',
  ): Promise<void> {
    await this.working(label, async (progress) => {
      if (this.session === undefined || choice.holes.length === 0) {
        return;
      }
      const { patches, report } = await this.session.mend(choice, messageOf(constraints), progress);
      this.skipped = this.session.skipped;
      const holes = patches.map((patch) => patch.hole.id ?? 0);
      const { acceptDoubtful } = choice;
      this.history.push({ label, holes, acceptDoubtful, constraints, patches, report });
      this.message = this.messageOfStep(label, this.history.present);
      this.dispatchEvent(new Event(event));
    });
    this.dropDraft();
  }

  private messageOfStep(label: string, step: Step): string {
    const faces = step.patches.reduce((sum, patch) => sum + (patch.hole.patchFaces?.length ?? 0) / 3, 0);
    return `${label}: ${step.patches.length} filled, ${faces.toLocaleString('en')} new triangles.`;
  }

  private travel(move: () => void, word: string): void {
    const before = this.step;
    if (this.work !== undefined) {
      return;
    }
    move();
    if (this.step !== before) {
      this.message = `${word}. Now: ${this.step.label}.`;
      this.found = undefined;
      this.problem = undefined;
    }
    this.dropDraft();
  }

  /** Runs a task that takes time, and shows its progress and its error. One at a time: a new one stops the one before. */
  private async working(label: string, task: (progress: Progress) => Promise<void>): Promise<void> {
    this.work?.stop.abort();
    const stop = new AbortController();
    const show = (text: string, share: number | undefined): void => {
      if (!stop.signal.aborted) {
        this.work = { label: text, share, stop };
        this.changed();
      }
    };
    this.problem = undefined;
    show(label, undefined);
    try {
      // A gesture's last preview must not come after the answer to this.
      await this.live.settled();
      await task({
        signal: stop.signal,
        onSent: (share) => show(share < 1 ? label : 'Computing', share < 1 ? share : undefined),
        onWait: (seconds) => show(`The service is busy; waiting ${seconds} s`, undefined),
      });
    } catch (error) {
      this.report(error);
    } finally {
      if (this.work?.stop === stop) {
        this.work = undefined;
      }
      this.changed();
    }
  }

  private changed(): void {
    this.dispatchEvent(new Event('change'));
  }
}
