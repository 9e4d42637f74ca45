/** Confidence: how far new cloth may be from the cloth that was there. */
import type { Patch } from '../model/scan_session.js';

/** For each vertex of a patch its standard deviation before anchors and gestures, in the scene's unit; NaN where none was measured. */
export function patchDeviations({ hole, positions }: Patch): Float32Array<ArrayBuffer> {
  const { patchDeviations: deviations = [] } = hole;
  const count = positions.length / 3;
  return deviations.length === count ? new Float32Array(deviations) : new Float32Array(count).fill(Number.NaN);
}
