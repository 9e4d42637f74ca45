/** How the picture is drawn while it moves: with fewer pixels as long as frames take long. */

/** Milliseconds from the draw calls of a frame to its pixels: where they take more than the first, fewer are drawn; less than the second, more again. */
const SLOW = 20;
const FAST = 8;
/** How many frames tell how long one takes: their median, which a busy moment of the machine does not move. */
const FRAMES = 5;

/** Chooses among ways to draw, from the best one to the fastest, by how long frames take. */
export class Pace {
  private chosen = 0;
  /** Of the newest frames drawn in this way. */
  private times: number[] = [];

  /** @param ways - How many ways there are. */
  constructor(private readonly ways: number) {}

  /** The way to draw the next frame, from 0. */
  get way(): number {
    return this.chosen;
  }

  /** Takes note of a frame that took so many milliseconds. */
  took(time: number): void {
    this.times = [...this.times, time].slice(-FRAMES);
    const usual = this.times.toSorted((a, b) => a - b)[(FRAMES - 1) / 2];
    if (this.times.length < FRAMES || usual === undefined) {
      return;
    }
    if (usual > SLOW && this.chosen + 1 < this.ways) {
      this.go(this.chosen + 1);
    } else if (usual < FAST && this.chosen > 0) {
      this.go(this.chosen - 1);
    }
  }

  private go(way: number): void {
    this.chosen = way;
    this.times = [];
  }
}
