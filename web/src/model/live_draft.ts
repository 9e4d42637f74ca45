/** The gesture that is being made, and the cloth that the service answers while it is. */
import { Latest } from '../client.js';
import { type Draft, previewed } from './draft.js';
import type { Step } from './editor_state.js';
import type { Patch, ScanSession } from './scan_session.js';

/** What a draft is a change of, and who is told. */
interface Drafted {
  step(): Step;
  session(): ScanSession | undefined;
  changed(): void;
  report(error: unknown): void;
}

/** A draft is sent when the answer to the one before has come. */
export class LiveDraft {
  private made: Draft | undefined;
  private answered: readonly Patch[] | undefined;
  private asking = false;
  private readonly live = new Latest();

  constructor(private readonly drafted: Drafted) {}

  get draft(): Draft | undefined {
    return this.made;
  }

  /** The cloth as the service answered it last. */
  get patches(): readonly Patch[] | undefined {
    return this.answered;
  }

  /** Whether an answer is on its way. */
  get isAsking(): boolean {
    return this.asking;
  }

  show(draft: Draft): void {
    this.made = draft;
    this.drafted.changed();
    if (previewed(this.drafted.step().constraints, draft) !== undefined) {
      this.live.offer(() => this.ask(draft));
    }
  }

  drop(): void {
    this.made = undefined;
    this.answered = undefined;
    this.drafted.changed();
  }

  /** Forgets the draft that waits to be sent, and resolves when the answer to the one before has come. */
  settled(): Promise<void> {
    return this.live.settled();
  }

  private async ask(draft: Draft): Promise<void> {
    const [step, session] = [this.drafted.step(), this.drafted.session()];
    const constraints = previewed(step.constraints, draft);
    if (this.made !== draft || session === undefined || constraints === undefined) {
      return;
    }
    this.asking = true;
    try {
      const patches = await session.preview(step, constraints);
      if (this.made !== undefined && this.drafted.step() === step) {
        this.answered = patches;
      }
    } catch (error) {
      this.drafted.report(error);
    } finally {
      this.asking = false;
      this.drafted.changed();
    }
  }
}
