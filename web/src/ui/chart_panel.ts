/** The chart of a hole: the cloth laid flat, the places of gestures and anchors on it, the path and the map of an anchor search. */
import type { Uv } from '../client.js';
import type { Draft } from '../model/draft.js';
import { short } from '../model/loops.js';
import { type TemplateResult, css, html, nothing, svg } from '../vendor.js';
import { mapCells, rangeOf } from './map_cells.js';
import { Panel } from './panel.js';

/** Side of the drawing, in its own units. */
const SIDE = 256;
/** Cells of a grid's side. */
const GRID = 64;

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
    `,
  ].flat();

  protected override render(): TemplateResult | typeof nothing {
    const { draft, found, editable } = this.editor;
    const hole = draft?.hole ?? found?.hole ?? editable[0]?.hole.id;
    const patch = editable.find((it) => it.hole.id === hole);
    if (patch === undefined) {
      return nothing;
    }
    const search = found !== undefined && found.hole === hole ? found.found : undefined;
    const picture = patch.hole.chartPng;
    const map = this.editor.tool === 'anchor' ? ((search?.map ?? []) as (number | null)[]) : [];
    const range = rangeOf(map);
    const path = (search?.path ?? []).map(({ cell }) => uvOfCell(cell ?? []));
    return html`
      <h2>Chart of hole ${hole}</h2>
      <svg viewBox="0 0 ${SIDE} ${SIDE}" role="img" aria-label=${this.words(hole ?? 0)}>
        ${picture ? svg`<image href="data:image/png;base64,${picture}" width=${SIDE} height=${SIDE} />` : nothing}
        ${range ? mapCells(map, range, SIDE) : nothing}
        ${
          path.length > 1
            ? svg`<polyline points=${path.map((uv) => at(uv).join()).join(' ')} fill="none" stroke="#0b7285" stroke-width="2" />`
            : nothing
        }
        ${this.placed(hole ?? 0).map((uv) => dot(uv, '#ffffff'))}
        ${draft ? placesOf(draft).map((uv) => dot(uv, '#22b8cf')) : nothing}
        ${search?.uv ? dot(search.uv as Uv, '#ffd43b') : nothing}
      </svg>
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

  /** The places of the step's constraints. */
  private placed(hole: number): Uv[] {
    const { anchors, edits } = this.editor.step.constraints;
    const ofHole = (item: { hole?: number }): boolean => item.hole === undefined || item.hole === hole;
    return [
      ...anchors.filter(ofHole).map(({ uv }) => uv),
      ...edits.filter(ofHole).flatMap(({ grab, twist, pinch }) => [grab?.uv, twist?.uv, ...(pinch?.uvs ?? [])]),
    ].filter((uv) => uv?.length === 2) as Uv[];
  }

  private words(hole: number): string {
    const count = this.placed(hole).length;
    return `The cloth around hole ${hole}, laid flat, with ${count} ${count === 1 ? 'place' : 'places'} of constraints.`;
  }
}

/** Where a uv is drawn: v goes up. */
function at([u, v]: Uv): [number, number] {
  return [u * SIDE, (1 - v) * SIDE];
}

function dot(uv: Uv, color: string): TemplateResult {
  const [x, y] = at(uv);
  return svg`<circle cx=${x} cy=${y} r="5" fill=${color} stroke="#1c2026" stroke-width="1.5" />`;
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
      return [];
  }
}

customElements.define('darn-chart', ChartPanel);
