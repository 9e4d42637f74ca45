/** What was done, in words. */
import { holeInWords, reportInWords } from '../model/report.js';
import { scanBaseName } from '../model/scan_files.js';
import { type TemplateResult, css, html, nothing } from '../vendor.js';
import { download } from './download.js';
import { Panel } from './panel.js';

export class ReportPanel extends Panel {
  static override styles = [
    Panel.styles,
    css`
      .hole {
        margin-bottom: 0.75rem;
      }
      .hole p {
        margin: 0;
      }
    `,
  ].flat();

  protected override render(): TemplateResult | typeof nothing {
    const { report } = this.editor.step;
    const notes = [...(this.editor.scan?.notes ?? []), ...(report?.notes ?? [])];
    if (report === undefined) {
      return notes.length === 0
        ? nothing
        : html`<h2>Notes</h2>
            ${notes.map((note) => html`<p>${note}</p>`)}`;
    }
    return html`
      <h2>Report</h2>
      <p>${reportInWords(report)}</p>
      ${[...new Set(notes)].map((note) => html`<p>${note}</p>`)}
      ${(report.holes ?? []).map(
        (hole) => html`<div class="hole">${holeInWords(hole).map((line) => html`<p>${line}</p>`)}</div>`,
      )}
      <button
        @click=${() => download(new Blob([JSON.stringify(report, undefined, 2)]), `${scanBaseName(this.editor.scan?.name)}.report.json`)}
      >
        Save the report
      </button>
    `;
  }
}

customElements.define('darn-report', ReportPanel);
