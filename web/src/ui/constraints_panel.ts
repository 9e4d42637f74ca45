/** The constraints as JSON: to copy, to keep as a file, to load. */
import { scanBaseName } from '../model/scan_files.js';
import { type TemplateResult, html } from '../vendor.js';
import { download } from './download.js';
import { Panel } from './panel.js';

export class ConstraintsPanel extends Panel {
  protected override render(): TemplateResult {
    const { work } = this.editor;
    const busy = work !== undefined;
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
          <button ?disabled=${busy} @click=${this.load}>Load</button>
          <button @click=${this.save}>Save as a file</button>
          <button ?disabled=${busy} @click=${this.pick}>Load a file</button>
          <input type="file" accept=".json,application/json" hidden @change=${this.picked} />
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

  private readonly save = (): void => {
    const file = new Blob([this.field?.value ?? '', '\n'], { type: 'application/json' });
    download(file, `${scanBaseName(this.editor.scan?.name)}.constraints.json`);
  };

  private readonly pick = (): void => this.renderRoot.querySelector<HTMLInputElement>('input[type=file]')?.click();

  private readonly picked = async (event: Event): Promise<void> => {
    const input = event.target as HTMLInputElement;
    const text = await input.files?.[0]?.text();
    // So that the same file can be picked again.
    input.value = '';
    if (text !== undefined) {
      await this.editor.loadConstraints(text);
    }
  };
}

customElements.define('darn-constraints', ConstraintsPanel);
