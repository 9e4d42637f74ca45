/** Moves the camera by keys, as the pointer does. */
import type { OrbitControls } from '../vendor.js';

/** What a press does: radians, CSS pixels, and the share of the distance that is left. */
const STEP = { turn: Math.PI / 36, move: 24, zoom: 0.9 };

const ARROWS: ReadonlyMap<string, readonly [number, number]> = new Map([
  ['ArrowLeft', [1, 0]],
  ['ArrowRight', [-1, 0]],
  ['ArrowUp', [0, 1]],
  ['ArrowDown', [0, -1]],
]);

const ZOOMS: ReadonlyMap<string, number> = new Map([
  ['+', STEP.zoom],
  ['=', STEP.zoom],
  ['-', 1 / STEP.zoom],
  ['_', 1 / STEP.zoom],
]);

/** Arrows turn the camera about its pivot, with Shift they move it; + and - zoom. Whether the key was one of these. */
export function moveByKey(controls: OrbitControls, event: KeyboardEvent): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) {
    return false;
  }
  const [arrow, zoom] = [ARROWS.get(event.key), ZOOMS.get(event.key)];
  if (arrow !== undefined && event.shiftKey) {
    controls.pan(STEP.move * arrow[0], STEP.move * arrow[1]);
  } else if (arrow !== undefined) {
    controls.rotateLeft(STEP.turn * arrow[0]);
    controls.rotateUp(STEP.turn * arrow[1]);
  } else if (zoom !== undefined) {
    controls.dollyIn(zoom);
  }
  return arrow !== undefined || zoom !== undefined;
}
