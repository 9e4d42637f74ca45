/** Keeps one request in flight while a hand drags, and sends the newest when it is answered. */

/**
 * Runs one task at a time. A task that comes while another runs waits, and takes the place of one that waited before. So every answer
 * is used, which would not be so if each new task stopped the one before it.
 */
export class Latest {
  private running: Promise<void> | undefined;
  private waiting: (() => Promise<void>) | undefined;

  /** Runs a task now, or after the one that runs. Its errors are its own to handle. */
  offer(task: () => Promise<void>): void {
    if (this.running !== undefined) {
      this.waiting = task;
      return;
    }
    this.running = this.run(task);
  }

  /** Forgets the task that waits and resolves when the one that runs has ended. */
  async settled(): Promise<void> {
    this.waiting = undefined;
    await this.running;
  }

  private async run(first: () => Promise<void>): Promise<void> {
    for (let task: (() => Promise<void>) | undefined = first; task !== undefined;) {
      await task();
      task = this.waiting;
      this.waiting = undefined;
    }
    this.running = undefined;
  }
}
