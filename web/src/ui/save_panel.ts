/** What is saved, and how: the look of the new cloth in the file, and a picture. */
import { SAVED_LOOKS, type SavedLook } from '../model/saved_look.js';
import { type TemplateResult, html, nothing } from '../vendor.js';
import { Panel } from './panel.js';

/** The event `darn-saved-look` carries the look that was chosen in `detail`; `darn-picture` asks for the picture as a file. */
export class SavePanel extends Panel {
  static override properties = { look: {} };

  /** How the new cloth of a saved scan looks. */
  declare look: SavedLook;

  protected override render(): TemplateResult {
    return html`
      <h2>Save</h2>
      ${this.editor.step.holes.length > 0 ? this.looks() : nothing}
      <button @click=${() => this.tell('darn-picture')}>Save a picture</button>
    `;
  }

  private looks(): TemplateResult {
    return html`
      <fieldset>
        <legend class="quiet small">New cloth in the saved scan</legend>
        ${SAVED_LOOKS.map(
          ([look, , name]) => html`
            <label class="choice">
              <input
                type="radio"
                name="saved-look"
                .checked=${this.look === look}
                @change=${() => this.tell('darn-saved-look', look)}
              />${name}
            </label>
          `,
        )}
        <p class="quiet small">
          The file has both: viewers that let you choose a variant call them
          ${SAVED_LOOKS.map(([, variant], at) => html`${at > 0 ? ' and ' : ''}“${variant}”`)}.
        </p>
      </fieldset>
    `;
  }

  private tell(name: string, detail?: SavedLook): void {
    this.dispatchEvent(new CustomEvent(name, { detail, bubbles: true, composed: true }));
  }
}

customElements.define('darn-save', SavePanel);
