/** What is chosen of all holes at once: which of the plausible fills, and where the colour comes from. */
import type { ClothConstraints } from './constraints.js';
import { fillName } from './fills.js';
import { textureName } from './textures.js';

export type Variation = Pick<ClothConstraints, 'alternative' | 'texture'>;

/** What is varied. */
interface Varied {
  step(): { readonly constraints: ClothConstraints };
  isBusy(): boolean;
  /** Makes constraints on the holes of the present step a step of their own. */
  apply(label: string, constraints: ClothConstraints): Promise<void>;
}

/** The variation that is wanted: one request is in flight, and the newest choice waits. */
export class WantedVariation {
  private wanted: Variation | undefined;

  constructor(private readonly varied: Varied) {}

  /** Whether something was chosen that is no step yet. */
  get isWaiting(): boolean {
    return this.wanted !== undefined;
  }

  /** What was chosen last. */
  get newest(): Variation {
    return this.wanted ?? this.varied.step().constraints;
  }

  /** Chooses something else until it is shown, it was refused, or something else was begun meanwhile. */
  async choose(change: Partial<Variation>): Promise<void> {
    const { isWaiting, varied } = this;
    const { alternative, texture } = this.newest;
    this.wanted = { alternative, texture, ...change };
    if (isWaiting) {
      return;
    }
    let step: ReturnType<Varied['step']> | undefined;
    while (varied.step() !== step && !varied.isBusy()) {
      step = varied.step();
      const next = stepTowards(step.constraints, this.wanted);
      if (next !== undefined) {
        await varied.apply(next.label, next.constraints);
      }
    }
    this.wanted = undefined;
  }
}

/** The next step from constraints towards a variation, and its name; undefined when they have it. */
export function stepTowards(
  constraints: ClothConstraints,
  { alternative, texture }: Variation,
): { label: string; constraints: ClothConstraints } | undefined {
  if (alternative !== constraints.alternative) {
    return { label: fillName(alternative), constraints: { ...constraints, alternative } };
  }
  if (texture !== constraints.texture) {
    return { label: textureName(texture), constraints: { ...constraints, texture } };
  }
  return undefined;
}
