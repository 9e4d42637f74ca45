/** The list of boundary loops: which to fill, how long they are, why some are left as they are. */
import type { BorderCandidate, Loop } from '../client.js';
import type { MadeHole } from '../model/constraints.js';
import { bordering, isMade, madeBy } from '../model/draft.js';
import { byKind, isFillable, isHole, kindInWords, short, styleOf } from '../model/loops.js';
import { ACCEPT_DOUBTFUL, leftOpen, reasonInWords } from '../model/report.js';
import { type TemplateResult, css, html, nothing, svg } from '../vendor.js';
import './fill_stepper.js';
import { Panel } from './panel.js';
import './texture_choice.js';

/** The event `darn-frame` asks the picture to show the loop in `detail`. */
export class HolesPanel extends Panel {
  static override styles = [
    Panel.styles,
    css`
      ul {
        margin: 0 0 0.75rem;
        padding: 0;
        list-style: none;
        max-height: 18rem;
        overflow: auto;
      }
      li {
        display: grid;
        grid-template-columns: 28px 1fr auto;
        align-items: center;
        gap: 0 8px;
        min-height: 28px;
      }
      li button {
        border-color: transparent;
        background: none;
        text-align: left;
      }
      .doubtful {
        display: flex;
        align-items: center;
        gap: 4px;
        margin-bottom: 6px;
      }
      li.other {
        grid-template-columns: 1fr auto;
      }
      li.place {
        grid-template-columns: 1fr auto auto;
      }
      li .name {
        padding: 0 10px;
      }
      li button.own {
        border-color: var(--line);
        background: var(--surface);
      }
      .why {
        grid-column: 2 / -1;
        padding: 0 10px 4px;
      }
      svg {
        vertical-align: middle;
        margin-right: 6px;
      }
    `,
  ].flat();

  /** The last one that was clicked: shift-click chooses all from it on. */
  private lastClicked: number | undefined;

  protected override render(): TemplateResult {
    const { scan, chosen, work, step } = this.editor;
    const loops = scan?.loops ?? [];
    const holes = loops.filter(isHole).map((loop) => loop.id ?? 0);
    return html`
      <h2>Holes</h2>
      ${holes.length === 0 ? html`<p>${noHoles(loops, scan?.candidates ?? [])}</p>` : nothing}
      ${byKind(loops).map(([kind, members]) => this.group(kind, members))} ${this.candidates()} ${this.made()}
      ${this.doubtful()}
      <div class="row">
        <button
          class=${this.isNew ? 'main' : ''}
          id="mend"
          ?disabled=${chosen.size === 0 || work !== undefined}
          @click=${this.mend}
        >
          Mend ${chosen.size === 1 ? '1 hole' : `${chosen.size} holes`}
        </button>
        <button ?disabled=${holes.length === 0} @click=${() => this.editor.choose(new Set(holes))}>All</button>
        <button ?disabled=${chosen.size === 0} @click=${() => this.editor.choose(new Set())}>None</button>
      </div>
      ${
        step.patches.length === 0
          ? nothing
          : html`<darn-fill .editor=${this.editor}></darn-fill> <darn-texture .editor=${this.editor}></darn-texture>`
      }
    `;
  }

  /** Whether a mend would fill others than are filled now. */
  private get isNew(): boolean {
    const { chosen, step, scan, acceptDoubtful } = this.editor;
    const filled = step.holes.filter((id) => scan?.loops.some((loop) => loop.id === id));
    const isSame = chosen.size === filled.length && filled.every((id) => chosen.has(id));
    return !isSame || acceptDoubtful !== step.acceptDoubtful;
  }

  /** The choice to apply patches that were made and not applied, once there are such. */
  private doubtful(): TemplateResult | typeof nothing {
    const { skipped, acceptDoubtful, isRefusedAsDoubtful } = this.editor;
    if (!acceptDoubtful && !isRefusedAsDoubtful && !skipped.some(({ code }) => code === 'no_plausible_fill')) {
      return nothing;
    }
    const change = (event: Event): void => this.editor.setAcceptDoubtful((event.target as HTMLInputElement).checked);
    return html`
      <label class="doubtful">
        <input type="checkbox" .checked=${acceptDoubtful} @change=${change} />
        ${ACCEPT_DOUBTFUL}
      </label>
    `;
  }

  /** Bites, rips, torn corners and tears at the cloth's own edge; choosing one shows it in the border tool. */
  private candidates(): TemplateResult | typeof nothing {
    const candidates = this.editor.scan?.candidates ?? [];
    if (candidates.length === 0) {
      return nothing;
    }
    return html`
      <h3>Bites, rips and tears at the border (${candidates.length})</h3>
      <ul aria-label="Bites, rips and tears at the border">
        ${candidates.map((candidate, at) => this.candidate(candidate, at))}
      </ul>
    `;
  }

  private candidate(candidate: BorderCandidate, at: number): TemplateResult {
    const { step, work } = this.editor;
    const isTear = candidate.border?.facing !== undefined;
    const name = `${damage(candidate)} ${at + 1}`;
    const inward = isTear ? `${short(candidate.length)} long` : `${short(candidate.depth)} deep`;
    const mended = isMade(candidate, step.made);
    const draft = bordering(candidate);
    const show = (): void => {
      this.editor.setTool('border');
      this.editor.preview(draft);
    };
    const mend = (): void => void this.editor.make('Border', madeBy(draft));
    return html`
      <li class="place">
        <button ?disabled=${mended} @click=${show}>${name}${mended ? ' ✓ mended' : ''}</button>
        <span class="quiet small">${short(candidate.mouth)} wide · ${inward}</span>
        ${
          mended
            ? nothing
            : html`<button class="own" ?disabled=${work !== undefined} aria-label="Mend ${name}" @click=${mend}>
                Mend
              </button>`
        }
      </li>
    `;
  }

  /** What was cut out or mended at the border, and can be put back. */
  private made(): TemplateResult | typeof nothing {
    const { step, work } = this.editor;
    if (step.made.length === 0) {
      return nothing;
    }
    return html`
      <h3>Cut out and borders (${step.made.length})</h3>
      <ul aria-label="Cut out and borders">
        ${step.made.map(
          (entry, at) => html`
            <li class="other">
              <span class="name">${nameOf(entry)} ✓ mended</span>
              <button
                class="own"
                ?disabled=${work !== undefined}
                aria-label="Put back ${at + 1}: ${nameOf(entry)}"
                @click=${() => void this.editor.unmake(entry)}
              >
                Put back
              </button>
            </li>
          `,
        )}
      </ul>
    `;
  }

  private group(kind: string, members: readonly Loop[]): TemplateResult {
    const style = styleOf(kind);
    const dashes = { solid: '', dashed: '7 4', dotted: '2 4' }[style.line];
    const sample = svg`<svg width="30" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="30" y2="4" stroke=${style.color} stroke-width="3" stroke-dasharray=${dashes} />
    </svg>`;
    return html`
      <h3>${sample}${style.plural} (${members.length})</h3>
      <ul aria-label=${style.plural}>
        ${members.map((loop) => this.item(loop, members))}
      </ul>
    `;
  }

  private item(loop: Loop, group: readonly Loop[]): TemplateResult {
    const id = loop.id ?? 0;
    const { step, skipped, chosen } = this.editor;
    const filled = step.holes.includes(id);
    const skip = leftOpen(skipped).find((it) => it.id === id);
    const doubts = filled ? (this.editor.reportOf(id)?.doubts ?? []) : [];
    const name = `${styleOf(loop.kind ?? '').singular} ${id}`;
    return html`
      <li>
        ${
          isFillable(loop)
            ? html`<input
                type="checkbox"
                aria-label="Choose ${name}"
                .checked=${chosen.has(id)}
                @click=${(event: MouseEvent) => this.toggle(event, id, group)}
              />`
            : html`<span></span>`
        }
        <button @click=${() => this.frame(id)} aria-label="Show ${name}, length ${short(loop.length)}">
          ${name}${filled ? ' ✓ mended' : ''}
        </button>
        <span class="quiet small">${short(loop.length)} long · ${loop.vertices} vertices</span>
        ${sureness(loop)} ${skip ? html`<span class="why quiet small">${reasonInWords(skip)}</span>` : nothing}
        ${doubts.map((doubt) => html`<span class="why quiet small">Doubtful: ${doubt}.</span>`)}
      </li>
    `;
  }

  private toggle(event: MouseEvent, id: number, group: readonly Loop[]): void {
    const ids = group.map((loop) => loop.id ?? 0);
    const chosen = new Set(this.editor.chosen);
    const [from, to] = [ids.indexOf(this.lastClicked ?? id), ids.indexOf(id)];
    const range = event.shiftKey && from >= 0 ? ids.slice(Math.min(from, to), Math.max(from, to) + 1) : [id];
    const choose = (event.target as HTMLInputElement).checked;
    for (const each of range) {
      if (choose) {
        chosen.add(each);
      } else {
        chosen.delete(each);
      }
    }
    this.lastClicked = id;
    this.editor.choose(chosen);
  }

  private frame(id: number): void {
    this.dispatchEvent(new CustomEvent('darn-frame', { detail: id, bubbles: true, composed: true }));
  }

  private readonly mend = (): void => void this.editor.mend();
}

function nameOf(entry: MadeHole): string {
  if ('border' in entry) {
    const part = entry.border.facing ? 'Tear' : 'Part of the border';
    return entry.border.auto ? 'All bites, rips and torn corners' : part;
  }
  const { radius, loops, polygon } = entry.cut;
  if (radius !== undefined) {
    return `Ball of radius ${short(radius)}`;
  }
  return polygon !== undefined
    ? `Polygon of ${polygon.length} corners`
    : `Edge of ${(loops ?? []).map((loop) => `hole ${loop}`).join(', ')}`;
}

/** How sure the service is about a kind, and why, where it had to decide between a hole and an opening. */
function sureness({
  kind = 'LOOP_KIND_UNSPECIFIED',
  confidence = 0,
  evidence = [],
}: Loop): TemplateResult | typeof nothing {
  if (evidence.length === 0) {
    return nothing;
  }
  // Above 0 for an opening, below for a hole.
  const side = kind === 'HOLE' ? -1 : 1;
  const strongest = [...evidence].sort((a, b) => side * ((b.weight ?? 0) - (a.weight ?? 0)));
  const said = ({ weight = 0, reason }: (typeof evidence)[number]): string =>
    side * weight < 0 ? `But ${reason}` : `As ${reason}`;
  return html`
    <details class="why quiet small">
      <summary>${Math.round(confidence * 100)} % sure that it is ${kindInWords(kind)}</summary>
      ${strongest.map((each) => html`<p>${said(each)}</p>`)}
    </details>
  `;
}

/** What can be done with a scan without holes. */
/** What a place at the border suffered, for a person. */
function damage({ border }: BorderCandidate): string {
  if (border?.facing !== undefined) {
    return 'Tear';
  }
  return (border?.along ?? []).length > 0 ? 'Torn corner' : 'Bite or rip';
}

function noHoles(loops: readonly Loop[], candidates: readonly BorderCandidate[]): string {
  return [
    'This scan has no holes.',
    ...(loops.some(isFillable) ? ['An opening or an end of a sleeve is filled when you choose it.'] : []),
    ...(candidates.length > 0 ? ['What is bitten or torn at its border is listed below.'] : []),
  ].join(' ');
}

customElements.define('darn-holes', HolesPanel);
