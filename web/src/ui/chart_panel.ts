/** The chart of a hole: the cloth laid flat, the places of gestures and anchors on it, the path and the map of an anchor search. */
import type { Anchor, Uv } from '../client.js';
import { locate } from '../model/cloth.js';
import { type AnchorDraft, type Draft, isMaking } from '../model/draft.js';
import { short } from '../model/loops.js';
import type { Patch } from '../model/scan_session.js';
import { type TemplateResult, css, html, nothing, svg } from '../vendor.js';
import { mapCells, rangeOf } from './map_cells.js';
import { Panel } from './panel.js';

/** Side of the drawing, in its own units. */
const SIDE = 256;
/** Cells of a grid's side. */
const GRID = 64;
/** How far an arrow key moves a dot: a cell, or with Shift a quarter of one. */
const STEP = { whole: 1 / GRID, fine: 1 / (4 * GRID) };

const ARROWS: ReadonlyMap<string, Uv> = new Map([
  ['ArrowLeft', [-1, 0]],
  ['ArrowRight', [1, 0]],
  ['ArrowDown', [0, -1]],
  ['ArrowUp', [0, 1]],
]);

/** A dot that can be dragged: an anchor of the step, or one that is being made. */
interface AnchorDot {
  readonly name: string;
  readonly uv: Uv;
  /** The anchor at another place of the chart. */
  at(uv: Uv): AnchorDraft;
}

export class ChartPanel extends Panel {
  static override styles = [
    Panel.styles,
    css`
      svg {
        display: block;
        width: 100%;
        max-width: 320px;
        border: 1px solid var(--line);
        border-radius: 5px;
      }
      .dot {
        cursor: grab;
        touch-action: none;
        outline: none;
      }
      .dot .focus {
        fill: transparent;
      }
      .dot:focus-visible .focus {
        stroke: #1c2026;
        stroke-width: 4;
      }
      .dot:focus-visible .ring {
        stroke: #ffffff;
      }
    `,
  ].flat();

  /** The pointer that drags a dot, where both were at first, and whether it has moved. */
  private held: Held | undefined;

  protected override render(): TemplateResult | typeof nothing {
    const { draft, found, editable } = this.editor;
    const ofDraft = draft === undefined || isMaking(draft) ? undefined : draft.hole;
    const hole = ofDraft ?? found?.hole ?? editable[0]?.hole.id;
    const patch = editable.find((it) => it.hole.id === hole);
    if (patch === undefined || hole === undefined) {
      return nothing;
    }
    const search = found !== undefined && found.hole === hole ? found.found : undefined;
    const picture = patch.hole.chartPng;
    const map = this.editor.tool === 'anchor' && this.editor.map?.hole === hole ? this.editor.map.losses : [];
    const range = rangeOf(map);
    const path = (search?.path ?? []).map(({ cell }) => uvOfCell(cell ?? []));
    const [dots, gestures] = [this.dots(hole), this.gestures(hole)];
    return html`
      <h2>Chart of hole ${hole}</h2>
      <svg viewBox="0 0 ${SIDE} ${SIDE}" role="group" aria-label=${this.words(hole)}>
        ${picture ? svg`<image href="data:image/png;base64,${picture}" width=${SIDE} height=${SIDE} />` : nothing}
        ${range ? mapCells(map, range, SIDE) : nothing}
        ${
          path.length > 1
            ? svg`<polyline points=${path.map((uv) => at(uv).join()).join(' ')} fill="none" stroke="#0b7285" stroke-width="2" />`
            : nothing
        }
        ${gestures.map((uv) => place(uv, '#ffffff'))}
        ${draft ? placesOf(draft).map((uv) => place(uv, '#22b8cf')) : nothing}
        ${search?.uv ? cross(search.uv as Uv) : nothing} ${dots.map((it) => this.anchorDot(it, patch))}
      </svg>
      ${
        search !== undefined || dots.length + gestures.length > 0
          ? html`<p class="quiet small">White: gestures; yellow: anchors; the cross: where the last search ended.</p>`
          : nothing
      }
      ${
        dots.length > 0
          ? html`<p class="quiet small">
              Drag a dot to choose which place of the cloth goes to its point; the arrow keys move it, too, Enter keeps
              it.
            </p>`
          : nothing
      }
      ${
        range
          ? html`<p class="small">
              The map: light where the loss is least (${short(range.least)}), dark where it is largest
              (${short(range.most)}).
            </p>`
          : nothing
      }
      ${
        search
          ? html`<p class="small">
              The point belongs at u ${search.uv?.[0]?.toFixed(3)}, v ${search.uv?.[1]?.toFixed(3)}; the search went
              through ${path.length} ${path.length === 1 ? 'cell' : 'cells'}.
            </p>`
          : nothing
      }
    `;
  }

  /** The step's anchors on a hole, the one that is being moved where it is now; last one that is being made. */
  private dots(hole: number): AnchorDot[] {
    const { draft, found, step } = this.editor;
    const made = draft?.kind === 'anchor' && draft.hole === hole ? draft : undefined;
    const placed = step.constraints.anchors.flatMap((anchor, index) => {
      const moved = made?.replaces === index ? made : undefined;
      const uv = moved?.uv ?? anchor.uv;
      const isHere = anchor.hole === undefined || anchor.hole === hole;
      return isHere && uv?.length === 2 ? [dotOf(anchor, { index, hole, uv: uv as Uv, draft: moved })] : [];
    });
    const uv = made?.uv ?? (found?.hole === hole ? (found.found.uv as Uv | undefined) : undefined);
    if (made === undefined || made.replaces !== undefined || uv === undefined) {
      return placed;
    }
    return [...placed, { name: 'New anchor', uv, at: (to) => ({ ...made, uv: to }) }];
  }

  private anchorDot(it: AnchorDot, patch: Patch): TemplateResult {
    const [x, y] = at(it.uv);
    const [u, v] = it.uv;
    const words = `u ${u.toFixed(3)}, v ${v.toFixed(3)}`;
    return svg`
      <g
        class="dot"
        role="slider"
        tabindex="0"
        aria-label="${it.name} on the chart"
        aria-valuemin="0"
        aria-valuemax="1"
        aria-valuenow=${u.toFixed(3)}
        aria-valuetext=${words}
        @pointerdown=${(event: PointerEvent) => this.down(event, it)}
        @pointermove=${(event: PointerEvent) => this.move(event, it, patch)}
        @pointerup=${this.up}
        @pointercancel=${this.cancel}
        @keydown=${(event: KeyboardEvent) => this.key(event, it, patch)}
      >
        <circle class="focus" cx=${x} cy=${y} r="11" />
        <circle class="ring" cx=${x} cy=${y} r="6" fill="#ffd43b" stroke="#1c2026" stroke-width="2" />
      </g>
    `;
  }

  private down(event: PointerEvent, { uv }: AnchorDot): void {
    if (event.button !== 0 || !event.isPrimary || this.editor.work !== undefined) {
      return;
    }
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    this.held = { pointer: event.pointerId, x: event.clientX, y: event.clientY, uv, moved: false };
  }

  private move(event: PointerEvent, dot: AnchorDot, patch: Patch): void {
    const drawing = this.renderRoot.querySelector('svg')?.getBoundingClientRect();
    if (this.held?.pointer !== event.pointerId || drawing === undefined) {
      return;
    }
    this.held.moved = true;
    // From where it began: the panel above the chart may grow meanwhile.
    const { x, y, uv } = this.held;
    this.put(dot, [uv[0] + (event.clientX - x) / drawing.width, uv[1] - (event.clientY - y) / drawing.height], patch);
  }

  private readonly up = (event: PointerEvent): void => {
    const { held } = this;
    this.held = undefined;
    if (held?.pointer === event.pointerId && held.moved && this.editor.draft?.kind === 'anchor') {
      void this.editor.commit();
    }
  };

  private readonly cancel = (): void => {
    this.held = undefined;
    this.editor.dropDraft();
  };

  private key(event: KeyboardEvent, dot: AnchorDot, patch: Patch): void {
    const arrow = ARROWS.get(event.key);
    const { draft, work } = this.editor;
    if (work !== undefined) {
      return;
    }
    if (arrow !== undefined) {
      event.preventDefault();
      const step = event.shiftKey ? STEP.fine : STEP.whole;
      this.put(dot, [dot.uv[0] + step * arrow[0], dot.uv[1] + step * arrow[1]], patch);
    } else if (event.key === 'Enter' && draft?.kind === 'anchor' && draft.uv !== undefined) {
      event.preventDefault();
      void this.editor.commit();
    } else if (event.key === 'Escape') {
      this.cancel();
    }
  }

  /** Shows the cloth with an anchor elsewhere, as long as that is on the new cloth. */
  private put(dot: AnchorDot, uv: Uv, patch: Patch): void {
    if (locate(patch, uv) === undefined) {
      return;
    }
    const draft = dot.at(uv);
    if (this.editor.tool !== 'anchor') {
      this.editor.setTool('anchor');
    }
    this.editor.preview(draft);
  }

  /** The places of the step's gestures. */
  private gestures(hole: number): Uv[] {
    const ofHole = (item: { hole?: number }): boolean => item.hole === undefined || item.hole === hole;
    const places = this.editor.step.constraints.edits
      .filter(ofHole)
      .flatMap(({ grab, twist, pinch }) => [grab?.uv, twist?.uv, ...(pinch?.uvs ?? [])]);
    return places.filter((uv) => uv?.length === 2) as Uv[];
  }

  private words(hole: number): string {
    const count = this.gestures(hole).length + this.dots(hole).length;
    return `The cloth around hole ${hole}, laid flat, with ${count} ${count === 1 ? 'place' : 'places'} of constraints.`;
  }
}

interface Held {
  readonly pointer: number;
  readonly x: number;
  readonly y: number;
  readonly uv: Uv;
  moved: boolean;
}

interface DotPlace {
  readonly index: number;
  readonly hole: number;
  readonly uv: Uv;
  /** The anchor while it is moved. */
  readonly draft: AnchorDraft | undefined;
}

function dotOf({ position, hard = false }: Anchor, { index, hole, uv, draft }: DotPlace): AnchorDot {
  const [x = 0, y = 0, z = 0] = position ?? [];
  const anchor: AnchorDraft = draft ?? { kind: 'anchor', hole, position: [x, y, z], hard, replaces: index };
  return { name: `Anchor ${index + 1}`, uv, at: (to) => ({ ...anchor, uv: to }) };
}

/** Where a uv is drawn: v goes up. */
function at([u, v]: Uv): [number, number] {
  return [u * SIDE, (1 - v) * SIDE];
}

function place(uv: Uv, color: string): TemplateResult {
  const [x, y] = at(uv);
  return svg`<circle cx=${x} cy=${y} r="5" fill=${color} stroke="#1c2026" stroke-width="1.5" />`;
}

/** Where a search ended. */
function cross(uv: Uv): TemplateResult {
  const [x, y] = at(uv);
  const lines = `M${x - 8},${y}H${x + 8}M${x},${y - 8}V${y + 8}`;
  return svg`<path d=${lines} stroke="#1c2026" stroke-width="4" /><path d=${lines} stroke="#ffd43b" stroke-width="2" />`;
}

function uvOfCell([i = 0, j = 0]: number[]): Uv {
  return [(i + 0.5) / GRID, (j + 0.5) / GRID];
}

function placesOf(draft: Draft): readonly Uv[] {
  switch (draft.kind) {
    case 'grab':
    case 'twist':
      return [draft.uv];
    case 'pinch':
      return draft.uvs;
    case 'anchor':
    case 'cut':
    case 'polygon':
    case 'border':
      return [];
  }
}

customElements.define('darn-chart', ChartPanel);
