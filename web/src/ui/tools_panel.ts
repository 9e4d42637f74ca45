/** The tools, and the gesture that is being made as numbers: all that a pointer can do can be typed here. */
import type { Uv, Vec3 } from '../client.js';
import {
  type AnchorDraft,
  type Draft,
  type DraftKind,
  type GrabDraft,
  type PinchDraft,
  NAMES,
  type TwistDraft,
  firstDraft,
} from '../model/draft.js';
import type { Tool } from '../model/editor.js';
import { type TemplateResult, css, html, nothing } from '../vendor.js';
import { Panel } from './panel.js';

/** The tools, with the key of each. */
export const TOOLS: readonly { tool: Tool; name: string; key: string; help: string }[] = [
  {
    tool: 'look',
    name: 'Look',
    key: 'L',
    help: 'Drag to turn the scan, right button or two fingers to move it, wheel to zoom.',
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
    help: 'Drag from the cloth to where it should be, or type the point; the service finds which place of the cloth belongs there.',
  },
];

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
      .check {
        display: flex;
        align-items: center;
        gap: 4px;
      }
    `,
  ].flat();

  protected override render(): TemplateResult {
    const { tool, step, editable } = this.editor;
    const help = TOOLS.find((it) => it.tool === tool)?.help ?? '';
    return html`
      <h2>Tools</h2>
      <div class="row tools" role="group" aria-label="Tools">
        ${TOOLS.map(
          (it) => html`
            <button
              aria-pressed=${it.tool === tool}
              aria-keyshortcuts=${it.key}
              title="${it.name} (${it.key})"
              ?disabled=${editable.length === 0 && it.tool !== 'look'}
              @click=${() => this.editor.setTool(it.tool)}
            >
              ${it.name}
            </button>
          `,
        )}
      </div>
      <p class="quiet small">${editable.length > 0 ? help : noTools(step.patches.length)}</p>
      ${tool === 'look' || editable.length === 0 ? nothing : this.form(this.draftOf(tool))}
    `;
  }

  /** The gesture that is being made, or one that changes nothing yet. */
  private draftOf(kind: DraftKind): Draft | undefined {
    const { draft, editable } = this.editor;
    const [patch] = editable;
    return draft?.kind === kind ? draft : patch && firstDraft(kind, patch);
  }

  private form(draft: Draft | undefined): TemplateResult | typeof nothing {
    if (draft === undefined) {
      return nothing;
    }
    const { work } = this.editor;
    const busy = work !== undefined;
    return html`
      <form @submit=${(event: Event) => this.apply(event, draft)}>
        ${this.holeField(draft)} ${this.fields(draft)}
        <div class="row wide">
          <button class="main" ?disabled=${busy}>${draft.kind === 'anchor' ? 'Find its place' : 'Apply'}</button>
          <button type="button" ?disabled=${this.editor.draft === undefined} @click=${() => this.editor.dropDraft()}>
            Cancel
          </button>
          ${
            draft.kind === 'anchor'
              ? html`<button type="button" ?disabled=${busy} @click=${() => this.editor.findAnchor(draft, true)}>
                  Draw the map
                </button>`
              : nothing
          }
        </div>
      </form>
    `;
  }

  private holeField(draft: Draft): TemplateResult | typeof nothing {
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
    }
  }

  private grabFields(draft: GrabDraft): TemplateResult {
    return html`
      ${this.uvFields(draft.uv, '', (uv) => ({ ...draft, uv }))}
      <span></span>
      ${this.vectorFields('Move', draft.offset, (offset) => ({ ...draft, offset }))}
    `;
  }

  private twistFields(draft: TwistDraft): TemplateResult {
    const degrees = (draft.angle * 180) / Math.PI;
    return html`
      ${this.uvFields(draft.uv, '', (uv) => ({ ...draft, uv }))}
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
      ${this.vectorFields('Point', draft.position, (position) => ({ ...draft, position }))}
      <label class="wide check">
        <input type="checkbox" .checked=${draft.hard} @change=${hard} />
        Hard: refuse it where the cloth cannot reach it
      </label>
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

  private number(name: string, value: number, change: (value: number) => Draft): TemplateResult {
    const changed = (event: Event): void => {
      const number = (event.target as HTMLInputElement).valueAsNumber;
      if (Number.isFinite(number)) {
        this.preview(change(number));
      }
    };
    return html`
      <label>
        ${name}
        <input type="number" step="any" .value=${String(Number(value.toPrecision(6)))} @change=${changed} />
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
