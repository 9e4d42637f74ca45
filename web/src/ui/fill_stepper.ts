/** Steps through the plausible fills of the mended holes. */
import { FILLS, fillName, onlyFillInWords } from '../model/fills.js';
import { type TemplateResult, css, html, nothing } from '../vendor.js';
import { Panel } from './panel.js';

export class FillStepper extends Panel {
  static override styles = [
    Panel.styles,
    css`
      :host {
        display: block;
        margin-top: 6px;
      }
      span {
        padding: 0 4px;
      }
      button {
        min-width: 28px;
      }
      button[aria-disabled='true'],
      button[aria-disabled='true']:hover:enabled {
        border-color: var(--line);
        color: var(--quiet);
        cursor: default;
        opacity: 0.65;
      }
      p {
        margin: 4px 0 0;
      }
    `,
  ].flat();

  protected override render(): TemplateResult {
    const { editor } = this;
    const { step, alternative, canVary } = editor;
    const only = onlyFillInWords(step.constraints.alternative, step.report);
    // At an end a button keeps the keyboard's focus, which one that is disabled would lose.
    const button = (sign: string, name: string, next: number): TemplateResult => html`
      <button
        aria-label=${name}
        ?disabled=${!canVary}
        aria-disabled=${next < 0 || next >= FILLS}
        @click=${() => void editor.chooseFill(next)}
      >
        ${sign}
      </button>
    `;
    return html`
      <div class="row" role="group" aria-label="Fills">
        ${button('‹', 'Previous fill', alternative - 1)}
        <span class=${canVary ? '' : 'quiet'}>${fillName(alternative)}</span>
        ${button('›', 'Next fill', alternative + 1)}
      </div>
      ${only === undefined ? nothing : html`<p class="small">${only}</p>`}
    `;
  }
}

customElements.define('darn-fill', FillStepper);
