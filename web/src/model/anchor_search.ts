/** Where on a hole's chart a point in space belongs, and the map of that search. */
import type { AnchorFound, MapPiece, Progress, Uv, Vec3 } from '../client.js';
import { AnchorMap } from './anchor_map.js';
import type { AnchorDraft } from './draft.js';
import type { FoundAnchor, Step } from './editor_state.js';
import type { ScanSession } from './scan_session.js';

/** What is searched in, and who is told. */
interface Searched {
  step(): Step;
  session(): ScanSession | undefined;
  changed(): void;
  say(message: string): void;
  report(error: unknown): void;
}

export class AnchorSearch {
  private last: FoundAnchor | undefined;
  private drawn: AnchorMap | undefined;

  constructor(private readonly searched: Searched) {}

  /** Where the last point belongs. */
  get found(): FoundAnchor | undefined {
    return this.last;
  }

  /** The map that was asked for last. */
  get map(): AnchorMap | undefined {
    return this.drawn;
  }

  /** Finds the place of an anchor. A map of another point is forgotten. */
  async find({ hole, position }: AnchorDraft, progress: Progress): Promise<Uv | undefined> {
    if (this.drawn !== undefined && this.drawn.target.join() !== position.join()) {
      this.dropMap();
    }
    const query = { hole, target: [...position] };
    const found = await this.searched.session()?.optimizeAnchor(this.searched.step(), query, progress);
    if (found === undefined) {
      return undefined;
    }
    this.last = { hole, found };
    this.searched.say(`Found after ${found.evaluations} evaluations of the network.`);
    return found.uv as Uv | undefined;
  }

  /** Draws the map while its cells come. Everything else can be done meanwhile. */
  async drawMap({ hole, position }: { readonly hole: number; readonly position: Vec3 }): Promise<void> {
    this.stopMap();
    const map = new AnchorMap(hole, position);
    this.drawn = map;
    this.searched.say('The map is being drawn.');
    try {
      const events = {
        onFound: (found: AnchorFound): void => {
          this.last = { hole, found };
          this.searched.changed();
        },
        onMap: (piece: MapPiece): void => {
          map.add(piece);
          this.searched.changed();
        },
      };
      const query = { hole, target: [...position] };
      await this.searched.session()?.anchorMap(this.searched.step(), query, events, { signal: map.signal });
      this.searched.say('The map is complete.');
    } catch (error) {
      map.stop();
      this.searched.report(error);
    }
  }

  /** Ends the map that is being drawn; what is known of it stays. */
  stopMap(): void {
    if (this.drawn?.isComing) {
      this.drawn.stop();
      this.searched.say('The map is stopped.');
    }
  }

  /** Forgets what was found, and the map. */
  forget(): void {
    this.last = undefined;
    this.dropMap();
  }

  private dropMap(): void {
    this.drawn?.stop();
    this.drawn = undefined;
  }
}
