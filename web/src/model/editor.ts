/** What the editor knows and does, without a page: the scan, its holes, the session, every step and what was chosen. */
import {
  type HoleReport,
  type Info,
  ProblemError,
  type Progress,
  type Service,
  type Skipped,
  type Uv,
  describeError,
  isAbort,
} from '../client.js';
import type { AnchorMap } from './anchor_map.js';
import { AnchorSearch } from './anchor_search.js';
import { hasChart } from './cloth.js';
import {
  type Choice,
  type ClothConstraints,
  type MadeHole,
  carried,
  choiceOf,
  readConstraints,
  statelessMessageOf,
} from './constraints.js';
import {
  type AnchorDraft,
  type Draft,
  FIRST_RADIUS,
  NAMES,
  isMaking,
  madeBy,
  withAnchor,
  withGesture,
} from './draft.js';
import { type FoundAnchor, type OpenScan, START, type Step, type Tool, type Work } from './editor_state.js';
import { isFill } from './fills.js';
import { documentOf } from './gltf_document.js';
import { History } from './history.js';
import { LiveDraft } from './live_draft.js';
import { foundInWords, isHole } from './loops.js';
import { stepInWords, withControls } from './report.js';
import { fetchedScan } from './scan_files.js';
import { type Patch, ScanSession } from './scan_session.js';
import type { Texture } from './textures.js';
import { type Variation, WantedVariation } from './variation.js';

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
  /** Whether the last mend was refused because its patches are no plausible cloth. */
  isRefusedAsDoubtful = false;
  /** The loops that the service left as they were at the last mend, with why. */
  skipped: readonly Skipped[] = [];
  tool: Tool = 'look';
  /** The radius of the next twist, on the chart. */
  twistRadius = FIRST_RADIUS;
  work: Work | undefined;
  /** The last error, until the next action. */
  problem: string | undefined;
  /** The last result in words, for everybody and for screen readers. */
  message = '';

  private history = new History<Step>(START);
  private session: ScanSession | undefined;
  private readonly hand = new LiveDraft({
    step: () => this.step,
    session: () => this.session,
    changed: () => this.changed(),
    report: (error) => this.report(error),
  });
  private readonly search = new AnchorSearch({
    step: () => this.step,
    session: () => this.session,
    changed: () => this.changed(),
    say: (message) => this.say(message),
    report: (error) => this.report(error),
  });
  private readonly wanted = new WantedVariation({
    step: () => this.step,
    isBusy: () => this.work !== undefined,
    apply: (label, constraints) => this.apply(label, this.step, constraints),
  });
  private readonly limits: Promise<Info | undefined>;

  constructor(private readonly service: Service) {
    super();
    this.limits = service.info().catch(() => undefined);
  }

  get step(): Step {
    return this.history.present;
  }

  /** The gesture that is being made. */
  get draft(): Draft | undefined {
    return this.hand.draft;
  }

  /** The cloth of the draft as the service answered it last. */
  get draftPatches(): readonly Patch[] | undefined {
    return this.hand.patches;
  }

  /** Whether cloth of the draft is on its way. */
  get isAsking(): boolean {
    return this.hand.isAsking;
  }

  /** Of the last anchor search. */
  get found(): FoundAnchor | undefined {
    return this.search.found;
  }

  /** The map that was asked for last. */
  get map(): AnchorMap | undefined {
    return this.search.map;
  }

  /** The patches that take gestures and anchors: those with a chart. */
  get editable(): readonly Patch[] {
    return this.step.patches.filter(hasChart);
  }

  /** The plausible fill that is shown, or the one that is waited for: 0 is the likeliest. */
  get alternative(): number {
    return this.wanted.newest.alternative;
  }

  /** Where the new cloth's colour comes from, or that which is waited for. */
  get texture(): Texture {
    return this.wanted.newest.texture;
  }

  /** Whether another fill or colour can be chosen: something is mended, and nothing else is under way. */
  get canVary(): boolean {
    return this.step.patches.length > 0 && (this.work === undefined || this.wanted.isWaiting);
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
      const { loops = [], candidates = [], notes = [] } = await this.service.holes(file, progress);
      this.session?.close();
      this.scan = { file, name, bytes, loops, candidates, notes, document: documentOf(bytes) };
      this.session = new ScanSession(this.service, this.scan);
      this.history = new History<Step>(START);
      this.chosen = new Set(loops.filter(isHole).map((loop) => loop.id ?? 0));
      this.skipped = [];
      this.acceptDoubtful = this.isRefusedAsDoubtful = false;
      this.search.forget();
      this.dropDraft();
      this.message = `${name} is open: ${foundInWords(loops, candidates.length)}.`;
      this.dispatchEvent(new Event('opened'));
    });
  }

  /** Opens a scan from an address that the person named. */
  async openAddress(address: URL): Promise<void> {
    const name = decodeURIComponent(address.pathname.split('/').pop() ?? '') || address.host;
    let file: Blob | undefined;
    await this.working(`Loading ${name}`, async ({ signal }) => {
      file = await fetchedScan(address, signal);
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
    await this.fill(`Mend ${count}`, { ...this.step, holes, acceptDoubtful, selection: undefined });
  }

  /** Mends a hole that an entry of `holes` makes, beside what is filled already. */
  async make(label: string, entry: MadeHole): Promise<void> {
    const { step, acceptDoubtful } = this;
    await this.fill(label, { ...step, made: [...step.made, entry], acceptDoubtful, selection: undefined });
  }

  /** Takes back a made hole: cloth that was cut out is there again. */
  async unmake(entry: MadeHole): Promise<void> {
    const { step } = this;
    const made = step.made.filter((it) => it !== entry);
    // The numbers of made holes mean nothing without them.
    const holes = step.holes.filter((id) => this.scan?.loops.some((loop) => loop.id === id));
    if (holes.length + made.length === 0) {
      this.history.push({ ...START, label: 'Put back' });
      this.say('Put back: nothing is mended.');
    } else {
      await this.fill('Put back', { ...step, holes, made, selection: undefined });
    }
  }

  /** Shows a gesture while it is made: sends it when the answer to the one before has come. An anchor's place is found only at its commit. */
  preview(draft: Draft): void {
    if (draft.kind === 'twist') {
      this.twistRadius = draft.radius;
    }
    this.hand.show(draft);
  }

  /** Chooses the radius of the twist that is made, or of the next one. */
  setTwistRadius(radius: number): void {
    const { draft } = this;
    if (draft?.kind === 'twist') {
      this.preview({ ...draft, radius });
    } else {
      this.twistRadius = radius;
      this.say(`Twist: radius ${radius.toFixed(3)} of the chart.`);
    }
  }

  /** Makes the draft a step. */
  async commit(): Promise<void> {
    const { draft } = this;
    if (draft === undefined) {
      return;
    }
    if (isMaking(draft)) {
      await this.make(NAMES[draft.kind], madeBy(draft));
    } else if (draft.kind === 'anchor' && draft.uv !== undefined) {
      await this.apply('Move anchor', this.step, withAnchor(this.step.constraints, draft, draft.uv));
    } else if (draft.kind === 'anchor') {
      await this.placeAnchor(draft);
    } else {
      const constraints = withGesture(this.step.constraints, draft);
      await this.apply(NAMES[draft.kind], this.step, constraints);
    }
  }

  /** Forgets the draft. */
  dropDraft(): void {
    this.hand.drop();
  }

  /** Shows another of the plausible fills of the mended holes. */
  async chooseFill(alternative: number): Promise<void> {
    if (isFill(alternative)) {
      await this.vary({ alternative });
    }
  }

  /** Chooses a fill, or where the colour comes from, for all mended holes. One request is in flight, and the newest choice waits. */
  async vary(change: Partial<Variation>): Promise<void> {
    if (this.canVary) {
      const shown = this.wanted.choose(change);
      this.changed();
      await shown;
      this.changed();
    }
  }

  /** Draws the map of an anchor search while its cells come. Everything else can be done meanwhile. */
  async drawMap(draft: AnchorDraft): Promise<void> {
    this.problem = undefined;
    await this.search.drawMap(draft);
  }

  /** Ends the map that is being drawn; what is known of it stays. */
  stopMap(): void {
    this.search.stopMap();
  }

  /** Searches the place of an anchor and adds it as a step. */
  private async placeAnchor(draft: AnchorDraft): Promise<void> {
    let uv: Uv | undefined;
    await this.working('Searching', async (progress) => {
      uv = await this.search.find(draft, progress);
    });
    if (uv !== undefined) {
      const constraints = withAnchor(this.step.constraints, draft, uv);
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
    const message = statelessMessageOf(this.scan?.loops ?? [], this.step, this.step.constraints);
    return JSON.stringify(message, undefined, 2);
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
    const choice = choiceOf(file, this.step, this.scan?.loops ?? []);
    this.acceptDoubtful = choice.acceptDoubtful;
    await this.apply('Load constraints', choice, file.constraints);
    this.choose(new Set(this.step.holes));
  }

  /** The whole scan as shown: the bytes of one `POST /inpaint` of the same constraints. */
  async result(): Promise<Blob | undefined> {
    let result: Blob | undefined;
    await this.working('Saving', async (progress) => {
      const { holes, constraints } = this.step;
      result = await this.session?.result(this.step, constraints, progress);
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
      this.isRefusedAsDoubtful = error instanceof ProblemError && error.code === 'no_plausible_fill';
      this.problem = withControls(describeError(error));
      this.changed();
    }
  }

  /** Clears the last error. */
  clearProblem(): void {
    this.problem = undefined;
    this.changed();
  }

  /** Fills other holes than now, the constraints of the present step on those that stay. */
  private async fill(label: string, choice: Choice): Promise<void> {
    const { step, draft } = this;
    await this.working(label, async (progress) => {
      const { session } = this;
      if (session !== undefined) {
        const holes = await session.holes(choice, progress);
        const constraints = carried(
          step.constraints,
          step.patches.map((patch) => patch.hole),
          holes,
        );
        await this.take(label, { choice, constraints }, progress);
        this.dispatchEvent(new Event('mended'));
      }
    });
    // A cut or a border that is refused can be changed.
    if (this.step !== step || draft === undefined || !isMaking(draft)) {
      this.dropDraft();
    }
  }

  /** Fills holes under constraints. */
  private async apply(label: string, choice: Choice, constraints: ClothConstraints): Promise<void> {
    const { step } = this;
    await this.working(label, async (progress) => {
      if (choice.selection !== undefined || choice.holes.length + choice.made.length > 0) {
        await this.take(label, { choice, constraints }, progress);
        this.dispatchEvent(new Event('edited'));
      }
    });
    // What is refused can be changed.
    if (this.step !== step) {
      this.dropDraft();
    }
  }

  /** Asks the service for a state and makes it a step. */
  private async take(
    label: string,
    { choice, constraints }: { choice: Choice; constraints: ClothConstraints },
    progress: Progress,
  ): Promise<void> {
    const { session } = this;
    if (session === undefined) {
      return;
    }
    const { patches, report } = await session.mend(choice, constraints, progress);
    const { skipped, cutFaces } = session;
    this.skipped = skipped;
    const holes = patches.map((patch) => patch.hole.id ?? 0);
    const { made, acceptDoubtful, selection, more } = choice;
    const chosen = { holes, made, acceptDoubtful, selection, more };
    this.history.push({ label, ...chosen, constraints, patches, cutFaces, report });
    this.message = stepInWords(this.history.present);
  }

  private travel(move: () => void, word: string): void {
    const before = this.step;
    if (this.work !== undefined) {
      return;
    }
    move();
    if (this.step !== before) {
      this.message = `${word}. Now: ${this.step.label}.`;
      this.search.forget();
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
      await this.hand.settled();
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
