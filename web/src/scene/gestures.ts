/** From a pointer on the picture to a gesture on the cloth. */
import type { Uv, Vec3 } from '../client.js';
import { type ClothPoint, nearestPatch, normalOf, positionOf } from '../model/cloth.js';
import {
  type CutDraft,
  type Draft,
  type PolygonDraft,
  firstMaking,
  endsOf,
  handlesOf,
  withCorner,
  withHandle,
} from '../model/draft.js';
import type { Editor } from '../model/editor.js';
import { Vector3 } from '../vendor.js';
import type { Disk } from './draft_marks.js';
import type { Hit, Viewer } from './viewer.js';

/** A pointer that moved less, in CSS pixels, has clicked. */
const CLICK = 4;
/** How near to a handle or a corner a pointer holds it, in CSS pixels. */
const REACH = 16;
/** Radians that a twist turns for each CSS pixel. */
const TURN = Math.PI / 200;
/** How much a notch of the wheel changes a twist's radius, and its bounds on the chart. */
const RADIUS = { step: 1.1, least: 0.02, most: 0.5 };

const AXES: ReadonlyMap<string, Vector3> = new Map([
  ['x', new Vector3(1, 0, 0)],
  ['y', new Vector3(0, 1, 0)],
  ['z', new Vector3(0, 0, 1)],
]);

/** What a pointer that is not on new cloth has of it. */
const NOT_CLOTH = { cloth: undefined, onPatch: false };

/** A pointer that is down. */
interface Hold {
  readonly pointer: number;
  readonly x: number;
  readonly y: number;
  readonly hit: Hit;
  /** The cloth under it, where the tool needs cloth. */
  readonly cloth: HeldCloth | undefined;
  /** Which handle of a stretch of border, or corner of a polygon, it holds. */
  readonly part?: number | undefined;
  moved: boolean;
  /** The draft before it went down. */
  readonly before: Draft | undefined;
  /** Where it is now. */
  last: PointerEvent;
}

/** A finger that has been down for a while goes down for the camera's controls. */
class FirstFinger extends PointerEvent {
  constructor(last: PointerEvent) {
    super('pointerdown', last);
  }
}

/** A place on cloth, and where it was when it was taken. */
interface HeldCloth {
  readonly point: ClothPoint;
  readonly position: Vector3;
  readonly normal: Vector3;
}

/**
 * Listens to the canvas before the camera's controls do. A pointer that goes down on new cloth with a tool chosen makes a gesture; any
 * other pointer moves the camera.
 */
export class Gestures {
  private hold: Hold | undefined;
  private firstOfPinch: ClothPoint | undefined;
  private heldAxis: string | undefined;
  private firstOfBorder: Vector3 | undefined;
  /** The new cloth under a pointer that is not down, while a twist is chosen. */
  private hovered: ClothPoint | undefined;
  /** Told when what is marked has changed without the editor's knowing. */
  onMarks: () => void = () => {};
  private readonly listening = new AbortController();

  constructor(
    private readonly viewer: Viewer,
    private readonly editor: Editor,
  ) {
    const { signal } = this.listening;
    const first = { capture: true, signal };
    const { canvas } = viewer;
    canvas.addEventListener('pointerdown', (event) => this.down(event), first);
    canvas.addEventListener('pointermove', (event) => this.move(event), first);
    canvas.addEventListener('pointerup', (event) => this.up(event), first);
    canvas.addEventListener('pointercancel', () => this.cancel(), first);
    canvas.addEventListener('pointerleave', () => this.hover(undefined), { signal });
    canvas.addEventListener('wheel', (event) => this.wheel(event), { ...first, passive: false });
    addEventListener('keydown', (event) => this.key(event, true), { signal });
    addEventListener('keyup', (event) => this.key(event, false), { signal });
  }

  /** The first point of a pinch that waits for its second. */
  get waitingPoint(): ClothPoint | undefined {
    return this.editor.tool === 'pinch' ? this.firstOfPinch : undefined;
  }

  /** The first end of a stretch of border that waits for its second. */
  get waitingEnd(): Vector3 | undefined {
    return this.editor.tool === 'border' ? this.firstOfBorder : undefined;
  }

  /** The disk that a twist would turn: where the pointer is, before it is dragged. */
  get disk(): Disk | undefined {
    const { tool, work } = this.editor;
    const point = this.hold === undefined ? this.hovered : this.hold.cloth?.point;
    return tool === 'twist' && work === undefined && point ? { point, radius: this.editor.twistRadius } : undefined;
  }

  /** Forgets the gesture that is being made. */
  cancel(): void {
    this.hold = undefined;
    this.firstOfPinch = undefined;
    this.firstOfBorder = undefined;
    this.editor.dropDraft();
  }

  dispose(): void {
    this.listening.abort();
  }

  private down(event: PointerEvent): void {
    const { tool, work } = this.editor;
    if (event instanceof FirstFinger) {
      return;
    }
    if (this.hold !== undefined) {
      this.joined(this.hold, event);
      return;
    }
    if (tool === 'look' || work !== undefined || event.button !== 0 || !event.isPrimary) {
      return;
    }
    if (tool === 'border') {
      this.borderDown(event);
      return;
    }
    const { draft } = this.editor;
    if (draft?.kind === 'polygon' && this.takeHandle(event, draft.corners)) {
      return;
    }
    const hit = this.viewer.pick(event.clientX, event.clientY);
    const cloth = this.held(hit?.cloth);
    if (tool === 'cut' || tool === 'polygon') {
      this.cutDown(event, hit);
      return;
    }
    if (hit === undefined || (cloth === undefined && (tool !== 'anchor' || this.editor.editable.length === 0))) {
      return;
    }
    this.take(event, { hit, cloth });
    this.onMarks();
  }

  /** Remembers which new cloth is under the pointer. */
  private hover(point: ClothPoint | undefined): void {
    if (point !== this.hovered) {
      this.hovered = point;
      this.onMarks();
    }
  }

  private take(event: PointerEvent, { hit, cloth, part }: Pick<Hold, 'hit' | 'cloth' | 'part'>): void {
    event.stopImmediatePropagation();
    this.viewer.canvas.focus();
    this.viewer.canvas.setPointerCapture(event.pointerId);
    const { pointerId: pointer, clientX: x, clientY: y } = event;
    this.hold = { pointer, x, y, hit, cloth, part, moved: false, before: this.editor.draft, last: event };
  }

  /** Another pointer comes down. Two fingers move the camera: what the first one began is taken back, and the camera's controls get both. */
  private joined(hold: Hold, event: PointerEvent): void {
    if (event.pointerType !== 'touch' || hold.last.pointerType !== 'touch') {
      event.stopImmediatePropagation();
      return;
    }
    this.hold = undefined;
    if (hold.before === undefined) {
      this.editor.dropDraft();
    } else {
      this.editor.preview(hold.before);
    }
    // The controls have not heard of the first finger.
    this.viewer.canvas.dispatchEvent(new FirstFinger(hold.last));
  }

  /** Takes the nearest of some points that a draft has; false where none is near to the pointer. */
  private takeHandle(event: PointerEvent, points: readonly Vec3[]): boolean {
    const handles = points.map((point) => new Vector3(...point));
    const held = this.viewer.aim.nearestOf(handles, { x: event.clientX, y: event.clientY }, REACH);
    if (held === undefined) {
      return false;
    }
    this.take(event, { hit: { position: held, ...NOT_CLOTH }, cloth: undefined, part: handles.indexOf(held) });
    return true;
  }

  /** The middle of a ball is where the pointer goes down on the scan; how far it is dragged is the radius. */
  private cutDown(event: PointerEvent, hit: Hit | undefined): void {
    if (hit === undefined) {
      return;
    }
    if (hit.onPatch) {
      event.stopImmediatePropagation();
      this.editor.say('Only cloth of the scan itself can be cut out.');
      return;
    }
    if (this.editor.tool === 'polygon') {
      this.cornerDown(event, hit);
      return;
    }
    this.take(event, { hit, cloth: undefined });
    const { radius } = this.cutDraft();
    this.editor.preview({ kind: 'cut', center: hit.position.toArray(), radius });
  }

  /** Gives a polygon a corner where the pointer goes down, and holds it. */
  private cornerDown(event: PointerEvent, hit: Hit): void {
    this.take(event, { hit, cloth: undefined, part: this.polygonDraft().corners.length });
    // Read only now: the picture has taken the focus from a field, whose number may have changed the draft.
    const draft = this.polygonDraft();
    this.editor.preview({ ...draft, corners: [...draft.corners, hit.position.toArray()] });
  }

  private polygonDraft(): PolygonDraft {
    const { draft } = this.editor;
    return draft?.kind === 'polygon' ? draft : { kind: 'polygon', corners: [] };
  }

  private cutDraft(): CutDraft {
    const { draft, scan } = this.editor;
    const start = { loops: scan?.loops ?? [], candidates: [] };
    return draft?.kind === 'cut' ? draft : (firstMaking('cut', start) as CutDraft);
  }

  /** Takes a handle of the stretch, or begins and ends one at the cloth's edge. */
  private borderDown(event: PointerEvent): void {
    const { draft } = this.editor;
    if (draft?.kind === 'border') {
      this.takeHandle(event, handlesOf(draft));
      return;
    }
    const end = this.viewer.nearestOfBorder(event.clientX, event.clientY);
    if (end === undefined) {
      return;
    }
    this.take(event, { hit: { position: end, ...NOT_CLOTH }, cloth: undefined });
  }

  /** A click at the cloth's edge: the first end of a stretch, or its second. */
  private bordered({ hit, moved }: Hold): void {
    const { draft } = this.editor;
    if (moved || draft?.kind === 'border') {
      return;
    }
    const first = this.firstOfBorder;
    if (first === undefined) {
      this.firstOfBorder = hit.position;
      this.editor.say('Border: click where the stretch ends.');
      return;
    }
    this.firstOfBorder = undefined;
    this.editor.say('Border: drag its ends, or mend it.');
    this.editor.preview({ kind: 'border', from: first.toArray(), to: hit.position.toArray(), along: [] });
  }

  private movedHandle({ hit, part = 0 }: Hold, { clientX, clientY }: PointerEvent): Draft | undefined {
    const { draft } = this.editor;
    if (draft?.kind !== 'border') {
      return undefined;
    }
    const isEnd = part < endsOf(draft);
    const target = isEnd
      ? this.viewer.nearestOfBorder(clientX, clientY)
      : this.viewer.aim.onScreenPlane(clientX, clientY, hit.position);
    return target && withHandle(draft, part, target.toArray());
  }

  /** A corner of a polygon is dragged along the scan's cloth. */
  private movedCorner({ part = 0 }: Hold, { clientX, clientY }: PointerEvent): Draft | undefined {
    const { draft } = this.editor;
    const hit = this.viewer.pick(clientX, clientY);
    const isOnScan = hit !== undefined && !hit.onPatch;
    return draft?.kind === 'polygon' && isOnScan ? withCorner(draft, part, hit.position.toArray()) : undefined;
  }

  private move(event: PointerEvent): void {
    const { hold } = this;
    if (hold === undefined && event.buttons === 0) {
      const isTwist = this.editor.tool === 'twist';
      this.hover(isTwist ? this.viewer.pick(event.clientX, event.clientY)?.cloth : undefined);
    }
    if (hold === undefined || event.pointerId !== hold.pointer) {
      return;
    }
    event.stopImmediatePropagation();
    hold.last = event;
    hold.moved ||= Math.hypot(event.clientX - hold.x, event.clientY - hold.y) > CLICK;
    const draft = hold.moved ? this.dragged(hold, event) : undefined;
    if (draft !== undefined) {
      this.editor.preview(draft);
    }
  }

  private up(event: PointerEvent): void {
    const { hold } = this;
    if (hold === undefined || event.pointerId !== hold.pointer) {
      return;
    }
    event.stopImmediatePropagation();
    this.hold = undefined;
    // A finger that is lifted is nowhere.
    this.hover(event.pointerType === 'touch' ? undefined : hold.cloth?.point);
    const { tool } = this.editor;
    if (tool === 'pinch') {
      this.pinched(hold);
    } else if (tool === 'border') {
      this.bordered(hold);
    } else if (tool === 'cut') {
      this.editor.say('Cut out: change the ball, or cut it out and mend.');
    } else if (tool === 'polygon') {
      this.editor.say(cornersInWords(this.editor.draft));
    } else if (tool === 'anchor' && !hold.moved) {
      this.editor.preview(this.anchorAt(hold, hold.hit.position));
      void this.editor.commit();
    } else if (hold.moved && this.editor.draft !== undefined) {
      void this.editor.commit();
    }
  }

  /** The gesture of a pointer that was dragged to where it is now. */
  private dragged(hold: Hold, event: PointerEvent): Draft | undefined {
    const { cloth } = hold;
    switch (this.editor.tool) {
      case 'grab':
        return cloth && this.grabbed(cloth, event);
      case 'twist':
        return cloth && this.twisted(cloth, event.clientX - hold.x);
      case 'anchor': {
        const target = this.viewer.aim.onScreenPlane(event.clientX, event.clientY, hold.hit.position);
        return target && this.anchorAt(hold, target);
      }
      case 'cut': {
        const edge = this.viewer.aim.onScreenPlane(event.clientX, event.clientY, hold.hit.position);
        const radius = edge?.distanceTo(hold.hit.position) ?? 0;
        return radius > 0 ? { kind: 'cut', center: hold.hit.position.toArray(), radius } : undefined;
      }
      case 'polygon':
        return this.movedCorner(hold, event);
      case 'border':
        return this.movedHandle(hold, event);
      default:
        return undefined;
    }
  }

  private grabbed({ point, position, normal }: HeldCloth, event: PointerEvent): Draft | undefined {
    const { clientX, clientY } = event;
    const axis = event.shiftKey ? normal : AXES.get(this.heldAxis ?? '');
    const target = axis
      ? this.viewer.aim.onLine(clientX, clientY, position, axis)
      : this.viewer.aim.onScreenPlane(clientX, clientY, position);
    const { hole, uv } = point;
    return target && { kind: 'grab', hole, uv, offset: target.sub(position).toArray() };
  }

  private twisted({ point, normal }: HeldCloth, pixels: number): Draft {
    // To the right turns clockwise for who looks at it, whichever side of the cloth that is.
    const axis = normal.clone();
    if (axis.dot(this.viewer.camera.getWorldDirection(new Vector3())) > 0) {
      axis.negate();
    }
    const { hole, uv } = point;
    return { kind: 'twist', hole, uv, radius: this.editor.twistRadius, axis: axis.toArray(), angle: -pixels * TURN };
  }

  private anchorAt({ cloth }: Hold, target: Vector3): Draft {
    const position: Vec3 = target.toArray();
    const nearest = nearestPatch(this.editor.editable, position)?.hole.id ?? 0;
    const { draft } = this.editor;
    const hard = draft?.kind === 'anchor' && draft.hard;
    return { kind: 'anchor', hole: cloth?.point.hole ?? nearest, position, hard };
  }

  /** A click of the pinch: the first point, or the second, after which its amount can be chosen. */
  private pinched({ cloth }: Hold): void {
    const first = this.firstOfPinch;
    if (cloth === undefined) {
      return;
    }
    if (first === undefined || first.hole !== cloth.point.hole) {
      this.firstOfPinch = cloth.point;
      this.editor.say('Pinch: click the second point.');
      return;
    }
    this.firstOfPinch = undefined;
    const uvs: [Uv, Uv] = [first.uv, cloth.point.uv];
    this.editor.say('Pinch: choose how much, then apply.');
    this.editor.preview({ kind: 'pinch', hole: first.hole, uvs, amount: 0.5 });
  }

  private wheel(event: WheelEvent): void {
    const { draft } = this.editor;
    if (draft?.kind === 'cut') {
      const hit = this.viewer.pick(event.clientX, event.clientY);
      if (hit !== undefined && hit.position.distanceTo(new Vector3(...draft.center)) <= draft.radius) {
        event.preventDefault();
        event.stopImmediatePropagation();
        this.editor.preview({ ...draft, radius: draft.radius * RADIUS.step ** -Math.sign(event.deltaY) });
      }
      return;
    }
    const cloth = this.editor.tool === 'twist' ? this.viewer.pick(event.clientX, event.clientY)?.cloth : undefined;
    if (cloth === undefined) {
      return;
    }
    this.hovered = cloth;
    event.preventDefault();
    event.stopImmediatePropagation();
    const radius = this.editor.twistRadius * RADIUS.step ** -Math.sign(event.deltaY);
    this.editor.setTwistRadius(Math.min(Math.max(radius, RADIUS.least), RADIUS.most));
  }

  private key(event: KeyboardEvent, down: boolean): void {
    const key = event.key.toLowerCase();
    if (down && key === 'escape') {
      this.cancel();
    } else if (AXES.has(key) && (down ? this.hold !== undefined : key === this.heldAxis)) {
      this.heldAxis = down ? key : undefined;
    }
  }

  private held(point: ClothPoint | undefined): HeldCloth | undefined {
    const patch = this.editor.step.patches.find(({ hole }) => hole.id === point?.hole);
    return (
      point &&
      patch && {
        point,
        position: new Vector3(...positionOf(patch, point)),
        normal: new Vector3(...normalOf(patch, point)),
      }
    );
  }
}

/** How many corners a polygon has, and what can be done next. */
function cornersInWords(draft: Draft | undefined): string {
  const count = draft?.kind === 'polygon' ? draft.corners.length : 0;
  const next = count < 3 ? 'click the next one' : 'click another, or cut it out and mend';
  return `Cut out: ${count} ${count === 1 ? 'corner' : 'corners'}; ${next}.`;
}
