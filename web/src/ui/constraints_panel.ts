/** The constraints as JSON: to copy, to keep, to load. */
import { type TemplateResult, html } from '../vendor.js';
import { Panel } from './panel.js';

export class ConstraintsPanel extends Panel {
  protected override render(): TemplateResult {
    const { work } = this.editor;
    return html`
      <details>
        <summary>Constraints as JSON</summary>
        <p class="quiet small">
          The part <code>constraints</code> of <code>POST /inpaint</code>, which gives the same bytes as “Save the
          scan”.
        </p>
        <textarea
          rows="10"
          spellcheck="false"
          aria-label="Constraints as JSON"
          .value=${this.editor.constraintsText()}
        ></textarea>
        <div class="row">
          <button @click=${this.copy}>Copy</button>
          <button ?disabled=${work !== undefined} @click=${this.load}>Load</button>
        </div>
      </details>
    `;
  }

  private get field(): HTMLTextAreaElement | null {
    return this.renderRoot.querySelector('textarea');
  }

  private readonly copy = async (): Promise<void> => {
    const text = this.field?.value ?? '';
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      // Pages without https have no clipboard.
      this.field?.select();
      document.execCommand('copy');
    }
    this.editor.say('Copied.');
  };

  private readonly load = (): void => void this.editor.loadConstraints(this.field?.value ?? '');
}

customElements.define('darn-constraints', ConstraintsPanel);
