/** The tools, and the gesture that is being made as numbers: all that a pointer can do can be typed here. */
import type { Uv, Vec3 } from '../client.js';
import { middleOf } from '../model/cloth.js';
import {
  type AnchorDraft,
  type BorderDraft,
  type ClothDraft,
  type CutDraft,
  depthOf,
  type Draft,
  type DraftKind,
  firstDraft,
  firstMaking,
  type GrabDraft,
  handlesOf,
  isMaking,
  isWhole,
  type MakingDraft,
  NAMES,
  type PinchDraft,
  type PolygonDraft,
  type TwistDraft,
  unmade,
  withCorner,
  withFacing,
  withHandle,
  withoutFacing,
  withoutLastCorner,
  withTypedCorner,
} from '../model/draft.js';
import type { Tool } from '../model/editor_state.js';
import { isHole } from '../model/loops.js';
import { type TemplateResult, css, html, nothing } from '../vendor.js';
import { Panel } from './panel.js';

/** The tools, with the key of each. */
export const TOOLS: readonly { tool: Tool; name: string; key: string; help: string }[] = [
  {
    tool: 'look',
    name: 'Look',
    key: 'L',
    help: 'Drag to turn the scan, right button or two fingers to move it, wheel to zoom. With the picture in focus, the arrow keys turn it, with Shift they move it, + and - zoom.',
  },
  {
    tool: 'grab',
    name: NAMES.grab,
    key: 'G',
    help: 'Drag new cloth in the plane of the screen; hold Shift to pull it along its normal, or X, Y or Z along an axis.',
  },
  {
    tool: 'twist',
    name: NAMES.twist,
    key: 'T',
    help: 'Drag to the left or right on new cloth to turn a disk of it; the wheel changes its size.',
  },
  {
    tool: 'pinch',
    name: NAMES.pinch,
    key: 'P',
    help: 'Click two points of new cloth, then choose how far to draw them together.',
  },
  {
    tool: 'anchor',
    name: NAMES.anchor,
    key: 'A',
    help: 'Drag from the cloth to where it should be, or type the point; the service finds which place of the cloth belongs there. That place is a dot on the chart, which can be dragged.',
  },
  {
    tool: 'cut',
    name: NAMES.cut,
    key: 'C',
    help: 'For stained, torn or badly scanned cloth: press on its middle and drag to its edge. What the ball touches is cut out, and new cloth is put in. The wheel changes its size.',
  },
  {
    tool: 'border',
    name: NAMES.border,
    key: 'E',
    help: 'For a bite or a rip at the edge of the cloth: click where it begins and where it ends. New cloth goes up to the dashed line; add points where the new hem should go. Where the cloth is torn in two, add the edge that faces it: the two are joined.',
  },
];

/** A polygon is a shape of the tool that cuts out. */
const POLYGON_HELP =
  'For damaged cloth of any outline: click its corners one after another. A corner can be dragged, and Backspace takes the last one back. What lies under the polygon is cut out, and new cloth is put in.';

/** The shapes that are cut out, each with the tool that it is. */
const SHAPES: readonly (readonly [Tool, string])[] = [
  ['cut', 'Ball'],
  ['polygon', 'Polygon'],
];

/** Whether a tool works on new cloth, and so needs some. */
export function needsCloth(tool: Tool): boolean {
  return !['look', 'cut', 'polygon', 'border'].includes(tool);
}

/** What the button of a draft says. */
const COMMIT: Readonly<Record<DraftKind, string>> = {
  grab: 'Apply',
  twist: 'Apply',
  pinch: 'Apply',
  anchor: 'Find its place',
  cut: 'Cut out and mend',
  polygon: 'Cut out and mend',
  border: 'Mend up to the new hem',
};

/** An anchor that a hand has put on the chart needs no search. */
function commitWord(draft: Draft): string {
  return draft.kind === 'anchor' && draft.uv !== undefined ? 'Apply' : COMMIT[draft.kind];
}

/** What the first two fields of a gesture are. */
const PLACE = html`<span class="wide quiet small">u and v: the place on the chart, from 0 to 1</span>`;

const AXIS_NAMES = ['x', 'y', 'z'] as const;

export class ToolsPanel extends Panel {
  static override styles = [
    Panel.styles,
    css`
      .tools {
        margin-bottom: 0.5rem;
      }
      form {
        display: grid;
        grid-template-columns: repeat(3, 1fr);
        gap: 6px;
      }
      label {
        display: block;
        font-size: 12px;
      }
      .wide {
        grid-column: 1 / -1;
      }
      fieldset {
        display: flex;
        gap: 12px;
        margin: 0;
      }
    `,
  ].flat();

  protected override render(): TemplateResult {
    const { tool, step, editable } = this.editor;
    const shown = tool === 'polygon' ? 'cut' : tool;
    const help = tool === 'polygon' ? POLYGON_HELP : (TOOLS.find((it) => it.tool === tool)?.help ?? '');
    return html`
      <h2>Tools</h2>
      <div class="row tools" role="group" aria-label="Tools">
        ${TOOLS.map(
          (it) => html`
            <button
              aria-pressed=${it.tool === shown}
              aria-keyshortcuts=${it.key}
              title="${it.name} (${it.key})"
              ?disabled=${editable.length === 0 && needsCloth(it.tool)}
              @click=${() => this.editor.setTool(it.tool)}
            >
              ${it.name}
            </button>
          `,
        )}
      </div>
      <p class="quiet small">${help}</p>
      ${editable.length > 0 || tool !== 'look' ? nothing : html`<p class="quiet small">${noTools(step.patches.length)}</p>`}
      ${tool === 'look' ? nothing : this.form(this.draftOf(tool))}
    `;
  }

  /** The gesture that is being made, or one that changes nothing yet. */
  private draftOf(kind: DraftKind): Draft | undefined {
    const { draft, editable, scan, step } = this.editor;
    const [patch] = editable;
    if (draft?.kind === kind) {
      return draft;
    }
    if (kind === 'cut' || kind === 'polygon' || kind === 'border') {
      return scan && firstMaking(kind, { ...scan, candidates: unmade(scan.candidates, step.made) });
    }
    const first = patch && firstDraft(kind, patch);
    return first?.kind === 'twist' ? { ...first, radius: this.editor.twistRadius } : first;
  }

  private form(draft: Draft | undefined): TemplateResult | typeof nothing {
    if (draft === undefined) {
      return nothing;
    }
    const { work } = this.editor;
    const busy = work !== undefined;
    return html`
      <form @submit=${(event: Event) => this.apply(event, draft)}>
        ${isMaking(draft) ? this.shapes(draft) : this.holeField(draft)} ${this.fields(draft)}
        <div class="row wide">
          <button class="main" ?disabled=${busy || !isWhole(draft) || this.isUnseen(draft)}>
            ${commitWord(draft)}
          </button>
          <button type="button" ?disabled=${this.editor.draft === undefined} @click=${() => this.editor.dropDraft()}>
            Cancel
          </button>
          ${draft.kind === 'anchor' ? this.mapButton(draft) : nothing}
        </div>
      </form>
    `;
  }

  /** Whether a draft would mend a stretch of border that is not drawn. */
  private isUnseen(draft: Draft): boolean {
    return draft.kind === 'border' && draft !== this.editor.draft;
  }

  private mapButton(draft: AnchorDraft): TemplateResult {
    const { work, map } = this.editor;
    if (map?.isComing) {
      return html`
        <button type="button" @click=${() => this.editor.stopMap()}>Stop the map</button>
        <progress aria-label="The map" max="1" .value=${map.share}></progress>
      `;
    }
    const draw = (): void => void this.editor.drawMap(draft);
    return html`<button type="button" ?disabled=${work !== undefined} @click=${draw}>Draw the map</button>`;
  }

  private holeField(draft: ClothDraft): TemplateResult | typeof nothing {
    const patches = this.editor.editable;
    if (patches.length < 2) {
      return nothing;
    }
    const choose = (event: Event): void => {
      const id = Number((event.target as HTMLSelectElement).value);
      const patch = patches.find(({ hole }) => hole.id === id);
      if (patch !== undefined) {
        this.preview(draft.kind === 'anchor' ? { ...draft, hole: id } : firstDraft(draft.kind, patch));
      }
    };
    return html`
      <label class="wide">
        Hole
        <select @change=${choose}>
          ${patches.map(({ hole }) => html`<option value=${hole.id} ?selected=${hole.id === draft.hole}>${hole.id}</option>`)}
        </select>
      </label>
    `;
  }

  private fields(draft: Draft): TemplateResult {
    switch (draft.kind) {
      case 'grab':
        return this.grabFields(draft);
      case 'twist':
        return this.twistFields(draft);
      case 'pinch':
        return this.pinchFields(draft);
      case 'anchor':
        return this.anchorFields(draft);
      case 'cut':
        return this.cutFields(draft);
      case 'polygon':
        return this.polygonFields(draft);
      case 'border':
        return this.borderFields(draft);
    }
  }

  private grabFields(draft: GrabDraft): TemplateResult {
    return html`
      ${PLACE} ${this.uvFields(draft.uv, '', (uv) => ({ ...draft, uv }))}
      <span></span>
      ${this.vectorFields('Move', draft.offset, (offset) => ({ ...draft, offset }))}
    `;
  }

  private twistFields(draft: TwistDraft): TemplateResult {
    const degrees = (draft.angle * 180) / Math.PI;
    return html`
      ${PLACE} ${this.uvFields(draft.uv, '', (uv) => ({ ...draft, uv }))}
      ${this.number('Radius', draft.radius, (radius) => ({ ...draft, radius }))}
      ${this.vectorFields('Axis', draft.axis, (axis) => ({ ...draft, axis }))}
      ${this.number('Angle in degrees', degrees, (value) => ({ ...draft, angle: (value * Math.PI) / 180 }))}
    `;
  }

  private pinchFields(draft: PinchDraft): TemplateResult {
    const [first, second] = draft.uvs;
    const amount = (event: Event): void => {
      this.preview({ ...draft, amount: Number((event.target as HTMLInputElement).value) });
    };
    return html`
      ${this.uvFields(first, 'First ', (uv) => ({ ...draft, uvs: [uv, second] }))}
      <span></span>
      ${this.uvFields(second, 'Second ', (uv) => ({ ...draft, uvs: [first, uv] }))}
      <span></span>
      <label class="wide">
        Share of their distance to take away: ${Math.round(draft.amount * 100)} %
        <input type="range" min="0" max="1" step="0.01" .value=${String(draft.amount)} @input=${amount} />
      </label>
    `;
  }

  private anchorFields(draft: AnchorDraft): TemplateResult {
    const hard = (event: Event): void => {
      this.preview({ ...draft, hard: (event.target as HTMLInputElement).checked });
    };
    return html`
      ${this.vectorFields('Point', draft.position, (position) => ({ ...draft, position }))} ${this.placeFields(draft)}
      <label class="wide choice">
        <input type="checkbox" .checked=${draft.hard} @change=${hard} />
        Hard: refuse it where the cloth cannot reach it
      </label>
    `;
  }

  /** Where an anchor is on the chart; empty while that is to be searched. */
  private placeFields(draft: AnchorDraft): TemplateResult[] {
    const patch = this.editor.editable.find(({ hole }) => hole.id === draft.hole);
    const place = draft.uv ?? (patch === undefined ? undefined : middleOf(patch)) ?? [0.5, 0.5];
    return (['u', 'v'] as const).map((name, axis) =>
      this.number(name, draft.uv?.[axis], (value) => ({ ...draft, uv: place.with(axis, value) as Uv })),
    );
  }

  private cutFields(draft: CutDraft): TemplateResult {
    return html`
      ${this.vectorFields('Centre', draft.center, (center) => ({ ...draft, center }))}
      ${this.number('Radius', draft.radius, (radius) => ({ ...draft, radius }))} ${this.cutEdges()}
    `;
  }

  private polygonFields(draft: PolygonDraft): TemplateResult {
    const { corners } = draft;
    const { scan } = this.editor;
    const add = (): void => this.preview(withTypedCorner(draft, scan?.loops ?? []));
    const remove = (): void => this.preview(withoutLastCorner(draft));
    return html`
      ${corners.map((corner, at) =>
        this.vectorFields(`Corner ${at + 1}`, corner, (moved) => withCorner(draft, at, moved)),
      )}
      <div class="row wide">
        <button type="button" @click=${add}>Add a corner</button>
        <button type="button" ?disabled=${corners.length === 0} @click=${remove}>Take the last corner back</button>
      </div>
      ${corners.length < 2 ? nothing : this.number('Depth', depthOf(draft), (depth) => ({ ...draft, depth }))}
      ${this.cutEdges()}
    `;
  }

  /** Whether a ball or a polygon is cut out. */
  private shapes({ kind }: MakingDraft): TemplateResult | typeof nothing {
    if (kind === 'border') {
      return nothing;
    }
    return html`
      <fieldset class="wide">
        <legend class="quiet small">Shape</legend>
        ${SHAPES.map(
          ([tool, name]) => html`
            <label class="choice">
              <input
                type="radio"
                name="shape"
                .checked=${tool === kind}
                @change=${() => this.editor.setTool(tool)}
              />${name}
            </label>
          `,
        )}
      </fieldset>
    `;
  }

  /** Cuts the damaged edges of the chosen holes back, so that they are mended from sound cloth. */
  private cutEdges(): TemplateResult | typeof nothing {
    const { scan, chosen, work } = this.editor;
    const loops = (scan?.loops ?? []).filter(isHole).map((loop) => loop.id ?? 0);
    const holes = loops.filter((id) => chosen.has(id));
    if (holes.length === 0) {
      return nothing;
    }
    const cut = (): void => void this.editor.make('Cut edges back', { cut: { loops: holes } });
    return html`
      <div class="row wide">
        <button type="button" ?disabled=${work !== undefined} @click=${cut}>Cut the edges of chosen holes back</button>
      </div>
    `;
  }

  private borderFields(draft: BorderDraft): TemplateResult {
    const { from, to, along, facing } = draft;
    const middle = [0, 1, 2].map((axis) => ((from[axis] as number) + (to[axis] as number)) / 2) as Vec3;
    const add = (): void => this.preview({ ...draft, along: [...along, along.at(-1) ?? middle] });
    const remove = (index: number): void => this.preview({ ...draft, along: along.filter((_, at) => at !== index) });
    const others = facing ? ['Facing from', 'Facing to'] : along.map((_, at) => `Hem ${at + 1}`);
    const names = ['From', 'To', ...others];
    const fields = handlesOf(draft).map((point, at) =>
      this.vectorFields(names[at] as string, point, (moved) => withHandle(draft, at, moved)),
    );
    if (facing !== undefined) {
      return html`
        ${fields}
        <div class="row wide">
          <button type="button" @click=${() => this.preview(withoutFacing(draft))}>Without the facing edge</button>
        </div>
      `;
    }
    return html`
      ${fields}
      <div class="row wide">
        <button type="button" @click=${() => this.preview(withFacing(draft))}>Join with a facing edge</button>
        <button type="button" @click=${add}>Add a point of the hem</button>
        ${
          along.length > 0
            ? html`<button type="button" @click=${() => remove(along.length - 1)}>Remove the last point</button>`
            : nothing
        }
      </div>
    `;
  }

  private uvFields([u, v]: Uv, name: string, change: (uv: Uv) => Draft): TemplateResult[] {
    return [
      this.number(`${name}u`, u, (value) => change([value, v])),
      this.number(`${name}v`, v, (value) => change([u, value])),
    ];
  }

  private vectorFields(name: string, vector: Vec3, change: (vector: Vec3) => Draft): TemplateResult[] {
    return AXIS_NAMES.map((axis, index) =>
      this.number(`${name} ${axis}`, vector[index] as number, (value) => change(vector.with(index, value) as Vec3)),
    );
  }

  private number(name: string, value: number | undefined, change: (value: number) => Draft): TemplateResult {
    const changed = (event: Event): void => {
      const number = (event.target as HTMLInputElement).valueAsNumber;
      if (Number.isFinite(number)) {
        this.preview(change(number));
      }
    };
    return html`
      <label>
        ${name}
        <input
          type="number"
          step="any"
          placeholder="found"
          .value=${value === undefined ? '' : String(Number(value.toPrecision(6)))}
          @change=${changed}
        />
      </label>
    `;
  }

  private preview(draft: Draft): void {
    this.editor.preview(draft);
  }

  private apply(event: Event, draft: Draft): void {
    event.preventDefault();
    this.editor.preview(draft);
    void this.editor.commit();
  }
}

customElements.define('darn-tools', ToolsPanel);

/** Why no tool can be chosen. */
function noTools(patches: number): string {
  return patches === 0
    ? 'Mend a hole to edit its new cloth.'
    : 'The cloth around what is filled cannot be laid flat, so its new cloth takes no gestures.';
}
