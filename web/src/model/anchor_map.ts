/** The map of an anchor search while it comes: the loss of every cell of a hole. */
import type { MapPiece, Vec3 } from '../client.js';

/** Cells of a grid. */
const CELLS = 64 * 64;

/** The cells of a map that are known so far. */
export class AnchorMap {
  /** By index `64 j + i`; null outside the hole, and where it is not known yet. */
  readonly losses: (number | null)[] = Array.from({ length: CELLS }, () => null);
  private known = 0;
  private total: number | undefined;
  private readonly stopped = new AbortController();

  constructor(
    readonly hole: number,
    /** The point whose place is searched. */
    readonly target: Vec3,
  ) {}

  /** Aborted when it is stopped. */
  get signal(): AbortSignal {
    return this.stopped.signal;
  }

  /** From 0 to 1. */
  get share(): number {
    return this.total === undefined ? 0 : Math.min(this.known / Math.max(this.total, 1), 1);
  }

  /** Whether cells still come. */
  get isComing(): boolean {
    return !this.signal.aborted && (this.total === undefined || this.known < this.total);
  }

  add({ cells = [], losses = [], total = 0 }: MapPiece): void {
    cells.forEach((cell, at) => (this.losses[cell] = losses[at] ?? null));
    this.known += cells.length;
    this.total = total;
  }

  stop(): void {
    this.stopped.abort();
  }
}
