/** How things are drawn, and the comparison with the scan as it was. */
import type { Look } from '../scene/viewer.js';
import { type TemplateResult, html } from '../vendor.js';
import { Panel } from './panel.js';

const SHADINGS = [
  ['textured', 'Textured'],
  ['shaded', 'Shaded'],
  ['wireframe', 'Wireframe'],
  ['stretch', 'Stretch'],
  ['curvature', 'Curvature'],
  ['confidence', 'Confidence'],
] as const;

/** The event `darn-look` carries what has changed of the look in `detail`. */
export class LookPanel extends Panel {
  static override properties = { shown: {} };

  /** What is drawn, as it was chosen here or elsewhere. */
  declare shown: Pick<Look, 'tinted' | 'outlined' | 'split'>;

  protected override render(): TemplateResult {
    return html`
      <h2>Look</h2>
      <fieldset>
        <legend class="quiet small">Surface</legend>
        <div class="row">
          ${SHADINGS.map(
            ([shading, name]) => html`
              <label class="choice">
                <input
                  type="radio"
                  name="shading"
                  ?checked=${shading === 'textured'}
                  @change=${() => this.look({ shading })}
                />${name}
              </label>
            `,
          )}
        </div>
      </fieldset>
      <div>${this.check('New cloth in its own colour', 'tinted')}</div>
      <div>${this.check('Outlines of holes and borders', 'outlined')}</div>
      <label>
        Before and after (hold B for before)
        <input
          type="range"
          min="0"
          max="1"
          step="0.01"
          .value=${String(this.shown.split)}
          @input=${(event: Event) => this.look({ split: Number((event.target as HTMLInputElement).value) })}
        />
      </label>
    `;
  }

  private check(name: string, part: 'tinted' | 'outlined'): TemplateResult {
    const changed = (event: Event): void => this.look({ [part]: (event.target as HTMLInputElement).checked });
    return html`<label class="choice"
      ><input type="checkbox" .checked=${this.shown[part]} @change=${changed} />${name}</label
    >`;
  }

  private look(detail: Partial<Look>): void {
    this.dispatchEvent(new CustomEvent('darn-look', { detail, bubbles: true, composed: true }));
  }
}

customElements.define('darn-look', LookPanel);
