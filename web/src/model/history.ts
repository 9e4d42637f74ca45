/** Undo and redo as a list of states. */

/** States in the order they were made, and which one is shown. */
export class History<State> {
  private readonly states: State[];
  private at = 0;

  constructor(first: State) {
    this.states = [first];
  }

  get present(): State {
    return this.states[this.at] as State;
  }

  get canUndo(): boolean {
    return this.at > 0;
  }

  get canRedo(): boolean {
    return this.at + 1 < this.states.length;
  }

  /** The state that `redo` would show. */
  get next(): State | undefined {
    return this.states[this.at + 1];
  }

  /** Adds a state after the present one; what was undone before is forgotten. */
  push(state: State): void {
    this.states.length = this.at + 1;
    this.states.push(state);
    this.at += 1;
  }

  undo(): void {
    this.at = Math.max(this.at - 1, 0);
  }

  redo(): void {
    this.at = Math.min(this.at + 1, this.states.length - 1);
  }
}
